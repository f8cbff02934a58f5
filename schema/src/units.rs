//! Newtypes for the edges (DBC, configuration, columns). Inside the crates everything is SI and radians.

/// Standard gravity, m/s^2 (exact by definition).
pub const STANDARD_GRAVITY: f64 = 9.806_65;

macro_rules! unit {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Default)]
        pub struct $name(pub f64);
    };
}

unit!(
    /// A speed in metres a second.
    MetersPerSecond
);
unit!(
    /// An acceleration or specific force in metres a second squared.
    MetersPerSecondSquared
);
unit!(
    /// An angular rate in radians a second.
    RadiansPerSecond
);
unit!(
    /// An angle in radians.
    Radians
);

impl MetersPerSecond {
    /// From kilometres an hour.
    #[must_use]
    pub fn from_kmh(kmh: f64) -> Self {
        Self(kmh / 3.6)
    }

    /// In kilometres an hour.
    #[must_use]
    pub fn kmh(self) -> f64 {
        self.0 * 3.6
    }
}

impl MetersPerSecondSquared {
    /// From multiples of standard gravity.
    #[must_use]
    pub fn from_g(g: f64) -> Self {
        Self(g * STANDARD_GRAVITY)
    }

    /// In multiples of standard gravity.
    #[must_use]
    pub fn g(self) -> f64 {
        self.0 / STANDARD_GRAVITY
    }
}

impl RadiansPerSecond {
    /// From degrees a second.
    #[must_use]
    pub fn from_degps(degps: f64) -> Self {
        Self(degps.to_radians())
    }

    /// In degrees a second.
    #[must_use]
    pub fn degps(self) -> f64 {
        self.0.to_degrees()
    }
}

impl Radians {
    /// From degrees.
    #[must_use]
    pub fn from_deg(deg: f64) -> Self {
        Self(deg.to_radians())
    }

    /// In degrees.
    #[must_use]
    pub fn deg(self) -> f64 {
        self.0.to_degrees()
    }
}
