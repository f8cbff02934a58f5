//! A log as a live source: its frames come at the pace of their stamps, moved to now. For the bench and for tests
//! where no CAN is at hand; everything behind it is the daemon as in the car.

use std::time::Duration;

use schema::header::{Clock, ClockSource, Interface};

use crate::can::{Frame, FrameSource, Interfaces};
use crate::clock::{monotonic_ns, realtime_ns};
use crate::config::Settings;
use crate::error::RecorderError;
use crate::live::{InterfaceState, LiveSource, Note};
use crate::log_source::{LogInput, Merged};

/// The source.
pub struct Paced {
    log: Merged,
    next: Option<Frame>,
    /// What is added to a stamp of the log to be on the line.
    shift_ns: i64,
    /// UTC at the start minus the monotonic clock.
    offset_ns: i64,
    states: Vec<InterfaceState>,
    ended: bool,
}

impl Paced {
    /// Begins now.
    ///
    /// # Errors
    /// When the log can not be read.
    pub fn open(
        settings: &Settings,
        inputs: Vec<LogInput>,
        map: &[(String, String)],
    ) -> Result<Self, RecorderError> {
        let names: Vec<String> = settings
            .buses
            .iter()
            .map(|bus| bus.interface.clone())
            .collect();
        let interfaces = Interfaces::new(&names, map)?;
        let mut log = Merged::open(inputs, &interfaces)?;
        let mut frame = Frame::empty();
        let next = log.next_frame(&mut frame)?.then_some(frame);
        let offset_ns = realtime_ns().saturating_sub(monotonic_ns());
        let start = realtime_ns();
        let state = |name: &String| InterfaceState {
            name: name.clone(),
            up: true,
            stamps: "log".to_owned(),
            ..InterfaceState::default()
        };
        Ok(Self {
            shift_ns: next.map_or(0, |frame| start.saturating_sub(frame.time_ns)),
            ended: next.is_none(),
            log,
            next,
            offset_ns,
            states: names.iter().map(state).collect(),
        })
    }
}

impl LiveSource for Paced {
    fn read(&mut self, wait: Duration, take: &mut dyn FnMut(&Frame)) -> Result<(), RecorderError> {
        let now = self.now_ns();
        let due = self
            .next
            .map(|frame| frame.time_ns.saturating_add(self.shift_ns));
        let until = due.unwrap_or(i64::MAX).saturating_sub(now).max(0);
        if until > 0 {
            let until = Duration::from_nanos(u64::try_from(until).unwrap_or(u64::MAX));
            std::thread::sleep(wait.min(until));
        }
        let now = self.now_ns();
        while let Some(mut frame) = self.next {
            frame.time_ns = frame.time_ns.saturating_add(self.shift_ns);
            if frame.time_ns > now {
                break;
            }
            if let Some(state) = self.states.get_mut(usize::from(frame.interface)) {
                state.frames += 1;
            }
            take(&frame);
            let mut frame = Frame::empty();
            self.next = self.log.next_frame(&mut frame)?.then_some(frame);
            self.ended = self.next.is_none();
        }
        Ok(())
    }

    fn open(&self) -> bool {
        !self.ended
    }

    fn now_ns(&mut self) -> i64 {
        monotonic_ns().saturating_add(self.offset_ns)
    }

    fn next_note(&mut self) -> Option<Note> {
        None
    }

    fn interfaces(&self) -> &[InterfaceState] {
        &self.states
    }

    fn header_interfaces(&self) -> Vec<Interface> {
        let interface = |state: &InterfaceState| Interface {
            name: state.name.clone(),
            offset_ns: 0,
            uncertainty_ns: None,
        };
        self.states.iter().map(interface).collect()
    }

    fn clock(&mut self) -> Clock {
        Clock {
            source: ClockSource::SystemClock,
            offset_ns: 0,
            uncertainty_ns: None,
            leap_second: false,
        }
    }

    fn reconfigure(&mut self, _: &Settings) -> Result<(), RecorderError> {
        Ok(())
    }
}
