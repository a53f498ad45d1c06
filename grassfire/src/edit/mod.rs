//! Edits of the fitted body: new radii on the skeleton, and the surface that follows them.

mod grow;
mod radii;

pub use grow::{cells_of, grow};
pub use radii::{EditError, apply_radii};
