//! Datagrams of one interface become frames on the line.

use schema::header::Interface;

use super::batch::{BATCH, Stamps, decode};
use super::bus::Controller;
use super::desk::Desk;
use crate::can::{ERR, Frame};
use crate::clock::HardwareClock;
use crate::live::InterfaceState;

/// Kernel stamps are taken in whole microseconds, as logs have them: a replay of the log then gives the very samples
/// that were recorded live. The kernel's own delay is tens of them.
const STAMP_NS: i64 = 1_000;
/// Notes between two looks at the interface: a bus that is flapping is told of, not listed.
const NOTES: u32 = 4;

/// What is read and not yet handed on, and what is known of the stamps.
pub(super) struct Intake {
    frames: Vec<Frame>,
    at: usize,
    hardware: HardwareClock,
    controller: Controller,
    after_ns: i64,
    notes: u32,
}

impl Intake {
    pub(super) fn new() -> Self {
        Self {
            frames: Vec::with_capacity(BATCH),
            at: 0,
            hardware: HardwareClock::new(),
            controller: Controller::default(),
            after_ns: i64::MIN,
            notes: 0,
        }
    }

    /// The frame to be handed on next.
    pub(super) fn head(&self) -> Option<&Frame> {
        self.frames.get(self.at)
    }

    /// That frame was handed on.
    pub(super) fn advance(&mut self) {
        self.at += 1;
        if self.at >= self.frames.len() {
            self.frames.clear();
            self.at = 0;
        }
    }

    /// Time of the newest frame, ns on the line.
    pub(super) fn newest_ns(&self) -> i64 {
        self.after_ns
    }

    /// Numbers what still waits anew: the interface has another place in the configuration.
    pub(super) fn renumber(&mut self, number: u8) {
        for frame in &mut self.frames {
            frame.interface = number;
        }
    }

    /// The interface was opened anew: its controller may have started anew.
    pub(super) fn begin(&mut self) {
        self.hardware = HardwareClock::new();
        self.controller = Controller::default();
    }

    /// Another quarter of a second, in which a few things may be noted.
    pub(super) fn refresh(&mut self) {
        self.notes = 0;
    }

    /// Takes a datagram that was read at `now_ns` on the line.
    pub(super) fn take(
        &mut self,
        state: &mut InterfaceState,
        desk: &mut Desk,
        (now_ns, number): (i64, u8),
        datagram: &[u8],
        stamps: Stamps,
    ) {
        let mut frame = Frame::empty();
        if !decode(datagram, &mut frame) {
            state.malformed += 1;
            self.note(state, desk, now_ns, "handed on what is no CAN frame");
            return;
        }
        let (time_ns, explained) = match stamps.kernel_ns {
            Some(stamp) => {
                let stamp = stamp.div_euclid(STAMP_NS) * STAMP_NS;
                let place = desk
                    .line
                    .place(stamp, self.after_ns.max(desk.drained_ns), now_ns);
                (place.time_ns, place.explained)
            }
            None => (now_ns, false),
        };
        self.after_ns = self.after_ns.max(time_ns);
        frame.time_ns = time_ns;
        if !explained {
            state.malformed += 1;
            let what = "has frames without a usable stamp: they get the time they were read at";
            self.note(state, desk, now_ns, what);
        }
        let hardware = stamps.hardware_ns.filter(|_| explained);
        if let Some(stamp) = hardware {
            let mapped = self.hardware.map(stamp, time_ns);
            frame.time_ns = mapped.time_ns;
            if let Some(jump) = mapped.jumped_ns {
                let text = format!("the controller's clock jumped by {jump} ns");
                self.note(state, desk, now_ns, &text);
            }
        }
        if stamps.hardware_ns.is_some() != (state.stamps == "hardware") || state.stamps.is_empty() {
            state.stamps.clear();
            state.stamps.push_str(match stamps.hardware_ns {
                Some(_) => "hardware",
                None => "kernel",
            });
        }
        frame.interface = number;
        state.frames += 1;
        if frame.id & ERR != 0 {
            self.hear(state, desk, &frame);
        }
        self.frames.push(frame);
    }

    fn hear(&mut self, state: &mut InterfaceState, desk: &mut Desk, frame: &Frame) {
        state.error_frames += 1;
        let news = self.controller.hear(frame);
        state.bus_off += u64::from(news.bus_off);
        if let Some(now) = news.state {
            self.note(state, desk, frame.time_ns, now.says());
        }
        if news.restarted {
            self.note(state, desk, frame.time_ns, "the controller was restarted");
        }
        if news.overflowed {
            let what = "the controller had no room for a frame and lost it";
            self.note(state, desk, frame.time_ns, what);
        }
    }

    fn note(&mut self, state: &InterfaceState, desk: &mut Desk, at_ns: i64, what: &str) {
        self.notes += 1;
        if self.notes <= NOTES {
            desk.note(at_ns, format!("{}: {what}", state.name));
        }
    }

    /// The interface as the record's header has it. A kernel stamp is off the line by the steps of the system clock
    /// and by nothing else; how late the kernel stamps can not be told.
    pub(super) fn header(&self, state: &InterfaceState, desk: &Desk) -> Interface {
        let hardware = self
            .hardware
            .offset_ns()
            .filter(|_| state.stamps == "hardware");
        Interface {
            name: state.name.clone(),
            offset_ns: hardware.map_or(-desk.line.utc_offset_ns(), |(offset, _)| offset),
            uncertainty_ns: hardware.map(|(_, uncertainty)| uncertainty),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock::FakeClocks;
    use crate::live::Note;

    const UTC: i64 = 1_700_000_000_000_000_000;

    struct Bench {
        clocks: FakeClocks,
        desk: Desk,
        state: InterfaceState,
        intake: Intake,
    }

    impl Bench {
        fn new() -> Self {
            let clocks = FakeClocks::new(1_000, UTC);
            Self {
                desk: Desk::new(Box::new(clocks.clone())),
                clocks,
                state: InterfaceState {
                    name: "can0".to_owned(),
                    ..InterfaceState::default()
                },
                intake: Intake::new(),
            }
        }

        fn take(&mut self, id: u32, kernel_ns: Option<i64>, hardware_ns: Option<i64>) -> Frame {
            let mut datagram = [0; 16];
            datagram[..4].copy_from_slice(&id.to_ne_bytes());
            datagram[4] = 8;
            let now = self.desk.now();
            let stamps = Stamps {
                kernel_ns,
                hardware_ns,
            };
            let Self {
                desk,
                state,
                intake,
                ..
            } = self;
            intake.take(state, desk, (now, 3), &datagram, stamps);
            let frame = *intake.head().unwrap();
            intake.advance();
            frame
        }

        fn texts(&mut self) -> Vec<String> {
            std::iter::from_fn(|| self.desk.next_note())
                .map(|note| match note {
                    Note::Text { text, .. } => text,
                    Note::ClockStep { step_ns, .. } => format!("step {step_ns}"),
                })
                .collect()
        }
    }

    #[test]
    fn a_frame_has_the_kernels_stamp_in_microseconds() {
        let mut bench = Bench::new();
        bench.clocks.pass(500_000);
        let frame = bench.take(0x123, Some(UTC + 300_999), None);
        assert_eq!((frame.time_ns, frame.interface), (UTC + 300_000, 3));
        assert_eq!((bench.state.frames, bench.state.malformed), (1, 0));
        assert_eq!(bench.state.stamps, "kernel");
        assert!(bench.texts().is_empty());
    }

    #[test]
    fn a_set_clock_moves_no_frame_and_is_noted() {
        let mut bench = Bench::new();
        bench.clocks.pass(5_000_000);
        bench.clocks.step(-3_600_000_000_000);
        let frame = bench.take(0x123, Some(UTC + 5_000_000 - 3_600_000_000_000), None);
        assert_eq!(frame.time_ns, UTC + 5_000_000);
        assert_eq!(bench.texts(), ["step -3600000000000"]);
        let header = bench.intake.header(&bench.state, &bench.desk);
        assert_eq!(header.offset_ns, 3_600_000_000_000, "line = stamp + offset");
    }

    #[test]
    fn a_frame_without_a_usable_stamp_is_kept_and_counted() {
        let mut bench = Bench::new();
        bench.clocks.pass(5_000_000);
        assert_eq!(bench.take(1, None, None).time_ns, UTC + 5_000_000);
        let absurd = bench.take(1, Some(UTC + 86_400_000_000_000), None);
        assert_eq!(absurd.time_ns, UTC + 5_000_000);
        assert_eq!((bench.state.malformed, bench.state.frames), (2, 2));
        for _ in 0..1000 {
            bench.take(1, None, None);
        }
        assert_eq!(bench.texts().len(), 4, "told of, not listed");
    }

    #[test]
    fn hardware_stamps_are_mapped_and_their_offset_told() {
        let mut bench = Bench::new();
        for at in 0..5_000 {
            bench.clocks.pass(1_000_000);
            let late = if at % 3 == 0 { 20_000 } else { 400_000 };
            let frame = bench.take(
                1,
                Some(UTC + at * 1_000_000 + late),
                Some(777 + at * 1_000_000),
            );
            if at > 2 {
                assert!((frame.time_ns - UTC - at * 1_000_000 - 20_000).abs() < 1_000);
            }
        }
        assert_eq!(bench.state.stamps, "hardware");
        let header = bench.intake.header(&bench.state, &bench.desk);
        assert!((header.offset_ns - (UTC + 20_000 - 777)).abs() < 1_000);
        assert!(header.uncertainty_ns.unwrap() < 5_000);
    }

    #[test]
    fn error_frames_are_counted_and_told() {
        let mut bench = Bench::new();
        bench.clocks.pass(1_000);
        let frame = bench.take(ERR | 0x40, Some(UTC + 500), None);
        assert_eq!(frame.id, ERR | 0x40);
        assert_eq!((bench.state.error_frames, bench.state.bus_off), (1, 1));
        bench.take(ERR | 0x100, Some(UTC + 600), None);
        let texts = bench.texts();
        assert!(
            texts[0].contains("bus-off") && texts[2].contains("restarted"),
            "{texts:?}"
        );
    }
}
