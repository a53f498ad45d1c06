//! Simulated annealing of the quads toward few irregular vertices of the body.
//!
//! Matching and greedy clean-up leave pairs of vertices with three and five quads that no single change removes. Annealing
//! (Kirkpatrick et al. 1983, <https://doi.org/10.1126/science.220.4598.671>) walks such pairs together or to the rims.

use rayon::prelude::*;

use super::body_valence::{Star, star};
use super::coarsen::Sizing;
use super::complex::Class;
use super::layout::Effort;
use super::quad_mesh::{Change, QuadMesh};
use super::quad_moves::{collapse, open, rotate, shorten_rim};
use super::reference::Reference;
use super::shape_cost::{settle, shape_cost, smooth_near};
use crate::monitor::{Cancelled, Monitor};

/// Temperatures of the first and last proposal, in irregular body valences.
const HOT: f64 = 2.5;
const COLD: f64 = 0.3;
/// A change may improve the shape of its quads by about this much, so its valences may cost as much more.
const SLACK: f64 = 4.0;
/// How often all vertices are put back onto sheets and rims.
const SETTLINGS: usize = 24;

/// What a search needs besides the mesh.
pub(crate) struct Annealing<'a> {
    pub reference: &'a Reference,
    pub sizing: &'a Sizing,
    pub effort: Effort,
    pub searches: usize,
    pub seed: u64,
}

/// Several searches from the same mesh; the best one wins, the first of equals. None when none is better.
///
/// 1. A proposal turns a side of two quads, collapses a quad along its diagonal, opens one, or shortens a rim.
/// 2. It must keep fans, rims and seams; then body valences, corners and sizes of the quads around decide (Metropolis).
/// 3. The temperature falls geometrically; at every leg vertices go back onto sheets and rims, and the best state is kept.
///
/// The number of proposals is fixed by the number of quads. The Betti numbers are checked at the end.
pub(crate) fn anneal(
    mesh: &QuadMesh,
    annealing: &Annealing,
    monitor: &Monitor,
) -> Result<Option<QuadMesh>, Cancelled> {
    let found: Result<Vec<(f64, QuadMesh)>, Cancelled> = (0..annealing.searches)
        .into_par_iter()
        .map(|k| {
            let seed = annealing.seed.wrapping_add(k as u64);
            Search::new(mesh.clone(), annealing, seed).run(monitor)
        })
        .collect();
    let mut best = (annealing.energy(mesh), None);
    let topology = mesh.betti();
    for (e, m) in found? {
        if e < best.0 && m.betti() == topology && !m.has_twins() {
            best = (e, Some(m));
        }
    }
    Ok(best.1)
}

impl Annealing<'_> {
    /// Cost of all vertices and quads.
    fn energy(&self, m: &QuadMesh) -> f64 {
        let vertices: f64 = (0..m.points.len() as u32)
            .filter(|&v| !m.around[v as usize].is_empty())
            .map(|v| star(m, v).map_or(100.0, |s| s.cost(self.effort.inner)))
            .sum();
        let quads: f64 = m.alive().map(|(_, q)| shape_cost(m, &q, self.sizing)).sum();
        vertices + quads
    }

    /// Cost of the vertices.
    fn cost(&self, stars: &[Star]) -> f64 {
        stars.iter().map(|s| s.cost(self.effort.inner)).sum()
    }

    /// Cost of the vertices and of all quads around them.
    fn local_energy(&self, m: &QuadMesh, vertices: &[u32]) -> Option<f64> {
        let mut sum = 0.0;
        let mut quads: Vec<u32> = Vec::with_capacity(40);
        for &v in vertices {
            sum += star(m, v)?.cost(self.effort.inner);
            quads.extend(&m.around[v as usize]);
        }
        quads.sort_unstable();
        quads.dedup();
        for i in quads {
            sum += shape_cost(m, &m.quad(i)?, self.sizing);
        }
        Some(sum)
    }
}

struct Search<'a> {
    m: QuadMesh,
    annealing: &'a Annealing<'a>,
    random: Random,
}

impl<'a> Search<'a> {
    fn new(m: QuadMesh, annealing: &'a Annealing, seed: u64) -> Self {
        Self {
            m,
            annealing,
            random: Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15)),
        }
    }

    fn run(mut self, monitor: &Monitor) -> Result<(f64, QuadMesh), Cancelled> {
        let effort = &self.annealing.effort;
        let n = (effort.proposals * self.m.alive().count()).min(effort.most_proposals);
        let mut best = (self.annealing.energy(&self.m), self.m.clone());
        for leg in 0..SETTLINGS {
            monitor.check()?;
            let t = leg as f64 / (SETTLINGS - 1) as f64;
            let temperature = HOT * (COLD / HOT).powf(t);
            for _ in 0..n / SETTLINGS {
                self.step(temperature);
            }
            settle(&mut self.m, self.annealing.reference, 2);
            let now = self.annealing.energy(&self.m);
            if now < best.0 {
                best = (now, self.m.clone());
            }
        }
        Ok(best)
    }

    /// One proposal, taken or not after Metropolis.
    fn step(&mut self, temperature: f64) {
        let points = self.m.points.len();
        let taken = self
            .propose()
            .is_some_and(|change| self.attempt(&change, temperature));
        if !taken {
            // A refused opening leaves no point behind.
            self.m.truncate_points(points);
        }
    }

    fn propose(&mut self) -> Option<Change> {
        let i = self.random.below(self.m.quads.len()) as u32;
        let q = self.m.quad(i)?;
        let k = self.random.below(4);
        match self.random.below(20) {
            0..=9 => rotate(&self.m, i, k, self.random.below(2) == 0),
            10..=13 => collapse(&self.m, i, k),
            14 => shorten_rim(&self.m, i, k),
            _ => {
                let n = self.m.around[q[k] as usize].len() + 1;
                let spokes = [self.random.below(n), self.random.below(n)];
                open(&mut self.m, q[k], i, spokes)
            }
        }
    }

    fn attempt(&mut self, change: &Change, temperature: f64) -> bool {
        // Metropolis: the worsening that this proposal may bring.
        let allowance = -temperature * self.random.unit().max(1e-12).ln();
        self.promising(change, allowance + SLACK)
            .is_some_and(|touched| self.take(change, &touched, allowance))
    }

    /// Vertices of a sound change whose valences alone do not cost too much; most proposals end here.
    fn promising(&mut self, change: &Change, most: f64) -> Option<Vec<u32>> {
        let touched = touched(&self.m, change)?;
        let before = stars(&self.m, &touched)?;
        let arcs_before = arcs(&self.m, &touched);
        let undo = self.m.apply(change);
        let good = stars(&self.m, &touched).is_some_and(|after| {
            self.annealing.cost(&after) - self.annealing.cost(&before) <= most
                && valid(&self.m, change, &touched, &before, &after)
                && (change.shortens_rim || arcs(&self.m, &touched) == arcs_before)
        });
        self.m.undo(undo);
        good.then_some(touched)
    }

    fn take(&mut self, change: &Change, touched: &[u32], allowance: f64) -> bool {
        let before = self.annealing.local_energy(&self.m, touched);
        let mut undo = self.m.apply(change);
        smooth_near(&mut self.m, touched, &mut undo);
        let after = self.annealing.local_energy(&self.m, touched);
        let good = matches!((before, after), (Some(b), Some(a)) if a - b <= allowance);
        if !good {
            self.m.undo(undo);
        }
        good
    }
}

/// Corners of the quads that go and come, sorted; none when a new quad is degenerate.
fn touched(m: &QuadMesh, change: &Change) -> Option<Vec<u32>> {
    let degenerate = |q: &[u32; 4]| (0..4).any(|k| q[k + 1..].contains(&q[k]));
    if change.add.iter().any(degenerate) {
        return None;
    }
    let removed = change.remove.iter().filter_map(|&i| m.quad(i));
    let mut out: Vec<u32> = removed
        .chain(change.add.iter().copied())
        .flatten()
        .collect();
    out.sort_unstable();
    out.dedup();
    Some(out)
}

/// Rim and seam sides with an end among the vertices, with their counts of quads.
fn arcs(m: &QuadMesh, vertices: &[u32]) -> Vec<([u32; 2], usize)> {
    let mut out = Vec::new();
    for &v in vertices {
        let mut ends = m.spoke_ends(v);
        ends.sort_unstable();
        for run in ends.chunk_by(|a, b| a == b).filter(|run| run.len() != 2) {
            out.push(([v, run[0]], run.len()));
        }
    }
    out
}

fn stars(m: &QuadMesh, vertices: &[u32]) -> Option<Vec<Star>> {
    vertices.iter().map(|&v| star(m, v)).collect()
}

/// Does the mesh around a change still have the same sheets, and valid quads?
fn valid(m: &QuadMesh, change: &Change, touched: &[u32], before: &[Star], after: &[Star]) -> bool {
    for ((&v, old), new) in touched.iter().zip(before).zip(after) {
        let class = m.class[v as usize];
        if new.fans() == 0 {
            // Gone; a vertex that something else holds must stay.
            if !m.beams[v as usize].is_empty() || !matches!(class, Class::Interior | Class::Rim) {
                return false;
            }
        } else if !new.valid(class) || old.fans() != 0 && new.fans() != old.fans() {
            return false;
        }
    }
    // Two quads over the same corners enclose nothing.
    change.add.iter().all(|q| {
        let twin = |&i: &u32| m.quad(i).is_some_and(|p| p.iter().all(|v| q.contains(v)));
        m.around[q[0] as usize].iter().filter(|i| twin(i)).count() == 1
            && (0..4).all(|k| !m.beams[q[k] as usize].contains(&q[(k + 1) % 4]))
    })
}

/// SplitMix64 (Steele et al. 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }

    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::super::arcs;
    use super::super::complex::Complex;
    use super::super::layout::Layout;
    use super::super::polygons::Polygon;
    use super::*;
    use crate::Vec3;

    const N: u32 = 8;

    fn reference() -> Reference {
        let n = 4 * N + 1;
        let at = |i: u32| 0.25 * f64::from(i);
        let points: Vec<Vec3> = (0..n * n)
            .map(|v| Vec3::new(at(v % n), at(v / n), 0.0))
            .collect();
        let triangles: Vec<[u32; 3]> = (0..(n - 1) * (n - 1))
            .map(|c| c / (n - 1) * n + c % (n - 1))
            .flat_map(|v| [[v, v + 1, v + n], [v + 1, v + n + 1, v + n]])
            .collect();
        let radii = vec![0.5; points.len()];
        let c = Complex::new(points, radii, &triangles, &[]);
        Reference::new(&c, &arcs::trace(&c), 0.1, true)
    }

    /// A square plate of unit quads.
    fn plate() -> QuadMesh {
        let n = N + 1;
        let points: Vec<Vec3> = (0..n * n)
            .map(|v| Vec3::new(f64::from(v % n), f64::from(v / n), 0.0))
            .collect();
        let quads: Vec<Option<Polygon>> = (0..N * N)
            .map(|c| c / N * n + c % N)
            .map(|v| Some(Polygon::quad([v, v + 1, v + n + 1, v + n], 0)))
            .collect();
        QuadMesh::new(&points, &vec![0.5; points.len()], &quads, &[])
    }

    const SIZING: Sizing = Sizing {
        factor: 0.0,
        least: 1.0,
        most: 1.0,
    };

    fn irregular(m: &QuadMesh) -> usize {
        (0..m.points.len())
            .filter(|&v| m.class[v] == Class::Interior && !m.around[v].is_empty())
            .filter(|&v| m.around[v].len() != 4)
            .count()
    }

    #[test]
    fn a_muddled_plate_becomes_regular_again() {
        let (reference, mut m) = (reference(), plate());
        let before = m.betti();
        for i in [9, 20, 33, 36, 51] {
            let change = rotate(&m, i, 1, i % 2 == 0).expect("a hexagon");
            m.apply(&change);
        }
        assert!(irregular(&m) >= 10);
        let annealing = Annealing {
            reference: &reference,
            sizing: &SIZING,
            effort: Layout::Plain.effort(),
            searches: 3,
            seed: 1,
        };
        let monitor = Monitor::default();
        let out = anneal(&m, &annealing, &monitor).expect("not cancelled");
        let out = out.expect("a better plate");
        assert!(irregular(&out) <= 2, "{} irregular", irregular(&out));
        assert_eq!(out.betti(), before);
    }

    #[test]
    fn every_change_can_be_undone() {
        let mut m = plate();
        let sorted = |m: &QuadMesh| {
            let mut around = m.around.clone();
            around.iter_mut().for_each(|a| a.sort_unstable());
            (m.quads.clone(), around, m.points.clone())
        };
        let before = sorted(&m);
        for i in 0..m.quads.len() as u32 {
            for k in 0..4 {
                let points = m.points.len();
                let corner = m.quad(i).expect("a quad")[k];
                let changes = [
                    rotate(&m, i, k, true),
                    collapse(&m, i, k),
                    shorten_rim(&m, i, k),
                    open(&mut m, corner, i, [0, 2]),
                ];
                for change in changes.into_iter().flatten() {
                    let mut undo = m.apply(&change);
                    if let Some(touched) = touched(&m, &change) {
                        smooth_near(&mut m, &touched, &mut undo);
                    }
                    m.undo(undo);
                }
                m.truncate_points(points);
                assert!(sorted(&m) == before, "quad {i}, corner {k}");
            }
        }
    }

    #[test]
    fn spokes_beyond_the_fan_open_nothing() {
        // The number of quads at a vertex may exceed that of its fan: the subtraction went below zero.
        let mut m = plate();
        let v = N + 2;
        for i in 0..9 {
            for j in 0..9 {
                let change = open(&mut m, v, 0, [i, j]);
                assert!(change.is_none() || i.max(j) <= 4);
            }
        }
    }
}
