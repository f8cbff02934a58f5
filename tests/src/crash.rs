//! Simulated crashes through the whole way, and what their truth says.

use std::sync::atomic::{AtomicU64, Ordering};

use reconstruct::findings::Reconstruction;
use reconstruct::simulate::{Class, Scenario, Simulated, simulate};
use recorder::config::Settings;
use schema::num;

use crate::log::{self, Line};

/// Squared radius of the 95 % ellipse (chi-square, 2 degrees).
const CHI_95: f64 = 5.991;

/// A simulated crash with its frames.
pub struct Crash {
    /// The simulation.
    pub simulated: Simulated,
    /// Its frames.
    pub lines: Vec<Line>,
    /// Its settings.
    pub settings: Settings,
}

/// The reconstruction beside the truth at one instant.
#[derive(Clone, Copy, Debug)]
pub struct Moment {
    /// Distance from the truth, m.
    pub off: f64,
    /// Squared distance over the covariance.
    pub chi: f64,
    /// Long half axis of the 95 % ellipse, m.
    pub radius: f64,
    /// Speed less the true speed, m/s.
    pub speed_off: f64,
    /// One sigma of the speed, m/s.
    pub speed_sd: f64,
}

impl Moment {
    /// True inside the 95 % ellipse.
    pub fn inside(&self) -> bool {
        self.chi <= CHI_95
    }
}

/// Draws and simulates.
pub fn draw(class: Class, seed: u64) -> Crash {
    let simulated = simulate(&Scenario::draw(class, seed)).unwrap();
    let settings = settings(&simulated, &[]);
    Crash {
        lines: log::read(simulated.candump().as_bytes()),
        settings,
        simulated,
    }
}

/// Settings of a simulated crash with pieces of its configuration replaced.
pub fn settings(simulated: &Simulated, changes: &[(&str, &str)]) -> Settings {
    settings_with(simulated, &simulated.dbc(), changes)
}

/// The same with another DBC; `{dbc}` in a replacement is the name of its file.
pub fn settings_with(simulated: &Simulated, dbc: &str, changes: &[(&str, &str)]) -> Settings {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let name = format!(
        "svartboks-{}-{}.dbc",
        std::process::id(),
        COUNT.fetch_add(1, Ordering::Relaxed)
    );
    let path = std::env::temp_dir().join(&name);
    std::fs::write(&path, dbc).unwrap();
    let mut text = simulated.config(&name);
    for (from, to) in changes {
        assert!(text.contains(from), "the configuration has no `{from}`");
        text = text.replace(from, &to.replace("{dbc}", &name));
    }
    let settings = Settings::from_toml_str(&text, &std::env::temp_dir()).unwrap();
    std::fs::remove_file(path).unwrap();
    settings
}

impl Crash {
    /// The true time of the first impact (or of the rest), s of the log.
    pub fn trigger_at(&self) -> f64 {
        self.simulated.truth.facts.trigger_at_s
    }

    /// The frames as text.
    pub fn text(&self) -> String {
        log::write(&self.lines)
    }

    /// Drops frames of the identifiers between two times of the log (s).
    pub fn without(&self, ids: &[&str], from: f64, to: f64) -> String {
        let zero = self.simulated.truth.facts.start_unix_s * 1_000_000_000;
        let kept: Vec<Line> = self
            .lines
            .iter()
            .filter(|line| {
                let t = num::real_i64(line.time_ns - zero) * 1e-9;
                !(ids.contains(&line.id.as_str()) && (from..to).contains(&t))
            })
            .cloned()
            .collect();
        log::write(&kept)
    }

    /// The reconstruction against the truth, so many seconds after the true trigger (negative: before).
    pub fn moment(&self, result: &Reconstruction, seconds: f64) -> Moment {
        let t = self.trigger_at() + seconds;
        let zero = self.simulated.truth.facts.start_unix_s * 1_000_000_000;
        let utc = zero + num::round_i64(t * 1e9);
        let at = result
            .states
            .partition_point(|s| s.utc_ns.unwrap() < utc)
            .min(result.states.len() - 1);
        let state = &result.states[at];
        let own = num::real_i64(state.utc_ns.unwrap() - zero) * 1e-9;
        let rows = &self.simulated.truth.rows;
        let row = &rows[num::round_usize(own * 100.0).min(rows.len() - 1)];
        let north = state.position[0] - row.position[0];
        let east = state.position[1] - row.position[1];
        let (nn, ee, ne) = (
            state.sd_north.powi(2).max(1e-12),
            state.sd_east.powi(2).max(1e-12),
            state.cov_north_east,
        );
        let determinant = (nn * ee - ne * ne).max(1e-24);
        let mean = f64::midpoint(nn, ee);
        let long = mean + (0.25 * (nn - ee).powi(2) + ne * ne).sqrt();
        Moment {
            off: north.hypot(east),
            chi: (ee * north * north - 2.0 * ne * north * east + nn * east * east) / determinant,
            radius: (CHI_95 * long).sqrt(),
            speed_off: state.speed - row.speed,
            speed_sd: state.sd_speed,
        }
    }
}
