//! The recorder's configuration of a simulated car: the data sheet and the nominal places, never the drawn
//! errors.

use std::fmt::Write;

use schema::units::STANDARD_GRAVITY;

use super::scenario::{Axes, Scenario};

/// Least figure stated for a quantity that has no error at all: a filter needs a number above zero.
const LEAST: f64 = 1e-6;

fn list(values: [f64; 3]) -> String {
    let [x, y, z] = values.map(|value| format!("{value:.4}"));
    format!("[{x}, {y}, {z}]")
}

fn figure(text: &mut String, key: &str, value: f64) {
    let value = value.max(LEAST);
    // Writing to a String cannot fail.
    let _ = if value < 1e-3 {
        writeln!(text, "{key} = {value:.3e}")
    } else {
        writeln!(text, "{key} = {value:.6}")
    };
}

/// Configuration text with the DBC file's name.
pub(super) fn config(scenario: &Scenario, dbc: &str) -> String {
    let (car, sheet) = (&scenario.car, &scenario.sheet);
    let mut text = String::with_capacity(2048);
    let _ = writeln!(
        text,
        "# Simulated car: class {}, seed {}.",
        scenario.class, scenario.seed
    );
    let _ = writeln!(text, "\n[vehicle]\nname = \"simulated {}\"", scenario.class);
    let _ = writeln!(text, "track_width_m = {:.4}", car.track_width);
    let _ = writeln!(text, "imu_position_m = {}", list(car.imu_nominal));
    let _ = writeln!(
        text,
        "imu_position_sd_m = {}",
        list([sheet.imu_place.max(1e-4); 3])
    );
    let _ = writeln!(text, "cg_position_m = {}", list(car.cg_nominal));
    let _ = writeln!(
        text,
        "cg_position_sd_m = {}",
        list([sheet.cg_place.max(1e-4); 3])
    );
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
    if let Some(range) = sheet.accel_range {
        let _ = writeln!(text, "accel_range_g = {:.3}", range / STANDARD_GRAVITY);
    }
    if let Some(range) = sheet.rate_range {
        let _ = writeln!(text, "rate_range_degps = {:.3}", range.to_degrees());
    }
    let mounting = sheet.mounting.to_degrees().max(LEAST);
    let _ = writeln!(
        text,
        "mounting_sd_deg = [{mounting:.6}, {mounting:.6}, {mounting:.6}]"
    );
    text.push_str("\n[imu.noise]\n");
    figure(&mut text, "accel_density", sheet.accel_density);
    figure(&mut text, "rate_density", sheet.rate_density.to_degrees());
    figure(&mut text, "accel_bias", sheet.accel_bias);
    figure(&mut text, "rate_bias", sheet.rate_bias.to_degrees());
    figure(&mut text, "accel_bias_jump", sheet.accel_bias_jump);
    figure(
        &mut text,
        "rate_bias_jump",
        sheet.rate_bias_jump.to_degrees(),
    );
    figure(&mut text, "accel_scale", sheet.accel_scale);
    figure(&mut text, "rate_scale", sheet.rate_scale);
    figure(&mut text, "accel_vibration", sheet.accel_vibration);
    figure(
        &mut text,
        "rate_vibration",
        sheet.rate_vibration.to_degrees(),
    );
    text.push_str(
        "\n[wheels]\nleft = \"CHASSIS.WheelRearLeft\"\nright = \"CHASSIS.WheelRearRight\"\n",
    );
    let [low, high] = sheet.wheel_latency;
    figure(&mut text, "latency_ms", 500.0 * (low + high));
    figure(
        &mut text,
        "latency_sd_ms",
        1e3 * (high - low) / 12.0_f64.sqrt(),
    );
    figure(&mut text, "cutoff_kmh", 3.6 * sheet.wheel_cutoff[1]);
    figure(&mut text, "scale_sd", sheet.wheel_scale);
    figure(
        &mut text,
        "scale_difference_sd",
        sheet.wheel_scale_difference,
    );
    figure(&mut text, "noise_kmh", 3.6 * sheet.wheel_noise);
    text.push_str(
        "\n[aux]\nbrake = \"CHASSIS.Brake\"\n\n[ring]\nseconds = 40\npost_trigger_s = 10\n",
    );
    text.push_str("layout = \"full\"\n\n[trigger]\npeak_g = 50\ndelta_v_kmh = 8\n\n[store]\ndir = \"records\"\n");
    text
}
