//! The svartboks reconstructor: a sealed record back into what happened, with its uncertainty.

pub mod anchor;
pub mod chain;
pub mod compare;
pub mod constraint;
pub mod dead_reckoning;
pub mod design;
pub mod epochs;
pub mod error;
pub mod error_model;
pub mod export;
pub mod fetch;
pub mod filter;
pub mod findings;
pub mod frame;
pub mod funnel;
pub mod gnss;
pub mod kalman;
pub mod map;
pub mod matrix;
pub mod mechanize;
pub mod motion;
pub mod published;
pub mod refined;
pub mod report;
pub mod rest;
pub mod road;
pub mod run;
mod series;
pub mod simulate;
pub mod smooth;
pub mod start;
pub mod stats;
pub mod trajectory;
pub mod validate;
pub mod wgs84;

pub use error::ReconstructError;
