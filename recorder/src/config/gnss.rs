//! `[gnss]`: the satellite receiver, on a serial device or in signals of a CAN bus. Without the table no position is kept.

use schema::gnss::{GnssSheet, GnssSource};
use schema::num;
use serde::Deserialize;

use super::ConfigError;
use super::condition::Condition;
use super::file::Config;
use super::mapping::Mapper;
use super::settings::Check;
use super::units::{self, Quantity};
use crate::gnss::can::{Field, Rules};
use crate::plan::Role;

/// The table as written. Where no standard deviation is stated those of a consumer's receiver in a town are taken.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Table {
    receiver: Option<String>,
    device: Option<String>,
    baud: Option<u32>,
    latitude: Option<String>,
    longitude: Option<String>,
    position_unit: Option<String>,
    height: Option<String>,
    height_unit: Option<String>,
    speed: Option<String>,
    speed_unit: Option<String>,
    course: Option<String>,
    course_unit: Option<String>,
    climb: Option<String>,
    climb_unit: Option<String>,
    v_north: Option<String>,
    v_east: Option<String>,
    v_down: Option<String>,
    velocity_unit: Option<String>,
    utc: Option<String>,
    utc_unit: Option<String>,
    time_of_day: Option<String>,
    time_of_day_unit: Option<String>,
    quality: Option<String>,
    valid: Option<String>,
    valid_equals: Option<f64>,
    valid_above: Option<f64>,
    satellites: Option<String>,
    hdop: Option<String>,
    horizontal_sd: Option<String>,
    horizontal_sd_unit: Option<String>,
    height_sd: Option<String>,
    height_sd_unit: Option<String>,
    speed_sd: Option<String>,
    speed_sd_unit: Option<String>,
    course_sd: Option<String>,
    course_sd_unit: Option<String>,
    pair_ms: Option<f64>,
    antenna_position_m: Option<[f64; 3]>,
    antenna_position_sd_m: Option<[f64; 3]>,
    latency_ms: Option<f64>,
    latency_sd_ms: Option<f64>,
    horizontal_sd_m: Option<f64>,
    height_sd_m: Option<f64>,
    speed_sd_mps: Option<f64>,
}

/// Default of `baud`: what most modules in cars send at as they come. The 4,800 of the standard carry 480 characters a
/// second, hardly the six sentences of one fix.
const BAUD: u32 = 9600;
/// Default of `pair_ms`: frames of one fix are sent together.
const PAIR_MS: f64 = 20.0;
/// Defaults of `latency_ms` and its sd: receivers compute for some 50 to 150 ms.
const LATENCY_MS: f64 = 100.0;
const LATENCY_SD_MS: f64 = 100.0;
/// Defaults of the standard deviations: m, m, m/s.
const HORIZONTAL_SD: f64 = 5.0;
const HEIGHT_SD: f64 = 10.0;
const SPEED_SD: f64 = 0.3;

/// A serial device that sends NMEA 0183.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Device {
    /// Its path.
    pub path: String,
    /// Bits a second.
    pub baud: u32,
}

impl Device {
    /// What a byte takes on the line, ns: eight bits between a start and a stop bit.
    #[must_use]
    pub fn byte_ns(&self) -> i64 {
        10_000_000_000 / i64::from(self.baud.max(1))
    }
}

/// Signals that fixes are made of.
#[derive(Clone, Debug, PartialEq)]
pub struct Signals {
    /// What is mapped.
    pub fields: Vec<Field>,
    /// How it is put together.
    pub rules: Rules,
}

/// Where fixes come from.
#[derive(Clone, Debug, PartialEq)]
pub enum GnssInput {
    /// A serial device.
    Device(Device),
    /// Signals.
    Signals(Signals),
}

/// `[gnss]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Gnss {
    /// What the record says of the receiver.
    pub sheet: GnssSheet,
    /// Where fixes come from.
    pub input: GnssInput,
}

impl Gnss {
    /// The serial device, if it is one.
    #[must_use]
    pub fn device(&self) -> Option<&Device> {
        match &self.input {
            GnssInput::Device(device) => Some(device),
            GnssInput::Signals(_) => None,
        }
    }
}

/// A signal of the table: what it is of, its name, and the key of its unit with what was written there.
struct Entry<'a> {
    field: Field,
    signal: &'a str,
    unit: Option<(Quantity, &'static str, &'a Option<String>)>,
}

impl Table {
    fn signal(&self, field: Field) -> Option<&str> {
        let signal = match field {
            Field::Latitude => &self.latitude,
            Field::Longitude => &self.longitude,
            Field::Height => &self.height,
            Field::Speed => &self.speed,
            Field::Course => &self.course,
            Field::Climb => &self.climb,
            Field::VelocityNorth => &self.v_north,
            Field::VelocityEast => &self.v_east,
            Field::VelocityDown => &self.v_down,
            Field::Utc => &self.utc,
            Field::TimeOfDay => &self.time_of_day,
            Field::Quality => &self.quality,
            Field::Valid => &self.valid,
            Field::Satellites => &self.satellites,
            Field::Hdop => &self.hdop,
            Field::HorizontalSd => &self.horizontal_sd,
            Field::HeightSd => &self.height_sd,
            Field::SpeedSd => &self.speed_sd,
            Field::CourseSd => &self.course_sd,
        };
        signal.as_deref()
    }

    /// Quantity, key and text of a field's unit; `None` for plain numbers.
    fn unit(&self, field: Field) -> Option<(Quantity, &'static str, &Option<String>)> {
        use Quantity::{Angle, Length, Speed, Time};
        Some(match field {
            Field::Latitude | Field::Longitude => (Angle, "position_unit", &self.position_unit),
            Field::Height => (Length, "height_unit", &self.height_unit),
            Field::Speed => (Speed, "speed_unit", &self.speed_unit),
            Field::Course => (Angle, "course_unit", &self.course_unit),
            Field::Climb => (Speed, "climb_unit", &self.climb_unit),
            Field::VelocityNorth | Field::VelocityEast | Field::VelocityDown => {
                (Speed, "velocity_unit", &self.velocity_unit)
            }
            Field::Utc => (Time, "utc_unit", &self.utc_unit),
            Field::TimeOfDay => (Time, "time_of_day_unit", &self.time_of_day_unit),
            Field::HorizontalSd => (Length, "horizontal_sd_unit", &self.horizontal_sd_unit),
            Field::HeightSd => (Length, "height_sd_unit", &self.height_sd_unit),
            Field::SpeedSd => (Speed, "speed_sd_unit", &self.speed_sd_unit),
            Field::CourseSd => (Angle, "course_sd_unit", &self.course_sd_unit),
            Field::Quality | Field::Valid | Field::Satellites | Field::Hdop => return None,
        })
    }

    fn entries(&self) -> impl Iterator<Item = Entry<'_>> {
        Field::ALL.into_iter().filter_map(|field| {
            self.signal(field).map(|signal| Entry {
                field,
                signal,
                unit: self.unit(field),
            })
        })
    }

    fn has(&self, field: Field) -> bool {
        self.signal(field).is_some()
    }
}

impl Check<'_> {
    pub(super) fn gnss(&self, config: &Config) -> Result<Option<Gnss>, ConfigError> {
        let Some(table) = &config.gnss else {
            return Ok(None);
        };
        let expected = "either a device or signals latitude and longitude";
        let input = match (&table.device, table.entries().next()) {
            (Some(_), Some(entry)) => {
                let key = format!("gnss.{}", entry.field.key());
                return Err(self.wrong(&key, expected, "both"));
            }
            (Some(path), None) => GnssInput::Device(self.device(table, path)?),
            (None, Some(_)) => GnssInput::Signals(self.signals(table)?),
            (None, None) => return Err(self.wrong("gnss", expected, "neither")),
        };
        let sheet = self.sheet(table, &input)?;
        Ok(Some(Gnss { sheet, input }))
    }

    fn device(&self, table: &Table, path: &str) -> Result<Device, ConfigError> {
        if path.is_empty() || path.len() > 4096 {
            return Err(self.wrong("gnss.device", "the path of a serial device", path));
        }
        let baud = table.baud.unwrap_or(BAUD);
        if !(1200..=921_600).contains(&baud) {
            return Err(self.wrong("gnss.baud", "1200 to 921600", baud));
        }
        let of_signals = [
            ("pair_ms", table.pair_ms),
            ("valid_equals", table.valid_equals),
            ("valid_above", table.valid_above),
        ];
        if let Some((key, Some(value))) = of_signals.iter().find(|(_, value)| value.is_some()) {
            let expected = "no such key, as a device needs none";
            return Err(self.wrong(&format!("gnss.{key}"), expected, value));
        }
        Ok(Device {
            path: path.to_owned(),
            baud,
        })
    }

    fn signals(&self, table: &Table) -> Result<Signals, ConfigError> {
        let wrong = |key: &str, expected: &str, found: &str| {
            Err(self.wrong(&format!("gnss.{key}"), expected, found))
        };
        if let Some(baud) = table.baud {
            return wrong("baud", "a device beside it", &baud.to_string());
        }
        for (field, other) in [
            (Field::Latitude, Field::Longitude),
            (Field::Longitude, Field::Latitude),
            (Field::VelocityNorth, Field::VelocityEast),
            (Field::VelocityEast, Field::VelocityNorth),
        ] {
            if table.has(field) && !table.has(other) {
                return wrong(field.key(), &format!("{} beside it", other.key()), "none");
            }
        }
        if !table.has(Field::Latitude) {
            return wrong("latitude", "signals latitude and longitude", "none");
        }
        for (field, other) in [
            (Field::Speed, Field::VelocityNorth),
            (Field::Course, Field::VelocityNorth),
            (Field::Climb, Field::VelocityDown),
            (Field::Utc, Field::TimeOfDay),
        ] {
            if table.has(field) && table.has(other) {
                let expected = format!("one of {} and {}", field.key(), other.key());
                return wrong(field.key(), &expected, "both");
            }
        }
        let valid = match (&table.valid, table.valid_equals, table.valid_above) {
            (None, None, None) => None,
            (Some(_), Some(value), None) => Some(Condition::Equals(value)),
            (Some(_), None, Some(value)) => Some(Condition::Above(value)),
            (Some(_), both, _) => {
                let found = if both.is_some() { "both" } else { "neither" };
                return wrong("valid", "one of valid_equals and valid_above", found);
            }
            (None, equals, _) => {
                let key = equals.map_or("valid_above", |_| "valid_equals");
                return wrong(key, "a signal valid beside it", "none");
            }
        };
        let pair_ms = self.within("gnss.pair_ms", table.pair_ms.unwrap_or(PAIR_MS), 1.0, 500.0)?;
        Ok(Signals {
            fields: table.entries().map(|entry| entry.field).collect(),
            rules: Rules {
                pair_ns: num::round_i64(pair_ms * 1e6),
                valid,
                quality: table.has(Field::Quality),
            },
        })
    }

    fn sheet(&self, table: &Table, input: &GnssInput) -> Result<GnssSheet, ConfigError> {
        let number = |key: &str, value: Option<f64>, default: f64, low: f64, high: f64| {
            self.within(&format!("gnss.{key}"), value.unwrap_or(default), low, high)
        };
        let sd = |key: &str, value, default| number(key, value, default, 0.001, 1000.0);
        let ms = |key: &str, value, default, low: f64| {
            Ok::<_, ConfigError>(number(key, value, default, low, 60_000.0)? / 1000.0)
        };
        for (axis, metres) in table.antenna_position_m.iter().flatten().enumerate() {
            self.within(
                &format!("gnss.antenna_position_m[{axis}]"),
                *metres,
                -20.0,
                20.0,
            )?;
        }
        let antenna_position_sd_m = table.antenna_position_sd_m.unwrap_or([0.1; 3]);
        for (axis, metres) in antenna_position_sd_m.iter().enumerate() {
            let key = format!("gnss.antenna_position_sd_m[{axis}]");
            self.within(&key, *metres, 0.0, 10.0)?;
        }
        let (source, at) = match input {
            GnssInput::Device(device) => (
                GnssSource::Nmea,
                format!(
                    "NMEA 0183 on {}, {} bits a second",
                    device.path, device.baud
                ),
            ),
            GnssInput::Signals(_) => {
                let name = |entry: Entry<'_>| format!("{} {}", entry.field.key(), entry.signal);
                let names: Vec<String> = table.entries().map(name).collect();
                (GnssSource::Can, format!("CAN: {}", names.join(", ")))
            }
        };
        let name = table.receiver.as_deref().unwrap_or_default();
        if name.len() > 200 {
            return Err(self.wrong("gnss.receiver", "at most 200 bytes", name.len()));
        }
        let mut receiver = if name.is_empty() {
            at
        } else {
            format!("{name}; {at}")
        };
        // The record holds 65,535 bytes of it; names of a DBC are far shorter.
        while receiver.len() > 4096 {
            receiver.pop();
        }
        Ok(GnssSheet {
            source,
            receiver,
            antenna_position_m: table.antenna_position_m,
            antenna_position_sd_m,
            latency_s: ms("latency_ms", table.latency_ms, LATENCY_MS, -60_000.0)?,
            latency_sd_s: ms("latency_sd_ms", table.latency_sd_ms, LATENCY_SD_MS, 0.0)?,
            horizontal_sd_m: sd("horizontal_sd_m", table.horizontal_sd_m, HORIZONTAL_SD)?,
            height_sd_m: sd("height_sd_m", table.height_sd_m, HEIGHT_SD)?,
            speed_sd_mps: sd("speed_sd_mps", table.speed_sd_mps, SPEED_SD)?,
        })
    }
}

impl Mapper<'_> {
    pub(super) fn gnss(&mut self) -> Result<(), ConfigError> {
        let Some(table) = &self.config.gnss else {
            return Ok(());
        };
        for entry in table.entries() {
            let key = format!("gnss.{}", entry.field.key());
            let found = self.find(&key, entry.signal)?;
            let to_si = match entry.unit {
                None => 1.0,
                Some((quantity, unit_key, written)) => {
                    let unit = written.as_ref().unwrap_or(&found.signal.unit);
                    units::receiver(quantity, unit).ok_or_else(|| {
                        let remedy = format!("[gnss] {unit_key}");
                        self.unit_error(&key, entry.signal, quantity, unit, &remedy)
                    })?
                }
            };
            self.take(&key, &found)?;
            let role = Role::Gnss {
                field: entry.field,
                scaled: found.scaled,
                to_si,
                range: found.signal.range,
            };
            self.add(&found, role, None)?;
        }
        Ok(())
    }
}
