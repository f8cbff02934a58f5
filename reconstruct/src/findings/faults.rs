//! What was wrong with the sensors, as the refined model found it: sentences for the limits of the result.
//!
//! Each is a statement about this record with the figures behind it; none of them is needed for the bounds to hold, and
//! none takes a sensor's word for its own fault.

use nalgebra::{Matrix2, Vector2};

use crate::epochs::Epochs;
use crate::export::fixed::fixed;
use crate::motion::Motion;
use crate::refined::Refined;
use crate::refined::states::{MOUNT_PITCH, MOUNT_YAW, WHEEL_LEFT, WHEEL_RIGHT};
use crate::road::RoadLimits;

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
/// Frames of both wheels needed to look at the track width, and sigmas beyond which it is doubted.
const TRACK_FRAMES: f64 = 300.0;
const BEYOND_TRACK: f64 = 2.1;
/// Share of the spread of the wheels' differences that is noise to the track width.
const STEPS_SHARE: f64 = 0.71;
/// Way over which a lean of the car tells of its mounting, m.
const LEAN_WAY_M: f64 = 300.0;

const SIDES: [&str; 2] = ["left", "right"];

/// The sentences.
#[must_use]
pub fn sentences(
    refined: &Refined,
    epochs: &Epochs,
    motion: &Motion,
    road: Option<&RoadLimits>,
) -> Vec<String> {
    let mut out = Vec::new();
    smoothed(refined, &mut out);
    limits_reached(refined, epochs, &mut out);
    wheels(refined, epochs, motion, &mut out);
    track(refined, epochs, motion, &mut out);
    mounting(refined, epochs, motion, road, &mut out);
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
/// `left - right = track * rate + difference * speed`, the difference within the sheet.
///
/// A drive that turns little tells it badly: over 60 simulated approaches one sigma was 3 % in the median, so that 5 % are
/// found in two of three of them, and in 2 of 60 a right width is doubted.
fn track(refined: &Refined, epochs: &Epochs, motion: &Motion, out: &mut Vec<String>) {
    let list = &epochs.list;
    let end = motion
        .impacts
        .first()
        .map_or(list.len(), |pulse| pulse.before);
    let configured = epochs.header.vehicle.track_width_m;
    let (mut n, mut square) = (0.0, 0.0);
    let mut normal = Matrix2::<f64>::zeros();
    let mut right = Vector2::<f64>::zeros();
    for (k, epoch) in list[..end].iter().enumerate() {
        let [Some(a), Some(b)] = epoch.wheels else {
            continue;
        };
        let nav = &refined.snapshots[k].nav;
        let speed = nav.c_nb.m.column(0).dot(&nav.v_n.v);
        if motion.wheels_bad[k] || speed < LOCKED_SPEED {
            continue;
        }
        // A wheel's reading is a mean over its own time; the gyro's shakes less in one of its own.
        let near = &motion.rate[k.saturating_sub(2)..(k + 3).min(list.len())];
        let rate = near.iter().map(|w| w.z).sum::<f64>() / schema::num::real(near.len());
        let row = Vector2::new(rate, speed);
        normal += row * row.transpose();
        right += row * (a - b);
        square += (a - b) * (a - b);
        n += 1.0;
    }
    let Some(free) = normal.try_inverse().filter(|_| n > TRACK_FRAMES) else {
        return;
    };
    let noise = ((square - (free * right).dot(&right)) / f64::max(n - 2.0, 1.0)).max(0.0);
    let difference = epochs.header.wheels.scale_difference_sd.max(1e-6);
    normal[(1, 1)] += noise / (difference * difference);
    let Some(inverse) = normal.try_inverse() else {
        return;
    };
    let fit = inverse * right;
    let scale = epochs.header.imu.rate_scale * fit.x;
    // Steps of the wheels' readings are no noise of their own: the spread found is 0.7 of what they make it.
    let sd = (STEPS_SHARE.powi(2) * noise * inverse[(0, 0)] + scale * scale).sqrt();
    let off = fit.x / configured - 1.0;
    if off.abs() > BEYOND_TRACK * sd / configured && off.abs() > 0.02 {
        out.push(format!(
            "The configured track width of {configured:.2} m hardly fits the wheels and the gyro in turns: they ask for \
             {:.2} m (one sigma {sd:.2} m). The bounds allow for it.",
            fit.x
        ));
    }
}

fn mounting(
    refined: &Refined,
    epochs: &Epochs,
    motion: &Motion,
    road: Option<&RoadLimits>,
    out: &mut Vec<String>,
) {
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
    let Some(road) = road else { return };
    let end = motion
        .impacts
        .first()
        .map_or(epochs.list.len(), |pulse| pulse.before);
    let (mut way, mut sum) = (0.0, 0.0);
    for (epoch, snapshot) in epochs.list[..end].iter().zip(&refined.snapshots) {
        let step = snapshot.nav.v_n.v.norm() * epoch.dt;
        way += step;
        sum += step * snapshot.nav.c_nb.euler().0.to_degrees();
    }
    if way < LEAN_WAY_M {
        return;
    }
    // About the longitudinal axis the mounting cannot be told from the road: both lean the car for good.
    let (lean, stated) = (sum / way, epochs.header.imu.mounting_sd[0].to_degrees());
    let off = lean - road.roll_mean_deg;
    if off.abs() > BEYOND_SHEET * stated {
        out.push(format!(
            "By the sensors the car leaned {} degrees on average over {way:.0} m before the impact, {} from a road's usual \
             {}: the road (one sigma {:.1}), or the IMU is mounted off about the longitudinal axis by more than the \
             stated one sigma of {stated:.1}. Look at the mounting.",
            fixed(lean, 1),
            fixed(off.abs(), 1),
            fixed(road.roll_mean_deg, 1),
            road.roll_mean_sd_deg
        ));
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
