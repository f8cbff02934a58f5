//! A manoeuvre from a file: what a scenario of the simulator is made of, in the units of a person.

use std::path::Path;

use super::DesignError;
use super::file::{self, Place};
use super::manoeuvre_file::{BrakingTable, CarTable, ManoeuvreFile, RoadTable, Side, SlideTable};
use crate::simulate::scenario::{
    BrakingPlan, Car, Curve, ImpactPlan, Manoeuvre, Road, Scenario, Sideslip, Slide, SpeedTarget,
};
use crate::simulate::{Class, Grade, Pulse};

/// A manoeuvre file as `--example manoeuvre` prints it.
pub const EXAMPLE: &str = include_str!("example_manoeuvre.toml");

/// Longest list of speeds or curves.
const MOST: usize = 200;
/// Latest time of an event, s.
const LATEST_S: f64 = 150.0;

/// A manoeuvre that can be simulated, and what it is called.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Shown above every result.
    pub name: String,
    /// Its motion; the sensors in it are without error.
    pub scenario: Scenario,
}

impl Plan {
    /// A class of the simulator, drawn from a seed.
    #[must_use]
    pub fn drawn(class: Class, seed: u64) -> Self {
        Self {
            name: format!("simulated {class}, seed {seed}"),
            scenario: Scenario::draw_graded(class, seed, Grade::Perfect),
        }
    }

    /// Reads a manoeuvre file; `seed` makes what the file leaves to chance (road, lane keeping, sideslip).
    ///
    /// # Errors
    /// [`DesignError::File`] where the file cannot be read, a key is not known or a value is out of range.
    pub fn load(path: &Path, seed: u64) -> Result<Self, DesignError> {
        let name = path
            .file_stem()
            .map_or_else(|| "manoeuvre".to_owned(), |s| s.to_string_lossy().into());
        Self::parse(&file::read(path)?, &path.display().to_string(), &name, seed)
    }

    /// Reads a manoeuvre from text; `source` is named in errors, `name` is used where the text gives none.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn parse(text: &str, source: &str, name: &str, seed: u64) -> Result<Self, DesignError> {
        let file: ManoeuvreFile = file::decode(text, source)?;
        let at = Place { source };
        let class = if file.impacts.is_empty() {
            Class::Drive
        } else {
            Class::Frontal
        };
        let mut scenario = Scenario::draw_graded(class, seed, Grade::Perfect);
        scenario.car = car(&file.car, &at)?;
        scenario.road = road(&file.road, &at)?;
        scenario.wheel_hz = 50.0;
        scenario.wheel_phase = 0.01;
        scenario.manoeuvre = manoeuvre(&file, &at)?;
        Ok(Self {
            name: at.text("name", file.name.as_deref().unwrap_or(name), 80)?,
            scenario,
        })
    }
}

fn manoeuvre(file: &ManoeuvreFile, at: &Place<'_>) -> Result<Manoeuvre, DesignError> {
    let speeds = speeds(file, at)?;
    let braking = file.braking.as_ref().map(|b| braking(b, at)).transpose()?;
    let impacts = impacts(file, at)?;
    let ends = braking.is_some() || speeds.last().is_some_and(|s| s.speed <= 0.0);
    if impacts.is_empty() && !ends {
        return Err(at.wrong(
            "braking",
            "a braking, an impact or a last speed of 0 km/h that brings the car to rest",
            "none",
        ));
    }
    Ok(Manoeuvre {
        start_speed: at.within("start_kmh", file.start_kmh, 0.0, 300.0)? / 3.6,
        speeds,
        drive_accel: at.within("drive_accel_mps2", file.drive_accel_mps2, 0.1, 10.0)?,
        drive_decel: at.within("drive_decel_mps2", file.drive_decel_mps2, 0.1, 10.0)?,
        curves: curves(file, at)?,
        wander_sd: at.within("wander_mps2", file.wander_mps2, 0.0, 2.0)?,
        sideslip: Sideslip {
            sd: 0.25_f64.to_radians(),
            time: 1.2,
            per_lateral: 0.3_f64.to_radians(),
        },
        braking,
        impacts,
        slide: slide(&file.slide, at)?,
        rollover: None,
        rest: at.within("rest_s", file.rest_s, 1.0, 60.0)?,
        still: None,
    })
}

fn speeds(file: &ManoeuvreFile, at: &Place<'_>) -> Result<Vec<SpeedTarget>, DesignError> {
    at.list("speeds", file.speeds.iter().map(|s| s.t_s), MOST)?;
    file.speeds
        .iter()
        .enumerate()
        .map(|(i, s)| {
            Ok(SpeedTarget {
                t: at.within(&format!("speeds[{i}].t_s"), s.t_s, 0.0, LATEST_S)?,
                speed: at.within(&format!("speeds[{i}].kmh"), s.kmh, 0.0, 300.0)? / 3.6,
            })
        })
        .collect()
}

fn curves(file: &ManoeuvreFile, at: &Place<'_>) -> Result<Vec<Curve>, DesignError> {
    at.list("curves", file.curves.iter().map(|c| c.start_m), MOST)?;
    let mut end = 0.0;
    file.curves
        .iter()
        .enumerate()
        .map(|(i, c)| {
            let key = |name: &str| format!("curves[{i}].{name}");
            let start = at.within(&key("start_m"), c.start_m, end, 20_000.0)?;
            let length = at.within(&key("length_m"), c.length_m, 5.0, 5000.0)?;
            end = start + length;
            Ok(Curve {
                start,
                length,
                ramp: at.within(&key("ramp"), c.ramp, 0.05, 0.5)?,
                lateral: at.within(&key("lateral_mps2"), c.lateral_mps2, -10.0, 10.0)?,
            })
        })
        .collect()
}

fn braking(b: &BrakingTable, at: &Place<'_>) -> Result<BrakingPlan, DesignError> {
    let pair = |key: &str, values: [f64; 2], low: f64, high: f64| {
        let key = format!("braking.{key}");
        Ok::<_, DesignError>([
            at.within(&key, values[0], low, high)?,
            at.within(&key, values[1], low, high)?,
        ])
    };
    Ok(BrakingPlan {
        t: at.within("braking.t_s", b.t_s, 0.0, LATEST_S)?,
        decel: at.within("braking.decel_mps2", b.decel_mps2, 0.5, 12.0)?,
        slip: pair("slip", b.slip, 0.0, 0.5)?,
        abs_hz: pair("abs_hz", b.abs_hz, 1.0, 20.0)?,
        abs_depth: at.within("braking.abs_depth", b.abs_depth, 0.0, 1.0)?,
        lock: b.locked.map(|side| usize::from(side == Side::Right)),
    })
}

fn impacts(file: &ManoeuvreFile, at: &Place<'_>) -> Result<Vec<ImpactPlan>, DesignError> {
    at.list("impacts", file.impacts.iter().map(|i| i.t_s), 2)?;
    file.impacts
        .iter()
        .enumerate()
        .map(|(i, hit)| {
            let key = |name: &str| format!("impacts[{i}].{name}");
            let size = at.within(&key("delta_v_kmh"), hit.delta_v_kmh, 0.0, 200.0)? / 3.6;
            let from = at.within(&key("from_deg"), hit.from_deg, -360.0, 360.0)?;
            let (s, c) = from.to_radians().sin_cos();
            let duration = at.within(&key("duration_ms"), hit.duration_ms, 20.0, 500.0)?;
            Ok(ImpactPlan {
                t: at.within(&key("t_s"), hit.t_s, 1.0, LATEST_S)?,
                delta_v: [-size * c, -size * s],
                spin: at
                    .within(&key("spin_degps"), hit.spin_degps, -1000.0, 1000.0)?
                    .to_radians(),
                kick: [0.0; 2],
                pulse: Pulse {
                    main: 0.75,
                    exponent: 1.5,
                    rebound: 0.1,
                    ripple: 0.15,
                    ripple_hz: 80.0,
                    ..Pulse::half_sine(duration / 1000.0)
                },
            })
        })
        .collect()
}

fn slide(s: &SlideTable, at: &Place<'_>) -> Result<Slide, DesignError> {
    if s.locked.len() > 2 {
        return Err(at.wrong(
            "slide.locked",
            "at most two wheels",
            &s.locked.len().to_string(),
        ));
    }
    for (i, slip) in s.slip.iter().enumerate() {
        at.within(&format!("slide.slip[{i}]"), *slip, 0.0, 1.0)?;
    }
    for (i, slope) in s.slope_deg.iter().enumerate() {
        at.within(&format!("slide.slope_deg[{i}]"), *slope, -20.0, 20.0)?;
    }
    Ok(Slide {
        friction: at.within("slide.friction_mps2", s.friction_mps2, 0.5, 12.0)?,
        spin_decel: at
            .within("slide.spin_decel_degps2", s.spin_decel_degps2, 10.0, 3000.0)?
            .to_radians(),
        slip: s.slip,
        locked: [Side::Left, Side::Right].map(|side| s.locked.contains(&side)),
        slope: s.slope_deg.map(f64::to_radians),
        slope_distance: 12.0,
    })
}

fn car(c: &CarTable, at: &Place<'_>) -> Result<Car, DesignError> {
    for (key, place) in [("car.imu_position_m", c.imu), ("car.cg_position_m", c.cg)] {
        for (axis, x) in place.iter().enumerate() {
            at.within(&format!("{key}[{axis}]"), *x, -10.0, 10.0)?;
        }
    }
    Ok(Car {
        track_width: at.within("car.track_width_m", c.track_width, 0.8, 3.0)?,
        imu_nominal: c.imu,
        imu: c.imu,
        cg_nominal: c.cg,
        cg: c.cg,
        roll_per_lateral: 0.45_f64.to_radians(),
        pitch_per_longitudinal: 0.22_f64.to_radians(),
        spring_hz: 1.5,
        spring_damping: 0.5,
    })
}

fn road(r: &RoadTable, at: &Place<'_>) -> Result<Road, DesignError> {
    let degrees = |key: &str, value: f64, low: f64, high: f64| {
        at.within(&format!("road.{key}"), value, low, high)
            .map(f64::to_radians)
    };
    Ok(Road {
        roll_mean: degrees("bank_mean_deg", r.bank_mean_deg, -4.6, 4.6)?,
        roll_sd: degrees("bank_sd_deg", r.bank_sd_deg, 0.0, 4.0)?,
        roll_limit: 4.6_f64.to_radians(),
        pitch_sd: degrees("grade_sd_deg", r.grade_sd_deg, 0.0, 5.0)?,
        pitch_limit: 5.7_f64.to_radians(),
        correlation: at.within("road.correlation_m", r.correlation_m, 20.0, 5000.0)?,
    })
}

#[cfg(test)]
mod tests {
    use super::{EXAMPLE, Plan};
    use crate::simulate::simulate;

    #[test]
    fn the_example_is_read_and_driven() {
        let plan = Plan::parse(EXAMPLE, "example", "x", 1).unwrap();
        assert_eq!(plan.name, "rural road, oblique impact");
        let facts = simulate(&plan.scenario).unwrap().truth.facts;
        let hit = &facts.impacts[0];
        assert!((hit.cg.resultant_mps * 3.6 - 45.0).abs() < 3.0, "{hit:?}");
        assert!((hit.cg.pdof_deg - 35.0).abs() < 6.0, "{hit:?}");
        assert!(facts.distance_m > 800.0 && facts.rest_t_s > 40.0);
    }

    #[test]
    fn errors_say_where() {
        let cases = [
            ("start_kmh = 80", "braking: expected a braking"),
            (
                "start_kmh = nan\n[braking]\nt_s = 5\ndecel_mps2 = 6",
                "start_kmh: expected 0 to 300, found NaN",
            ),
            ("start_kmh = 80\nspead = 3", "unknown field `spead`"),
            (
                "start_kmh = 80\nspeeds = [{t_s = 5, kmh = 0}, {t_s = 5, kmh = 0}]",
                "speeds[1]: expected a value above the one before it (5), found 5",
            ),
            (
                "{\"start_kmh\": 80, \"impacts\": [{\"t_s\": 40, \"delta_v_kmh\": -1}]}",
                "impacts[0].delta_v_kmh: expected 0 to 200, found -1",
            ),
        ];
        for (text, expected) in cases {
            let found = Plan::parse(text, "m.toml", "x", 1).unwrap_err().to_string();
            assert!(
                found.starts_with("m.toml: ") && found.contains(expected),
                "{found}"
            );
        }
    }
}
