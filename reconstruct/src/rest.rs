//! Rest: the car stands still, and the backward pass may start from velocity zero.
//!
//! Rest is found, not assumed [S00, 3.5]: quiet accelerometers and gyros over one second, wheels that do not
//! turn, a specific force as large as gravity.

use nalgebra::Vector3;
use schema::num::real;

use crate::epochs::{Epoch, Epochs};
use crate::frame::{Body, Nav, Rot};

/// Bound on the sum of the two level accelerations' variances over one second, (m/s^2)^2 [S00, 3.5 and 4.3],
/// where no wheel confirms the rest.
const ACCEL_VARIANCE: f64 = 0.048;
/// Bound on the variance along gravity, (m/s^2)^2: an idling engine shakes a car up and down most
/// [S00, table 4.5].
const ACCEL_Z_VARIANCE: f64 = 0.15;
/// Bound on the variance of each acceleration where the wheels stand still, (m/s^2)^2: an idling engine shook
/// a loosely mounted sensor by 0.65 m/s^2 in a car that stood (measured).
const IDLING_VARIANCE: f64 = 1.0;
/// Bound on the variance of each rate, (rad/s)^2: (1.5 deg/s)^2.
const RATE_VARIANCE: f64 = 6.85e-4;
/// Engines shake at 10 Hz and more, driving at 5 Hz and less: bound on the spread of means over a quarter of
/// a second, m/s^2 and rad/s.
const ACCEL_SLOW: f64 = 0.12;
const RATE_SLOW: f64 = 0.006;
/// A rest window's means may differ by this much from the final ones, m/s^2 and rad/s.
const ACCEL_DRIFT: f64 = 0.15;
const RATE_DRIFT: f64 = 0.007;
/// Length of the window, s.
const WINDOW_S: f64 = 1.0;
/// The springs still rock when the wheels stand: the first second of a rest (at most this share of it) is not
/// used for levelling, and the backward pass starts behind it.
const SETTLE_S: f64 = 1.2;
const SETTLE_SHARE: f64 = 0.35;

/// The final rest of a record.
#[derive(Clone, Debug, PartialEq)]
pub struct RestInterval {
    /// First and one-past-last epoch of the rest, in recording order; empty if there is none.
    pub range: std::ops::Range<usize>,
    /// First epoch of its settled part, whose means are given below.
    pub settled: usize,
    /// Length of the settled part, s.
    pub settled_s: f64,
    /// Length, s.
    pub duration_s: f64,
    /// Mean specific force over it, m/s^2.
    pub accel: Vector3<f64>,
    /// Mean rate over it, rad/s: the gyro bias.
    pub rate: Vector3<f64>,
    /// Why it is or is not believed.
    pub reason: String,
}

impl RestInterval {
    /// True if the record ends at rest.
    #[must_use]
    pub fn found(&self) -> bool {
        !self.range.is_empty()
    }
}

struct Means {
    accel: Vector3<f64>,
    rate: Vector3<f64>,
}

/// Finds the final rest.
#[must_use]
pub fn find(epochs: &Epochs, gravity: f64) -> RestInterval {
    let list = &epochs.list;
    let none = |reason: String| RestInterval {
        range: 0..0,
        settled: 0,
        settled_s: 0.0,
        duration_s: 0.0,
        accel: Vector3::zeros(),
        rate: Vector3::zeros(),
        reason,
    };
    // Missing samples at the very end say nothing: the rest ends where the sensors were last heard.
    let Some(end) = list
        .iter()
        .rposition(|e| e.measured == [true; 6])
        .map(|k| k + 1)
    else {
        return none("no sample carries acceleration and rate".to_owned());
    };
    let Some(start) = window_start(list, end) else {
        return none("the record is shorter than one second".to_owned());
    };
    let last = match quiet(epochs, &list[start..end], gravity) {
        Ok(means) => means,
        Err(reason) => return none(format!("the record ends moving: {reason}")),
    };
    let mut from = start;
    let mut window_end = end;
    while from > 0 {
        window_end -= 1;
        let Some(start) = window_start(list, window_end) else {
            break;
        };
        let Ok(means) = quiet(epochs, &list[start..window_end], gravity) else {
            break;
        };
        if (means.accel - last.accel).amax() > ACCEL_DRIFT
            || (means.rate - last.rate).amax() > RATE_DRIFT
        {
            break;
        }
        from = start;
    }
    let rest = &list[from..end];
    let duration_s = rest.iter().map(|e| e.dt).sum();
    let wheels = rest.iter().any(|e| e.wheels.iter().any(Option::is_some));
    let skip = SETTLE_S.min(SETTLE_SHARE * duration_s);
    let settled = from + list[from..end].partition_point(|e| e.t_s < list[from].t_s + skip);
    let means = means(&list[settled..end]);
    RestInterval {
        range: from..end,
        settled,
        settled_s: duration_s - skip,
        duration_s,
        accel: means.accel,
        rate: means.rate,
        reason: if wheels {
            format!(
                "{duration_s:.1} s of quiet accelerometers and gyros with wheels that do not turn"
            )
        } else {
            format!(
                "{duration_s:.1} s of quiet accelerometers and gyros; no wheel speed confirms it"
            )
        },
    }
}

/// A stand before the final rest, at lights for example: quiet sensors and wheels that were heard and did not turn.
#[derive(Clone, Debug, PartialEq)]
pub struct Stand {
    /// Its epochs in recording order, the rocking at both ends left out.
    pub range: std::ops::Range<usize>,
    /// Length, s.
    pub seconds: f64,
    /// Mean specific force, m/s^2.
    pub accel: Vector3<f64>,
    /// Mean rate, rad/s.
    pub rate: Vector3<f64>,
}

/// Step between the windows in which a stand is looked for, s.
const STAND_STEP_S: f64 = 0.1;
/// Left out at both ends of a stand, s.
const STAND_TRIM_S: f64 = 0.4;
/// Shortest stand, s.
const STAND_S: f64 = 0.5;

/// Every stand before epoch `end`, in order of time.
#[must_use]
pub fn stands(epochs: &Epochs, gravity: f64, end: usize) -> Vec<Stand> {
    let list = &epochs.list[..end.min(epochs.list.len())];
    let mut quiet_runs: Vec<(usize, usize)> = Vec::new();
    let mut next_t = f64::NEG_INFINITY;
    for window_end in 1..=list.len() {
        if list[window_end - 1].t_s < next_t {
            continue;
        }
        next_t = list[window_end - 1].t_s + STAND_STEP_S;
        let Some(start) = window_start(list, window_end) else {
            continue;
        };
        let window = &list[start..window_end];
        let heard = window.iter().any(|e| e.wheels.iter().any(Option::is_some));
        // A car that rolls to its stop is quiet too. Its wheels show it, also below the speed from which they are
        // right: a reading of more than one step is no stand.
        let step = epochs.header.wheel_scale.step;
        let rolls = window
            .iter()
            .flat_map(|e| e.wheels)
            .flatten()
            .any(|speed| speed > 1.01 * step);
        if !heard || rolls || quiet(epochs, window, gravity).is_err() {
            continue;
        }
        match quiet_runs.last_mut() {
            Some(run) if start <= run.1 => run.1 = window_end,
            _ => quiet_runs.push((start, window_end)),
        }
    }
    quiet_runs
        .into_iter()
        .filter_map(|(from, to)| {
            let start = list[from].t_s + STAND_TRIM_S;
            let stop = list[to - 1].t_s - STAND_TRIM_S;
            let from = list.partition_point(|e| e.t_s < start);
            let to = list.partition_point(|e| e.t_s <= stop);
            let run = list.get(from..to)?;
            let seconds: f64 = run.iter().map(|e| e.dt).sum();
            let means = means(run);
            (seconds >= STAND_S).then_some(Stand {
                range: from..to,
                seconds,
                accel: means.accel,
                rate: means.rate,
            })
        })
        .collect()
}

fn window_start(list: &[Epoch], end: usize) -> Option<usize> {
    let mut length = 0.0;
    for k in (0..end).rev() {
        length += list[k].dt;
        if length > WINDOW_S - 0.005 {
            return Some(k);
        }
    }
    None
}

fn means(window: &[Epoch]) -> Means {
    let mut accel = Vector3::zeros();
    let mut rate = Vector3::zeros();
    let mut n = 0.0;
    for e in window.iter().filter(|e| e.measured == [true; 6]) {
        accel += e.accel;
        rate += e.rate;
        n += 1.0;
    }
    let n = f64::max(n, 1.0);
    Means {
        accel: accel / n,
        rate: rate / n,
    }
}

/// The means of a quiet window, or the reason why it is not quiet.
fn quiet(epochs: &Epochs, window: &[Epoch], gravity: f64) -> Result<Means, String> {
    let imu = &epochs.header.imu;
    let whole = window.iter().filter(|e| e.measured == [true; 6]).count();
    if real(whole) < 0.5 * real(window.len()) {
        return Err("half of its last second is missing".to_owned());
    }
    let cutoff = epochs.header.wheels.cutoff_mps.max(0.1);
    let turning = window
        .iter()
        .flat_map(|e| e.wheels)
        .flatten()
        .fold(0.0, f64::max);
    if turning > cutoff {
        return Err(format!("a wheel turns at {:.1} km/h", turning * 3.6));
    }
    let m = means(window);
    let mut var_a = Vector3::<f64>::zeros();
    let mut var_w = Vector3::<f64>::zeros();
    for e in window.iter().filter(|e| e.measured == [true; 6]) {
        var_a += (e.accel - m.accel).map(|x| x * x);
        var_w += (e.rate - m.rate).map(|x| x * x);
    }
    let n = real(whole.max(1));
    (var_a, var_w) = (var_a / n, var_w / n);
    // Down is wherever gravity points: an upside-down or lying car is at rest too.
    let down = m.accel.abs().imax();
    let level = var_a.sum() - var_a[down];
    let heard = window.iter().any(|e| e.wheels.iter().any(Option::is_some));
    let loud = if heard {
        var_a.amax() > IDLING_VARIANCE
    } else {
        level > ACCEL_VARIANCE || var_a[down] > ACCEL_Z_VARIANCE
    };
    if loud {
        return Err(format!(
            "accelerations vary by {:.2} m/s^2",
            var_a.sum().sqrt()
        ));
    }
    if var_w.amax() > RATE_VARIANCE {
        return Err(format!(
            "rates vary by {:.2} deg/s",
            var_w.amax().sqrt().to_degrees()
        ));
    }
    for quarter in window.chunks(window.len().div_ceil(4)) {
        let slow = means(quarter);
        // A quarter of a second holds few turns of a slow idle: a third of what shakes may be left in its mean.
        let drifts =
            |x: f64, variance: f64, bound: f64| x.abs() > bound.max(0.33 * variance.sqrt());
        let accel = slow.accel - m.accel;
        let rate = slow.rate - m.rate;
        if (0..3)
            .any(|i| drifts(accel[i], var_a[i], ACCEL_SLOW) || drifts(rate[i], var_w[i], RATE_SLOW))
        {
            return Err("accelerations or rates drift within its last second".to_owned());
        }
    }
    let bias = 3.0 * imu.rate_bias + 0.5_f64.to_radians();
    if m.rate.norm() > bias.max(1.5_f64.to_radians()) {
        return Err(format!(
            "the car turns at {:.1} deg/s",
            m.rate.norm().to_degrees()
        ));
    }
    let allowed = 0.4 + 4.0 * imu.accel_bias + 4.0 * imu.accel_scale * gravity;
    if (m.accel.norm() - gravity).abs() > allowed {
        return Err(format!(
            "the specific force is {:.2} m/s^2, not gravity",
            m.accel.norm()
        ));
    }
    Ok(m)
}

/// Attitude from the mean specific force at rest, heading zero: the third row of C is the direction of
/// gravity seen by the body [S00, 2.6 in another form, valid for every attitude].
///
/// The body x axis points north; a car that stands on its nose or tail takes its z axis instead.
#[must_use]
pub fn level(accel: &Vector3<f64>) -> Rot<Nav, Body> {
    let down = -accel / accel.norm();
    let forward = Vector3::x() - down * down.x;
    let forward = if forward.norm() > 0.05 {
        forward
    } else {
        Vector3::z() - down * down.z
    };
    let north = forward / forward.norm();
    let east = down.cross(&north);
    Rot::from_matrix(nalgebra::Matrix3::from_rows(&[
        north.transpose(),
        east.transpose(),
        down.transpose(),
    ]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levelling_finds_any_attitude() {
        for (roll, pitch) in [
            (0.0, 0.0),
            (0.1, -0.2),
            (3.1, 0.05),
            (-1.5, 0.3),
            (0.2, 1.4),
        ] {
            let truth = Rot::<Nav, Body>::from_euler(roll, pitch, 0.0);
            let accel = truth.m.transpose() * Vector3::new(0.0, 0.0, -9.81);
            let found = level(&accel).euler();
            assert!((found.0 - roll).abs() < 1e-9, "{roll} {pitch}: {found:?}");
            assert!((found.1 - pitch).abs() < 1e-9);
            assert!(found.2.abs() < 1e-9);
        }
    }
}
