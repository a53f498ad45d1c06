//! Where the fitted surface is no good: it intersects itself, or its patches fold.

use std::collections::BTreeMap;

use super::round::Solver;
use super::{Fold, SelfIntersectionPlace};
use crate::Vec3;
use crate::mesh::TriMesh;
use crate::mesh::self_intersection::self_intersections;
use crate::monitor::Monitor;
use crate::spline::{ControlMesh, Jacobian, PatchOptions, jacobians, patches};

/// Intersections of the limit mesh and folds of the patches of one set of control points.
#[derive(Clone)]
pub(super) struct Tangles {
    mesh: TriMesh,
    /// Triangles that intersect each other.
    pub pairs: Vec<[u32; 2]>,
    /// Control quads of these, ascending.
    crossing: Vec<u32>,
    /// Smallest normalised Jacobian of the patch of each control quad.
    jacobians: Vec<Jacobian>,
    /// Control quads whose patch folds or nearly folds, ascending.
    pub folded: Vec<u32>,
    /// Normalised Jacobian that is aimed at.
    aim: f64,
}

impl Tangles {
    pub fn of(solver: &Solver, points: &[Vec3]) -> Self {
        let surface = &solver.surface;
        let mesh = surface.triangle_mesh(surface.samples.apply(points));
        let pairs = self_intersections(&mesh);
        let owners = pairs.iter().flatten();
        let mut crossing: Vec<u32> = owners.map(|&t| surface.owner[t as usize]).collect();
        crossing.sort_unstable();
        crossing.dedup();
        let control = ControlMesh {
            points: points.to_vec(),
            quads: surface.coarse.quads.clone(),
        };
        // The scratch monitor swallows the fold warning: what is left in the end is reported once.
        // Meshes without patches (the spline stage names the reason) just have no folds.
        let faces = patches(&control, &PatchOptions::default(), &Monitor::default());
        let jacobians = jacobians(&faces.unwrap_or_default());
        let aim = 2.0 * solver.fold_limit();
        let below = jacobians.iter().enumerate().filter(|(_, j)| j.value < aim);
        let folded = below.map(|(q, _)| q as u32).collect();
        Self {
            mesh,
            pairs,
            crossing,
            jacobians,
            folded,
            aim,
        }
    }

    /// Neither intersections nor folds.
    pub fn none(&self) -> bool {
        self.pairs.is_empty() && self.folded.is_empty()
    }

    /// No intersections, and no patch whose normal flips over.
    pub fn sound(&self) -> bool {
        self.pairs.is_empty()
            && self
                .folded
                .iter()
                .all(|&q| self.jacobians[q as usize].value >= 0.0)
    }

    /// One a pair, and one or more a fold, the deeper the more.
    pub fn trouble(&self) -> f64 {
        let depth = |&q: &u32| 1.0 + 10.0 * (self.aim - self.jacobians[q as usize].value);
        self.pairs.len() as f64 + self.folded.iter().map(depth).sum::<f64>()
    }

    /// All offending control quads, ascending.
    pub fn quads(&self) -> Vec<u32> {
        let mut quads = self.crossing.clone();
        quads.extend(&self.folded);
        quads.sort_unstable();
        quads.dedup();
        quads
    }

    /// Control quads that intersect others or whose patch is below `limit`, ascending.
    pub fn bad_quads(&self, limit: f64) -> Vec<u32> {
        let mut quads = self.crossing.clone();
        let below = |q: &u32| self.jacobians[*q as usize].value < limit;
        quads.extend(self.folded.iter().copied().filter(below));
        quads.sort_unstable();
        quads.dedup();
        quads
    }

    /// Quads that offend more than in `before`: the intersecting ones if there are more pairs now,
    /// and those with a fold that is deeper.
    pub fn worse_than(&self, before: &Tangles) -> Vec<u32> {
        const SLACK: f64 = 1e-3;
        let value = |t: &Tangles, q: u32| t.jacobians.get(q as usize).map_or(1.0, |j| j.value);
        let deeper = |q: &u32| value(self, *q) < value(before, *q) - SLACK;
        let mut quads: Vec<u32> = self.folded.iter().copied().filter(deeper).collect();
        if self.pairs.len() > before.pairs.len() {
            quads.extend(&self.crossing);
        }
        quads.sort_unstable();
        quads.dedup();
        quads
    }

    /// Control points of `quads` and of `rings` rings of quads around.
    pub fn control_points(&self, solver: &Solver, quads: &[u32], rings: u32) -> Vec<bool> {
        let coarse = &solver.surface.coarse;
        let mut near = vec![false; coarse.point_count];
        for &q in quads {
            coarse.quads[q as usize]
                .iter()
                .for_each(|&v| near[v as usize] = true);
        }
        for _ in 0..rings {
            let inner = near.clone();
            for quad in &coarse.quads {
                if quad.iter().any(|&v| inner[v as usize]) {
                    quad.iter().for_each(|&v| near[v as usize] = true);
                }
            }
        }
        near
    }

    /// Folds below `limit`, by quad.
    pub fn folds(&self, solver: &Solver, limit: f64) -> Vec<Fold> {
        let all = self.jacobians.iter().enumerate();
        all.filter(|(_, j)| j.value < limit)
            .map(|(q, j)| Fold {
                place: solver.surface.to_mm(&j.place),
                quad: q as u32,
                value: j.value,
            })
            .collect()
    }

    /// Groups intersecting quads that share points or intersect each other.
    pub fn places(&self, solver: &Solver) -> Vec<SelfIntersectionPlace> {
        let surface = &solver.surface;
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
        for &q in &self.crossing {
            surface.coarse.quads[q as usize]
                .iter()
                .for_each(|&v| unite(first(q), v));
        }
        for pair in &self.pairs {
            let [a, b] = pair.map(|t| surface.owner[t as usize]);
            unite(first(a), first(b));
        }
        let mut groups: BTreeMap<usize, (Vec<u32>, Vec3, f64)> = BTreeMap::new();
        for &q in &self.crossing {
            groups
                .entry(root(&mut parent, first(q) as usize))
                .or_default()
                .0
                .push(q);
        }
        for &t in self.pairs.iter().flatten() {
            let key = root(&mut parent, first(surface.owner[t as usize]) as usize);
            let group = groups.entry(key).or_default();
            group.1 += self.mesh.corners(t as usize).iter().sum::<Vec3>() / 3.0;
            group.2 += 1.0;
        }
        groups
            .into_values()
            .map(|(quads, sum, count)| SelfIntersectionPlace {
                place: surface.to_mm(&(sum / count.max(1.0))),
                quads,
            })
            .collect()
    }
}
