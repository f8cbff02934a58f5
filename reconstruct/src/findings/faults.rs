//! What was wrong with the sensors, as the refined model found it: sentences for the limits of the result.
//!
//! Each is a statement about this record with the figures behind it; none of them is needed for the bounds to hold, and
//! none takes a sensor's word for its own fault.

use nalgebra::{Matrix2, Vector2};

use crate::epochs::Epochs;
use crate::motion::Motion;
use crate::refined::Refined;
use crate::refined::states::{MOUNT_PITCH, MOUNT_YAW, TRACK, WHEEL_LEFT, WHEEL_RIGHT};

/// A wheel below this share of its speed over ground is locked, and for how long it must be, s.
const LOCKED_SHARE: f64 = 0.3;
const LOCKED_S: f64 = 0.15;
/// Speed over ground above which that can be told, m/s.
const LOCKED_SPEED: f64 = 4.0;
/// Deceleration below which a wheel that stands has no reason to, m/s^2.
const ROLLING: f64 = -1.0;
/// Share of a wheel's values refused that is worth a word.
const REFUSED_SHARE: f64 = 0.15;
/// Calibration beyond so many sigmas of the data sheet is worth a word.
const BEYOND_SHEET: f64 = 2.2;
/// Yaw rate from which a turn tells the track width, rad/s.
const TURNING: f64 = 0.03;
/// Turning frames needed for it.
const TURNING_FRAMES: f64 = 60.0;

const SIDES: [&str; 2] = ["left", "right"];

/// The sentences.
#[must_use]
pub fn sentences(refined: &Refined, epochs: &Epochs, motion: &Motion) -> Vec<String> {
    let mut out = Vec::new();
    smoothed(refined, &mut out);
    limits_reached(refined, epochs, &mut out);
    wheels(refined, epochs, motion, &mut out);
    track(refined, epochs, motion, &mut out);
    mounting(refined, epochs, &mut out);
    wheel_scale(refined, epochs, &mut out);
    out
}

/// Which smoother answered, where it is not the plain sweep.
fn smoothed(refined: &Refined, out: &mut Vec<String>) {
    if let Some(why) = &refined.unsettled {
        out.push(format!(
            "The refined model's states could not be solved all at once, which this record needs ({why}): its bounds may \
             be too narrow; take no figure of it as proof without those of the other models."
        ));
    }
}

fn limits_reached(refined: &Refined, epochs: &Epochs, out: &mut Vec<String>) {
    let inputs = &refined.passed.inputs;
    let imu = &epochs.header.imu;
    let rate_s = inputs.clipped_s[3..].iter().fold(0.0_f64, |a, b| a.max(*b));
    if rate_s > 0.0 {
        let range = imu
            .rate_range
            .map_or(String::new(), |r| format!(" ({:.0} deg/s)", r.to_degrees()));
        out.push(format!(
            "A gyro stood at its limit{range} for {rate_s:.2} s: how far the car turned meanwhile is drawn from the way \
             the turning died away, and heading and place before that are unsure by it."
        ));
    }
}

/// A wheel's speed over ground at the end of epoch `k`, m/s.
fn over_ground(refined: &Refined, epochs: &Epochs, motion: &Motion, k: usize, side: usize) -> f64 {
    let nav = &refined.snapshots[k].nav;
    let arm = 0.5 * epochs.header.vehicle.track_width_m * if side == 0 { 1.0 } else { -1.0 };
    nav.c_nb.m.column(0).dot(&nav.v_n.v) + motion.rate[k].z * arm
}

fn wheels(refined: &Refined, epochs: &Epochs, motion: &Motion, out: &mut Vec<String>) {
    let list = &epochs.list;
    let end = motion
        .impacts
        .first()
        .map_or(list.len(), |pulse| pulse.before);
    let cutoff = epochs.header.wheels.cutoff_mps;
    let mut locked: Vec<String> = Vec::new();
    for (side, name) in SIDES.iter().enumerate() {
        let period = schema::num::real_u64(epochs.header.periods.wheels_ns[side]) * 1e-9;
        let period = if period > 0.0 { period } else { 0.02 };
        let (mut braked, mut rolling) = (0.0, 0.0);
        let mut from = f64::INFINITY;
        for (k, epoch) in list[..end].iter().enumerate() {
            let Some(speed) = epoch.wheels[side] else {
                continue;
            };
            let ground = over_ground(refined, epochs, motion, k, side);
            if ground < LOCKED_SPEED.max(3.0 * cutoff) || speed > LOCKED_SHARE * ground {
                continue;
            }
            if motion.smooth[k].x < ROLLING || motion.wheels_bad[k] {
                braked += period;
                from = from.min(epoch.t_s);
            } else {
                rolling += period;
            }
        }
        if braked >= LOCKED_S {
            locked.push(format!(
                "the {name} wheel for {braked:.2} s, first at {from:.2} s"
            ));
        }
        if rolling >= LOCKED_S {
            out.push(format!(
                "The {name} wheel's sensor read nothing for {rolling:.2} s while the car rolled: it was not believed there."));
        }
        let offered = refined.passed.offered[side];
        let share = schema::num::real_u64(refined.passed.refused[side])
            / schema::num::real_u64(offered.max(1));
        if offered > 100 && share > REFUSED_SHARE {
            out.push(format!(
                "{:.0} % of the {} wheel's values disagree with the other sensors and were not believed.",
                share * 100.0,
                name
            ));
        }
    }
    if !locked.is_empty() {
        out.push(format!(
            "Before the impact a wheel locked: {}. The speed there rests on the accelerometers.",
            locked.join("; ")
        ));
    }
}

/// The track width that the difference of the wheels in turns asks for, by least squares on
/// `left - right = track * rate + difference * speed`.
fn track(refined: &Refined, epochs: &Epochs, motion: &Motion, out: &mut Vec<String>) {
    let list = &epochs.list;
    let end = motion
        .impacts
        .first()
        .map_or(list.len(), |pulse| pulse.before);
    let configured = epochs.header.vehicle.track_width_m;
    let mut n = 0.0;
    let mut turning = 0.0;
    let mut normal = Matrix2::<f64>::zeros();
    let mut right = Vector2::<f64>::zeros();
    let mut square = 0.0;
    for (k, epoch) in list[..end].iter().enumerate() {
        let [Some(a), Some(b)] = epoch.wheels else {
            continue;
        };
        let nav = &refined.snapshots[k].nav;
        let speed = nav.c_nb.m.column(0).dot(&nav.v_n.v);
        if motion.wheels_bad[k] || speed < LOCKED_SPEED {
            continue;
        }
        let rate = motion.rate[k].z;
        let row = Vector2::new(rate, speed);
        normal += row * row.transpose();
        right += row * (a - b);
        square += (a - b) * (a - b);
        n += 1.0;
        turning += f64::from(u8::from(rate.abs() > TURNING));
    }
    let Some(inverse) = normal.try_inverse().filter(|_| turning > TURNING_FRAMES) else {
        return;
    };
    let fit = inverse * right;
    let noise = ((square - fit.dot(&right)) / f64::max(n - 2.0, 1.0)).max(0.0);
    // Neighbouring frames share their error: twice the spread of independent ones, and the gyro's own scale.
    let scale = epochs.header.imu.rate_scale * fit.x;
    let sd = (4.0 * noise * inverse[(0, 0)] + scale * scale + (1e-3 * configured).powi(2)).sqrt();
    let off = fit.x / configured - 1.0;
    let beside = refined.before.0.value(TRACK);
    if off.abs() > 2.0 * sd / configured && off.abs() > 0.02 && off.signum() * beside > 0.005 {
        out.push(format!(
            "The configured track width of {configured:.2} m does not fit the wheels and the gyro in turns: they ask for \
             {:.2} m (one sigma {sd:.2} m).",
            fit.x
        ));
    }
}

fn mounting(refined: &Refined, epochs: &Epochs, out: &mut Vec<String>) {
    let (nominal, p) = &refined.before;
    for (state, axis, name) in [(MOUNT_YAW, 2, "vertical"), (MOUNT_PITCH, 1, "lateral")] {
        let stated = epochs.header.imu.mounting_sd[axis];
        let found = nominal.value(state);
        let sd = p[(state, state)].max(0.0).sqrt();
        if found.abs() > BEYOND_SHEET * stated && found.abs() > 3.0 * sd {
            out.push(format!(
                "The IMU's mounting is off by {:.1} degrees about the {name} axis (one sigma {:.1}); the configuration \
                 states one sigma of {:.1}. It is taken out.",
                found.to_degrees(),
                sd.to_degrees(),
                stated.to_degrees()
            ));
        }
    }
}

fn wheel_scale(refined: &Refined, epochs: &Epochs, out: &mut Vec<String>) {
    let (nominal, p) = &refined.before;
    let sheet = &epochs.header.wheels;
    let stated = sheet.scale_sd.hypot(0.5 * sheet.scale_difference_sd);
    for (state, side) in [(WHEEL_LEFT, SIDES[0]), (WHEEL_RIGHT, SIDES[1])] {
        let found = nominal.value(state);
        let sd = p[(state, state)].max(0.0).sqrt();
        if stated > 0.0 && found.abs() > 3.0 * stated && found.abs() > 3.0 * sd {
            out.push(format!(
                "The {side} wheel reads {:.1} % {} (one sigma {:.1} %), beyond the stated {:.1} %: another tyre size?",
                found.abs() * 100.0,
                if found > 0.0 { "high" } else { "low" },
                sd * 100.0,
                stated * 100.0
            ));
        }
    }
}
