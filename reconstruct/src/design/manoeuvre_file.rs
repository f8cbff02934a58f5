//! A manoeuvre file as written: one struct a table, unknown keys refused.

use serde::Deserialize;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ManoeuvreFile {
    #[serde(default)]
    pub(super) name: Option<String>,
    pub(super) start_kmh: f64,
    #[serde(default)]
    pub(super) speeds: Vec<SpeedEntry>,
    #[serde(default)]
    pub(super) curves: Vec<CurveEntry>,
    #[serde(default = "drive_accel")]
    pub(super) drive_accel_mps2: f64,
    #[serde(default = "drive_decel")]
    pub(super) drive_decel_mps2: f64,
    #[serde(default = "wander")]
    pub(super) wander_mps2: f64,
    #[serde(default = "rest")]
    pub(super) rest_s: f64,
    pub(super) braking: Option<BrakingTable>,
    #[serde(default)]
    pub(super) impacts: Vec<ImpactEntry>,
    #[serde(default)]
    pub(super) slide: SlideTable,
    #[serde(default)]
    pub(super) car: CarTable,
    #[serde(default)]
    pub(super) road: RoadTable,
}

fn drive_accel() -> f64 {
    1.2
}
fn drive_decel() -> f64 {
    1.5
}
fn wander() -> f64 {
    0.15
}
fn rest() -> f64 {
    6.0
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SpeedEntry {
    pub(super) t_s: f64,
    pub(super) kmh: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CurveEntry {
    pub(super) start_m: f64,
    pub(super) length_m: f64,
    pub(super) lateral_mps2: f64,
    #[serde(default = "ramp")]
    pub(super) ramp: f64,
}

fn ramp() -> f64 {
    0.35
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Side {
    Left,
    Right,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BrakingTable {
    pub(super) t_s: f64,
    pub(super) decel_mps2: f64,
    #[serde(default = "braking_slip")]
    pub(super) slip: [f64; 2],
    #[serde(default = "abs_hz")]
    pub(super) abs_hz: [f64; 2],
    #[serde(default = "abs_depth")]
    pub(super) abs_depth: f64,
    pub(super) locked: Option<Side>,
}

fn braking_slip() -> [f64; 2] {
    [0.08, 0.10]
}
fn abs_hz() -> [f64; 2] {
    [8.0, 9.0]
}
fn abs_depth() -> f64 {
    0.5
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ImpactEntry {
    pub(super) t_s: f64,
    pub(super) delta_v_kmh: f64,
    #[serde(default)]
    pub(super) from_deg: f64,
    #[serde(default)]
    pub(super) spin_degps: f64,
    #[serde(default = "duration")]
    pub(super) duration_ms: f64,
}

fn duration() -> f64 {
    90.0
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct SlideTable {
    pub(super) friction_mps2: f64,
    pub(super) spin_decel_degps2: f64,
    pub(super) slope_deg: [f64; 2],
    pub(super) slip: [f64; 2],
    pub(super) locked: Vec<Side>,
}

impl Default for SlideTable {
    fn default() -> Self {
        Self {
            friction_mps2: 5.0,
            spin_decel_degps2: 250.0,
            slope_deg: [0.0; 2],
            slip: [0.05; 2],
            locked: Vec::new(),
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct CarTable {
    #[serde(rename = "track_width_m")]
    pub(super) track_width: f64,
    #[serde(rename = "imu_position_m")]
    pub(super) imu: [f64; 3],
    #[serde(rename = "cg_position_m")]
    pub(super) cg: [f64; 3],
}

impl Default for CarTable {
    fn default() -> Self {
        Self {
            track_width: 1.5,
            imu: [1.5, 0.1, -0.4],
            cg: [1.2, 0.0, -0.55],
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RoadTable {
    pub(super) bank_mean_deg: f64,
    pub(super) bank_sd_deg: f64,
    pub(super) grade_sd_deg: f64,
    pub(super) correlation_m: f64,
}

impl Default for RoadTable {
    fn default() -> Self {
        Self {
            bank_mean_deg: 1.75,
            bank_sd_deg: 0.8,
            grade_sd_deg: 1.2,
            correlation_m: 150.0,
        }
    }
}
