//! Exports: one file a format.
//!
//! 1. [`fixed`]: numbers as text with fixed decimals, and time as ISO 8601.
//! 2. [`trajectory`]: `trajectory.csv`, one row a sample.
//! 3. [`ellipse`]: the confidence ellipse of one instant, and the funnel's outline, the union of all.
//! 4. [`geodesy`]: local north-east metres to WGS 84 latitude and longitude.
//! 5. [`funnel`]: `funnel.geojson`, or `funnel.local.json` where no pose ties the path to the earth.
//! 6. [`compass`]: from the axes of the car at rest to true north.
//! 7. [`samples`], [`candump`]: the record itself in other formats, with its original times.

pub mod candump;
pub mod compass;
pub mod ellipse;
pub mod fixed;
pub mod funnel;
pub mod geodesy;
pub mod samples;
pub mod trajectory;
