//! The trigger machine, case by case.
#![allow(clippy::unwrap_used, reason = "tests")]

use recorder::config::Condition;
use recorder::rest::RestLimits;
use recorder::sampler::Peak;
use recorder::trigger::{Action, Input, MOST_TAIL, Rules, State};
use schema::Sample;
use schema::parts::TriggerKind;

const G: f64 = 9.806_65;

fn rules() -> Rules {
    Rules {
        peak: Some(50.0 * G),
        delta_v: Some(8.0 / 3.6),
        can: vec![Condition::Equals(1.0), Condition::Above(0.5)],
        after: 1000,
        rest: RestLimits {
            accel_bias: 0.1,
            rate_bias: 0.009,
            wheel_cutoff: Some(1.0),
        },
        muted: false,
    }
}

fn sample(x: f64, y: f64, wheel: f64) -> Sample {
    Sample {
        wheels: [Some(wheel), None],
        accel: [Some(x), Some(y), Some(-G)],
        rate: [Some(0.0), Some(0.0), Some(0.001)],
    }
}

/// Feeds samples of 10 ms; gives what happened and where.
fn feed(
    state: &mut State,
    from: u64,
    samples: impl IntoIterator<Item = Sample>,
) -> Vec<(u64, Action)> {
    let mut actions = Vec::new();
    for (index, sample) in (from..).zip(samples) {
        let (next, action) = state.step(&Input::Sample(index, &sample), &rules());
        *state = next;
        if action != Action::None {
            actions.push((index, action));
        }
    }
    actions
}

fn repeat(sample: Sample, count: usize) -> impl Iterator<Item = Sample> {
    std::iter::repeat_n(sample, count)
}

#[test]
fn what_drivers_do_is_no_crash() {
    let slope = G * 0.29;
    let cases: Vec<(&str, Vec<Sample>)> = vec![
        (
            "0.8 g braking for 5 s",
            repeat(sample(-0.8 * G, 0.0, 20.0), 500).collect(),
        ),
        (
            "braking that ends at once",
            repeat(sample(-0.8 * G, 0.0, 20.0), 500)
                .chain(repeat(sample(0.0, 0.0, 0.0), 300))
                .collect(),
        ),
        (
            "1.1 g braking down a slope of 30 %",
            repeat(sample(slope, 0.0, 20.0), 1000)
                .chain(repeat(sample(slope - 1.1 * G, 0.0, 20.0), 300))
                .collect(),
        ),
        (
            "a kerb: 8 g for 20 ms",
            repeat(sample(-8.0 * G, 3.0 * G, 5.0), 2)
                .chain(repeat(sample(0.0, 0.0, 5.0), 50))
                .collect(),
        ),
        (
            "a sensor on its side at start-up",
            repeat(sample(G, 0.0, 0.0), 500).collect(),
        ),
        (
            "1 g of cornering",
            repeat(sample(0.0, G, 20.0), 500).collect(),
        ),
    ];
    for (name, samples) in cases {
        let mut state = State::default();
        let actions: Vec<_> = feed(&mut state, 0, repeat(sample(0.0, 0.0, 20.0), 200))
            .into_iter()
            .chain(feed(&mut state, 200, samples.clone()))
            .collect();
        assert!(actions.is_empty(), "{name}: {actions:?}");
        let mut cold = State::default();
        assert!(
            feed(&mut cold, 0, samples).is_empty(),
            "{name}, at start-up"
        );
    }
}

#[test]
fn delta_v_fires_once_a_pulse_on_either_axis() {
    for (x, y, axis) in [(-20.0 * G, 0.0, 0), (0.0, 15.0 * G, 1)] {
        let mut state = State::default();
        feed(&mut state, 0, repeat(sample(0.0, 0.0, 15.0), 300));
        let pulse = repeat(sample(x, y, 15.0), 10).chain(repeat(sample(0.0, 0.0, 0.0), 300));
        let actions = feed(&mut state, 300, pulse);
        assert_eq!(actions.len(), 1, "{actions:?}");
        let (_, Action::Open(fired)) = actions[0] else {
            unreachable!("{actions:?}")
        };
        assert_eq!((fired.kind, fired.source), (TriggerKind::DeltaV, axis));
        // 8 km/h at 20 or 15 g take 11 or 15 ms.
        let after = fired.monotonic_ns - 3_000_000_000;
        assert!((10_000_000..16_000_000).contains(&after), "{after}");
    }
}

#[test]
fn a_slope_is_taken_out_before_the_crash() {
    let slope = G * 0.3;
    let mut state = State::default();
    feed(&mut state, 0, repeat(sample(slope, 0.0, 15.0), 6000));
    // 8 km/h are 0.15 s of 1.51 g; on the slope 1.4 g of deceleration must not fire, 1.7 g must.
    let mut calm = state;
    assert!(
        feed(
            &mut calm,
            6000,
            repeat(sample(slope - 1.4 * G, 0.0, 10.0), 60)
        )
        .is_empty()
    );
    assert_eq!(
        feed(
            &mut state,
            6000,
            repeat(sample(slope - 1.7 * G, 0.0, 10.0), 60)
        )
        .len(),
        1
    );
}

fn peak(time_ns: i64, g: f64) -> Input<'static> {
    Input::Peak(Peak {
        time_ns,
        value: g * G,
        axis: 0,
    })
}

fn run(state: &mut State, input: &Input<'_>) -> Action {
    let (next, action) = state.step(input, &rules());
    *state = next;
    action
}

#[test]
fn a_peak_rearms_after_200_ms_below() {
    let mut state = State::default();
    let ms = 1_000_000;
    assert_eq!(run(&mut state, &peak(1000 * ms, 49.0)), Action::None);
    assert!(matches!(
        run(&mut state, &peak(1001 * ms, 50.0)),
        Action::Open(_)
    ));
    for at in 1002..1100 {
        assert_eq!(run(&mut state, &peak(at * ms, 70.0)), Action::None);
    }
    assert_eq!(
        run(&mut state, &peak(1250 * ms, 60.0)),
        Action::None,
        "150 ms later"
    );
    assert!(matches!(
        run(&mut state, &peak(1500 * ms, 60.0)),
        Action::Mark(_)
    ));
}

#[test]
fn a_can_signal_fires_on_its_edge() {
    let second = 1_000_000_000;
    for (slot, off, on) in [(0, 0.0, 1.0), (1, 0.5, 0.6)] {
        let mut state = State::default();
        let mut set =
            |at: i64, value: f64| run(&mut state, &Input::Can(slot, at * second / 10, value));
        assert_eq!(set(1, on), Action::None, "set from the start is no edge");
        assert_eq!(set(2, off), Action::None);
        assert_eq!(set(3, on), Action::None, "false for too short");
        assert_eq!(set(6, off), Action::None);
        assert!(
            matches!(set(7, on), Action::Open(fired) if fired.kind == TriggerKind::Can && fired.source == slot)
        );
        assert_eq!(set(8, on), Action::None);
    }
}

#[test]
fn impacts_within_5_s_are_one_event_and_extend_it() {
    let mut state = State::default();
    let second = 1_000_000_000;
    assert!(matches!(
        run(&mut state, &Input::Manual(10 * second)),
        Action::Open(_)
    ));
    assert_eq!(state.post_trigger_end(), Some(2001));
    assert!(matches!(
        run(&mut state, &Input::Manual(14 * second)),
        Action::Mark(_)
    ));
    assert_eq!(state.post_trigger_end(), Some(2401));
    assert!(
        matches!(
            run(&mut state, &Input::Manual(20 * second)),
            Action::OpenNext(_)
        ),
        "6 s after the last"
    );
    assert_eq!(state.post_trigger_end(), Some(2401));
    assert!(matches!(
        run(&mut state, &Input::Manual(22 * second)),
        Action::MarkNext(_)
    ));
    let actions = feed(&mut state, 1000, repeat(sample(0.0, 0.0, 0.0), 1500));
    assert_eq!(actions, vec![(2400, Action::Seal { at_rest: true })]);
    assert_eq!(
        state.post_trigger_end(),
        Some(3201),
        "the next event runs on"
    );
    let actions = feed(&mut state, 2500, repeat(sample(0.0, 0.0, 0.0), 1500));
    assert_eq!(actions, vec![(3200, Action::Seal { at_rest: true })]);
    assert!(!state.running());
}

#[test]
fn many_impacts_extend_to_two_minutes_at_most() {
    let mut state = State::default();
    for at in (0..200).step_by(4) {
        run(&mut state, &Input::Manual(i64::from(at) * 1_000_000_000));
    }
    assert_eq!(state.post_trigger_end(), Some(12_000));
}

#[test]
fn the_tail_waits_for_rest_but_not_for_ever() {
    let moving = |k: usize| sample(if k % 20 < 10 { 0.6 } else { -0.6 }, 0.0, 10.0);
    let mut state = State::default();
    run(&mut state, &Input::Manual(0));
    let actions = feed(
        &mut state,
        0,
        (0..1500)
            .map(moving)
            .chain(repeat(sample(0.0, 0.0, 0.0), 500)),
    );
    let [(index, Action::Seal { at_rest: true })] = actions[..] else {
        unreachable!("{actions:?}")
    };
    assert!(
        (1690..=1800).contains(&index),
        "two seconds after the stop: {index}"
    );

    let mut state = State::default();
    run(&mut state, &Input::Manual(0));
    let actions = feed(&mut state, 0, (0..5000).map(moving));
    assert_eq!(
        actions,
        vec![(1000 + MOST_TAIL, Action::Seal { at_rest: false })]
    );
}

#[test]
fn sliding_and_rolling_are_no_rest() {
    let cases = [
        ("wheels turn", sample(0.0, 0.0, 5.0)),
        ("a smooth slide at 0.4 g", sample(-0.4 * G, 0.0, 0.0)),
        (
            "a steady spin",
            Sample {
                rate: [Some(0.0), Some(0.0), Some(0.3)],
                ..sample(0.0, 0.0, 0.0)
            },
        ),
        (
            "no gyro",
            Sample {
                rate: [None; 3],
                ..sample(0.0, 0.0, 0.0)
            },
        ),
    ];
    for (name, sample) in cases {
        let mut state = State::default();
        feed(&mut state, 0, repeat(sample, 500));
        assert!(!state.at_rest(), "{name}");
    }
    let mut state = State::default();
    feed(
        &mut state,
        0,
        repeat(
            Sample {
                wheels: [None; 2],
                ..sample(0.0, 0.0, 0.0)
            },
            500,
        ),
    );
    assert!(
        state.at_rest(),
        "wheels that send nothing do not forbid rest"
    );
}
