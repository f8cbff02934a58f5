//! The second seed: satellite fixes and inertial samples of a box behind the windscreen S00.
//!
//! The raw logs [S00, 6.1 and 6.2], two text tables on one clock, the on-board unit's: 35 columns of fixes at about 1 Hz and
//! 14 columns of accelerations and rates at 50 Hz. The formats are lists of columns; how the columns are separated is not
//! said, so it is found out.
//!
//! 1. [`layout`]: delimiter, decimal sign and header, told from the first lines.
//! 2. [`rows`]: what a line holds, in SI units and radians.
//! 3. [`read`]: text to rows, with line and column in every complaint.
//! 4. [`notes`]: what is reported of a log and does not stop it: gaps, repeats, disorder, bad fixes.
//! 5. [`write`](mod@write): rows to text, to a fixed number of decimals.
//! 6. [`time`]: UTC and GPS time.
//!
//! What is made of them:
//!
//! 7. [`published`]: the filter of S00, with its faults; the point of comparison.
//! 8. [`drive`]: the same input as our filter takes it, [`sheet`]: what it takes for granted, [`stop`]: does the car stand.
//! 9. [`logs`]: rows to either filter, and a simulated drive to rows.
//! 10. [`forward`]: our filter, the refined model's states and rows forwards in time; [`smooth`]: every instant from all data.
//! 11. [`reference`](mod@reference): how far a track is from a reference receiver, [`stands`]: how often a stop detector is wrong.
//! 12. [`trial`]: fixes withheld as in S00; [`experiments`] on simulated drives, [`outages`] on logs; [`pictures`] of all.
//! 13. [`plausible`]: can the logs be what they are taken for, units, axes and signs; [`clocks`]: do they run on one.
//! 14. [`analyse`]: what the logs tell of receiver and sensors, chapter 4 of S00 for any log.

pub mod analyse;
pub mod clocks;
mod columns;
pub mod drive;
pub mod error;
pub mod experiments;
mod fields;
pub mod forward;
pub mod layout;
mod lines;
pub mod logs;
pub mod notes;
pub mod outages;
pub mod pictures;
pub mod plausible;
pub mod published;
pub mod read;
pub mod reference;
pub mod rows;
pub mod sheet;
pub mod smooth;
pub mod stands;
pub mod stop;
pub mod time;
pub mod trial;
pub mod unproven;
pub mod write;

pub use error::GnssError;
