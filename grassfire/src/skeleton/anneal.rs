//! Simulated annealing of the quads toward few irregular vertices of the body.
//!
//! Matching and greedy clean-up leave pairs of vertices with three and five quads that no single change removes. Annealing
//! (Kirkpatrick et al. 1983, <https://doi.org/10.1126/science.220.4598.671>) walks such pairs together or to the rims.

use rayon::prelude::*;

use super::body_valence::star;
use super::coarsen::Sizing;
use super::complex::Class;
use super::quad_mesh::{Change, QuadMesh};
use super::quad_moves::{collapse, open, rotate, shorten_rim};
use super::reference::Reference;
use super::shape_cost::{settle, shape_cost, smooth_near};
use crate::monitor::{Cancelled, Monitor};

/// Proposals a quad and search.
const PROPOSALS: usize = 300;
const MOST_PROPOSALS: usize = 200_000;
/// Temperatures of the first and last proposal, in irregular body valences.
const HOT: f64 = 2.5;
const COLD: f64 = 0.3;
/// How often all vertices are put back onto sheets and rims.
const SETTLINGS: usize = 24;

/// What a search needs besides the mesh.
pub(crate) struct Annealing<'a> {
    pub reference: &'a Reference,
    pub sizing: &'a Sizing,
    pub searches: usize,
    pub seed: u64,
}

/// Several searches from the same mesh; the best one wins, the first of equals.
pub(crate) fn anneal(
    mesh: &QuadMesh,
    annealing: &Annealing,
    monitor: &Monitor,
) -> Result<QuadMesh, Cancelled> {
    let found: Result<Vec<(f64, QuadMesh)>, Cancelled> = (0..annealing.searches)
        .into_par_iter()
        .map(|k| {
            let seed = annealing.seed.wrapping_add(k as u64);
            Search::new(mesh.clone(), annealing, seed).run(monitor)
        })
        .collect();
    let mut best = (energy(mesh, annealing.sizing), None);
    for (e, m) in found? {
        if e < best.0 {
            best = (e, Some(m));
        }
    }
    Ok(best.1.unwrap_or_else(|| mesh.clone()))
}

/// Cost of all vertices and quads.
fn energy(m: &QuadMesh, sizing: &Sizing) -> f64 {
    let vertices: f64 = (0..m.points.len() as u32)
        .filter(|&v| !m.around[v as usize].is_empty())
        .map(|v| star(m, v).map_or(100.0, |s| s.cost()))
        .sum();
    let quads: f64 = m.alive().map(|(_, q)| shape_cost(m, &q, sizing)).sum();
    vertices + quads
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
        let n = (PROPOSALS * self.m.alive().count()).min(MOST_PROPOSALS);
        let mut best = (energy(&self.m, self.annealing.sizing), self.m.clone());
        for leg in 0..SETTLINGS {
            monitor.check()?;
            let t = leg as f64 / (SETTLINGS - 1) as f64;
            let temperature = HOT * (COLD / HOT).powf(t);
            for _ in 0..n / SETTLINGS {
                self.step(temperature);
            }
            settle(&mut self.m, self.annealing.reference, 2);
            let now = energy(&self.m, self.annealing.sizing);
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
        let sizing = self.annealing.sizing;
        let Some(touched) = touched(&self.m, change) else {
            return false;
        };
        let before_arcs = arcs(&self.m, &touched);
        let before_fans = fans(&self.m, &touched);
        let (Some(before_fans), Some(before)) =
            (before_fans, local_energy(&self.m, &touched, sizing))
        else {
            return false;
        };
        let mut undo = self.m.apply(change);
        let sound = valid(&self.m, change, &touched, &before_fans)
            && (change.shortens_rim || arcs(&self.m, &touched) == before_arcs);
        if sound {
            smooth_near(&mut self.m, &touched, &mut undo);
            if let Some(after) = local_energy(&self.m, &touched, sizing) {
                let worse = after - before;
                if worse <= 0.0 || self.random.unit() < (-worse / temperature).exp() {
                    return true;
                }
            }
        }
        self.m.undo(undo);
        false
    }
}

/// Corners of the quads that go and come, sorted; none when a new quad is degenerate.
fn touched(m: &QuadMesh, change: &Change) -> Option<Vec<u32>> {
    let degenerate = |q: &[u32; 4]| (0..4).any(|k| q[k + 1..].contains(&q[k]));
    if change.add.iter().any(degenerate) {
        return None;
    }
    let removed = change.remove.iter().filter_map(|&i| m.quad(i));
    let mut out: Vec<u32> = removed.chain(change.add.iter().copied()).flatten().collect();
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

/// Fans of each vertex that is not free inside a sheet.
fn fans(m: &QuadMesh, vertices: &[u32]) -> Option<Vec<usize>> {
    vertices
        .iter()
        .map(|&v| star(m, v).map(|s| s.fans()))
        .collect()
}

/// Does the mesh around a change still have the same shape of sheets, rims and seams?
fn valid(m: &QuadMesh, change: &Change, touched: &[u32], before: &[usize]) -> bool {
    for (&v, &fans) in touched.iter().zip(before) {
        let class = m.class[v as usize];
        let Some(s) = star(m, v) else { return false };
        if s.fans() == 0 {
            // Gone; a vertex that something else holds must stay.
            if !m.beams[v as usize].is_empty() || !matches!(class, Class::Interior | Class::Rim) {
                return false;
            }
            continue;
        }
        if !s.valid(class) || fans != 0 && s.fans() != fans {
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

/// Cost of the vertices and of all quads around them.
fn local_energy(m: &QuadMesh, vertices: &[u32], sizing: &Sizing) -> Option<f64> {
    let mut sum = 0.0;
    let mut quads: Vec<u32> = Vec::with_capacity(40);
    for &v in vertices {
        sum += star(m, v)?.cost();
        quads.extend(&m.around[v as usize]);
    }
    quads.sort_unstable();
    quads.dedup();
    for i in quads {
        sum += shape_cost(m, &m.quad(i)?, sizing);
    }
    Some(sum)
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
