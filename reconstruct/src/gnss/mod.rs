//! The raw logs of a satellite receiver and of its inertial sensors, in and out [S00, 6.1 and 6.2].
//!
//! Two text tables share one clock, the on-board unit's: 35 columns of fixes at about 1 Hz and 14 columns of
//! accelerations and rates at 50 Hz. The formats are lists of columns; how the columns are separated is not said,
//! so it is found out.
//!
//! 1. [`layout`]: delimiter, decimal sign and header, told from the first lines.
//! 2. [`rows`]: what a line holds, in SI units and radians.
//! 3. [`read`]: text to rows, with line and column in every complaint.
//! 4. [`notes`]: what is reported of a log and does not stop it: gaps, repeats, disorder, bad fixes.
//! 5. [`write`](mod@write): rows to text, to a fixed number of decimals.
//! 6. [`time`]: UTC and GPS time.

mod columns;
pub mod error;
mod fields;
pub mod layout;
mod lines;
pub mod notes;
pub mod read;
pub mod rows;
pub mod time;
pub mod write;

pub use error::GnssError;
