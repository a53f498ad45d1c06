//! One start of the fit: rounds, untangling, refinement, settling.

use super::goal::{Figures, Goal};
use super::tangles::Tangles;
use super::targets::Target;
use super::{FitError, FitOptions, Fitted, STAGE, refine, round, settle, surface, untangle};
use crate::Vec3;
use crate::monitor::Monitor;
use crate::skeleton::Skeleton;
use crate::thicken::ThickenedBody;

/// A fit from one start, and how good it is.
pub(super) struct Attempt {
    pub fitted: Fitted,
    /// It neither intersects itself nor folds, and is close everywhere.
    pub met: bool,
    /// It neither intersects itself nor folds.
    pub sound: bool,
    /// Largest distance both ways, voxels.
    pub farthest: f64,
    error: f64,
}

impl Attempt {
    /// Soundness first, then distance and volume.
    pub fn better_than(&self, other: &Self) -> bool {
        if self.sound == other.sound {
            self.error < other.error
        } else {
            self.sound
        }
    }
}

/// Steps 1 to 5 of [`super::fit`], with the evenness of `options`.
pub(super) fn attempt(
    body: &ThickenedBody,
    skeleton: &Skeleton,
    target: &Target,
    options: &FitOptions,
    monitor: &Monitor,
) -> Result<Attempt, FitError> {
    monitor.step(STAGE, "operators", 0.0)?;
    let field = target.field;
    let surface = surface::Surface::new(body, field)?;
    let thickened: Vec<Vec3> = body.mesh.points.iter().map(|p| field.to_grid(p)).collect();
    let mut points = surface.damped_start(&thickened)?;
    let mut solver = round::Solver::new(surface, field, &target.iso, options)?;
    let mut fitted = Fitted {
        iso_volume: target.volume,
        ..Fitted::default()
    };
    for round in 0..options.rounds {
        let part = f64::from(round) / f64::from(options.rounds);
        monitor.step(STAGE, "rounds", 0.05 + 0.45 * part)?;
        fitted.rounds.push(solver.round(&mut points, round)?);
    }
    let tangles = untangle::untangle(&mut solver, &mut points, &mut fitted, options, monitor)?;
    let body = body.clone();
    let state = refine::State {
        body,
        solver,
        points,
        tangles,
    };
    finished(state, fitted, skeleton, options, monitor)
}

/// Steps 4 and 5 of [`super::fit`] alone, of a body that was fitted to another field.
pub(super) fn settled(
    fitted: &Fitted,
    skeleton: &Skeleton,
    target: &Target,
    options: &FitOptions,
    monitor: &Monitor,
) -> Result<Attempt, FitError> {
    let field = target.field;
    let surface = surface::Surface::new(&fitted.body, field)?;
    let solver = round::Solver::new(surface, field, &target.iso, options)?;
    let placed = fitted.mesh.points.iter().map(|p| field.to_grid(p));
    let points: Vec<Vec3> = placed.collect();
    let tangles = Tangles::of(&solver, &points);
    let state = refine::State {
        body: fitted.body.clone(),
        solver,
        points,
        tangles,
    };
    let fitted = Fitted {
        iso_volume: target.volume,
        ..fitted.clone()
    };
    finished(state, fitted, skeleton, options, monitor)
}

/// Refines and settles a body without trouble, and measures it.
fn finished(
    mut state: refine::State,
    mut fitted: Fitted,
    skeleton: &Skeleton,
    options: &FitOptions,
    monitor: &Monitor,
) -> Result<Attempt, FitError> {
    if state.tangles.sound() {
        state = refine::refine(state, skeleton, &mut fitted, options, monitor)?;
        settle::settle(&mut state, &fitted, options, monitor)?;
    }
    monitor.step(STAGE, "distances", 0.97)?;
    Ok(Attempt::of(state, fitted, options))
}

impl Attempt {
    /// Measures what a start has come to.
    fn of(state: refine::State, mut fitted: Fitted, options: &FitOptions) -> Self {
        let refine::State {
            body,
            solver,
            points,
            tangles,
        } = state;
        fitted.self_intersections = tangles.places(&solver);
        fitted.folds = tangles.folds(&solver, options.fold_limit);
        fitted.body_to_iso = solver.body_to_iso(&points);
        fitted.iso_to_body = solver.iso_to_body(&points);
        fitted.farthest = solver
            .farthest_from_iso(&points)
            .max(fitted.iso_to_body.max);
        fitted.volume = solver.surface.volume(&points);
        fitted.mesh = solver.surface.control_mesh(&points);
        fitted.body = body;
        let goal = Goal::of(options);
        let both = [fitted.body_to_iso, fitted.iso_to_body];
        let figures = Figures::new(
            both,
            fitted.volume / fitted.iso_volume,
            solver.field.spacing,
        );
        let sound = tangles.sound();
        Self {
            met: sound && goal.met(&figures),
            sound,
            farthest: figures.farthest(),
            error: goal.error(&figures),
            fitted,
        }
    }
}
