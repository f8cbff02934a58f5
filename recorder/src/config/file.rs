//! The configuration as written: one struct a table, unknown keys refused.

use serde::Deserialize;

use super::ConfigError;
use super::locate::{Source, nearest};

/// A string or a list of strings.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
pub(crate) enum OneOrMany {
    One(String),
    Many(Vec<String>),
}

/// A threshold, or `false`.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(untagged)]
pub(crate) enum Threshold {
    Switch(bool),
    Value(f64),
}

/// The whole file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    #[serde(default)]
    pub(crate) device: Device,
    pub(crate) vehicle: Vehicle,
    pub(crate) bus: Vec<Bus>,
    pub(crate) imu: Imu,
    pub(crate) wheels: Option<Wheels>,
    #[serde(default)]
    pub(crate) aux: toml::Table,
    #[serde(default)]
    pub(crate) ring: Ring,
    #[serde(default)]
    pub(crate) trigger: Trigger,
    #[serde(default)]
    pub(crate) raw: Raw,
    #[serde(default)]
    pub(crate) store: Store,
    #[serde(default)]
    pub(crate) spool: Spool,
    #[serde(default)]
    pub(crate) run: Run,
    pub(crate) serial: Option<Serial>,
    pub(crate) gnss: Option<super::gnss::Table>,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Device {
    #[serde(default)]
    pub(crate) id: String,
    pub(crate) key: Option<String>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Vehicle {
    #[serde(default)]
    pub(crate) vin: String,
    #[serde(default)]
    pub(crate) name: String,
    pub(crate) track_width_m: f64,
    pub(crate) imu_position_m: Option<[f64; 3]>,
    pub(crate) imu_position_sd_m: Option<[f64; 3]>,
    pub(crate) cg_position_m: Option<[f64; 3]>,
    pub(crate) cg_position_sd_m: Option<[f64; 3]>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Bus {
    pub(crate) interface: String,
    pub(crate) dbc: OneOrMany,
    #[serde(default)]
    pub(crate) range_check: bool,
}

#[derive(Clone, Copy, Debug, Deserialize)]
pub(crate) enum AxesName {
    #[serde(rename = "front-left-up")]
    FrontLeftUp,
    #[serde(rename = "front-right-down")]
    FrontRightDown,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Imu {
    pub(crate) axes: AxesName,
    #[serde(default)]
    pub(crate) mounting_deg: [f64; 3],
    #[serde(default = "ones")]
    pub(crate) mounting_sd_deg: [f64; 3],
    pub(crate) accel: [String; 3],
    pub(crate) rate: [String; 3],
    pub(crate) accel_unit: Option<String>,
    pub(crate) rate_unit: Option<String>,
    pub(crate) accel_counter: Option<String>,
    pub(crate) rate_counter: Option<String>,
    pub(crate) accel_range_g: Option<f64>,
    pub(crate) rate_range_degps: Option<f64>,
    #[serde(default)]
    pub(crate) noise: Noise,
}

fn ones() -> [f64; 3] {
    [1.0; 3]
}

/// Data-sheet figures; the defaults are those of a consumer MEMS.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Noise {
    pub(crate) accel_density: f64,
    pub(crate) rate_density: f64,
    pub(crate) accel_bias: f64,
    pub(crate) rate_bias: f64,
    pub(crate) accel_bias_jump: f64,
    pub(crate) rate_bias_jump: f64,
    pub(crate) accel_scale: f64,
    pub(crate) rate_scale: f64,
    pub(crate) accel_vibration: f64,
    pub(crate) rate_vibration: f64,
}

impl Default for Noise {
    fn default() -> Self {
        Self {
            accel_density: 0.0015,
            rate_density: 0.01,
            accel_bias: 0.1,
            rate_bias: 0.5,
            accel_bias_jump: 0.05,
            rate_bias_jump: 0.02,
            accel_scale: 0.003,
            rate_scale: 0.003,
            accel_vibration: 0.3,
            rate_vibration: 0.3,
        }
    }
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Wheels {
    pub(crate) left: String,
    pub(crate) right: String,
    pub(crate) unit: Option<String>,
    pub(crate) radius_m: Option<f64>,
    pub(crate) pulses_per_rev: Option<f64>,
    pub(crate) wrap_bits: Option<u32>,
    #[serde(default = "twenty")]
    pub(crate) latency_ms: f64,
    #[serde(default = "ten")]
    pub(crate) latency_sd_ms: f64,
    #[serde(default = "three")]
    pub(crate) cutoff_kmh: f64,
    #[serde(default = "wheel_scale")]
    pub(crate) scale_sd: f64,
    #[serde(default = "wheel_scale_difference")]
    pub(crate) scale_difference_sd: f64,
    #[serde(default = "wheel_noise")]
    pub(crate) noise_kmh: f64,
}

fn twenty() -> f64 {
    20.0
}
fn ten() -> f64 {
    10.0
}
fn three() -> f64 {
    3.0
}
/// Wear, pressure and load change a tyre's rolling radius by about this part; the measured RAV4 reads 1.0 % low.
fn wheel_scale() -> f64 {
    0.01
}
fn wheel_scale_difference() -> f64 {
    0.001
}
fn wheel_noise() -> f64 {
    0.2
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum LayoutName {
    #[default]
    Full,
    TwoRate,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Ring {
    pub(crate) seconds: f64,
    pub(crate) post_trigger_s: f64,
    pub(crate) layout: LayoutName,
}

impl Default for Ring {
    fn default() -> Self {
        Self {
            seconds: 40.0,
            post_trigger_s: 10.0,
            layout: LayoutName::Full,
        }
    }
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Trigger {
    pub(crate) peak_g: Threshold,
    pub(crate) delta_v_kmh: Threshold,
    pub(crate) power_loss: bool,
    pub(crate) can: Vec<CanTrigger>,
}

impl Default for Trigger {
    fn default() -> Self {
        Self {
            peak_g: Threshold::Value(50.0),
            delta_v_kmh: Threshold::Value(8.0),
            power_loss: true,
            can: Vec::new(),
        }
    }
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct CanTrigger {
    pub(crate) signal: String,
    pub(crate) equals: Option<f64>,
    pub(crate) above: Option<f64>,
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum FramesName {
    #[default]
    Mapped,
    All,
    None,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Raw {
    pub(crate) frames: FramesName,
    pub(crate) before_s: f64,
    pub(crate) after_s: f64,
}

impl Default for Raw {
    fn default() -> Self {
        Self {
            frames: FramesName::Mapped,
            before_s: 1.0,
            after_s: 1.0,
        }
    }
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Store {
    pub(crate) dir: String,
    pub(crate) keep: u32,
    pub(crate) encrypt_to: Option<String>,
}

impl Default for Store {
    fn default() -> Self {
        Self {
            dir: "records".to_owned(),
            keep: 5,
            encrypt_to: None,
        }
    }
}

/// The ring on disk.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Spool {
    pub(crate) enabled: bool,
    pub(crate) file: Option<String>,
    pub(crate) loss_ms: f64,
    pub(crate) flush_ms: Option<f64>,
}

impl Default for Spool {
    fn default() -> Self {
        Self {
            enabled: true,
            file: None,
            loss_ms: 100.0,
            flush_ms: None,
        }
    }
}

/// The daemon.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Run {
    pub(crate) socket: Option<String>,
    pub(crate) realtime_priority: u8,
    pub(crate) lock_memory: bool,
    pub(crate) self_test_minutes: f64,
    pub(crate) receive_buffer_kib: u32,
}

impl Default for Run {
    fn default() -> Self {
        Self {
            socket: None,
            realtime_priority: 0,
            lock_memory: false,
            self_test_minutes: 60.0,
            receive_buffer_kib: 16 * 1024,
        }
    }
}

/// The read-out over a serial line.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Serial {
    pub(crate) token: String,
    #[serde(default = "baud")]
    pub(crate) baud: u32,
}

fn baud() -> u32 {
    115_200
}

impl Config {
    /// Parses the text; `source` is for naming lines.
    pub(crate) fn parse(source: &Source<'_>, text: &str) -> Result<Self, ConfigError> {
        toml::from_str(text).map_err(|error: toml::de::Error| {
            let place = source.at(error.span().map_or(0, |span| span.start));
            let message = error.message();
            // serde names the unknown field first and then the known ones, each between back quotes.
            let mut names = message.split('`').skip(1).step_by(2);
            match (message.starts_with("unknown field"), names.next()) {
                (true, Some(key)) => ConfigError::UnknownKey {
                    place,
                    key: key.to_owned(),
                    hint: nearest(key, names),
                },
                _ => ConfigError::Syntax {
                    place,
                    message: message.to_owned(),
                },
            }
        })
    }
}
