//! What `reconstruct gnss run` writes of a reckoned drive: the track, and its figures for the summary.

use std::fmt::Write;

use reconstruct::gnss::drive::Drive;
use reconstruct::gnss::forward::{Estimate, Fate};
use reconstruct::gnss::pictures::{HOLE_S, Shot};
use reconstruct::gnss::reference::Second;
use schema::num::real;
use serde_json::{Value, json};

/// A track that begins so much later than the samples is said to, s; in the second case only time in which the car moves
/// counts.
const LATE_S: [f64; 2] = [10.0, 3.0];

/// Rounded to milliseconds, and no negative zero.
pub(crate) fn milli(x: f64) -> f64 {
    (1000.0 * x).round() / 1000.0 + 0.0
}

/// What of the drive is before the track.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Begin {
    t_s: f64,
    left_out_s: f64,
    moving_s: f64,
    why: &'static str,
}

impl Begin {
    /// `standing` has a flag for each period of the drive.
    pub(crate) fn of(
        track: &[Estimate],
        drive: &Drive,
        standing: &[bool],
        why: &'static str,
    ) -> Self {
        let t_s = track.first().map_or(f64::INFINITY, |e| e.t_s);
        let before = drive.periods.iter().zip(standing);
        let mut out = Self {
            t_s,
            left_out_s: 0.0,
            moving_s: 0.0,
            why,
        };
        for (period, still) in before.take_while(|(p, _)| p.t_s < t_s - 1e-6) {
            out.left_out_s += period.dt;
            out.moving_s += if *still { 0.0 } else { period.dt };
        }
        out
    }

    /// For a page, if there is something to say.
    pub(crate) fn words(&self) -> Option<String> {
        (self.left_out_s > LATE_S[0] || self.moving_s > LATE_S[1]).then(|| {
            format!(
                "The track begins at {:.2} s of the box's clock, {}: {:.1} s of the drive before are left out, {:.1} s of them with the car moving by the stop detector.",
                self.t_s, self.why, self.left_out_s, self.moving_s
            )
        })
    }

    /// For a machine.
    pub(crate) fn json(&self) -> Value {
        json!({
            "t_s": milli(self.t_s), "reason": self.why, "left_out_s": milli(self.left_out_s),
            "left_out_moving_s": milli(self.moving_s),
        })
    }
}

/// What became of the fixes of the log, counted; that of the start is used.
pub(crate) fn fates(track: &[Estimate], shots: &[Shot]) -> Value {
    let count = |f: &dyn Fn(&Shot) -> bool| shots.iter().filter(|s| f(s)).count();
    let [begin, end] = [track.first(), track.last()].map(|e| e.map_or(f64::NAN, |e| e.t_s));
    let [used, refused, forced] =
        [Fate::Used, Fate::Refused, Fate::Forced].map(|fate| count(&|s| s.fate == Some(fate)));
    let none = |s: &Shot| s.fate.is_none();
    let before = count(&|s| none(s) && s.fix.t_s < begin);
    let after = count(&|s| none(s) && s.fix.t_s > end);
    let beside = |s: &Shot| {
        let at = track.partition_point(|e| e.t_s < s.fix.t_s);
        let pair = at.checked_sub(1).and_then(|i| track.get(i..=at));
        pair.is_some_and(|pair| pair[1].t_s - pair[0].t_s > HOLE_S)
    };
    let holes = count(&|s| none(s) && beside(s));
    json!({
        "log": shots.len(), "before_track": before, "after_track": after,
        "in_holes": holes, "withheld": count(&none) - before - after - holes,
        "offered": used + refused + forced, "used": used, "refused": refused, "forced": forced,
    })
}

/// Horizontal deviation from the reference at its stamps, m: mean, 95th percentile, largest, and how often the reference
/// lies in the ellipse of 95 %; null where the two do not meet. `told`: the reference's speed was fed in.
pub(crate) fn deviation(list: &[Second], told: bool) -> Value {
    if list.is_empty() {
        return Value::Null;
    }
    let mut off: Vec<f64> = list.iter().map(|s| s.off_m).collect();
    let inside = list.iter().filter(|s| s.inside).count();
    off.sort_by(f64::total_cmp);
    let last = off.len() - 1;
    json!({
        "instants": off.len(), "mean_m": off.iter().sum::<f64>() / real(off.len()),
        "p95_m": off[schema::num::round_usize(0.95 * real(last))], "largest_m": off[last],
        "inside_95": real(inside) / real(off.len()), "speed_of_reference_fed_in": told,
    })
}

/// Time in which the car was taken to stand, s.
pub(crate) fn standing_s(track: &[Estimate]) -> f64 {
    milli(
        track
            .windows(2)
            .filter(|w| w[1].standing && w[1].t_s - w[0].t_s < HOLE_S)
            .map(|w| w[1].t_s - w[0].t_s)
            .sum(),
    )
}

/// `t_s` is the box's clock; each fix that went in stands at the first estimate at or behind it.
pub(crate) fn csv(track: &[Estimate], shots: &[Shot]) -> String {
    let mut out = String::from(
        "t_s,latitude_deg,longitude_deg,height_m,v_north_mps,v_east_mps,v_down_mps,roll_deg,pitch_deg,heading_deg,sd_north_m,sd_east_m,cov_north_east_m2,sd_down_m,sd_v_north_mps,sd_v_east_mps,sd_heading_deg,standing,fix_used,fix_forced\n",
    );
    let mut next = 0;
    for e in track {
        let (mut used, mut forced) = (false, false);
        while let Some(shot) = shots.get(next).filter(|s| s.fix.t_s <= e.t_s + 1e-6) {
            // Of those before the track that of its start alone has a fate.
            used |= shot.fate == Some(Fate::Used);
            forced |= shot.fate == Some(Fate::Forced);
            next += 1;
        }
        let sd = |i: usize| e.p[(i, i)].max(0.0).sqrt();
        let _ = writeln!(
            out,
            "{:.3},{:.9},{:.9},{:.3},{:.4},{:.4},{:.4},{:.3},{:.3},{:.3},{:.3},{:.3},{:.4},{:.3},{:.4},{:.4},{:.3},{},{},{}",
            e.t_s,
            e.place.latitude.to_degrees(),
            e.place.longitude.to_degrees(),
            e.place.height,
            e.v_n.x,
            e.v_n.y,
            e.v_n.z,
            e.angles[0].to_degrees(),
            e.angles[1].to_degrees(),
            e.angles[2].to_degrees(),
            sd(0),
            sd(1),
            e.p[(0, 1)],
            sd(2),
            sd(3),
            sd(4),
            sd(8).to_degrees(),
            u8::from(e.standing),
            u8::from(used),
            u8::from(forced),
        );
    }
    out
}
