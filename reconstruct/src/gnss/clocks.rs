//! Do logs run on one clock? What the stamps and the speeds that two receivers give tell of it.

use super::drive::Fixed;
use super::reference::{Mark, Reference};
use super::rows::{Fix, Head, Motion, Row};

/// Delays farther from the one that was told are noted, s, where they scatter less than this from fix to fix.
const DELAY_OFF_S: f64 = 0.3;
const SCATTER_S: f64 = 0.1;
/// Rows with both stamps, in either log, that tell of a delay.
const STAMPED: usize = 10;
/// Shifts of the reference that are tried, s, and their steps: all, then about the best.
const SHIFT_S: f64 = 60.0;
const STEPS_S: [f64; 2] = [0.25, 0.05];
/// A smaller shift is a receiver's own delay, s.
const SHIFT_OFF_S: f64 = 0.5;
/// A shift is one if it takes the mean difference of the speeds to this share, and so much off it, m/s.
const SHARE: f64 = 0.7;
const GAIN_MPS: f64 = 0.2;
/// Least number of speeds that are compared, and the most.
const COMPARED: [usize; 2] = [20, 1000];
/// Marks farther apart are not joined, s.
const JOINED_S: f64 = 2.5;

/// A log's stamps: on-board, and how far it is behind GPS time, s.
fn stamps<'a>(heads: impl Iterator<Item = &'a Head>) -> Vec<(f64, f64)> {
    heads
        .filter_map(|h| {
            let week = 604_800.0 * f64::from(h.week.unwrap_or(0));
            Some((h.obu_s, h.obu_s - week - h.tow_s?))
        })
        .collect()
}

/// Delay of the fixes behind the inertial samples by the stamps of both logs, s: where GPS time is that of the fix and of the
/// sample, the on-board stamps differ by it. The median, and the span in which eight fixes of ten lie; `None` where the stamps
/// are not there or do not run with GPS time.
#[must_use]
pub fn delay(fixes: &[Fix], motions: &[Motion]) -> Option<(f64, [f64; 2])> {
    let there = stamps(motions.iter().map(Row::head));
    // Both clocks drift alike: each fix beside the sample of its moment.
    let mut list: Vec<f64> = stamps(fixes.iter().map(Row::head))
        .iter()
        .filter_map(|(t_s, late)| {
            let beside = there.get(there.partition_point(|m| m.0 < *t_s))?;
            (beside.0 - t_s < 1.0).then_some(late - beside.1)
        })
        .collect();
    if list.len() < STAMPED {
        return None;
    }
    // From one fix to the next, so that a clock that was set once does not count as scatter.
    let jitter = list.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    let scatter = super::notes::median(jitter)?;
    list.sort_by(f64::total_cmp);
    let [low, middle, high] = [1, 5, 9].map(|tenths| list[(list.len() - 1) * tenths / 10]);
    (scatter < SCATTER_S).then_some((middle, [low, high]))
}

/// What there is to note of a delay that the stamps tell, beside the one that was told, s.
#[must_use]
pub fn delay_note(fixes: &[Fix], motions: &[Motion], latency_s: f64) -> Option<String> {
    let (found, [low, high]) = delay(fixes, motions)?;
    // Stamps of another day or of a counter of their own are no delay.
    let off = (found - latency_s).abs() > DELAY_OFF_S || high - low > DELAY_OFF_S;
    let span = if high - low > DELAY_OFF_S {
        format!("{low:.2} to {high:.2} s")
    } else {
        format!("{found:.2} s")
    };
    (off && found.abs() < SHIFT_S).then(|| {
        format!(
            "fixes: expected them {latency_s:.2} s behind the inertial samples (--latency), found the on-board stamps {span} behind GPS time as the inertial samples have it"
        )
    })
}

/// What there is to note of a reference beside the fixes, `None` where they agree or there is nothing to compare.
#[must_use]
pub fn reference_note(fixes: &[Fixed], reference: &Reference) -> Option<String> {
    let spans = [
        [fixes.first()?.t_s, fixes.last()?.t_s],
        [reference.marks.first()?.t_s, reference.marks.last()?.t_s],
    ];
    let apart = spans[0][0] > spans[1][1] || spans[1][0] > spans[0][1];
    let shift = shift(fixes, reference);
    let by = shift.map_or_else(String::new, |s| {
        format!("; the speeds of both agree with the reference {s:+.2} s of its stamps away")
    });
    if apart {
        return Some(format!(
            "reference: expected one on the box's clock, found fixes from {:.1} to {:.1} s and the reference from {:.1} to {:.1} s{by}",
            spans[0][0], spans[0][1], spans[1][0], spans[1][1]
        ));
    }
    let s = shift.filter(|s| s.abs() >= SHIFT_OFF_S)?;
    Some(format!(
        "reference: expected its speeds to agree with those of the fixes at the same instants, found them to agree {:.2} s {}: another clock, or another delay of the fixes than --latency",
        s.abs(),
        if s > 0.0 { "later" } else { "earlier" }
    ))
}

/// How much later the reference has the speeds of the fixes, s, as far as it does; `None` where no shift is much better than
/// none.
fn shift(fixes: &[Fixed], reference: &Reference) -> Option<f64> {
    let speeds: Vec<(f64, f64)> = fixes
        .iter()
        .filter_map(|f| Some((f.t_s, f.v_n?.xy().norm())))
        .collect();
    let thin = speeds.len().div_ceil(COMPARED[1]).max(1);
    let speeds: Vec<(f64, f64)> = speeds.into_iter().step_by(thin).collect();
    let marks: Vec<(f64, f64)> = reference
        .marks
        .iter()
        .filter_map(|m: &Mark| Some((m.t_s, m.speed?)))
        .collect();
    let least = COMPARED[0].max(speeds.len() / 2);
    let differ = |shift: f64| {
        let (mut sum, mut n) = (0.0, 0);
        for (t, v) in &speeds {
            if let Some(there) = speed_at(&marks, t + shift) {
                sum += (there - v).abs();
                n += 1;
            }
        }
        (n >= least).then(|| sum / f64::from(u32::try_from(n).unwrap_or(u32::MAX)))
    };
    let best = |from: f64, to: f64, step: f64| {
        let n = schema::num::round_usize((to - from) / step);
        (0..=n)
            .map(|i| from + step * schema::num::real(i))
            .filter_map(|s| Some((s, differ(s)?)))
            .min_by(|a, b| a.1.total_cmp(&b.1))
    };
    let (near, _) = best(-SHIFT_S, SHIFT_S, STEPS_S[0])?;
    let (found, off) = best(near - STEPS_S[0], near + STEPS_S[0], STEPS_S[1])?;
    let at_none = differ(0.0).unwrap_or(f64::INFINITY);
    (off < SHARE * at_none && at_none - off > GAIN_MPS).then_some(found)
}

/// Speed between two marks that are near each other, m/s.
fn speed_at(marks: &[(f64, f64)], t_s: f64) -> Option<f64> {
    let i = marks.partition_point(|m| m.0 <= t_s);
    let (a, b) = (marks.get(i.checked_sub(1)?)?, marks.get(i)?);
    let h = b.0 - a.0;
    (h <= JOINED_S).then(|| a.1 + (b.1 - a.1) * (t_s - a.0) / h)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gnss::logs::{self, Axes};
    use crate::gnss::sheet::Sheet;
    use crate::simulate::city::{self, BoxSheet};

    #[test]
    fn delays_and_shifts_are_found() {
        let sheet = BoxSheet::default();
        let city = city::drive(4, 200.0, &sheet).unwrap();
        let (fixes, motions, rows) = logs::rows(&city, &sheet, &Axes::Car);
        let found = delay(&fixes, &motions).unwrap();
        assert!((found.0 - sheet.latency_s).abs() < 1e-3, "{found:?}");
        assert!(delay_note(&fixes, &motions, 1.24).is_none());
        assert!(
            delay_note(&fixes, &motions, 0.2)
                .unwrap()
                .contains("1.24 s behind")
        );
        // A clock that was set in the middle.
        let mut set = fixes.clone();
        set[100..].iter_mut().for_each(|f| f.head.obu_s += 1.0);
        let note = delay_note(&set, &motions, 1.24).unwrap();
        assert!(note.contains("1.24 to 2.24 s behind"), "{note}");
        let bare: Vec<Fix> = fixes
            .iter()
            .map(|f| Fix {
                head: Head {
                    tow_s: None,
                    ..f.head
                },
                ..*f
            })
            .collect();
        assert!(delay_note(&bare, &motions, 0.2).is_none());
        let fixed = logs::fixes(&fixes, sheet.latency_s, &Sheet::default());
        let drive = logs::drive(&motions, &Axes::Car, fixed, Vec::new()).unwrap();
        let reference = Reference::of_rows(&rows);
        assert_eq!(reference_note(&drive.fixes, &reference), None);
        for by in [-30.0, -1.5, 1.0, 2.0, 30.0] {
            let mut moved = reference.clone();
            moved.marks.iter_mut().for_each(|m| m.t_s += by);
            let found = shift(&drive.fixes, &moved).unwrap_or(f64::NAN);
            assert!((found - by).abs() < 0.25, "{by} {found}");
            assert!(
                reference_note(&drive.fixes, &moved)
                    .unwrap()
                    .contains("another clock")
            );
        }
        let mut moved = reference.clone();
        moved.marks.iter_mut().for_each(|m| m.t_s += 5000.0);
        let note = reference_note(&drive.fixes, &moved).unwrap();
        assert!(note.contains("expected one on the box's clock"), "{note}");
        assert_eq!(reference_note(&drive.fixes, &Reference::default()), None);
    }
}
