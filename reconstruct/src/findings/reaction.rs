//! The reaction window: what the car did in the last seconds before the impact, row by row.

use schema::num::{real, round_usize, usize_of};
use schema::parts::AuxChannel;

use crate::findings::Figure;
use crate::findings::crash::Evidence;
use crate::trajectory::State;

/// Time between two rows, s.
pub const STEP_S: f64 = 0.5;
/// The acceleration of a row is the mean over so long before it, s.
pub const MEAN_S: f64 = 0.1;

/// One row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Seconds to the reference (the onset of the first impact, else the begin of the rest): 0 or negative.
    pub before_s: f64,
    /// Seconds from the trigger.
    pub t_s: f64,
    /// Sample at or before that time, on the 100 Hz grid.
    pub index: u64,
    /// Forward speed, m/s.
    pub speed_mps: Figure,
    /// North of the IMU, m.
    pub north_m: Figure,
    /// East, m.
    pub east_m: Figure,
    /// Covariance of the two, m^2.
    pub cov_north_east_m2: f64,
    /// Heading, degrees.
    pub heading_deg: Figure,
    /// Way still to go to the reference, along the path, m. Its bounds take the speed errors as one and the same
    /// throughout, which they at most are.
    pub distance_m: Figure,
    /// Forward acceleration, mean over the 0.1 s before, m/s^2; `None` where samples are missing.
    pub forward_mps2: Option<Figure>,
    /// Rightward acceleration, the same.
    pub right_mps2: Option<Figure>,
    /// Value of the recorded brake signal; `None` where none is recorded.
    pub brake: Option<f64>,
}

/// What the last row stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Reference {
    /// The onset of the first impact.
    #[default]
    Impact,
    /// The instant the car stood still: there was no impact.
    Stop,
}

impl Reference {
    /// Name in `summary.json`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Impact => "impact",
            Self::Stop => "stop",
        }
    }
}

/// The table.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Reaction {
    /// What the last row stands for.
    pub reference: Reference,
    /// Rows in order of time; empty where the window holds nothing to refer to.
    pub rows: Vec<Row>,
    /// Unit of the brake signal; `None` where none is recorded.
    pub brake_unit: Option<String>,
}

/// Rows each 0.5 s over `seconds` up to `end` (seconds from the trigger), as far as the states go.
#[must_use]
pub fn rows(evidence: &Evidence<'_>, states: &[State], seconds: f64, end: &Figure) -> Vec<Row> {
    let count = round_usize((seconds / STEP_S).max(0.0).floor());
    let mut out: Vec<Row> = (0..=count)
        .rev()
        .filter_map(|i| row(evidence, states, real(i) * STEP_S, end))
        .collect();
    for row in &mut out {
        row.distance_m = way(states, row.t_s, end.value, evidence.quantile);
    }
    out
}

/// Distance over ground between two times, m.
#[must_use]
pub fn way(states: &[State], from_s: f64, to_s: f64, quantile: f64) -> Figure {
    let (mut sum, mut sd) = (0.0, 0.0);
    let from = states.partition_point(|s| s.t_s <= from_s + 1e-9);
    for pair in states[from.saturating_sub(1)..].windows(2) {
        let (a, b) = (&pair[0], &pair[1]);
        if a.t_s >= to_s {
            break;
        }
        let length = b.t_s - a.t_s;
        let share = ((to_s.min(b.t_s) - from_s.max(a.t_s)) / length).clamp(0.0, 1.0);
        sum += 0.5 * (a.ground_speed + b.ground_speed) * length * share;
        sd += 0.5 * (a.sd_speed + b.sd_speed) * length * share;
    }
    Figure::non_negative(sum, sd, quantile)
}

fn row(evidence: &Evidence<'_>, states: &[State], back: f64, end: &Figure) -> Option<Row> {
    let q = evidence.quantile;
    let t = end.value - back;
    // The states on both sides; in the pulse the one before it must do, drawn on with its own speed.
    let after = states.partition_point(|s| s.t_s <= t + 1e-9);
    let a = states.get(after.checked_sub(1)?)?;
    let b = if back > 0.0 { states.get(after)? } else { a };
    let share = if b.t_s > a.t_s {
        (t - a.t_s) / (b.t_s - a.t_s)
    } else {
        0.0
    };
    let mix = |x: f64, y: f64| x + (y - x) * share;
    let lead = if back > 0.0 { 0.0 } else { t - a.t_s };
    let turn = b.heading - a.heading;
    let turn = turn - std::f64::consts::TAU * (turn / std::f64::consts::TAU).round();
    let heading = a.heading + turn * share + a.yaw_rate.unwrap_or(0.0) * lead;
    let place = |i: usize| mix(a.position[i], b.position[i]) + a.velocity[i] * lead;
    let accel = a.accel[0].unwrap_or(0.0);
    // The reference is known to its own time: the doubt moves the row along the path.
    let speed_sd = mix(a.sd_speed, b.sd_speed).hypot(accel * end.sd);
    let place_sd = |sd: f64, i: usize| sd.hypot(a.velocity[i] * end.sd);
    let [forward, right] = [0, 1].map(|axis| mean(states, axis, a.t_s, q));
    Some(Row {
        before_s: -back,
        t_s: t,
        index: a.index,
        speed_mps: Figure::new(mix(a.speed, b.speed) + accel * lead, speed_sd, q),
        north_m: Figure::new(place(0), place_sd(mix(a.sd_north, b.sd_north), 0), q),
        east_m: Figure::new(place(1), place_sd(mix(a.sd_east, b.sd_east), 1), q),
        cov_north_east_m2: mix(a.cov_north_east, b.cov_north_east)
            + a.velocity[0] * a.velocity[1] * end.sd * end.sd,
        heading_deg: Figure::new(
            heading.to_degrees().rem_euclid(360.0),
            mix(a.sd_heading, b.sd_heading).to_degrees(),
            q,
        ),
        distance_m: Figure::NONE,
        forward_mps2: forward,
        right_mps2: right,
        brake: None,
    })
}

/// Mean over the 0.1 s up to `to_s`; its spread is the widest of a single sample's, as their errors may go together.
fn mean(states: &[State], axis: usize, to_s: f64, quantile: f64) -> Option<Figure> {
    let to = states.partition_point(|s| s.t_s <= to_s + 1e-9);
    let from = states.partition_point(|s| s.t_s <= to_s - MEAN_S + 1e-9);
    let window = states.get(from..to).filter(|w| !w.is_empty())?;
    let mut sum = 0.0;
    let mut sd: f64 = 0.0;
    for state in window {
        sum += state.accel[axis]?;
        sd = sd.max(state.sd_accel[axis]);
    }
    Some(Figure::new(sum / real(window.len()), sd, quantile))
}

impl Reaction {
    /// Fills the brake column from the record's auxiliary channel of that name.
    pub fn fill_brake(&mut self, channels: &[AuxChannel]) {
        let Some(channel) = channels.iter().find(|c| c.name == "brake") else {
            return;
        };
        self.brake_unit = Some(channel.unit.clone());
        for row in &mut self.rows {
            row.brake = row
                .index
                .checked_sub(channel.first_index)
                .and_then(|n| channel.values.get(usize_of(n / 10)).copied().flatten());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample_case;

    #[test]
    fn the_way_is_that_of_the_states_and_the_brake_that_of_its_sample() {
        let r = sample_case::reconstruction();
        let (from, to) = (r.states[100].t_s, r.states[900].t_s);
        let whole = way(&r.states, from, to, 1.96);
        let parts = [(from, from + 2.0034), (from + 2.0034, to)]
            .map(|(a, b)| way(&r.states, a, b, 1.96).value);
        assert!((whole.value - parts[0] - parts[1]).abs() < 1e-9);
        assert!(whole.value > 100.0 && whole.sd > 0.0);
        let mut reaction = r.details.reaction.clone();
        for (row, index) in reaction.rows.iter_mut().zip([1005, 1019, 990]) {
            row.index = index;
        }
        reaction.fill_brake(&[AuxChannel {
            name: "brake".to_owned(),
            signal: "X.Brake".to_owned(),
            unit: "%".to_owned(),
            first_index: 1000,
            values: vec![Some(3.0), None, Some(7.0)],
        }]);
        let found: Vec<_> = reaction.rows.iter().map(|row| row.brake).collect();
        assert_eq!(found, [Some(3.0), None, None]);
    }
}
