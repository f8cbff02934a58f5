//! Names of signals become a [`Plan`]: which message of which bus carries what.

use super::ConfigError;
use super::file::{Config, Wheels};
use super::locate::Source;
use super::names::Found;
use super::units::{self, Quantity, WheelUnit};
use crate::dbc::Database;
use crate::plan::{AuxName, Channel, MessagePlan, Plan, Role, Stream, Wheel, WheelKind};
use crate::signal::{Bits, Selector};

/// Builds the plan of a configuration.
pub(crate) struct Mapper<'a> {
    pub(crate) config: &'a Config,
    pub(crate) source: &'a Source<'a>,
    /// The DBC files of each bus.
    pub(crate) databases: &'a [Vec<Database>],
    /// Sensor fields assigned so far: signal as `bus:message.signal`, its key, bus and id, bits and selectors.
    pub(super) taken: Vec<(String, String, u8, u32, Bits, Vec<Selector>)>,
    pub(super) plan: Plan,
}

impl<'a> Mapper<'a> {
    pub(crate) fn new(
        config: &'a Config,
        source: &'a Source<'a>,
        databases: &'a [Vec<Database>],
    ) -> Self {
        Self {
            config,
            source,
            databases,
            taken: Vec::new(),
            plan: Plan::default(),
        }
    }

    /// The plan, or the first thing that is wrong.
    pub(crate) fn build(mut self) -> Result<Plan, ConfigError> {
        self.imu()?;
        if let Some(wheels) = &self.config.wheels {
            self.wheel(wheels, 0, "wheels.left", &wheels.left)?;
            self.wheel(wheels, 1, "wheels.right", &wheels.right)?;
        }
        self.aux()?;
        self.gnss()?;
        for (slot, trigger) in self.config.trigger.can.iter().enumerate() {
            let found = self.find(&format!("trigger.can[{slot}].signal"), &trigger.signal)?;
            let role = Role::Can {
                slot,
                scaled: found.scaled,
            };
            self.add(&found, role, None)?;
        }
        self.plan.index(self.config.bus.len());
        Ok(self.plan)
    }

    fn imu(&mut self) -> Result<(), ConfigError> {
        let imu = &self.config.imu;
        let counters = [
            ("imu.accel_counter", &imu.accel_counter),
            ("imu.rate_counter", &imu.rate_counter),
        ];
        let groups = [
            (
                "imu.accel",
                &imu.accel,
                Quantity::Accel,
                &imu.accel_unit,
                "accel_unit",
            ),
            (
                "imu.rate",
                &imu.rate,
                Quantity::Rate,
                &imu.rate_unit,
                "rate_unit",
            ),
        ];
        for (group, (key, names, quantity, unit, unit_key)) in groups.into_iter().enumerate() {
            let counter = match counters.get(group) {
                Some((key, Some(name))) => Some((*key, self.find(key, name)?)),
                _ => None,
            };
            let mut counted = false;
            for (axis, name) in names.iter().enumerate() {
                let key = format!("{key}[{axis}]");
                let found = self.find(&key, name)?;
                let text = unit.as_ref().unwrap_or(&found.signal.unit);
                let to_si = match quantity {
                    Quantity::Accel => units::accel(text),
                    _ => units::rate(text),
                };
                let to_si = to_si.ok_or_else(|| {
                    self.unit_error(&key, name, quantity, text, &format!("[imu] {unit_key}"))
                })?;
                self.take(&key, &found)?;
                let range = match quantity {
                    Quantity::Accel => imu
                        .accel_range_g
                        .map(|g| g * schema::units::STANDARD_GRAVITY),
                    _ => imu.rate_range_degps.map(f64::to_radians),
                };
                // The last step below the range can be the largest number the sensor sends.
                let limit = range.map_or(f64::INFINITY, |range| {
                    range - 1.5 * (found.scaled.factor * to_si).abs()
                });
                let channel = Channel {
                    axis: group * 3 + axis,
                    scaled: found.scaled,
                    to_si,
                    range: found.signal.range,
                    limit,
                };
                let bits = match &counter {
                    Some((_, counter)) if (counter.bus, counter.id) == (found.bus, found.id) => {
                        counted = true;
                        Some(counter.scaled.bits)
                    }
                    _ => None,
                };
                let role = Role::Imu {
                    number: 0,
                    channels: vec![channel],
                };
                self.add(&found, role, bits)?;
            }
            if let (Some((key, found)), false) = (&counter, counted) {
                return Err(ConfigError::Value {
                    place: self.source.place(key),
                    key: (*key).to_owned(),
                    expected: "a counter in the message that carries the axes".to_owned(),
                    found: found.message.name.clone(),
                });
            }
        }
        Ok(())
    }

    fn wheel(
        &mut self,
        wheels: &Wheels,
        side: usize,
        key: &str,
        name: &str,
    ) -> Result<(), ConfigError> {
        let found = self.find(key, name)?;
        let text = wheels.unit.as_ref().unwrap_or(&found.signal.unit);
        let unit = match (units::wheel(text), wheels.pulses_per_rev) {
            (Some(WheelUnit::Pulses), _) | (None, Some(_)) => WheelUnit::Pulses,
            (Some(unit), _) => unit,
            (None, None) => {
                return Err(self.unit_error(
                    key,
                    name,
                    Quantity::Wheel,
                    text,
                    "[wheels] unit (or pulses_per_rev)",
                ));
            }
        };
        let need = |value: Option<f64>, missing: &str| {
            value
                .filter(|value| *value > 0.0)
                .ok_or_else(|| ConfigError::Value {
                    place: self.source.place("wheels"),
                    key: format!("wheels.{missing}"),
                    expected: format!("a number above 0, as {name} is in `{text}`"),
                    found: value.map_or_else(|| "nothing".to_owned(), |value| value.to_string()),
                })
        };
        let kind = match unit {
            WheelUnit::Speed(size) => WheelKind::Speed(size),
            WheelUnit::Rate(size) => WheelKind::Speed(size * need(wheels.radius_m, "radius_m")?),
            WheelUnit::Pulses => {
                let round = std::f64::consts::TAU * need(wheels.radius_m, "radius_m")?;
                let bits = wheels.wrap_bits.unwrap_or(found.scaled.bits.size());
                if !(2..=32).contains(&bits) {
                    return Err(ConfigError::Value {
                        place: self.source.place("wheels.wrap_bits"),
                        key: "wheels.wrap_bits".to_owned(),
                        expected: "2 to 32".to_owned(),
                        found: bits.to_string(),
                    });
                }
                let metres = round / need(wheels.pulses_per_rev, "pulses_per_rev")?;
                WheelKind::Pulses {
                    metres,
                    wrap: 1 << bits,
                }
            }
        };
        self.take(key, &found)?;
        let role = Role::Wheel(Wheel {
            side,
            scaled: found.scaled,
            kind,
            range: found.signal.range,
        });
        self.add(&found, role, None)
    }

    fn aux(&mut self) -> Result<(), ConfigError> {
        let mut seen: Vec<(&str, &str)> = Vec::new();
        for (slot, (name, value)) in self.config.aux.iter().enumerate() {
            let key = format!("aux.{name}");
            let signal = value.as_str().ok_or_else(|| ConfigError::Value {
                place: self.source.place(&key),
                key: key.clone(),
                expected: "a string MESSAGE.SIGNAL".to_owned(),
                found: value.to_string(),
            })?;
            let found = self.find(&key, signal)?;
            if let Some((other, _)) = seen.iter().find(|(_, other)| *other == signal) {
                return Err(self.twice(&key, signal, &format!("aux.{other}")));
            }
            seen.push((name, signal));
            let unit = found.signal.unit.clone();
            self.plan.aux.push(AuxName {
                name: name.clone(),
                signal: signal.to_owned(),
                unit,
            });
            let role = Role::Aux {
                slot,
                scaled: found.scaled,
                range: found.signal.range,
            };
            self.add(&found, role, None)?;
        }
        Ok(())
    }

    /// Adds a role to the stream it belongs to; axes of one IMU that come in one frame share a stream.
    pub(super) fn add(
        &mut self,
        found: &Found<'_>,
        mut role: Role,
        counter: Option<Bits>,
    ) -> Result<(), ConfigError> {
        let same = |plan: &MessagePlan| (plan.bus, plan.id) == (found.bus, found.id);
        let at = if let Some(at) = self.plan.messages.iter().position(same) {
            at
        } else {
            let range_check = self
                .config
                .bus
                .get(usize::from(found.bus))
                .is_some_and(|bus| bus.range_check);
            let (bus, id, name) = (found.bus, found.id, found.message.name.clone());
            self.plan.messages.push(MessagePlan {
                bus,
                id,
                name,
                range_check,
                streams: Vec::new(),
            });
            self.plan.messages.len() - 1
        };
        let Some(message) = self.plan.messages.get_mut(at) else {
            return Ok(());
        };
        if message.name != found.message.name {
            return Err(ConfigError::Overlap {
                place: self.source.place("bus"),
                key: "bus".to_owned(),
                expected: "one mapped message for an identifier".to_owned(),
                found: format!(
                    "{} and {} with identifier {:X}",
                    message.name,
                    found.message.name,
                    found.id & 0x1FFF_FFFF
                ),
            });
        }
        if let Role::Imu { number, channels } = &mut role {
            for stream in &mut message.streams {
                if let Role::Imu {
                    channels: present, ..
                } = &mut stream.role
                    && stream.selectors == found.signal.selectors
                {
                    present.append(channels);
                    stream.counter = stream.counter.or(counter);
                    return Ok(());
                }
            }
            *number = self.plan.imu_streams;
            self.plan.imu_streams += 1;
        }
        message.streams.push(Stream {
            selectors: found.signal.selectors.clone(),
            counter,
            role,
        });
        Ok(())
    }
}
