//! Edits: a changed skeleton, and the proposal or the body that follows it.

mod bridge;
mod copy;
mod delete;
mod draft;
mod envelope;
mod error;
mod fill;
#[cfg(test)]
mod fixtures;
mod grow;
mod list;
mod material;
mod members;
mod places;
mod radii;
mod region;
mod rims;
mod split;
mod subdivide;
mod weld;

pub use bridge::Between;
pub use draft::EditedSkeleton;
pub use error::{EditListError, Refusal};
pub use grow::{cells_of, grow, grow_by};
pub(crate) use grow::{interpolate, offset};
pub use list::{Counts, Edit, Edited, check_edits, edit};
pub use material::material;
pub use places::{Plane, Rotation, Stretch};
pub use radii::{EditError, apply_radii};
pub use region::Region;
