//! The daemon: `recorder run`. One thread receives, decides and fills the spool's buffer; others synchronise the
//! spool ([`crate::spool::Syncer`]), seal records ([`sealer`]) and answer on the socket ([`control`]).
//!
//! In a turn of the loop: read what frames there are, hand them to the spool's journal and to the pipeline; tell the
//! spool of triggers; hand sealed events to the sealer; flush if it is time. The rest, ten times a second.

pub mod control;
pub mod gnss;
mod housekeeping;
mod keeper;
pub mod paced;
mod say;
pub mod sealer;
pub mod self_test;
mod start;
pub mod status;
mod storing;

pub use start::{Options, run};

use std::cell::RefCell;
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::mpsc::Receiver;
use std::thread::JoinHandle;
use std::time::Duration;

use schema::Record;
use schema::parts::TriggerKind;

use self::control::{Answer, Command, Control, Shared};
use self::sealer::{Sealer, Told};
use self::self_test::SelfTest;
use self::status::TriggerStatus;
use crate::clock::monotonic_ns;
use crate::config::Settings;
use crate::error::RecorderError;
use crate::live::{LiveSource, Note};
use crate::pipeline::Pipeline;
use crate::spool::{EVENT_FLUSH_NS, Entry, Journal, Moment, Syncer};

/// Longest wait for frames, ns.
const WAIT_NS: i64 = 20_000_000;
/// Time between two looks at everything but frames, ns.
const HOUSE_NS: i64 = 100_000_000;
/// Triggers that are written again at most.
const MOST_REPEATED: usize = 64;

/// What has become of the signals from outside.
#[derive(Clone, Debug, Default)]
pub struct Signals {
    /// SIGTERM or SIGINT.
    pub stop: Arc<std::sync::atomic::AtomicBool>,
    /// SIGHUP.
    pub reload: Arc<std::sync::atomic::AtomicBool>,
}

/// The running daemon.
struct Daemon {
    config: PathBuf,
    settings: Arc<Settings>,
    bundle: [u8; 32],
    pipeline: Pipeline<'static>,
    source: Box<dyn LiveSource>,
    /// Of the satellite receiver.
    ear: gnss::Ear,
    journal: Journal,
    syncer: Option<Syncer>,
    spool_error: Option<String>,
    /// Begins the spool; tried again while it can not be.
    begin: start::Begin,
    beginning: Option<JoinHandle<Result<Syncer, RecorderError>>>,
    begun_ns: i64,
    /// Events of an earlier run wait for the disk, and the spool has their only durable copy.
    blocked: bool,
    sealer: Sealer,
    self_test: Rc<RefCell<SelfTest>>,
    findings: Vec<String>,
    faults: Vec<String>,
    tested_ns: Option<i64>,
    _control: Control,
    shared: Arc<Shared>,
    commands: Receiver<Command>,
    signals: Signals,
    started_ns: i64,
    flushed_ns: i64,
    house_ns: i64,
    counts_ns: i64,
    /// The spool's state, looked at once a second, and when.
    spool_status: (i64, status::SpoolStatus),
    watchdog_ns: Option<i64>,
    watched_ns: i64,
    urgent: bool,
    silent: [bool; 4],
    reload: bool,
    /// Triggers of events that run, written again each second.
    running: Vec<Entry>,
    last_trigger: Option<TriggerStatus>,
    records: status::RecordsStatus,
    waiting: Option<String>,
    lost: u64,
}

impl Daemon {
    /// Receives until it is told to stop, or the source has ended.
    fn run(&mut self) -> Result<(), RecorderError> {
        use std::sync::atomic::Ordering::Relaxed;
        while !self.signals.stop.load(Relaxed) && self.source.open() {
            self.turn()?;
            if self.signals.reload.swap(false, Relaxed) {
                self.reload = true;
            }
            if self.reload && !self.pipeline.running() {
                self.reload = false;
                self.reload();
            }
        }
        Ok(())
    }

    fn turn(&mut self) -> Result<(), RecorderError> {
        let interval = self.flush_interval();
        let wait = (self.flushed_ns + interval - monotonic_ns()).clamp(1_000_000, WAIT_NS);
        let wait = Duration::from_nanos(wait.unsigned_abs());
        let (settings, journal, pipeline) = (&self.settings, &mut self.journal, &mut self.pipeline);
        let spooled = self.syncer.is_some();
        self.source.read(wait, &mut |frame| {
            let mapped =
                frame.carries_data() && settings.plan.find(frame.interface, frame.id).is_some();
            if mapped && spooled {
                journal.frame(frame);
            }
            pipeline.frame(frame);
        })?;
        // Before notes: a trigger belongs to the UTC that was in force when it fired.
        self.triggers();
        let now = self.source.now_ns();
        let clock = monotonic_ns();
        while let Some(note) = self.source.next_note() {
            self.note(note);
        }
        self.hear(now, clock);
        self.pipeline.tick(now);
        self.listen(now);
        self.triggers();
        while let Some(record) = self.pipeline.take_ready() {
            self.seal(record);
        }
        self.flush(now);
        let clock = monotonic_ns();
        if clock - self.house_ns >= HOUSE_NS {
            self.house_ns = clock;
            self.housekeeping(now);
        }
        Ok(())
    }

    fn flush_interval(&self) -> i64 {
        if self.pipeline.alert() {
            self.settings.spool.flush_ns.min(EVENT_FLUSH_NS)
        } else {
            self.settings.spool.flush_ns
        }
    }

    /// Hands the journal to the spool's thread if it is time.
    fn flush(&mut self, now: i64) {
        let clock = monotonic_ns();
        let due = clock - self.flushed_ns >= self.flush_interval() || self.urgent;
        if !due {
            return;
        }
        if self.syncer.is_none() || self.journal.is_empty() {
            self.flushed_ns = clock;
            return;
        }
        if !self.syncer.as_mut().is_some_and(Syncer::ready) {
            return;
        }
        if self.pipeline.line_ns().is_some() {
            let at_ns = self.pipeline.undecided_ns();
            self.spool(&Entry::Closed { at_ns });
        }
        let moment = self.moment(now, clock);
        let Some(syncer) = &mut self.syncer else {
            return;
        };
        if syncer.flush(&mut self.journal, moment) {
            self.flushed_ns = clock;
            self.urgent = false;
        }
    }

    fn moment(&self, now_ns: i64, clock_ns: i64) -> Moment {
        Moment {
            upto_ns: self.pipeline.line_ns().unwrap_or(now_ns).min(now_ns),
            now_ns,
            clock_ns,
            alert: self.pipeline.alert(),
        }
    }

    fn spool(&mut self, entry: &Entry) {
        if self.syncer.is_some() {
            self.journal.entry(entry);
        }
    }

    /// What the source tells beside frames.
    fn note(&mut self, note: Note) {
        match note {
            Note::ClockStep { at_ns, step_ns } => {
                say::warn(format!("the system clock was set by {step_ns} ns"));
                self.pipeline.clock_step(at_ns, step_ns);
                self.spool(&Entry::ClockStep { at_ns, step_ns });
            }
            Note::Text { at_ns, text } => {
                say::warn(text.as_str());
                self.remark(at_ns, text);
            }
        }
    }

    fn remark(&mut self, at_ns: i64, text: String) {
        self.pipeline.remark(at_ns, &text);
        self.spool(&Entry::Note { at_ns, text });
    }

    /// Triggers that fired go into the spool, and out at once.
    fn triggers(&mut self) {
        let shift = self.pipeline.shift_ns();
        let (journal, last, urgent) = (&mut self.journal, &mut self.last_trigger, &mut self.urgent);
        let running = &mut self.running;
        let spooled = self.syncer.is_some();
        self.pipeline.take_fired(|fired| {
            let entry = Entry::Trigger {
                fired,
                utc_offset_ns: shift,
            };
            if spooled {
                journal.entry(&entry);
            }
            if running.len() < MOST_REPEATED {
                running.push(entry);
            }
            *urgent = true;
            let utc = housekeeping::iso(fired.monotonic_ns.saturating_add(shift));
            let kind = status::kind_word(fired.kind);
            let (value, threshold) = (fired.value, fired.threshold);
            say::warn(format!(
                "{kind} trigger at {utc}: {value:.3}, threshold {threshold:.3}"
            ));
            *last = Some(TriggerStatus {
                kind: kind.to_owned(),
                utc,
                value: fired.value,
                threshold: fired.threshold,
            });
        });
    }

    fn seal(&mut self, record: Record) {
        let line_ns = self.pipeline.trigger_line_ns(&record);
        let span_ns = |record: &Record| {
            let first = record.triggers.first().map(|first| first.monotonic_ns);
            let last = record.triggers.last().map(|last| last.monotonic_ns);
            first.zip(last).map_or(0, |(first, last)| last - first)
        };
        let kinds: Vec<&str> = record
            .triggers
            .iter()
            .map(|trigger| status::kind_word(trigger.kind))
            .collect();
        let whole = if record.completion.complete {
            "complete"
        } else {
            "incomplete"
        };
        let text = format!("an event is over ({}), {whole}", kinds.join(", "));
        let span = (line_ns, line_ns.saturating_add(span_ns(&record)));
        if let Err(reason) = self.sealer.seal(record, span) {
            self.told(Told::Lost { reason });
        }
        say::info(text);
    }

    /// Commands from the socket.
    fn listen(&mut self, now: i64) {
        while let Ok(Command::Trigger(answer)) = self.commands.try_recv() {
            let done = self.pipeline.trigger_at(now);
            let message = if done {
                format!(
                    "a {} trigger at {}",
                    status::kind_word(TriggerKind::Manual),
                    housekeeping::iso(now.saturating_add(self.pipeline.shift_ns()))
                )
            } else {
                "no frame was received yet, so there is nothing to record".to_owned()
            };
            let _ = answer.try_send(Answer { ok: done, message });
        }
    }

    /// SIGHUP: the configuration is read again. The ring stays; where it can not be used the old one stays too.
    fn reload(&mut self) {
        let now = self.source.now_ns();
        match start::reload(&self.config, &self.settings, self.source.as_mut()) {
            Err(error) => {
                say::error(format!("the configuration is not taken over: {error}"));
                self.remark(
                    now,
                    format!(
                        "the configuration was to be read again and could not be used: {error}"
                    ),
                );
            }
            Ok(reloaded) => {
                if reloaded.needs_restart {
                    say::warn(
                        "[store], [spool], [run] and the key are taken over at the next start",
                    );
                }
                let settings = Arc::new(reloaded.settings);
                self.bundle = reloaded.digest;
                self.pipeline.reconfigure(Arc::clone(&settings), now);
                // What the last samples under the old settings decided is told before the new ones.
                self.triggers();
                self.spool(&Entry::Session {
                    at_ns: now,
                    bundle: self.bundle,
                    utc_offset_ns: self.pipeline.shift_ns(),
                });
                self.urgent = true;
                *self.self_test.borrow_mut() = SelfTest::new(&settings);
                self.reload_line(&settings);
                self.settings = settings;
                say::info("the configuration was read again");
            }
        }
    }

    /// The end: what runs is sealed as far as it goes, and the spool says that this was on purpose.
    fn finish(&mut self) {
        let now = self.source.now_ns();
        self.pipeline.cut("the recorder was stopped");
        self.triggers();
        while let Some(record) = self.pipeline.take_ready() {
            self.seal(record);
        }
        let told: Vec<Told> = self.sealer.finish();
        for told in told {
            self.told(told);
        }
        // A record that could not be stored is still in the spool: it must not look ended.
        if self.records.waiting == 0 {
            self.spool(&Entry::End { at_ns: now });
        }
        let moment = self.moment(now, monotonic_ns());
        if let Some(syncer) = &mut self.syncer {
            syncer.drain();
            syncer.flush(&mut self.journal, moment);
            syncer.drain();
        }
    }
}
