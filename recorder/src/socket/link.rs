//! One interface: its socket as long as there is one, and what happened to it.

use std::io;

use nix::errno::Errno;

use super::batch::{BATCH, Batch};
use super::desk::Desk;
use super::intake::Intake;
use super::raw::{FULL_BUS, RawCan, Wishes, holds, index_of};
use crate::live::InterfaceState;

/// A socket and what it is bound to.
struct Bound {
    raw: RawCan,
    index: u32,
    drops: u32,
}

/// One interface.
pub(super) struct Link {
    wishes: Wishes,
    bound: Option<Bound>,
    /// It was missing, down or refused when last looked at, and that was told.
    out: bool,
    /// When that was seen, ns on the line.
    lost_ns: i64,
    /// More may wait in the kernel.
    more: bool,
    /// Frames on their way.
    pub intake: Intake,
}

impl Link {
    pub(super) fn new(wishes: Wishes) -> Self {
        Self {
            wishes,
            bound: None,
            out: false,
            lost_ns: i64::MIN,
            more: false,
            intake: Intake::new(),
        }
    }

    /// The socket to wait for, if there is one.
    pub(super) fn socket(&self) -> Option<&RawCan> {
        self.bound.as_ref().map(|bound| &bound.raw)
    }

    /// More frames may wait in the kernel.
    pub(super) fn more(&self) -> bool {
        self.more
    }

    /// It is not read now, for something of it waits: more may wait in the kernel behind that.
    pub(super) fn leave(&mut self) {
        self.more = self.bound.is_some();
    }

    /// Looks after the interface, each quarter of a second: opens it, finds it back, finds it gone. True if there is
    /// another socket to wait for now.
    pub(super) fn look(&mut self, state: &mut InterfaceState, desk: &mut Desk) -> bool {
        self.intake.refresh();
        self.count_drops(state);
        let index = index_of(&state.name);
        let bound = self.bound.as_ref().map(|bound| bound.index);
        if bound.is_some() && bound != index {
            self.close(state);
            self.lost(state, desk, "was removed or renamed");
        }
        let Some(index) = index else {
            self.lost(state, desk, "is not there");
            return false;
        };
        if self.bound.is_some() && !self.out {
            return false;
        }
        // Where the interface is only down the socket at hand still is the one to listen to, and this one merely
        // tells whether it is up again.
        let opened = RawCan::open(index, &self.wishes).and_then(|raw| match raw.error() {
            None => Ok((raw, true)),
            Some(error) if is_down(&error) => Ok((raw, false)),
            Some(error) => Err(error),
        });
        let (raw, up) = match opened {
            Ok(opened) => opened,
            Err(error) => {
                self.lost(state, desk, &format!("can not be opened: {error}"));
                return false;
            }
        };
        let fresh = self.bound.is_none();
        if fresh {
            self.bind(state, desk, raw, index);
        }
        if up {
            self.back(state, desk);
        } else {
            self.lost(state, desk, "is down");
        }
        fresh
    }

    fn bind(&mut self, state: &mut InterfaceState, desk: &mut Desk, raw: RawCan, index: u32) {
        let queue = raw.queue();
        let drops = queue.map_or(0, |queue| queue.drops);
        self.bound = Some(Bound { raw, index, drops });
        self.intake.begin();
        self.tell_buffer(state, desk);
    }

    fn tell_buffer(&self, state: &mut InterfaceState, desk: &mut Desk) {
        let queue = self.bound.as_ref().and_then(|bound| bound.raw.queue());
        let buffer = queue.map_or(0, |queue| queue.buffer);
        let known = std::mem::replace(&mut state.receive_buffer, u64::from(buffer));
        let frames = holds(buffer);
        if frames < FULL_BUS && known != state.receive_buffer {
            let text = format!(
                "{}: the receive buffer in force, {buffer} bytes, holds {frames} frames; expected {FULL_BUS}, 1 s of \
                 a full bus: raise run.receive_buffer_kib and give CAP_NET_ADMIN, or raise net.core.rmem_max",
                state.name,
            );
            let now = desk.now();
            desk.note(now, text);
        }
    }

    fn close(&mut self, state: &mut InterfaceState) {
        self.count_drops(state);
        self.bound = None;
        self.more = false;
    }

    fn lost(&mut self, state: &mut InterfaceState, desk: &mut Desk, how: &str) {
        state.up = false;
        if !std::mem::replace(&mut self.out, true) {
            state.outages += 1;
            self.lost_ns = desk.now();
            desk.note(self.lost_ns, format!("{} {how}", state.name));
        }
    }

    fn back(&mut self, state: &mut InterfaceState, desk: &mut Desk) {
        state.up = true;
        if std::mem::replace(&mut self.out, false) {
            let now = desk.now();
            desk.note(now, format!("{} is up", state.name));
        }
    }

    /// Takes over other filters and another buffer.
    pub(super) fn change(&mut self, state: &mut InterfaceState, desk: &mut Desk, wishes: Wishes) {
        self.wishes = wishes;
        let Some(bound) = &self.bound else { return };
        match bound.raw.apply(&self.wishes) {
            Ok(()) => self.tell_buffer(state, desk),
            Err(error) => {
                self.close(state);
                self.lost(state, desk, &format!("refuses the new filters: {error}"));
            }
        }
    }

    fn count_drops(&mut self, state: &mut InterfaceState) {
        if let Some(bound) = &mut self.bound
            && let Some(queue) = bound.raw.queue()
        {
            state.dropped += dropped(&mut bound.drops, queue.drops);
        }
    }

    /// Reads the next batch behind what waits.
    pub(super) fn refill(
        &mut self,
        state: &mut InterfaceState,
        desk: &mut Desk,
        batch: &mut Batch,
        number: u8,
    ) {
        let behind = std::mem::take(&mut self.more);
        let Some(bound) = &self.bound else { return };
        let intake = &mut self.intake;
        let read = batch.read(&bound.raw, desk, |desk, now, datagram, stamps| {
            intake.take(state, desk, (now, number), datagram, stamps);
        });
        match read {
            Ok(count) => {
                self.more = count == BATCH;
                // What waited when it went down is no sign of its being up.
                if self.out && count > 0 && self.intake.newest_ns() > self.lost_ns {
                    self.back(state, desk);
                }
                if behind || self.more {
                    self.count_drops(state);
                }
            }
            // The kernel tells of it once, ahead of the frames that still wait.
            Err(Errno::ENETDOWN) => {
                self.more = true;
                self.lost(state, desk, "went down");
            }
            Err(Errno::EAGAIN | Errno::EINTR) => {}
            Err(Errno::ENODEV | Errno::ENXIO) => {
                self.close(state);
                self.lost(state, desk, "was removed");
            }
            Err(error) => {
                self.close(state);
                self.lost(state, desk, &format!("can not be read: {error}"));
            }
        }
    }
}

/// Frames dropped since the counter showed `last`; it has 32 bits and wraps.
fn dropped(last: &mut u32, now: u32) -> u64 {
    u64::from(now.wrapping_sub(std::mem::replace(last, now)))
}

fn is_down(error: &io::Error) -> bool {
    error.raw_os_error() == Some(nix::libc::ENETDOWN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_drop_counter_wraps() {
        let mut last = u32::MAX - 2;
        assert_eq!(dropped(&mut last, u32::MAX), 2);
        assert_eq!(dropped(&mut last, 7), 8);
        assert_eq!(dropped(&mut last, 7), 0);
    }
}
