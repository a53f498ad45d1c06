//! From the medial axis to the fitted body and its faces, with another try when a body cuts itself.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::ReconstructOptions;
use super::error::{PipelineError, StageError};
use super::record::Record;
use super::score::{Best, FINE, MANY, Score, next_size};
use super::steady::SteadyLimits;
use crate::fit::{FitOptions, Fitted, fit, volume};
use crate::medial::MedialAxis;
use crate::monitor::Monitor;
use crate::radii;
use crate::remesh::{Remeshed, WrapOptions, wrap};
use crate::skeleton::{self, Layout, QuadSkeleton, Skeleton, quad_skeleton};
use crate::spline::{
    self, Brep, ControlMesh, CurvatureJump, G1Report, SplineError, Tessellation, build_brep,
    patches, tessellate,
};
use crate::thicken::{self, ThickenedBody, thicken};
use crate::topology::Betti;
use crate::voxel::VoxelGrid;

/// Bodies of a regular layout with more quads get but one start of the fit, if any, and take longest: noise and bulk mostly.
const MOST_QUADS: usize = 2000;

/// When to try again with another quad size, and with which.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RetryOptions {
    /// Quad sizes to try in turn, as multiples of `skeleton.size_factor` (or `skeleton.quad_size`), until a body does
    /// not cut itself and follows the proposal within `report.limits`. After a body that cuts itself sizes above 1 come
    /// first. A skeleton drawn elsewhere is tried once.
    pub quad_sizes: Vec<f64>,
    /// A body is close enough when it is within this distance of the proposal (rms, 95 % within twice that), voxels; else finer
    /// quads are tried, and the closest body is kept.
    pub close: f64,
    /// Limits of the skeleton for the first try, with the regular layout; it is given up like that one, and the limits in `medial` and
    /// `skeleton` are used. None leaves it out, and so do other than the default limits there.
    pub steady: Option<SteadyLimits>,
    /// When the body of these is close on the whole, but not at some place, they are tried once more on a design part that keeps the tips of wedges beside non-design
    /// bodies: `cut_out.wedge` for that, voxels. None leaves it out.
    pub wedge: Option<f64>,
}

impl Default for RetryOptions {
    fn default() -> Self {
        Self {
            quad_sizes: vec![1.0, 0.8, 1.3, 0.65],
            close: 0.22,
            steady: Some(SteadyLimits::default()),
            wedge: Some(0.3),
        }
    }
}

/// The quad skeleton, the body thickened from it, and its fit to the proposal.
#[derive(Clone)]
pub(super) struct Shape {
    pub(super) skeleton: QuadSkeleton,
    /// The layout of its quads.
    pub(super) layout: Layout,
    /// Why the regular layout was given up, if it was.
    pub(super) regular_refused: Option<String>,
    pub(super) body: ThickenedBody,
    pub(super) fitted: Fitted,
    /// The body does not come from the skeleton but is wrapped around the proposal.
    pub(super) wrapped: bool,
    /// How far the surface moved for the sake of fewer faces, mm; none when that was not asked for.
    pub(super) faces_deviation: Option<f64>,
}

/// The smooth surface of the body.
pub(super) struct Surface {
    pub(super) g1: G1Report,
    pub(super) curvature: CurvatureJump,
    pub(super) brep: Brep,
    pub(super) tessellation: Tessellation,
}

/// What is made into a body: the design part or the whole proposal.
#[derive(Clone, Copy)]
pub(super) struct Base<'a> {
    pub(super) remeshed: &'a Remeshed,
    /// The field that bodies are fitted to.
    pub(super) target: &'a VoxelGrid<f32>,
    /// The same of a finer remesh, on which the body settles in the end.
    pub(super) fine: Option<(&'a Remeshed, &'a VoxelGrid<f32>)>,
    /// The topology of the union, when non-design bodies were cut out.
    pub(super) united: Option<Betti>,
    /// What cutting them out took that they do not give back, mm3.
    pub(super) lost: f64,
}

impl Base<'_> {
    /// Volume of what bodies are fitted to, mm3: that of the surface, whose edges are sharper than those of its field, what
    /// `target` has more, and what is lost beside non-design bodies: spread over the whole surface it is a hundredth of a voxel.
    pub(super) fn volume(&self, target: &VoxelGrid<f32>) -> f64 {
        self.volume_of(self.remeshed, target)
    }

    /// That of the finer remesh.
    pub(super) fn fine_volume(&self) -> Option<f64> {
        let (remeshed, target) = self.fine?;
        Some(self.volume_of(remeshed, target))
    }

    fn volume_of(&self, remeshed: &Remeshed, target: &VoxelGrid<f32>) -> f64 {
        let more = volume(target) - volume(&remeshed.field);
        remeshed.solid.volume() + more + self.lost
    }
}

/// A shape with its score, or why there is none.
pub(super) type Tried = Result<(Score, Shape), PipelineError>;

/// What every try starts from.
struct Workshop<'a> {
    record: &'a mut Record,
    axis: &'a MedialAxis,
    base: &'a Base<'a>,
    /// A skeleton drawn elsewhere.
    drawn: Option<&'a Skeleton>,
    layout: Layout,
    options: &'a ReconstructOptions,
    monitor: &'a Monitor,
}

/// Skeleton, thickening and fit. Of [`Layout::Auto`] the regular layout comes first, once; its body is taken when it is close, or
/// not farther than the one that comes of the plain layout. Of one layout the first body that is sound and close enough
/// wins, else the best of all tries. When none is sound, or all are far off, the body is wrapped around the proposal
/// instead, but never around a design part: there the whole proposal is tried before.
pub(super) fn shape(
    record: &mut Record,
    axis: &MedialAxis,
    base: &Base,
    drawn: Option<&Skeleton>,
    layout: Layout,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Tried {
    let mut workshop = Workshop {
        record,
        axis,
        base,
        drawn,
        layout,
        options,
        monitor,
    };
    let tried = workshop.layouts();
    let finished = match &tried {
        Ok((score, _)) => score.usable(),
        Err(error) => error.is_cancelled() || options.retry.quad_sizes.is_empty(),
    };
    if finished || drawn.is_some() || base.united.is_some() {
        return tried;
    }
    let first = tried.as_ref().ok().map(|(_, shape)| shape);
    let refused = first.and_then(|shape| shape.regular_refused.clone());
    if let Some((score, shape)) = workshop.wrapped(first.map(|shape| shape.skeleton.clone()))? {
        let best = tried.as_ref().ok();
        if best.is_none_or(|(least, _)| score.worse() < least.worse()) {
            let quads = shape.body.mesh.quads.len();
            monitor.warn("thicken", format!("the part is too bulky for its skeleton: its body of {quads} quads is wrapped around the proposal instead, and editing radii does not move it"));
            if !score.good() {
                monitor.warn("fit", format!("wrapped body: {score}"));
            }
            let shape = Shape {
                regular_refused: refused,
                ..shape
            };
            return Ok((score, shape));
        }
    }
    tried
}

/// The regular layout on a skeleton of the steady limits in `options`, whose medial axis `axis` is.
pub(super) fn first(
    record: &mut Record,
    axis: &MedialAxis,
    base: &Base,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Tried {
    let size = options.retry.quad_sizes.first().copied().unwrap_or(1.0);
    let mut workshop = Workshop {
        record,
        axis,
        base,
        drawn: None,
        layout: Layout::Regular,
        options,
        monitor,
    };
    workshop.regular(size)
}

/// Why the first of two shapes is not taken instead of the second.
pub(super) fn refusal(first: &Tried, second: &Tried, close: f64) -> Option<String> {
    match (first, second) {
        (Err(error), _) => Some(error.source.to_string()),
        (Ok((first, _)), Ok((second, other))) if !other.wrapped => first.refused_for(second, close),
        (Ok((first, _)), _) => (!first.good()).then(|| first.to_string()),
    }
}

/// Why the first of two shapes, of steady limits and not near the proposal, is not taken instead of the second, of the usual ones.
pub(super) fn steady_refusal(first: &Tried, second: &Tried, close: f64) -> Option<String> {
    let sheets = |tried: &Tried| tried.as_ref().is_ok_and(|(_, shape)| shape.has_sheets());
    if sheets(second) && !sheets(first) {
        // A plate whose holes leave narrow strips would be a frame of beams.
        return Some("no sheet of the part is left".to_owned());
    }
    // Fewer faces are not worth a place that is far off where the usual limits give a good body.
    let good = second
        .as_ref()
        .is_ok_and(|(score, shape)| score.good() && !shape.wrapped);
    let far = first.as_ref().ok().filter(|_| good);
    refusal(first, second, close).or(far.map(|(score, _)| score.distances()))
}

impl Workshop<'_> {
    /// The shape of the regular layout when that is good enough, else of the plain one.
    fn layouts(&mut self) -> Tried {
        let first = self.options.retry.quad_sizes.first();
        let Some(&size) = first.filter(|_| self.layout == Layout::Auto && self.drawn.is_none())
        else {
            return self.tries();
        };
        let (close, told) = (self.options.retry.close, self.monitor.warnings().len());
        self.layout = Layout::Regular;
        let regular = self.regular(size);
        self.layout = Layout::Plain;
        match &regular {
            Ok((score, _)) if score.close(close) => return regular,
            Err(error) if error.is_cancelled() => return regular,
            _ => {}
        }
        // What went wrong is said once, in the reason.
        self.monitor.keep_warnings(told);
        let plain = self.tries();
        if plain.as_ref().is_err_and(PipelineError::is_cancelled) {
            return plain;
        }
        let refused = refusal(&regular, &plain, close);
        if refused.is_none() {
            self.monitor.keep_warnings(told);
            return regular;
        }
        plain.map(|(score, shape)| {
            let shape = Shape {
                regular_refused: refused,
                ..shape
            };
            (score, shape)
        })
    }

    /// The regular layout at one quad size, or at the next finer one when that is good but rough, and that one less so.
    fn regular(&mut self, size: f64) -> Tried {
        let (skeleton, body) = self.thickened(size)?;
        let quads = body.mesh.quads.len();
        if quads > MOST_QUADS {
            return Err(PipelineError {
                stage: "thicken",
                source: StageError::LargeBody {
                    quads,
                    most: MOST_QUADS,
                },
            });
        }
        let tried = self.fitted(skeleton, body, false)?;
        let rough = tried.0.good() && tried.0.rough > self.options.retry.close;
        let finer = |&&other: &&f64| other < size && other >= FINE * size;
        let Some(&finer) = self
            .options
            .retry
            .quad_sizes
            .iter()
            .find(finer)
            .filter(|_| rough)
        else {
            return Ok(tried);
        };
        match self.one(finer) {
            Ok(fine) if fine.0.worse() < tried.0.worse() => Ok(fine),
            Err(error) if error.is_cancelled() => Err(error),
            _ => Ok(tried),
        }
    }

    /// The first good shape of all quad sizes, else the best.
    fn tries(&mut self) -> Tried {
        let sizes: &[f64] = if self.drawn.is_some() {
            &[1.0]
        } else {
            &self.options.retry.quad_sizes
        };
        let mut best: Result<(Score, Shape), _> = Err(PipelineError {
            stage: "skeleton",
            source: StageError::NoQuadSize,
        });
        let (mut left, mut attempt) = (sizes.to_vec(), 0);
        let close = self.options.retry.close;
        loop {
            let best_so_far = match &best {
                Err(_) => Best::None,
                Ok((score, _)) if score.good() => Best::Rough,
                Ok((score, _)) if score.sound() && !score.torn() => Best::Far,
                Ok(_) => Best::Unsound,
            };
            let Some(size) = next_size(&mut left, best_so_far, self.base.united.is_some()) else {
                break;
            };
            attempt += 1;
            let name = format!("try {attempt} (quad size x {size})");
            match self.one(size) {
                Ok((score, shape)) if score.good() && score.rough <= close => {
                    return Ok((score, shape));
                }
                Ok((score, shape)) => {
                    if !score.good() {
                        self.monitor.warn("fit", format!("{name}: {score}"));
                    }
                    let hopeless =
                        score.hopeless() || self.base.united.is_some() && score.crossings > MANY;
                    let least = best.as_ref().ok();
                    if least.is_none_or(|(least, _)| score.worse() < least.worse()) {
                        best = Ok((score, shape));
                    }
                    // What coarser quads cannot finer ones may.
                    if hopeless && size <= 1.0 {
                        break;
                    }
                }
                Err(error) if error.is_cancelled() => return Err(error),
                Err(error) => {
                    let text = format!("{name} failed: {}", error.source);
                    self.monitor.warn(error.stage, text);
                    best = best.or(Err(error));
                }
            }
        }
        best
    }

    fn one(&mut self, size: f64) -> Tried {
        let (skeleton, body) = self.thickened(size)?;
        self.fitted(skeleton, body, false)
    }

    fn thickened(&mut self, size: f64) -> Result<(QuadSkeleton, ThickenedBody), PipelineError> {
        let skeleton = self.skeleton(size)?;
        let (options, monitor) = (&self.options.thicken, self.monitor);
        let body = self
            .record
            .stage("thicken", || thicken(&skeleton.skeleton, options, monitor))?;
        Ok((skeleton, body))
    }

    /// The last resort for bulky parts: a quad mesh wrapped around the proposal, fitted like a thickened one. The
    /// skeleton is still delivered; every point of the body belongs to its nearest skeleton point. The first size whose fit
    /// is sound wins, else the best of all.
    fn wrapped(
        &mut self,
        skeleton: Option<QuadSkeleton>,
    ) -> Result<Option<(Score, Shape)>, PipelineError> {
        let skeleton = match skeleton {
            Some(skeleton) => skeleton,
            None => self.skeleton(1.0)?,
        };
        let mut best: Option<(Score, Shape)> = None;
        for &size in &self.options.wrap.sizes {
            let options = WrapOptions {
                sizes: vec![size],
                ..self.options.wrap.clone()
            };
            let (field, solid) = (&self.base.remeshed.field, self.axis.solid);
            let mesh = self
                .record
                .stage("thicken", || wrap(field, solid, &options, self.monitor))?;
            let Some(mesh) = mesh else { continue };
            let body = self
                .record
                .stage("thicken", || thicken::adopt(mesh, &skeleton.skeleton))?;
            let (score, shape) = self.fitted(skeleton.clone(), body, true)?;
            let sound = score.sound();
            let least = best.as_ref();
            if least.is_none_or(|(least, _)| score.worse() < least.worse()) {
                best = Some((score, shape));
            }
            if sound {
                break;
            }
        }
        Ok(best)
    }

    fn fitted(&mut self, skeleton: QuadSkeleton, body: ThickenedBody, wrapped: bool) -> Tried {
        let (base, field) = (self.base, self.base.target);
        let options = &self.options.fit;
        let fitted = self.record.stage("fit", || {
            let options = FitOptions {
                volume: options.volume.or_else(|| Some(base.volume(field))),
                ..*options
            };
            fit(&body, &skeleton.skeleton, field, &options, self.monitor)
        })?;
        let score = Score::of(&fitted, field.spacing, &self.options.report.limits);
        let shape = Shape {
            skeleton,
            layout: self.layout,
            regular_refused: None,
            body,
            fitted,
            wrapped,
            faces_deviation: None,
        };
        Ok((score, shape))
    }

    /// The quad skeleton at one quad size, or the one drawn elsewhere, with smooth radii.
    fn skeleton(&mut self, size: f64) -> Result<QuadSkeleton, PipelineError> {
        let mut sized = self.options.skeleton.clone();
        sized.layout = self.layout;
        sized.size_factor *= size;
        sized.size_least *= size;
        sized.size_most *= size;
        sized.quad_size = sized.quad_size.map(|mm| mm * size);
        let (axis, voxel) = (self.axis, self.base.remeshed.field.spacing);
        let (drawn, monitor) = (self.drawn, self.monitor);
        let mut skeleton = self.record.stage("skeleton", || match drawn {
            Some(drawn) => Ok(adopt(drawn, axis)),
            None => quad_skeleton(&axis.mesh, voxel, &sized, monitor),
        })?;
        radii::smooth(&mut skeleton.skeleton, self.options.radii.smoothing);
        skeleton.stats = skeleton::stats(&skeleton.skeleton);
        Ok(skeleton)
    }
}

impl Shape {
    /// The skeleton is not of beams alone.
    pub(super) fn has_sheets(&self) -> bool {
        self.skeleton.stats.sheets > 0
    }

    /// The body neither cuts itself nor folds over.
    pub(super) fn sound(&self) -> bool {
        self.fitted.self_intersections.is_empty() && flipped(&self.fitted) == 0
    }
}

/// Patches of a fitted body whose normal flips over somewhere.
pub(super) fn flipped(fitted: &Fitted) -> usize {
    fitted.folds.iter().filter(|fold| fold.value < 0.0).count()
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
    let curvature = spline::curvature_jump(mesh, &patches)?;
    let brep = build_brep(mesh, &patches, &options.brep, monitor)?;
    // A tenth of a voxel is well below what any figure of the report resolves.
    let mut fine = options.tessellate;
    fine.chord = fine.chord.min(0.1 * voxel);
    let tessellation = tessellate(mesh, &patches, &fine)?;
    Ok(Surface {
        g1,
        curvature,
        brep,
        tessellation,
    })
}
