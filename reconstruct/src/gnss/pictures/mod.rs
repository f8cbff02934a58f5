//! Pictures of a drive and of a study of outages, as [S00, figures 4.5 to 4.15] has them: SVG that the same input gives the
//! same bytes of, bounded in size however long the log is.

pub mod over_time;
pub mod page;
pub mod plan;
mod plan_parts;
mod stage;
pub mod study;
mod tables;

use super::drive::{Drive, Fixed};
use super::forward::{Estimate, Fate};
use super::reference::{Reference, Second};
use super::stands::{Count, Found};

/// Our track, the published filter's, the reference, the receiver's own.
pub(super) const OURS: [&str; 2] = ["#1f5a96", "#bcd3ea"];
pub(super) const PUBLISHED: &str = "#d55e00";
pub(super) const TRUTH: &str = "#111";
pub(super) const RECEIVER: &str = "#00805c";
/// An outage in the background.
pub(super) const OUTAGE: &str = "#fbeecb";

/// A fix of the log as the pictures have it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shot {
    /// The fix, at the instant it was true.
    pub fix: Fixed,
    /// What the filter made of it; `None`: withheld from it.
    pub fate: Option<Fate>,
}

/// A drive reckoned.
#[derive(Clone, Copy, Debug)]
pub struct Shown<'a> {
    /// Filter in words.
    pub filter: &'a str,
    /// The track, in order of time.
    pub track: &'a [Estimate],
    /// Every fix of the log, in order of time.
    pub shots: &'a [Shot],
    /// The drive.
    pub drive: &'a Drive,
    /// What the stop detectors found.
    pub found: &'a [Found],
    /// Reference receiver, without marks where there is none.
    pub reference: &'a Reference,
    /// The track beside it.
    pub seconds: &'a [Second],
    /// Their errors beside the reference.
    pub counts: &'a [Count],
    /// Spans without a fix that was used, s.
    pub outages: &'a [[f64; 2]],
}

/// The longest time from one used fix to the next that is no outage, s.
pub const NO_OUTAGE_S: f64 = 2.5;

/// Two estimates farther apart in time, s, are on either side of a hole: no line goes over it.
pub const HOLE_S: f64 = 1.0;

/// Instants of the fixes that went in, s.
fn used(shots: &[Shot]) -> impl Iterator<Item = f64> {
    shots
        .iter()
        .filter(|s| matches!(s.fate, Some(Fate::Used | Fate::Forced)))
        .map(|s| s.fix.t_s)
}

/// Spans of the track without a used fix for more than 2.5 s, s.
#[must_use]
pub fn outages(track: &[Estimate], shots: &[Shot]) -> Vec<[f64; 2]> {
    let used: Vec<f64> = used(shots).collect();
    let mut out = Vec::new();
    for drive in track.chunk_by(|a, b| b.t_s - a.t_s < HOLE_S) {
        let [first, last] = [drive[0].t_s, drive[drive.len() - 1].t_s];
        let mut from = first;
        let within = used.iter().filter(|t| **t > first && **t < last);
        for t in within.copied().chain([last]) {
            if t - from > NO_OUTAGE_S {
                out.push([from, t]);
            }
            from = t;
        }
    }
    out
}

/// Name of its file without ending, caption, SVG for a page.
pub type Picture = (&'static str, &'static str, String);

/// Every picture of a drive.
#[must_use]
pub fn all(shown: &Shown<'_>) -> Vec<Picture> {
    let mut out = vec![(
        "plan",
        "The drive from above, north up, equal scales. Ellipses hold the true place with 95 % at their instant, if the filter is right about itself; they stand at the ends of the longest outages and at even distances.",
        plan::whole(shown),
    )];
    if let Some(svg) = plan::close(shown) {
        out.push((
            "plan-close",
            "Thirty seconds about the place where the track is farthest from the reference, or, without one, about the end of the longest outage. Marks each second; thin lines join track and reference of the same instant.",
            svg,
        ));
    }
    if let Some(svg) = over_time::deviation(shown) {
        out.push((
            "deviation",
            "Horizontal deviation from the reference, and the radius within which it stays with 95 % if the filter is right about itself. Green: the receiver's own fixes beside the reference.",
            svg,
        ));
    }
    out.push((
        "motion",
        "Speed over ground and heading with their bands of 95 %, and what the receiver says (its course only above 3 m/s).",
        over_time::motion(shown),
    ));
    out.push((
        "stops",
        "What the stop detectors go by, on logarithmic scales, with their bounds, and the spans in which each says that the car stands, over the whole log: the track begins later.",
        over_time::stops(shown),
    ));
    out.push((
        "biases",
        "Gyro biases about the forward, right and down axes with their bands of 95 %.",
        over_time::biases(shown),
    ));
    out
}
