//! Recognition of non-design surfaces: what must come out of the reconstruction exactly as it went in.
//!
//! 1. [`recognise`] finds planes and cylinders in the proposal alone and pairs bores, walls and end planes into [`Boss`]es.
//! 2. [`flats`] picks the flat faces with sharp borders, which the part gets exactly plane on request.
//! 3. [`coverage`] tells which faces of a design space given as CAD the proposal still follows.
//!
//! All of them only measure. The CAD stage makes solids of what was found; the pipeline decides which of them are united.

mod bosses;
mod domain;
mod facets;
mod fitting;
mod flats;
mod notches;
mod options;
mod ransac;
mod recognise;

pub use bosses::{Boss, bosses};
pub use domain::{FaceCoverage, coverage, sleeves};
pub use flats::{Flat, Flats, flats};
pub use notches::Notch;
pub use options::{DomainOptions, FlatOptions, RecogniseMode, RecogniseOptions};
pub use ransac::{Candidate, surfaces};
pub use recognise::{Recognised, recognise};
