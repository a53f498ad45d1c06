//! grassfire turns a topology-optimization result into an editable, checked CAD solid.
//!
//! The data flows through the modules in this order; `pipeline` runs them top to bottom:
//!
//! `io` (read) -> `mesh` (repair) -> `remesh` -> `medial` -> `skeleton` -> `radii` -> `thicken`
//! -> `fit` -> `spline` -> `cad` -> `report`.
//!
//! Lengths are millimetres everywhere in public data, angles degrees in reports and radians in code.

pub mod mesh;
pub mod monitor;
pub mod topology;
pub mod voxel;

pub mod cad;
pub mod case;
pub mod casting;
pub mod edit;
pub mod fe;
pub mod fit;
pub mod io;
pub mod medial;
pub mod non_design;
pub mod pipeline;
pub mod radii;
pub mod remesh;
pub mod report;
pub mod skeleton;
pub mod spline;
pub mod tet;
pub mod thicken;
pub mod topopt;
pub mod verify;

/// A point or a vector in millimetres.
pub type Vec3 = nalgebra::Vector3<f64>;
