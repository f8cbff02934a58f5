//! Every instant of a drive from all of its data: the sweep of [`crate::smooth::rts`] over a forward pass.

use super::drive::{Drive, ReckonError};
use super::forward::{Estimate, Passed, Runner, Start, Stretch, estimate};
use super::sheet::Sheet;
use crate::error_model::STATES;
use crate::refined::states::{BG, Row};
use crate::smooth::rts::Adjoint;

/// Periods of which the sweep holds all at once, some 13 kB each; four minutes at 50 Hz. Of a longer drive the forward pass is run
/// again from where it stood before each such stretch, from the last to the first: a day of driving costs the time of two
/// forward passes and not 18 GB.
const HELD: usize = 12_000;

/// Runs the filter from `start` to the end of the drive ([`super::forward::run`]) and back: the pass, and the smoothed states,
/// in order of time, one each period of the pass.
///
/// # Errors
/// Those of [`super::forward::run`].
pub fn run(
    drive: &Drive,
    standing: &[bool],
    sheet: &Sheet,
    start: &Start,
) -> Result<(Passed, Vec<Estimate>), ReckonError> {
    by_stretches(drive, standing, sheet, start, HELD)
}

fn by_stretches(
    drive: &Drive,
    standing: &[bool],
    sheet: &Sheet,
    start: &Start,
    held: usize,
) -> Result<(Passed, Vec<Estimate>), ReckonError> {
    let mut runner = Runner::new(drive, standing, sheet, start)?;
    let count = drive.periods.len() - start.first;
    let stretch = |number: usize| {
        let from = start.first + number * held;
        from..(from + held).min(drive.periods.len())
    };
    let mut estimates = Vec::with_capacity(count);
    let stretches = count.div_ceil(held);
    let mut marks = Vec::with_capacity(stretches);
    let mut taken = Stretch::empty();
    for number in 0..stretches {
        marks.push(runner.clone());
        let last = number + 1 == stretches;
        for k in stretch(number) {
            estimates.push(runner.epoch(k, last.then_some(&mut taken))?);
        }
    }
    let passed = runner.passed(estimates);
    let mut out = passed.estimates.clone();
    let mut adjoint = Adjoint::last();
    while let Some(mut runner) = marks.pop() {
        let list = stretch(marks.len());
        if marks.len() + 1 < stretches {
            taken = Stretch::empty();
            for k in list.clone() {
                runner.epoch(k, Some(&mut taken))?;
            }
        }
        for (i, k) in list.enumerate().rev() {
            let out = &mut out[k - start.first];
            *out = smoothed(&taken, i, &adjoint, out, sheet.mounting[0]);
            adjoint.retreat(&taken.tape, i);
        }
    }
    Ok((passed, out))
}

/// Step `i` of a stretch from all data.
fn smoothed(
    taken: &Stretch,
    i: usize,
    adjoint: &Adjoint,
    filtered: &Estimate,
    mounting_roll: f64,
) -> Estimate {
    let step = &taken.tape.steps[i];
    let nominal = adjoint.nominal(&step.nominal, &step.p);
    let p = adjoint.covariance::<STATES>(&step.p);
    let bias = [0, 1, 2].map(|axis| {
        let mut row = Row::zeros();
        row[BG + axis] = 1.0;
        adjoint.variance(&step.p, &row)
    });
    Estimate {
        standing: filtered.standing,
        fixed: filtered.fixed,
        ..estimate(
            filtered.t_s,
            &taken.anchors[i],
            &nominal,
            &p,
            bias,
            mounting_roll,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gnss::experiments::drive;
    use crate::gnss::trial::standing;
    use crate::simulate::city::{self, BoxSheet};

    #[test]
    fn in_stretches_it_is_the_same_to_the_last_bit() {
        let sheet = BoxSheet::default();
        let city = city::drive(3, 60.0, &sheet).unwrap();
        let whole = drive(&city, &sheet).unwrap();
        let still = standing(&whole);
        let start = Start::at_first_course(&whole, &still).unwrap();
        let run = |held| by_stretches(&whole, &still, &Sheet::default(), &start, held).unwrap();
        let at_once = run(usize::MAX / 2).1;
        for held in [1, 700, at_once.len()] {
            let (passed, parts) = run(held);
            assert_eq!(parts.len(), whole.periods.len() - start.first);
            assert_eq!(passed.estimates.len(), parts.len());
            assert!(parts == at_once, "{held} at once");
        }
    }
}
