//! The built-in sensor grades: data-sheet figures typical of a published class, one sigma.
//!
//! Classes after the usual division of inertial sensors by gyro drift and accelerometer bias (navigation below
//! 0.01 deg/h and 0.1 mg, tactical 1 to 10 deg/h and 1 to 5 mg, commercial or automotive about 0.1 deg/s: "Inertial
//! sensors technologies for navigation applications", Satellite Navigation 1, 2020, table 1), each grade filled
//! in with the figures of one widely used device. Wheels, vibration and the rest of the car are the same for every grade: those are not
//! the IMU's.

use schema::header::{ImuSheet, WheelSheet};
use schema::units::STANDARD_GRAVITY;

use super::sheet::DataSheet;

/// The names of the built-in grades, best first.
pub const GRADES: [&str; 5] = [
    "navigation",
    "tactical",
    "industrial",
    "consumer",
    "automotive",
];

/// Figures of a maker's sheet in its own units.
struct Figures {
    /// micro-g/sqrt(Hz).
    accel_noise: f64,
    /// deg/s/sqrt(Hz).
    rate_noise: f64,
    /// mg.
    accel_bias: f64,
    /// deg/s.
    rate_bias: f64,
    /// Shift at an impact, mg.
    accel_jump: f64,
    /// Shift at an impact, deg/s.
    rate_jump: f64,
    /// Fractions.
    scale: [f64; 2],
    /// g.
    accel_range: f64,
    /// deg/s.
    rate_range: f64,
    /// Left of the mounting after alignment, deg.
    mounting: f64,
    /// Place known to, m.
    place: f64,
}

/// The built-in grade of that name.
#[must_use]
pub fn grade(name: &str) -> Option<DataSheet> {
    let per_root_hour = 1.0 / 60.0;
    let per_hour = 1.0 / 3600.0;
    let (typical_of, figures) = match name {
        "navigation" => (
            "ring-laser navigation-grade IMU such as HG9900: 0.003 deg/h, 0.002 deg/sqrt(h), 25 micro-g, 5 and \
             100 ppm; an accelerometer that reaches 60 g is assumed",
            Figures {
                accel_noise: 10.0,
                rate_noise: 0.002 * per_root_hour,
                accel_bias: 0.025,
                rate_bias: 0.003 * per_hour,
                accel_jump: 0.1,
                rate_jump: 0.01 * per_hour,
                scale: [1e-4, 5e-6],
                accel_range: 60.0,
                rate_range: 500.0,
                mounting: 0.1,
                place: 0.01,
            },
        ),
        "tactical" => (
            "fibre-optic tactical IMU such as LN-200: 1 deg/h, 0.07 deg/sqrt(h), 1 mg, 100 and 300 ppm",
            Figures {
                accel_noise: 50.0,
                rate_noise: 0.07 * per_root_hour,
                accel_bias: 1.0,
                rate_bias: per_hour,
                accel_jump: 1.0,
                rate_jump: 3.0 * per_hour,
                scale: [3e-4, 1e-4],
                accel_range: 70.0,
                rate_range: 1000.0,
                mounting: 0.2,
                place: 0.01,
            },
        ),
        "industrial" => (
            "factory-calibrated industrial MEMS such as ADIS16470: +-40 g, 2000 deg/s, 0.008 deg/s/sqrt(Hz), \
             100 micro-g/sqrt(Hz), bias repeatability 3 mg and 0.1 deg/s, scale 0.1 %",
            Figures {
                accel_noise: 100.0,
                rate_noise: 0.008,
                accel_bias: 3.0,
                rate_bias: 0.1,
                accel_jump: 2.0,
                rate_jump: 0.01,
                scale: [1e-3, 1e-3],
                accel_range: 40.0,
                rate_range: 2000.0,
                mounting: 0.5,
                place: 0.02,
            },
        ),
        "consumer" => (
            "consumer MEMS calibrated once on the bench: the recorder's defaults, 150 micro-g/sqrt(Hz), \
             10 mg, 0.01 deg/s/sqrt(Hz), 0.5 deg/s, 0.3 %; with an 80 g accelerometer",
            Figures {
                accel_noise: 153.0,
                rate_noise: 0.01,
                accel_bias: 10.2,
                rate_bias: 0.5,
                accel_jump: 5.1,
                rate_jump: 0.02,
                scale: [3e-3, 3e-3],
                accel_range: 80.0,
                rate_range: 500.0,
                mounting: 1.0,
                place: 0.05,
            },
        ),
        "automotive" => (
            "stability-control sensors over temperature and life, uncalibrated: 50 mg, 1 deg/s, 0.02 \
             deg/s/sqrt(Hz), 1 %, 300 deg/s; acceleration from the air-bag unit's 80 g sensor [S03, 1.1]",
            Figures {
                accel_noise: 400.0,
                rate_noise: 0.02,
                accel_bias: 50.0,
                rate_bias: 1.0,
                accel_jump: 10.0,
                rate_jump: 0.05,
                scale: [1e-2, 1e-2],
                accel_range: 80.0,
                rate_range: 300.0,
                mounting: 1.0,
                place: 0.05,
            },
        ),
        _ => return None,
    };
    Some(sheet(name, typical_of, &figures))
}

fn sheet(name: &str, typical_of: &str, f: &Figures) -> DataSheet {
    let mg = STANDARD_GRAVITY * 1e-3;
    DataSheet {
        name: name.to_owned(),
        typical_of: typical_of.to_owned(),
        imu: ImuSheet {
            accel_range: Some(f.accel_range * STANDARD_GRAVITY),
            rate_range: Some(f.rate_range.to_radians()),
            accel_density: f.accel_noise * mg * 1e-3,
            rate_density: f.rate_noise.to_radians(),
            accel_bias: f.accel_bias * mg,
            rate_bias: f.rate_bias.to_radians(),
            accel_bias_jump: f.accel_jump * mg,
            rate_bias_jump: f.rate_jump.to_radians(),
            accel_scale: f.scale[0],
            rate_scale: f.scale[1],
            accel_vibration: 0.3,
            rate_vibration: 0.3_f64.to_radians(),
            mounting: [0.0; 3],
            mounting_sd: [f.mounting.to_radians(); 3],
        },
        wheels: wheels(),
        imu_place_sd: [f.place; 3],
        cg_place_sd: [0.05; 3],
    }
}

/// ABS sensors of the car, with the recorder's defaults.
fn wheels() -> WheelSheet {
    WheelSheet {
        present: true,
        latency_s: 0.020,
        latency_sd_s: 0.010,
        cutoff_mps: 3.0 / 3.6,
        scale_sd: 0.01,
        scale_difference_sd: 0.001,
        noise_mps: 0.2 / 3.6,
    }
}

#[cfg(test)]
mod tests {
    use super::{GRADES, grade};
    use crate::design::sheet::DataSheet;

    #[test]
    fn every_name_has_a_sheet_and_worse_grades_are_worse() {
        let sheets: Vec<DataSheet> = GRADES.iter().filter_map(|name| grade(name)).collect();
        assert_eq!(sheets.len(), GRADES.len());
        for pair in sheets.windows(2) {
            let (a, b) = (&pair[0].imu, &pair[1].imu);
            assert!(a.accel_bias < b.accel_bias && a.rate_bias < b.rate_bias);
            assert!(a.accel_density < b.accel_density && a.rate_density < b.rate_density);
        }
        assert!(grade("perfect").is_none());
    }

    /// The consumer grade is what the recorder assumes where nothing is configured.
    #[test]
    fn consumer_is_the_recorders_default() {
        let ours = grade("consumer").unwrap();
        let default = DataSheet::parse("", "empty", "x").unwrap();
        for (a, b) in [
            (ours.imu.accel_density, default.imu.accel_density),
            (ours.imu.accel_bias, default.imu.accel_bias),
            (ours.imu.rate_bias, default.imu.rate_bias),
            (ours.imu.accel_scale, default.imu.accel_scale),
            (ours.wheels.scale_sd, default.wheels.scale_sd),
            (ours.wheels.noise_mps, default.wheels.noise_mps),
        ] {
            assert!((a / b - 1.0).abs() < 0.01, "{a} against {b}");
        }
    }
}
