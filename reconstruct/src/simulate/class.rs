//! The classes of crash and the grades of sensor that a seed is drawn for.

use std::fmt;
use std::str::FromStr;

use super::SimulateError;

/// What happens.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Class {
    /// Struck from the front, within 15 degrees.
    Frontal,
    /// Struck from 20 to 60 degrees off the front, with spin.
    Oblique,
    /// Struck from 60 to 110 degrees, with spin.
    Side,
    /// Struck from behind, within 20 degrees.
    Rear,
    /// Two impacts, 1 to 4 s apart.
    Double,
    /// A stop and a stand at lights in the last half minute, then a frontal or oblique impact.
    Lights,
    /// An impact and a roll onto the roof, where the car rests.
    Roof,
    /// Full braking to rest, no impact.
    Stop,
    /// A drive that ends in an ordinary stop without wheel slip.
    Drive,
    /// No motion at all.
    Still,
}

impl Class {
    /// Every class, in the order of the list.
    pub const ALL: [Self; 10] = [
        Self::Frontal,
        Self::Oblique,
        Self::Side,
        Self::Rear,
        Self::Double,
        Self::Lights,
        Self::Roof,
        Self::Stop,
        Self::Drive,
        Self::Still,
    ];

    /// The classes with an impact after which the car rests on its wheels.
    pub const CRASHES: [Self; 6] = [
        Self::Frontal,
        Self::Oblique,
        Self::Side,
        Self::Rear,
        Self::Double,
        Self::Lights,
    ];

    /// The name used on the command line and in file names.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Frontal => "frontal",
            Self::Oblique => "oblique",
            Self::Side => "side",
            Self::Rear => "rear",
            Self::Double => "double",
            Self::Lights => "lights",
            Self::Roof => "roof",
            Self::Stop => "stop",
            Self::Drive => "drive",
            Self::Still => "still",
        }
    }

    /// One sentence about it.
    #[must_use]
    pub const fn about(self) -> &'static str {
        match self {
            Self::Frontal => "braking, then an impact from the front, delta-V 8 to 80 km/h",
            Self::Oblique => "impact from 20 to 60 degrees off the front, spin to 220 deg/s",
            Self::Side => "impact from the side, spin to 220 deg/s",
            Self::Rear => "impact from behind",
            Self::Double => "two impacts, 1 to 4 s apart",
            Self::Lights => "a stand at lights within the last half minute, then an impact",
            Self::Roof => "an impact and a roll-over; rest on the roof",
            Self::Stop => "full braking to rest, no impact",
            Self::Drive => "a drive that ends in an ordinary stop",
            Self::Still => "no motion at all",
        }
    }
}

impl fmt::Display for Class {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Class {
    type Err = SimulateError;

    fn from_str(text: &str) -> Result<Self, SimulateError> {
        Self::ALL
            .into_iter()
            .find(|class| class.name() == text)
            .ok_or_else(|| SimulateError::UnknownClass(text.to_owned()))
    }
}

/// How good the sensors are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Grade {
    /// Tactical IMU, bias 0.02 m/s^2 and 0.01 deg/s, mounted with care.
    Tactical,
    /// Consumer MEMS, the default.
    #[default]
    Consumer,
    /// No error of any sensor; the motion is the same.
    Perfect,
}

impl Grade {
    /// Every grade.
    pub const ALL: [Self; 3] = [Self::Tactical, Self::Consumer, Self::Perfect];

    /// The name used on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Tactical => "tactical",
            Self::Consumer => "consumer",
            Self::Perfect => "perfect",
        }
    }
}

impl fmt::Display for Grade {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Grade {
    type Err = SimulateError;

    fn from_str(text: &str) -> Result<Self, SimulateError> {
        Self::ALL
            .into_iter()
            .find(|grade| grade.name() == text)
            .ok_or_else(|| SimulateError::UnknownGrade(text.to_owned()))
    }
}
