//! The details of the made-up crash: everything there is to show at once.

use crate::findings::DeltaV;
use crate::findings::agreement::Comparison;
use crate::findings::curve::{CurvePoint, Maximum, Peak};
use crate::findings::details::{Budget, Details, SamplePaths};
use crate::findings::extremes::{Extreme, Extremes};
use crate::findings::final_rest::{FinalRest, FromImpact};
use crate::findings::pulse_times::{PulseTimes, Rule};
use crate::findings::reaction::{Reaction, Reference, Row};
use crate::findings::rollover::RollOver;
use crate::report::sample_case::figure;
use crate::smooth::Smoother;

pub(crate) fn comparison() -> Comparison {
    Comparison {
        quantity: "impact speed",
        models: ["dead-reckoning", "nine-state"],
        difference: 0.6,
        unit: "m/s",
        chi_square: 14.2,
        degrees: 1,
        limit: 3.84,
    }
}

pub(crate) fn pulse() -> DeltaV {
    let peak = |value, after| Peak {
        value_mps: figure(value, 0.1),
        after_onset_s: figure(after, 0.006),
    };
    DeltaV {
        north_mps: figure(-9.9, 0.13),
        east_mps: figure(5.6, 0.12),
        azimuth_deg: figure(150.5, 0.9),
        yaw_rate_change_degps: figure(-133.0, 2.0),
        times: [Rule::Ramp, Rule::Cfr563, Rule::HalfG]
            .map(|rule| PulseTimes {
                rule,
                begin_t_s: Some(figure(-0.012, 0.003)),
                end_t_s: (rule != Rule::HalfG).then(|| figure(0.1, 0.005)),
            })
            .to_vec(),
        curve: [(0.007, -0.1, 0.0), (0.057, -5.4, 1.9), (0.117, -10.7, 3.9)]
            .map(|(t, x, y)| CurvePoint {
                after_onset_s: t,
                longitudinal_mps: figure(x, 0.1),
                lateral_mps: figure(y, 0.1),
                resultant_mps: figure(f64::hypot(x, y), 0.1),
            })
            .to_vec(),
        maximum: Some(Maximum {
            longitudinal: peak(-10.7, 0.117),
            lateral: peak(3.9, 0.117),
            resultant: peak(11.4, 0.117),
        }),
        ..DeltaV::default()
    }
}

pub(crate) fn details() -> Details {
    let row = |before_s: f64| Row {
        before_s,
        t_s: before_s - 0.012,
        index: 3900,
        speed_mps: figure(20.0 + before_s, 0.1),
        north_m: figure(20.0 * before_s, 0.5),
        east_m: figure(-3.0, 0.4),
        cov_north_east_m2: 0.01,
        heading_deg: figure(359.8, 0.4),
        distance_m: figure(-20.0 * before_s, 0.3),
        forward_mps2: (before_s < -0.2).then(|| figure(-6.4, 0.1)),
        right_mps2: None,
        brake: Some(1.0),
    };
    let extreme = |value, t_s| {
        Some(Extreme {
            value: figure(value, 0.2),
            t_s,
        })
    };
    let extremes = |sign: f64| Extremes {
        lateral_mps2: extreme(3.1 * sign, -17.2),
        sideslip_deg: extreme(-1.2 * sign, -16.0),
        yaw_rate_degps: None,
    };
    Details {
        reaction: Reaction {
            reference: Reference::Impact,
            rows: [-1.0, -0.5, 0.0].map(row).to_vec(),
            brake_unit: Some("%".to_owned()),
        },
        before: extremes(1.0),
        after: Some(extremes(-4.0)),
        no_attitude: false,
        rollover: Some(RollOver {
            axis: "roll",
            angle_deg: figure(-181.0, 1.0),
            largest_deg: figure(-184.0, 1.0),
            quarter_turns: 2,
            certain: true,
            begin_t_s: figure(0.4, 0.02),
            end_t_s: figure(2.1, 0.02),
        }),
        final_rest: Some(FinalRest {
            stop_t_s: figure(3.41, 0.02),
            settled_t_s: 4.6,
            duration_s: figure(4.59, 0.02),
            roll_deg: figure(-179.2, 0.6),
            pitch_deg: figure(0.4, 0.6),
            heading_deg: figure(0.0, 0.0),
            lies_on: "roof",
            from_impact: Some(FromImpact {
                straight_m: figure(17.2, 0.2),
                path_m: figure(18.1, 0.3),
                rotation_deg: figure(-231.0, 0.4),
                duration_s: figure(3.42, 0.02),
            }),
        }),
        intervals: Vec::new(),
        multi_event: 1,
        smoother: Some(Smoother::Rts),
        budgets: vec![Budget {
            figure: "impact speed".to_owned(),
            unit: "m/s",
            sd: 0.12,
            sources: vec![
                ("levelling".to_owned(), 0.12),
                ("accelerometer".to_owned(), 0.63),
                ("wheel <scale>".to_owned(), 0.25),
            ],
        }],
        paths: SamplePaths::default(),
    }
}
