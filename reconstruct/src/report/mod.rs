//! The report: words, pictures and figures for a person, and the same for a machine.
//!
//! 1. [`case`]: which record, and in what state it was found.
//! 2. [`number`]: numbers rounded to their uncertainty.
//! 3. [`summary`]: `summary.json`; its JSON Schema is [`SUMMARY_SCHEMA`].
//! 4. [`words`]: the findings as sentences a judge can read.
//! 5. [`svg`], [`axis`], [`labels`]: drawing; [`plan`]: `path.svg`; [`motion`], [`panel`]: `motion.svg`; [`pictures`]: all of them.
//! 6. [`map`]: where the path lies on a road map, in words, a table and a picture.
//! 7. [`page`], [`tables`], [`record_tables`]: `report.html`; [`terminal`]: one screen.

pub mod axis;
pub mod case;
pub(crate) mod finding_tables;
pub mod fixes;
pub(crate) mod impact_tables;
pub mod labels;
pub mod map;
pub(crate) mod map_json;
pub(crate) mod map_picture;
pub mod motion;
pub(crate) mod motion_parts;
pub mod number;
pub mod page;
pub mod panel;
pub mod pictures;
pub mod plan;
pub(crate) mod plan_marks;
pub(crate) mod plan_signs;
pub mod record_tables;
#[cfg(test)]
pub(crate) mod sample_case;
#[cfg(test)]
pub(crate) mod sample_details;
pub mod summary;
pub(crate) mod summary_details;
pub mod svg;
pub mod tables;
pub mod terminal;
pub mod words;

/// JSON Schema (draft 2020-12) of `summary.json`.
pub const SUMMARY_SCHEMA: &str = include_str!("../../summary.schema.json");
