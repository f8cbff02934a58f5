//! The answer: where the path lies on the earth, what became of each fix, and the clock.

use nalgebra::{Matrix2, Matrix3, Matrix3x2, Vector2};
use schema::gnss::GnssSource;

use super::Anchor;
use super::fixes::{Clock, Heard, Left};
use crate::export::compass;
use crate::findings::{Figure, Reconstruction, RestPose};
use crate::refined::Refined;
use crate::refined::states::{LAG, PLACE, TURN};
use crate::stats::two_sided_quantile;
use crate::trajectory::State;

/// Pose of the path on the earth, from all fixes and the path together.
#[derive(Clone, Debug, PartialEq)]
pub struct Pose {
    /// The pose; its sds are the largest per axis.
    pub rest: RestPose,
    /// Covariance of north, east (m) and heading (rad).
    pub covariance: Matrix3<f64>,
    /// What it shares with the path, one entry a state: rows north, east, heading of the pose; columns north, east (axes of
    /// the path) and heading of the state; estimate less truth.
    pub shared: Vec<Matrix3<f64>>,
    /// Delay of the fixes beside what they are said to have, s, and its sd.
    pub lag_s: [f64; 2],
    /// Turn and place about the rough pose that the pass was linear about, rad and m.
    pub moved: [f64; 2],
}

/// A fix against the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residual {
    /// Its number in the record.
    pub number: usize,
    /// Instant it holds for, seconds from the first trigger.
    pub t_s: f64,
    /// Its place, north and east of the rest, m.
    pub place: [f64; 2],
    /// Fix less path, north and east, m.
    pub off: [f64; 2],
    /// It was used.
    pub used: bool,
}

/// What became of a record's fixes.
#[derive(Clone, Debug, PartialEq)]
pub struct Anchored {
    /// Where the fixes came from.
    pub source: GnssSource,
    /// Fixes of the record.
    pub offered: usize,
    /// Fixes used.
    pub used: usize,
    /// The others by number.
    pub left: Vec<(usize, Left)>,
    /// Spread of the fixes over what is said of them, 1 or more.
    pub scale: f64,
    /// The pose; `None`: see `why`.
    pub pose: Option<Pose>,
    /// Why there is no pose.
    pub why: Option<String>,
    /// Fixes against the path, after [`lay`].
    pub residuals: Vec<Residual>,
    /// Latitude and longitude, degrees, and instant of each usable fix.
    pub usable: Vec<(usize, f64, [f64; 2])>,
    /// Clock of the fixes.
    pub clock: Option<Clock>,
    /// Clock of the fixes less the recorder's, s, and its sd.
    pub clock_off_s: Option<[f64; 2]>,
    /// UTC is that of the fixes.
    pub clock_used: bool,
    /// The place of the antenna was given.
    pub antenna_known: bool,
    /// IMU to antenna, body axes, m: forward and right.
    pub lever: [f64; 2],
}

impl Anchored {
    /// Before anything is laid.
    #[must_use]
    pub fn new(heard: &Heard, source: GnssSource) -> Self {
        Self {
            source,
            offered: heard.offered,
            used: 0,
            left: heard.left.clone(),
            scale: 1.0,
            pose: None,
            why: None,
            residuals: Vec::new(),
            usable: heard
                .fixes
                .iter()
                .map(|f| (f.number, f.t_s, f.degrees))
                .collect(),
            clock: heard.clock,
            clock_off_s: None,
            clock_used: false,
            antenna_known: heard.antenna_known,
            lever: [heard.lever.x, heard.lever.y],
        }
    }

    /// Why fixes were left out, and how many for each reason.
    #[must_use]
    pub fn reasons(&self) -> Vec<(&'static str, usize)> {
        let count = |why: Left| self.left.iter().filter(|(_, left)| *left == why).count();
        Left::ALL
            .into_iter()
            .map(|why| (why.name(), count(why)))
            .filter(|(_, count)| *count > 0)
            .collect()
    }
}

/// The pose that the refined model found. The states of the pose are constants: those of the first epoch hold for all.
#[must_use]
pub fn pose(refined: &Refined, anchor: &Anchor, range: std::ops::Range<usize>) -> Pose {
    let (nominal, p) = &refined.before;
    let offset = Vector2::new(nominal.value(PLACE), nominal.value(PLACE + 1));
    let turn = nominal.value(TURN);
    let (s, c) = anchor.heading.sin_cos();
    let out = Matrix2::new(c, -s, s, c);
    let mut axes = Matrix3::identity();
    axes.fixed_view_mut::<2, 2>(0, 0).copy_from(&out);
    let states = [PLACE, PLACE + 1, TURN];
    let own = Matrix3::from_fn(|r, c| p[(states[r], states[c])]);
    let covariance = axes * own * axes.transpose();
    let place = out * offset;
    let [longitude_deg, latitude_deg] = anchor.plane.lon_lat(place.x, place.y);
    // Truth less estimate against estimate less truth, and an angle about down that takes from the heading.
    let shared = refined
        .shared
        .get(range)
        .unwrap_or(&[])
        .iter()
        .map(|m| {
            let mut m = axes * m;
            m.column_mut(0).neg_mut();
            m.column_mut(1).neg_mut();
            m
        })
        .collect();
    let level = covariance.fixed_view::<2, 2>(0, 0).symmetric_eigenvalues();
    Pose {
        rest: RestPose {
            latitude_deg,
            longitude_deg,
            heading_deg: (anchor.heading + turn).to_degrees().rem_euclid(360.0),
            sd_m: level.max().max(0.0).sqrt(),
            sd_deg: covariance[(2, 2)].max(0.0).sqrt().to_degrees(),
        },
        covariance,
        shared,
        lag_s: [nominal.value(LAG), p[(LAG, LAG)].max(0.0).sqrt()],
        moved: [turn, offset.norm()],
    }
}

/// A state's place and its covariance in the axes of the path.
#[must_use]
pub(crate) fn own(state: &State) -> (Vector2<f64>, Matrix2<f64>) {
    let c = state.cov_north_east;
    (
        Vector2::new(state.position[0], state.position[1]),
        Matrix2::new(state.sd_north.powi(2), c, c, state.sd_east.powi(2)),
    )
}

/// Covariance of a state's place relative to the rest in axes of true north, and what it has beside on the earth: from that
/// of the pose (north, east, heading), and from what both share (axes of the path). `heading` is that of the pose.
pub(crate) fn on_earth(
    state: &mut State,
    (place, own): &(Vector2<f64>, Matrix2<f64>),
    heading: f64,
    covariance: &Matrix3<f64>,
    shared: &Matrix3x2<f64>,
) {
    let (s, c) = heading.sin_cos();
    let rotation = Matrix2::new(c, -s, s, c);
    let slope = Matrix2::new(-s, -c, c, -s);
    let shared = shared * rotation.transpose();
    let lever = slope * place;
    let own = rotation * own * rotation.transpose();
    // Estimate less truth: d(place) + lever d(heading) + R e, with d and e against each other.
    let turned = lever * shared.row(2);
    let relative =
        own + lever * lever.transpose() * covariance[(2, 2)] - turned - turned.transpose();
    let with_turn = covariance.fixed_view::<2, 1>(0, 2) * lever.transpose();
    let moved = shared.fixed_view::<2, 2>(0, 0);
    let earth = covariance.fixed_view::<2, 2>(0, 0) + with_turn + with_turn.transpose()
        - moved
        - moved.transpose();
    state.sd_north = relative[(0, 0)].max(0.0).sqrt();
    state.sd_east = relative[(1, 1)].max(0.0).sqrt();
    state.cov_north_east = relative[(0, 1)];
    state.on_earth = Some([earth[(0, 0)], earth[(1, 1)], earth[(0, 1)]]);
}

/// Turns a reconstruction with a pose from fixes to true north, the doubt of pose and path together.
pub fn lay(r: &mut Reconstruction) {
    let Some((pose, usable, lever)) = r.gnss.as_ref().and_then(|gnss| {
        let pose = gnss.pose.clone()?;
        Some((pose, gnss.usable.clone(), gnss.lever))
    }) else {
        return;
    };
    let before: Vec<(Vector2<f64>, Matrix2<f64>, f64)> = r
        .states
        .iter()
        .map(|s| {
            let (place, covariance) = own(s);
            (place, covariance, s.sd_heading)
        })
        .collect();
    r.rest_pose = Some(pose.rest);
    compass::to_true_north(r);
    let heading = pose.rest.heading_deg.to_radians();
    for ((state, (place, covariance, sd)), shared) in
        r.states.iter_mut().zip(&before).zip(&pose.shared)
    {
        // The sign of what is shared is the other way round than that of a fit to a map.
        let with_path = -shared.fixed_view::<3, 2>(0, 0).into_owned();
        on_earth(
            state,
            &(*place, *covariance),
            heading,
            &pose.covariance,
            &with_path,
        );
        let variance = sd * sd + pose.covariance[(2, 2)] + 2.0 * shared[(2, 2)];
        state.sd_heading = variance.max(0.0).sqrt();
    }
    figures(r);
    let plane = crate::export::geodesy::TangentPlane::at(&pose.rest);
    let left: Vec<usize> = r
        .gnss
        .iter()
        .flat_map(|g| g.left.iter().map(|(number, _)| *number))
        .collect();
    let residuals = usable
        .iter()
        .filter_map(|(number, t_s, degrees)| {
            let state = at(&r.states, *t_s - pose.lag_s[0])?;
            let (s, c) = state.heading.sin_cos();
            let place = plane.north_east(degrees[0], degrees[1]);
            let antenna = [
                state.position[0] + c * lever[0] - s * lever[1],
                state.position[1] + s * lever[0] + c * lever[1],
            ];
            Some(Residual {
                number: *number,
                t_s: *t_s,
                place,
                off: [place[0] - antenna[0], place[1] - antenna[1]],
                used: !left.contains(number),
            })
        })
        .collect();
    if let Some(gnss) = &mut r.gnss {
        gnss.residuals = residuals;
    }
}

/// The state at a time; the last one behind it, none more than 50 ms before the first.
fn at(states: &[State], t_s: f64) -> Option<&State> {
    let first = states.first()?;
    if t_s < first.t_s - 0.05 {
        return None;
    }
    let k = states.partition_point(|s| s.t_s < t_s);
    states.get(k).or_else(|| states.last())
}

/// Figures that [`compass`] turned as if pose and path had nothing to do with each other, from the states.
fn figures(r: &mut Reconstruction) {
    let quantile = two_sided_quantile(r.confidence);
    let states = &r.states;
    let place = |t: f64, north: &mut Figure, east: &mut Figure, cross: &mut f64| {
        let Some(state) = at(states, t).filter(|_| open(north) && open(east)) else {
            return;
        };
        *north = Figure::new(north.value, state.sd_north, quantile);
        *east = Figure::new(east.value, state.sd_east, quantile);
        *cross = state.cov_north_east;
    };
    let heading = |t: f64, figure: &mut Figure| {
        if let Some(state) = at(states, t).filter(|_| open(figure)) {
            *figure = Figure::new(figure.value, state.sd_heading.to_degrees(), quantile);
        }
    };
    for impact in &mut r.impacts {
        let t = impact.t_s.value;
        heading(t, &mut impact.heading_deg);
        place(
            t,
            &mut impact.north_m,
            &mut impact.east_m,
            &mut impact.cov_north_east_m2,
        );
    }
    for row in &mut r.details.reaction.rows {
        heading(row.t_s, &mut row.heading_deg);
        place(
            row.t_s,
            &mut row.north_m,
            &mut row.east_m,
            &mut row.cov_north_east_m2,
        );
    }
}

/// A figure whose bounds can be told.
fn open(figure: &Figure) -> bool {
    figure.low.is_finite() && figure.high.is_finite()
}
