//! The recorder's configuration of a simulated car: the data sheet and the nominal places, never the drawn
//! errors.

use std::fmt::Write;

use schema::header::{
    Clock, ClockSource, Header, ImuSheet, Layout, Origin, Periods, Vehicle, WheelSheet,
};
use schema::num;
use schema::scale::{TwoSlope, WheelScale};
use schema::units::STANDARD_GRAVITY;

use super::scenario::{Axes, Scenario};

/// Least figure stated for a quantity that has no error at all: a filter needs a number above zero.
const LEAST: f64 = 1e-6;
/// Least place error stated, m.
const LEAST_PLACE: f64 = 1e-4;

fn list(values: [f64; 3]) -> String {
    let [x, y, z] = values.map(|value| format!("{value:.4}"));
    format!("[{x}, {y}, {z}]")
}

fn figure(text: &mut String, key: &str, value: f64) {
    // Writing to a String cannot fail.
    let _ = if value < 1e-3 {
        writeln!(text, "{key} = {value:.3e}")
    } else {
        writeln!(text, "{key} = {value:.6}")
    };
}

/// Configuration text with the DBC file's name.
pub(super) fn config(scenario: &Scenario, dbc: &str) -> String {
    let (car, imu, wheels) = (
        scenario.vehicle(),
        scenario.imu_sheet(),
        scenario.wheel_sheet(),
    );
    let mut text = String::with_capacity(2048);
    let _ = writeln!(
        text,
        "# Simulated car: class {}, seed {}.",
        scenario.class, scenario.seed
    );
    let _ = writeln!(text, "\n[vehicle]\nname = \"{}\"", car.name);
    let _ = writeln!(text, "track_width_m = {:.4}", car.track_width_m);
    let _ = writeln!(text, "imu_position_m = {}", list(scenario.car.imu_nominal));
    let _ = writeln!(text, "imu_position_sd_m = {}", list(car.imu_position_sd_m));
    let _ = writeln!(text, "cg_position_m = {}", list(scenario.car.cg_nominal));
    let _ = writeln!(text, "cg_position_sd_m = {}", list(car.cg_position_sd_m));
    let _ = writeln!(text, "\n[[bus]]\ninterface = \"can0\"\ndbc = \"{dbc}\"");
    let axes = match scenario.axes {
        Axes::FrontLeftUp => "front-left-up",
        Axes::FrontRightDown => "front-right-down",
    };
    let _ = writeln!(text, "\n[imu]\naxes = \"{axes}\"");
    for (key, message, prefix) in [
        ("accel", "IMU_ACCEL", "Accel"),
        ("rate", "IMU_RATE", "Rate"),
    ] {
        let names = ["X", "Y", "Z"]
            .map(|axis| format!("\"{message}.{prefix}{axis}\""))
            .join(", ");
        let _ = writeln!(
            text,
            "{key} = [{names}]\n{key}_counter = \"{message}.{prefix}Count\""
        );
    }
    if let Some(range) = imu.accel_range {
        let _ = writeln!(text, "accel_range_g = {:.3}", range / STANDARD_GRAVITY);
    }
    if let Some(range) = imu.rate_range {
        let _ = writeln!(text, "rate_range_degps = {:.3}", range.to_degrees());
    }
    let [roll, pitch, yaw] = imu.mounting_sd.map(f64::to_degrees);
    let _ = writeln!(text, "mounting_sd_deg = [{roll:.6}, {pitch:.6}, {yaw:.6}]");
    text.push_str("\n[imu.noise]\n");
    figure(&mut text, "accel_density", imu.accel_density);
    figure(&mut text, "rate_density", imu.rate_density.to_degrees());
    figure(&mut text, "accel_bias", imu.accel_bias);
    figure(&mut text, "rate_bias", imu.rate_bias.to_degrees());
    figure(&mut text, "accel_bias_jump", imu.accel_bias_jump);
    figure(&mut text, "rate_bias_jump", imu.rate_bias_jump.to_degrees());
    figure(&mut text, "accel_scale", imu.accel_scale);
    figure(&mut text, "rate_scale", imu.rate_scale);
    figure(&mut text, "accel_vibration", imu.accel_vibration);
    figure(&mut text, "rate_vibration", imu.rate_vibration.to_degrees());
    text.push_str(
        "\n[wheels]\nleft = \"CHASSIS.WheelRearLeft\"\nright = \"CHASSIS.WheelRearRight\"\n",
    );
    figure(&mut text, "latency_ms", 1e3 * wheels.latency_s);
    figure(&mut text, "latency_sd_ms", 1e3 * wheels.latency_sd_s);
    figure(&mut text, "cutoff_kmh", 3.6 * wheels.cutoff_mps);
    figure(&mut text, "scale_sd", wheels.scale_sd);
    figure(&mut text, "scale_difference_sd", wheels.scale_difference_sd);
    figure(&mut text, "noise_kmh", 3.6 * wheels.noise_mps);
    text.push_str(
        "\n[aux]\nbrake = \"CHASSIS.Brake\"\n\n[ring]\nseconds = 40\npost_trigger_s = 10\n",
    );
    text.push_str("layout = \"full\"\n\n[trigger]\npeak_g = 50\ndelta_v_kmh = 8\n\n[store]\ndir = \"records\"\n");
    text
}

/// What a recorder with this configuration would put into its header.
impl Scenario {
    /// The header of a record of this scenario, for runs that need no recorder: 100 Hz, clock of the log.
    #[must_use]
    pub fn header(&self) -> Header {
        let wheel_ns = u64::try_from(num::round_i64(1e9 / self.wheel_hz)).unwrap_or(0);
        let imu_ns = u64::try_from(num::round_i64(1e9 / num::real(self.imu_hz))).unwrap_or(0);
        Header {
            number: 1,
            previous_sha256: [0; 32],
            parent_sha256: None,
            origin: Origin::Replay { logs: Vec::new() },
            device_id: String::new(),
            software: concat!("svartboks-reconstruct ", env!("CARGO_PKG_VERSION")).to_owned(),
            config_sha256: [0; 32],
            vehicle: self.vehicle(),
            imu: self.imu_sheet(),
            wheels: self.wheel_sheet(),
            wheel_scale: WheelScale::default_kmh(),
            accel_scale: TwoSlope::accel_default(),
            rate_scale: TwoSlope::rate_default(),
            layout: Layout::Full,
            channel_frequency_class: None,
            periods: Periods {
                accel_ns: imu_ns,
                rate_ns: imu_ns,
                wheels_ns: [wheel_ns; 2],
            },
            interfaces: Vec::new(),
            clock: Clock {
                source: ClockSource::LogStamps,
                offset_ns: 0,
                uncertainty_ns: None,
                leap_second: false,
            },
        }
    }

    /// The car as configured.
    #[must_use]
    pub fn vehicle(&self) -> Vehicle {
        Vehicle {
            vin: String::new(),
            name: format!("simulated {}", self.class),
            track_width_m: self.car.track_width,
            imu_position_m: Some(self.car.imu_nominal),
            imu_position_sd_m: [self.sheet.imu_place.max(LEAST_PLACE); 3],
            cg_position_m: Some(self.car.cg_nominal),
            cg_position_sd_m: [self.sheet.cg_place.max(LEAST_PLACE); 3],
        }
    }

    /// The IMU's data sheet as configured.
    #[must_use]
    pub fn imu_sheet(&self) -> ImuSheet {
        let sheet = &self.sheet;
        ImuSheet {
            accel_range: sheet.accel_range,
            rate_range: sheet.rate_range,
            accel_density: sheet.accel_density.max(LEAST),
            rate_density: sheet.rate_density.max(LEAST.to_radians()),
            accel_bias: sheet.accel_bias.max(LEAST),
            rate_bias: sheet.rate_bias.max(LEAST.to_radians()),
            accel_bias_jump: sheet.accel_bias_jump.max(LEAST),
            rate_bias_jump: sheet.rate_bias_jump.max(LEAST.to_radians()),
            accel_scale: sheet.accel_scale.max(LEAST),
            rate_scale: sheet.rate_scale.max(LEAST),
            accel_vibration: sheet.accel_vibration.max(LEAST),
            rate_vibration: sheet.rate_vibration.max(LEAST.to_radians()),
            mounting: [0.0; 3],
            mounting_sd: [sheet.mounting.max(LEAST.to_radians()); 3],
        }
    }

    /// The wheel sensors' data sheet as configured.
    #[must_use]
    pub fn wheel_sheet(&self) -> WheelSheet {
        let sheet = &self.sheet;
        let [low, high] = sheet.wheel_latency;
        WheelSheet {
            present: true,
            latency_s: f64::midpoint(low, high).max(LEAST / 1e3),
            latency_sd_s: ((high - low) / 12.0_f64.sqrt()).max(LEAST / 1e3),
            cutoff_mps: sheet.wheel_cutoff[1].max(LEAST / 3.6),
            scale_sd: sheet.wheel_scale.max(LEAST),
            scale_difference_sd: sheet.wheel_scale_difference.max(LEAST),
            noise_mps: sheet.wheel_noise.max(LEAST / 3.6),
        }
    }
}
