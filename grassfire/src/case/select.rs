//! Named places for supports and loads.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::faces::{FaceLike, Wanted, chosen, is_colour};
use super::shape::{cylinder, read};
use super::{Case, CaseError, finite, value};
use crate::Vec3;
use crate::io::read_deck_set;
use crate::mesh::{Bvh, TriMesh};
use crate::monitor::Monitor;

/// Tolerances in voxels: the corners of voxels lie beside the true surface.
const RADIAL: f64 = 0.8;
const AXIAL: f64 = 0.6;
const FLAT: f64 = 0.4;

/// Which nodes belong to a place. Without a tolerance (mm) that of the voxels is taken.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Selector {
    /// Near a plane.
    Plane {
        /// A point of the plane.
        point: [f64; 3],
        /// Normal.
        normal: [f64; 3],
        /// Distance, mm.
        tolerance: Option<f64>,
    },
    /// In a cylinder, such as the bore of a bearing.
    Cylinder {
        /// A point of the axis.
        point: [f64; 3],
        /// Direction of the axis.
        axis: [f64; 3],
        /// Radius, mm.
        radius: f64,
        /// Where it begins along the axis from `point`; without: endless.
        from: Option<f64>,
        /// Where it ends.
        to: Option<f64>,
        /// Distance, mm.
        tolerance: Option<f64>,
    },
    /// In a box along the axes.
    Box {
        /// Lower corner.
        min: [f64; 3],
        /// Upper corner.
        max: [f64; 3],
    },
    /// In a ball.
    Sphere {
        /// Centre.
        centre: [f64; 3],
        /// Radius, mm.
        radius: f64,
        /// Distance, mm.
        tolerance: Option<f64>,
    },
    /// The node nearest to a point that touches material.
    Nearest {
        /// The point.
        point: [f64; 3],
    },
    /// All nodes of a non-design body.
    Body {
        /// Its name.
        name: String,
    },
    /// Near the surface in a file.
    File {
        /// Path, relative to the project file.
        path: String,
        /// Distance, mm.
        tolerance: Option<f64>,
    },
    /// Near faces of a STEP file; `grassfire faces FILE` lists them.
    StepFace {
        /// Path, relative to the project file.
        path: String,
        /// Faces that look like these.
        #[serde(default)]
        like: Vec<FaceLike>,
        /// All faces of this name.
        name: Option<String>,
        /// All faces of this colour, such as `#ff8000`.
        colour: Option<String>,
        /// Distance, mm.
        tolerance: Option<f64>,
    },
    /// Near the element faces of a set of an Abaqus or CalculiX deck.
    Deck {
        /// Path, relative to the project file.
        path: String,
        /// Node set, element set or surface.
        set: String,
        /// Distance, mm.
        tolerance: Option<f64>,
    },
    /// In all of some selections.
    All(Vec<String>),
    /// In any of some selections.
    Any(Vec<String>),
    /// Not in a selection.
    Not(String),
}

impl Selector {
    /// Refuses numbers that mean nothing and names that are not there.
    pub(super) fn check(&self, name: &str, case: &Case) -> Result<(), CaseError> {
        let key = format!("select.{name}");
        let direction = |v: &[f64; 3]| {
            if v.iter().all(|&a| a == 0.0) {
                Err(value(&key, "0 0 0", "a direction"))
            } else {
                Ok(())
            }
        };
        match self {
            Self::Plane {
                point,
                normal,
                tolerance,
            } => {
                finite(&key, point.iter().chain(normal).chain(tolerance))?;
                direction(normal)
            }
            Self::Cylinder {
                point,
                axis,
                radius,
                from,
                to,
                tolerance,
            } => {
                let numbers = point.iter().chain(axis).chain([radius]);
                finite(&key, numbers.chain(from).chain(to).chain(tolerance))?;
                direction(axis)
            }
            Self::Box { min, max } => finite(&key, min.iter().chain(max)),
            Self::Sphere {
                centre,
                radius,
                tolerance,
            } => finite(&key, centre.iter().chain([radius]).chain(tolerance)),
            Self::Nearest { point } => finite(&key, point),
            Self::Body { name } => {
                let known: Vec<String> = case.non_design.iter().map(|b| b.name.clone()).collect();
                if known.contains(name) {
                    return Ok(());
                }
                Err(CaseError::Name {
                    key,
                    name: name.clone(),
                    known,
                })
            }
            Self::File { tolerance, .. } | Self::Deck { tolerance, .. } => finite(&key, tolerance),
            Self::StepFace {
                like,
                name,
                colour,
                tolerance,
                ..
            } => {
                finite(&key, tolerance)?;
                if let Some(bad) = colour.as_deref().filter(|c| !is_colour(c)) {
                    return Err(value(
                        &key,
                        format!("{bad:?}"),
                        "a colour such as \"#ff8000\"",
                    ));
                }
                if like.is_empty() && name.is_none() && colour.is_none() {
                    return Err(value(&key, "empty", "like, name or colour of its faces"));
                }
                like.iter().try_for_each(|like| {
                    finite(
                        &key,
                        [&like.area]
                            .into_iter()
                            .chain(&like.middle)
                            .chain(&like.normal),
                    )
                })
            }
            Self::All(names) | Self::Any(names) => {
                names.iter().try_for_each(|n| refer(name, n, &key, case))
            }
            Self::Not(other) => refer(name, other, &key, case),
        }
    }
}

/// A selection may refer to ones that do not refer on: so there are no circles.
fn refer(from: &str, to: &str, key: &str, case: &Case) -> Result<(), CaseError> {
    let composed = matches!(
        case.find(to, key)?,
        Selector::All(_) | Selector::Any(_) | Selector::Not(_)
    );
    if from == to || composed {
        let wanted = "a selection that is not itself made of others";
        return Err(value(key, format!("{to:?}"), wanted));
    }
    Ok(())
}

/// What selections are made on.
pub(super) struct Nodes<'a> {
    pub case: &'a Case,
    pub folder: &'a Path,
    /// Positions: all nodes of a grid, `[z][y][x]`, or points of a surface.
    pub places: Vec<Vec3>,
    /// Length that tolerances are a share of, mm; the edge of a voxel for nodes of a labelled grid.
    pub slack: f64,
    /// Nodes that touch a design or frozen voxel.
    pub active: Vec<bool>,
    /// Nodes that touch a frozen voxel.
    pub frozen: Vec<bool>,
    /// For every non-design body the nodes that touch it.
    pub bodies: Vec<Vec<bool>>,
}

impl Nodes<'_> {
    /// Which nodes a selection holds, by its geometry alone.
    pub fn select(&self, selector: &Selector, monitor: &Monitor) -> Result<Vec<bool>, CaseError> {
        let h = self.slack;
        let each = |test: &dyn Fn(&Vec3) -> bool| self.places.iter().map(test).collect();
        Ok(match selector {
            Selector::Plane {
                point,
                normal,
                tolerance,
            } => {
                let n = Vec3::from(*normal).normalize();
                let limit = tolerance.unwrap_or(FLAT * h);
                each(&|p| (p - Vec3::from(*point)).dot(&n).abs() <= limit)
            }
            Selector::Cylinder {
                point,
                axis,
                radius,
                from,
                to,
                tolerance,
            } => {
                let (radial, axial) = match tolerance {
                    Some(t) => (*t, *t),
                    None => (RADIAL * h, AXIAL * h),
                };
                each(&|p| {
                    let (along, away) = cylinder(point, axis, p);
                    away <= radius + radial
                        && from.is_none_or(|from| along >= from - axial)
                        && to.is_none_or(|to| along <= to + axial)
                })
            }
            Selector::Box { min, max } => {
                each(&|p| (0..3).all(|d| min[d] - 1e-6 * h <= p[d] && p[d] <= max[d] + 1e-6 * h))
            }
            Selector::Sphere {
                centre,
                radius,
                tolerance,
            } => {
                let limit = radius + tolerance.unwrap_or(RADIAL * h);
                each(&|p| (p - Vec3::from(*centre)).norm() <= limit)
            }
            Selector::Nearest { point } => self.nearest(&Vec3::from(*point)),
            Selector::Body { name } => {
                let body = self.case.non_design.iter().position(|b| b.name == *name);
                body.map_or_else(
                    || vec![false; self.places.len()],
                    |b| self.bodies[b].clone(),
                )
            }
            Selector::File { path, tolerance } => {
                let mesh = read(&self.folder.join(path), "select", 1.0, monitor)?;
                self.near(&mesh, tolerance)
            }
            Selector::StepFace {
                path,
                like,
                name,
                colour,
                tolerance,
            } => {
                let wanted = Wanted {
                    like,
                    name: name.as_deref(),
                    colour: colour.as_deref(),
                };
                let mesh = chosen(&self.folder.join(path), "select", wanted)?;
                self.near(&mesh, tolerance)
            }
            Selector::Deck {
                path,
                set,
                tolerance,
            } => {
                let mesh = read_deck_set(&self.folder.join(path), set, monitor)?;
                self.near(&mesh, tolerance)
            }
            Selector::All(names) => self.combine(names, true, |a, b| a && b, monitor)?,
            Selector::Any(names) => self.combine(names, false, |a, b| a || b, monitor)?,
            Selector::Not(name) => {
                let other =
                    self.combine(std::slice::from_ref(name), false, |a, b| a || b, monitor)?;
                other.into_iter().map(|o| !o).collect()
            }
        })
    }

    fn near(&self, mesh: &TriMesh, tolerance: &Option<f64>) -> Vec<bool> {
        let tree = Bvh::new(mesh);
        let limit = tolerance.unwrap_or(RADIAL * self.slack);
        let places = self.places.iter();
        places.map(|p| tree.nearest(p, limit).is_some()).collect()
    }

    fn combine(
        &self,
        names: &[String],
        start: bool,
        join: fn(bool, bool) -> bool,
        monitor: &Monitor,
    ) -> Result<Vec<bool>, CaseError> {
        let mut out = vec![start; self.places.len()];
        for name in names {
            let found = self.select(self.case.find(name, "select")?, monitor)?;
            out.iter_mut()
                .zip(found)
                .for_each(|(o, f)| *o = join(*o, f));
        }
        Ok(out)
    }

    fn nearest(&self, point: &Vec3) -> Vec<bool> {
        let candidates = (0..self.places.len()).filter(|&i| self.active[i]);
        let distance = |i: &usize| (self.places[*i] - point).norm_squared();
        let best = candidates.min_by(|a, b| distance(a).total_cmp(&distance(b)));
        let mut out = vec![false; self.places.len()];
        if let Some(i) = best {
            out[i] = true;
        }
        out
    }
}
