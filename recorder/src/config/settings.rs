//! Valid settings: everything checked, SI and radians, signals resolved to bits.

use std::fmt;
use std::fs;
use std::path::Path;

use schema::header::{ImuSheet, Layout, Vehicle, WheelSheet};
use schema::units::{MetersPerSecond, MetersPerSecondSquared, Radians, RadiansPerSecond};
use sha2::{Digest, Sha256};

use super::ConfigError;
use super::condition::Condition;
use super::file::{AxesName, Config, LayoutName, OneOrMany, Threshold};
use super::gnss::Gnss;
use super::locate::Source;
use super::mapping::Mapper;
use super::operation::{Run, Serial, Spool, Store};
use crate::axes::Mounting;
use crate::dbc::{Database, DbcError};
use crate::plan::Plan;

/// A bus that is listened to.
#[derive(Clone, Debug)]
pub struct Bus {
    /// Name of the interface.
    pub interface: String,
}

/// `[ring]`.
#[derive(Clone, Copy, Debug)]
pub struct Ring {
    /// Samples before the first trigger that belong to a record.
    pub before: u64,
    /// Samples after the last trigger, before the tail.
    pub after: u64,
    /// Layout of the sealed blocks.
    pub layout: Layout,
}

/// A signal that triggers.
#[derive(Clone, Debug)]
pub struct CanTrigger {
    /// `MESSAGE.SIGNAL` as configured.
    pub signal: String,
    /// When.
    pub condition: Condition,
}

/// `[trigger]`.
#[derive(Clone, Debug)]
pub struct Triggers {
    /// Trigger 1, m/s^2.
    pub peak: Option<f64>,
    /// Trigger 2, m/s.
    pub delta_v: Option<f64>,
    /// A recording that was cut while the car moved becomes a record.
    pub power_loss: bool,
    /// Trigger 4.
    pub can: Vec<CanTrigger>,
}

/// Which frames are kept verbatim about a trigger.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RawFrames {
    /// Those that carry a mapped signal.
    Mapped,
    /// All of the configured interfaces.
    All,
    /// None.
    None,
}

/// `[raw]`.
#[derive(Clone, Copy, Debug)]
pub struct Raw {
    /// Which.
    pub frames: RawFrames,
    /// From so long before a trigger, ns.
    pub before_ns: i64,
    /// To so long after it, ns.
    pub after_ns: i64,
}

/// Everything the recorder needs to know, valid.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Name of the device, may be empty.
    pub device_id: String,
    /// The car.
    pub vehicle: Vehicle,
    /// The IMU's data sheet.
    pub imu: ImuSheet,
    /// From the sensor's axes to the body's.
    pub mounting: Mounting,
    /// The wheels' data sheet.
    pub wheels: WheelSheet,
    /// Buses in the order of the file.
    pub buses: Vec<Bus>,
    /// What each message carries.
    pub plan: Plan,
    /// `[ring]`.
    pub ring: Ring,
    /// `[trigger]`.
    pub trigger: Triggers,
    /// `[raw]`.
    pub raw: Raw,
    /// `[store]`.
    pub store: Store,
    /// The ring on disk: `[spool]`.
    pub spool: Spool,
    /// The daemon: `[run]`.
    pub run: Run,
    /// The read-out over a serial line: `[serial]`.
    pub serial: Option<Serial>,
    /// The satellite receiver: `[gnss]`.
    pub gnss: Option<Gnss>,
    /// SHA-256 of the configuration's bytes.
    pub config_sha256: [u8; 32],
}

impl Settings {
    /// Reads a file; relative paths in it are relative to its folder.
    ///
    /// # Errors
    /// The first thing that is wrong, with file and line.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        let text = fs::read_to_string(path).map_err(|source| ConfigError::Read {
            path: path.to_path_buf(),
            source,
        })?;
        let base_dir = path.parent().unwrap_or(Path::new(""));
        Self::from_text(path, &text, base_dir, &Database::load)
    }

    /// Reads a text; relative paths in it are relative to `base_dir`.
    ///
    /// # Errors
    /// The first thing that is wrong, with its line.
    pub fn from_toml_str(text: &str, base_dir: &Path) -> Result<Self, ConfigError> {
        Self::from_text(Path::new("configuration"), text, base_dir, &Database::load)
    }

    /// As the others; `load` gives the DBC of a path.
    pub(super) fn from_text(
        file: &Path,
        text: &str,
        base_dir: &Path,
        load: &Load<'_>,
    ) -> Result<Self, ConfigError> {
        let source = Source::new(file, text);
        let config = Config::parse(&source, text)?;
        let check = Check { source: &source };
        let databases = check.buses(&config, base_dir, load)?;
        let imu = check.imu(&config)?;
        let settings = Self {
            device_id: config.device.id.clone(),
            vehicle: check.vehicle(&config)?,
            mounting: Mounting::new(
                matches!(config.imu.axes, AxesName::FrontLeftUp),
                imu.mounting,
            ),
            wheels: check.wheels(&config)?,
            buses: config
                .bus
                .iter()
                .map(|bus| Bus {
                    interface: bus.interface.clone(),
                })
                .collect(),
            ring: check.ring(&config)?,
            trigger: check.trigger(&config)?,
            raw: check.raw(&config)?,
            store: check.store(&config, base_dir)?,
            spool: check.spool(&config, base_dir)?,
            run: check.run(&config, base_dir)?,
            serial: check.serial(&config)?,
            gnss: check.gnss(&config)?,
            config_sha256: Sha256::digest(text.as_bytes()).into(),
            plan: Mapper::new(&config, &source, &databases).build()?,
            imu,
        };
        Ok(settings)
    }
}

/// Gives the DBC of a path.
pub(super) type Load<'a> = dyn Fn(&Path) -> Result<Database, DbcError> + 'a;

/// The checks, with the text to name lines of.
pub(super) struct Check<'a> {
    source: &'a Source<'a>,
}

impl Check<'_> {
    pub(super) fn wrong(&self, key: &str, expected: &str, found: impl fmt::Display) -> ConfigError {
        ConfigError::Value {
            place: self.source.place(key),
            key: key.to_owned(),
            expected: expected.to_owned(),
            found: format!("{found}"),
        }
    }

    /// A number within bounds, both included; NaN is never within.
    pub(super) fn within(
        &self,
        key: &str,
        value: f64,
        low: f64,
        high: f64,
    ) -> Result<f64, ConfigError> {
        if (low..=high).contains(&value) {
            Ok(value)
        } else {
            Err(self.wrong(key, &format!("{low} to {high}"), value))
        }
    }

    fn buses(
        &self,
        config: &Config,
        base_dir: &Path,
        load: &Load<'_>,
    ) -> Result<Vec<Vec<Database>>, ConfigError> {
        if config.bus.is_empty() || config.bus.len() > 64 {
            return Err(self.wrong("bus", "1 to 64 buses", config.bus.len()));
        }
        let mut databases = Vec::new();
        for (at, bus) in config.bus.iter().enumerate() {
            let key = format!("bus[{at}].interface");
            if bus.interface.is_empty() || bus.interface.len() > 64 {
                return Err(self.wrong(&key, "a name of 1 to 64 bytes", &bus.interface));
            }
            if config
                .bus
                .iter()
                .take(at)
                .any(|other| other.interface == bus.interface)
            {
                return Err(ConfigError::Overlap {
                    place: self.source.place(&key),
                    key,
                    expected: "an interface that no other bus names".to_owned(),
                    found: format!("{} a second time", bus.interface),
                });
            }
            let files = match &bus.dbc {
                OneOrMany::One(file) => std::slice::from_ref(file),
                OneOrMany::Many(files) => files.as_slice(),
            };
            let load = |file: &String| {
                load(&base_dir.join(file)).map_err(|source| ConfigError::Dbc {
                    place: self.source.place(&format!("bus[{at}].dbc")),
                    source,
                })
            };
            databases.push(files.iter().map(load).collect::<Result<Vec<_>, _>>()?);
        }
        Ok(databases)
    }

    fn vehicle(&self, config: &Config) -> Result<Vehicle, ConfigError> {
        let vehicle = &config.vehicle;
        let position = |key: &str, value: Option<[f64; 3]>| {
            for (axis, metres) in value.iter().flatten().enumerate() {
                self.within(&format!("vehicle.{key}[{axis}]"), *metres, -20.0, 20.0)?;
            }
            Ok(value)
        };
        let sd = |key: &str, value: Option<[f64; 3]>| {
            let value = value.unwrap_or([0.05; 3]);
            for (axis, metres) in value.iter().enumerate() {
                self.within(&format!("vehicle.{key}[{axis}]"), *metres, 0.0, 10.0)?;
            }
            Ok(value)
        };
        Ok(Vehicle {
            vin: vehicle.vin.clone(),
            name: vehicle.name.clone(),
            track_width_m: self.within("vehicle.track_width_m", vehicle.track_width_m, 0.3, 5.0)?,
            imu_position_m: position("imu_position_m", vehicle.imu_position_m)?,
            imu_position_sd_m: sd("imu_position_sd_m", vehicle.imu_position_sd_m)?,
            cg_position_m: position("cg_position_m", vehicle.cg_position_m)?,
            cg_position_sd_m: sd("cg_position_sd_m", vehicle.cg_position_sd_m)?,
        })
    }

    fn imu(&self, config: &Config) -> Result<ImuSheet, ConfigError> {
        let (imu, noise) = (&config.imu, &config.imu.noise);
        let angles =
            |key: &str, degrees: [f64; 3], low: f64, high: f64| -> Result<[f64; 3], ConfigError> {
                let mut radians = [0.0; 3];
                for (axis, (into, degree)) in radians.iter_mut().zip(degrees).enumerate() {
                    *into = Radians::from_deg(self.within(
                        &format!("imu.{key}[{axis}]"),
                        degree,
                        low,
                        high,
                    )?)
                    .0;
                }
                Ok(radians)
            };
        let range = |key: &str, value: Option<f64>, high: f64| {
            value
                .map(|value| self.within(&format!("imu.{key}"), value, 0.1, high))
                .transpose()
        };
        let noise_of = |key: &str, value: f64, high: f64| {
            self.within(&format!("imu.noise.{key}"), value, 0.0, high)
        };
        let degps = |key: &str, value: f64, high: f64| {
            Ok(RadiansPerSecond::from_degps(noise_of(key, value, high)?).0)
        };
        Ok(ImuSheet {
            accel_range: range("accel_range_g", imu.accel_range_g, 10_000.0)?
                .map(|g| MetersPerSecondSquared::from_g(g).0),
            rate_range: range("rate_range_degps", imu.rate_range_degps, 100_000.0)?
                .map(|rate| RadiansPerSecond::from_degps(rate).0),
            accel_density: noise_of("accel_density", noise.accel_density, 10.0)?,
            rate_density: degps("rate_density", noise.rate_density, 100.0)?,
            accel_bias: noise_of("accel_bias", noise.accel_bias, 50.0)?,
            rate_bias: degps("rate_bias", noise.rate_bias, 1000.0)?,
            accel_bias_jump: noise_of("accel_bias_jump", noise.accel_bias_jump, 50.0)?,
            rate_bias_jump: degps("rate_bias_jump", noise.rate_bias_jump, 1000.0)?,
            accel_scale: noise_of("accel_scale", noise.accel_scale, 1.0)?,
            rate_scale: noise_of("rate_scale", noise.rate_scale, 1.0)?,
            accel_vibration: noise_of("accel_vibration", noise.accel_vibration, 100.0)?,
            rate_vibration: degps("rate_vibration", noise.rate_vibration, 1000.0)?,
            mounting: angles("mounting_deg", imu.mounting_deg, -180.0, 180.0)?,
            mounting_sd: angles("mounting_sd_deg", imu.mounting_sd_deg, 0.0, 180.0)?,
        })
    }

    fn wheels(&self, config: &Config) -> Result<WheelSheet, ConfigError> {
        let Some(wheels) = &config.wheels else {
            return Ok(WheelSheet {
                present: false,
                latency_s: 0.0,
                latency_sd_s: 0.0,
                cutoff_mps: 0.0,
                scale_sd: 0.0,
                scale_difference_sd: 0.0,
                noise_mps: 0.0,
            });
        };
        let value = |key: &str, value: f64, high: f64| {
            self.within(&format!("wheels.{key}"), value, 0.0, high)
        };
        Ok(WheelSheet {
            present: true,
            latency_s: value("latency_ms", wheels.latency_ms, 1000.0)? / 1000.0,
            latency_sd_s: value("latency_sd_ms", wheels.latency_sd_ms, 1000.0)? / 1000.0,
            cutoff_mps: MetersPerSecond::from_kmh(value("cutoff_kmh", wheels.cutoff_kmh, 30.0)?).0,
            scale_sd: value("scale_sd", wheels.scale_sd, 1.0)?,
            scale_difference_sd: value("scale_difference_sd", wheels.scale_difference_sd, 1.0)?,
            noise_mps: MetersPerSecond::from_kmh(value("noise_kmh", wheels.noise_kmh, 100.0)?).0,
        })
    }

    fn ring(&self, config: &Config) -> Result<Ring, ConfigError> {
        let ring = &config.ring;
        let seconds = self.within("ring.seconds", ring.seconds, 30.0, 120.0)?;
        let after = self.within("ring.post_trigger_s", ring.post_trigger_s, 1.0, 60.0)?;
        if after >= seconds {
            return Err(self.wrong(
                "ring.post_trigger_s",
                &format!("less than ring.seconds ({seconds})"),
                after,
            ));
        }
        let samples = |seconds: f64| schema::num::u64_of(schema::num::round_usize(seconds * 100.0));
        Ok(Ring {
            before: samples(seconds - after),
            after: samples(after),
            layout: match ring.layout {
                LayoutName::Full => Layout::Full,
                LayoutName::TwoRate => Layout::TwoRate,
            },
        })
    }

    fn trigger(&self, config: &Config) -> Result<Triggers, ConfigError> {
        let peak = match config.trigger.peak_g {
            Threshold::Switch(false) => None,
            Threshold::Switch(true) => {
                return Err(self.wrong("trigger.peak_g", "50 to 80, or false", true));
            }
            Threshold::Value(g) => Some(self.within("trigger.peak_g", g, 50.0, 80.0)?),
        };
        if let (Some(peak), Some(range)) = (peak, config.imu.accel_range_g)
            && peak > range
        {
            let expected =
                format!("at most the sensor's range (imu.accel_range_g = {range}), or false");
            return Err(self.wrong("trigger.peak_g", &expected, peak));
        }
        let delta_v = match config.trigger.delta_v_kmh {
            Threshold::Switch(false) => None,
            Threshold::Switch(true) => {
                return Err(self.wrong("trigger.delta_v_kmh", "1 to 100, or false", true));
            }
            Threshold::Value(kmh) => Some(self.within("trigger.delta_v_kmh", kmh, 1.0, 100.0)?),
        };
        let mut can = Vec::new();
        for (at, trigger) in config.trigger.can.iter().enumerate() {
            let condition = match (trigger.equals, trigger.above) {
                (Some(value), None) => Condition::Equals(value),
                (None, Some(value)) => Condition::Above(value),
                _ => {
                    return Err(self.wrong(
                        &format!("trigger.can[{at}]"),
                        "one of equals and above",
                        "both or neither",
                    ));
                }
            };
            can.push(CanTrigger {
                signal: trigger.signal.clone(),
                condition,
            });
        }
        if can.len() > 16 {
            return Err(self.wrong("trigger.can", "at most 16", can.len()));
        }
        Ok(Triggers {
            peak: peak.map(|g| MetersPerSecondSquared::from_g(g).0),
            delta_v: delta_v.map(|kmh| MetersPerSecond::from_kmh(kmh).0),
            power_loss: config.trigger.power_loss,
            can,
        })
    }
}
