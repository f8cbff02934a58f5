//! Settings of the running daemon: records, spool, socket, priority, serial read-out.

use std::path::{Path, PathBuf};

use schema::num;

use super::ConfigError;
use super::file::{Config, FramesName};
use super::settings::{Check, Raw, RawFrames};

/// Part of the bound on the loss that passes between two flushes, where `flush_ms` is not set: the rest is for the
/// flush itself.
const FLUSH_PART: f64 = 0.6;
/// Shortest token of the serial read-out, bytes.
const SHORTEST_TOKEN: usize = 12;

/// `[store]`, and the key of `[device]`.
#[derive(Clone, Debug)]
pub struct Store {
    /// Folder of the records.
    pub dir: PathBuf,
    /// Sealed records that are kept.
    pub keep: u32,
    /// File of the device's secret key; without one records are not signed.
    pub key: Option<PathBuf>,
    /// The recipient's public key that records are encrypted to (cargo feature `age`).
    pub encrypt_to: Option<String>,
}

/// `[spool]`.
#[derive(Clone, Debug)]
pub struct Spool {
    /// Kept at all.
    pub enabled: bool,
    /// Its file.
    pub file: PathBuf,
    /// A cut loses at most so much, ns.
    pub loss_ns: i64,
    /// Time between two flushes while nothing happens, ns.
    pub flush_ns: i64,
}

/// `[run]`.
#[derive(Clone, Debug)]
pub struct Run {
    /// The Unix socket of `recorder status` and `recorder trigger`.
    pub socket: PathBuf,
    /// `SCHED_FIFO` priority, 1 to 99; `None`: as started.
    pub realtime_priority: Option<u8>,
    /// Lock all memory.
    pub lock_memory: bool,
    /// Time between two self-tests, ns.
    pub self_test_ns: i64,
    /// Receive buffer of each CAN socket, bytes.
    pub receive_buffer: usize,
}

/// `[serial]`.
#[derive(Clone, Debug)]
pub struct Serial {
    /// What a reader must know.
    pub token: String,
    /// Bits a second.
    pub baud: u32,
}

/// Where the socket is unless configured: in the folder that systemd gives the service, else in the user's, else in
/// that of root.
#[must_use]
pub fn default_socket() -> PathBuf {
    let folder = |name: &str| std::env::var_os(name).map(PathBuf::from);
    folder("RUNTIME_DIRECTORY")
        .or_else(|| folder("XDG_RUNTIME_DIR").map(|folder| folder.join("svartboks")))
        .unwrap_or_else(|| PathBuf::from("/run/svartboks"))
        .join("recorder.sock")
}

impl Check<'_> {
    pub(super) fn raw(&self, config: &Config) -> Result<Raw, ConfigError> {
        let nanos = |key: &str, value: f64| -> Result<i64, ConfigError> {
            Ok(num::round_i64(self.within(key, value, 0.0, 10.0)? * 1e9))
        };
        Ok(Raw {
            frames: match config.raw.frames {
                FramesName::Mapped => RawFrames::Mapped,
                FramesName::All => RawFrames::All,
                FramesName::None => RawFrames::None,
            },
            before_ns: nanos("raw.before_s", config.raw.before_s)?,
            after_ns: nanos("raw.after_s", config.raw.after_s)?,
        })
    }

    pub(super) fn store(&self, config: &Config, base_dir: &Path) -> Result<Store, ConfigError> {
        let store = &config.store;
        if !(5..=100_000).contains(&store.keep) {
            return Err(self.wrong("store.keep", "5 to 100000", store.keep));
        }
        Ok(Store {
            dir: base_dir.join(&store.dir),
            keep: store.keep,
            key: config.device.key.as_ref().map(|key| base_dir.join(key)),
            encrypt_to: store.encrypt_to.clone(),
        })
    }

    pub(super) fn spool(&self, config: &Config, base_dir: &Path) -> Result<Spool, ConfigError> {
        let spool = &config.spool;
        let loss = self.within("spool.loss_ms", spool.loss_ms, 20.0, 10_000.0)?;
        let flush = spool.flush_ms.unwrap_or(loss * FLUSH_PART);
        let flush = self.within("spool.flush_ms", flush, 5.0, loss)?;
        let nanos = |milliseconds: f64| num::round_i64(milliseconds * 1e6);
        Ok(Spool {
            enabled: spool.enabled,
            file: spool.file.as_ref().map_or_else(
                || base_dir.join(&config.store.dir).join("spool.svs"),
                |file| base_dir.join(file),
            ),
            loss_ns: nanos(loss),
            flush_ns: nanos(flush),
        })
    }

    pub(super) fn run(&self, config: &Config, base_dir: &Path) -> Result<Run, ConfigError> {
        let run = &config.run;
        if run.realtime_priority > 99 {
            let expected = "0 (off) to 99";
            return Err(self.wrong("run.realtime_priority", expected, run.realtime_priority));
        }
        if !(64..=262_144).contains(&run.receive_buffer_kib) {
            let expected = "64 to 262144";
            return Err(self.wrong("run.receive_buffer_kib", expected, run.receive_buffer_kib));
        }
        let minutes = self.within(
            "run.self_test_minutes",
            run.self_test_minutes,
            0.01,
            10_000.0,
        )?;
        Ok(Run {
            socket: run
                .socket
                .as_ref()
                .map_or_else(default_socket, |socket| base_dir.join(socket)),
            realtime_priority: Some(run.realtime_priority).filter(|priority| *priority > 0),
            lock_memory: run.lock_memory,
            self_test_ns: num::round_i64(minutes * 60e9),
            receive_buffer: num::usize_of(u64::from(run.receive_buffer_kib) * 1024),
        })
    }

    pub(super) fn serial(&self, config: &Config) -> Result<Option<Serial>, ConfigError> {
        let Some(serial) = &config.serial else {
            return Ok(None);
        };
        if serial.token.len() < SHORTEST_TOKEN || serial.token.len() > 128 {
            let expected = "12 to 128 bytes";
            return Err(self.wrong(
                "serial.token",
                expected,
                format!("{} bytes", serial.token.len()),
            ));
        }
        if !(1200..=4_000_000).contains(&serial.baud) {
            return Err(self.wrong("serial.baud", "1200 to 4000000", serial.baud));
        }
        Ok(Some(Serial {
            token: serial.token.clone(),
            baud: serial.baud,
        }))
    }
}
