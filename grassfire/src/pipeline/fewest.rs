//! `brep.faces = fewest`: the body on a coarser control mesh.

use super::ReconstructOptions;
use super::error::{PipelineError, StageError};
use super::record::Record;
use super::shape::Shape;
use crate::fit::{Fitted, Fold};
use crate::monitor::Monitor;
use crate::spline::{FaceMode, coarsen, jacobians, patches};
use crate::thicken::adopt;

/// Tolerance when none is given, voxels.
const TOLERANCE: f64 = 0.5;

/// The same shape with fewer extraordinary points, within `brep.tolerance` of it; bodies that cut themselves stay as they are.
///
/// # Errors
/// As [`coarsen`]; cancelled.
pub(super) fn fewest(
    record: &mut Record,
    shape: Shape,
    voxel: f64,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<Shape, PipelineError> {
    if options.brep.faces != FaceMode::Fewest || !shape.fitted.self_intersections.is_empty() {
        return Ok(shape);
    }
    record.stage("fewest", || {
        let tolerance = options.brep.tolerance.unwrap_or(TOLERANCE * voxel);
        let coarse = coarsen(&shape.fitted.mesh, tolerance, &options.patches, monitor)?;
        let skeleton = &shape.skeleton.skeleton;
        let mut body = adopt(coarse.mesh.clone(), skeleton)?;
        let of = |i: &u32| *i as usize;
        body.source = coarse
            .kept
            .iter()
            .map(|i| shape.fitted.body.source[of(i)])
            .collect();
        body.foot = coarse
            .kept
            .iter()
            .map(|i| shape.fitted.body.foot[of(i)])
            .collect();
        let surface = patches(&coarse.mesh, &options.patches, monitor)?;
        let folds = jacobians(&surface).into_iter().enumerate();
        let folds = folds.filter(|(_, jacobian)| jacobian.value < options.fit.fold_limit);
        let fold = |(quad, jacobian): (usize, crate::spline::Jacobian)| Fold {
            place: jacobian.place,
            quad: quad as u32,
            value: jacobian.value,
        };
        Ok::<_, StageError>(Shape {
            fitted: Fitted {
                mesh: coarse.mesh,
                body: body.clone(),
                folds: folds.map(fold).collect(),
                ..shape.fitted
            },
            body,
            faces_deviation: Some(coarse.deviation),
            ..shape
        })
    })
}
