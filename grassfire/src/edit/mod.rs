//! Edits: a changed skeleton, and the proposal or the body that follows it.

mod copy;
mod delete;
mod draft;
mod envelope;
mod error;
#[cfg(test)]
mod fixtures;
mod grow;
mod list;
mod material;
mod members;
mod places;
mod radii;
mod region;

pub use draft::EditedSkeleton;
pub use error::{EditListError, Refusal};
pub use grow::{cells_of, grow};
pub use list::{Counts, Edit, Edited, check_edits, edit};
pub use material::material;
pub use places::{Plane, Rotation, Stretch};
pub use radii::{EditError, apply_radii};
pub use region::Region;
