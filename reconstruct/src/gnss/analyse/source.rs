//! The figures of S00 that stand beside ours.

use super::spans::Situation;

/// Gravity at Trondheim as S00 has it, m/s^2 [S00, 5.2].
pub const GRAVITY: f64 = 9.821_71;
/// Rate at which the gyro of S00 wraps, rad/s [S00, 5.2].
pub const WRAP: f64 = 0.6;
/// Fixes compared per set [S00, 4.1].
pub const COMPARED: &str = "first 1000 fixes";

/// Variance of the specific force x, y, z, (m/s^2)^2, and of the rate x, y, z, (rad/s)^2; S00 prints the units without the square
/// [S00, tables 4.4 and 4.5].
#[must_use]
pub fn variance(situation: Situation) -> Option<[f64; 6]> {
    match situation {
        Situation::Rest => Some([1.877e-4, 2.189e-4, 3.517e-4, 7.02e-6, 5.14e-6, 7.36e-6]),
        Situation::Stop => Some([1.986e-3, 1.090e-3, 1.930e-2, 5.65e-6, 4.38e-6, 7.22e-6]),
        Situation::Straight => Some([9.949e-2, 4.694e-2, 2.0443e-1, 1.829e-4, 5.503e-4, 2.908e-5]),
        Situation::Driving => None,
    }
}

/// Mean rate at four stops, x, y, z, rad/s, with the seconds of the set [S00, table 4.6].
pub const BIAS: [(&str, [f64; 3]); 4] = [
    ("381 to 385", [-0.004_23, 0.003_31, -0.003_82]),
    ("1001 to 1005", [-0.003_94, 0.003_19, -0.003_24]),
    ("2701 to 2705", [-0.001_61, 0.003_15, -0.001_76]),
    ("3061 to 3065", [-0.001_73, 0.003_14, -0.001_70]),
];

/// Readings in the order of [`super::positions::POSITIONS`], m/s^2: x -1 g, x +1 g, y +1 g, y -1 g, z "+1 g" (negative, so the axis pointed
/// down), z "-1 g" [S00, table 4.7].
pub const POSITIONS: [f64; 6] = [-10.005, 10.047, 10.204, -9.9949, -10.197, 10.163];

/// Mean absolute deviation from the reference of receivers 1, 2 and 9: latitude, longitude, height, m, velocity north, east,
/// down, m/s; the drive on the E6 has no velocities [S00, tables 4.1 to 4.3].
pub const DEVIATION: [(&str, [[Option<f64>; 6]; 3]); 3] = [
    (
        "Rosenborg",
        [
            some([25.58, 8.57, 67.19, 0.83, 0.41, 1.83]),
            some([3.61, 2.32, 4.08, 0.31, 0.23, 0.19]),
            some([10.05, 9.15, 5.76, 0.88, 0.84, 0.19]),
        ],
    ),
    (
        "Ilsvikøra",
        [
            some([5.15, 5.20, 9.22, 0.75, 0.71, 0.05]),
            some([5.50, 4.99, 12.72, 0.76, 0.72, 0.05]),
            some([5.54, 4.92, 10.53, 0.74, 0.70, 0.05]),
        ],
    ),
    (
        "E6",
        [
            places([1.69, 1.86, 10.90]),
            places([2.03, 2.14, 3.67]),
            places([1.71, 1.73, 8.99]),
        ],
    ),
];

/// Receivers of [`DEVIATION`].
pub const RECEIVERS: [u32; 3] = [1, 2, 9];

const fn some(v: [f64; 6]) -> [Option<f64>; 6] {
    [
        Some(v[0]),
        Some(v[1]),
        Some(v[2]),
        Some(v[3]),
        Some(v[4]),
        Some(v[5]),
    ]
}

const fn places(v: [f64; 3]) -> [Option<f64>; 6] {
    [Some(v[0]), Some(v[1]), Some(v[2]), None, None, None]
}
