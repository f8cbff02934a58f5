//! The daemon as a program: started, asked, stopped; and senders that go on whatever becomes of the interface.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{JoinHandle, sleep};
use std::time::Duration;

use recorder::clock::monotonic_ns;
use schema::Record;
use serde_json::Value;

use crate::bench::{Lane, Process, run};

/// A running daemon; killed with its test.
pub(crate) struct Daemon {
    program: PathBuf,
    config: String,
    process: Process,
}

impl Daemon {
    /// Starts it and waits until it answers.
    pub(crate) fn start(lane: &Lane, config: &Path) -> Self {
        let program = lane.bin.join("recorder");
        let config = config.to_str().unwrap().to_owned();
        let words = ["run", "--config", &config];
        let process = Process::start(&program, &words, &lane.dir().join("daemon"));
        let mut daemon = Self {
            program,
            config,
            process,
        };
        daemon.until("answers", 20, |_| true);
        daemon
    }

    /// What it says of itself; `None` while it does not answer.
    pub(crate) fn status(&self) -> Option<Value> {
        let output = std::process::Command::new(&self.program)
            .args(["status", "--json", "--config", &self.config])
            .output()
            .unwrap();
        serde_json::from_slice(&output.stdout).ok()
    }

    /// Asks again and again until it answers and the answer is right; fails after `most` seconds.
    pub(crate) fn until(&mut self, what: &str, most: i64, right: impl Fn(&Value) -> bool) -> Value {
        let end = monotonic_ns() + most * 1_000_000_000;
        loop {
            let status = self.status();
            if let Some(status) = status.as_ref().filter(|status| right(status)) {
                return status.clone();
            }
            let said = fs::read_to_string(self.log()).unwrap_or_default();
            assert!(self.process.running(), "the daemon ended: {said}");
            let late = monotonic_ns() > end;
            assert!(
                !late,
                "not so in {most} s: {what}; status {status:?}; {said}"
            );
            sleep(Duration::from_millis(200));
        }
    }

    /// Where it logs.
    pub(crate) fn log(&self) -> PathBuf {
        Path::new(&self.config).parent().unwrap().join("daemon.err")
    }

    /// A manual trigger.
    pub(crate) fn trigger(&self) {
        run(&self.program, &["trigger", "--config", &self.config]);
    }

    /// Most memory it ever had, bytes.
    pub(crate) fn peak_memory(&self) -> u64 {
        let status = fs::read_to_string(format!("/proc/{}/status", self.process.id())).unwrap();
        let line = status.lines().find(|line| line.starts_with("VmHWM:"));
        let kib = line.unwrap().split_whitespace().nth(1).unwrap();
        kib.parse::<u64>().unwrap() * 1024
    }

    /// Processor time as the kernel accounts it, s, of all threads.
    pub(crate) fn cpu_s(&self) -> f64 {
        cpu_s(&self.process)
    }

    /// Stops it as a service manager does; gives its records in order.
    pub(crate) fn stop(mut self) -> Vec<Record> {
        assert_eq!(self.process.stop("TERM"), Some(0));
        let dir = Path::new(&self.config).parent().unwrap().join("records");
        records(&dir)
    }
}

/// Processor time as the kernel accounts it, s, of all threads of a program.
pub(crate) fn cpu_s(process: &Process) -> f64 {
    let stat = fs::read_to_string(format!("/proc/{}/stat", process.id())).unwrap();
    let words: Vec<&str> = stat.rsplit_once(") ").unwrap().1.split(' ').collect();
    let ticks = |at: usize| words[at].parse::<f64>().unwrap();
    // utime and stime, in ticks of 10 ms.
    (ticks(11) + ticks(12)) * 0.01
}

/// The records in a folder, in order of their names.
pub(crate) fn records(dir: &Path) -> Vec<Record> {
    let mut paths: Vec<PathBuf> = fs::read_dir(dir)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|kind| kind == "svb"))
        .collect();
    paths.sort();
    paths
        .iter()
        .map(|path| Record::read(&fs::read(path).unwrap()).unwrap().0)
        .collect()
}

/// Programs that are started again whenever they end: a sender ends when its interface goes down.
pub(crate) struct Senders {
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Senders {
    /// Starts `cangen` once for each of these lists of words.
    pub(crate) fn start(lane: &Lane, commands: &[&str]) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let threads = (0..)
            .zip(commands)
            .map(|(number, words)| {
                let (stop, words) = (Arc::clone(&stop), (*words).to_owned());
                let out = lane.dir().join(format!("sender-{number}"));
                std::thread::spawn(move || {
                    let words: Vec<&str> = words.split_whitespace().collect();
                    while !stop.load(Ordering::Relaxed) {
                        let mut sender = Process::start("cangen", &words, &out);
                        while sender.running() && !stop.load(Ordering::Relaxed) {
                            sleep(Duration::from_millis(50));
                        }
                        sender.stop("INT");
                    }
                })
            })
            .collect();
        Self { stop, threads }
    }

    /// Ends them.
    pub(crate) fn stop(self) {
        drop(self);
    }
}

impl Drop for Senders {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

/// A car at rest: 1 g upwards, no rate, no speed; its counters never count.
pub(crate) const AT_REST: &[&str] = &[
    "vcan0 -g 10 -I 120 -L 8 -D 0000000000271300",
    "vcan0 -g 10 -I 121 -L 8 -D 0000000000000000",
    "vcan0 -g 20 -I 122 -L 5 -D 0000000000",
];
