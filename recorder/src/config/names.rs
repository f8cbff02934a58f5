//! Names of signals looked up in the DBC files, and what can be wrong with them.

use super::ConfigError;
use super::locate::nearest;
use super::mapping::Mapper;
use super::units::Quantity;
use crate::dbc::{MessageDef, SignalDef};
use crate::signal::Scaled;

/// A signal found by its name.
pub(super) struct Found<'a> {
    pub(super) bus: u8,
    pub(super) message: &'a MessageDef,
    pub(super) signal: &'a SignalDef,
    pub(super) scaled: Scaled,
    pub(super) id: u32,
}

impl<'a> Mapper<'a> {
    /// Notes that a sensor field has this signal; an error if another has it, or bits of it.
    pub(super) fn take(&mut self, key: &str, found: &Found<'_>) -> Result<(), ConfigError> {
        let name = format!("{}.{}", found.message.name, found.signal.name);
        for (other, other_key, bus, id, bits, selectors) in &self.taken {
            if (*bus, *id) != (found.bus, found.id) {
                continue;
            }
            if *other == name {
                return Err(self.twice(key, &name, other_key));
            }
            if *selectors == found.signal.selectors && bits.overlaps(&found.scaled.bits) {
                return Err(ConfigError::Overlap {
                    place: self.source.place(key),
                    key: key.to_owned(),
                    expected: format!("a signal with bits of its own, as {other_key} has {other}"),
                    found: format!("{name}, which overlaps it"),
                });
            }
        }
        self.taken.push((
            name,
            key.to_owned(),
            found.bus,
            found.id,
            found.scaled.bits,
            found.signal.selectors.clone(),
        ));
        Ok(())
    }

    pub(super) fn twice(&self, key: &str, signal: &str, other: &str) -> ConfigError {
        ConfigError::Overlap {
            place: self.source.place(key),
            key: key.to_owned(),
            expected: "a signal of its own".to_owned(),
            found: format!("{signal}, which {other} has already"),
        }
    }

    pub(super) fn unit_error(
        &self,
        key: &str,
        name: &str,
        quantity: Quantity,
        found: &str,
        remedy: &str,
    ) -> ConfigError {
        let remedy = if found.is_empty() {
            format!("the DBC gives none: set {remedy}")
        } else {
            format!("if the DBC is wrong, set {remedy}")
        };
        ConfigError::Unit {
            place: self.source.place(key),
            signal: name.to_owned(),
            expected: quantity.expected().to_owned(),
            found: found.to_owned(),
            remedy,
        }
    }

    /// Finds `MESSAGE.SIGNAL` or `BUS:MESSAGE.SIGNAL`.
    pub(super) fn find(&self, key: &str, name: &str) -> Result<Found<'a>, ConfigError> {
        let unknown = |expected: String, found: &str, hint: String| ConfigError::UnknownName {
            place: self.source.place(key),
            expected,
            found: found.to_owned(),
            hint,
        };
        let buses: Vec<&str> = self
            .config
            .bus
            .iter()
            .map(|bus| bus.interface.as_str())
            .collect();
        let (bus, rest) = match (name.split_once(':'), buses.as_slice()) {
            (Some((bus, rest)), _) => {
                let at = buses.iter().position(|known| *known == bus);
                (
                    at.ok_or_else(|| {
                        unknown(
                            "a configured interface".to_owned(),
                            bus,
                            nearest(bus, buses.iter().copied()),
                        )
                    })?,
                    rest,
                )
            }
            (None, [_]) => (0, name),
            (None, _) => {
                return Err(unknown(
                    format!("BUS:MESSAGE.SIGNAL, as there are {} buses", buses.len()),
                    name,
                    String::new(),
                ));
            }
        };
        let (message_name, signal_name) = rest
            .split_once('.')
            .ok_or_else(|| unknown("MESSAGE.SIGNAL".to_owned(), name, String::new()))?;
        let databases = self
            .databases
            .get(bus)
            .map(Vec::as_slice)
            .unwrap_or_default();
        let all = || databases.iter().flat_map(|database| &database.messages);
        let mut named = all().filter(|message| message.name == message_name);
        let message = named.next().ok_or_else(|| {
            let hint = nearest(message_name, all().map(|message| message.name.as_str()));
            unknown(
                format!("a message of the DBC of {}", buses.get(bus).unwrap_or(&"")),
                message_name,
                hint,
            )
        })?;
        if named.next().is_some() {
            return Err(ConfigError::Overlap {
                place: self.source.place(key),
                key: key.to_owned(),
                expected: "one message of that name on the bus".to_owned(),
                found: format!("two messages {message_name}"),
            });
        }
        let signal = message
            .signals
            .iter()
            .find(|signal| signal.name == signal_name)
            .ok_or_else(|| {
                let hint = nearest(
                    signal_name,
                    message.signals.iter().map(|signal| signal.name.as_str()),
                );
                unknown(format!("a signal of {message_name}"), signal_name, hint)
            })?;
        let wrong = |expected: &str, found: String| ConfigError::Value {
            place: self.source.place(key),
            key: key.to_owned(),
            expected: expected.to_owned(),
            found,
        };
        let id = message.id.clone().map_err(|text| {
            wrong(
                "a message that can be received",
                format!("{message_name}: {text}"),
            )
        })?;
        let scaled = signal
            .scaled
            .map_err(|error| wrong("a signal that can be read", format!("{name}: {error}")))?;
        let bus = u8::try_from(bus).unwrap_or(u8::MAX);
        Ok(Found {
            bus,
            message,
            signal,
            scaled,
            id,
        })
    }
}
