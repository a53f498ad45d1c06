//! The checked skeleton with its adjacency, split and refined so that every vertex has a rule.

use super::chords::split_tight_strips;
use super::sectors::sort_sectors;
use super::{RuleCounts, STAGE, ThickenError, ThickenOptions, node, unit};
use crate::Vec3;
use crate::monitor::Monitor;
use crate::skeleton::Skeleton;

/// An edge with quads.
#[derive(Debug, Clone)]
pub(super) struct Edge {
    /// Lower and higher vertex.
    pub ends: [u32; 2],
    /// Quads on it, as (quad, corner where the edge starts in the cycle of the quad); counter-clockwise about it.
    pub uses: Vec<(u32, u8)>,
}

/// Sheets and beams with adjacency.
#[derive(Debug, Clone, Default)]
pub(super) struct Complex {
    pub points: Vec<Vec3>,
    /// Radii times the scale.
    pub radii: Vec<f64>,
    /// Input point of each vertex.
    pub source: Vec<u32>,
    pub quads: Vec<[u32; 4]>,
    pub beams: Vec<[u32; 2]>,
    /// Edges with quads, ascending.
    pub edges: Vec<Edge>,
    /// Edge from corner k to the next one, for every quad.
    pub quad_edges: Vec<[u32; 4]>,
    /// Quads at each vertex as (quad, corner).
    pub corners: Vec<Vec<(u32, u8)>>,
    /// Beam neighbours of each vertex, ascending.
    pub beam_neighbours: Vec<Vec<u32>>,
    /// Unit normal of each quad by its cycle.
    pub normals: Vec<Vec3>,
    /// Mean of the corners of each quad.
    pub centres: Vec<Vec3>,
}

/// A connected piece of the quads at one vertex.
#[derive(Debug, Clone)]
pub(super) struct Fan {
    /// Quads as (quad, corner), ascending.
    pub corners: Vec<(u32, u8)>,
    /// Rim edges at the vertex that belong to the piece.
    pub rims: Vec<u32>,
    /// No seam and exactly two rims: a half disc.
    pub plain: bool,
}

/// Checks the input and builds the complex (steps 1 of [`super::thicken`]).
pub(super) fn prepare(
    skeleton: &Skeleton,
    options: &ThickenOptions,
    rules: &mut RuleCounts,
    monitor: &Monitor,
) -> Result<Complex, ThickenError> {
    validate(skeleton)?;
    let mut complex = Complex {
        points: skeleton.points.clone(),
        radii: skeleton.radii.iter().map(|r| r * options.scale).collect(),
        source: (0..skeleton.points.len() as u32).collect(),
        quads: skeleton.quads.clone(),
        beams: skeleton.beams.clone(),
        ..Complex::default()
    };
    complex.link();
    drop_doubled_beams(&mut complex, monitor);
    // A tie moves corners, which may spoil the ring of a neighbour: repeat, every round ties at
    // least one of the finitely many pieces.
    while tie_pieces(&mut complex, options, rules) {
        monitor.check()?;
        complex.link();
    }
    if split_tight_strips(&mut complex, rules) {
        complex.link();
    }
    add_middles(&mut complex, rules);
    complex.link();
    Ok(complex)
}

fn validate(skeleton: &Skeleton) -> Result<(), ThickenError> {
    let n = skeleton.points.len();
    if skeleton.quads.is_empty() && skeleton.beams.is_empty() {
        return Err(ThickenError::Empty);
    }
    if skeleton.radii.len() != n || n > i32::MAX as usize {
        return Err(ThickenError::BadCount {
            points: n,
            radii: skeleton.radii.len(),
        });
    }
    let bad_quad = |q: &[u32; 4]| (0..4).any(|k| q[k] as usize >= n || q[k + 1..].contains(&q[k]));
    if let Some(quad) = skeleton.quads.iter().position(bad_quad) {
        return Err(ThickenError::BadQuad { quad: quad as u32 });
    }
    let bad_beam = |b: &[u32; 2]| b[0] == b[1] || b.iter().any(|&v| v as usize >= n);
    if let Some(beam) = skeleton.beams.iter().position(bad_beam) {
        return Err(ThickenError::BadBeam { beam: beam as u32 });
    }
    let used = skeleton
        .quads
        .iter()
        .flatten()
        .chain(skeleton.beams.iter().flatten());
    for &point in used {
        let (place, radius) = (
            skeleton.points[point as usize],
            skeleton.radii[point as usize],
        );
        let far = place.iter().any(|x| !x.is_finite() || x.abs() > 1e9);
        if far || !(radius > 0.0 && radius < 1e9) {
            return Err(ThickenError::BadPoint {
                point,
                place,
                radius,
            });
        }
    }
    Ok(())
}

impl Complex {
    /// Rebuilds all adjacency.
    fn link(&mut self) {
        let n = self.points.len();
        self.corners = vec![Vec::new(); n];
        self.beam_neighbours = vec![Vec::new(); n];
        let mut uses = Vec::with_capacity(4 * self.quads.len());
        for (q, quad) in self.quads.iter().enumerate() {
            for k in 0..4 {
                let (a, b) = (quad[k], quad[(k + 1) % 4]);
                uses.push(([a.min(b), a.max(b)], q as u32, k as u8));
                self.corners[a as usize].push((q as u32, k as u8));
            }
        }
        uses.sort_unstable();
        self.edges.clear();
        self.quad_edges = vec![[0; 4]; self.quads.len()];
        for (ends, q, k) in uses {
            if self.edges.last().is_none_or(|e| e.ends != ends) {
                self.edges.push(Edge {
                    ends,
                    uses: Vec::new(),
                });
            }
            self.quad_edges[q as usize][k as usize] = (self.edges.len() - 1) as u32;
            if let Some(edge) = self.edges.last_mut() {
                edge.uses.push((q, k));
            }
        }
        for &[a, b] in &self.beams {
            self.beam_neighbours[a as usize].push(b);
            self.beam_neighbours[b as usize].push(a);
        }
        self.beam_neighbours
            .iter_mut()
            .for_each(|list| list.sort_unstable());
        let points = &self.points;
        let corners = |q: &[u32; 4]| q.map(|v| points[v as usize]);
        self.centres = self
            .quads
            .iter()
            .map(|q| corners(q).iter().sum::<Vec3>() / 4.0)
            .collect();
        self.normals = self
            .quads
            .iter()
            .map(|q| {
                let [a, b, c, d] = corners(q);
                unit((c - a).cross(&(d - b)))
            })
            .collect();
        sort_sectors(self);
    }

    /// Position of vertex `v`.
    #[inline]
    pub fn at(&self, v: u32) -> Vec3 {
        self.points[v as usize]
    }

    /// The two edges at corner `k` of quad `q`: leaving the corner and arriving at it.
    #[inline]
    pub fn corner_edges(&self, (q, k): (u32, u8)) -> [u32; 2] {
        let edges = self.quad_edges[q as usize];
        [edges[k as usize], edges[(k as usize + 3) % 4]]
    }

    /// Quad `q` runs from the lower to the higher end of edge `e`.
    fn runs_along(&self, e: u32, q: u32) -> bool {
        let edge = &self.edges[e as usize];
        edge.uses
            .iter()
            .any(|&(i, k)| i == q && self.quads[q as usize][k as usize] == edge.ends[0])
    }

    /// Edge with quads between two vertices.
    fn edge_between(&self, a: u32, b: u32) -> Option<usize> {
        self.edges
            .binary_search_by_key(&[a.min(b), a.max(b)], |e| e.ends)
            .ok()
    }

    /// The connected pieces of the quads at `v`, by their lowest quad.
    pub fn fans(&self, v: u32) -> Vec<Fan> {
        let corners = &self.corners[v as usize];
        let mut piece: Vec<usize> = (0..corners.len()).collect();
        let mut edges: Vec<(u32, usize)> = corners
            .iter()
            .enumerate()
            .flat_map(|(i, &c)| self.corner_edges(c).map(|e| (e, i)))
            .collect();
        edges.sort_unstable();
        for pair in edges.windows(2).filter(|p| p[0].0 == p[1].0) {
            let (a, b) = (root(&mut piece, pair[0].1), root(&mut piece, pair[1].1));
            piece[a.max(b)] = a.min(b);
        }
        let mut fans: Vec<Fan> = Vec::new();
        let mut fan_of = vec![usize::MAX; corners.len()];
        for (i, &corner) in corners.iter().enumerate() {
            let r = root(&mut piece, i);
            if fan_of[r] == usize::MAX {
                fan_of[r] = fans.len();
                fans.push(Fan {
                    corners: Vec::new(),
                    rims: Vec::new(),
                    plain: true,
                });
            }
            let fan = &mut fans[fan_of[r]];
            fan.corners.push(corner);
            for e in self.corner_edges(corner) {
                match self.edges[e as usize].uses.len() {
                    1 => fan.rims.push(e),
                    2 => {}
                    _ => fan.plain = false,
                }
            }
        }
        fans.iter_mut()
            .for_each(|fan| fan.plain &= fan.rims.len() == 2);
        fans
    }
}

/// +1 or -1 for each corner of `fan`, so that equal signs mean coherent cycles; for plain fans.
pub(super) fn coherent_signs(complex: &Complex, fan: &Fan) -> Vec<f64> {
    let mut signs = vec![0.0; fan.corners.len()];
    let mut stack = vec![0];
    signs[0] = 1.0;
    while let Some(i) = stack.pop() {
        for e in complex.corner_edges(fan.corners[i]) {
            for j in 0..fan.corners.len() {
                if signs[j] == 0.0 && complex.corner_edges(fan.corners[j]).contains(&e) {
                    let along = |c: (u32, u8)| complex.runs_along(e, c.0);
                    let coherent = along(fan.corners[i]) != along(fan.corners[j]);
                    signs[j] = if coherent { signs[i] } else { -signs[i] };
                    stack.push(j);
                }
            }
        }
    }
    signs
}

/// Root of `i` in a union-find forest, halving paths.
pub(super) fn root(parent: &mut [usize], mut i: usize) -> usize {
    while parent[i] != i {
        parent[i] = parent[parent[i]];
        i = parent[i];
    }
    i
}

fn drop_doubled_beams(complex: &mut Complex, monitor: &Monitor) {
    let mut seen = std::collections::BTreeSet::new();
    let mut kept = Vec::with_capacity(complex.beams.len());
    for (i, &[a, b]) in complex.beams.iter().enumerate() {
        let place = complex.at(a);
        let why = if complex.edge_between(a, b).is_some() {
            "runs along the edge of a quad"
        } else if !seen.insert([a.min(b), a.max(b)]) {
            "is there twice"
        } else {
            kept.push([a, b]);
            continue;
        };
        let text = format!(
            "beam {i} at ({:.2}, {:.2}, {:.2}) {why}: dropped",
            place.x, place.y, place.z
        );
        monitor.warn(STAGE, text);
    }
    if kept.len() != complex.beams.len() {
        complex.beams = kept;
        complex.link();
    }
}

/// Splits vertices whose quads fall into several pieces that no ring can join; ties the copies.
fn tie_pieces(complex: &mut Complex, options: &ThickenOptions, rules: &mut RuleCounts) -> bool {
    let before = rules.ties;
    for v in 0..complex.points.len() as u32 {
        let mut fans = complex.fans(v);
        if fans.len() < 2 || node::ring(complex, v, &fans, options).is_some() {
            continue;
        }
        fans.sort_by_key(|fan| std::cmp::Reverse(fan.corners.len()));
        for fan in fans.iter().skip(1) {
            let apart = tie_vector(complex, v, fan);
            let (middle, copy) = (complex.points.len() as u32, complex.points.len() as u32 + 1);
            for part in [0.5, 1.0] {
                complex.points.push(complex.at(v) + part * apart);
                complex.radii.push(complex.radii[v as usize]);
                complex.source.push(complex.source[v as usize]);
            }
            complex.beams.extend([[v, middle], [middle, copy]]);
            for &(q, k) in &fan.corners {
                complex.quads[q as usize][k as usize] = copy;
            }
            rules.ties += 1;
        }
    }
    rules.ties > before
}

/// From `v` to where its copy for `fan` goes.
fn tie_vector(complex: &Complex, v: u32, fan: &Fan) -> Vec3 {
    let at = complex.at(v);
    let count = fan.corners.len() as f64;
    let mean = fan
        .corners
        .iter()
        .map(|&(q, _)| complex.centres[q as usize] - at)
        .sum::<Vec3>()
        / count;
    let (length, radius) = (mean.norm(), complex.radii[v as usize]);
    if length > 0.3 * radius {
        return mean * (radius.clamp(0.5 * length, 0.75 * length) / length);
    }
    // Almost symmetric about v: leave along the normal, towards where the piece bends.
    let normals = fan
        .corners
        .iter()
        .map(|&(q, _)| complex.normals[q as usize]);
    let first = complex.normals[fan.corners[0].0 as usize];
    let normal = unit(
        normals
            .map(|n| if n.dot(&first) < 0.0 { -n } else { n })
            .sum(),
    );
    normal
        * if normal.dot(&mean) < 0.0 {
            -radius
        } else {
            radius
        }
}

/// Puts a vertex into every beam between two vertices that are not plain beam vertices.
fn add_middles(complex: &mut Complex, rules: &mut RuleCounts) {
    let plain = |c: &Complex, v: u32| {
        c.corners[v as usize].is_empty() && c.beam_neighbours[v as usize].len() == 2
    };
    for i in 0..complex.beams.len() {
        let [a, b] = complex.beams[i];
        if plain(complex, a) || plain(complex, b) {
            continue;
        }
        let middle = complex.points.len() as u32;
        complex.points.push((complex.at(a) + complex.at(b)) / 2.0);
        complex
            .radii
            .push((complex.radii[a as usize] + complex.radii[b as usize]) / 2.0);
        complex.source.push(complex.source[a as usize]);
        complex.beams[i] = [a, middle];
        complex.beams.push([middle, b]);
        rules.middles += 1;
    }
}
