//! Edits: new radii on the skeleton, and the proposal or the body that follows them.

mod grow;
mod list;
mod radii;

pub use grow::{cells_of, grow};
pub use list::{EditListError, RadiusEdit, RadiusEdited, Region, check_edits, edit_radii};
pub use radii::{EditError, apply_radii};
