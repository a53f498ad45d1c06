//! Removal of self-intersections and folds from the fitted limit surface, guarded.

use super::guard::guarded_step;
use super::round::Solver;
use super::tangles::Tangles;
use super::{FitError, FitOptions, Fitted, STAGE, UntangleRound};
use crate::Vec3;
use crate::monitor::Monitor;

/// Unfolding rounds without progress before it is given up.
const PATIENCE: u32 = 4;

/// Step 3 of [`super::fit`]; returns what still intersects or folds.
///
/// Offending quads are those that intersect others and those whose patch folds or nearly folds.
/// 1. Unfold: around the offending quads fairness grows and data counts less, until there are none.
///    This may thin necks, so it stops when much volume is gone.
/// 2. Regrow: with all data back, rounds whose steps are shortened wherever they would create an
///    intersection or deepen a fold.
/// 3. Guard: keep the result only if less trouble is left and volume and accuracy stayed within the
///    limits.
///
/// Growing again from the thickened body was tried instead of giving up after step 3: on ten parts it
/// never left less trouble, and took three times as long.
pub(super) fn untangle(
    solver: &mut Solver,
    points: &mut Vec<Vec3>,
    fitted: &mut Fitted,
    options: &FitOptions,
    monitor: &Monitor,
) -> Result<Tangles, FitError> {
    let mut left = Tangles::of(solver, points);
    fitted.pairs_before_untangling = left.pairs.len() as u32;
    fitted.folds_before_untangling = left.folds(solver, options.fold_limit).len() as u32;
    if !left.none() && options.untangle_rounds > 0 {
        let reference = state(solver, points, &left);
        let mut trial = points.clone();
        let start = unfold(solver, &mut trial, left.clone(), fitted, options, monitor)?;
        let after = regrow(solver, &mut trial, start, fitted, options, monitor)?;
        let now = state(solver, &trial, &after);
        let passes = now.rms <= reference.rms * (1.0 + options.max_rms_growth)
            && now.volume
                >= reference.volume.min(fitted.iso_volume) * (1.0 - options.max_volume_loss)
            && after.pairs.len() <= left.pairs.len()
            && after.trouble() < left.trouble();
        if passes {
            let rounds = fitted.untangle_rounds.iter_mut();
            rounds.for_each(|round| round.accepted = true);
            left = after;
            *points = trial;
        }
    }
    Ok(left)
}

fn state(solver: &Solver, points: &[Vec3], tangles: &Tangles) -> UntangleRound {
    UntangleRound {
        pairs: tangles.pairs.len() as u32,
        folds: tangles.folded.len() as u32,
        rms: solver.body_to_iso(points).rms,
        volume: solver.surface.volume(points),
        accepted: false,
    }
}

fn unfold(
    solver: &mut Solver,
    points: &mut Vec<Vec3>,
    mut found: Tangles,
    fitted: &mut Fitted,
    options: &FitOptions,
    monitor: &Monitor,
) -> Result<Tangles, FitError> {
    let mut best = (found.clone(), points.clone());
    let volume = solver.surface.volume(points);
    let mut idle = 0;
    for round in 0..options.untangle_rounds {
        if found.none() {
            break;
        }
        monitor.step(
            STAGE,
            "untangling",
            0.5 + 0.15 * f64::from(round) / f64::from(options.untangle_rounds),
        )?;
        let near = found.control_points(solver, &found.quads(), 1);
        for (factor, _) in solver
            .fairness
            .iter_mut()
            .zip(&near)
            .filter(|(_, near)| **near)
        {
            *factor = (*factor * 6.0).min(2000.0);
        }
        for j in 0..solver.trust.len() {
            let (indices, weights) = solver.surface.samples.row(j);
            let inside = indices
                .iter()
                .zip(weights)
                .filter(|(p, _)| near[**p as usize]);
            let share: f64 = inside.map(|x| x.1).sum();
            solver.trust[j] *= 1.0 - 0.6 * share.clamp(0.0, 1.0);
        }
        for k in 0..2 {
            solver.round(points, options.rounds + 2 * round + k)?;
        }
        found = Tangles::of(solver, points);
        let now = state(solver, points, &found);
        fitted.untangle_rounds.push(now);
        if found.trouble() < best.0.trouble() {
            best = (found.clone(), points.clone());
            idle = 0;
        } else {
            idle += 1;
        }
        if now.volume < 0.9 * volume || idle == PATIENCE {
            break;
        }
    }
    *points = best.1;
    Ok(best.0)
}

/// Rounds with all data, their steps shortened where they would make things worse.
fn regrow(
    solver: &mut Solver,
    points: &mut Vec<Vec3>,
    mut found: Tangles,
    fitted: &mut Fitted,
    options: &FitOptions,
    monitor: &Monitor,
) -> Result<Tangles, FitError> {
    let rounds = options.regrow_rounds;
    let (mut rms, mut settled) = (f64::INFINITY, 0);
    solver.trust.fill(1.0);
    solver.fairness.fill(1.0);
    for round in 0..rounds {
        monitor.step(
            STAGE,
            "regrowing",
            0.65 + 0.1 * f64::from(round) / f64::from(rounds),
        )?;
        let mut wanted = points.clone();
        solver.round(&mut wanted, options.rounds + round)?;
        let Some((trial, tangles)) = guarded_step(solver, points, &wanted, &found) else {
            continue;
        };
        *points = trial;
        found = tangles;
        let now = state(solver, points, &found);
        fitted.untangle_rounds.push(now);
        settled = if now.rms > 0.995 * rms {
            settled + 1
        } else {
            0
        };
        rms = now.rms;
        if settled == 3 {
            break;
        }
    }
    Ok(found)
}
