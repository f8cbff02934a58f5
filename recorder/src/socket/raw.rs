//! One raw CAN socket: opened with everything set before it is bound, so that no frame comes unfiltered, unstamped
//! or into too small a buffer.

use std::io;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, RawFd};

use nix::libc;
use nix::net::if_::if_nametoindex;
use schema::num;
use socket2::{Domain, Protocol, SockAddr, Socket, Type};
use socketcan::{CanAddr, CanFilter, SocketOptions};

/// Most filters the kernel takes for one socket (`CAN_RAW_FILTER_MAX`).
const MOST_FILTERS: usize = 512;
/// What the kernel charges the receive buffer for one frame, bytes (measured: 278 frames fill 212,992).
pub(super) const CHARGED: usize = 768;
/// Frames a second of a full classic bus: 1 Mbit/s and frames of 8 bytes; rounded up.
pub(super) const FULL_BUS: usize = 10_000;
/// In the answer to `SO_MEMINFO`, words of 32 bits: the receive buffer in force, and the drops so far.
const MEMINFO_RCVBUF: usize = 1;
const MEMINFO_DROPS: usize = 8;
const MEMINFO_WORDS: usize = 9;

/// What a socket is opened with.
#[derive(Clone, Debug)]
pub(super) struct Wishes {
    /// Identifiers with their flag of extended ones, sorted; `None` lets every frame in.
    pub ids: Option<Vec<u32>>,
    /// Receive buffer, bytes.
    pub receive_buffer: usize,
}

impl Wishes {
    fn filters(&self) -> Option<Vec<CanFilter>> {
        let ids = self.ids.as_ref().filter(|ids| ids.len() <= MOST_FILTERS)?;
        Some(ids.iter().map(|&id| filter(id)).collect())
    }
}

/// Exactly this identifier, data frames only.
fn filter(id: u32) -> CanFilter {
    let bits = if id & libc::CAN_EFF_FLAG == 0 {
        libc::CAN_SFF_MASK
    } else {
        libc::CAN_EFF_MASK
    };
    CanFilter::new(id, bits | libc::CAN_EFF_FLAG | libc::CAN_RTR_FLAG)
}

/// Number of an interface now, if it is there.
pub(super) fn index_of(name: &str) -> Option<u32> {
    if_nametoindex(name).ok()
}

/// The receive queue's figures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Queue {
    /// Buffer in force, bytes.
    pub buffer: u32,
    /// Frames dropped so far, counted in 32 bits that wrap. It is the counter that `SO_RXQ_OVFL` tells with the next
    /// frame after a loss, read without waiting for that frame, and without a control message that comes and goes.
    pub drops: u32,
}

/// A raw CAN socket, classic and FD.
#[derive(Debug)]
pub(super) struct RawCan(Socket);

impl AsRawFd for RawCan {
    fn as_raw_fd(&self) -> RawFd {
        self.0.as_raw_fd()
    }
}

impl AsFd for RawCan {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}

impl SocketOptions for RawCan {}

impl RawCan {
    /// A socket that is bound to nothing: fails where the kernel has no SocketCAN.
    pub(super) fn unbound() -> io::Result<Self> {
        let domain = Domain::from(libc::AF_CAN);
        let protocol = Protocol::from(libc::CAN_RAW);
        let socket = Socket::new(domain, Type::RAW.nonblocking(), Some(protocol))?;
        Ok(Self(socket))
    }

    /// Opens and binds. On an interface that is down this works, and [`RawCan::error`] says so.
    pub(super) fn open(index: u32, wishes: &Wishes) -> io::Result<Self> {
        let socket = Self::unbound()?;
        let on: libc::c_int = 1;
        socket.set_socket_option_int(libc::SOL_CAN_RAW, libc::CAN_RAW_FD_FRAMES, on)?;
        socket.set_error_filter_accept_all()?;
        // The plain stamp is there for every frame; the other brings the hardware's, where the interface has one.
        // Both come with every frame, so that the control messages always need the same space.
        socket.set_recv_timestamp(true)?;
        socket.set_timestamping(
            libc::SOF_TIMESTAMPING_RX_SOFTWARE
                | libc::SOF_TIMESTAMPING_SOFTWARE
                | libc::SOF_TIMESTAMPING_RX_HARDWARE
                | libc::SOF_TIMESTAMPING_RAW_HARDWARE,
        )?;
        socket.apply(wishes)?;
        socket.0.bind(&SockAddr::from(CanAddr::new(index)))?;
        Ok(socket)
    }

    /// Sets filters and buffer, of an open socket too.
    pub(super) fn apply(&self, wishes: &Wishes) -> io::Result<()> {
        match wishes.filters() {
            Some(filters) if filters.is_empty() => self.set_filter_drop_all()?,
            Some(filters) => self.set_filters(&filters)?,
            None => self.set_filter_accept_all()?,
        }
        // The kernel doubles what it is asked for.
        let half = libc::c_int::try_from(wishes.receive_buffer / 2).unwrap_or(libc::c_int::MAX);
        self.set_socket_option_int(libc::SOL_SOCKET, libc::SO_RCVBUFFORCE, half)
            .or_else(|_| self.set_socket_option_int(libc::SOL_SOCKET, libc::SO_RCVBUF, half))
    }

    /// The error that is pending, which it then no longer is.
    pub(super) fn error(&self) -> Option<io::Error> {
        self.0.take_error().unwrap_or_else(Some)
    }

    /// The receive queue's figures; `None` where the kernel does not tell.
    pub(super) fn queue(&self) -> Option<Queue> {
        let mut bytes = [0; 4 * MEMINFO_WORDS];
        let read = self
            .get_socket_option_bytes(libc::SOL_SOCKET, libc::SO_MEMINFO, &mut bytes)
            .ok()?;
        queue(bytes.get(..read)?)
    }
}

fn queue(bytes: &[u8]) -> Option<Queue> {
    let (words, _) = bytes.as_chunks::<4>();
    Some(Queue {
        buffer: u32::from_ne_bytes(*words.get(MEMINFO_RCVBUF)?),
        drops: u32::from_ne_bytes(*words.get(MEMINFO_DROPS)?),
    })
}

/// Frames that a buffer of so many bytes holds.
pub(super) fn holds(buffer: u32) -> usize {
    num::usize_of(u64::from(buffer)) / CHARGED
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_filter_lets_in_one_identifier_and_no_remote_request() {
        let parts = |id: u32| {
            let filter = filter(id);
            let raw: &libc::can_filter = filter.as_ref();
            (raw.can_id, raw.can_mask)
        };
        assert_eq!(parts(0x120), (0x120, 0xC000_07FF));
        assert_eq!(parts(0x8000_0120), (0x8000_0120, 0xDFFF_FFFF));
    }

    #[test]
    fn more_filters_than_the_kernel_takes_are_none() {
        let wishes = |count| Wishes {
            ids: Some((0..count).collect()),
            receive_buffer: 0,
        };
        assert_eq!(wishes(512).filters().unwrap().len(), 512);
        assert!(wishes(513).filters().is_none());
    }

    #[test]
    fn the_queues_figures_are_found_in_the_kernels_answer() {
        let mut answer = Vec::new();
        for word in 0_u32..9 {
            answer.extend_from_slice(&(word * 100).to_ne_bytes());
        }
        let expected = Queue {
            buffer: 100,
            drops: 800,
        };
        assert_eq!(queue(&answer), Some(expected));
        assert_eq!(queue(&answer[..32]), None, "kernels before 4.12");
    }
}
