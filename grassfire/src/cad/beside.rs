//! What stands beside the body in a union: non-design bodies and the tools that keep their bores free.

use grassfire_occt::{OcctError, Operation, Shape};

use super::CadOptions;
use super::bores::{self, Bore};
use super::non_design::NonDesignBody;
use crate::Vec3;
use crate::spline::{Brep, BrepFace};

pub(super) fn side_by_side(body: &Shape, bodies: &[NonDesignBody]) -> Result<Shape, OcctError> {
    Shape::compound(std::iter::once(body).chain(bodies.iter().map(|b| &b.solid)))
}

/// The bores of each body, kept free only as far as no other non-design body is in the way.
pub(super) fn free_bores(bodies: &[NonDesignBody]) -> Result<Vec<Vec<Bore>>, OcctError> {
    let solids: Vec<&Shape> = bodies.iter().map(|b| &b.solid).collect();
    let free = |bore: &Bore| {
        let mut bore = bore.clone();
        let factor = bore.extension[0].max(bore.extension[1]) / bore.radius;
        bores::extend(&mut bore, factor, &solids)?;
        Ok(bore)
    };
    bodies
        .iter()
        .map(|b| b.bores.iter().map(free).collect())
        .collect()
}

pub(super) fn tool(bores: &[Bore]) -> Result<Option<Shape>, OcctError> {
    let tools: Vec<Shape> = bores.iter().map(Bore::tool).collect::<Result<_, _>>()?;
    if tools.is_empty() {
        Ok(None)
    } else {
        Shape::compound(&tools).map(Some)
    }
}

/// One compound of solids that do not overlap: those whose boxes meet are fused first, so that volumes add up.
pub(super) fn disjoint<'a>(
    shapes: impl Iterator<Item = &'a Shape>,
    options: &CadOptions,
) -> Result<Option<Shape>, OcctError> {
    let mut groups: Vec<(Shape, [[f64; 3]; 2])> = Vec::new();
    for shape in shapes {
        for solid in shape.solids()? {
            let mut merged = solid;
            let mut bounds = merged.bounds()?;
            while let Some(k) = groups.iter().position(|(_, other)| {
                (0..3).all(|d| other[0][d] <= bounds[1][d] && bounds[0][d] <= other[1][d])
            }) {
                let (other, _) = groups.remove(k);
                merged = other
                    .boolean(Operation::Fuse, &merged, options.fuzzy, false, &|| false)?
                    .shape;
                bounds = merged.bounds()?;
            }
            groups.push((merged, bounds));
        }
    }
    if groups.is_empty() {
        Ok(None)
    } else {
        Shape::compound(groups.iter().map(|(s, _)| s)).map(Some)
    }
}

/// Faces whose control points come near a non-design body or its tools.
pub(super) fn near(
    brep: &Brep,
    bodies: &[NonDesignBody],
    tools: &[Option<Shape>],
) -> Result<Vec<bool>, OcctError> {
    let margin = Vec3::repeat(0.5);
    let shapes = bodies.iter().map(|b| &b.boss).chain(tools.iter().flatten());
    let boxes: Vec<(Vec3, Vec3)> = shapes
        .map(|s| {
            s.bounds()
                .map(|[lo, hi]| (Vec3::from(lo) - margin, Vec3::from(hi) + margin))
        })
        .collect::<Result<_, _>>()?;
    let meets = |face: &BrepFace| {
        let first = face.control[0];
        let (lo, hi) = face
            .control
            .iter()
            .fold((first, first), |(lo, hi), p| (lo.inf(p), hi.sup(p)));
        boxes
            .iter()
            .any(|(a, b)| (0..3).all(|d| a[d] <= hi[d] && lo[d] <= b[d]))
    };
    Ok(brep.faces.iter().map(meets).collect())
}
