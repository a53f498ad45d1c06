//! The body that follows grown radii, and the proposal that it is measured against then.

use rayon::prelude::*;

use super::ReconstructOptions;
use super::bodies::Bodies;
use super::error::StageError;
use super::feeding::{keep_free, solid_of};
use super::shape::{Base, Shape};
use crate::edit::{apply_radii, cells_of, grow, grow_by};
use crate::fit::{FitOptions, fit};
use crate::mesh::TriMesh;
use crate::monitor::Monitor;
use crate::remesh::Remeshed;
use crate::skeleton;
use crate::thicken::ThickenedBody;
use crate::voxel::VoxelGrid;

/// A fit follows this much growth at once, voxels: as far as its samples look.
const STEP: f64 = 4.0;
/// Most steps.
const MOST_STEPS: usize = 4;

/// By how much a proposal grows.
#[derive(Debug, Clone, Default)]
pub(super) struct Growth {
    /// Around every point of a shape's skeleton, mm.
    pub(super) skeleton: Vec<f64>,
    /// Besides, around the balls of medial axes.
    pub(super) balls: Vec<Balls>,
}

/// Growth around the balls of a medial axis.
#[derive(Debug, Clone)]
pub(super) struct Balls {
    /// Its triangles, and its curves as triangles without area.
    pub(super) cells: TriMesh,
    /// mm, one a point.
    pub(super) growth: Vec<f64>,
}

impl Growth {
    /// A share of it.
    fn times(&self, share: f64) -> Self {
        let scaled = |values: &[f64]| values.iter().map(|x| share * x).collect();
        let balls = self.balls.iter().map(|balls| Balls {
            cells: balls.cells.clone(),
            growth: scaled(&balls.growth),
        });
        Self {
            skeleton: scaled(&self.skeleton),
            balls: balls.collect(),
        }
    }

    /// The largest change, mm.
    fn most(&self) -> f64 {
        let largest = |values: &[f64]| values.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let balls = self.balls.iter().map(|b| largest(&b.growth));
        largest(&self.skeleton) + balls.sum::<f64>()
    }
}

/// The field that bodies are fitted to, moved by a growth.
pub(super) fn target(base: &Base, shape: &Shape, growth: &Growth) -> VoxelGrid<f32> {
    let cells = cells_of(&shape.skeleton.skeleton);
    let mut layers: Vec<(&TriMesh, &[f64])> = vec![(&cells, &growth.skeleton)];
    layers.extend(growth.balls.iter().map(|b| (&b.cells, &b.growth[..])));
    grow_by(base.target, base.remeshed.solid.mesh(), &layers)
}

/// The shape with new `radii`, fitted to the target with its `growth`; none when its body would cut itself or fold over.
///
/// The growth is taken in equal steps of a few voxels. In each the target moves ([`target`]), every offset of the last fitted
/// body is scaled ([`apply_radii`]), and the scaled body is fitted, which also untangles it.
///
/// # Errors
/// As [`apply_radii`] and [`fit`].
pub(super) fn follow(
    shape: &Shape,
    base: &Base,
    radii: &[f64],
    growth: &Growth,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<Option<Shape>, StageError> {
    let first = &shape.skeleton.skeleton.radii;
    let steps = (growth.most() / (STEP * base.target.spacing)).ceil();
    let steps = (steps as usize).clamp(1, MOST_STEPS);
    let mut now = shape.clone();
    for step in 1..=steps {
        let part = step as f64 / steps as f64;
        let radii = first.iter().zip(radii);
        let grown: Vec<f64> = radii.map(|(r, new)| r + part * (new - r)).collect();
        let target = target(base, shape, &growth.times(part));
        now = fitted(now, grown, &target, base, options, monitor)?;
        if !now.sound() {
            return Ok(None);
        }
    }
    Ok(Some(now))
}

/// One step.
fn fitted(
    now: Shape,
    radii: Vec<f64>,
    target: &VoxelGrid<f32>,
    base: &Base,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<Shape, StageError> {
    let last = &now.fitted;
    let mesh = apply_radii(&last.mesh, &last.body, &now.skeleton.skeleton, &radii)?;
    let body = ThickenedBody {
        mesh,
        ..last.body.clone()
    };
    let mut skeleton = now.skeleton.clone();
    skeleton.skeleton.radii = radii;
    skeleton.stats = skeleton::stats(&skeleton.skeleton);
    let options = FitOptions {
        volume: Some(base.volume(target)),
        // The body that grows was refined before, and starts from where it is.
        refinements: 0,
        starts: 1,
        ..options.fit
    };
    let fitted = fit(&body, &skeleton.skeleton, target, &options, monitor)?;
    Ok(Shape {
        skeleton,
        body,
        fitted,
        ..now
    })
}

/// The whole proposal with the change of the radii of the shape's skeleton: what the finished part is measured against.
///
/// What has thinned of `whole`, and the grown `target` beside: so nothing comes off the bodies that were cut out of the target.
/// The free lengths of their bores stay free.
///
/// # Errors
/// As [`solid_of`].
pub(super) fn reference(
    target: &VoxelGrid<f32>,
    whole: &Remeshed,
    shape: &Shape,
    growth: &Growth,
    bodies: &Bodies,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<Remeshed, StageError> {
    let thinning: Vec<f64> = growth.skeleton.iter().map(|g| g.min(0.0)).collect();
    let cells = cells_of(&shape.skeleton.skeleton);
    let thinned = grow(&whole.field, whole.solid.mesh(), &cells, &thinning);
    let value = |(v, &grown): (usize, &f32)| {
        let [i, j, k] = target.ijk(v);
        grown.max(thinned.sample(&target.centre(i, j, k)) as f32)
    };
    let values = target.values.par_iter().enumerate().map(value).collect();
    let mut field = VoxelGrid {
        values,
        ..target.clone()
    };
    keep_free(&mut field, &bodies.bosses.free);
    Ok(solid_of(field, bodies, options, monitor)?)
}

/// Whether two solids have as many tunnels and shells.
pub(super) fn same_topology(a: &Remeshed, b: &Remeshed) -> bool {
    // Of closed triangles: two for every three edges.
    let euler = |solid: &Remeshed| {
        let mesh = solid.solid.mesh();
        mesh.points.len() as i64 - mesh.triangles.len() as i64 / 2
    };
    a.genus_after == b.genus_after && euler(a) == euler(b)
}
