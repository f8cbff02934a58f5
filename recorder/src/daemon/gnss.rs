//! The satellite receiver in the daemon: its line, what it tells, what `recorder status` shows of it.

use std::fmt::Write as _;

use schema::gnss::FixQuality;
use schema::num;
use serde::{Deserialize, Serialize};

use super::{Daemon, say};
use crate::clock::monotonic_ns;
use crate::config::Settings;
use crate::error::RecorderError;
use crate::gnss::age_s;
use crate::gnss::line::{Line, LineState, Told};
use crate::nmea::{Heard, Kind};
use crate::spool::Entry;

/// Without a fix or a word of none for so long the receiver is silent, s.
const SILENT_S: f64 = 5.0;
/// Bytes that must hold a sentence, if the line's pace is right.
const ENOUGH_BYTES: u64 = 2000;

/// The satellite receiver. No position is told here.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GnssStatus {
    /// Device or signals.
    pub receiver: String,
    /// The serial device is open; `None` where fixes come over CAN.
    pub open: Option<bool>,
    /// Since the last fix with a position, s; `None`: none yet.
    pub last_fix_s: Option<f64>,
    /// Quality of the newest epoch.
    pub quality: Option<String>,
    /// Satellites of the newest epoch.
    pub satellites: Option<u8>,
    /// Fixes with a position.
    pub fixes: u64,
    /// Epochs without a fix.
    pub no_fix: u64,
    /// Sentences understood.
    pub sentences: u64,
    /// With a wrong checksum.
    pub bad_checksum: u64,
    /// Malformed.
    pub malformed: u64,
    /// Of other kinds.
    pub unknown: u64,
    /// That found no room.
    pub lost: u64,
    /// Times the device went away.
    pub outages: u64,
    /// Bytes received.
    pub bytes: u64,
}

/// A quality in words.
#[must_use]
pub fn quality_word(quality: FixQuality) -> &'static str {
    match quality {
        FixQuality::None => "no fix",
        FixQuality::Autonomous => "autonomous",
        FixQuality::Differential => "differential",
        FixQuality::Precise => "precise",
        FixQuality::RtkFixed => "RTK fixed",
        FixQuality::RtkFloat => "RTK float",
        FixQuality::Estimated => "dead reckoning",
        FixQuality::Manual => "by hand",
        FixQuality::Simulated => "simulated",
        FixQuality::Unstated => "a fix",
    }
}

impl GnssStatus {
    pub(super) fn write_line(&self, out: &mut String) -> std::fmt::Result {
        let age = match self.last_fix_s {
            None => "never a fix".to_owned(),
            Some(age) => format!("last fix {age:.1} s ago"),
        };
        let satellites = match self.satellites {
            None => String::new(),
            Some(count) => format!(", {count} satellites"),
        };
        let device = match self.open {
            Some(true) => " on an open line",
            Some(false) => " (NOT OPEN)",
            None => "",
        };
        writeln!(
            out,
            "gnss      {age}, now {}{satellites}{device}; {} fixes, {} without a fix",
            self.quality.as_deref().unwrap_or("unknown"),
            self.fixes,
            self.no_fix
        )?;
        if self.open.is_some() {
            writeln!(
                out,
                "sentences {} read, {} with a wrong checksum, {} malformed, {} of other kinds, {} lost, {} outages",
                self.sentences,
                self.bad_checksum,
                self.malformed,
                self.unknown,
                self.lost,
                self.outages
            )?;
        }
        Ok(())
    }

    /// What needs somebody's attention; nothing in the first seconds.
    pub(super) fn alarms(&self, uptime_s: f64) -> Vec<String> {
        let mut alarms = Vec::new();
        if self.open == Some(false) {
            alarms.push("the satellite receiver's device can not be opened".to_owned());
        } else if self.open == Some(true) && self.sentences == 0 && self.bytes > ENOUGH_BYTES {
            alarms.push(format!(
                "the satellite receiver sent {} bytes and no sentence among them: is [gnss] baud right?",
                self.bytes
            ));
        } else if self.fixes + self.no_fix == 0 && uptime_s > SILENT_S {
            alarms.push("the satellite receiver never said anything".to_owned());
        }
        if self.lost > 0 {
            alarms.push(format!(
                "{} sentences of the satellite receiver found no room",
                self.lost
            ));
        }
        alarms
    }
}

/// Starts the thread of the line, where a device is configured.
pub(super) fn start(settings: &Settings) -> Result<Option<Line>, RecorderError> {
    let device = settings.gnss.as_ref().and_then(|gnss| gnss.device());
    device.map(Line::start).transpose()
}

impl Daemon {
    /// What the line told since the last turn. `now` is the time on the line of the frames.
    pub(super) fn hear(&mut self, now: i64) {
        let Some(line) = self.gnss.take() else { return };
        let offset_ns = now.saturating_sub(monotonic_ns());
        while let Some(told) = line.next() {
            match told {
                Told::Note { at_ns, text } => {
                    say::info(text.as_str());
                    self.remark(at_ns.saturating_add(offset_ns), text);
                }
                Told::Heard(heard) => {
                    let mut at = now;
                    if let Heard::Sentence { at_ns, text } = heard {
                        at = at_ns.saturating_add(offset_ns);
                        if Kind::of(&text).is_some() {
                            self.spool(&Entry::Sentence { at_ns: at, text });
                        }
                    }
                    self.pipeline.heard(at, &heard);
                }
            }
        }
        self.gnss = Some(line);
    }

    /// Other settings: another device is another line.
    pub(super) fn reload_line(&mut self, settings: &Settings) {
        let device = |settings: &Settings| {
            let gnss = settings.gnss.as_ref();
            gnss.and_then(|gnss| gnss.device().cloned())
        };
        if device(&self.settings) == device(settings) {
            return;
        }
        // The old thread must be gone before the device is opened again.
        self.gnss = None;
        match start(settings) {
            Ok(line) => self.gnss = line,
            Err(error) => say::error(format!(
                "the satellite receiver is not listened to: {error}"
            )),
        }
    }

    pub(super) fn gnss_status(&self) -> Option<GnssStatus> {
        let settings = self.settings.gnss.as_ref()?;
        let state = self.pipeline.gnss()?;
        let line = match &self.gnss {
            Some(line) => line.state(),
            None => LineState::default(),
        };
        Some(GnssStatus {
            receiver: settings.sheet.receiver.clone(),
            open: settings.device().map(|_| line.open),
            last_fix_s: age_s(&state, self.pipeline.now_ns()),
            quality: state
                .quality
                .map(|quality| quality_word(quality).to_owned()),
            satellites: state.satellites,
            fixes: state.fixes,
            no_fix: state.no_fix,
            sentences: state.counts.sentences(),
            bad_checksum: state.counts.bad_checksum,
            malformed: state.counts.malformed,
            unknown: state.counts.unknown,
            lost: line.lost,
            outages: line.outages,
            bytes: line.bytes,
        })
    }

    pub(super) fn gnss_alarms(&self, status: Option<&GnssStatus>) -> Vec<String> {
        let uptime_s = num::real_i64(monotonic_ns() - self.started_ns) / 1e9;
        status.map_or_else(Vec::new, |status| status.alarms(uptime_s))
    }
}
