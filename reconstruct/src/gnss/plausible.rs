//! Can the logs be what they are taken for? Units, axes and signs that are wrong are read without complaint and reckoned
//! without complaint: what the two logs share, gravity, turns, ways and changes of speed, tells of them.
//!
//! Slopes are those of least absolute deviations, so a few wild fixes do not make one; their standard errors are those of a
//! median, by the median of the deviations.

use nalgebra::{Vector2, Vector3};
use schema::num::real;

use super::columns;
use super::drive::{Drive, Fixed};
use super::forward::FixUse;
use super::notes::median;
use super::rows::Motion;
use crate::frame::wrapped;

/// What a car at rest feels, m/s^2, and how far from it the drive's may be, share of it.
const GRAVITY: f64 = 9.81;
const GRAVITY_OFF: f64 = 0.1;
/// Gravity may be so far off the vertical axis, rad: a box that sits askew, a hill.
const TILT: f64 = 15.0 * std::f64::consts::PI / 180.0;
/// One column that stays the same so long while others change, and all of them, s.
const STUCK_S: [f64; 2] = [20.0, 2.0];
/// A slope is off if it is so far from 1, and by so many standard errors.
const TURN_OFF: f64 = 0.3;
const WAY_OFF: f64 = 0.2;
const PULL_OFF: f64 = 0.5;
const SIGMAS: f64 = 5.0;
/// Two fixes are held against each other over so many seconds; in between there is one each so many at least.
const SPAN_S: f64 = 3.0;
const STEP_S: f64 = 2.5;
/// Least speed of a fix whose course is used, and of a way, m/s.
const COURSE_SPEED: f64 = 5.0;
const WAY_SPEED: f64 = 3.0;
/// Least number of such pairs, and the least that the widest of them turns, rad, else nothing is told.
const PAIRS: usize = 10;
const WIDEST_TURN: f64 = 0.3;
/// Least change of speed, m/s, that one pair in ten has to have: on a hilly road without, the accelerometer feels the slopes.
const TENTH_PULL: f64 = 2.0;
/// So many corners, rad, tell that the rate does not follow the course: on a straight road this is noise.
const CORNERS: (usize, f64) = (3, 0.4);
/// The rate follows the course to this share at least: less, by so many standard errors, and it is another axis's.
const FOLLOWS: f64 = 0.5;
/// Share of the fixes within the drive that the filter may refuse, and the least number of fixes that makes a share.
const REFUSED: f64 = 0.2;
const OFFERED: u64 = 10;

/// A slope that ought to be 1, and its standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slope {
    /// The slope.
    pub value: f64,
    /// One sigma of it.
    pub se: f64,
}

impl Slope {
    /// Of `y` on `x` through the origin, by least absolute deviations; `None` where `x` is zero throughout.
    fn of(list: &[(f64, f64)]) -> Option<Self> {
        let mut ratios: Vec<(f64, f64)> = list
            .iter()
            .filter(|(x, _)| x.abs() > 0.0)
            .map(|(x, y)| (y / x, x.abs()))
            .collect();
        ratios.sort_by(|a, b| a.0.total_cmp(&b.0));
        let half = 0.5 * ratios.iter().map(|r| r.1).sum::<f64>();
        let mut sum = 0.0;
        let value = ratios
            .iter()
            .find(|r| {
                sum += r.1;
                sum >= half
            })?
            .0;
        let off = list.iter().map(|(x, y)| (y - value * x).abs()).collect();
        let square: f64 = list.iter().map(|(x, _)| x * x).sum();
        // Deviations of a normal law: 1.4826 of their median is one sigma, and a median is 1.2533 as unsure as a mean.
        let se = 1.2533 * 1.4826 * median(off)? / square.sqrt();
        (value.is_finite() && se.is_finite()).then_some(Self { value, se })
    }

    /// Is it farther from 1 than `by`, and than chance makes it?
    fn is_off(self, by: f64) -> bool {
        let off = (self.value - 1.0).abs();
        off > by && off > SIGMAS * self.se
    }

    /// As in a note: to the digits that its error leaves it.
    fn words(self) -> String {
        let digits = match self.value.abs() {
            v if v >= 100.0 => 0,
            v if v > 0.0 && v < 0.01 => 6,
            _ => 2,
        };
        format!("{:.digits$} \u{b1} {:.digits$}", self.value, self.se)
    }
}

/// What was found of the logs; `None` where they do not tell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Found {
    /// Median over the drive's seconds of the specific force, m/s^2.
    pub force: Option<f64>,
    /// Mean specific force off the upward axis, rad.
    pub tilt: Option<f64>,
    /// Change of the fixes' course by the rate about the vertical axis.
    pub turn: Option<Slope>,
    /// The rate about the vertical axis by the change of the fixes' course.
    pub turn_back: Option<Slope>,
    /// Way between fixes by what their velocities make.
    pub way: Option<Slope>,
    /// Change of the fixes' speed by the specific force along the forward axis.
    pub pull: Option<Slope>,
    /// Columns that stay the same, with the seconds they do from a stamp on, s.
    pub stuck: Vec<(&'static str, [f64; 2])>,
}

/// Looks at a drive with all its fixes, and at the rows that its periods are of, in order of time.
#[must_use]
pub fn look(drive: &Drive, rows: &[Motion]) -> Found {
    let seconds = seconds(drive);
    let sum: Vector3<f64> = seconds.iter().sum();
    let pairs = pairs(drive);
    let list = |f: fn(&Pair) -> Option<(f64, f64)>| pairs.iter().filter_map(f).collect::<Vec<_>>();
    let turns = centred(&list(|p| p.turn));
    let turned = turns.len() >= PAIRS && turns.iter().any(|t| t.1.abs() >= WIDEST_TURN);
    let pulls = centred(&list(|p| Some(p.pull)));
    let strong = pulls.iter().filter(|p| p.1.abs() >= TENTH_PULL).count();
    let pulled = pulls.len() >= PAIRS && 10 * strong >= pulls.len();
    let ways: Vec<(f64, f64)> = list(|p| p.way);
    let corners = turns.iter().filter(|t| t.1.abs() >= CORNERS.1).count();
    let turned_back: Vec<(f64, f64)> = turns.iter().map(|(x, y)| (*y, *x)).collect();
    Found {
        force: median(seconds.iter().map(Vector3::norm).collect()),
        tilt: (sum.norm() > 0.1 * real(seconds.len())).then(|| sum.xy().norm().atan2(-sum.z)),
        turn: turned.then(|| Slope::of(&turns)).flatten(),
        turn_back: (turned && corners >= CORNERS.0)
            .then(|| Slope::of(&turned_back))
            .flatten(),
        way: (ways.len() >= PAIRS).then(|| Slope::of(&ways)).flatten(),
        pull: pulled.then(|| Slope::of(&pulls)).flatten(),
        stuck: stuck(rows),
    }
}

/// What a factor near this one is known for; a road's slopes and noisy fixes leave it a quarter off.
fn known(value: f64, list: &[(f64, &'static str)]) -> String {
    let off = |k: f64| (value / k - 1.0).abs();
    let near = list.iter().min_by(|a, b| off(a.0).total_cmp(&off(b.0)));
    near.filter(|(k, _)| off(*k) < 0.25)
        .map_or_else(String::new, |(_, what)| format!(", as with {what}"))
}

impl Found {
    /// What there is to note, in words.
    #[must_use]
    pub fn notes(&self) -> Vec<String> {
        let mut out = Vec::new();
        let range = [1.0 - GRAVITY_OFF, 1.0 + GRAVITY_OFF].map(|k| k * GRAVITY);
        if let Some(force) = self.force.filter(|f| !(range[0]..=range[1]).contains(f)) {
            out.push(format!(
                "accelerations: expected a specific force of {:.1} to {:.1} m/s^2 over the drive, found {force:.3} m/s^2{}",
                range[0],
                range[1],
                known(force / GRAVITY, &[(0.009_806_65, "m/s^2 in place of milli-g"), (0.001, "g in place of milli-g")])
            ));
        }
        if let Some(tilt) = self.tilt.filter(|t| *t > TILT) {
            out.push(format!(
                "accelerations: expected gravity along the vertical axis of --axes, found it {:.0} degrees off",
                tilt.to_degrees()
            ));
        }
        for (column, [from, to]) in &self.stuck {
            out.push(format!(
                "motions: expected values that change, found {column} the same for {:.1} s from {from:.3} s on",
                to - from
            ));
        }
        out.extend(self.turn_note());
        if let Some(way) = self.way.filter(|s| s.is_off(WAY_OFF)) {
            out.push(format!(
                "fixes: expected them as far apart as their velocities say, found {} times that{}",
                way.words(),
                known(
                    way.value,
                    &[
                        (1.0 / 3.6, "velocities in km/h"),
                        (1852.0 / 3600.0, "velocities in knots"),
                        (0.447_04, "velocities in miles an hour"),
                    ]
                )
            ));
        }
        if let Some(pull) = self.pull.filter(|s| s.is_off(PULL_OFF)) {
            out.push(format!(
                "accelerations: expected the fixes' speed to change as the force along the forward axis says, found {} times that{}",
                pull.words(),
                known(pull.value, &[(-1.0, "the axis the wrong way round")])
            ));
        }
        out
    }

    fn turn_note(&self) -> Option<String> {
        let back = self.turn_back;
        let follows = back.is_none_or(|b| b.value + SIGMAS * b.se >= FOLLOWS);
        if follows && !self.turn.is_some_and(|t| t.is_off(TURN_OFF)) {
            return None;
        }
        let turn = self.turn.map_or_else(
            || "no turn of the sensor".to_owned(),
            |t| format!("{} times that", t.words()),
        );
        let hint = self.turn.map_or_else(String::new, |t| {
            known(
                t.value,
                &[
                    (-1.0, "the axis upside down"),
                    (1000.0, "degrees a second in place of millidegrees"),
                    (
                        1000.0_f64.to_degrees(),
                        "radians a second in place of millidegrees",
                    ),
                ],
            )
        });
        Some(format!(
            "rates: expected the fixes' course to turn as the rate about the vertical axis says, found {turn}{}{hint}",
            back.map_or_else(String::new, |b| format!(
                " (the rate by the course: {})",
                b.words()
            ))
        ))
    }

    /// The figures for a machine: the force in m/s^2, the tilt in degrees, slopes with one sigma; null where the logs do not
    /// tell.
    #[must_use]
    pub fn json(&self) -> serde_json::Value {
        let slope = |s: Option<Slope>| s.map(|s| [s.value, s.se]);
        serde_json::json!({
            "specific_force_mps2": self.force, "gravity_off_axis_deg": self.tilt.map(f64::to_degrees),
            "course_by_rate": slope(self.turn), "rate_by_course": slope(self.turn_back),
            "way_by_velocity": slope(self.way), "speed_by_force": slope(self.pull),
        })
    }
}

/// What there is to note of what the filter made of the fixes.
#[must_use]
pub fn refused(fixes: &FixUse) -> Vec<String> {
    let list = [
        ("positions", fixes.refused + fixes.forced),
        ("velocities", fixes.speeds_refused + fixes.speeds_forced),
    ];
    let share = |n: u64| schema::num::real_u64(n) / schema::num::real_u64(fixes.offered.max(1));
    list.iter()
        .filter(|(_, n)| fixes.offered >= OFFERED && share(*n) > REFUSED)
        .map(|(what, n)| {
            format!(
                "fixes: expected at most {:.0} % of the {what} not to fit the filter's state, found {n} of {} ({:.0} %)",
                100.0 * REFUSED,
                fixes.offered,
                100.0 * share(*n)
            )
        })
        .collect()
}

/// The same about their medians: a gyro's bias, a box that is not level.
fn centred(list: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let x = median(list.iter().map(|l| l.0).collect()).unwrap_or(0.0);
    let y = median(list.iter().map(|l| l.1).collect()).unwrap_or(0.0);
    list.iter().map(|l| (l.0 - x, l.1 - y)).collect()
}

/// Mean specific force of each second: what shakes is out of it.
fn seconds(drive: &Drive) -> Vec<Vector3<f64>> {
    let second = |t: f64| schema::num::floor_i64(t);
    drive
        .periods
        .chunk_by(|a, b| second(a.t_s) == second(b.t_s))
        .map(|list| list.iter().map(|p| p.accel).sum::<Vector3<f64>>() / real(list.len()))
        .collect()
}

/// Two fixes some seconds apart: what the sensors say of the time between, and what the fixes do.
struct Pair {
    turn: Option<(f64, f64)>,
    pull: (f64, f64),
    way: Option<(f64, f64)>,
}

/// Pairs that follow each other, each over [`SPAN_S`] or a little more, where fixes with velocity come often enough.
fn pairs(drive: &Drive) -> Vec<Pair> {
    let mut sums = vec![[0.0; 2]];
    let mut last = [0.0; 2];
    for p in &drive.periods {
        last = [last[0] + p.rate.z * p.dt, last[1] + p.accel.x * p.dt];
        sums.push(last);
    }
    let begin = drive
        .periods
        .first()
        .map_or(f64::INFINITY, |p| p.t_s - p.dt);
    let end = drive.periods.last().map_or(f64::NEG_INFINITY, |p| p.t_s);
    let moving: Vec<(&Fixed, Vector3<f64>)> = drive
        .fixes
        .iter()
        .filter(|f| f.t_s >= begin && f.t_s <= end)
        .filter_map(|f| Some((f, f.v_n?)))
        .collect();
    let sum = |t: f64| sums[drive.periods.partition_point(|p| p.t_s <= t)];
    let mut out = Vec::new();
    for run in moving.chunk_by(|a, b| b.0.t_s - a.0.t_s <= STEP_S) {
        let (mut from, mut by) = (0, Vector2::zeros());
        for to in 1..run.len() {
            let ((a, va), (b, vb)) = (run[to - 1], run[to]);
            by += (va + vb).xy() * (0.5 * (b.t_s - a.t_s));
            let (first, v_first) = run[from];
            if b.t_s - first.t_s < SPAN_S - 1e-3 {
                continue;
            }
            let (s0, s1) = (sum(first.t_s), sum(b.t_s));
            let [v0, v1] = [v_first, vb].map(|v| v.xy().norm());
            let course = |v: Vector3<f64>| v.y.atan2(v.x);
            let long = by.norm();
            out.push(Pair {
                turn: (v0 >= COURSE_SPEED && v1 >= COURSE_SPEED)
                    .then(|| (s1[0] - s0[0], wrapped(course(vb) - course(v_first)))),
                pull: (s1[1] - s0[1], v1 - v0),
                way: (long >= WAY_SPEED * (b.t_s - first.t_s))
                    .then(|| (long, first.place.to(&b.place).xy().dot(&by) / long)),
            });
            from = to;
            by = Vector2::zeros();
        }
    }
    out
}

/// Columns of the log that stay the same too long: one while others change, or all at once.
fn stuck(rows: &[Motion]) -> Vec<(&'static str, [f64; 2])> {
    let values = |m: &Motion| -> [u64; 6] {
        let [a, b, c] = m.accel.map(f64::to_bits);
        let [d, e, f] = m.rate.map(f64::to_bits);
        [a, b, c, d, e, f]
    };
    let span = |list: &[Motion]| {
        let [a, b] = [list.first(), list.last()].map(|m| m.map_or(0.0, |m| m.head.obu_s));
        [a, b]
    };
    let longest = |same: &dyn Fn(&Motion, &Motion) -> bool| {
        rows.chunk_by(same)
            .map(span)
            .max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])))
            .unwrap_or([0.0; 2])
    };
    let all = longest(&|a, b| values(a) == values(b));
    if all[1] - all[0] > STUCK_S[1] {
        return vec![("every column", all)];
    }
    (0..6)
        .map(|i| {
            (
                columns::MOTION[8 + i].name,
                longest(&|a, b| values(a)[i] == values(b)[i]),
            )
        })
        .filter(|(_, s)| s[1] - s[0] > STUCK_S[0])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{FixUse, Slope, refused};

    #[test]
    fn shares_of_refused_fixes() {
        let mut fixes = FixUse {
            offered: 100,
            used: 80,
            refused: 20,
            ..FixUse::default()
        };
        assert!(refused(&fixes).is_empty());
        fixes.speeds_refused = 21;
        assert!(
            refused(&fixes)[0].contains("velocities") && refused(&fixes)[0].contains("21 of 100")
        );
        fixes.offered = 9;
        assert!(refused(&fixes).is_empty());
    }

    #[test]
    fn slopes() {
        let line: Vec<(f64, f64)> = (1..40)
            .map(|i| (f64::from(i), 2.0 * f64::from(i)))
            .collect();
        let slope = Slope::of(&line).unwrap();
        assert!((slope.value - 2.0).abs() < 1e-12 && slope.is_off(0.3));
        assert!(Slope::of(&[(0.0, 1.0)]).is_none() && Slope::of(&[]).is_none());
    }
}
