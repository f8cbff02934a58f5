//! The columns of the two formats: names, units, ranges and decimals, in one place for reader and writer.

/// A column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Column {
    /// Name, with its unit, as the header has it.
    pub(super) name: &'static str,
    /// Unit in the file.
    pub(super) unit: &'static str,
    /// Least value.
    pub(super) low: f64,
    /// Greatest value.
    pub(super) high: f64,
    /// True if `high` itself is out of range.
    pub(super) below: bool,
    /// Decimals written.
    pub(super) decimals: usize,
}

impl Column {
    /// True for a value a car can meet; not for NaN.
    pub(super) fn holds(&self, value: f64) -> bool {
        value >= self.low && value <= self.high && !(self.below && value >= self.high)
    }

    /// The range for a person.
    pub(super) fn range(&self) -> String {
        let below = if self.below { "below " } else { "" };
        let gap = if self.unit.is_empty() { "" } else { " " };
        format!("{} to {below}{}{gap}{}", self.low, self.high, self.unit)
    }
}

const fn real(
    name: &'static str,
    unit: &'static str,
    low: f64,
    high: f64,
    decimals: usize,
) -> Column {
    Column {
        name,
        unit,
        low,
        high,
        below: false,
        decimals,
    }
}

const fn size(name: &'static str, unit: &'static str, limit: f64, decimals: usize) -> Column {
    real(name, unit, -limit, limit, decimals)
}

const fn whole(name: &'static str) -> Column {
    real(name, "", 0.0, 4_294_967_295.0, 0)
}

/// Of receivers that write "unknown" as their largest number.
const UNKNOWN_M: f64 = 1e7;
/// 200 g: more than crash tests show, in milli-g.
const ACCEL_MG: f64 = 200_000.0;
/// 28 turns a second, in degrees.
const RATE_DEG: f64 = 10_000.0;
/// Receivers for sale stop at 515 m/s.
const SPEED_MPS: f64 = 1000.0;
const WEEK: Column = real("gps_week", "", 0.0, 20_000.0, 0);
const TIME_OF_WEEK: Column = Column {
    below: true,
    ..real("gps_tow_s", "s", 0.0, 604_800.0, 3)
};
/// Wide enough for seconds since 1970.
const OBU: Column = real("obu_s", "s", 0.0, 1e10, 3);

const fn error_m(name: &'static str) -> Column {
    real(name, "m", 0.0, UNKNOWN_M, 4)
}

/// Of the fixes [S00, 6.1].
pub(super) const FIX: [Column; 35] = [
    whole("equipment"),
    whole("drive"),
    whole("leg"),
    whole("date_utc"),
    whole("time_utc"),
    WEEK,
    TIME_OF_WEEK,
    OBU,
    whole("good"),
    whole("fix_type"),
    size("latitude_deg", "deg", 90.0, 9),
    size("longitude_deg", "deg", 180.0, 9),
    real("ellipsoid_height_m", "m", -1000.0, 100_000.0, 4),
    real("sea_height_m", "m", -1000.0, 100_000.0, 4),
    real("speed_mps", "m/s", 0.0, SPEED_MPS, 4),
    size("course_deg", "deg", 360.0, 4),
    size("yaw_degps", "deg/s", RATE_DEG, 4),
    size("pitch_degps", "deg/s", RATE_DEG, 4),
    size("roll_degps", "deg/s", RATE_DEG, 4),
    error_m("horizontal_error_m"),
    error_m("vertical_error_m"),
    error_m("sd_north_m"),
    error_m("sd_east_m"),
    error_m("sd_down_m"),
    real("hdop", "", 0.0, 100_000.0, 3),
    real("pdop", "", 0.0, 100_000.0, 3),
    size("v_north_mps", "m/s", SPEED_MPS, 4),
    size("v_east_mps", "m/s", SPEED_MPS, 4),
    size("v_down_mps", "m/s", SPEED_MPS, 4),
    whole("satellites"),
    size("signal_quality", "", 1e9, 3),
    whole("sbas"),
    error_m("integrity_north_m"),
    error_m("integrity_east_m"),
    error_m("integrity_down_m"),
];

/// Of the motions [S00, 6.2].
pub(super) const MOTION: [Column; 14] = [
    FIX[0],
    FIX[1],
    FIX[2],
    FIX[3],
    FIX[4],
    WEEK,
    TIME_OF_WEEK,
    OBU,
    size("accel_x_mg", "milli-g", ACCEL_MG, 3),
    size("accel_y_mg", "milli-g", ACCEL_MG, 3),
    size("accel_z_mg", "milli-g", ACCEL_MG, 3),
    size("gyro_x_mdegps", "millideg/s", 1000.0 * RATE_DEG, 2),
    size("gyro_y_mdegps", "millideg/s", 1000.0 * RATE_DEG, 2),
    size("gyro_z_mdegps", "millideg/s", 1000.0 * RATE_DEG, 2),
];

#[cfg(test)]
mod tests {
    use super::{FIX, MOTION};

    #[test]
    fn ranges_hold_their_ends_and_no_nan() {
        for column in FIX.iter().chain(&MOTION) {
            assert!(column.holds(column.low) && !column.holds(f64::NAN));
            assert_eq!(column.holds(column.high), !column.below, "{}", column.name);
            assert!(!column.holds(column.low - 1.0) && !column.holds(column.high + 1.0));
            assert!(!column.name.contains(' '));
        }
        assert_eq!(FIX[6].range(), "0 to below 604800 s");
        assert_eq!(FIX[10].range(), "-90 to 90 deg");
        assert_eq!(FIX[24].range(), "0 to 100000");
    }
}
