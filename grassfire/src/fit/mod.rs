//! Fit: moves the control points so that the Catmull-Clark limit surface follows the proposal.

mod attempt;
mod clearance;
mod data;
mod equations;
mod goal;
mod guard;
mod lean;
mod options;
mod raise;
mod refine;
mod residual;
mod round;
mod settle;
mod shade;
mod strips;
mod surface;
mod tangles;
mod targets;
mod untangle;
mod volume;

pub use clearance::clear_of;
pub use lean::leaned;
pub use options::FitOptions;
pub use raise::raised;
pub use volume::volume;

use serde::Serialize;

use crate::Vec3;
use crate::monitor::{Cancelled, Monitor};
use crate::skeleton::Skeleton;
use crate::spline::ControlMesh;
use crate::spline::catmull_clark::CatmullClarkError;
use crate::thicken::ThickenedBody;
use crate::voxel::VoxelGrid;

/// Name of this stage in progress and warnings.
pub(crate) const STAGE: &str = "fit";

/// Evenness of the starts in turn, over that of the options. Which of them follows a part best cannot be told beforehand: a
/// lively net reaches tips and gets stuck where it is crowded, a calm one does neither.
const CALM: [f64; 3] = [1.0, 10.0, 3.0];
/// Starts after the second are made only for places farther off than this many times the goal for rms distance (1.5 voxels by
/// default): they seldom help the rest.
const FAR: f64 = 10.0;

/// Quads of all starts together, at most: large bodies take long, and get fewer starts.
const MANY_QUADS: usize = 4000;

/// Quads of a body that settles on a finer field, over those it had: a field is finer by less than the square root of 2.
const MORE: f64 = std::f64::consts::SQRT_2;

/// How one round went.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct FitRound {
    /// Area-weighted mean distance of the limit surface to the iso-surface before the round, mm.
    pub mean_distance: f64,
    /// Mean move of a control point, mm.
    pub step: f64,
}

/// How one refinement went.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Refinement {
    /// Quads afterwards.
    pub quads: u32,
    /// Root of the mean square distance afterwards, both ways, mm.
    pub rms: f64,
    /// It was kept.
    pub accepted: bool,
}

/// How one untangling round went.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct UntangleRound {
    /// Intersecting triangle pairs of the limit mesh afterwards.
    pub pairs: u32,
    /// Patches below twice the fold limit afterwards.
    pub folds: u32,
    /// Rms distance of the limit surface to the iso-surface afterwards, mm.
    pub rms: f64,
    /// Volume afterwards, mm3.
    pub volume: f64,
    /// It belongs to the way that led to the result; the guards let it pass.
    pub accepted: bool,
}

/// A place where the fitted limit surface still intersects itself.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct SelfIntersectionPlace {
    /// Mean of the offending triangles, mm.
    pub place: Vec3,
    /// Control quads involved, ascending.
    pub quads: Vec<u32>,
}

/// A control quad whose G1 patch folds or nearly folds.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Fold {
    /// Where the patch is worst, mm.
    pub place: Vec3,
    /// The control quad.
    pub quad: u32,
    /// Its smallest normalised Jacobian; negative where the normal flips over.
    pub value: f64,
}

/// Distances over a sampled surface, mm.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Distances {
    /// Root of the mean square.
    pub rms: f64,
    /// 95 % of the surface are closer than this.
    pub p95: f64,
    /// Largest.
    pub max: f64,
}

/// A fitted control mesh and how well it does.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Fitted {
    /// The control mesh.
    #[serde(skip)]
    pub mesh: ControlMesh,
    /// The thickened body with the quads and points of `mesh`: the given one, its strips split as the fit needed. Its
    /// `bodies` are those of the given one.
    #[serde(skip)]
    pub body: ThickenedBody,
    /// Starts that were made; what follows is of the best.
    pub starts: u32,
    /// Rounds against the iso-surface.
    pub rounds: Vec<FitRound>,
    /// Refinements in turn; none when the goal was met without.
    pub refinements: Vec<Refinement>,
    /// Untangling rounds, also the refused ones.
    pub untangle_rounds: Vec<UntangleRound>,
    /// Intersecting triangle pairs before untangling.
    pub pairs_before_untangling: u32,
    /// What is left after untangling; empty when all is well.
    pub self_intersections: Vec<SelfIntersectionPlace>,
    /// Folded patches before untangling.
    pub folds_before_untangling: u32,
    /// Patches that still fold after untangling, by quad; empty when all is well.
    pub folds: Vec<Fold>,
    /// Limit surface to iso-surface (length of the flow along the gradient).
    pub body_to_iso: Distances,
    /// Iso-surface to limit surface (nearest triangle among those around the nearest sample).
    pub iso_to_body: Distances,
    /// Largest distance of both, mm, where a flow counts no more than the way to the iso-surface near its nearest sample: in a
    /// narrow groove it leads far along the floor.
    pub farthest: f64,
    /// Volume inside the limit surface, mm3.
    pub volume: f64,
    /// Volume of the region f > 0, mm3.
    pub iso_volume: f64,
}

/// Why a body cannot be fitted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FitError {
    /// The body is no closed manifold quad mesh.
    #[error("the thickened body cannot be subdivided")]
    BadBody(#[from] CatmullClarkError),
    /// The body does not belong to the skeleton, or has coordinates that are not finite.
    #[error("point {point} of the body names skeleton point {source_point}, or is not finite")]
    BadPoint {
        /// Index of the body point.
        point: u32,
        /// Its skeleton point.
        source_point: u32,
    },
    /// The field has no surface f = 0, its size does not match its values, or one is not finite.
    #[error("the field of {} x {} x {} voxels has no surface to fit to, or values that are not finite", dims[0], dims[1], dims[2])]
    BadField {
        /// Voxels along x, y, z.
        dims: [usize; 3],
    },
    /// An option is out of range.
    #[error("option {name} is {value}, allowed is {allowed}")]
    BadOption {
        /// Name of the option.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What is allowed.
        allowed: &'static str,
    },
    /// The normal equations could not be solved.
    #[error("the normal equations of round {round} could not be solved: {reason}")]
    Solver {
        /// Index of the round.
        round: u32,
        /// What the factorisation said.
        reason: String,
    },
    /// The user asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl FitError {
    /// What the user can do about it.
    pub fn hint(&self) -> Option<String> {
        let text = match self {
            Self::BadBody(inner) => return inner.hint(),
            Self::BadPoint { .. } => "fit the body with the skeleton that it was thickened from",
            Self::BadField { .. } => "use the field that the skeleton was made from",
            Self::Solver { .. } => "raise fit.fairness",
            Self::BadOption { .. } | Self::Cancelled(_) => return None,
        };
        Some(text.to_owned())
    }
}

/// Fits the limit surface of `body` to the surface f = 0 of `field` (signed distance, mm, positive
/// inside).
///
/// 1. Start: damped least squares of the limit surface to the thickened points.
/// 2. Rounds: samples of the limit surface (16 a quad) flow to f = 0 along the gradient and pull
///    point to plane; samples of the iso-surface pull their nearest limit sample point to plane,
///    without which tips and corners are never reached. Weights: area, agreement of normals, and a
///    cap on far samples that tightens from round to round. Tangential damping and fairness
///    |Lap Lap X|^2 + 0.02 |Lap X|^2 keep the net regular; steps are clamped.
///    Tangential evenness |Lap X|^2, without its normal part, spreads the control points.
/// 3. Untangling: where the limit mesh (two splits) intersects itself or a G1 patch folds, fairness
///    grows and data counts less until it does not; then rounds with all data give back what that
///    took, their steps shortened wherever they would create an intersection or deepen a fold. It is
///    undone if it costs more volume or accuracy than the options allow. Places that stay are
///    reported in [`Fitted::self_intersections`]
///    and [`Fitted::folds`] and as warnings, never hidden.
/// 4. Refinement of bodies without trouble: strips of quads are split lengthwise where the mesh is too coarse. That makes no extraordinary points,
///    so that the number of faces does not grow with it.
/// 5. Settling of these: a few rounds more, with little fairness and at the volume of f > 0.
/// 6. If a sound body does not meet the goal, all again with a net of other evenness; the best is kept.
///
/// From the ninth round on samples inside the proposal whose normals do not agree pull, too, under more fairness: they sit
/// between walls of the body that nearly touch, and nothing else fills such slits. Around places farther off than a voxel
/// evenness is ten times as strong, since a crowded net cannot move there.
///
/// The normal equations are one sparse Cholesky system; its symbolic factorisation is made once.
/// Memory and time grow nearly linearly with the quads. The result does not depend on the number of
/// threads.
///
/// # Errors
/// Invalid input, or a system that cannot be factorised.
pub fn fit(
    body: &ThickenedBody,
    skeleton: &Skeleton,
    field: &VoxelGrid<f32>,
    options: &FitOptions,
    monitor: &Monitor,
) -> Result<Fitted, FitError> {
    options::check(options)?;
    check_body(body, skeleton)?;
    let target = targets::Target::new(field, options)?;
    let mut best: Option<attempt::Attempt> = None;
    let affordable = (MANY_QUADS / body.mesh.quads.len().max(1)).max(1);
    let mut starts = 0;
    for calm in CALM
        .into_iter()
        .take(affordable.min(options.starts as usize))
    {
        let calmer = FitOptions {
            evenness: options.evenness * calm,
            ..*options
        };
        let tried = attempt::attempt(body, skeleton, &target, &calmer, monitor)?;
        starts += 1;
        // Another start does not untangle a body; quads of another size do.
        let ended = tried.met || !tried.sound;
        if best.as_ref().is_none_or(|best| tried.better_than(best)) {
            best = Some(tried);
        }
        let far = best
            .as_ref()
            .is_some_and(|best| best.farthest > FAR * options.goal);
        if ended || (starts > 1 && !far) {
            break;
        }
    }
    let mut fitted = best.map(|best| best.fitted).unwrap_or_default();
    fitted.starts = starts;
    report(&fitted, monitor);
    Ok(fitted)
}

/// The last steps of [`fit`] alone: a body that was fitted to a coarser field of the same solid is refined once, by few quads, and
/// settles on `field`, without a new intersection or fold. A body that has some stays as it is. Figures are those to `field`.
///
/// # Errors
/// As [`fit`].
pub fn settled(
    fitted: &Fitted,
    skeleton: &Skeleton,
    field: &VoxelGrid<f32>,
    options: &FitOptions,
    monitor: &Monitor,
) -> Result<Fitted, FitError> {
    options::check(options)?;
    let target = targets::Target::new(field, options)?;
    let options = FitOptions {
        refinements: options.refinements.min(1),
        most_quads: options.most_quads.min(MORE),
        ..*options
    };
    let settled = attempt::settled(fitted, skeleton, &target, &options, monitor)?;
    Ok(settled.fitted)
}

fn report(fitted: &Fitted, monitor: &Monitor) {
    for place in &fitted.self_intersections {
        let (p, quads) = (place.place, place.quads.len());
        let text = format!(
            "the fitted surface intersects itself near ({:.1}, {:.1}, {:.1}) mm in {quads} control quads",
            p.x, p.y, p.z
        );
        monitor.warn(STAGE, text);
    }
    for fold in &fitted.folds {
        let (p, quad, value) = (fold.place, fold.quad, fold.value);
        let text = format!(
            "the fitted surface folds near ({:.1}, {:.1}, {:.1}) mm in control quad {quad}: normalised Jacobian {value:.3}",
            p.x, p.y, p.z
        );
        monitor.warn(STAGE, text);
    }
}

/// Refuses a body that is not of the skeleton.
fn check_body(body: &ThickenedBody, skeleton: &Skeleton) -> Result<(), FitError> {
    for (i, p) in body.mesh.points.iter().enumerate() {
        let source = body.source.get(i).copied().unwrap_or(u32::MAX);
        if source as usize >= skeleton.points.len()
            || p.iter().any(|x| !x.is_finite() || x.abs() > 1e9)
        {
            return Err(FitError::BadPoint {
                point: i as u32,
                source_point: source,
            });
        }
    }
    Ok(())
}
