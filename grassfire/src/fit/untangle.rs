//! Removal of self-intersections from the fitted limit surface, guarded.

use std::collections::BTreeMap;

use super::round::Solver;
use super::{FitError, FitOptions, Fitted, STAGE, SelfIntersectionPlace, UntangleRound};
use crate::Vec3;
use crate::mesh::TriMesh;
use crate::mesh::self_intersection::self_intersections;
use crate::monitor::Monitor;

/// Step 3 of [`super::fit`].
pub(super) fn untangle(
    solver: &mut Solver,
    points: &mut Vec<Vec3>,
    fitted: &mut Fitted,
    options: &FitOptions,
    monitor: &Monitor,
) -> Result<(), FitError> {
    let mut found = Tangles::of(solver, points);
    fitted.pairs_before_untangling = found.pairs.len() as u32;
    for round in 0..options.untangle_rounds {
        if found.pairs.is_empty() {
            break;
        }
        monitor.step(STAGE, "untangling", 0.65 + 0.3 * f64::from(round) / f64::from(options.untangle_rounds))?;
        let n = solver.surface.coarse.point_count;
        let mut m = vec![false; n];
        for &q in &found.quads {
            for v in solver.surface.coarse.quads[q as usize] {
                m[v as usize] = true;
            }
        }
        let inner: Vec<u32> = (0..n as u32).filter(|&v| m[v as usize]).collect();
        for v in inner {
            for h in solver.surface.coarse.ring(v) {
                m[solver.surface.coarse.head(h) as usize] = true;
                m[solver.surface.coarse.diagonal(h) as usize] = true;
            }
        }
        for v in 0..n {
            if m[v] {
                solver.fairness[v] = (solver.fairness[v] * 6.0).min(2000.0);
            }
        }
        for j in 0..solver.trust.len() {
            let (p, w) = solver.surface.samples.row(j);
            let inf: f64 = p.iter().zip(w).filter(|(p, _)| m[**p as usize]).map(|x| x.1).sum();
            solver.trust[j] *= 1.0 - 0.6 * inf.clamp(0.0, 1.0);
        }
        let mut trial = points.clone();
        for k in 0..2 {
            solver.round(&mut trial, options.rounds + 2 * round + k)?;
        }
        let after = Tangles::of(solver, &trial);
        let rms = solver.body_to_iso(&trial).rms;
        let volume = solver.surface.volume(&trial);
        fitted.untangle_rounds.push(UntangleRound { pairs: after.pairs.len() as u32, rms, volume, accepted: true });
        *points = trial;
        found = after;
    }
    fitted.self_intersections = found.places(solver);
    Ok(())
}

/// Where the limit surface intersects itself.
struct Tangles {
    mesh: TriMesh,
    pairs: Vec<[u32; 2]>,
    /// Control quads involved, ascending.
    quads: Vec<u32>,
}

impl Tangles {
    fn of(solver: &Solver, points: &[Vec3]) -> Self {
        let surface = solver.surface;
        let mesh = surface.triangle_mesh(surface.samples.apply(points));
        let pairs = self_intersections(&mesh);
        let mut quads: Vec<u32> = pairs.iter().flatten().map(|&t| surface.owner[t as usize]).collect();
        quads.sort_unstable();
        quads.dedup();
        Self { mesh, pairs, quads }
    }

    /// Groups offending quads that share points or intersect each other.
    fn places(&self, solver: &Solver) -> Vec<SelfIntersectionPlace> {
        let surface = solver.surface;
        let mut parent: Vec<usize> = (0..surface.coarse.point_count).collect();
        fn root(parent: &mut [usize], mut i: usize) -> usize {
            while parent[i] != i {
                parent[i] = parent[parent[i]];
                i = parent[i];
            }
            i
        }
        let mut unite = |a: u32, b: u32| {
            let (a, b) = (root(&mut parent, a as usize), root(&mut parent, b as usize));
            parent[a.max(b)] = a.min(b);
        };
        let first = |q: u32| surface.coarse.quads[q as usize][0];
        for &q in &self.quads {
            surface.coarse.quads[q as usize].iter().for_each(|&v| unite(first(q), v));
        }
        for pair in &self.pairs {
            let [a, b] = pair.map(|t| surface.owner[t as usize]);
            unite(first(a), first(b));
        }
        let mut groups: BTreeMap<usize, (Vec<u32>, Vec3, f64)> = BTreeMap::new();
        for &q in &self.quads {
            groups.entry(root(&mut parent, first(q) as usize)).or_default().0.push(q);
        }
        for &t in self.pairs.iter().flatten() {
            let key = root(&mut parent, first(surface.owner[t as usize]) as usize);
            let group = groups.entry(key).or_default();
            group.1 += self.mesh.corners(t as usize).iter().sum::<Vec3>() / 3.0;
            group.2 += 1.0;
        }
        groups
            .into_values()
            .map(|(quads, sum, count)| SelfIntersectionPlace { place: surface.to_mm(&(sum / count.max(1.0))), quads })
            .collect()
    }
}
