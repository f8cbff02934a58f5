//! When a lost frame may be bridged.
//!
//! The mean of its neighbours stands in for one lost frame of a driving car. In a pulse it is off by as much as an eighth
//! of them (one lost frame of 100 Hz hid 0.3 m/s of a change of 14), and a sample made so looks like any other. There the
//! bin is missing, which a reader sees and bounds.

/// Largest specific force beside a bridged frame, m/s^2.
const FORCE: f64 = 30.0;
/// Largest step over it, m/s^2 and rad/s.
const STEP: [f64; 2] = [10.0, 0.5];
/// A frame shorter than this share of a bin is bridged in any case: the others of the bin hold it.
const SHORT: f64 = 0.5;

/// True if a frame of `share` of a bin, lost between two values of an axis (0 to 2 specific force, m/s^2; 3 to 5 rate,
/// rad/s), may be bridged by their mean. Not finite: not measured there, which hides nothing.
#[must_use]
pub fn bridges(share: f64, axis: usize, before: f64, after: f64) -> bool {
    if share < SHORT || !before.is_finite() || !after.is_finite() {
        return true;
    }
    let step = (after - before).abs();
    if axis < 3 {
        step <= STEP[0] && before.abs().max(after.abs()) <= FORCE
    } else {
        step <= STEP[1]
    }
}

#[cfg(test)]
mod tests {
    use super::bridges;

    #[test]
    fn driving_is_bridged_and_a_pulse_is_not() {
        assert!(bridges(1.0, 0, -8.0, -1.0) && bridges(1.0, 2, -9.8, -12.0));
        assert!(!bridges(1.0, 0, -111.0, -318.0) && !bridges(1.0, 1, 300.0, 301.0));
        assert!(bridges(0.1, 0, -111.0, -318.0));
        assert!(bridges(1.0, 5, 0.2, 0.6) && !bridges(1.0, 5, 0.2, 0.8));
        assert!(bridges(1.0, 0, f64::NAN, -318.0));
    }
}
