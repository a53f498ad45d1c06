//! A coarser control mesh with nearly the same surface: fewer extraordinary points, fewer faces.

use std::collections::BTreeSet;

use super::catmull_clark::limit_mesh;
use super::half_edges::connect;
use super::quality::jacobians;
use super::refit::{Target, refit};
use super::strips::take_strip_out;
use super::{ControlMesh, PatchOptions, SplineError, patches};
use crate::mesh::self_intersection::self_intersections;
use crate::mesh::{Bvh, DistanceOptions, TriMesh, two_sided};
use crate::monitor::Monitor;

/// Name of this work in progress.
const STAGE: &str = "fewest";
/// Strips that are tried at most.
const TRIES: usize = 400;
/// A strip may turn by this many tolerances: the fit takes up most of it.
const BEND: f64 = 16.0;
/// Rings of points around a strip that are fitted again.
const RINGS: usize = 2;
/// Strips with more points to fit are left alone: the equations are dense.
const MOST_POINTS: usize = 700;
/// Splits of the control mesh for the distance between two surfaces.
const LEVELS: u32 = 2;

/// A coarser control mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct Coarse {
    /// The mesh.
    pub mesh: ControlMesh,
    /// The number that each of its points had before.
    pub kept: Vec<u32>,
    /// Strips of quads that were taken out.
    pub strips: usize,
    /// Largest distance between the limit surfaces before and after, either way, at samples, mm.
    pub deviation: f64,
}

/// Takes strips of quads out of a control mesh as long as its limit surface stays within `tolerance` mm of the first one.
///
/// 1. Take out the strip that costs least for what it gains; see [`take_strip_out`].
/// 2. Fit the control points around it to the first limit surface again.
/// 3. Keep that when the surfaces are within the tolerance of each other, both ways, and the new one does not cut itself or
///    fold more than the first; else refuse the strip. Go on until no strip is left.
///
/// The faces are made from the coarser mesh just as exactly as from the first, so they are just as smooth.
///
/// # Errors
/// As for [`super::patches`].
pub fn coarsen(
    mesh: &ControlMesh,
    tolerance: f64,
    options: &PatchOptions,
    monitor: &Monitor,
) -> Result<Coarse, SplineError> {
    connect(mesh)?;
    let first = surface(mesh)?;
    let search = Search {
        crossings: self_intersections(&first).len(),
        folds: folds(mesh, options)?,
        target: Target {
            tree: Bvh::new(&first),
            mesh: first,
        },
        tolerance,
        options,
    };
    let (mut current, mut strips, mut deviation) = (mesh.clone(), 0, 0.0);
    let mut refused = BTreeSet::new();
    for round in 0..TRIES {
        monitor.step(STAGE, "coarser meshes", round as f64 / TRIES as f64)?;
        let Some(step) = take_strip_out(&current, &refused, BEND * tolerance)? else {
            break;
        };
        let seeds: Vec<u32> = step.merged.iter().map(|[a, _]| *a).collect();
        match search.accept(step.mesh, &seeds)? {
            Some((mesh, distance)) => {
                (current, deviation) = (mesh, distance);
                strips += 1;
            }
            None => refused.extend(step.merged.iter().map(|[a, b]| [*a.min(b), *a.max(b)])),
        }
    }
    let (mesh, kept) = compact(&current);
    Ok(Coarse {
        mesh,
        kept,
        strips,
        deviation,
    })
}

struct Search<'a> {
    target: Target,
    crossings: usize,
    folds: usize,
    tolerance: f64,
    options: &'a PatchOptions,
}

impl Search<'_> {
    /// The mesh fitted again and its deviation, when it is good enough.
    fn accept(
        &self,
        mut mesh: ControlMesh,
        seeds: &[u32],
    ) -> Result<Option<(ControlMesh, f64)>, SplineError> {
        let free = around(&mesh, seeds);
        if free.len() > MOST_POINTS || refit(&mut mesh, &free, &self.target)? > self.tolerance {
            return Ok(None);
        }
        if folds(&mesh, self.options)? > self.folds {
            return Ok(None);
        }
        let after = surface(&mesh)?;
        let samples = DistanceOptions::default();
        let distance = two_sided(&after, &self.target.mesh, &samples, None).max;
        let near = distance <= self.tolerance;
        let sound = near && self_intersections(&after).len() <= self.crossings;
        Ok(sound.then_some((mesh, distance)))
    }
}

fn surface(mesh: &ControlMesh) -> Result<TriMesh, SplineError> {
    Ok(limit_mesh(mesh, LEVELS)?.0)
}

/// Patches that fold or nearly fold.
fn folds(mesh: &ControlMesh, options: &PatchOptions) -> Result<usize, SplineError> {
    let all = jacobians(&patches(mesh, options, &Monitor::default())?);
    let folded = all.iter().filter(|j| j.value < options.fold_limit);
    Ok(folded.count())
}

/// The seeds and the points within a few rings of quads, ascending.
fn around(mesh: &ControlMesh, seeds: &[u32]) -> Vec<u32> {
    let mut inside = vec![false; mesh.points.len()];
    seeds.iter().for_each(|v| inside[*v as usize] = true);
    for _ in 0..RINGS {
        let touched: Vec<&[u32; 4]> = mesh
            .quads
            .iter()
            .filter(|quad| quad.iter().any(|v| inside[*v as usize]))
            .collect();
        let points = touched.into_iter().flatten();
        points.for_each(|v| inside[*v as usize] = true);
    }
    let all = 0..mesh.points.len() as u32;
    all.filter(|v| inside[*v as usize]).collect()
}

/// The mesh without the points that no quad uses, and the old number of each point.
fn compact(mesh: &ControlMesh) -> (ControlMesh, Vec<u32>) {
    let mut number = vec![u32::MAX; mesh.points.len()];
    let used = mesh.quads.iter().flatten();
    used.for_each(|v| number[*v as usize] = 0);
    let kept: Vec<u32> = (0..number.len() as u32)
        .filter(|v| number[*v as usize] == 0)
        .collect();
    for (new, old) in kept.iter().enumerate() {
        number[*old as usize] = new as u32;
    }
    let quads = mesh.quads.iter();
    let mesh = ControlMesh {
        points: kept.iter().map(|v| mesh.points[*v as usize]).collect(),
        quads: quads.map(|q| q.map(|v| number[v as usize])).collect(),
    };
    (mesh, kept)
}
