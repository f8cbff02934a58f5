//! The svartboks recorder: CAN frames in, sealed crash records out.
pub mod axes;
pub mod can;
pub mod candump;
pub mod config;
pub mod dbc;
pub mod error;
pub mod plan;
pub mod signal;
pub mod timeline;
pub mod pace;
pub mod bins;
pub mod sampler;
pub mod imu_stream;
