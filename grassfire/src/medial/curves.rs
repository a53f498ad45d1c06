//! Pruning of the curves (edges without faces), branch by branch.

use std::collections::BinaryHeap;

use super::burn::{Alive, distance, key, unkey};
use super::complex::Complex;
use super::delaunay::NONE;

/// One burnt curve edge.
struct Burnt {
    edge: u32,
    /// The end that burnt first.
    outer: u32,
    branch: u32,
    /// The whole component ends here: nothing of it is left.
    last: bool,
}

/// Removes dangling curves whose erosion thickness is small.
///
/// 1. Burn all curves from their tips, as faces burn from rims; where branches meet, the latest fire
///    goes on. A branch is what one fire burnt from its tip to the place where it had to stop.
///    Time runs along chords of a few voxels.
/// 2. A branch is significant when its erosion thickness at its root exceeds `limit(radius there)`.
///    Judging at the root, not edge by edge from the tip, is what keeps lattice zig-zag at the tips
///    from blocking the fire.
/// 3. Keep significant branches and whatever carries something kept. A component that would vanish
///    keeps one edge.
///
/// Returns the edges kept for that reason.
pub(super) fn prune_curves(
    complex: &Complex,
    alive: &mut Alive,
    limit: impl Fn(f32) -> f32,
) -> Vec<u32> {
    let (burnt, significant) = burn_curves(complex, alive, limit);
    let mut carries = vec![false; complex.radii.len()];
    let mut points = Vec::new();
    for b in &burnt {
        let kept = carries[b.outer as usize] || significant[b.branch as usize];
        let ends = complex.edges[b.edge as usize];
        let vanishing = b.last && !kept && !ends.iter().any(|&v| carries[v as usize]);
        if vanishing {
            points.push(b.edge);
        }
        if kept || vanishing {
            ends.iter().for_each(|&v| carries[v as usize] = true);
        } else {
            alive.edges[b.edge as usize] = false;
        }
    }
    points
}

/// Which edges are curves, where they meet, and how many edges that are left every vertex has.
fn curves(complex: &Complex, alive: &Alive) -> (Vec<bool>, Incidence, Vec<u32>) {
    let is_curve: Vec<bool> = (0..complex.edges.len() as u32)
        .map(|e| alive.edges[e as usize] && alive.faces_at(complex, e).next().is_none())
        .collect();
    let at = Incidence::of(complex, &is_curve);
    let mut degree = vec![0u32; complex.radii.len()];
    for (ends, _) in complex
        .edges
        .iter()
        .zip(&alive.edges)
        .filter(|(_, alive)| **alive)
    {
        ends.iter().for_each(|&v| degree[v as usize] += 1);
    }
    (is_curve, at, degree)
}

fn burn_curves(
    complex: &Complex,
    alive: &Alive,
    limit: impl Fn(f32) -> f32,
) -> (Vec<Burnt>, Vec<bool>) {
    let (mut left, at, mut degree) = curves(complex, alive);
    let mut front: BinaryHeap<_> = (0..degree.len())
        .filter(|&v| degree[v] == 1)
        .map(|v| key(complex.radii[v], v as u32))
        .collect();
    let mut branch_of = vec![NONE; degree.len()];
    let mut burnt: Vec<Burnt> = Vec::new();
    let mut significant: Vec<bool> = Vec::new();
    let mut anchors: Vec<Anchor> = Vec::new();
    while let Some(entry) = front.pop() {
        let (start, outer) = unkey(entry);
        let branch = branch_of[outer as usize];
        if degree[outer as usize] == 0 && branch != NONE {
            // Another fire took the edge ahead: this is where the branch ends.
            let radius = complex.radii[outer as usize];
            significant[branch as usize] = start - radius > limit(radius);
        }
        let edge = at.edges(outer).iter().copied().find(|&e| left[e as usize]);
        let (1, Some(edge)) = (degree[outer as usize], edge) else {
            continue;
        };
        let [a, b] = complex.edges[edge as usize];
        let inner = if a == outer { b } else { a };
        let (o, i) = (outer as usize, inner as usize);
        let branch = if branch == NONE {
            significant.push(false);
            anchors.push(Anchor {
                place: complex.centres[o],
                time: start,
            });
            significant.len() as u32 - 1
        } else {
            branch
        };
        let time = anchors[branch as usize]
            .run_to(&complex.centres[i])
            .max(start)
            .max(complex.radii[i]);
        left[edge as usize] = false;
        degree[o] -= 1;
        degree[i] -= 1;
        burnt.push(Burnt {
            edge,
            outer,
            branch,
            last: degree[i] == 0,
        });
        if degree[i] == 1 && at.edges(inner).iter().any(|&e| left[e as usize]) {
            branch_of[i] = branch;
            front.push(key(time, inner));
        } else {
            significant[branch as usize] = time - complex.radii[i] > limit(complex.radii[i]);
        }
    }
    (burnt, significant)
}

/// Cuts back dangling curves to the innermost place whose ball, widened by `tolerance(its radius)`, holds
/// all balls from there to the tip: what lies beyond is a spur to the surface.
pub(super) fn trim_tips(complex: &Complex, alive: &mut Alive, tolerance: impl Fn(f32) -> f32) {
    let (_, at, mut degree) = curves(complex, alive);
    for tip in (0..degree.len() as u32)
        .filter(|&v| degree[v as usize] == 1)
        .collect::<Vec<_>>()
    {
        let (vertices, edges) = way_in(complex, alive, &at, &degree, tip);
        let sphere = |i: usize| {
            (
                &complex.centres[vertices[i] as usize],
                complex.radii[vertices[i] as usize],
            )
        };
        let holds = |&i: &usize| {
            let (centre, radius) = sphere(i);
            (0..i)
                .all(|j| distance(centre, sphere(j).0) + sphere(j).1 <= radius + tolerance(radius))
        };
        let Some(cut) = (1..edges.len()).rev().find(holds) else {
            continue;
        };
        for i in 0..cut {
            alive.edges[edges[i] as usize] = false;
            degree[vertices[i] as usize] = 0;
        }
        degree[vertices[cut] as usize] -= 1;
    }
}

/// Vertices and edges from a tip to the next junction, but not much farther than one diameter.
fn way_in(
    complex: &Complex,
    alive: &Alive,
    at: &Incidence,
    degree: &[u32],
    tip: u32,
) -> (Vec<u32>, Vec<u32>) {
    let (mut vertices, mut edges) = (vec![tip], Vec::new());
    let mut v = tip;
    while let Some(&e) = at
        .edges(v)
        .iter()
        .find(|e| alive.edges[**e as usize] && edges.last() != Some(*e))
    {
        let [a, b] = complex.edges[e as usize];
        v = if a == v { b } else { a };
        vertices.push(v);
        edges.push(e);
        let away = distance(&complex.centres[tip as usize], &complex.centres[v as usize]);
        if degree[v as usize] != 2 || away > 2.0 * complex.radii[v as usize] + 2.0 * CHORD {
            break;
        }
    }
    (vertices, edges)
}

/// Where and when a fire last set its bearings: it is timed along chords of [`CHORD`] voxels, for a
/// path along Voronoi edges zigzags on a lattice and would be far too long.
struct Anchor {
    place: [f32; 3],
    time: f32,
}

/// Length over which zigzag is ignored, in voxels.
const CHORD: f32 = 4.0;

impl Anchor {
    /// When the fire reaches `place`.
    fn run_to(&mut self, place: &[f32; 3]) -> f32 {
        let chord = distance(&self.place, place);
        let time = self.time + chord;
        if chord >= CHORD {
            *self = Self {
                place: *place,
                time,
            };
        }
        time
    }
}

/// Curve edges at each vertex.
pub(super) struct Incidence {
    start: Vec<u32>,
    edges: Vec<u32>,
}

impl Incidence {
    pub(super) fn of(complex: &Complex, wanted: &[bool]) -> Self {
        let mut start = vec![0u32; complex.radii.len() + 1];
        let ends = || {
            complex
                .edges
                .iter()
                .enumerate()
                .filter(|(e, _)| wanted[*e])
                .flat_map(|(e, ends)| ends.map(|v| (v as usize, e as u32)))
        };
        ends().for_each(|(v, _)| start[v + 1] += 1);
        for v in 0..complex.radii.len() {
            start[v + 1] += start[v];
        }
        let mut fill = start.clone();
        let mut edges = vec![0; start[complex.radii.len()] as usize];
        for (v, e) in ends() {
            edges[fill[v] as usize] = e;
            fill[v] += 1;
        }
        Self { start, edges }
    }

    pub(super) fn edges(&self, v: u32) -> &[u32] {
        &self.edges[self.start[v as usize] as usize..self.start[v as usize + 1] as usize]
    }
}
