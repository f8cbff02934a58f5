//! The 15-state linear filter as published [S00, chapters 2 and 3, program 6.5], for comparison.
//!
//! States: position and velocity in ECEF axes (m, m/s), roll, pitch, yaw (rad), body rates (rad/s), gyro biases
//! (rad/s) [S00, 3.1]; one step per inertial sample at 50 Hz. Body axes: x forward, y right, z down.
//!
//! The text and the program differ, and both slip; [`Variant`] selects, item by item, and [`SLIPS`] tells them.
//! By default everything is as in the program, which made the source's figures.
//!
//! [`mechanise`] makes a velocity from the samples, [`matrices`] are the model, [`Dense`] is the
//! textbook's filter and [`Chains`] the same one without its zeros, [`filter::run`] is the program's loop.

pub mod chains;
pub mod constants;
pub mod dense;
pub mod earth;
pub mod error;
pub mod filter;
pub mod input;
pub mod matrices;
pub mod mechanise;
pub mod options;
pub mod sensor;
pub mod slips;
pub mod step;
pub mod variant;

pub use chains::Chains;
pub use dense::Dense;
pub use error::PublishedError;
pub use filter::run;
pub use input::{GnssFix, ImuSample, Initial, Input};
pub use options::{Engine, Options, SpeedAid, SpeedUse};
pub use slips::{SLIPS, Slip};
pub use step::{Step, Used};
pub use variant::{Reading, Source, Variant};
