//! Where on the map the path lies [S03, 3.3.1].
//!
//! The path is computed in the axes of the car at rest, without a heading. Here it is laid on the centre
//! lines of a road map by a rigid move (north, east, heading), from a rough place of rest.
//!
//! 1. [`roads`]: the file, `GeoJSON` or OpenStreetMap XML.
//! 2. [`network`]: its lines in metres about the rough place, and which of them a point of the path lies on.
//! 3. [`drift`]: points along the path, and how their errors hang together.
//! 4. [`align`]: the best move from one guess, by Gauss-Newton, with its covariance and its evidence.
//! 5. [`search`]: guesses over the whole circle and all roads near; rivals and their probabilities.
//! 6. [`place`]: the whole of it, with a second run on the heading found.

pub mod align;
pub mod drift;
pub(crate) mod geojson;
pub mod network;
pub(crate) mod osm;
pub mod place;
pub mod roads;
pub mod search;
