//! `trajectory.csv` (and `sample_paths.csv`): one row a sample in recording order, RFC 4180 (lines end in CR LF), a missing value empty.

use crate::export::fixed::{push, utc};
use crate::findings::details::SamplePaths;
use crate::trajectory::State;

/// The columns in their order. The first 21 are the stable interface; further ones may be added at the end.
pub const COLUMNS: [&str; 30] = [
    "t_s",
    "utc",
    "north_m",
    "east_m",
    "down_m",
    "v_north_mps",
    "v_east_mps",
    "v_down_mps",
    "speed_mps",
    "roll_deg",
    "pitch_deg",
    "heading_deg",
    "yaw_rate_degps",
    "accel_forward_mps2",
    "accel_right_mps2",
    "sd_north_m",
    "sd_east_m",
    "cov_north_east_m2",
    "sd_down_m",
    "sd_speed_mps",
    "sd_heading_deg",
    "ground_speed_mps",
    "sideslip_deg",
    "accel_down_mps2",
    "sd_accel_forward_mps2",
    "sd_accel_right_mps2",
    "sd_yaw_rate_degps",
    "wheels_used",
    "bridged",
    "sample",
];

/// The whole file. Metres, metres a second and degrees with four decimals, the covariance with six.
#[must_use]
pub fn csv(states: &[State]) -> String {
    let mut out = String::with_capacity((states.len() + 1) * 280);
    out.push_str(&COLUMNS.join(","));
    out.push_str("\r\n");
    for state in states {
        row(&mut out, state);
    }
    out
}

/// Columns of `sample_paths.csv`.
pub const PATH_COLUMNS: [&str; 4] = ["path", "t_s", "north_m", "east_m"];

/// Sample paths, one after the other from 1; metres with three decimals.
#[must_use]
pub fn sample_paths(paths: &SamplePaths) -> String {
    let mut out = PATH_COLUMNS.join(",");
    out.push_str("\r\n");
    for (i, path) in paths.places.iter().enumerate() {
        for (t_s, [north, east]) in paths.t_s.iter().zip(path) {
            out.push_str(&(i + 1).to_string());
            for (value, decimals) in [(t_s, 4), (north, 3), (east, 3)] {
                out.push(',');
                push(&mut out, *value, decimals);
            }
            out.push_str("\r\n");
        }
    }
    out
}

fn row(out: &mut String, s: &State) {
    push(out, s.t_s, 4);
    out.push(',');
    if let Some(ns) = s.utc_ns {
        out.push_str(&utc(ns));
    }
    let [north, east, down] = s.position;
    let [v_north, v_east, v_down] = s.velocity;
    let [forward, right, downward] = s.accel;
    let mut field = |value: Option<f64>, decimals: usize| {
        out.push(',');
        if let Some(x) = value {
            push(out, x, decimals);
        }
    };
    for x in [north, east, down, v_north, v_east, v_down, s.speed] {
        field(Some(x), 4);
    }
    field(Some(s.roll.to_degrees()), 4);
    field(Some(s.pitch.to_degrees()), 4);
    field(Some(compass(s.heading)), 4);
    field(s.yaw_rate.map(f64::to_degrees), 4);
    field(forward, 4);
    field(right, 4);
    field(Some(s.sd_north), 4);
    field(Some(s.sd_east), 4);
    field(Some(s.cov_north_east), 6);
    field(Some(s.sd_down), 4);
    field(Some(s.sd_speed), 4);
    field(Some(s.sd_heading.to_degrees()), 4);
    field(Some(s.ground_speed), 4);
    field(s.sideslip.map(f64::to_degrees), 4);
    field(downward, 4);
    let [sd_forward, sd_right] = s.sd_accel;
    field(Some(sd_forward), 4);
    field(Some(sd_right), 4);
    field(Some(s.sd_yaw_rate.to_degrees()), 4);
    field(Some(f64::from(u8::from(s.wheels_used))), 0);
    field(Some(f64::from(u8::from(s.bridged))), 0);
    out.push(',');
    out.push_str(&s.index.to_string());
    out.push_str("\r\n");
}

/// Degrees from 0 to 360 such that four decimals never print 360.
fn compass(heading: f64) -> f64 {
    let degrees = heading.to_degrees().rem_euclid(360.0);
    if degrees >= 359.999_95 { 0.0 } else { degrees }
}

#[cfg(test)]
mod tests {
    use super::{COLUMNS, compass, csv};
    use crate::report::sample_case;

    #[test]
    fn every_row_has_every_column_and_missing_is_empty() {
        let mut states = sample_case::reconstruction().states;
        states[3].utc_ns = None;
        states[3].accel = [None; 3];
        let text = csv(&states);
        let rows: Vec<Vec<&str>> = text.lines().map(|l| l.split(',').collect()).collect();
        assert_eq!(rows.len(), states.len() + 1);
        assert!(rows.iter().all(|r| r.len() == COLUMNS.len()));
        assert_eq!(rows[0][0], "t_s");
        assert_eq!(rows[4][1], "");
        assert_eq!(rows[4][13], "");
        assert!(rows[1][1].ends_with('Z'), "{}", rows[1][1]);
        assert!(!text.contains("NaN") && !text.contains("inf"));
    }

    #[test]
    fn heading_stays_below_360() {
        assert!((compass(-0.1) - (360.0 - 0.1_f64.to_degrees())).abs() < 1e-9);
        assert!(compass(-1e-9).abs() < f64::EPSILON);
    }
}
