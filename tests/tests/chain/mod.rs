//! One simulated crash through the whole chain, and its score against the truth.

use reconstruct::epochs::Epochs;
use reconstruct::findings::Reconstruction;
use reconstruct::run::{Facts, Options, from_epochs, reconstruct};
use reconstruct::simulate::{Class, Scenario, Simulated, simulate};
use recorder::config::Settings;
use recorder::replay::{LogInput, ReplayOptions, replay};
use schema::num::{real_i64, usize_of};
use schema::{Record, Sample};

/// Times before the impact (or the rest) at which positions are scored, s.
pub(crate) const BACK_S: [f64; 3] = [30.0, 10.0, 1.0];

/// A crash, its record and its reconstruction.
pub(crate) struct Case {
    /// The truth and what the sensors made of it.
    pub(crate) simulated: Simulated,
    /// The sealed record, written and read back.
    pub(crate) record: Record,
    /// Unrounded samples by index.
    pub(crate) samples: Vec<(u64, Sample)>,
    /// The reconstruction.
    pub(crate) result: Reconstruction,
}

impl Case {
    /// Simulates, replays, seals, reads, reconstructs: consumer sensors, default options.
    pub(crate) fn run(class: Class, seed: u64) -> Self {
        Self::run_by(class, seed, &Options::default())
    }

    /// The same with these options.
    pub(crate) fn run_by(class: Class, seed: u64, options: &Options) -> Self {
        let simulated = simulate(&Scenario::draw(class, seed)).unwrap();
        let dir = std::env::temp_dir().join(format!(
            "svartboks-truth-{}-{class}-{seed}",
            std::process::id()
        ));
        std::fs::create_dir_all(&dir).unwrap();
        std::fs::write(dir.join("sim.dbc"), simulated.dbc()).unwrap();
        let settings = Settings::from_toml_str(&simulated.config("sim.dbc"), &dir).unwrap();
        let log = dir.join("sim.log");
        std::fs::write(&log, simulated.candump()).unwrap();
        let facts = &simulated.truth.facts;
        // A class without an impact, or an impact below the trigger's 8 km/h, is frozen by hand.
        let (mut records, mut samples) = freeze(&settings, &log, &[]);
        if records.is_empty() {
            (records, samples) = freeze(&settings, &log, &[facts.trigger_at_s]);
        }
        std::fs::remove_dir_all(&dir).unwrap();
        assert!(!records.is_empty(), "{class} {seed}: no record");
        let (record, _) = Record::read(&records[0].to_bytes().unwrap()).unwrap();
        let result = reconstruct(&record, options).unwrap();
        Self {
            simulated,
            record,
            samples,
            result,
        }
    }

    /// The same record reconstructed again.
    pub(crate) fn again(&mut self, options: &Options) {
        self.result = reconstruct(&self.record, options).unwrap();
    }

    /// The same crash reconstructed from the samples before they were packed.
    pub(crate) fn unrounded(&self, options: &Options) -> Self {
        let (first, end) = (self.record.first_index(), self.record.end_index());
        let list: Vec<(u64, u8, Sample)> = self
            .samples
            .iter()
            .filter(|(index, _)| (first..end).contains(index))
            .map(|(index, sample)| (*index, 100, *sample))
            .collect();
        assert_eq!(list.len(), usize_of(end - first));
        let epochs = Epochs::from_samples(
            self.record.header.clone(),
            &list,
            self.record.time_s(first),
            &self.record.clipping,
        )
        .unwrap();
        let facts = Facts {
            triggers: &self.record.triggers,
            completion: &self.record.completion,
            utc_zero_ns: None,
        };
        let result = from_epochs(&epochs, &facts, options).unwrap();
        Self {
            simulated: self.simulated.clone(),
            record: self.record.clone(),
            samples: Vec::new(),
            result,
        }
    }

    /// Seconds of the log at t = 0 of the reconstruction.
    pub(crate) fn log_time_of_zero(&self) -> f64 {
        let zero = self.record.triggers[0].monotonic_ns + self.record.header.clock.offset_ns;
        real_i64(zero - self.simulated.scenario.start_unix_s * 1_000_000_000) * 1e-9
    }
}

/// Records and unrounded samples of one log.
fn freeze(
    settings: &Settings,
    log: &std::path::Path,
    trigger_at: &[f64],
) -> (Vec<Record>, Vec<(u64, Sample)>) {
    let mut records = Vec::new();
    let mut samples = Vec::new();
    let options = ReplayOptions {
        trigger_at: trigger_at.to_vec(),
        sink: Some(Box::new(|record| {
            records.push(record);
            Ok(())
        })),
        observer: Some(Box::new(|index, sample: &Sample| {
            samples.push((index, *sample));
        })),
        ..ReplayOptions::default()
    };
    replay(settings, vec![LogInput::File(log.to_path_buf())], options).unwrap();
    (records, samples)
}

/// The error at one instant.
#[derive(Clone, Copy, Debug)]
pub(crate) struct At {
    /// Estimated position, north and east, m.
    pub(crate) position: [f64; 2],
    /// Position error, m.
    pub(crate) error_m: f64,
    /// The same as a share of the distance driven from there to the rest.
    pub(crate) error_share: f64,
    /// Normalised estimation error squared, 2 degrees of freedom.
    pub(crate) nees: f64,
    /// Largest semi-axis of the 95 % ellipse, m.
    pub(crate) semi_axis_95: f64,
}

impl At {
    /// Distance between two estimates, m.
    pub(crate) fn distance_to(&self, other: &Self) -> f64 {
        (self.position[0] - other.position[0]).hypot(self.position[1] - other.position[1])
    }

    /// True if the truth lies in the ellipse of this confidence.
    pub(crate) fn inside(&self, confidence: f64) -> bool {
        self.nees <= -2.0 * (1.0 - confidence).ln()
    }
}

/// The score of one case.
#[derive(Clone, Debug)]
pub(crate) struct Score {
    /// At each of [`BACK_S`].
    pub(crate) at: Vec<At>,
    /// Error of the impact speed, m/s; `None` where there was no impact.
    pub(crate) impact_speed_error: Option<f64>,
    /// The true impact speed lies in the 95 % bounds.
    pub(crate) impact_speed_inside: bool,
}

/// Scores a case against its truth.
pub(crate) fn score(case: &Case) -> Score {
    let facts = &case.simulated.truth.facts;
    let event = facts
        .impacts
        .first()
        .map_or(facts.rest_t_s, |impact| impact.t_s);
    let zero = case.log_time_of_zero();
    let rows = &case.simulated.truth.rows;
    let states = &case.result.states;
    // The truth's frame has its origin at the last row, the record may end earlier in the same rest.
    let at = BACK_S
        .iter()
        .map(|back| {
            let wanted = event - back - zero;
            let k = states
                .partition_point(|s| s.t_s < wanted)
                .min(states.len() - 1);
            let state = &states[k];
            let row = usize::try_from(schema::num::round_i64((state.t_s + zero) * 100.0)).unwrap();
            let truth = &rows[row];
            assert!((truth.t_s - state.t_s - zero).abs() < 1e-6);
            let [dn, de] = [0, 1].map(|i| state.position[i] - truth.position[i]);
            let (a, b, c) = (
                state.sd_north.powi(2),
                state.sd_east.powi(2),
                state.cov_north_east,
            );
            let nees = (dn * dn * b - 2.0 * dn * de * c + de * de * a) / (a * b - c * c);
            let driven: f64 = rows[row..]
                .iter()
                .map(|r| r.velocity[0].hypot(r.velocity[1]) * 0.01)
                .sum();
            let largest = 0.5 * (a + b) + (0.25 * (a - b).powi(2) + c * c).sqrt();
            At {
                position: [state.position[0], state.position[1]],
                error_m: dn.hypot(de),
                error_share: dn.hypot(de) / driven,
                nees,
                semi_axis_95: reconstruct::stats::ellipse_radius(0.95) * largest.sqrt(),
            }
        })
        .collect();
    let pair = facts.impacts.first().zip(case.result.impacts.first());
    Score {
        at,
        impact_speed_error: pair.map(|(t, f)| (f.speed_mps.value - t.speed_mps).abs()),
        impact_speed_inside: pair
            .is_some_and(|(t, f)| (f.speed_mps.low..=f.speed_mps.high).contains(&t.speed_mps)),
    }
}

/// Median.
pub(crate) fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
