//! Units of the DBC: what one of them is in SI and radians.

use schema::units::STANDARD_GRAVITY;

/// What a signal measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Quantity {
    Accel,
    Rate,
    Wheel,
    Angle,
    Length,
    Speed,
    Time,
}

/// What a wheel signal counts in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum WheelUnit {
    /// m/s of one unit.
    Speed(f64),
    /// rad/s of one unit; needs the radius.
    Rate(f64),
    /// Pulses.
    Pulses,
}

impl Quantity {
    /// Units that are understood, for messages.
    pub(crate) fn expected(self) -> &'static str {
        match self {
            Self::Accel => "acceleration (m/s^2, m/s2, g, mg)",
            Self::Rate => "rate (deg/s, rad/s, mdeg/s, mrad/s, rpm)",
            Self::Wheel => "speed (km/h, kph, m/s, mph, rad/s, rpm, pulses)",
            Self::Angle => "angle (deg, rad, mdeg, mrad)",
            Self::Length => "length (m, cm, mm, km, ft)",
            Self::Speed => "speed (m/s, km/h, kn, mph, cm/s, mm/s)",
            Self::Time => "time (s, ms, us, ns, min, h)",
        }
    }
}

fn plain(unit: &str) -> String {
    unit.chars()
        .filter(|c| !matches!(c, ' ' | '^' | '*' | '(' | ')' | '[' | ']'))
        .map(|c| match c {
            '\u{B2}' => '2',
            other => other.to_ascii_lowercase(),
        })
        .collect()
}

/// Size of the unit in m/s^2.
pub(crate) fn accel(unit: &str) -> Option<f64> {
    match plain(unit).as_str() {
        "m/s2" | "m/s/s" | "mps2" | "m/sec2" | "ms-2" | "m/ss" => Some(1.0),
        "g" | "g0" | "gn" => Some(STANDARD_GRAVITY),
        "mg" => Some(STANDARD_GRAVITY / 1000.0),
        "cm/s2" => Some(0.01),
        "mm/s2" => Some(0.001),
        _ => None,
    }
}

/// Size of the unit in rad/s.
pub(crate) fn rate(unit: &str) -> Option<f64> {
    let degree = 1_f64.to_radians();
    match plain(unit).as_str() {
        "deg/s" | "deg/sec" | "degree/s" | "degrees/s" | "degrees/sec" | "degree/sec" | "dps"
        | "deg/second" | "\u{B0}/s" | "\u{B0}/sec" => Some(degree),
        "mdeg/s" | "mdps" => Some(degree / 1000.0),
        "rad/s" | "rad/sec" | "radians/s" => Some(1.0),
        "mrad/s" => Some(0.001),
        "rpm" | "1/min" | "u/min" => Some(std::f64::consts::TAU / 60.0),
        _ => None,
    }
}

/// What a wheel signal's unit is.
pub(crate) fn wheel(unit: &str) -> Option<WheelUnit> {
    match plain(unit).as_str() {
        "km/h" | "kph" | "kmh" | "km/hr" | "kmph" => Some(WheelUnit::Speed(1.0 / 3.6)),
        "m/s" | "mps" | "m/sec" => Some(WheelUnit::Speed(1.0)),
        "mph" | "mi/h" | "miles/h" => Some(WheelUnit::Speed(0.447_04)),
        "pulses" | "pulse" | "counts" | "count" | "ticks" | "tick" | "imp" | "edges" => {
            Some(WheelUnit::Pulses)
        }
        _ => rate(unit).map(WheelUnit::Rate),
    }
}

/// Size of the unit in SI and radians (times in ns), of what a satellite receiver sends.
pub(crate) fn receiver(quantity: Quantity, unit: &str) -> Option<f64> {
    let unit = plain(unit);
    match quantity {
        Quantity::Angle => angle(&unit),
        Quantity::Length => length(&unit),
        Quantity::Speed => speed(&unit),
        Quantity::Time => time(&unit),
        Quantity::Accel | Quantity::Rate | Quantity::Wheel => None,
    }
}

fn angle(unit: &str) -> Option<f64> {
    let degree = 1_f64.to_radians();
    match unit {
        "deg" | "degree" | "degrees" | "\u{B0}" => Some(degree),
        "mdeg" => Some(degree / 1000.0),
        "rad" | "radian" | "radians" => Some(1.0),
        "mrad" => Some(0.001),
        _ => None,
    }
}

fn length(unit: &str) -> Option<f64> {
    match unit {
        "m" | "metre" | "metres" | "meter" | "meters" => Some(1.0),
        "cm" => Some(0.01),
        "mm" => Some(0.001),
        "km" => Some(1000.0),
        "ft" | "feet" => Some(0.3048),
        _ => None,
    }
}

fn speed(unit: &str) -> Option<f64> {
    match (unit, wheel(unit)) {
        ("kn" | "kt" | "kts" | "knot" | "knots", _) => Some(1852.0 / 3600.0),
        ("cm/s", _) => Some(0.01),
        ("mm/s", _) => Some(0.001),
        (_, Some(WheelUnit::Speed(size))) => Some(size),
        _ => None,
    }
}

fn time(unit: &str) -> Option<f64> {
    match unit {
        "s" | "sec" | "second" | "seconds" => Some(1e9),
        "ms" => Some(1e6),
        "us" | "\u{B5}s" => Some(1e3),
        "ns" => Some(1.0),
        "min" => Some(60e9),
        "h" | "hour" | "hours" => Some(3600e9),
        _ => None,
    }
}
