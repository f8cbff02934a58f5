//! Simulated drives and boxes as logs, for the tests of `gnss analyse`.
#![allow(dead_code, reason = "each test file uses some of it")]

use std::sync::OnceLock;

use reconstruct::gnss::analyse::{Analysis, Logs, Settings, analyse};
use reconstruct::gnss::logs::{self, Axes};
use reconstruct::gnss::rows::{Fix, Motion};
use reconstruct::simulate::city::{self, BoxSheet, CityDrive};

#[derive(Clone)]
pub(crate) struct Made {
    pub(crate) city: CityDrive,
    pub(crate) fixes: Vec<Fix>,
    pub(crate) motions: Vec<Motion>,
    pub(crate) reference: Vec<Fix>,
}

pub(crate) fn made(seed: u64) -> Made {
    let sheet = BoxSheet::default();
    let city = city::drive(seed, 200.0, &sheet).unwrap();
    let (fixes, motions, reference) = logs::rows(&city, &sheet, &Axes::Car);
    Made {
        city,
        fixes,
        motions,
        reference,
    }
}

/// The drives of the testing seeds 90101 to 90140, made once for all tests of a file.
pub(crate) fn drives() -> &'static [Made] {
    static DRIVES: OnceLock<Vec<Made>> = OnceLock::new();
    DRIVES.get_or_init(|| (90_101..90_141).map(made).collect())
}

pub(crate) fn settings() -> Settings {
    Settings::new(Axes::Car, 1.24)
}

/// Line `k + 2`: behind a header.
pub(crate) fn numbered(motions: &[Motion]) -> Vec<(u64, Motion)> {
    (2..).zip(motions.iter().copied()).collect()
}

pub(crate) fn told(fixes: &[Fix], motions: &[Motion], reference: &[Fix]) -> Analysis {
    told_as(fixes, motions, reference, &settings())
}

pub(crate) fn told_as(
    fixes: &[Fix],
    motions: &[Motion],
    reference: &[Fix],
    settings: &Settings,
) -> Analysis {
    let motions = numbered(motions);
    let logs = Logs {
        fixes,
        motions: &motions,
        reference,
    };
    analyse(&logs, settings)
}
