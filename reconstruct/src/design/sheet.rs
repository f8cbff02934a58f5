//! A sensor data sheet: the figures of the recorder's `[imu]`, `[imu.noise]` and `[wheels]`.

use std::path::Path;

use schema::header::{ImuSheet, WheelSheet};
use schema::units::STANDARD_GRAVITY;
use serde::Deserialize;
use serde::de::IgnoredAny;

use super::DesignError;
use super::file::{self, Place};
use crate::simulate::Sheet;

/// Least figure of a quantity that has no error at all: a filter needs a number above zero.
const LEAST: f64 = 1e-6;

/// The simulator's vibration grows with speed, to this multiple of its figure at 30 m/s; the sheet's figure is the
/// most that the driving car has.
const VIBRATION_GROWTH: f64 = 1.2;

/// What a maker states of an IMU, and what is known of the wheels it works with. SI and radians, one sigma.
#[derive(Clone, Debug, PartialEq)]
pub struct DataSheet {
    /// Short name: of the grade, or of the file.
    pub name: String,
    /// What the figures are typical of; empty if not stated.
    pub typical_of: String,
    /// The IMU.
    pub imu: ImuSheet,
    /// The wheel speed sensors.
    pub wheels: WheelSheet,
    /// Place of the IMU, m, per axis.
    pub imu_place_sd: [f64; 3],
    /// Place of the centre of gravity, m, per axis.
    pub cg_place_sd: [f64; 3],
}

/// A sheet file as `--example sheet` prints it.
pub const EXAMPLE: &str = include_str!("example_sheet.toml");

impl DataSheet {
    /// Reads a sheet file (TOML, or JSON if it begins with a brace): tables `[imu]`, `[imu.noise]`, `[wheels]`
    /// and, of `[vehicle]`, the standard deviations of the places, with the recorder's keys, units and defaults.
    /// A whole configuration of the recorder serves too.
    ///
    /// # Errors
    /// [`DesignError::File`] where the file cannot be read, a key is not known or a figure is out of range.
    pub fn load(path: &Path) -> Result<Self, DesignError> {
        let text = file::read(path)?;
        let stem = path
            .file_stem()
            .map_or_else(|| "sheet".to_owned(), |s| s.to_string_lossy().into_owned());
        Self::parse(&text, &path.display().to_string(), &stem)
    }

    /// Reads a sheet from text; `source` is named in errors, `name` is used where the text gives none.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn parse(text: &str, source: &str, name: &str) -> Result<Self, DesignError> {
        let file: SheetFile = file::decode(text, source)?;
        let at = Place { source };
        let (imu, noise, wheels, vehicle) =
            (&file.imu, &file.imu.noise, &file.wheels, &file.vehicle);
        let of = |key: &str, value: f64, high: f64| at.within(key, value, 0.0, high);
        let noise_of =
            |key: &str, value: f64, high: f64| of(&format!("imu.noise.{key}"), value, high);
        let degrees = |key: &str, value: f64, high: f64| -> Result<f64, DesignError> {
            Ok(noise_of(key, value, high)?.to_radians())
        };
        let range = |key: &str, value: Option<f64>, high: f64| {
            value
                .map(|value| at.within(&format!("imu.{key}"), value, 0.1, high))
                .transpose()
        };
        let triple = |key: &str, values: [f64; 3], high: f64| -> Result<[f64; 3], DesignError> {
            for (axis, value) in values.iter().enumerate() {
                of(&format!("{key}[{axis}]"), *value, high)?;
            }
            Ok(values)
        };
        Ok(Self {
            name: at.text("name", file.name.as_deref().unwrap_or(name), 40)?,
            typical_of: at.text("typical_of", &file.typical_of, 300)?,
            imu: ImuSheet {
                accel_range: range("accel_range_g", imu.accel_range_g, 10_000.0)?
                    .map(|g| g * STANDARD_GRAVITY),
                rate_range: range("rate_range_degps", imu.rate_range_degps, 100_000.0)?
                    .map(f64::to_radians),
                accel_density: noise_of("accel_density", noise.accel_density, 10.0)?,
                rate_density: degrees("rate_density", noise.rate_density, 100.0)?,
                accel_bias: noise_of("accel_bias", noise.accel_bias, 50.0)?,
                rate_bias: degrees("rate_bias", noise.rate_bias, 1000.0)?,
                accel_bias_jump: noise_of("accel_bias_jump", noise.accel_bias_jump, 50.0)?,
                rate_bias_jump: degrees("rate_bias_jump", noise.rate_bias_jump, 1000.0)?,
                accel_scale: noise_of("accel_scale", noise.accel_scale, 1.0)?,
                rate_scale: noise_of("rate_scale", noise.rate_scale, 1.0)?,
                accel_vibration: noise_of("accel_vibration", noise.accel_vibration, 100.0)?,
                rate_vibration: degrees("rate_vibration", noise.rate_vibration, 1000.0)?,
                mounting: [0.0; 3],
                mounting_sd: triple("imu.mounting_sd_deg", imu.mounting_sd_deg, 180.0)?
                    .map(f64::to_radians),
            },
            wheels: WheelSheet {
                present: true,
                latency_s: of("wheels.latency_ms", wheels.latency_ms, 1000.0)? / 1000.0,
                latency_sd_s: of("wheels.latency_sd_ms", wheels.latency_sd_ms, 1000.0)? / 1000.0,
                cutoff_mps: of("wheels.cutoff_kmh", wheels.cutoff_kmh, 30.0)? / 3.6,
                scale_sd: of("wheels.scale_sd", wheels.scale_sd, 1.0)?,
                scale_difference_sd: of(
                    "wheels.scale_difference_sd",
                    wheels.scale_difference_sd,
                    1.0,
                )?,
                noise_mps: of("wheels.noise_kmh", wheels.noise_kmh, 100.0)? / 3.6,
            },
            imu_place_sd: triple("vehicle.imu_position_sd_m", vehicle.imu_position_sd_m, 10.0)?,
            cg_place_sd: triple("vehicle.cg_position_sd_m", vehicle.cg_position_sd_m, 10.0)?,
        })
    }

    /// The same sheet with no figure at zero.
    #[must_use]
    pub(crate) fn floored(&self) -> Self {
        let mut sheet = self.clone();
        let (imu, wheels) = (&mut sheet.imu, &mut sheet.wheels);
        for figure in [
            &mut imu.accel_density,
            &mut imu.accel_bias,
            &mut imu.accel_bias_jump,
            &mut imu.accel_scale,
            &mut imu.rate_scale,
            &mut imu.accel_vibration,
            &mut wheels.scale_sd,
            &mut wheels.scale_difference_sd,
            &mut wheels.noise_mps,
            &mut wheels.latency_sd_s,
        ] {
            *figure = figure.max(LEAST);
        }
        for figure in [
            &mut imu.rate_density,
            &mut imu.rate_bias,
            &mut imu.rate_bias_jump,
            &mut imu.rate_vibration,
        ]
        .into_iter()
        .chain(&mut imu.mounting_sd)
        {
            *figure = figure.max(LEAST.to_radians());
        }
        for figure in sheet.imu_place_sd.iter_mut().chain(&mut sheet.cg_place_sd) {
            *figure = figure.max(1e-4);
        }
        sheet
    }

    /// What the simulator draws sensors from: the sheet's figures and nothing else. Where the sheet has a
    /// figure an axis, the root mean square.
    #[must_use]
    pub fn simulator(&self) -> Sheet {
        let rms = |x: [f64; 3]| (x.iter().map(|x| x * x).sum::<f64>() / 3.0).sqrt();
        let (imu, wheels) = (&self.imu, &self.wheels);
        let half = 3.0_f64.sqrt() * wheels.latency_sd_s;
        Sheet {
            accel_density: imu.accel_density,
            rate_density: imu.rate_density,
            accel_bias: imu.accel_bias,
            rate_bias: imu.rate_bias,
            accel_bias_jump: imu.accel_bias_jump,
            rate_bias_jump: imu.rate_bias_jump,
            accel_scale: imu.accel_scale,
            rate_scale: imu.rate_scale,
            accel_vibration: imu.accel_vibration / VIBRATION_GROWTH,
            rate_vibration: imu.rate_vibration / VIBRATION_GROWTH,
            accel_second: 0.0,
            rate_second: 0.0,
            asymmetry: 0.0,
            accel_range: imu.accel_range,
            rate_range: imu.rate_range,
            mounting: rms(imu.mounting_sd),
            imu_place: rms(self.imu_place_sd),
            cg_place: rms(self.cg_place_sd),
            jitter: 0.0,
            frame_loss: 0.0,
            wheel_latency: [
                (wheels.latency_s - half).max(0.0),
                wheels.latency_s + half.min(wheels.latency_s),
            ],
            wheel_cutoff: [wheels.cutoff_mps / 3.0, wheels.cutoff_mps],
            wheel_scale: wheels.scale_sd,
            wheel_scale_difference: wheels.scale_difference_sd,
            wheel_noise: wheels.noise_mps,
        }
    }
}

/// The file. Tables of the recorder's configuration that say nothing of the sensors are let through.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct SheetFile {
    name: Option<String>,
    #[serde(default)]
    typical_of: String,
    #[serde(default)]
    vehicle: VehicleTable,
    #[serde(default)]
    imu: ImuTable,
    #[serde(default)]
    wheels: WheelTable,
    #[serde(rename = "device")]
    _device: Option<IgnoredAny>,
    #[serde(rename = "bus")]
    _bus: Option<IgnoredAny>,
    #[serde(rename = "aux")]
    _aux: Option<IgnoredAny>,
    #[serde(rename = "ring")]
    _ring: Option<IgnoredAny>,
    #[serde(rename = "trigger")]
    _trigger: Option<IgnoredAny>,
    #[serde(rename = "raw")]
    _raw: Option<IgnoredAny>,
    #[serde(rename = "store")]
    _store: Option<IgnoredAny>,
    #[serde(rename = "spool")]
    _spool: Option<IgnoredAny>,
    #[serde(rename = "run")]
    _run: Option<IgnoredAny>,
    #[serde(rename = "serial")]
    _serial: Option<IgnoredAny>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct VehicleTable {
    imu_position_sd_m: [f64; 3],
    cg_position_sd_m: [f64; 3],
    #[serde(rename = "vin")]
    _vin: Option<IgnoredAny>,
    #[serde(rename = "name")]
    _name: Option<IgnoredAny>,
    #[serde(rename = "track_width_m")]
    _track_width_m: Option<IgnoredAny>,
    #[serde(rename = "imu_position_m")]
    _imu_position_m: Option<IgnoredAny>,
    #[serde(rename = "cg_position_m")]
    _cg_position_m: Option<IgnoredAny>,
}

impl Default for VehicleTable {
    fn default() -> Self {
        Self {
            imu_position_sd_m: [0.05; 3],
            cg_position_sd_m: [0.05; 3],
            _vin: None,
            _name: None,
            _track_width_m: None,
            _imu_position_m: None,
            _cg_position_m: None,
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct ImuTable {
    accel_range_g: Option<f64>,
    rate_range_degps: Option<f64>,
    mounting_sd_deg: [f64; 3],
    noise: NoiseTable,
    #[serde(rename = "axes")]
    _axes: Option<IgnoredAny>,
    #[serde(rename = "mounting_deg")]
    _mounting_deg: Option<IgnoredAny>,
    #[serde(rename = "accel")]
    _accel: Option<IgnoredAny>,
    #[serde(rename = "rate")]
    _rate: Option<IgnoredAny>,
    #[serde(rename = "accel_unit")]
    _accel_unit: Option<IgnoredAny>,
    #[serde(rename = "rate_unit")]
    _rate_unit: Option<IgnoredAny>,
    #[serde(rename = "accel_counter")]
    _accel_counter: Option<IgnoredAny>,
    #[serde(rename = "rate_counter")]
    _rate_counter: Option<IgnoredAny>,
}

impl Default for ImuTable {
    fn default() -> Self {
        Self {
            accel_range_g: None,
            rate_range_degps: None,
            mounting_sd_deg: [1.0; 3],
            noise: NoiseTable::default(),
            _axes: None,
            _mounting_deg: None,
            _accel: None,
            _rate: None,
            _accel_unit: None,
            _rate_unit: None,
            _accel_counter: None,
            _rate_counter: None,
        }
    }
}

/// The recorder's defaults.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct NoiseTable {
    accel_density: f64,
    rate_density: f64,
    accel_bias: f64,
    rate_bias: f64,
    accel_bias_jump: f64,
    rate_bias_jump: f64,
    accel_scale: f64,
    rate_scale: f64,
    accel_vibration: f64,
    rate_vibration: f64,
}

impl Default for NoiseTable {
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

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct WheelTable {
    latency_ms: f64,
    latency_sd_ms: f64,
    cutoff_kmh: f64,
    scale_sd: f64,
    scale_difference_sd: f64,
    noise_kmh: f64,
    #[serde(rename = "left")]
    _left: Option<IgnoredAny>,
    #[serde(rename = "right")]
    _right: Option<IgnoredAny>,
    #[serde(rename = "unit")]
    _unit: Option<IgnoredAny>,
    #[serde(rename = "radius_m")]
    _radius_m: Option<IgnoredAny>,
    #[serde(rename = "pulses_per_rev")]
    _pulses_per_rev: Option<IgnoredAny>,
    #[serde(rename = "wrap_bits")]
    _wrap_bits: Option<IgnoredAny>,
}

impl Default for WheelTable {
    fn default() -> Self {
        Self {
            latency_ms: 20.0,
            latency_sd_ms: 10.0,
            cutoff_kmh: 3.0,
            scale_sd: 0.01,
            scale_difference_sd: 0.001,
            noise_kmh: 0.2,
            _left: None,
            _right: None,
            _unit: None,
            _radius_m: None,
            _pulses_per_rev: None,
            _wrap_bits: None,
        }
    }
}
