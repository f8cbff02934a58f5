//! A DBC file: can-dbc reads the syntax, this module makes of it messages whose bits can be read.

use std::fs;
use std::path::{Path, PathBuf};

use can_dbc::{
    ByteOrder as DbcOrder, Dbc, MessageId, MultiplexIndicator, NumericValue,
    SignalExtendedValueType, ValueType,
};
use schema::num;

use crate::can::EFF;
use crate::signal::{Bits, BitsError, ByteOrder, Coding, Reading, Scaled, Selector, selected};

/// Largest DBC file that is read, bytes.
const MAX_FILE: u64 = 64 << 20;

/// Why a DBC can not be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DbcError {
    /// The file can not be read.
    #[error("{}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file is too large to be a DBC.
    #[error("{}: expected a DBC of at most {MAX_FILE} bytes, found {found}", path.display())]
    Large {
        /// The file.
        path: PathBuf,
        /// Its size.
        found: u64,
    },
    /// It is no DBC.
    #[error("{}: {message}", path.display())]
    Syntax {
        /// The file.
        path: PathBuf,
        /// What the parser says, with line and column.
        message: String,
    },
}

/// A message of the DBC.
#[derive(Clone, Debug)]
pub struct MessageDef {
    /// Name.
    pub name: String,
    /// Identifier as on the wire, with [`EFF`] for an extended one; or why it is none.
    pub id: Result<u32, String>,
    /// Payload bytes by the DBC.
    pub size: u64,
    /// Signals.
    pub signals: Vec<SignalDef>,
}

/// A signal of a message.
#[derive(Clone, Debug)]
pub struct SignalDef {
    /// Name.
    pub name: String,
    /// Bits, factor and offset; or why they can not be read.
    pub scaled: Result<Scaled, BitsError>,
    /// Multiplexors that must have a certain value, outermost first.
    pub selectors: Vec<Selector>,
    /// Minimum and maximum by the DBC; `None` where it gives `[0|0]`.
    pub range: Option<(f64, f64)>,
    /// Unit, trimmed.
    pub unit: String,
}

impl SignalDef {
    /// The physical value in a payload, in the DBC's unit.
    #[must_use]
    pub fn read(&self, data: &[u8]) -> Reading {
        match (&self.scaled, selected(&self.selectors, data)) {
            (Ok(scaled), Some(true)) => scaled.read(data),
            (_, Some(false)) => Reading::NotSelected,
            (Err(_), _) | (_, None) => Reading::TooShort,
        }
    }
}

/// A DBC file.
#[derive(Clone, Debug)]
pub struct Database {
    /// The file.
    pub path: PathBuf,
    /// Its messages.
    pub messages: Vec<MessageDef>,
}

impl Database {
    /// Reads a file: UTF-8, else Latin-1.
    ///
    /// # Errors
    /// When it can not be read or is no DBC.
    pub fn load(path: &Path) -> Result<Self, DbcError> {
        Self::check_size(path)?;
        let bytes = fs::read(path).map_err(|source| DbcError::Read {
            path: path.to_path_buf(),
            source,
        })?;
        Self::parse(path, &bytes)
    }

    /// Refuses a file too large to be read.
    pub(crate) fn check_size(path: &Path) -> Result<(), DbcError> {
        let found = fs::metadata(path)
            .map_err(|source| DbcError::Read {
                path: path.to_path_buf(),
                source,
            })?
            .len();
        if found > MAX_FILE {
            return Err(DbcError::Large {
                path: path.to_path_buf(),
                found,
            });
        }
        Ok(())
    }

    /// Parses the bytes of a file; `path` is for messages only.
    ///
    /// # Errors
    /// When they are no DBC.
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Self, DbcError> {
        let text = match std::str::from_utf8(bytes) {
            Ok(text) => text.trim_start_matches('\u{FEFF}').to_owned(),
            Err(_) => bytes.iter().copied().map(char::from).collect(),
        };
        let syntax = |message: String| DbcError::Syntax {
            path: path.to_path_buf(),
            message,
        };
        let dbc = Dbc::try_from(text.as_str()).map_err(|error| syntax(error.to_string()))?;
        let wrong_ids = standard_ids_beyond_11_bits(&text);
        let messages = dbc
            .messages
            .iter()
            .map(|message| {
                let wrong = wrong_ids.iter().find(|(name, _)| *name == message.name);
                let id = match (wrong, message.id) {
                    (Some((_, id)), _) => Err(format!(
                        "expected a standard identifier up to 2047, or an extended one with bit 31 set, found {id}"
                    )),
                    (None, MessageId::Standard(id)) => Ok(u32::from(id)),
                    (None, MessageId::Extended(id)) => Ok(id | EFF),
                };
                let signals = message.signals.iter().map(|signal| signal_def(&dbc, message, signal)).collect();
                MessageDef { name: message.name.clone(), id, size: message.size, signals }
            })
            .collect();
        Ok(Self {
            path: path.to_path_buf(),
            messages,
        })
    }
}

/// Messages with an identifier that the parser would cut to 16 bits without a word.
fn standard_ids_beyond_11_bits(text: &str) -> Vec<(&str, u64)> {
    text.lines()
        .filter_map(|line| {
            let mut words = line
                .trim_start()
                .strip_prefix("BO_ ")?
                .split([' ', '\t', ':'])
                .filter(|word| !word.is_empty());
            let id: u64 = words.next()?.parse().ok()?;
            let name = words.next()?;
            (id > 0x7FF && id < u64::from(EFF)).then_some((name, id))
        })
        .collect()
}

fn bits_of(
    dbc: &Dbc,
    message: &can_dbc::Message,
    signal: &can_dbc::Signal,
) -> Result<Bits, BitsError> {
    let extended = dbc
        .signal_extended_value_type_list
        .iter()
        .find(|entry| entry.message_id == message.id && entry.signal_name == signal.name)
        .map(|entry| entry.signal_extended_value_type);
    let coding = match (extended, signal.value_type) {
        (Some(SignalExtendedValueType::IEEEfloat32Bit), _) => Coding::Float32,
        (Some(SignalExtendedValueType::IEEEdouble64bit), _) => Coding::Float64,
        (_, ValueType::Signed) => Coding::Signed,
        (_, ValueType::Unsigned) => Coding::Unsigned,
    };
    let order = match signal.byte_order {
        DbcOrder::LittleEndian => ByteOrder::Little,
        DbcOrder::BigEndian => ByteOrder::Big,
    };
    Bits::new(signal.start_bit, signal.size, order, coding)
}

fn signal_def(dbc: &Dbc, message: &can_dbc::Message, signal: &can_dbc::Signal) -> SignalDef {
    let scaled = bits_of(dbc, message, signal).map(|bits| Scaled {
        bits,
        factor: signal.factor,
        offset: signal.offset,
    });
    let mut selectors = Vec::new();
    let scaled = match collect_selectors(dbc, message, signal, &mut selectors) {
        Ok(()) => scaled,
        Err(error) => Err(error),
    };
    selectors.reverse();
    let (min, max) = (real(signal.min), real(signal.max));
    SignalDef {
        name: signal.name.clone(),
        scaled,
        selectors,
        range: (min < max).then_some((min, max)),
        unit: signal.unit.trim().to_owned(),
    }
}

/// Adds the selectors of a signal, innermost first; at most as many as the message has signals.
fn collect_selectors(
    dbc: &Dbc,
    message: &can_dbc::Message,
    signal: &can_dbc::Signal,
    into: &mut Vec<Selector>,
) -> Result<(), BitsError> {
    let mut at = signal;
    for _ in 0..message.signals.len() {
        let value = match at.multiplexer_indicator {
            MultiplexIndicator::Plain | MultiplexIndicator::Multiplexor => return Ok(()),
            MultiplexIndicator::MultiplexedSignal(value)
            | MultiplexIndicator::MultiplexorAndMultiplexedSignal(value) => value,
        };
        let extended = dbc
            .extended_multiplex
            .iter()
            .filter(|entry| entry.message_id == message.id && entry.signal_name == at.name);
        let mut ranges = Vec::new();
        let mut selector_name = None;
        for entry in extended {
            selector_name = Some(entry.multiplexor_signal_name.as_str());
            ranges.extend(
                entry
                    .mappings
                    .iter()
                    .map(|pair| (pair.min_value, pair.max_value)),
            );
        }
        let selector = message.signals.iter().find(|other| match selector_name {
            Some(name) => other.name == name,
            None => other.multiplexer_indicator == MultiplexIndicator::Multiplexor,
        });
        if ranges.is_empty() {
            ranges.push((value, value));
        }
        // A multiplexed signal without a multiplexor in its message is always there.
        let Some(selector) = selector else {
            return Ok(());
        };
        into.push(Selector {
            bits: bits_of(dbc, message, selector)?,
            ranges,
        });
        at = selector;
    }
    Ok(())
}

fn real(value: NumericValue) -> f64 {
    match value {
        NumericValue::Uint(value) => num::real_u64(value),
        NumericValue::Int(value) => num::real_i64(value),
        NumericValue::Double(value) => value,
    }
}
