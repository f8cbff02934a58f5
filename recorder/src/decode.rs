//! A frame of a mapped message becomes readings: IMU axes, wheel speeds, auxiliary and trigger values.

use crate::bins::AXES;
use crate::can::Frame;
use crate::gnss::can::Field;
use crate::plan::{MessagePlan, Role, Stream, Wheel, WheelKind};
use crate::signal::{Reading, Scaled, selected};

/// Fastest wheel the record can hold, m/s (255.5 km/h).
const FASTEST: f64 = 255.5 / 3.6;
/// An unsigned signal with an offset may read so far below zero at standstill, m/s.
const SLIGHTLY_NEGATIVE: f64 = -0.3;
/// A counter that was silent for longer may have wrapped, ns.
const COUNTER_MEMORY_NS: i64 = 500_000_000;

/// What a frame says.
#[derive(Clone, Copy, Debug)]
pub enum Update {
    /// Axes of the IMU stream of that number; NaN: not in it.
    Imu(usize, Option<u32>, [f64; AXES]),
    /// Speed of a wheel, m/s.
    Wheel(usize, f64),
    /// An auxiliary value.
    Aux(usize, f64),
    /// What a satellite receiver says, SI and radians, times in ns; NaN: it says that it has no value.
    Gnss(Field, f64),
    /// A value of a trigger signal.
    Can(usize, f64),
}

/// What was wrong with frames so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DecodeHealth {
    /// Frames too short for a signal they should carry.
    pub too_short: u64,
    /// Values that were not finite.
    pub not_finite: u64,
    /// Values outside the DBC's range, or no possible wheel speed.
    pub out_of_range: u64,
}

/// The last count of a pulse counter.
#[derive(Clone, Copy, Debug, Default)]
struct Pulse {
    last: Option<(u64, i64)>,
    period: f64,
}

/// The decoder's state.
#[derive(Clone, Debug, Default)]
pub struct Decoder {
    /// What was wrong so far.
    pub health: DecodeHealth,
    pulses: [Pulse; 2],
}

impl Decoder {
    /// Reads every stream of the message; each update goes to `take`.
    pub fn read(
        &mut self,
        message: &MessagePlan,
        frame: &Frame,
        time_ns: i64,
        mut take: impl FnMut(Update),
    ) {
        let mut short = false;
        for stream in &message.streams {
            match selected(&stream.selectors, frame.data()) {
                Some(true) => {}
                Some(false) => continue,
                None => {
                    short = true;
                    continue;
                }
            }
            match &stream.role {
                Role::Imu { number, channels } => {
                    let mut values = [f64::NAN; AXES];
                    let mut any = false;
                    for channel in channels {
                        let value = self.value(
                            &channel.scaled,
                            channel.range,
                            message.range_check,
                            frame,
                            &mut short,
                        );
                        if let (Some(value), Some(slot)) = (value, values.get_mut(channel.axis)) {
                            *slot = value * channel.to_si;
                            any = true;
                        }
                    }
                    if any {
                        take(Update::Imu(*number, counter(stream, frame), values));
                    }
                }
                Role::Wheel(wheel) => {
                    if let Some(value) = self.value(
                        &wheel.scaled,
                        wheel.range,
                        message.range_check,
                        frame,
                        &mut short,
                    ) && let Some(speed) = self.wheel(wheel, value, frame, time_ns)
                    {
                        take(Update::Wheel(wheel.side, speed));
                    }
                }
                Role::Aux {
                    slot,
                    scaled,
                    range,
                } => {
                    if let Some(value) =
                        self.value(scaled, *range, message.range_check, frame, &mut short)
                    {
                        take(Update::Aux(*slot, value));
                    }
                }
                Role::Gnss {
                    field,
                    scaled,
                    to_si,
                    range,
                } => {
                    if let Some(value) = self.said(scaled, *range, frame, &mut short) {
                        take(Update::Gnss(*field, value * to_si));
                    }
                }
                Role::Can { slot, scaled } => {
                    if let Some(value) = self.value(scaled, None, false, frame, &mut short) {
                        take(Update::Can(*slot, value));
                    }
                }
            }
        }
        self.health.too_short += u64::from(short);
    }

    fn value(
        &mut self,
        scaled: &Scaled,
        range: Option<(f64, f64)>,
        range_check: bool,
        frame: &Frame,
        short: &mut bool,
    ) -> Option<f64> {
        match scaled.read(frame.data()) {
            Reading::Value(value) => {
                // Half a step of slack: a limit written as a rounded decimal does not exclude its own code.
                let slack = 0.5 * scaled.factor.abs();
                let beyond =
                    range.is_some_and(|(low, high)| value < low - slack || value > high + slack);
                self.health.out_of_range += u64::from(beyond);
                (!(beyond && range_check)).then_some(value)
            }
            Reading::TooShort => {
                *short = true;
                None
            }
            Reading::NotFinite => {
                self.health.not_finite += 1;
                None
            }
            Reading::NotSelected => None,
        }
    }

    /// What a satellite receiver says. A number outside the DBC's range, or none at all, is how it says that it has no
    /// value (NaN), whatever `range_check` is: a blow to the car drives none of its values beyond the range.
    fn said(
        &mut self,
        scaled: &Scaled,
        range: Option<(f64, f64)>,
        frame: &Frame,
        short: &mut bool,
    ) -> Option<f64> {
        let value = self.value(scaled, range, true, frame, short);
        let none = || {
            matches!(
                scaled.read(frame.data()),
                Reading::Value(_) | Reading::NotFinite
            )
        };
        value.or_else(|| none().then_some(f64::NAN))
    }

    fn wheel(&mut self, wheel: &Wheel, value: f64, frame: &Frame, time_ns: i64) -> Option<f64> {
        let speed = match wheel.kind {
            // A signed signal says the direction; the record holds the speed.
            WheelKind::Speed(size) if wheel.scaled.bits.signed() => (value * size).abs(),
            WheelKind::Speed(size) if value * size >= SLIGHTLY_NEGATIVE => (value * size).max(0.0),
            WheelKind::Speed(_) => {
                self.health.out_of_range += 1;
                return None;
            }
            WheelKind::Pulses { metres, wrap } => {
                let count = wheel.scaled.bits.raw(frame.data())?;
                self.pulses
                    .get_mut(wheel.side)?
                    .speed(count, wrap, metres, time_ns)?
            }
        };
        if speed > FASTEST {
            self.health.out_of_range += 1;
            return None;
        }
        Some(speed)
    }
}

fn counter(stream: &Stream, frame: &Frame) -> Option<u32> {
    stream
        .counter
        .and_then(|bits| bits.raw(frame.data()))
        .and_then(|raw| u32::try_from(raw & 0xFFFF_FFFF).ok())
}

impl Pulse {
    /// Speed from the counts since the last frame, over as many periods as passed (receive jitter left out).
    fn speed(&mut self, count: u64, wrap: u64, metres: f64, time_ns: i64) -> Option<f64> {
        let (last, then_ns) = self.last.replace((count, time_ns))?;
        let passed = schema::num::real_i64(time_ns.saturating_sub(then_ns));
        if passed <= 0.0 || time_ns - then_ns > COUNTER_MEMORY_NS {
            return None;
        }
        if self.period == 0.0 {
            self.period = passed;
        }
        let periods = (passed / self.period).round();
        let elapsed = if (1.0..=4.0).contains(&periods) {
            self.period += (passed / periods - self.period) * 0.02;
            periods * self.period
        } else {
            // The pace has changed, or the first step was no period.
            self.period += (passed - self.period) * 0.5;
            passed
        };
        let pulses = (count % wrap).wrapping_sub(last % wrap).wrapping_add(wrap) % wrap;
        Some(schema::num::real_u64(pulses) * metres / (elapsed * 1e-9))
    }
}
