//! A log as a list of frames that a test can change.

use std::fmt::Write as _;

use schema::num;

/// A frame of a log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Line {
    /// Stamp, ns since 1970.
    pub time_ns: i64,
    /// Interface.
    pub bus: String,
    /// Identifier as written.
    pub id: String,
    /// Payload.
    pub data: Vec<u8>,
}

/// Reads candump text of classic frames.
pub fn read(text: &[u8]) -> Vec<Line> {
    std::str::from_utf8(text)
        .unwrap()
        .lines()
        .map(|line| {
            let mut words = line.split(' ');
            let stamp = words.next().unwrap();
            let (seconds, fraction) = stamp[1..stamp.len() - 1].split_once('.').unwrap();
            let digits = format!("{fraction:0<9}");
            let bus = words.next().unwrap().to_owned();
            let (id, hex) = words.next().unwrap().split_once('#').unwrap();
            Line {
                time_ns: seconds.parse::<i64>().unwrap() * 1_000_000_000
                    + digits.parse::<i64>().unwrap(),
                bus,
                id: id.to_owned(),
                data: (0..hex.len() / 2)
                    .map(|k| u8::from_str_radix(&hex[2 * k..2 * k + 2], 16).unwrap())
                    .collect(),
            }
        })
        .collect()
}

/// Writes candump text, in the order given.
pub fn write(lines: &[Line]) -> String {
    let mut text = String::with_capacity(lines.len() * 48);
    for line in lines {
        write!(
            text,
            "({}.{:09}) {} {}#",
            line.time_ns.div_euclid(1_000_000_000),
            line.time_ns.rem_euclid(1_000_000_000),
            line.bus,
            line.id
        )
        .unwrap();
        for byte in &line.data {
            write!(text, "{byte:02X}").unwrap();
        }
        text.push('\n');
    }
    text
}

/// In order of time (frames of one instant keep theirs).
pub fn sorted(mut lines: Vec<Line>) -> Vec<Line> {
    lines.sort_by_key(|line| line.time_ns);
    lines
}

/// Three signed 20-bit values of a step and a 4-bit counter, as the IMU frames of the recordings and of the simulator
/// carry them.
pub fn unpack(data: &[u8], step: f64) -> ([f64; 3], u64) {
    let mut bytes = [0; 8];
    bytes[..data.len().min(8)].copy_from_slice(&data[..data.len().min(8)]);
    let word = u64::from_le_bytes(bytes);
    let axis = |k: u32| num::real_i64((word << (44 - 20 * k)).cast_signed() >> 44) * step;
    ([axis(0), axis(1), axis(2)], word >> 60)
}

/// Pairs of IMU frames of a recording (ids 120 and 121): number of the second frame from 1, seconds since `zero_s`,
/// specific force, m/s^2, and rate, rad/s, in the sensor's axes.
pub fn imu(text: &[u8], zero_s: i64) -> Vec<(u64, f64, [f64; 3], [f64; 3])> {
    let (mut force, mut out) = (None, Vec::new());
    for (number, line) in (1..).zip(read(text)) {
        match line.id.as_str() {
            "120" => force = Some(unpack(&line.data, 0.002).0),
            "121" => {
                if let Some(accel) = force.take() {
                    let t = num::real_i64(line.time_ns - zero_s * 1_000_000_000) * 1e-9;
                    let rate = unpack(&line.data, 0.002).0.map(f64::to_radians);
                    out.push((number, t, accel, rate));
                }
            }
            _ => {}
        }
    }
    out
}

/// The other way about.
pub fn pack(values: [f64; 3], step: f64, counter: u64) -> Vec<u8> {
    let mut word = (counter & 15) << 60;
    for (k, value) in values.into_iter().enumerate() {
        let code = num::round_i64(value / step).clamp(-524_288, 524_287);
        word |= (code.cast_unsigned() & 0xF_FFFF) << (20 * k);
    }
    word.to_le_bytes().to_vec()
}
