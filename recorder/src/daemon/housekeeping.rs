//! What the daemon does beside receiving, ten times a second: sensors that died, counts for the spool, self-tests,
//! the state for the socket, the watchdog.

use schema::num;
use schema::seal::Hex;
use schema::time::Stamp;
use schema::units::{MetersPerSecond, MetersPerSecondSquared};

use super::sealer::Told;
use super::self_test::Finding;
use super::status::{RingStatus, SignalStatus, SpoolStatus, Status, TotalsStatus};
use super::{Daemon, say};
use crate::clock::monotonic_ns;
use crate::event::{Facts, GROUP_NAMES};
use crate::recovery::source_number;
use crate::spool::{EVENT_FLUSH_NS, EVENT_LOSS_NS, Entry, wear};

/// A sensor is told to be silent after so long at the latest, ns; and not before it is surely no jitter.
const DEAD_NS: f64 = 800e6;
const ALIVE_NS: f64 = 200e6;
/// Time between two counts in the spool, ns.
const COUNTS_NS: i64 = 1_000_000_000;
/// The first self-test comes so long after the first sample, ns.
const FIRST_TEST_NS: i64 = 10_000_000_000;
/// Frames that wait longer for the disk than this, ns, mean that it hangs.
const LATE_NS: i64 = 1_000_000_000;
/// Flushes before p99.9 means anything.
const ENOUGH_FLUSHES: usize = 100;

/// UTC as ISO 8601 with milliseconds.
#[must_use]
pub(super) fn iso(utc_ns: i64) -> String {
    let stamp = Stamp::from_utc_ns(utc_ns);
    format!(
        "{:04}-{:02}-{:02}T{:02}:{:02}:{:02}.{:03}Z",
        stamp.year,
        stamp.month,
        stamp.day,
        stamp.hour,
        stamp.minute,
        stamp.second,
        utc_ns.rem_euclid(1_000_000_000) / 1_000_000
    )
}

fn ms(ns: i64) -> f64 {
    num::real_i64(ns) / 1e6
}

impl Daemon {
    pub(super) fn housekeeping(&mut self, now: i64) {
        let told: Vec<Told> = self.sealer.told().collect();
        for told in told {
            self.told(told);
        }
        self.begin_spool();
        self.look_for_silence(now);
        self.look_for_receiver(now);
        self.test(now);
        if now - self.counts_ns >= COUNTS_NS || now < self.counts_ns {
            self.counts_ns = now;
            self.count(now);
        }
        let status = self.status(now);
        self.shared.set(status);
        let clock = monotonic_ns();
        if let Some(period) = self.watchdog_ns
            && clock - self.watched_ns >= period / 3
        {
            self.watched_ns = clock;
            let _ = sd_notify::notify(&[sd_notify::NotifyState::Watchdog]);
        }
    }

    /// A sensor that falls silent, or comes back, is told within a second.
    fn look_for_silence(&mut self, now: i64) {
        let Some(line) = self.pipeline.line_ns() else {
            return;
        };
        let offset = line - self.pipeline.now_ns();
        let groups = self.pipeline.groups();
        let wanted = if self.settings.wheels.present { 4 } else { 2 };
        for (at, (name, group)) in GROUP_NAMES.iter().zip(groups).enumerate().take(wanted) {
            let Some(last_ns) = group.last_ns else {
                continue;
            };
            let limit = (3.0 * group.period + 6.0 * group.jitter).clamp(ALIVE_NS, DEAD_NS);
            let silent_ns = now - (last_ns + offset);
            let silent = num::real_i64(silent_ns) > limit;
            let Some(was) = self.silent.get_mut(at) else {
                continue;
            };
            if silent == *was {
                continue;
            }
            *was = silent;
            let text = if silent {
                format!("{name} fell silent")
            } else {
                format!("{name} is back")
            };
            say::warn(text.as_str());
            self.remark(if silent { last_ns + offset } else { now }, text);
        }
    }

    fn test(&mut self, now: i64) {
        let (held, _) = self.pipeline.fill();
        if held == 0 {
            return;
        }
        let Some(next) = self.tested_ns else {
            self.tested_ns = Some(now + FIRST_TEST_NS);
            return;
        };
        if now < next {
            return;
        }
        self.tested_ns = Some(now + self.settings.run.self_test_ns);
        let findings = self.self_test.borrow_mut().finish();
        let utc = iso(now.saturating_add(self.pipeline.shift_ns()));
        self.findings = findings.iter().map(Finding::text).collect();
        let fault = |finding: &&Finding| matches!(finding, Finding::Fault(_));
        self.faults = findings
            .iter()
            .filter(fault)
            .map(|finding| format!("self-test of {utc}: {}", finding.text()))
            .collect();
        for finding in &findings {
            if let Finding::Fault(_) = finding {
                say::warn(format!("self-test: {}", finding.text()));
            } else {
                say::info(format!("self-test: {}", finding.text()));
            }
        }
        for finding in &mut self.findings {
            *finding = format!("{utc} {finding}");
        }
    }

    /// The state of sockets and clock, for records and for the spool.
    fn count(&mut self, now: i64) {
        let clock = self.source.clock();
        let interfaces = self.source.interfaces();
        let dropped = interfaces.iter().map(|interface| interface.dropped).sum();
        let error_frames = interfaces
            .iter()
            .map(|interface| interface.error_frames)
            .sum();
        self.spool(&Entry::Counts {
            at_ns: now,
            bundle: self.bundle,
            clock: source_number(clock.source),
            uncertainty_ns: clock.uncertainty_ns,
            dropped,
            error_frames,
            utc_offset_ns: self.pipeline.shift_ns(),
        });
        if self.pipeline.running() {
            for entry in std::mem::take(&mut self.running) {
                self.spool(&entry);
                self.running.push(entry);
            }
        } else {
            self.running.clear();
        }
        let mut notes = if self.findings.is_empty() {
            vec!["no self-test was finished before this record".to_owned()]
        } else {
            self.findings
                .iter()
                .map(|finding| format!("self-test {finding}"))
                .collect()
        };
        if self.lost > 0 {
            notes.push(format!(
                "{} records before this one were lost for want of room",
                self.lost
            ));
        }
        let facts = Facts {
            clock,
            interfaces: self.source.header_interfaces(),
            dropped,
            error_frames,
            notes,
        };
        self.pipeline.set_facts(facts);
    }

    fn signals(&self, now: i64) -> Vec<SignalStatus> {
        let offset = self.pipeline.line_ns().unwrap_or(0) - self.pipeline.now_ns();
        let groups = self.pipeline.groups();
        let wanted = if self.settings.wheels.present { 4 } else { 2 };
        let signal = |(name, group): (&&str, crate::event::GroupState)| SignalStatus {
            signal: (*name).to_owned(),
            rate_hz: if group.period > 0.0 {
                1e9 / group.period
            } else {
                0.0
            },
            jitter_ms: group.jitter / 1e6,
            silent_s: group
                .last_ns
                .map(|last| num::real_i64((now - (last + offset)).max(0)) / 1e9),
        };
        GROUP_NAMES
            .iter()
            .zip(groups)
            .take(wanted)
            .map(signal)
            .collect()
    }

    fn look_at_spool(&self, now: i64) -> SpoolStatus {
        let settings = &self.settings.spool;
        let Some(syncer) = &self.syncer else {
            return SpoolStatus::default();
        };
        let state = syncer.state();
        let p999 = state.durations().quantile_ns(0.999);
        let lost = |alert: bool| {
            let ages = state.ages(alert);
            ages.quantile_ns(0.999)
                .filter(|_| ages.len() >= ENOUGH_FLUSHES)
        };
        // The interval and the flush, and what was in fact measured, with whatever held the daemon up.
        let keeps = |alert: bool, interval: i64, bound: i64| {
            state.durations().len() < ENOUGH_FLUSHES
                || (p999.is_none_or(|p999| interval + p999 <= bound)
                    && lost(alert).is_none_or(|lost| lost <= bound))
        };
        // A disk that hangs finishes no flush that could be measured.
        let waits_ns = self.journal.oldest_ns().map_or(0, |oldest| now - oldest);
        let late = waits_ns > settings.loss_ns.max(LATE_NS);
        let seconds = num::real_i64(monotonic_ns() - self.started_ns) / 1e9;
        let bytes_a_day = num::real_u64(state.bytes) / seconds.max(1.0) * 86_400.0;
        let flushes = state.flushes.max(1);
        let blocks = state
            .bytes
            .div_ceil(flushes)
            .div_ceil(num::u64_of(crate::spool::block::BLOCK_BYTES));
        let interval = num::round_i64(seconds.max(1.0) * 1e9 / num::real_u64(flushes));
        SpoolStatus {
            running: syncer.alive(),
            loss_bound_ms: ms(settings.loss_ns),
            flush_ms: ms(settings.flush_ns),
            flush_p999_ms: p999.map(ms),
            flush_longest_ms: ms(state.longest_ns),
            loss_p999_ms: lost(false).map(ms),
            within_bound: keeps(false, settings.flush_ns, settings.loss_ns) && !late,
            within_event_bound: keeps(true, settings.flush_ns.min(EVENT_FLUSH_NS), EVENT_LOSS_NS),
            behind_ms: (state.durable_ns > 0).then(|| ms(now - state.durable_ns)),
            flushes: state.flushes,
            bytes_a_day,
            flash_years_8gb: wear::wear(interval, blocks, 8_000_000_000, 24.0).years,
            errors: state.errors,
            lost_frames: self.journal.lost(),
        }
    }

    fn status(&mut self, now: i64) -> Status {
        let clock = monotonic_ns();
        if clock - self.spool_status.0 >= COUNTS_NS {
            self.spool_status = (clock, self.look_at_spool(now));
        }
        let totals = self.pipeline.totals();
        let (held, capacity) = self.pipeline.fill();
        let interfaces = self.source.interfaces().to_vec();
        let seconds = |samples: u64| num::real_u64(samples) / 100.0;
        let mut status = Status {
            software: concat!("svartboks recorder ", env!("CARGO_PKG_VERSION")).to_owned(),
            pid: std::process::id(),
            state: if self.pipeline.running() {
                "event"
            } else if held == 0 {
                "waiting"
            } else {
                "recording"
            }
            .to_owned(),
            device_id: self.settings.device_id.clone(),
            config_sha256: Hex(&self.settings.config_sha256).to_string(),
            utc: iso(now.saturating_add(self.pipeline.shift_ns())),
            uptime_s: num::real_i64(monotonic_ns() - self.started_ns) / 1e9,
            ring: RingStatus {
                held_s: seconds(held),
                seconds: seconds(capacity),
            },
            signals: self.signals(now),
            totals: TotalsStatus {
                frames: totals.frames,
                dropped: interfaces.iter().map(|interface| interface.dropped).sum(),
                error_frames: interfaces
                    .iter()
                    .map(|interface| interface.error_frames)
                    .sum(),
                late: totals.late,
                gaps: totals.gaps,
                clock_steps: totals.clock_steps,
                malformed: totals.decode.too_short,
                out_of_range: totals.decode.out_of_range,
                largest_delta_v_kmh: MetersPerSecond(totals.largest_delta_v).kmh(),
                largest_peak_g: MetersPerSecondSquared(totals.largest_peak).g(),
            },
            interfaces,
            last_trigger: self.last_trigger.clone(),
            records: self.records.clone(),
            spool: self.spool_status.1.clone(),
            self_test: self.findings.clone(),
            gnss: self.gnss_status(),
            alarms: Vec::new(),
        };
        status.alarms = self.alarms(&status);
        status
    }

    fn alarms(&self, status: &Status) -> Vec<String> {
        let mut alarms = Vec::new();
        for (signal, silent) in status.signals.iter().zip(self.silent) {
            match signal.silent_s {
                None => alarms.push(format!("{} never arrived", signal.signal)),
                Some(seconds) if silent => {
                    alarms.push(format!(
                        "{} has been silent for {seconds:.1} s",
                        signal.signal
                    ));
                }
                Some(_) => {}
            }
        }
        for interface in &status.interfaces {
            if !interface.up {
                alarms.push(format!("{} is down", interface.name));
            }
            if interface.dropped > 0 {
                alarms.push(format!(
                    "{}: {} frames were dropped by the kernel",
                    interface.name, interface.dropped
                ));
            }
        }
        let spool = &status.spool;
        if self.settings.spool.enabled && !spool.running && self.beginning.is_none() {
            alarms.push(format!(
                "the ring is in memory only: {}",
                self.spool_error
                    .as_deref()
                    .unwrap_or("the spool is not written")
            ));
        }
        if spool.running && !spool.within_bound {
            alarms.push(format!(
                "a cut may lose more than {:.0} ms: flush interval {:.0} ms, p99.9 of the flush {:.1} ms, of the oldest \
                 frame that was not durable {:.1} ms",
                spool.loss_bound_ms,
                spool.flush_ms,
                spool.flush_p999_ms.unwrap_or(0.0),
                spool.loss_p999_ms.unwrap_or(0.0)
            ));
        }
        if spool.running && !spool.within_event_bound {
            alarms.push(format!(
                "after a trigger a cut may lose more than 50 ms: p99.9 of the flush is {:.1} ms",
                spool.flush_p999_ms.unwrap_or(0.0)
            ));
        }
        if spool.errors > 0 {
            alarms.push(format!("{} flushes of the spool failed", spool.errors));
        }
        if spool.lost_frames > 0 {
            alarms.push(format!(
                "{} frames are not in the spool: the disk was too slow",
                spool.lost_frames
            ));
        }
        alarms.extend(self.gnss_alarms());
        alarms.extend(self.waiting.clone());
        if self.lost > 0 {
            alarms.push(format!(
                "{} records are lost: no room on the disk",
                self.lost
            ));
        }
        alarms.extend(self.faults.iter().cloned());
        if self.reload {
            alarms.push("the configuration is read again when the event is over".to_owned());
        }
        alarms
    }
}
