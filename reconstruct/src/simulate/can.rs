//! Frames on the bus: encoding, receive times, candump text and the DBC they follow.

use std::fmt::Write;

use schema::num;

use super::random::{Random, Stream};
use super::scenario::{Axes, Scenario};
use super::sensors::{ACCEL_STEP, ImuFrame, RATE_STEP_DEGPS, WHEEL_STEP_KMH, WheelFrame};

/// Identifier of the accelerometer frame.
const ACCEL_ID: u16 = 0x120;
/// Identifier of the gyro frame.
const RATE_ID: u16 = 0x121;
/// Identifier of the wheel and brake frame.
const WHEEL_ID: u16 = 0x122;
/// The gyro frame follows the accelerometer frame by this, ns.
const RATE_DELAY_NS: i64 = 200_000;
/// Least distance of two frames of one identifier, ns.
const SPACING_NS: i64 = 150_000;
/// Largest magnitude of a 20-bit signed signal.
const SIGNED_20_MAX: i64 = (1 << 19) - 1;

/// One classic CAN frame as received.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Receive time, UTC, ns since 1970.
    pub unix_ns: i64,
    /// 11-bit identifier.
    pub id: u16,
    /// Number of bytes in use.
    pub len: u8,
    /// Payload; bytes beyond `len` are zero.
    pub data: [u8; 8],
}

impl Frame {
    /// The payload.
    #[must_use]
    pub fn payload(&self) -> &[u8] {
        self.data.get(..usize::from(self.len)).unwrap_or(&self.data)
    }
}

/// Three signed 20-bit values from bit 0 on and a 4-bit counter, little-endian.
fn pack_three(values: [f64; 3], step: f64, counter: u64) -> [u8; 8] {
    let mut word = counter << 60;
    for (i, value) in values.iter().enumerate() {
        let raw = num::round_i64(value / step).clamp(-SIGNED_20_MAX, SIGNED_20_MAX);
        let low = u64::from_le_bytes(raw.to_le_bytes()) & 0xF_FFFF;
        word |= low << (20 * i);
    }
    word.to_le_bytes()
}

/// Two unsigned 16-bit values, big-endian, then brake and counter.
fn pack_wheels(speed: [f64; 2], brake: bool, counter: u8) -> [u8; 8] {
    let raw =
        speed.map(|v| u16::try_from(num::round_i64(v * 3.6 / WHEEL_STEP_KMH)).unwrap_or(u16::MAX));
    let [a, b] = raw[0].to_be_bytes();
    let [c, d] = raw[1].to_be_bytes();
    [a, b, c, d, u8::from(brake) | (counter << 4), 0, 0, 0]
}

/// Receive times of one identifier: late by the jitter, never out of order.
struct Arrivals {
    start_ns: i64,
    jitter: f64,
    last_ns: i64,
}

impl Arrivals {
    fn new(scenario: &Scenario) -> Self {
        let start_ns = scenario.start_unix_s.saturating_mul(1_000_000_000);
        Self {
            start_ns,
            jitter: scenario.errors.jitter,
            last_ns: i64::MIN,
        }
    }

    fn at(&mut self, t: f64, delay_ns: i64, random: &mut Random) -> i64 {
        let late = random.normal().abs() * self.jitter;
        // candump writes microseconds.
        let us = num::round_i64((t + late) * 1e6);
        let ns = self
            .start_ns
            .saturating_add(us.saturating_mul(1000))
            .saturating_add(delay_ns);
        self.last_ns = ns.max(self.last_ns.saturating_add(SPACING_NS));
        self.last_ns
    }
}

/// All frames that reach the bus, sorted by receive time; the first is the accelerometer frame at time 0.
pub(super) fn frames(scenario: &Scenario, imu: &[ImuFrame], wheels: &[WheelFrame]) -> Vec<Frame> {
    let signs = match scenario.axes {
        Axes::FrontLeftUp => [1.0, -1.0, -1.0],
        Axes::FrontRightDown => [1.0, 1.0, 1.0],
    };
    let turned = |v: [f64; 3]| [0, 1, 2].map(|i| v[i] * signs[i]);
    let mut random = Random::new(scenario.class, scenario.sensor_seed, Stream::Jitter);
    let mut frames = Vec::with_capacity(imu.len() * 2 + wheels.len());
    let (mut accel_times, mut rate_times, mut wheel_times) = (
        Arrivals::new(scenario),
        Arrivals::new(scenario),
        Arrivals::new(scenario),
    );
    for (number, frame) in imu.iter().filter(|frame| frame.t > -1e-9).enumerate() {
        let counter = num::u64_of(number) & 15;
        let first = frame.t < 1e-9;
        if first {
            (accel_times.jitter, rate_times.jitter) = (0.0, 0.0);
        }
        let accel_ns = accel_times.at(frame.t, 0, &mut random);
        let rate_ns = rate_times.at(frame.t, RATE_DELAY_NS, &mut random);
        if first {
            (accel_times.jitter, rate_times.jitter) =
                (scenario.errors.jitter, scenario.errors.jitter);
        }
        if !frame.accel_lost {
            let data = pack_three(turned(frame.accel), ACCEL_STEP, counter);
            frames.push(Frame {
                unix_ns: accel_ns,
                id: ACCEL_ID,
                len: 8,
                data,
            });
        }
        if !frame.rate_lost {
            let rate = turned(frame.rate).map(f64::to_degrees);
            let data = pack_three(rate, RATE_STEP_DEGPS, counter);
            frames.push(Frame {
                unix_ns: rate_ns,
                id: RATE_ID,
                len: 8,
                data,
            });
        }
    }
    let brake_t = scenario.manoeuvre.braking.as_ref().map(|braking| braking.t);
    let mut counter = 0_u8;
    for frame in wheels {
        let ns = wheel_times.at(frame.t, 0, &mut random);
        if !frame.lost {
            let brake = brake_t.is_some_and(|t| frame.t >= t);
            let data = pack_wheels(frame.speed, brake, counter);
            frames.push(Frame {
                unix_ns: ns,
                id: WHEEL_ID,
                len: 5,
                data,
            });
        }
        counter = (counter + 1) & 15;
    }
    frames.sort_by_key(|frame| (frame.unix_ns, frame.id));
    frames
}

/// candump text of the frames on interface `can0`.
pub(super) fn candump(frames: &[Frame]) -> String {
    let mut text = String::with_capacity(frames.len() * 46);
    for frame in frames {
        let (seconds, rest) = (
            frame.unix_ns.div_euclid(1_000_000_000),
            frame.unix_ns.rem_euclid(1_000_000_000),
        );
        // Writing to a String cannot fail.
        let _ = write!(
            text,
            "({seconds}.{:06}) can0 {:03X}#",
            rest / 1000,
            frame.id
        );
        for byte in frame.payload() {
            text.push(hex(byte >> 4));
            text.push(hex(byte & 15));
        }
        text.push('\n');
    }
    text
}

fn hex(nibble: u8) -> char {
    char::from_digit(u32::from(nibble), 16).map_or('0', |digit| digit.to_ascii_uppercase())
}

/// DBC of the simulated bus.
pub(super) fn dbc() -> String {
    let mut text = String::from(
        "VERSION \"svartboks-simulated\"\n\nNS_ :\n\nBS_:\n\nBU_: IMU BRAKES RECORDER\n",
    );
    for (id, name, prefix, step, unit) in [
        (ACCEL_ID, "IMU_ACCEL", "Accel", ACCEL_STEP, "m/s^2"),
        (RATE_ID, "IMU_RATE", "Rate", RATE_STEP_DEGPS, "deg/s"),
    ] {
        let _ = write!(text, "\nBO_ {id} {name}: 8 IMU\n");
        for (i, axis) in ["X", "Y", "Z"].iter().enumerate() {
            let _ = writeln!(
                text,
                " SG_ {prefix}{axis} : {}|20@1- ({step},0) [-1048.574|1048.574] \"{unit}\" RECORDER",
                20 * i
            );
        }
        let _ = writeln!(
            text,
            " SG_ {prefix}Count : 60|4@1+ (1,0) [0|15] \"\" RECORDER"
        );
    }
    let _ = write!(text, "\nBO_ {WHEEL_ID} CHASSIS: 5 BRAKES\n");
    for (name, start) in [("WheelRearLeft", 7), ("WheelRearRight", 23)] {
        let _ = writeln!(
            text,
            " SG_ {name} : {start}|16@0+ ({WHEEL_STEP_KMH},0) [0|655.35] \"km/h\" RECORDER"
        );
    }
    text.push_str(" SG_ Brake : 32|1@1+ (1,0) [0|1] \"\" RECORDER\n");
    text.push_str(" SG_ ChassisCount : 36|4@1+ (1,0) [0|15] \"\" RECORDER\n");
    text
}
