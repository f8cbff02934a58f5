//! Live frames off SocketCAN: one raw socket an interface, batches of frames by one call of the kernel, all in order
//! of their stamps.
//!
//! An interface that is missing, down, removed or renamed is no error: it is noted, and looked for each quarter of a
//! second. Loss is counted by the kernel and told exactly. After a wait that frames ended, about a millisecond of
//! them is let pile up: waking for each would cost more than all else (`PILE`).

mod batch;
mod bus;
mod desk;
mod intake;
mod link;
mod raw;

use std::time::Duration;

use nix::errno::Errno;
use nix::sys::epoll::{Epoll, EpollCreateFlags, EpollEvent, EpollFlags, EpollTimeout};
use schema::header::{Clock, ClockSource, Interface};

use crate::can::Frame;
use crate::clock::{Clocks, SystemClocks};
use crate::config::{RawFrames, Settings};
use crate::error::RecorderError;
use crate::live::{InterfaceState, LiveSource, Note};
use batch::Batch;
use desk::Desk;
use link::Link;
use raw::{RawCan, Wishes};

/// Interfaces are looked after so often, ns.
const LOOK_NS: i64 = 250_000_000;
/// Frames are let pile up for so long before they are read.
const PILE: Duration = Duration::from_millis(1);
/// Most frames that one reading hands on, so that it returns from a flood.
const MOST: usize = 8192;
/// Sockets that one wait tells of; others are told of by the next.
const EVENTS: usize = 16;

/// CAN interfaces as a source of live frames.
pub struct Sockets {
    links: Vec<Link>,
    states: Vec<InterfaceState>,
    batch: Batch,
    desk: Desk,
    epoll: Epoll,
    next_look_ns: i64,
    /// When the last reading began, on the line.
    begun_ns: i64,
    /// The last reading left frames that were younger than it.
    held: bool,
}

impl Sockets {
    /// Opens the configured interfaces; those that can not be opened now are tried again and again.
    ///
    /// # Errors
    /// When the kernel has no SocketCAN at all.
    pub fn open(settings: &Settings) -> Result<Self, RecorderError> {
        Self::with_clocks(settings, Box::new(SystemClocks))
    }

    /// The same by other clocks.
    ///
    /// # Errors
    /// As [`Sockets::open`].
    pub fn with_clocks(
        settings: &Settings,
        clocks: Box<dyn Clocks>,
    ) -> Result<Self, RecorderError> {
        let action = "open a CAN socket (has the kernel its modules can and can-raw?)";
        RawCan::unbound().map_err(RecorderError::io("SocketCAN", action))?;
        let mut sockets = Self {
            links: Vec::new(),
            states: Vec::new(),
            batch: Batch::new(),
            desk: Desk::new(clocks),
            epoll: epoll()?,
            next_look_ns: i64::MIN,
            begun_ns: i64::MIN,
            held: false,
        };
        sockets.reconfigure(settings)?;
        Ok(sockets)
    }

    /// Looks after the interfaces when it is time to.
    fn look(&mut self, now_ns: i64) {
        if now_ns < self.next_look_ns {
            return;
        }
        self.next_look_ns = now_ns.saturating_add(LOOK_NS);
        self.desk.line.follow_tai(&mut *self.desk.clocks);
        for (at, (link, state)) in (0..).zip(self.links.iter_mut().zip(&mut self.states)) {
            if link.look(state, &mut self.desk) {
                watch(&self.epoll, link, at);
            }
        }
    }

    /// Waits for frames, and a moment more for others to join them. True if some may be there.
    fn wait(&mut self, wait: Duration, now_ns: i64) -> bool {
        let until_look = u64::try_from(self.next_look_ns.saturating_sub(now_ns)).unwrap_or(0);
        let most = wait.min(Duration::from_nanos(until_look));
        let milliseconds = most.as_nanos().div_ceil(1_000_000);
        let timeout = EpollTimeout::try_from(milliseconds).unwrap_or(EpollTimeout::MAX);
        let mut events = [EpollEvent::empty(); EVENTS];
        // A signal ends the wait early, as it should: the caller looks at signals between two readings.
        match self.epoll.wait(&mut events, timeout) {
            Ok(0) => false,
            Ok(_) => {
                if wait >= PILE {
                    self.desk.clocks.sleep(PILE);
                }
                true
            }
            Err(Errno::EINTR) => true,
            Err(_) => {
                self.desk.clocks.sleep(most);
                true
            }
        }
    }

    /// Reads each interface, and hands on what was there when this began, the earliest first. A younger frame stays:
    /// of those interfaces that were read before it came there may be older ones.
    fn hand_on(&mut self, take: &mut dyn FnMut(&Frame)) {
        let until = if self.links.len() > 1 {
            self.desk.now()
        } else {
            i64::MAX
        };
        for (number, (link, state)) in (0..).zip(self.links.iter_mut().zip(&mut self.states)) {
            if link.intake.head().is_none() {
                link.refill(state, &mut self.desk, &mut self.batch, number);
            } else {
                link.leave();
            }
        }
        self.held = false;
        let mut handed = 0;
        while handed < MOST {
            let mut first: Option<(i64, usize)> = None;
            for (at, link) in self.links.iter_mut().enumerate() {
                if link.intake.head().is_none() && link.more() {
                    let (Some(state), Ok(number)) = (self.states.get_mut(at), u8::try_from(at))
                    else {
                        continue;
                    };
                    link.refill(state, &mut self.desk, &mut self.batch, number);
                }
                if let Some(frame) = link.intake.head()
                    && first.is_none_or(|(time, _)| frame.time_ns < time)
                {
                    first = Some((frame.time_ns, at));
                }
            }
            let Some((time, at)) = first else {
                return;
            };
            if time > until {
                self.held = true;
                return;
            }
            let Some(link) = self.links.get_mut(at) else {
                return;
            };
            if let Some(frame) = link.intake.head() {
                take(frame);
                link.intake.advance();
                handed += 1;
            }
        }
    }

    fn pending(&self) -> bool {
        self.links
            .iter()
            .any(|link| link.more() || link.intake.head().is_some())
    }
}

impl LiveSource for Sockets {
    fn read(&mut self, wait: Duration, take: &mut dyn FnMut(&Frame)) -> Result<(), RecorderError> {
        let now = self.desk.now();
        let begun = std::mem::replace(&mut self.begun_ns, now);
        if !self.pending() {
            self.desk.drained_ns = begun;
        }
        self.look(now);
        let pending = self.pending();
        if pending && self.held && wait >= PILE {
            // They came while it went on: others may join them, as after a wait.
            self.desk.clocks.sleep(PILE);
        }
        if pending || self.wait(wait, now) {
            self.hand_on(take);
        }
        Ok(())
    }

    fn open(&self) -> bool {
        true
    }

    fn now_ns(&mut self) -> i64 {
        self.desk.now()
    }

    fn next_note(&mut self) -> Option<Note> {
        self.desk.next_note()
    }

    fn interfaces(&self) -> &[InterfaceState] {
        &self.states
    }

    fn header_interfaces(&self) -> Vec<Interface> {
        self.links
            .iter()
            .zip(&self.states)
            .map(|(link, state)| link.intake.header(state, &self.desk))
            .collect()
    }

    fn clock(&mut self) -> Clock {
        Clock {
            source: if self.desk.clocks.disciplined() {
                ClockSource::Disciplined
            } else {
                ClockSource::SystemClock
            },
            offset_ns: self.desk.line.utc_offset_ns(),
            uncertainty_ns: None,
            leap_second: self.desk.line.leap(),
        }
    }

    fn reconfigure(&mut self, settings: &Settings) -> Result<(), RecorderError> {
        let epoll = epoll()?;
        let mut old: Vec<(InterfaceState, Link)> =
            self.states.drain(..).zip(self.links.drain(..)).collect();
        for (number, bus) in (0_u8..).zip(&settings.buses) {
            let wishes = wishes(settings, number);
            let known = old
                .iter()
                .position(|(state, _)| state.name == bus.interface);
            let (state, link) = if let Some(known) = known {
                let (mut state, mut link) = old.swap_remove(known);
                link.change(&mut state, &mut self.desk, wishes);
                link.intake.renumber(number);
                watch(&epoll, &link, u64::from(number));
                (state, link)
            } else {
                let state = InterfaceState {
                    name: bus.interface.clone(),
                    // Room for either word, so that none is made when frames come.
                    stamps: String::with_capacity(8),
                    ..InterfaceState::default()
                };
                (state, Link::new(wishes))
            };
            self.states.push(state);
            self.links.push(link);
        }
        self.epoll = epoll;
        self.next_look_ns = i64::MIN;
        let now = self.desk.now();
        self.look(now);
        Ok(())
    }
}

fn epoll() -> Result<Epoll, RecorderError> {
    Epoll::new(EpollCreateFlags::EPOLL_CLOEXEC)
        .map_err(|error| RecorderError::io("epoll", "create")(error.into()))
}

/// Closing a socket ends its being watched.
fn watch(epoll: &Epoll, link: &Link, number: u64) {
    if let Some(socket) = link.socket() {
        // It fails only for want of memory; the interface is then read when another is, and each time it is looked at.
        let _ = epoll.add(socket, EpollEvent::new(EpollFlags::EPOLLIN, number));
    }
}

/// What the socket of a bus is opened with.
fn wishes(settings: &Settings, bus: u8) -> Wishes {
    let mut ids: Vec<u32> = settings
        .plan
        .messages
        .iter()
        .filter(|message| message.bus == bus)
        .map(|message| message.id)
        .collect();
    ids.sort_unstable();
    ids.dedup();
    Wishes {
        ids: (settings.raw.frames != RawFrames::All).then_some(ids),
        receive_buffer: settings.run.receive_buffer,
    }
}
