//! Satellite fixes, where the configuration asks for them (`[gnss]`): from signals of a CAN bus ([`can`]) or from NMEA
//! 0183 on a serial line ([`mod@line`], [`crate::nmea`]).
//!
//! A [`Receiver`] is a part of the pipeline and reads no clock; what it makes goes onto the ring's [`GnssTape`] and from
//! there into the record. Frames of mapped messages, and all sentences, are in the spool, so fixes are made again from
//! them after a cut.

pub mod can;
pub mod line;
pub mod log;
mod tally;
mod tape;

use schema::gnss::{Fix, FixQuality};
use schema::num;

use crate::config::{Device, Gnss, GnssInput};
use crate::nmea::{Counts, Epochs, Heard, Kind, Reading, Text, read};
use can::{Assembler, Field};
pub use tally::Arrivals;
use tally::Tally;
pub use tape::GnssTape;
use tape::seconds;

/// Nanoseconds of 1,024 weeks, after which the week number that GPS sends begins again.
const ROLL_OVER_NS: i64 = 1024 * 7 * DAY_NS;
const DAY_NS: i64 = 86_400_000_000_000;
/// The receiver's UTC and the recorder's differ by more than latency makes, ns.
const APART_NS: i64 = 2_000_000_000;

/// Bytes of the end of a line, which stand in no sentence.
const LINE_END: usize = 2;

/// What makes fixes.
#[derive(Clone, Debug)]
enum Maker {
    Can(Box<Assembler>),
    Nmea(Box<Epochs>),
}

/// The state of a receiver since the start.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GnssState {
    /// Fixes with a position.
    pub fixes: u64,
    /// Epochs of which the receiver says that they are no fix.
    pub no_fix: u64,
    /// Receive time of the last fix with a position, monotonic ns.
    pub last_fix_ns: Option<i64>,
    /// Quality of the last epoch.
    pub quality: Option<FixQuality>,
    /// Satellites of the last epoch.
    pub satellites: Option<u8>,
    /// What was counted of sentences; zero where the source is CAN.
    pub counts: Counts,
    /// Each mapped signal, or each kind of sentence.
    pub arrivals: Vec<Arrivals>,
    /// What it said was not given to this replay.
    pub silent: bool,
}

/// What the receiver's UTC is worth beside the recorder's.
#[derive(Clone, Copy, Debug, Default)]
struct Clocks {
    /// Fixes dated a multiple of 1,024 weeks back.
    rolled_over: u64,
    /// Of these, how many times 1,024 weeks.
    turns: i64,
    /// Largest difference otherwise, ns.
    apart_ns: i64,
}

/// The receiver, as the pipeline knows it. Times are monotonic, ns.
#[derive(Clone, Debug)]
pub struct Receiver {
    maker: Maker,
    mapped: Vec<Field>,
    counts: Counts,
    /// How often each kind of sentence comes.
    tallies: [Tally; Kind::ALL.len()],
    fixes: u64,
    no_fix: u64,
    /// Fixes that repeat the one before.
    repeated: u64,
    /// UTC as stated and position of the newest fix.
    newest: Option<(i64, [f64; 2])>,
    last_fix_ns: Option<i64>,
    last: Option<(FixQuality, Option<u8>)>,
    clocks: Clocks,
    /// Nothing was given of it to this replay.
    silent: bool,
    newest_ns: i64,
    offset_ns: i64,
    /// What a byte takes on the line, ns; 0 where the source is CAN.
    byte_ns: i64,
}

impl Receiver {
    /// As configured.
    #[must_use]
    pub fn new(settings: &Gnss) -> Self {
        let (maker, mapped) = match &settings.input {
            GnssInput::Device(_) => (Maker::Nmea(Box::default()), Vec::new()),
            GnssInput::Signals(signals) => (
                Maker::Can(Box::new(Assembler::new(signals.rules))),
                signals.fields.clone(),
            ),
        };
        Self {
            maker,
            mapped,
            counts: Counts::default(),
            tallies: [Tally::default(); Kind::ALL.len()],
            fixes: 0,
            no_fix: 0,
            repeated: 0,
            newest: None,
            last_fix_ns: None,
            last: None,
            clocks: Clocks::default(),
            silent: false,
            newest_ns: i64::MIN,
            offset_ns: 0,
            byte_ns: settings.device().map_or(0, Device::byte_ns),
        }
    }

    /// Nothing of it will come: what it said was not given to this replay.
    pub fn keep_silent(&mut self) {
        self.silent = true;
    }

    /// UTC minus monotonic time by the recorder's clock, ns.
    pub fn set_clock(&mut self, offset_ns: i64) {
        self.offset_ns = offset_ns;
        match &mut self.maker {
            Maker::Can(can) => can.clock_offset_ns = offset_ns,
            Maker::Nmea(nmea) => nmea.clock_offset_ns = offset_ns,
        }
    }

    /// A value of a mapped signal.
    pub fn signal(&mut self, at_ns: i64, field: Field, value: f64) {
        if let Maker::Can(can) = &mut self.maker {
            can.take(at_ns, field, value);
        }
    }

    /// The frame of these signals is over; gives the fix that this ends.
    pub fn frame(&mut self) -> Option<Fix> {
        let Maker::Can(can) = &mut self.maker else {
            return None;
        };
        let fix = can.frame()?;
        self.given(fix)
    }

    /// What came over the line, counted.
    pub fn count(&mut self, heard: &Heard) {
        match heard {
            Heard::BadChecksum => self.counts.bad_checksum += 1,
            Heard::Malformed => self.counts.malformed += 1,
            Heard::Sentence { .. } => {}
        }
    }

    /// A sentence whose first byte came at this time on the line; or that can not be placed among the frames (no `at_ns`)
    /// and is only counted. Gives the time to keep it under, where it is of an interpreted kind, and the fix that it ends.
    pub fn sentence(
        &mut self,
        line_ns: i64,
        at_ns: Option<i64>,
        text: &Text,
    ) -> (Option<i64>, Option<Fix>) {
        let Maker::Nmea(epochs) = &mut self.maker else {
            return (None, None);
        };
        // Sentences come in order over a line.
        let at_ns = at_ns.map(|at_ns| at_ns.max(self.newest_ns));
        let bytes = i64::try_from(text.as_bytes().len() + LINE_END).unwrap_or(0);
        let taken_ns = bytes * self.byte_ns;
        let times = at_ns.map(|at_ns| (at_ns, at_ns.saturating_add(taken_ns)));
        self.newest_ns = at_ns.unwrap_or(self.newest_ns);
        let (talker, message) = match read(text) {
            Reading::Unknown => {
                self.counts.unknown += 1;
                let fix = times.and_then(|times| epochs.pass(times));
                return (None, fix.and_then(|fix| self.given(fix)));
            }
            Reading::Malformed => {
                self.counts.malformed += 1;
                let fix = times.and_then(|times| epochs.pass(times));
                return (at_ns, fix.and_then(|fix| self.given(fix)));
            }
            Reading::Message(talker, message) => (talker, message),
        };
        let number = message.kind().number();
        if let Some(count) = self.counts.kinds.get_mut(number) {
            *count += 1;
        }
        if let Some(tally) = self.tallies.get_mut(number) {
            tally.arrive(line_ns);
        }
        let fix = times.and_then(|times| epochs.take(times, talker, &message));
        (at_ns, fix.and_then(|fix| self.given(fix)))
    }

    /// Time has come to here; gives a fix that is over by that.
    pub fn advance(&mut self, now_ns: i64) -> Option<Fix> {
        let fix = match &mut self.maker {
            Maker::Can(can) => can.advance(now_ns),
            Maker::Nmea(nmea) => nmea.advance(now_ns),
        }?;
        self.given(fix)
    }

    /// The fix that still grows, as it stands.
    #[must_use]
    pub fn preview(&self) -> Option<Fix> {
        let fix = match &self.maker {
            Maker::Can(can) => can.preview(),
            Maker::Nmea(nmea) => nmea.preview(),
        }?;
        (!self.repeats(&fix)).then(|| self.judged(fix, &mut Clocks::default()))
    }

    /// A gateway may send a fix again and again until the next one, and a receiver that has lost its satellites too: with
    /// the same UTC, and the same place. A car that drives on under the same UTC has a clock that shows seconds.
    fn repeats(&self, fix: &Fix) -> bool {
        let newest = fix.utc_ns.zip(fix.position);
        newest.is_some() && newest == self.newest
    }

    fn given(&mut self, fix: Fix) -> Option<Fix> {
        if self.repeats(&fix) {
            self.repeated += 1;
            return None;
        }
        self.newest = fix.utc_ns.zip(fix.position);
        let mut clocks = self.clocks;
        let fix = self.judged(fix, &mut clocks);
        self.clocks = clocks;
        if fix.position.is_some() {
            self.fixes += 1;
            self.last_fix_ns = Some(fix.monotonic_ns);
        } else {
            self.no_fix += 1;
        }
        self.last = Some((fix.quality, fix.satellites));
        Some(fix)
    }

    /// A UTC that can not be is none. One of 1,024 weeks ago is a known fault of old receivers; that of an epoch without
    /// a fix may be anything. Else either clock may be wrong: it stays as stated, and the difference is told.
    fn judged(&self, mut fix: Fix, clocks: &mut Clocks) -> Fix {
        let Some(utc_ns) = fix.utc_ns else { return fix };
        let expected = fix.monotonic_ns.saturating_add(self.offset_ns);
        let apart = utc_ns.saturating_sub(expected);
        let turns = apart
            .saturating_add(ROLL_OVER_NS / 2)
            .div_euclid(ROLL_OVER_NS);
        let left = apart.saturating_sub(turns.saturating_mul(ROLL_OVER_NS));
        if fix.position.is_none() {
            fix.utc_ns = fix.utc_ns.filter(|_| apart.saturating_abs() < DAY_NS);
        } else if turns < 0 && left.saturating_abs() < DAY_NS {
            clocks.rolled_over += 1;
            clocks.turns = -turns;
            fix.utc_ns = None;
        } else if apart.saturating_abs() > clocks.apart_ns.saturating_abs() {
            clocks.apart_ns = apart;
        }
        fix
    }

    /// Its state.
    #[must_use]
    pub fn state(&self) -> GnssState {
        let mut counts = self.counts;
        let arrivals = match &self.maker {
            Maker::Can(can) => {
                let of = |field: &Field| can.arrivals(*field);
                self.mapped.iter().map(of).collect()
            }
            Maker::Nmea(epochs) => {
                counts.late = epochs.late();
                let kinds = Kind::ALL.iter().zip(&self.tallies);
                kinds
                    .map(|(kind, tally)| tally.arrivals(kind.word()))
                    .collect()
            }
        };
        GnssState {
            fixes: self.fixes,
            no_fix: self.no_fix,
            last_fix_ns: self.last_fix_ns,
            quality: self.last.map(|(quality, _)| quality),
            satellites: self.last.and_then(|(_, satellites)| satellites),
            counts,
            arrivals,
            silent: self.silent,
        }
    }

    /// What a reader of the record must hear, in sentences.
    #[must_use]
    pub fn notes(&self) -> Vec<String> {
        if self.silent {
            return vec![
                "the configured satellite receiver was not replayed: no log of its sentences was given (--nmea)".to_owned(),
            ];
        }
        let made = format!(
            "{} fixes with a position and {} epochs without a fix since the start",
            self.fixes, self.no_fix
        );
        let mut notes = Vec::new();
        match &self.maker {
            Maker::Can(can) => {
                notes.push(format!("satellite receiver: {made}"));
                if can.halved > 0 {
                    notes.push(format!(
                        "satellite receiver: {} latitudes or longitudes came without the other within the time that one \
                         epoch takes, and are in no fix",
                        can.halved
                    ));
                }
                if can.absurd > 0 {
                    notes.push(format!(
                        "satellite receiver: {} values are marked as none or can not be, such as a latitude beyond the pole, \
                         and are missing",
                        can.absurd
                    ));
                }
                let stated = [Field::Valid, Field::Quality];
                if !stated.iter().any(|field| self.mapped.contains(field)) {
                    notes.push(
                        "satellite receiver: neither valid nor quality is configured, so nothing says whether a position \
                         is a fix"
                            .to_owned(),
                    );
                }
            }
            Maker::Nmea(epochs) => {
                let counts = &self.counts;
                notes.push(format!(
                    "satellite receiver: {made}; {} sentences, {} with a wrong checksum, {} malformed, {} of other kinds, {} \
                     too late for their epoch",
                    counts.sentences(),
                    counts.bad_checksum,
                    counts.malformed,
                    counts.unknown,
                    epochs.late()
                ));
            }
        }
        if self.repeated > 0 {
            notes.push(format!(
                "satellite receiver: {} fixes repeat UTC and place of the one before, and are left out",
                self.repeated
            ));
        }
        notes.extend(self.clock_notes());
        notes
    }

    fn clock_notes(&self) -> Option<String> {
        let clocks = &self.clocks;
        if clocks.rolled_over > 0 {
            return Some(format!(
                "satellite receiver: {} fixes are dated {} weeks before the recorder's clock, as receivers do whose week \
                 number has begun again; their UTC is not believed and left out",
                clocks.rolled_over,
                clocks.turns * 1024
            ));
        }
        let apart = clocks.apart_ns;
        (apart.saturating_abs() > APART_NS).then(|| {
            format!(
                "satellite receiver: its UTC and the recorder's clock differ by up to {:+.1} s; which of both is wrong can \
                 not be told",
                seconds(apart)
            )
        })
    }
}

/// The newest fix is so old, s; `None` before the first.
#[must_use]
pub fn age_s(state: &GnssState, now_ns: i64) -> Option<f64> {
    let age = |last: i64| num::real_i64(now_ns.saturating_sub(last).max(0)) / 1e9;
    state.last_fix_ns.map(age)
}
