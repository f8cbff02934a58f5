//! The program's loop [S00, 6.5]: synchronisation, latency, fixes, stops, updates.
#![allow(
    non_snake_case,
    reason = "matrices keep the names they have in the literature"
)]

use std::f64::consts::TAU;

use nalgebra::{Matrix3, Vector3};
use schema::num::real;

use super::chains::Chains;
use super::constants::{DT, GATE, Noise, Process, STOP_WINDOW};
use super::dense::Dense;
use super::earth::{Earth, ecef_to_geographic};
use super::error::PublishedError;
use super::input::{ImuSample, Initial, Input};
use super::matrices::{
    ATT, BIAS, Estimator, H1_STATES, H2_STATES, POS, RATE, Row, State, VEL, YAW, p0, phi, q,
    r1_diagonal, r2_diagonal,
};
use super::mechanise::{level, velocity};
use super::options::{Engine, Options, SpeedUse};
use super::step::{Step, Used};
use super::variant::{Reading, Source};

/// Runs the filter: one step per inertial sample from the first fix to the last.
///
/// # Errors
/// [`PublishedError`]: an input too short or not finite, times that go back, no sample ahead of the first fix for
/// the latency and the stop detector's window, an option out of range, an innovation covariance that is not positive
/// definite, a state that runs away.
pub fn run(
    input: &Input,
    initial: &Initial,
    options: &Options,
) -> Result<Vec<Step>, PublishedError> {
    input.check()?;
    initial.check()?;
    options.check()?;
    let variant = &options.variant;
    let (fixes, motions) = (&input.fixes, &input.motions);
    let first = motions
        .iter()
        .position(|m| m.t_s >= fixes[0].t_s)
        .ok_or_else(|| PublishedError::NoOverlap {
            fix_s: fixes[0].t_s,
            last_s: motions.last().map_or(f64::NAN, |m| m.t_s),
        })?;
    let window = options.stop.map_or(0, |_| STOP_WINDOW - 1);
    let needed = options.latency.saturating_add(window);
    if first < needed {
        return Err(PublishedError::Lead {
            needed,
            found: first,
        });
    }
    let earth = Earth::of(variant.earth);
    let Ce_g = ecef_to_geographic(initial.lat, initial.lon);
    let mut x = State::zeros();
    let place = earth.ecef(initial.lat, initial.lon, initial.height);
    x.fixed_rows_mut::<3>(POS).copy_from(&place);
    x.fixed_rows_mut::<3>(VEL)
        .copy_from(&(Ce_g.transpose() * initial.v_ned));
    let angles = Vector3::new(initial.roll, initial.pitch, initial.yaw);
    x.fixed_rows_mut::<3>(ATT).copy_from(&angles);
    // Of the sample at the fix, latency or not, as in the program.
    x.fixed_rows_mut::<3>(RATE)
        .copy_from(&motions[first].rate_b);
    x.fixed_rows_mut::<3>(BIAS).copy_from(&initial.bias);
    let phi = phi(DT, variant.transition);
    let Q = q(
        &Process::of(variant.process_noise),
        DT,
        variant.noise_integral,
    );
    let setting = Setting {
        input,
        options,
        earth,
        r1: r1_diagonal(&Noise::of(variant.measurement_noise)).into(),
        r2: r2_diagonal(&Noise::of(variant.measurement_noise)).into(),
    };
    match options.engine {
        Engine::Chains => drive(Chains::new(x, &p0(), &phi, &Q)?, Ce_g, first, &setting),
        Engine::Dense => drive(Dense::new(x, p0(), phi, Q), Ce_g, first, &setting),
    }
}

/// What stays the same from step to step.
struct Setting<'a> {
    input: &'a Input,
    options: &'a Options,
    earth: Earth,
    r1: [f64; 15],
    r2: [f64; 8],
}

/// The loop over the fixes and the samples between them.
fn drive<E: Estimator>(
    mut filter: E,
    mut Ce_g: Matrix3<f64>,
    first: usize,
    setting: &Setting<'_>,
) -> Result<Vec<Step>, PublishedError> {
    let (options, fixes, motions) = (
        setting.options,
        &setting.input.fixes,
        &setting.input.motions,
    );
    let mut steps = Vec::with_capacity(motions.len() - first);
    let mut k = first;
    for (n, pair) in fixes.windows(2).enumerate() {
        // The program counts its fixes from 1 and never uses the first.
        let chosen = options.due.as_ref().map(|list| list.get(n) == Some(&true));
        let due =
            n > 0 && chosen.unwrap_or_else(|| options.every.is_some_and(|every| n % every == 0));
        let mut fresh = true;
        while let Some(sample) = motions.get(k)
            && sample.t_s < pair[1].t_s
        {
            let step = steps.len();
            let at = |error| match error {
                PublishedError::Innovation { .. } => PublishedError::Innovation { step },
                other => other,
            };
            let index = k - options.latency;
            if fresh {
                aid(&mut filter, setting, n, &Ce_g).map_err(at)?;
            }
            let fix = (due && fresh).then_some(n);
            fresh = false;
            let (rows, predicted, used) = measure(filter.x(), setting, index, fix, &Ce_g);
            let used = if let Some(mean) = standing(motions, index, options.stop) {
                stand(filter.x_mut(), &mean);
                Used::Stop
            } else {
                filter.predict();
                if let Some(velocity) = predicted {
                    filter.x_mut().fixed_rows_mut::<3>(VEL).copy_from(&velocity);
                }
                filter.update(rows.as_slice()).map_err(at)?;
                used
            };
            let x = *filter.x();
            if !x.iter().all(|value| value.is_finite()) {
                return Err(PublishedError::Diverged { step });
            }
            let ([lat, lon, height], axes) =
                setting.earth.local(&x.fixed_rows::<3>(POS).into_owned());
            if used != Used::Stop {
                Ce_g = axes;
            }
            steps.push(Step {
                t_s: sample.t_s,
                sample: index,
                lat,
                lon,
                height,
                x,
                variances: filter.variances(),
                covariance: options
                    .keep_covariance
                    .then(|| Box::new(filter.covariance())),
                used,
            });
            k += 1;
        }
    }
    Ok(steps)
}

/// Rows of one measurement.
struct Rows {
    list: [Row; 15],
    count: usize,
}

impl Rows {
    fn as_slice(&self) -> &[Row] {
        &self.list[..self.count]
    }

    fn push(&mut self, row: Row) {
        if let Some(place) = self.list.get_mut(self.count) {
            *place = row;
            self.count += 1;
        }
    }
}

/// The measurement of one sample, with fix `fix` where one is due (3.4, 3.5); with [`Reading::Corrected`] the inertial
/// velocity is apart from it, as a prediction.
fn measure(
    x: &State,
    setting: &Setting<'_>,
    index: usize,
    fix: Option<usize>,
    Ce_g: &Matrix3<f64>,
) -> (Rows, Option<Vector3<f64>>, Used) {
    let variant = &setting.options.variant;
    let ImuSample {
        accel_b, rate_b, ..
    } = &setting.input.motions[index];
    let veb_e = velocity(x, Ce_g, accel_b, rate_b, DT, variant);
    let (roll, pitch) = level(accel_b);
    let predicted = (variant.inertial == Reading::Corrected).then_some(veb_e);
    let mut rows = Rows {
        list: [Row::default(); 15],
        count: 0,
    };
    let fix = fix
        .map(|n| &setting.input.fixes[n])
        .filter(|fix| variant.gate == Source::Text || fix.v_ned.norm() > GATE);
    let Some(fix) = fix else {
        let z = [
            veb_e.x, veb_e.y, veb_e.z, roll, pitch, rate_b.x, rate_b.y, rate_b.z,
        ];
        for (i, state) in H2_STATES.into_iter().enumerate() {
            if predicted.is_none() || i > 2 {
                let (z, r) = (z[i], setting.r2[i]);
                rows.push(Row { state, z, r });
            }
        }
        return (rows, predicted, Used::Imu);
    };
    let place = setting.earth.ecef(fix.lat, fix.lon, fix.height);
    let v = Ce_g.transpose() * fix.v_ned;
    let mut yaw = fix.v_ned.y.atan2(fix.v_ned.x).rem_euclid(TAU);
    if variant.course == Reading::Corrected {
        yaw += TAU * ((x[YAW] - yaw) / TAU).round();
    }
    let z = [
        place.x, place.y, place.z, v.x, v.y, v.z, veb_e.x, veb_e.y, veb_e.z, roll, pitch, yaw,
        rate_b.x, rate_b.y, rate_b.z,
    ];
    for (i, state) in H1_STATES.into_iter().enumerate() {
        let inertial = predicted.is_some() && (6..9).contains(&i);
        let slow = state == YAW && fix.v_ned.norm() <= GATE;
        let unprinted = variant.gnss_rows == Source::Text && state > RATE;
        if !(inertial || slow || unprinted) {
            let (z, r) = (z[i], setting.r1[i]);
            rows.push(Row { state, z, r });
        }
    }
    (rows, predicted, Used::Gnss)
}

/// Mean specific force over the window that ends at `index`, where the variances say that the car stands [S00, 3.5].
fn standing(motions: &[ImuSample], index: usize, bound: Option<f64>) -> Option<Vector3<f64>> {
    let bound = bound?;
    let window = motions.get((index + 1).checked_sub(STOP_WINDOW)?..=index)?;
    let count = real(STOP_WINDOW);
    // Most samples are of a moving car: z is summed only at a stop, and nothing is kept from sample to sample that
    // rounding could wear.
    let (mut x, mut y) = (0.0, 0.0);
    for sample in window {
        x += sample.accel_b.x;
        y += sample.accel_b.y;
    }
    let (x, y) = (x / count, y / count);
    let mut spread = 0.0;
    for sample in window {
        let (dx, dy) = (sample.accel_b.x - x, sample.accel_b.y - y);
        spread += dx * dx + dy * dy;
    }
    (spread / (count - 1.0) < bound).then(|| {
        let z: f64 = window.iter().map(|sample| sample.accel_b.z).sum();
        Vector3::new(x, y, z / count)
    })
}

/// At a stop: no speed, roll and pitch of the mean specific force. Position, yaw and P stay; a fix that was due in this
/// step is lost [S00, 6.5].
fn stand(x: &mut State, mean: &Vector3<f64>) {
    x.fixed_rows_mut::<3>(VEL).fill(0.0);
    (x[ATT], x[ATT + 1]) = level(mean);
}

/// The exact speed at fix `n`, along the velocity, or along the body's x axis where the velocity is below 0.1 m/s.
fn aid<E: Estimator>(
    filter: &mut E,
    setting: &Setting<'_>,
    n: usize,
    Ce_g: &Matrix3<f64>,
) -> Result<(), PublishedError> {
    let Some(aid) = &setting.options.speed else {
        return Ok(());
    };
    let Some(speed) = aid.speeds.get(n).filter(|speed| speed.is_finite()) else {
        return Ok(());
    };
    let x = filter.x();
    let v = x.fixed_rows::<3>(VEL).into_owned();
    let norm = v.norm();
    let direction = if norm > 0.1 {
        v / norm
    } else {
        let variant = &setting.options.variant;
        let forward = super::mechanise::body_to_geographic(0.0, x[ATT + 1], x[YAW], variant);
        Ce_g.transpose() * forward.column(0)
    };
    let v = direction * *speed;
    match aid.how {
        SpeedUse::Set => filter.x_mut().fixed_rows_mut::<3>(VEL).copy_from(&v),
        SpeedUse::Measure(sd) => {
            let rows = [0, 1, 2].map(|axis| Row {
                state: VEL + axis,
                z: v[axis],
                r: sd * sd,
            });
            filter.update(&rows)?;
        }
    }
    Ok(())
}
