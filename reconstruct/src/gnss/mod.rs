//! Satellite fixes and inertial samples of a road-pricing tag [S00, 3.1], and the filter over both.

pub mod published;
