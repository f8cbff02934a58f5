//! Two threads: one ahead of all others kills on time, one of the daemons' own priority measures how long the machine
//! let it wait.

use std::collections::VecDeque;
use std::process::Child;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread::{JoinHandle, sleep};
use std::time::Duration;

use recorder::clock::{monotonic_ns, realtime_ns};

use crate::bench::run;

/// The meter's sleep.
const NAP: Duration = Duration::from_millis(1);
const NAP_NS: i64 = 1_000_000;
/// What it measured is remembered for so long, ns.
const REMEMBERED_NS: i64 = 1_000_000_000;

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

/// What the meter measured.
#[derive(Default)]
struct Meter {
    /// When it fell asleep last.
    asleep_ns: i64,
    /// Of the last second: when it woke, and how much too late.
    recent: VecDeque<(i64, i64)>,
    /// How much too late, each time.
    all: Vec<i64>,
}

impl Meter {
    fn stall_ns(&self) -> i64 {
        let running = monotonic_ns() - self.asleep_ns - NAP_NS;
        let recent = self.recent.iter().map(|(_, late)| *late);
        recent.fold(running, i64::max)
    }
}

/// The threads.
pub(crate) struct Reaper {
    to: Sender<Order>,
    killing: JoinHandle<()>,
    metering: JoinHandle<()>,
    measured: Arc<Mutex<Meter>>,
    stop: Arc<AtomicBool>,
}

/// Gives this thread a place in the order of real time; as root it is allowed.
fn realtime(priority: u8) {
    let own = std::fs::read_link("/proc/thread-self").unwrap();
    let number = own.file_name().unwrap().to_str().unwrap();
    run("chrt", &["--fifo", "--pid", &priority.to_string(), number]);
}

impl Reaper {
    /// Starts them; the daemons have this priority.
    pub(crate) fn start(priority: u8) -> Self {
        let (to, orders) = channel();
        let measured = Arc::new(Mutex::new(Meter {
            asleep_ns: monotonic_ns(),
            ..Meter::default()
        }));
        let stop = Arc::new(AtomicBool::new(false));
        let (shared, stopped) = (Arc::clone(&measured), Arc::clone(&stop));
        let metering = std::thread::spawn(move || {
            realtime(priority);
            measure(&shared, &stopped);
        });
        let shared = Arc::clone(&measured);
        let killing = std::thread::spawn(move || {
            realtime(priority + 10);
            reap(&orders, &shared);
        });
        Self {
            to,
            killing,
            metering,
            measured,
            stop,
        }
    }

    /// One who orders.
    pub(crate) fn killer(&self) -> Killer {
        Killer(self.to.clone())
    }

    /// Waits until no one orders any more; gives all that sleeps took too long, sorted, ns.
    pub(crate) fn end(self) -> Vec<i64> {
        drop(self.to);
        self.killing.join().unwrap();
        self.stop.store(true, Ordering::Relaxed);
        self.metering.join().unwrap();
        let mut all = std::mem::take(&mut self.measured.lock().unwrap().all);
        all.sort_unstable();
        all
    }
}

fn measure(shared: &Mutex<Meter>, stop: &AtomicBool) {
    while !stop.load(Ordering::Relaxed) {
        shared.lock().unwrap().asleep_ns = monotonic_ns();
        sleep(NAP);
        let mut meter = shared.lock().unwrap();
        let now = monotonic_ns();
        let late = now - meter.asleep_ns - NAP_NS;
        meter.all.push(late);
        meter.recent.push_back((now, late));
        while meter
            .recent
            .front()
            .is_some_and(|(at, _)| now - at > REMEMBERED_NS)
        {
            meter.recent.pop_front();
        }
    }
}

fn reap(orders: &Receiver<Order>, meter: &Mutex<Meter>) {
    let mut waiting: Vec<Order> = Vec::new();
    loop {
        let next = waiting.iter().map(|order| order.at_ns).min();
        let wait = next.map_or(i64::MAX, |at| at - monotonic_ns()).max(0);
        match orders.recv_timeout(Duration::from_nanos(wait.unsigned_abs())) {
            Ok(order) => waiting.push(order),
            Err(RecvTimeoutError::Disconnected) if waiting.is_empty() => return,
            Err(RecvTimeoutError::Disconnected) => sleep(NAP),
            Err(RecvTimeoutError::Timeout) => {}
        }
        let now = monotonic_ns();
        while let Some(at) = waiting.iter().position(|order| order.at_ns <= now) {
            let mut order = waiting.swap_remove(at);
            let ran = order.child.try_wait().unwrap().is_none();
            let killed_ns = realtime_ns();
            order.child.kill().unwrap();
            let sending_ns = realtime_ns() - killed_ns;
            let stall_ns = meter.lock().unwrap().stall_ns();
            order.child.wait().unwrap();
            let _ = order.done.send(Death {
                killed_ns,
                sending_ns,
                stall_ns,
                ran,
            });
        }
    }
}
