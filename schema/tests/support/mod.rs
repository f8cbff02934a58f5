//! Records for the tests: small ones built field by field, with every part used.
#![allow(
    dead_code,
    reason = "each test file uses its own share of this support"
)]

use schema::block::{cut, thin_blocks};
use schema::gnss::{Fix, FixQuality, Gnss, GnssSheet, GnssSource, Sentence};
use schema::header::{
    Clock, ClockSource, Header, ImuSheet, Interface, Layout, Origin, Periods, SourceLog, Vehicle,
    WheelSheet,
};
use schema::parts::{
    AuxChannel, Clip, ClockStep, Completion, Gap, Health, RawFrame, SignalHealth, Trigger,
    TriggerKind,
};
use schema::time::Grid;
use schema::{Packed, Packer, Record, Sample, Scales};

/// 2026-03-14T15:09:26Z at the monotonic time 5 s.
pub(crate) const CLOCK_OFFSET_NS: i64 = (1_773_500_966 - 5) * 1_000_000_000;
/// The samples begin 30 ms before a full UTC second.
pub(crate) const GRID: Grid = Grid {
    origin_ns: -30_000_000,
    utc_offset_ns: CLOCK_OFFSET_NS,
};

pub(crate) fn header(layout: Layout) -> Header {
    let Scales { wheel, accel, rate } = Scales::default();
    Header {
        number: 7,
        previous_sha256: [0xA5; 32],
        parent_sha256: None,
        origin: Origin::Replay {
            logs: vec![SourceLog {
                name: "drive.log".into(),
                bytes: 123_456,
                sha256: [0x5A; 32],
            }],
        },
        device_id: "bench".into(),
        software: "recorder 0.1.0".into(),
        config_sha256: [0x11; 32],
        vehicle: Vehicle {
            vin: String::new(),
            name: "Prøvebil".into(),
            track_width_m: 1.46,
            imu_position_m: Some([1.2, -0.1, -0.4]),
            imu_position_sd_m: [0.02; 3],
            cg_position_m: None,
            cg_position_sd_m: [0.1; 3],
        },
        imu: ImuSheet {
            accel_range: Some(784.532),
            rate_range: None,
            accel_density: 0.0015,
            rate_density: 1e-4,
            accel_bias: 0.1,
            rate_bias: 0.003,
            accel_bias_jump: 0.05,
            rate_bias_jump: 0.001,
            accel_scale: 0.005,
            rate_scale: 0.005,
            accel_vibration: 0.05,
            rate_vibration: 0.002,
            mounting: [0.0, 0.01, -0.02],
            mounting_sd: [0.01; 3],
        },
        wheels: WheelSheet {
            present: true,
            latency_s: 0.04,
            latency_sd_s: 0.01,
            cutoff_mps: 0.5,
            scale_sd: 0.01,
            scale_difference_sd: 0.002,
            noise_mps: 0.03,
        },
        wheel_scale: wheel,
        accel_scale: accel,
        rate_scale: rate,
        layout,
        channel_frequency_class: None,
        periods: Periods {
            accel_ns: 1_000_000,
            rate_ns: 10_000_000,
            wheels_ns: [20_000_000, 0],
        },
        interfaces: vec![Interface {
            name: "can0".into(),
            offset_ns: -12,
            uncertainty_ns: Some(50_000),
        }],
        clock: Clock {
            source: ClockSource::LogStamps,
            offset_ns: CLOCK_OFFSET_NS,
            uncertainty_ns: None,
            leap_second: false,
        },
    }
}

/// A curve with a pulse: what sample `k` might be; every seventh is without wheels, every eleventh without x.
pub(crate) fn sample(k: u64) -> Sample {
    let t = f64::from(u32::try_from(k).unwrap()) * 0.01;
    let wheel = |v: f64| (!k.is_multiple_of(7)).then_some(v);
    let pulse = if k % 400 > 380 { -31.7 } else { 0.3 };
    Sample {
        wheels: [wheel(13.0 + t.sin()), wheel(13.1 + t.cos())],
        accel: [
            (!k.is_multiple_of(11)).then_some(pulse * t.cos()),
            Some(1.234 * t.sin()),
            Some(-9.81),
        ],
        rate: [Some(0.01 * t.sin()), Some(-0.02), Some(0.3 * t.cos())],
    }
}

/// Samples `from..to`, packed as the recorder does.
pub(crate) fn packed(from: u64, to: u64) -> Vec<(u64, Packed)> {
    let Scales { wheel, accel, rate } = Scales::default();
    let mut packer = Packer::new(wheel, accel, rate);
    (from..to)
        .map(|k| {
            if GRID.starts_second(k) {
                packer.reset();
            }
            (k, packer.packed(&sample(k)))
        })
        .collect()
}

/// A record of samples `from..to` with one trigger at index `trigger` and every part in use.
pub(crate) fn record(layout: Layout, from: u64, to: u64, trigger: u64) -> Record {
    let header = header(layout);
    let mut blocks = cut(packed(from, to), &GRID);
    if layout == Layout::TwoRate {
        thin_blocks(&mut blocks, &[trigger], &header.scales());
    }
    let at = GRID.monotonic_ns(trigger) + 3_000_000;
    Record {
        header,
        blocks,
        clipping: vec![Clip {
            index: trigger,
            axis: 0,
            sign: -1,
            clipped: 3,
            frames: 10,
        }],
        raw: vec![
            RawFrame {
                monotonic_ns: at,
                interface: 0,
                id: 0x123,
                flags: 0,
                data: vec![1, 2, 3],
            },
            RawFrame {
                monotonic_ns: at + 1,
                interface: 0,
                id: 0x9234_5678,
                flags: 0x81,
                data: (0..12).collect(),
            },
        ],
        aux: vec![AuxChannel {
            name: "brake".into(),
            signal: "LAB_WHEELS.Brake".into(),
            unit: "%".into(),
            first_index: from,
            values: vec![Some(0.0), None, Some(-12.5), Some(1e-300)],
        }],
        gnss: None,
        health: Health {
            frames_seen: 1000,
            late_frames: 2,
            gaps: vec![Gap {
                signal: "wheel-left".into(),
                from_ns: at - 500,
                to_ns: at,
            }],
            clock_steps: vec![ClockStep {
                monotonic_ns: at,
                step_ns: -42,
            }],
            signals: vec![SignalHealth {
                signal: "accel".into(),
                frames: 900,
                lost_by_counter: Some(1),
                period_ns: 1_000_000,
                jitter_ns: 1500,
            }],
            notes: vec!["a note".into()],
            ..Health::default()
        },
        triggers: vec![Trigger {
            kind: TriggerKind::DeltaV,
            monotonic_ns: at,
            index: trigger,
            value: 2.5,
            threshold: 2.25,
            source: "x".into(),
        }],
        completion: Completion {
            complete: false,
            reasons: vec!["the log ends 9 s after the trigger".into()],
            ends_at_rest: true,
        },
    }
}

/// Five samples, one of them in the second before: a record of about 1,200 bytes.
pub(crate) fn small() -> Record {
    record(Layout::Full, 1, 6, 4)
}

/// [`small`] with satellite fixes: one that says everything, one that says nothing, a sentence.
pub(crate) fn placed() -> Record {
    let at = GRID.monotonic_ns(3);
    Record {
        gnss: Some(Gnss {
            sheet: GnssSheet {
                source: GnssSource::Nmea,
                receiver: "/dev/ttyS1".into(),
                antenna_position_m: Some([1.5, 0.0, -1.4]),
                antenna_position_sd_m: [0.1, 0.05, 0.1],
                latency_s: 0.12,
                latency_sd_s: 0.03,
                horizontal_sd_m: 3.0,
                height_sd_m: 6.0,
                speed_sd_mps: 0.2,
            },
            fixes: vec![
                Fix {
                    utc_ns: Some(at + GRID.utc_offset_ns - 120_000_000),
                    satellites: Some(9),
                    position: Some([1.107, 0.181]),
                    height_m: Some(161.5),
                    speed_mps: Some(13.9),
                    course: Some(4.2),
                    climb_mps: Some(-0.1),
                    horizontal_m2: Some([4.0, 2.25, -0.5]),
                    height_sd_m: Some(4.5),
                    speed_sd_mps: Some(0.1),
                    course_sd: Some(0.01),
                    hdop: Some(0.9),
                    ..Fix::new(at, FixQuality::Differential)
                },
                Fix::new(at + 1_000_000_000, FixQuality::None),
            ],
            sentences: vec![Sentence {
                monotonic_ns: at,
                text: "$GPZDA,150926.00,14,03,2026,00,00*65".into(),
            }],
        }),
        ..small()
    }
}
