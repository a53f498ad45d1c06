//! Shapes of spaces and bodies: a few simple solids, and files.

use std::path::Path;

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{CaseError, finite, value};
use crate::Vec3;
use crate::io::{self, Input, IoError, ReadOptions};
use crate::mesh::{Bvh, RepairOptions, TriMesh, Winding, repair};
use crate::monitor::Monitor;

/// A solid shape, mm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Shape {
    /// A box along the axes.
    Box {
        /// Lower corner.
        min: [f64; 3],
        /// Upper corner.
        max: [f64; 3],
    },
    /// A cylinder.
    Cylinder {
        /// A point of the axis.
        point: [f64; 3],
        /// Direction of the axis.
        axis: [f64; 3],
        /// Radius.
        radius: f64,
        /// Where it begins along the axis from `point`; without: endless.
        from: Option<f64>,
        /// Where it ends.
        to: Option<f64>,
    },
    /// A ball.
    Sphere {
        /// Centre.
        centre: [f64; 3],
        /// Radius.
        radius: f64,
    },
    /// A polygon in x and y, extruded along z.
    Extrude {
        /// Corners in order.
        polygon: Vec<[f64; 2]>,
        /// Lower z.
        from: f64,
        /// Upper z.
        to: f64,
    },
    /// A closed mesh (STL, OBJ, PLY, OFF, 3MF) or STEP solids.
    File {
        /// Path, relative to the project file.
        path: String,
        /// Millimetres per unit of the file.
        #[serde(default = "one")]
        scale: f64,
    },
}

fn one() -> f64 {
    1.0
}

impl Shape {
    /// Refuses numbers that mean nothing.
    pub(super) fn check(&self, key: &str) -> Result<(), CaseError> {
        match self {
            Self::Box { min, max } => {
                finite(key, min.iter().chain(max))?;
                if (0..3).any(|d| min[d] >= max[d]) {
                    return Err(value(
                        key,
                        format!("{min:?} to {max:?}"),
                        "a lower and an upper corner",
                    ));
                }
            }
            Self::Cylinder {
                point,
                axis,
                radius,
                from,
                to,
            } => {
                finite(key, point.iter().chain(axis).chain(from).chain(to))?;
                if axis.iter().all(|&a| a == 0.0) {
                    return Err(value(key, "axis 0 0 0", "a direction"));
                }
                if !(radius.is_finite() && *radius > 0.0) {
                    return Err(value(key, radius, "a positive radius"));
                }
                if from.zip(*to).is_some_and(|(from, to)| from >= to) {
                    return Err(value(key, format!("{from:?} to {to:?}"), "from below to"));
                }
            }
            Self::Sphere { centre, radius } => {
                finite(key, centre)?;
                if !(radius.is_finite() && *radius > 0.0) {
                    return Err(value(key, radius, "a positive radius"));
                }
            }
            Self::Extrude { polygon, from, to } => {
                finite(key, polygon.iter().flatten().chain([from, to]))?;
                if polygon.len() < 3 {
                    return Err(value(
                        key,
                        format!("{} corners", polygon.len()),
                        "3 or more",
                    ));
                }
                if from >= to {
                    return Err(value(key, format!("{from} to {to}"), "from below to"));
                }
            }
            Self::File { path, scale } => {
                if path.is_empty() || !(scale.is_finite() && *scale > 0.0) {
                    return Err(value(
                        key,
                        format!("{path:?} scale {scale}"),
                        "a path and a positive scale",
                    ));
                }
            }
        }
        Ok(())
    }
}

/// A shape ready for questions.
pub(super) enum Solid {
    Simple(Shape),
    Mesh(Bvh),
}

impl Solid {
    /// Reads the shape's file, if it has one. `key` stands in messages.
    pub fn load(
        shape: &Shape,
        key: &str,
        folder: &Path,
        monitor: &Monitor,
    ) -> Result<Self, CaseError> {
        match shape {
            Shape::File { path, scale } => {
                let mesh = read(&folder.join(path), key, *scale, monitor)?;
                Ok(Self::Mesh(Bvh::new(&mesh)))
            }
            simple => Ok(Self::Simple(simple.clone())),
        }
    }

    /// [`Solid::load`] for a list of shapes.
    pub fn load_all(
        shapes: &[Shape],
        key: &str,
        folder: &Path,
        monitor: &Monitor,
    ) -> Result<Vec<Self>, CaseError> {
        let each = shapes.iter().enumerate();
        each.map(|(i, shape)| Self::load(shape, &format!("{key}[{i}]"), folder, monitor))
            .collect()
    }

    /// Lower and upper corner; none when it has no end.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        match self {
            Self::Mesh(bvh) => bvh.bounds(),
            Self::Simple(shape) => bounds(shape),
        }
    }

    /// Which points lie inside, in order.
    pub fn contains(&self, points: &[Vec3]) -> Vec<bool> {
        match self {
            Self::Simple(shape) => points.par_iter().map(|p| inside(shape, p)).collect(),
            Self::Mesh(bvh) => {
                let winding = Winding::new(bvh);
                let Some((lo, hi)) = bvh.bounds() else {
                    return vec![false; points.len()];
                };
                let within = |p: &Vec3| (0..3).all(|d| lo[d] <= p[d] && p[d] <= hi[d]);
                points
                    .par_iter()
                    .with_min_len(256)
                    .map(|p| within(p) && winding.at(p) > 0.5)
                    .collect()
            }
        }
    }
}

/// Which of `points` lie in a list of shapes.
pub(super) fn any(solids: &[Solid], points: &[Vec3]) -> Vec<bool> {
    let mut out = vec![false; points.len()];
    for solid in solids {
        let found = solid.contains(points);
        out.iter_mut().zip(found).for_each(|(o, f)| *o |= f);
    }
    out
}

fn bounds(shape: &Shape) -> Option<(Vec3, Vec3)> {
    match shape {
        Shape::Box { min, max } => Some((Vec3::from(*min), Vec3::from(*max))),
        Shape::Sphere { centre, radius } => {
            let c = Vec3::from(*centre);
            Some((c - Vec3::repeat(*radius), c + Vec3::repeat(*radius)))
        }
        Shape::Extrude { polygon, from, to } => {
            let over = |pick: fn(f64, f64) -> f64, start: f64, d: usize| {
                polygon.iter().fold(start, |m, p| pick(m, p[d]))
            };
            let low = [0, 1].map(|d| over(f64::min, f64::INFINITY, d));
            let high = [0, 1].map(|d| over(f64::max, f64::NEG_INFINITY, d));
            Some((
                Vec3::new(low[0], low[1], *from),
                Vec3::new(high[0], high[1], *to),
            ))
        }
        Shape::Cylinder {
            point,
            axis,
            radius,
            from,
            to,
        } => {
            let a = Vec3::from(*axis).normalize();
            let p = Vec3::from(*point);
            let (one, other) = (p + a * (*from)?, p + a * (*to)?);
            let reach = a.map(|c| radius * (1.0 - c * c).max(0.0).sqrt());
            Some((one.inf(&other) - reach, one.sup(&other) + reach))
        }
        Shape::File { .. } => None,
    }
}

fn inside(shape: &Shape, p: &Vec3) -> bool {
    match shape {
        Shape::Box { min, max } => (0..3).all(|d| min[d] <= p[d] && p[d] <= max[d]),
        Shape::Sphere { centre, radius } => (p - Vec3::from(*centre)).norm() <= *radius,
        Shape::Extrude { polygon, from, to } => {
            (*from..=*to).contains(&p.z) && in_polygon(polygon, p.x, p.y)
        }
        Shape::Cylinder {
            point,
            axis,
            radius,
            from,
            to,
        } => {
            let (along, away) = cylinder(point, axis, p);
            away <= *radius
                && from.is_none_or(|from| from <= along)
                && to.is_none_or(|to| along <= to)
        }
        Shape::File { .. } => false,
    }
}

/// Position along an axis and distance from it.
pub(super) fn cylinder(point: &[f64; 3], axis: &[f64; 3], p: &Vec3) -> (f64, f64) {
    let a = Vec3::from(*axis).normalize();
    let r = p - Vec3::from(*point);
    let along = r.dot(&a);
    (along, (r - a * along).norm())
}

/// Even-odd rule.
fn in_polygon(polygon: &[[f64; 2]], x: f64, y: f64) -> bool {
    let mut inside = false;
    let mut b = polygon.len() - 1;
    for a in 0..polygon.len() {
        let ([ax, ay], [bx, by]) = (polygon[a], polygon[b]);
        if (ay > y) != (by > y) && x < (bx - ax) * (y - ay) / (by - ay) + ax {
            inside = !inside;
        }
        b = a;
    }
    inside
}

/// A closed surface from a file.
pub(super) fn read(
    path: &Path,
    key: &str,
    scale: f64,
    monitor: &Monitor,
) -> Result<TriMesh, CaseError> {
    let name = path.display().to_string();
    let options = ReadOptions {
        scale,
        ..ReadOptions::default()
    };
    let not_solid = |what: String| CaseError::NotSolid {
        key: key.to_owned(),
        path: name.clone(),
        what,
    };
    let input = io::read_input(path, &options, monitor).map_err(|source| match source {
        IoError::Open { .. } => CaseError::MissingFile {
            key: key.to_owned(),
            path: name.clone(),
            source: Box::new(source),
        },
        other => CaseError::Io(other),
    })?;
    match input {
        Input::Mesh { mesh, .. } => {
            let repaired = repair(mesh, &RepairOptions::default(), monitor)
                .map_err(|e| not_solid(e.to_string()))?;
            Ok(repaired.mesh)
        }
        Input::Density { .. } => Err(not_solid("it holds densities".into())),
        Input::Step(path) => step(&path, key, scale, monitor),
    }
}

/// The triangles of the solids of a STEP file.
#[cfg(feature = "occt")]
fn step(path: &Path, _key: &str, scale: f64, monitor: &Monitor) -> Result<TriMesh, CaseError> {
    /// Chord (mm) and facet angle (radians).
    const FINE: (f64, f64) = (0.02, 0.2);
    let options = crate::cad::NonDesignOptions::default();
    let mut mesh = crate::cad::read_surface(path, FINE, &options, monitor)?;
    mesh.points.iter_mut().for_each(|p| *p *= scale);
    Ok(mesh)
}

#[cfg(not(feature = "occt"))]
fn step(path: &Path, key: &str, _scale: f64, _monitor: &Monitor) -> Result<TriMesh, CaseError> {
    Err(CaseError::NoKernel {
        key: key.to_owned(),
        path: path.display().to_string(),
    })
}
