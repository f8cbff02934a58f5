//! The whole of it: run, lay on the map, run again with the heading found, lay again.

use nalgebra::{Matrix2, Matrix3x2};
use schema::Record;

use crate::anchor::laid;
use crate::error::ReconstructError;
use crate::export::compass;
use crate::export::geodesy::TangentPlane;
use crate::findings::{Reconstruction, RestPose};
use crate::map::align::{Fit, Prior};
use crate::map::drift::{Path, SHORTEST_M};
use crate::map::network::{Network, Traffic};
use crate::map::roads::Roads;
use crate::map::search::{self, Outcome, Verdict};
use crate::run::{Options, reconstruct};

/// Where the car came to rest, roughly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RestPoint {
    /// Latitude, degrees, north positive (WGS 84).
    pub latitude_deg: f64,
    /// Longitude, degrees, east positive.
    pub longitude_deg: f64,
    /// One sigma per axis, m.
    pub sd_m: f64,
}

/// What to lay the path on, and what is known beforehand.
#[derive(Clone, Debug)]
pub struct Job {
    /// The map.
    pub roads: Roads,
    /// Rough place of rest.
    pub point: RestPoint,
    /// Heading at rest and its sd, degrees, if known.
    pub heading: Option<[f64; 2]>,
    /// Side that traffic keeps to.
    pub traffic: Traffic,
}

/// One answer on the earth.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// The pose at rest; its sds are the largest of the fit's.
    pub pose: RestPose,
    /// Posterior probability among all answers.
    pub probability: f64,
    /// Names of the roads under the path, from the rest backwards.
    pub roads: Vec<String>,
    /// The fit, in metres about the rough point.
    pub fit: Fit,
}

/// What became of a job.
#[derive(Clone, Debug, PartialEq)]
pub struct Placing {
    /// Name of the map file.
    pub file: String,
    /// Its SHA-256.
    pub sha256: [u8; 32],
    /// Rough place of rest.
    pub point: RestPoint,
    /// Heading at rest and its sd as given, degrees.
    pub heading: Option<[f64; 2]>,
    /// Side that traffic keeps to.
    pub traffic: Traffic,
    /// What is claimed.
    pub verdict: Verdict,
    /// Why not one place, sentences.
    pub why: Vec<String>,
    /// Answers, the best first.
    pub answers: Vec<Answer>,
    /// Straight pieces of road near by, north and east of the rough point, m.
    pub pieces: Vec<[[f64; 2]; 2]>,
    /// Seconds from the trigger of the points of the path, for [`Fit::cross`].
    pub t_s: Vec<f64>,
    /// Runs made: a second one where the heading was found.
    pub runs: u32,
}

/// Reconstructs a record and lays it on a map. Where one place fits, its latitude and heading enter the terms of
/// the Earth's rotation in a second run, which is laid on the map again; else the latitude alone gives gravity.
///
/// # Errors
/// As [`reconstruct`]; [`ReconstructError::Map`] if no road lies near the rest point.
pub fn reconstruct_on(
    record: &Record,
    options: &Options,
    job: &Job,
) -> Result<Reconstruction, ReconstructError> {
    let mut options = options.clone();
    options.rest_pose = None;
    options.fixes = false;
    options.latitude_deg = Some(job.point.latitude_deg);
    let mut result = reconstruct(record, &options)?;
    let mut placing = place(&result, job)?;
    if placing.verdict == Verdict::Placed
        && let Some(first) = placing.answers.first()
    {
        options.rest_pose = Some(first.pose);
        let again = reconstruct(record, &options)?;
        placing = place(&again, job)?;
        placing.runs = 2;
        if placing.verdict == Verdict::Placed
            && let Some(second) = placing.answers.first()
        {
            result = again;
            result.rest_pose = Some(second.pose);
        }
    }
    sentences(&mut result.limits, &placing);
    result.map = Some(Box::new(placing));
    Ok(result)
}

/// Lays a reconstruction in the axes of the car at rest on the map; changes nothing in it.
///
/// # Errors
/// [`ReconstructError::Map`] if no road lies near the rest point.
pub fn place(r: &Reconstruction, job: &Job) -> Result<Placing, ReconstructError> {
    let rough = RestPose {
        latitude_deg: job.point.latitude_deg,
        longitude_deg: job.point.longitude_deg,
        heading_deg: 0.0,
        sd_m: job.point.sd_m,
        sd_deg: 0.0,
    };
    let plane = TangentPlane::at(&rough);
    let until = r.impacts.first().map_or(f64::INFINITY, |i| i.t_s.value);
    let path = Path::sample(&r.states, until);
    let reach = path.as_ref().map_or(0.0, |p| {
        p.points
            .iter()
            .map(nalgebra::Matrix::norm)
            .fold(0.0, f64::max)
    }) + 4.0 * job.point.sd_m
        + 150.0;
    let network = Network::near(&job.roads.lines, plane, reach, job.traffic).map_err(|what| {
        ReconstructError::Map {
            file: job.roads.file.clone(),
            what,
        }
    })?;
    let prior = Prior {
        place: Matrix2::identity() * job.point.sd_m.max(0.1).powi(2),
        heading: job.heading.map(|h| (h[0].to_radians(), h[1].to_radians())),
    };
    let outcome = path.as_ref().map_or_else(
        || Outcome {
            verdict: Verdict::NoFit,
            why: vec![format!(
                "Less than {SHORTEST_M:.0} m of path before the first impact: too short to lay on a map."
            )],
            candidates: Vec::new(),
        },
        |path| search::search(path, &network, &prior),
    );
    Ok(Placing {
        file: job.roads.file.clone(),
        sha256: job.roads.sha256,
        point: job.point,
        heading: job.heading,
        traffic: job.traffic,
        verdict: outcome.verdict,
        why: outcome.why,
        answers: outcome
            .candidates
            .into_iter()
            .map(|c| answer(c.fit, c.probability, &network))
            .collect(),
        pieces: network
            .pieces
            .iter()
            .map(|p| p.ends.map(Into::into))
            .collect(),
        t_s: path.map_or_else(Vec::new, |p| p.t_s),
        runs: 1,
    })
}

fn answer(fit: Fit, probability: f64, network: &Network) -> Answer {
    let [longitude_deg, latitude_deg] = network.plane.lon_lat(fit.pose.x, fit.pose.y);
    let mut roads: Vec<String> = Vec::new();
    for road in fit.roads.iter().flatten() {
        let name = &network.roads[*road].name;
        if !name.is_empty() && !roads.contains(name) {
            roads.push(name.clone());
        }
    }
    Answer {
        pose: RestPose {
            latitude_deg,
            longitude_deg,
            heading_deg: fit.pose.z.to_degrees().rem_euclid(360.0),
            sd_m: search::worst_place(&fit),
            sd_deg: fit.covariance[(2, 2)].max(0.0).sqrt().to_degrees(),
        },
        probability,
        roads,
        fit,
    }
}

/// What the map leaves open, before the other limits.
fn sentences(limits: &mut Vec<String>, placing: &Placing) {
    let lead = match placing.verdict {
        Verdict::Placed => {
            limits.push(format!(
                "The place on the earth is that of the road lines in {}, taken to be drawn within about a metre \
                 and driven on the {} side.",
                placing.file,
                side(placing.traffic)
            ));
            return;
        }
        Verdict::Ambiguous => "The place on the map is ambiguous, and none is claimed.",
        Verdict::NoFit => "The path could not be placed on the map.",
    };
    let mut why = vec![lead.to_owned()];
    why.extend(placing.why.iter().cloned());
    limits.insert(0, why.join(" "));
}

/// Name of the side that traffic keeps to.
#[must_use]
pub fn side(traffic: Traffic) -> &'static str {
    match traffic {
        Traffic::Right => "right",
        Traffic::Left => "left",
    }
}

/// Turns a placed reconstruction to true north, with the covariances of the fit: its heading and place, and
/// how their errors hang together with those of the path, which the fit has bent onto the road, or the satellite fixes.
pub fn lay(r: &mut Reconstruction) {
    if r.gnss.as_ref().is_some_and(|gnss| gnss.pose.is_some()) {
        laid::lay(r);
        return;
    }
    let fitted = r.map.as_ref().and_then(|placing| {
        let best = placing.answers.first()?;
        (placing.verdict == Verdict::Placed).then(|| (best.fit.clone(), placing.t_s.clone()))
    });
    let before: Vec<_> = r.states.iter().map(laid::own).collect();
    compass::to_true_north(r);
    let Some((fit, t_s)) = fitted else { return };
    let end = r.states.last().map_or(0.0, |s| s.t_s);
    for (state, before) in r.states.iter_mut().zip(&before) {
        let shared = shared(&fit, &t_s, state.t_s, end);
        laid::on_earth(state, before, fit.pose.z, &fit.covariance, &shared);
    }
}

/// Covariance of the pose with the path's error at a time: between the points of the fit, and down to nothing
/// at the end, where the path begins.
fn shared(fit: &Fit, t_s: &[f64], t: f64, end: f64) -> Matrix3x2<f64> {
    // Times fall from the first point on.
    let k = t_s.partition_point(|x| *x > t);
    let at = |i: usize| {
        i.checked_sub(1).map_or((end, Matrix3x2::zeros()), |j| {
            (t_s[j], fit.cross.get(j).copied().unwrap_or_default())
        })
    };
    let (after, a) = at(k);
    if k >= t_s.len() {
        return a;
    }
    let (before, b) = at(k + 1);
    let share = if after > before {
        ((after - t) / (after - before)).clamp(0.0, 1.0)
    } else {
        0.0
    };
    a * (1.0 - share) + b * share
}
