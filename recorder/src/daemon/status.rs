//! What `recorder status` shows: one JSON object, or the same in words.

use std::fmt::Write as _;

use schema::parts::TriggerKind;
use serde::{Deserialize, Serialize};

use super::gnss::GnssStatus;
use crate::live::InterfaceState;

/// The daemon's state.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Status {
    /// Program and version.
    pub software: String,
    /// Process.
    pub pid: u32,
    /// `recording`, `event` (one is running), `waiting` (no frame yet), `stopping`.
    pub state: String,
    /// As configured.
    pub device_id: String,
    /// SHA-256 of the configuration in force.
    pub config_sha256: String,
    /// UTC of the system clock, ISO 8601.
    pub utc: String,
    /// Seconds since the daemon started.
    pub uptime_s: f64,
    /// What the ring holds.
    pub ring: RingStatus,
    /// The signal groups.
    pub signals: Vec<SignalStatus>,
    /// The interfaces.
    pub interfaces: Vec<InterfaceState>,
    /// Counts since the start.
    pub totals: TotalsStatus,
    /// The last trigger.
    pub last_trigger: Option<TriggerStatus>,
    /// The records.
    pub records: RecordsStatus,
    /// The ring on disk.
    pub spool: SpoolStatus,
    /// Result of the last self-test, one sentence each; empty before the first.
    pub self_test: Vec<String>,
    /// The satellite receiver, where one is configured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gnss: Option<GnssStatus>,
    /// What needs somebody's attention, one sentence each.
    pub alarms: Vec<String>,
}

/// The ring.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct RingStatus {
    /// Held, s.
    pub held_s: f64,
    /// Configured, s.
    pub seconds: f64,
}

/// A signal group.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct SignalStatus {
    /// `accel`, `rate`, `wheel-left`, `wheel-right`.
    pub signal: String,
    /// Frames a second; 0: never arrived.
    pub rate_hz: f64,
    /// Jitter of the receive times, ms.
    pub jitter_ms: f64,
    /// Since its last frame, s; `None`: never arrived.
    pub silent_s: Option<f64>,
}

/// Counts.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct TotalsStatus {
    /// Frames received.
    pub frames: u64,
    /// Frames that the kernel dropped.
    pub dropped: u64,
    /// Error frames.
    pub error_frames: u64,
    /// Late and stray frames.
    pub late: u64,
    /// Gaps of mapped signals.
    pub gaps: u64,
    /// Steps of the clock.
    pub clock_steps: u64,
    /// Frames too short for their signals.
    pub malformed: u64,
    /// Values outside the DBC's bounds.
    pub out_of_range: u64,
    /// Largest change of speed within 150 ms, km/h.
    pub largest_delta_v_kmh: f64,
    /// Largest acceleration of a frame, g.
    pub largest_peak_g: f64,
}

/// A trigger.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TriggerStatus {
    /// Which.
    pub kind: String,
    /// UTC as the system clock gave it, ISO 8601.
    pub utc: String,
    /// The value that fired it, SI.
    pub value: f64,
    /// The threshold, SI.
    pub threshold: f64,
}

/// The records on disk.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct RecordsStatus {
    /// Their folder.
    pub dir: String,
    /// Record files there.
    pub stored: u64,
    /// Sealed since the start.
    pub sealed: u64,
    /// Path of the newest one sealed since the start.
    pub newest: Option<String>,
    /// Waiting for room on the disk.
    pub waiting: u64,
    /// They are signed.
    pub signed: bool,
    /// Bytes free for them.
    pub free_bytes: u64,
}

/// The ring on disk.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct SpoolStatus {
    /// It is written.
    pub running: bool,
    /// A cut may lose so much, ms.
    pub loss_bound_ms: f64,
    /// Time between two flushes, ms.
    pub flush_ms: f64,
    /// 99.9 % of the last flushes took at most so long, ms.
    pub flush_p999_ms: Option<f64>,
    /// 99.9 % of the last flushes had an oldest frame of at most this age when they were durable, ms: what a cut costs.
    pub loss_p999_ms: Option<f64>,
    /// The longest, ms.
    pub flush_longest_ms: f64,
    /// Flush interval and p99.9 keep the bound.
    pub within_bound: bool,
    /// The same for the 50 ms after a trigger.
    pub within_event_bound: bool,
    /// The newest frame is so far ahead of what is durable, ms.
    pub behind_ms: Option<f64>,
    /// Flushes since the start.
    pub flushes: u64,
    /// Bytes handed to the disk a day at the present pace.
    pub bytes_a_day: f64,
    /// Years that 8 GB of flash with 3,000 cycles stand at this pace, in use all day.
    pub flash_years_8gb: f64,
    /// Flushes that failed.
    pub errors: u64,
    /// Frames that found no room in memory while the disk was busy.
    pub lost_frames: u64,
}

/// A trigger in words.
#[must_use]
pub fn kind_word(kind: TriggerKind) -> &'static str {
    match kind {
        TriggerKind::Peak => "peak",
        TriggerKind::DeltaV => "delta-v",
        TriggerKind::Manual => "manual",
        TriggerKind::Can => "can",
        TriggerKind::PowerLoss => "power-loss",
    }
}

impl Status {
    /// For a person: a screen of some 30 lines.
    #[must_use]
    pub fn screen(&self) -> String {
        let mut out = String::new();
        // Writing to a string can not fail.
        let _ = self.write_screen(&mut out);
        out
    }

    fn write_screen(&self, out: &mut String) -> std::fmt::Result {
        let device = if self.device_id.is_empty() {
            "(no device id)"
        } else {
            &self.device_id
        };
        writeln!(
            out,
            "{}  {device}  pid {}  up {}",
            self.software,
            self.pid,
            span(self.uptime_s)
        )?;
        writeln!(out, "state     {}   {}", self.state, self.utc)?;
        writeln!(
            out,
            "ring      {:.1} of {:.0} s",
            self.ring.held_s, self.ring.seconds
        )?;
        for signal in &self.signals {
            let text = match signal.silent_s {
                None => "never arrived".to_owned(),
                Some(silent) if silent > 1.0 => {
                    format!("{:8.2} Hz   SILENT for {}", signal.rate_hz, span(silent))
                }
                Some(_) => format!(
                    "{:8.2} Hz   jitter {:.3} ms",
                    signal.rate_hz, signal.jitter_ms
                ),
            };
            writeln!(out, "signal    {:<12} {text}", signal.signal)?;
        }
        for interface in &self.interfaces {
            writeln!(
                out,
                "bus       {:<12} {}   {} frames, {} dropped, {} errors, {} bus-off, {} outages, stamps {}",
                interface.name,
                if interface.up { "up" } else { "DOWN" },
                interface.frames,
                interface.dropped,
                interface.error_frames,
                interface.bus_off,
                interface.outages,
                if interface.stamps.is_empty() {
                    "-"
                } else {
                    &interface.stamps
                }
            )?;
        }
        if let Some(gnss) = &self.gnss {
            gnss.write_line(out)?;
        }
        self.write_totals(out)?;
        let records = &self.records;
        writeln!(
            out,
            "records   {} in {}, {} sealed since the start, {} waiting, {}, {:.1} MB free",
            records.stored,
            records.dir,
            records.sealed,
            records.waiting,
            if records.signed {
                "signed"
            } else {
                "NOT signed"
            },
            schema::num::real_u64(records.free_bytes) / 1e6
        )?;
        if let Some(newest) = &records.newest {
            writeln!(out, "newest    {newest}")?;
        }
        self.write_spool(out)?;
        for line in &self.self_test {
            writeln!(out, "self-test {line}")?;
        }
        for line in &self.alarms {
            writeln!(out, "ALARM     {line}")?;
        }
        if self.alarms.is_empty() {
            writeln!(out, "no alarms")?;
        }
        Ok(())
    }

    fn write_totals(&self, out: &mut String) -> std::fmt::Result {
        let totals = &self.totals;
        writeln!(
            out,
            "totals    {} frames, {} dropped, {} late, {} gaps, {} malformed, {} out of range, {} clock steps",
            totals.frames,
            totals.dropped,
            totals.late,
            totals.gaps,
            totals.malformed,
            totals.out_of_range,
            totals.clock_steps
        )?;
        writeln!(
            out,
            "largest   {:.1} km/h within 150 ms, {:.1} g in a frame",
            totals.largest_delta_v_kmh, totals.largest_peak_g
        )?;
        match &self.last_trigger {
            None => writeln!(out, "trigger   none since the start")?,
            Some(last) => writeln!(
                out,
                "trigger   {} at {} ({:.2}, threshold {:.2})",
                last.kind, last.utc, last.value, last.threshold
            )?,
        }
        Ok(())
    }

    fn write_spool(&self, out: &mut String) -> std::fmt::Result {
        let spool = &self.spool;
        if !spool.running {
            return writeln!(
                out,
                "spool     NOT RUNNING: a cut of the power loses the ring"
            );
        }
        writeln!(
            out,
            "spool     a cut may lose {:.0} ms, p99.9 in fact {} ms; flush each {:.0} ms, p99.9 {} ms, longest {:.1} ms{}",
            spool.loss_bound_ms,
            spool
                .loss_p999_ms
                .map_or_else(|| "-".to_owned(), |ms| format!("{ms:.1}")),
            spool.flush_ms,
            spool
                .flush_p999_ms
                .map_or_else(|| "-".to_owned(), |ms| format!("{ms:.1}")),
            spool.flush_longest_ms,
            if spool.within_bound {
                ""
            } else {
                "  BOUND NOT KEPT"
            }
        )?;
        writeln!(
            out,
            "wear      {:.2} GB a day, 8 GB of flash last {:.1} years in use all day",
            spool.bytes_a_day / 1e9,
            spool.flash_years_8gb
        )
    }
}

/// A time span in words.
fn span(seconds: f64) -> String {
    if seconds < 120.0 {
        format!("{seconds:.1} s")
    } else if seconds < 7200.0 {
        format!("{:.0} min", seconds / 60.0)
    } else {
        format!("{:.1} h", seconds / 3600.0)
    }
}
