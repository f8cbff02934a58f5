//! What `motion.svg` shows: the curves with their bands and ranges, the shaded stretches, the marked events.

use crate::findings::Reconstruction;
use crate::report::number::KMH;
use crate::report::panel::Series;
use crate::report::svg::signed;
use crate::trajectory::State;

pub(crate) const BLUE: &str = "#1f5a96";
pub(crate) const BLUE_BAND: &str = "#b9d0e8";
pub(crate) const VERMILION: &str = "#c24e00";
pub(crate) const VERMILION_BAND: &str = "#f3cdb2";

pub(crate) fn span(r: &Reconstruction) -> Option<[f64; 2]> {
    let (first, last) = r.states.first().zip(r.states.last())?;
    Some([first.t_s, last.t_s.max(first.t_s + 0.1)])
}

/// Stretches whose samples are missing or were bridged.
pub(crate) fn shaded(r: &Reconstruction) -> Vec<[f64; 2]> {
    let mut out: Vec<[f64; 2]> = Vec::new();
    for s in r
        .states
        .iter()
        .filter(|s| s.bridged || s.accel.iter().any(Option::is_none) || s.yaw_rate.is_none())
    {
        match out.last_mut() {
            Some(last) if s.t_s - last[1] < 0.021 => last[1] = s.t_s,
            _ => out.push([s.t_s - 0.01, s.t_s]),
        }
    }
    out
}

pub(crate) struct Plot {
    pub(crate) title: &'static str,
    pub(crate) unit: &'static str,
    pub(crate) series: Series,
    pub(crate) range: [f64; 2],
}

pub(crate) fn series(r: &Reconstruction, value: impl Fn(&State) -> (Option<f64>, f64)) -> Series {
    let points = r
        .states
        .iter()
        .map(|s| (s.t_s, value(s).0, value(s).1))
        .collect();
    Series {
        points,
        color: BLUE,
        band: BLUE_BAND,
        dash: "",
    }
}

pub(crate) fn plots(r: &Reconstruction, z: f64) -> Vec<Plot> {
    let speed = series(r, |s| (Some(s.speed * KMH), z * s.sd_speed * KMH));
    let forward = series(r, |s| (s.accel[0], z * s.sd_accel[0]));
    let right = series(r, |s| (s.accel[1], z * s.sd_accel[1]));
    let yaw = series(r, |s| {
        (
            s.yaw_rate.map(f64::to_degrees),
            z * s.sd_yaw_rate.to_degrees(),
        )
    });
    let quiet = |s: &Series, least: f64| range(s, least, |t| in_pulse(r, t));
    let ranges = [
        range(&speed, 10.0, |_| false),
        quiet(&forward, 4.0),
        quiet(&right, 4.0),
        // A spin begins in the pulse and is seen whole.
        range(&yaw, 10.0, |_| false),
    ];
    let [r0, r1, r2, r3] = ranges;
    vec![
        Plot {
            title: "Forward speed, km/h",
            unit: "km/h",
            series: speed,
            range: r0,
        },
        Plot {
            title: "Forward acceleration, m/s\u{b2}",
            unit: "m/s\u{b2}",
            series: forward,
            range: r1,
        },
        Plot {
            title: "Rightward acceleration, m/s\u{b2}",
            unit: "m/s\u{b2}",
            series: right,
            range: r2,
        },
        Plot {
            title: "Yaw rate, \u{b0}/s (to the right)",
            unit: "\u{b0}/s",
            series: yaw,
            range: r3,
        },
    ]
}

pub(crate) fn in_pulse(r: &Reconstruction, t: f64) -> bool {
    r.impacts
        .iter()
        .any(|i| t > i.t_s.value - 0.05 && t < i.delta_v.end_t_s + 0.15)
}

/// Ends of an axis that holds zero and every band outside what is left out, at least `least` high.
pub(crate) fn range(s: &Series, least: f64, leave_out: impl Fn(f64) -> bool) -> [f64; 2] {
    let (mut low, mut high) = (0.0_f64, 0.0_f64);
    for (_, v, half) in s.points.iter().filter(|p| !leave_out(p.0)) {
        if let (Some(v), true) = (v, half.is_finite()) {
            low = low.min(v - half);
            high = high.max(v + half);
        }
    }
    let missing = (least - (high - low)).max(0.0);
    let margin = 0.06 * (high - low + missing);
    [
        if low < 0.0 {
            low - margin - 0.5 * missing
        } else {
            -margin
        },
        high + margin + missing * if low < 0.0 { 0.5 } else { 1.0 },
    ]
}

pub(crate) struct Event {
    pub(crate) t_s: f64,
    pub(crate) label: String,
    pub(crate) style: &'static str,
}

pub(crate) fn events(r: &Reconstruction) -> Vec<Event> {
    let mut out = Vec::new();
    if let Some(b) = &r.braking {
        out.push(Event {
            t_s: b.onset_t_s.value,
            label: format!("braking {} s", signed(b.onset_t_s.value, 2)),
            style: "stroke=\"#c24e00\" stroke-width=\"1.6\" stroke-dasharray=\"7 3\"",
        });
    }
    for (i, impact) in r.impacts.iter().enumerate() {
        let name = if r.impacts.len() > 1 {
            format!("impact {}", i + 1)
        } else {
            "impact".to_owned()
        };
        out.push(Event {
            t_s: impact.t_s.value,
            label: format!("{name} {} s", signed(impact.t_s.value, 3)),
            style: "stroke=\"#a3003f\" stroke-width=\"1.8\"",
        });
    }
    out.push(Event {
        t_s: 0.0,
        label: "trigger".to_owned(),
        style: "stroke=\"#111\" stroke-width=\"1.2\" stroke-dasharray=\"2 3\"",
    });
    if let (true, Some(t)) = (r.rest.found, r.rest.t_s) {
        out.push(Event {
            t_s: t,
            label: format!("rest {} s", signed(t, 1)),
            style: "stroke=\"#111\" stroke-width=\"1.2\" stroke-dasharray=\"9 3 2 3\"",
        });
    }
    if let Some([from, to]) = span(r) {
        out.retain(|e| e.t_s >= from && e.t_s <= to);
    }
    out
}
