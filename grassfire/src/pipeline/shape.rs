//! From the medial axis to the fitted body and its faces, with another try when a body cuts itself.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::ReconstructOptions;
use super::error::{PipelineError, StageError};
use super::record::Record;
use crate::fit::{Fitted, fit};
use crate::medial::MedialAxis;
use crate::monitor::Monitor;
use crate::radii;
use crate::remesh::{Remeshed, wrap};
use crate::report::Limits;
use crate::skeleton::{self, QuadSkeleton, Skeleton, quad_skeleton};
use crate::spline::{
    self, Brep, ControlMesh, G1Report, SplineError, Tessellation, build_brep, patches, tessellate,
};
use crate::thicken::{self, ThickenedBody, thicken};

/// When to try again with another quad size, and with which.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RetryOptions {
    /// Quad sizes to try in turn, as multiples of `skeleton.size_factor` (or `skeleton.quad_size`), until a body does
    /// not cut itself and follows the proposal within `report.limits`. A skeleton drawn elsewhere is tried once.
    pub quad_sizes: Vec<f64>,
}

impl Default for RetryOptions {
    fn default() -> Self {
        Self {
            quad_sizes: vec![1.0, 0.8, 1.3],
        }
    }
}

/// The quad skeleton, the body thickened from it, and its fit to the proposal.
pub(super) struct Shape {
    pub(super) skeleton: QuadSkeleton,
    pub(super) body: ThickenedBody,
    pub(super) fitted: Fitted,
    /// The body does not come from the skeleton but is wrapped around the proposal.
    pub(super) wrapped: bool,
}

/// The smooth surface of the body.
pub(super) struct Surface {
    pub(super) g1: G1Report,
    pub(super) brep: Brep,
    pub(super) tessellation: Tessellation,
}

/// Skeleton, thickening and fit; the first body that is sound and close enough wins, else the best of all tries.
pub(super) fn shape(
    record: &mut Record,
    axis: &MedialAxis,
    remeshed: &Remeshed,
    drawn: Option<&Skeleton>,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<Shape, PipelineError> {
    let sizes: &[f64] = if drawn.is_some() {
        &[1.0]
    } else {
        &options.retry.quad_sizes
    };
    if sizes.is_empty() {
        return Err(PipelineError {
            stage: "skeleton",
            source: StageError::NoQuadSize,
        });
    }
    let mut best: Option<(Score, Shape)> = None;
    let mut failure = None;
    for (attempt, &size) in sizes.iter().enumerate() {
        let name = format!("try {} (quad size x {size})", attempt + 1);
        match one_shape(record, axis, remeshed, drawn, size, options, monitor) {
            Ok(shape) => {
                let score = Score::of(
                    &shape.fitted,
                    remeshed.field.spacing,
                    &options.report.limits,
                );
                if score.good() {
                    return Ok(shape);
                }
                monitor.warn("fit", format!("{name}: {score}"));
                let hopeless = score.hopeless();
                if best
                    .as_ref()
                    .is_none_or(|(least, _)| score.worse() < least.worse())
                {
                    best = Some((score, shape));
                }
                if hopeless {
                    break;
                }
            }
            Err(error) if error.is_cancelled() => return Err(error),
            Err(error) => {
                monitor.warn(error.stage, format!("{name} failed: {}", error.source));
                failure = Some(error);
            }
        }
    }
    if drawn.is_none() {
        let wrapped = wrapped(record, axis, remeshed, options, monitor)?;
        if let Some((score, shape)) = wrapped.filter(|(score, _)| {
            best.as_ref()
                .is_none_or(|(least, _)| score.worse() < least.worse())
        }) {
            monitor.warn("thicken", format!("the part is too bulky for its skeleton: its body of {} quads is wrapped around the proposal instead, and editing radii does not move it", shape.body.mesh.quads.len()));
            if !score.good() {
                monitor.warn("fit", format!("wrapped body: {score}"));
            }
            return Ok(shape);
        }
    }
    match (best, failure) {
        (Some((_, shape)), _) => Ok(shape),
        (None, Some(error)) => Err(error),
        (None, None) => Err(PipelineError {
            stage: "skeleton",
            source: StageError::NoQuadSize,
        }),
    }
}

/// The last resort for bulky parts: a quad mesh wrapped around the proposal, fitted like a thickened one. The skeleton
/// is still made and delivered; every point of the body belongs to its nearest skeleton point.
fn wrapped(
    record: &mut Record,
    axis: &MedialAxis,
    remeshed: &Remeshed,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<Option<(Score, Shape)>, PipelineError> {
    let skeleton = skeleton_of(record, axis, remeshed, None, 1.0, options, monitor)?;
    let mesh = record.stage("thicken", || {
        wrap(&remeshed.field, axis.solid, &options.wrap, monitor)
    })?;
    let Some(mesh) = mesh else { return Ok(None) };
    let body = record.stage("thicken", || thicken::adopt(mesh, &skeleton.skeleton))?;
    let fitted = record.stage("fit", || {
        fit(
            &body,
            &skeleton.skeleton,
            &remeshed.field,
            &options.fit,
            monitor,
        )
    })?;
    let score = Score::of(&fitted, remeshed.field.spacing, &options.report.limits);
    Ok(Some((
        score,
        Shape {
            skeleton,
            body,
            fitted,
            wrapped: true,
        },
    )))
}

/// How good a fitted body is.
struct Score {
    /// Places where it cuts itself.
    crossings: usize,
    /// Patches whose normal flips over.
    folds: usize,
    /// Distance and volume over their limits, the largest ratio; above 1 a limit is exceeded.
    excess: f64,
}

/// The fit measures on its own samples; the final figures may be a little worse.
const MARGIN: f64 = 0.95;
/// Bodies that miss a limit by more than this factor and cut themselves are given up.
const HOPELESS: f64 = 3.0;

impl Score {
    fn of(fitted: &Fitted, voxel: f64, limits: &Limits) -> Self {
        let both = [&fitted.body_to_iso, &fitted.iso_to_body];
        let rms = both.iter().map(|d| d.rms).fold(0.0, f64::max) / (voxel * limits.distance_rms);
        let p95 = both.iter().map(|d| d.p95).fold(0.0, f64::max) / (voxel * limits.distance_p95);
        let volume = (fitted.volume / fitted.iso_volume - 1.0).abs() / limits.volume;
        Self {
            crossings: fitted.self_intersections.len(),
            folds: flipped(fitted),
            excess: rms.max(p95).max(volume) / MARGIN,
        }
    }

    fn good(&self) -> bool {
        self.crossings + self.folds == 0 && self.excess <= 1.0
    }

    /// So far off that other quad sizes do not help: the part is not made of sheets and members.
    fn hopeless(&self) -> bool {
        self.crossings > 0 && self.excess > HOPELESS
    }

    /// Orders tries: soundness first, then closeness.
    fn worse(&self) -> (usize, usize, f64) {
        (self.crossings, self.folds, self.excess)
    }
}

/// Patches of a fitted body whose normal flips over somewhere.
pub(super) fn flipped(fitted: &Fitted) -> usize {
    fitted.folds.iter().filter(|fold| fold.value < 0.0).count()
}

impl std::fmt::Display for Score {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.crossings {
            0 if self.folds > 0 => write!(f, "{} faces of the body fold over", self.folds),
            0 => write!(
                f,
                "the body misses the proposal by {:.2} times the limits for distance and volume",
                self.excess
            ),
            places => write!(f, "the body cuts itself at {places} places"),
        }
    }
}

fn one_shape(
    record: &mut Record,
    axis: &MedialAxis,
    remeshed: &Remeshed,
    drawn: Option<&Skeleton>,
    size: f64,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<Shape, PipelineError> {
    let skeleton = skeleton_of(record, axis, remeshed, drawn, size, options, monitor)?;
    let body = record.stage("thicken", || {
        thicken(&skeleton.skeleton, &options.thicken, monitor)
    })?;
    let fitted = record.stage("fit", || {
        fit(
            &body,
            &skeleton.skeleton,
            &remeshed.field,
            &options.fit,
            monitor,
        )
    })?;
    Ok(Shape {
        skeleton,
        body,
        fitted,
        wrapped: false,
    })
}

/// The quad skeleton at one quad size, or the one drawn elsewhere, with smooth radii.
fn skeleton_of(
    record: &mut Record,
    axis: &MedialAxis,
    remeshed: &Remeshed,
    drawn: Option<&Skeleton>,
    size: f64,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<QuadSkeleton, PipelineError> {
    let mut skeleton = record.stage("skeleton", || match drawn {
        Some(drawn) => Ok(adopt(drawn, axis)),
        None => {
            let mut sized = options.skeleton.clone();
            sized.size_factor *= size;
            sized.size_least *= size;
            sized.size_most *= size;
            sized.quad_size = sized.quad_size.map(|mm| mm * size);
            quad_skeleton(&axis.mesh, remeshed.field.spacing, &sized, monitor)
        }
    })?;
    radii::smooth(&mut skeleton.skeleton, options.radii.smoothing);
    skeleton.stats = skeleton::stats(&skeleton.skeleton);
    Ok(skeleton)
}

/// Takes a skeleton drawn elsewhere; radii that it does not have come from the medial axis.
fn adopt(drawn: &Skeleton, axis: &MedialAxis) -> QuadSkeleton {
    let mut skeleton = drawn.clone();
    radii::map(&axis.mesh, &mut skeleton);
    QuadSkeleton {
        topology: skeleton::topology(&skeleton),
        stats: skeleton::stats(&skeleton),
        skeleton,
    }
}

/// Patches, B-rep and tessellation of a control mesh.
pub(super) fn surface(
    mesh: &ControlMesh,
    voxel: f64,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<Surface, SplineError> {
    let patches = patches(mesh, &options.patches, monitor)?;
    let g1 = spline::g1_max(mesh, &patches)?;
    let brep = build_brep(mesh, &patches, &options.brep, monitor)?;
    // A tenth of a voxel is well below what any figure of the report resolves.
    let mut fine = options.tessellate;
    fine.chord = fine.chord.min(0.1 * voxel);
    let tessellation = tessellate(mesh, &patches, &fine)?;
    Ok(Surface {
        g1,
        brep,
        tessellation,
    })
}
