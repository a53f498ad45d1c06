//! Refinement: strips of quads are split where the mesh is too coarse for the proposal.

use super::goal::{Figures, Goal};
use super::guard::guarded_step;
use super::residual::Residual;
use super::round::Solver;
use super::strips::{Strips, split};
use super::surface::Surface;
use super::tangles::Tangles;
use super::{FitError, FitOptions, Fitted, Refinement, STAGE};
use crate::Vec3;
use crate::monitor::Monitor;
use crate::skeleton::Skeleton;
use crate::thicken::ThickenedBody;

/// Rounds after strips were split.
const ROUNDS: u32 = 4;
/// Attempts to split strips without making the surface worse.
const TRIES: u32 = 6;
/// Fairness against data of refined meshes, as a share of that of the first.
const FAIRNESS: f64 = 0.25;
/// A strip with more than this share of the residual may have the quads of later passes, too.
const MAJOR: f64 = 1.0 / 3.0;

/// A body with its system and the control points so far.
pub(super) struct State<'a> {
    pub body: ThickenedBody,
    pub solver: Solver<'a>,
    pub points: Vec<Vec3>,
    /// What still intersects or folds.
    pub tangles: Tangles,
}

/// Step 4 of [`super::fit`], for bodies that do not cut themselves: no step makes them do so.
///
/// 1. Every quad has a residual, shared between its two directions ([`Residual`]); a strip's is the sum over its quads.
/// 2. Strips with the largest residual an area are chosen, as long as it is above the goal and there may be more quads.
///    Where the surface is close on the whole, only strips through places that are too far off count. A strip that has more
///    than a third of the residual and is too long for a pass may use up the quads of all passes: it runs through the whole
///    body, and without it short strips gain little.
/// 3. They are split, and the control points found whose limit surface passes through the old one's. Strips that would
///    make it cut itself or fold there are left alone.
/// 4. Some rounds with little fairness at the volume of f > 0, each step shortened where it would make the body worse.
/// 5. The pass is kept when the distance falls and the body is still sound; else it was the last one.
pub(super) fn refine<'a>(
    mut state: State<'a>,
    skeleton: &Skeleton,
    fitted: &mut Fitted,
    options: &FitOptions,
    monitor: &Monitor,
) -> Result<State<'a>, FitError> {
    let first = state.body.mesh.quads.len() as f64;
    let goal = Goal::of(options);
    let mut before = Figures::of(&state.solver, &state.points, fitted.iso_volume);
    let most_of = |passes: u32| {
        let growth = f64::from(passes) / f64::from(options.refinements);
        first * options.most_quads.powf(growth)
    };
    for pass in 0..options.refinements {
        let part = f64::from(pass) / f64::from(options.refinements);
        monitor.step(STAGE, "refining", 0.75 + 0.15 * part)?;
        if goal.met(&before) {
            break;
        }
        // Where the surface is close on the whole, only single places count.
        let beyond = if goal.close(&before) { goal.max } else { 0.0 };
        let most = [pass + 1, options.refinements].map(|passes| most_of(passes) as usize);
        let Some(mut finer) = finer(&state, skeleton, &goal, beyond, most)? else {
            break;
        };
        finer.solver.volume = Some(fitted.iso_volume);
        for k in 0..ROUNDS {
            monitor.step(STAGE, "refining", 0.75 + 0.15 * part)?;
            let State {
                solver,
                points,
                tangles,
                ..
            } = &mut finer;
            let mut wanted = points.clone();
            solver.round(&mut wanted, options.rounds + k)?;
            let Some(step) = guarded_step(solver, points, &wanted, tangles) else {
                break;
            };
            (*points, *tangles) = step;
        }
        let after = Figures::of(&finer.solver, &finer.points, fitted.iso_volume);
        let accepted = after.rms() < before.rms() && finer.tangles.sound();
        fitted.refinements.push(Refinement {
            quads: finer.body.mesh.quads.len() as u32,
            rms: after.rms() * finer.solver.field.spacing,
            accepted,
        });
        if !accepted {
            break;
        }
        (state, before) = (finer, after);
    }
    Ok(state)
}

/// The body with its worst strips split; none when no strip is worth it or can be split.
fn finer<'a>(
    state: &State<'a>,
    skeleton: &Skeleton,
    goal: &Goal,
    beyond: f64,
    most: [usize; 2],
) -> Result<Option<State<'a>>, FitError> {
    let solver = &state.solver;
    let strips = Strips::new(&solver.surface.coarse);
    let residual = Residual::of(solver, &state.points, beyond);
    let at = solver.surface.samples.apply(&state.points);
    let limit = solver.options.fold_limit;
    let known = state.tangles.bad_quads(limit);
    let mut closed = state.tangles.quads();
    for _ in 0..TRIES {
        let chosen = choose(&strips, &residual, &closed, goal, most);
        if !chosen.contains(&true) {
            break;
        }
        let halves = split(&state.body, skeleton, &strips, &chosen);
        let surface = Surface::new(&halves.body, solver.field)?;
        // The first samples are those of points, edges and quads, in this order.
        let through: Vec<Vec3> = halves.origin.iter().map(|&j| at[j]).collect();
        let points = surface.damped_start(&through)?;
        let mut finer = Solver::new(surface, solver.field, solver.iso, &solver.options)?;
        finer.least_fairness = FAIRNESS * solver.options.fairness;
        let tangles = Tangles::of(&finer, &points);
        let bad = tangles.bad_quads(limit).into_iter();
        let bad = bad.map(|q| halves.parent[q as usize]);
        let worse: Vec<u32> = bad.filter(|q| !known.contains(q)).collect();
        if worse.is_empty() {
            return Ok(Some(State {
                body: halves.body,
                solver: finer,
                points,
                tangles,
            }));
        }
        // Where a quad is bad although no strip through it was split, those beside it are to blame.
        let rings = u32::from(worse.iter().all(|q| closed.contains(q)));
        let near = state.tangles.control_points(solver, &worse, rings);
        let quads = solver.surface.coarse.quads.iter().enumerate();
        closed.extend(
            quads
                .filter(|(_, quad)| quad.iter().all(|&v| near[v as usize]))
                .map(|(q, _)| q as u32),
        );
    }
    Ok(None)
}

/// The strips to split, so that there are at most `most` quads, or `last` with one that has most of the residual.
fn choose(
    strips: &Strips,
    residual: &Residual,
    closed: &[u32],
    goal: &Goal,
    [most, last]: [usize; 2],
) -> Vec<bool> {
    let mut energy = vec![0.0; strips.count];
    let mut area = vec![0.0; strips.count];
    let mut quads = vec![0; strips.count];
    let mut open = vec![true; strips.count];
    for q in 0..residual.energy.len() {
        let shares = [residual.along[q], 1.0 - residual.along[q]];
        for (direction, share) in shares.into_iter().enumerate() {
            let s = strips.across(q, direction) as usize;
            energy[s] += share * residual.energy[q];
            area[s] += residual.area[q];
            quads[s] += 1;
        }
    }
    for &q in closed {
        for direction in 0..2 {
            open[strips.across(q as usize, direction) as usize] = false;
        }
    }
    let density = |s: usize| energy[s] / area[s].max(1e-300);
    let worth = |s: &usize| open[*s] && density(*s) > goal.rms.powi(2);
    let mut order: Vec<usize> = (0..strips.count).filter(worth).collect();
    order.sort_by(|&a, &b| density(b).total_cmp(&density(a)).then(a.cmp(&b)));
    let old = residual.energy.len();
    let major = MAJOR * energy.iter().sum::<f64>();
    let chosen = fill(&order, &quads, vec![false; strips.count], [old, most]);
    let left_out = |&&s: &&usize| {
        !chosen[s] && energy[s] > major && (old + 1..=last).contains(&(old + quads[s]))
    };
    let Some(&s) = order.iter().find(left_out) else {
        return chosen;
    };
    let mut alone = vec![false; strips.count];
    alone[s] = true;
    fill(&order, &quads, alone, [old + quads[s], most])
}

/// Chooses more strips in turn, those that fit in below `most` quads.
fn fill(
    order: &[usize],
    quads: &[usize],
    mut chosen: Vec<bool>,
    [mut total, most]: [usize; 2],
) -> Vec<bool> {
    for &s in order {
        if !chosen[s] && total + quads[s] <= most {
            total += quads[s];
            chosen[s] = true;
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spline::catmull_clark::QuadTopology;

    /// A torus of `n` rings of `m` quads.
    fn torus(n: u32, m: u32) -> Strips {
        let v = |i: u32, j: u32| (i % n) * m + j % m;
        let quads: Vec<[u32; 4]> = (0..n * m)
            .map(|q| (q / m, q % m))
            .map(|(i, j)| [v(i, j), v(i + 1, j), v(i + 1, j + 1), v(i, j + 1)])
            .collect();
        let topology = QuadTopology::new((n * m) as usize, &quads);
        Strips::new(&topology.expect("closed and oriented"))
    }

    #[test]
    fn a_long_strip_with_most_of_the_residual_was_never_split() {
        // Four rings of 40 quads, crossed by forty strips of four. The first ring has most of the residual, but not by area.
        let strips = torus(4, 40);
        let mut residual = Residual {
            energy: vec![1.0; 160],
            area: vec![1.0; 160],
            along: vec![0.0; 160],
        };
        residual.energy[..40].fill(30.0);
        residual.along[..40].fill(1.0);
        residual.energy[45] = 500.0;
        let goal = Goal::of(&FitOptions::default());
        let ring = strips.across(0, 0) as usize;
        let chosen = choose(&strips, &residual, &[], &goal, [180, 240]);
        let expected: Vec<bool> = (0..strips.count).map(|s| s == ring).collect();
        assert_eq!(chosen, expected);
        // Never more quads than the last pass may have.
        let others = choose(&strips, &residual, &[], &goal, [180, 190]);
        assert!(!others[ring] && others.contains(&true));
    }
}
