//! One thread ahead of all others: it kills on time, and it measures whether the machine stood still.

use std::process::Child;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{JoinHandle, sleep};
use std::time::Duration;

use recorder::clock::{monotonic_ns, realtime_ns};

use crate::bench::run;

/// Between two looks.
const LOOK: Duration = Duration::from_millis(1);
/// Stalls are remembered for so long, ns.
const REMEMBERED_NS: i64 = 1_000_000_000;
/// Above the daemons: it is never kept waiting by them.
const PRIORITY: &str = "30";

/// What is to be killed.
struct Order {
    child: Child,
    at_ns: i64,
    done: Sender<Death>,
}

/// How it ended.
pub(crate) struct Death {
    /// Just before the signal was sent, by `CLOCK_REALTIME`, ns.
    pub(crate) killed_ns: i64,
    /// So long the sending took, ns.
    pub(crate) sending_ns: i64,
    /// The most that a sleep of 1 ms took too long in the second before, ns.
    pub(crate) stall_ns: i64,
    /// It still ran then.
    pub(crate) ran: bool,
}

/// The thread.
pub(crate) struct Reaper {
    to: Option<Sender<Order>>,
    thread: Option<JoinHandle<Vec<i64>>>,
}

/// For each of the daemons: orders a death and waits for it.
#[derive(Clone)]
pub(crate) struct Killer(Sender<Order>);

impl Killer {
    /// Kills a program at an instant of the monotonic clock and waits for its end.
    pub(crate) fn kill_at(&self, child: Child, at_ns: i64) -> Death {
        let (done, death) = channel();
        let order = Order { child, at_ns, done };
        self.0.send(order).unwrap();
        death.recv().unwrap()
    }
}

impl Reaper {
    /// Starts it.
    pub(crate) fn start() -> Self {
        let (to, orders) = channel();
        let thread = std::thread::spawn(move || {
            let own = std::fs::read_link("/proc/thread-self").unwrap();
            let number = own.file_name().unwrap().to_str().unwrap();
            // As root it is allowed.
            run("chrt", &["--fifo", "--pid", PRIORITY, number]);
            work(&orders)
        });
        Self {
            to: Some(to),
            thread: Some(thread),
        }
    }

    /// One who orders.
    pub(crate) fn killer(&self) -> Killer {
        Killer(self.to.clone().unwrap())
    }

    /// Waits until no one orders any more; gives all that sleeps took too long, sorted, ns.
    pub(crate) fn end(mut self) -> Vec<i64> {
        drop(self.to.take());
        let mut all = self.thread.take().unwrap().join().unwrap();
        all.sort_unstable();
        all
    }
}

fn work(orders: &Receiver<Order>) -> Vec<i64> {
    let mut waiting: Vec<Order> = Vec::new();
    let mut recent: std::collections::VecDeque<(i64, i64)> = std::collections::VecDeque::new();
    let mut all = Vec::new();
    let look_ns = schema::num::round_i64(LOOK.as_secs_f64() * 1e9);
    loop {
        let before = monotonic_ns();
        sleep(LOOK);
        let now = monotonic_ns();
        let over = now - before - look_ns;
        all.push(over);
        recent.push_back((now, over));
        while recent
            .front()
            .is_some_and(|(at, _)| now - at > REMEMBERED_NS)
        {
            recent.pop_front();
        }
        let closed = loop {
            match orders.try_recv() {
                Ok(order) => waiting.push(order),
                Err(error) => break error == std::sync::mpsc::TryRecvError::Disconnected,
            }
        };
        if closed && waiting.is_empty() {
            return all;
        }
        while let Some(at) = waiting.iter().position(|order| order.at_ns <= now) {
            let mut order = waiting.swap_remove(at);
            let ran = order.child.try_wait().unwrap().is_none();
            let killed_ns = realtime_ns();
            order.child.kill().unwrap();
            let sending_ns = realtime_ns() - killed_ns;
            order.child.wait().unwrap();
            let stall_ns = recent.iter().map(|(_, over)| *over).max().unwrap_or(0);
            let _ = order.done.send(Death {
                killed_ns,
                sending_ns,
                stall_ns,
                ran,
            });
        }
    }
}
