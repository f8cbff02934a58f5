//! The satellite receiver in the daemon: its line, what it tells, what `recorder status` shows of it.

use std::fmt::Write as _;

use schema::gnss::FixQuality;
use schema::num;
use serde::{Deserialize, Serialize};

use super::{Daemon, say};
use crate::clock::monotonic_ns;
use crate::config::Settings;
use crate::error::RecorderError;
use crate::gnss::line::{Line, LineState, Told};
use crate::gnss::{GnssState, age_s};
use crate::nmea::Heard;
use crate::spool::Entry;

/// Without a word for so long the receiver is silent, ns; or for so many times the pause between its last two words.
const SILENT_NS: i64 = 5_000_000_000;
const SILENT_PAUSES: i64 = 3;
/// Longest pause between two words that is no silence, ns.
const LONGEST_PAUSE_NS: i64 = 120_000_000_000;
/// A device has so long to be opened, ns.
const OPENED_NS: i64 = 1_000_000_000;
/// Bytes that must hold a sentence, if the line's pace is right.
const ENOUGH_BYTES: u64 = 2000;
/// Things that the line told that are taken in one turn: while they are, no frame is read.
const MOST_A_TURN: usize = 64;

/// The daemon's ear: the line, where a device is configured, and when the receiver last said a word, be it that there is
/// no fix. Times are monotonic, ns.
#[derive(Debug)]
pub(super) struct Ear {
    line: Option<Line>,
    /// It listens since.
    since_ns: i64,
    words: u64,
    word_ns: Option<i64>,
    /// Between the last two words.
    pause_ns: i64,
    /// That it is silent was told.
    silent: bool,
}

impl Ear {
    /// Listens from now on; starts the thread of the line, where a device is configured.
    pub(super) fn start(settings: &Settings) -> Result<Self, RecorderError> {
        let device = settings.gnss.as_ref().and_then(|gnss| gnss.device());
        Ok(Self::of(device.map(Line::start).transpose()?))
    }

    fn of(line: Option<Line>) -> Self {
        Self {
            line,
            since_ns: monotonic_ns(),
            words: 0,
            word_ns: None,
            pause_ns: 0,
            silent: false,
        }
    }

    /// So many words were heard until now.
    fn look(&mut self, words: u64, now_ns: i64) {
        if words == self.words {
            return;
        }
        self.words = words;
        let before = self.word_ns.replace(now_ns);
        self.pause_ns = before.map_or(0, |before| (now_ns - before).min(LONGEST_PAUSE_NS));
    }

    /// It has said nothing for so long, ns, where that is too long.
    fn silent_ns(&self, now_ns: i64) -> Option<i64> {
        let silent_ns = now_ns - self.word_ns.unwrap_or(self.since_ns);
        let allowed_ns = (SILENT_PAUSES * self.pause_ns).max(SILENT_NS);
        (silent_ns > allowed_ns).then_some(silent_ns)
    }
}

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
}

impl Daemon {
    /// What the line told since the last turn. `now` is the time on the line of the frames, `clock` the same instant on
    /// the monotonic clock.
    pub(super) fn hear(&mut self, now: i64, clock: i64) {
        let offset_ns = now.saturating_sub(clock);
        for _ in 0..MOST_A_TURN {
            let Some(told) = self.ear.line.as_ref().and_then(Line::next) else {
                return;
            };
            match told {
                Told::Note { at_ns, text, loss } => {
                    if loss {
                        say::warn(text.as_str());
                    } else {
                        say::info(text.as_str());
                    }
                    self.remark(at_ns.saturating_add(offset_ns), text);
                }
                Told::Heard(heard) => {
                    let mut at = now;
                    if let Heard::Sentence { at_ns, text } = heard {
                        at = at_ns.saturating_add(offset_ns);
                        self.spool(&Entry::Sentence { at_ns: at, text });
                    }
                    self.pipeline.heard(at, &heard);
                }
            }
        }
    }

    /// Other settings: another device is another line, another table another receiver.
    pub(super) fn reload_line(&mut self, settings: &Settings) {
        if self.settings.gnss == settings.gnss {
            return;
        }
        let device = |settings: &Settings| {
            let gnss = settings.gnss.as_ref();
            gnss.and_then(|gnss| gnss.device().cloned())
        };
        let mut line = self.ear.line.take();
        let wanted = device(settings);
        if device(&self.settings) != wanted {
            line = wanted.and_then(|device| match Line::follow(&device, line.take()) {
                Ok(line) => Some(line),
                Err(error) => {
                    say::error(format!(
                        "the satellite receiver is not listened to: {error}"
                    ));
                    None
                }
            });
        }
        self.ear = Ear::of(line);
    }

    /// A receiver that falls silent, or speaks again, is told, in the record too. Where its device is gone that was told.
    pub(super) fn look_for_receiver(&mut self, now: i64) {
        let Some(state) = self.pipeline.gnss() else {
            return;
        };
        let clock = monotonic_ns();
        self.ear.look(words(&state), clock);
        let open = self.ear.line.as_ref().is_none_or(|line| line.state().open);
        let silent_ns = self.ear.silent_ns(clock).filter(|_| open);
        let silent = silent_ns.is_some() && self.ear.word_ns.is_some();
        if silent == self.ear.silent || (!open && !silent) {
            return;
        }
        self.ear.silent = silent;
        let word = if silent { "fell silent" } else { "is back" };
        let text = format!("the satellite receiver {word}");
        say::warn(text.as_str());
        self.remark(now.saturating_sub(silent_ns.unwrap_or(0)), text);
    }

    pub(super) fn gnss_status(&self) -> Option<GnssStatus> {
        let settings = self.settings.gnss.as_ref()?;
        let state = self.pipeline.gnss()?;
        let line = self.line_state();
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

    fn line_state(&self) -> LineState {
        self.ear.line.as_ref().map(Line::state).unwrap_or_default()
    }

    /// What of the receiver needs somebody's attention; nothing while it has hardly begun.
    pub(super) fn gnss_alarms(&self) -> Vec<String> {
        let (Some(gnss), Some(state)) = (&self.settings.gnss, self.pipeline.gnss()) else {
            return Vec::new();
        };
        let (device, line, clock) = (gnss.device(), self.line_state(), monotonic_ns());
        let began = clock - self.ear.since_ns < OPENED_NS && line.outages == 0;
        let [rmc, gga, .., gll, _] = state.counts.kinds;
        let mut alarms = Vec::new();
        if device.is_some() && !line.open {
            if !began {
                alarms.push("the satellite receiver's device can not be opened".to_owned());
            }
        } else if line.strange > ENOUGH_BYTES {
            alarms.push(format!(
                "the satellite receiver sent {} bytes and no sentence among them: is [gnss] baud right?",
                line.strange
            ));
        } else if let Some(silent_ns) = self.ear.silent_ns(clock) {
            alarms.push(match self.ear.word_ns {
                None => "the satellite receiver never said anything".to_owned(),
                Some(_) => format!(
                    "the satellite receiver has said nothing new for {:.0} s",
                    num::real_i64(silent_ns) / 1e9
                ),
            });
        } else if device.is_some() && rmc + gga + gll == 0 && clock - self.ear.since_ns > SILENT_NS
        {
            alarms.push(
                "the satellite receiver sends none of the sentences that tell of a fix: RMC, GGA, GLL"
                    .to_owned(),
            );
        }
        if line.lost > 0 {
            alarms.push(format!(
                "{} sentences of the satellite receiver found no room",
                line.lost
            ));
        }
        alarms
    }
}

/// What a receiver said since it began: fixes, that there is none, and sentences, of whatever kind.
fn words(state: &GnssState) -> u64 {
    state.fixes + state.no_fix + state.counts.sentences() + state.counts.unknown
}
