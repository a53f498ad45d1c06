//! CAD stage: B-rep -> OpenCASCADE solid, united with the non-design bodies, checked, written as STEP.
//!
//! 1. [`read`] (STEP) or [`from_mesh`] make exact [`NonDesignBody`]s and find their bores.
//! 2. [`build`] makes the body's B-rep directly (shared edges, exact pcurves, no sewing), fuses the non-design bodies with
//!    their bores filled, cuts the bores last, and checks every step with volumes that do not come from the CAD kernel.
//! 3. [`trim`] cuts it plane, [`round_edges`] gives it fillets where that is asked for.
//! 4. [`write_step`], [`write_brep`], [`write_iges`], [`write_pieces`], [`write_casting`] and [`tessellate`] give the files.
//!
//! Without the feature `occt` only the options, the error and the recognition of surfaces in meshes ([`primitives`]) are here.

mod error;
mod options;
pub mod primitives;

#[cfg(feature = "occt")]
mod beside;
#[cfg(feature = "occt")]
mod body;
#[cfg(feature = "occt")]
mod bores;
#[cfg(feature = "occt")]
mod build;
#[cfg(feature = "occt")]
mod casting;
#[cfg(feature = "occt")]
mod faces;
#[cfg(feature = "occt")]
mod fillets;
#[cfg(feature = "occt")]
mod inspect;
#[cfg(feature = "occt")]
mod names;
#[cfg(feature = "occt")]
mod non_design;
#[cfg(feature = "occt")]
mod output;
#[cfg(feature = "occt")]
mod patches;
#[cfg(feature = "occt")]
mod rays;
#[cfg(feature = "occt")]
mod rebuild;
#[cfg(feature = "occt")]
mod reference;
#[cfg(feature = "occt")]
mod shells;
#[cfg(feature = "occt")]
mod split;
#[cfg(feature = "occt")]
mod trim;
#[cfg(feature = "occt")]
mod unite;

pub use error::CadError;
pub use options::{CadOptions, FilletRadius, FilletRule, NonDesignOptions, StepOptions};

#[cfg(feature = "occt")]
pub use {
    bores::Bore,
    build::{CadSolid, FaceSource, Joined, build, finish, join},
    casting::{FeederBody, write_casting},
    faces::{FaceText, read_faces},
    fillets::{Fillet, round_edges},
    inspect::NonDesignResult,
    non_design::{
        DesignSpace, NonDesignBody, Rebuilt, SpaceBore, from_boss, from_mesh, from_shape, read,
        read_design_space, read_surface,
    },
    output::{
        ORGANIC_PIECE, piece_name, tessellate, tessellate_solids, write_brep, write_iges,
        write_pieces, write_step,
    },
    trim::trim,
};

#[cfg(feature = "occt")]
fn array(v: crate::Vec3) -> [f64; 3] {
    v.into()
}

/// The prism from a convex polygon to the same polygon moved by `way`, from where it is seen counter-clockwise.
#[cfg(feature = "occt")]
fn prism(
    polygon: &[crate::Vec3],
    way: crate::Vec3,
) -> Result<grassfire_occt::Shape, grassfire_occt::OcctError> {
    let n = polygon.len() as u32;
    let feet = polygon.iter().map(|p| array(*p));
    let heads = polygon.iter().map(|p| array(p + way));
    let points: Vec<[f64; 3]> = feet.chain(heads).collect();
    let mut triangles = Vec::with_capacity(4 * polygon.len());
    for k in 0..n {
        let next = (k + 1) % n;
        triangles.extend([[k, next, n + next], [k, n + next, n + k]]);
    }
    for k in 2..n {
        triangles.extend([[0, k, k - 1], [n, n + k - 1, n + k]]);
    }
    grassfire_occt::Shape::from_triangles(&points, &triangles)?.unified()
}
