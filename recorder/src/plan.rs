//! What each mapped message carries: the configuration's names, resolved to bits.

use std::collections::HashMap;

use schema::num;

use crate::gnss::can::Field;
use crate::signal::{Bits, Scaled, Selector};

/// One axis of the IMU within a message.
#[derive(Clone, Debug)]
pub struct Channel {
    /// 0 to 2: accelerometer x, y, z; 3 to 5: gyro x, y, z (the sensor's own axes).
    pub axis: usize,
    /// Where it is, in the DBC's unit.
    pub scaled: Scaled,
    /// SI (m/s^2, rad/s) of one DBC unit.
    pub to_si: f64,
    /// The DBC's minimum and maximum, DBC unit.
    pub range: Option<(f64, f64)>,
    /// A magnitude from here on stands at the sensor's limit, SI; infinite if the range is not known.
    pub limit: f64,
}

/// How a wheel signal becomes a speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WheelKind {
    /// m/s of one DBC unit.
    Speed(f64),
    /// A counter: metres of one count, and the count it wraps at.
    Pulses {
        /// Metres.
        metres: f64,
        /// Counts.
        wrap: u64,
    },
}

/// One wheel's signal.
#[derive(Clone, Debug)]
pub struct Wheel {
    /// 0 left, 1 right.
    pub side: usize,
    /// Where it is.
    pub scaled: Scaled,
    /// What it means.
    pub kind: WheelKind,
    /// The DBC's minimum and maximum, DBC unit.
    pub range: Option<(f64, f64)>,
}

/// What a stream carries.
#[derive(Clone, Debug)]
pub enum Role {
    /// Axes of the IMU that come in one frame; the stream's number among the IMU's.
    Imu {
        /// Number of the stream, from 0.
        number: usize,
        /// The axes.
        channels: Vec<Channel>,
    },
    /// A wheel.
    Wheel(Wheel),
    /// An auxiliary signal.
    Aux {
        /// Its place in [`Plan::aux`].
        slot: usize,
        /// Where it is.
        scaled: Scaled,
        /// The DBC's minimum and maximum.
        range: Option<(f64, f64)>,
    },
    /// What a satellite receiver says.
    Gnss {
        /// Of what.
        field: Field,
        /// Where it is.
        scaled: Scaled,
        /// SI and radians (times: ns) of one DBC unit.
        to_si: f64,
        /// The DBC's minimum and maximum.
        range: Option<(f64, f64)>,
    },
    /// A trigger signal.
    Can {
        /// Its place among the CAN triggers.
        slot: usize,
        /// Where it is.
        scaled: Scaled,
    },
}

/// What one message carries under one setting of its multiplexors.
#[derive(Clone, Debug)]
pub struct Stream {
    /// Multiplexors and their values.
    pub selectors: Vec<Selector>,
    /// Rolling counter.
    pub counter: Option<Bits>,
    /// What it carries.
    pub role: Role,
}

/// A message that carries something mapped.
#[derive(Clone, Debug)]
pub struct MessagePlan {
    /// Index of the bus.
    pub bus: u8,
    /// Identifier with SocketCAN's flag of extended ones.
    pub id: u32,
    /// Name in the DBC.
    pub name: String,
    /// A value outside the DBC's range is missing.
    pub range_check: bool,
    /// What it carries.
    pub streams: Vec<Stream>,
}

/// An auxiliary signal's names.
#[derive(Clone, Debug)]
pub struct AuxName {
    /// Key in the configuration.
    pub name: String,
    /// `MESSAGE.SIGNAL` as configured.
    pub signal: String,
    /// Unit from the DBC.
    pub unit: String,
}

/// Every mapped message.
#[derive(Clone, Debug, Default)]
pub struct Plan {
    /// The messages.
    pub messages: Vec<MessagePlan>,
    /// Number of IMU streams.
    pub imu_streams: usize,
    /// Auxiliary signals in order of their names.
    pub aux: Vec<AuxName>,
    by_id: HashMap<(u8, u32), usize>,
    standard: Vec<u16>,
}

impl Plan {
    /// The plan of a message, if it carries anything mapped.
    #[must_use]
    pub fn find(&self, bus: u8, id: u32) -> Option<&MessagePlan> {
        // Standard identifiers by table, as nearly all are; the rest by hash.
        let at = if id < 0x800 {
            let slot = usize::from(bus) * 0x800 + num::usize_of(u64::from(id));
            match self.standard.get(slot) {
                Some(&at) if at != u16::MAX => usize::from(at),
                _ => return None,
            }
        } else {
            *self.by_id.get(&(bus, id))?
        };
        self.messages.get(at)
    }

    pub(crate) fn index(&mut self, buses: usize) {
        self.standard = vec![u16::MAX; buses * 0x800];
        for (at, message) in self.messages.iter().enumerate() {
            self.by_id.insert((message.bus, message.id), at);
            let slot = usize::from(message.bus) * 0x800 + num::usize_of(u64::from(message.id));
            if message.id < 0x800
                && let (Some(entry), Ok(at)) = (self.standard.get_mut(slot), u16::try_from(at))
            {
                *entry = at;
            }
        }
    }
}
