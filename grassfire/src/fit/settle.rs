//! The last rounds of a sound fit: nothing but data, at the volume of the proposal.

use super::goal::{Figures, Goal};
use super::guard::guarded_step;
use super::refine::State;
use super::{FitError, FitOptions, Fitted, STAGE};
use crate::monitor::Monitor;

/// Fairness against data, as a share of that of the first rounds.
const FAIRNESS: f64 = 0.05;

/// Rounds that bring less than 2 % before settling ends.
const PATIENCE: u32 = 2;

/// Step 5 of [`super::fit`]: rounds with little fairness whose solutions have the volume of f > 0, their steps shortened
/// wherever they would create an intersection or a fold. Rounds that bring nothing are not kept.
///
/// Fairness pulls convex places inward, which costs volume everywhere; distance alone hardly notices.
pub(super) fn settle(
    state: &mut State,
    fitted: &Fitted,
    options: &FitOptions,
    monitor: &Monitor,
) -> Result<(), FitError> {
    let State {
        solver,
        points,
        tangles,
        ..
    } = state;
    let goal = Goal::of(options);
    let volume = fitted.iso_volume;
    solver.trust.fill(1.0);
    solver.fairness.fill(1.0);
    solver.least_fairness = FAIRNESS * options.fairness;
    solver.volume = Some(volume);
    let mut best = goal.error(&Figures::of(solver, points, volume));
    let (mut here, mut found, mut idle) = (points.clone(), tangles.clone(), 0);
    for round in 0..options.settle_rounds {
        let part = f64::from(round) / f64::from(options.settle_rounds);
        monitor.step(STAGE, "settling", 0.92 + 0.05 * part)?;
        let mut wanted = here.clone();
        solver.round(&mut wanted, options.rounds + round)?;
        let Some(step) = guarded_step(solver, &here, &wanted, &found) else {
            break;
        };
        (here, found) = step;
        let now = Figures::of(solver, &here, volume);
        let now = goal.error(&now);
        idle = if now < 0.98 * best { 0 } else { idle + 1 };
        if now < best {
            best = now;
            points.clone_from(&here);
            *tangles = found.clone();
        }
        if idle == PATIENCE {
            break;
        }
    }
    Ok(())
}
