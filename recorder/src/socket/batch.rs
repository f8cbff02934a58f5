//! Many frames by one call of the kernel, into buffers that are made once.

use std::io::IoSliceMut;
use std::os::fd::AsRawFd;

use nix::cmsg_space;
use nix::errno::Errno;
use nix::sys::socket::{
    ControlMessageOwned, MsgFlags, MultiHeaders, RecvMsg, Timestamps, recvmmsg,
};
use nix::sys::time::TimeSpec;

use super::desk::Desk;
use super::raw::RawCan;
use crate::can::{EFF, ERR, FD, Frame, MAX_DATA, RTR};
use crate::clock::nanoseconds;

/// Frames by one call.
pub(super) const BATCH: usize = 128;
/// Bytes of a classic and of an FD frame as the kernel hands them on.
const CLASSIC: usize = 16;
const FLEXIBLE: usize = 72;
/// Where the payload begins in both.
const PAYLOAD: usize = 8;

/// Buffers for a batch.
pub(super) struct Batch {
    buffers: Box<[[u8; FLEXIBLE]; BATCH]>,
    headers: MultiHeaders<()>,
}

/// A datagram's stamps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Stamps {
    /// The kernel's stamp, UTC, ns.
    pub kernel_ns: Option<i64>,
    /// The controller's, by its own clock, ns.
    pub hardware_ns: Option<i64>,
}

impl Batch {
    pub(super) fn new() -> Self {
        Self {
            buffers: Box::new([[0; FLEXIBLE]; BATCH]),
            headers: headers(),
        }
    }

    /// Reads what is there, without waiting. `each` gets the time of the reading on the line, a datagram's bytes and
    /// its stamps. Gives the number of datagrams.
    pub(super) fn read(
        &mut self,
        socket: &RawCan,
        desk: &mut Desk,
        mut each: impl FnMut(&mut Desk, i64, &[u8], Stamps),
    ) -> Result<usize, Errno> {
        let mut truncated = false;
        let mut count = 0;
        {
            let mut slices = self
                .buffers
                .each_mut()
                .map(|buffer| [IoSliceMut::new(buffer)]);
            let messages = recvmmsg(
                socket.as_raw_fd(),
                &mut self.headers,
                slices.iter_mut(),
                MsgFlags::MSG_DONTWAIT,
                None,
            )?;
            let now = desk.now();
            for message in messages {
                count += 1;
                truncated |= message.flags.contains(MsgFlags::MSG_CTRUNC);
                let bytes = message.iovs().next().unwrap_or_default();
                each(desk, now, bytes, stamps(&message));
            }
        }
        if truncated {
            // The kernel writes the used length of the control messages into the headers and nix leaves it there, so
            // that a header serves only messages as long as the shortest before. All have the same length here; if
            // that should ever fail, the next batch at least has its stamps.
            self.headers = headers();
        }
        Ok(count)
    }
}

fn headers() -> MultiHeaders<()> {
    MultiHeaders::preallocate(BATCH, Some(cmsg_space!(TimeSpec, Timestamps)))
}

fn stamps(message: &RecvMsg<'_, '_, ()>) -> Stamps {
    let mut stamps = Stamps::default();
    let Ok(control) = message.cmsgs() else {
        return stamps;
    };
    for part in control {
        match part {
            ControlMessageOwned::ScmTimestampns(time) => {
                stamps.kernel_ns = Some(nanoseconds(time));
            }
            ControlMessageOwned::ScmTimestampsns(times) => {
                let raw = nanoseconds(times.hw_raw);
                stamps.hardware_ns = (raw != 0).then_some(raw);
            }
            _ => {}
        }
    }
    stamps
}

/// Reads a datagram into `frame`, all but its time and its interface; false if it is no frame.
pub(super) fn decode(datagram: &[u8], frame: &mut Frame) -> bool {
    let flexible = match datagram.len() {
        CLASSIC => false,
        FLEXIBLE => true,
        _ => return false,
    };
    let Some((&[a, b, c, d, length, flags, ..], payload)) = datagram.split_first_chunk::<PAYLOAD>()
    else {
        return false;
    };
    let id = u32::from_ne_bytes([a, b, c, d]);
    let length = usize::from(length);
    let most = if flexible { MAX_DATA } else { PAYLOAD };
    let Some(data) = payload.get(..length).filter(|_| length <= most) else {
        return false;
    };
    let bits = if id & (EFF | ERR) == 0 {
        0x7FF
    } else {
        0x1FFF_FFFF
    };
    frame.id = id & (bits | EFF | RTR | ERR);
    // Of an FD frame's flags only these two are the sender's; the kernel adds others of its own.
    frame.flags = if flexible { FD | (flags & 3) } else { 0 };
    frame.fill(if id & RTR == 0 { data } else { &[] });
    true
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn datagram(size: usize, id: u32, length: u8, flags: u8) -> Vec<u8> {
        let mut bytes = vec![0; size];
        bytes[..4].copy_from_slice(&id.to_ne_bytes());
        bytes[4] = length;
        bytes[5] = flags;
        for (at, byte) in (1..).zip(&mut bytes[8..]) {
            *byte = at;
        }
        bytes
    }

    #[test]
    fn classic_and_flexible_frames_are_told_apart() {
        let mut frame = Frame::empty();
        assert!(decode(&datagram(16, 0x123, 3, 0), &mut frame));
        assert_eq!(
            (frame.id, frame.flags, frame.data()),
            (0x123, 0, &[1, 2, 3][..])
        );
        assert!(decode(&datagram(72, 0x9ABC_DEF0, 12, 5), &mut frame));
        assert_eq!(
            (frame.id, frame.flags, frame.len()),
            (0x9ABC_DEF0, FD | 1, 12)
        );
        assert!(decode(&datagram(16, RTR | 0x10, 8, 0), &mut frame));
        assert_eq!((frame.id, frame.len()), (RTR | 0x10, 0));
        assert!(decode(&datagram(16, ERR | 0x40, 8, 0), &mut frame));
        assert_eq!((frame.id, frame.len()), (ERR | 0x40, 8));
    }

    #[test]
    fn what_is_no_frame_is_none() {
        let mut frame = Frame::empty();
        for bytes in [
            datagram(16, 1, 9, 0),
            datagram(72, 1, 65, 0),
            datagram(20, 1, 1, 0),
            Vec::new(),
        ] {
            assert!(!decode(&bytes, &mut frame), "{bytes:?}");
        }
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_frame_or_none(bytes in proptest::collection::vec(any::<u8>(), 0..80)) {
            let mut frame = Frame::empty();
            if decode(&bytes, &mut frame) {
                prop_assert!(frame.data().len() <= 64);
            }
        }
    }
}
