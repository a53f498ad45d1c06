//! Planes and cylinders in a mesh: random hypotheses, region growing, least squares.

use super::RecogniseOptions;
use super::facets::{Facets, NONE};
use super::fitting::{distance, fit, measure, merge, outward};
use crate::Vec3;
use crate::cad::primitives::Primitive;
use crate::monitor::{Cancelled, Monitor};

/// A plane or a cylinder of the proposal.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// The surface; `concave` cylinders are walls of holes.
    pub surface: Primitive,
    /// Triangles on it.
    pub triangles: Vec<u32>,
    /// Their area, mm2.
    pub area: f64,
    /// Angle of the circumference that they cover, radians; 0 for a plane.
    pub angle: f64,
    /// Where they begin and end along the axis from its `origin`, mm; zeros for a plane.
    pub extent: [f64; 2],
    /// Middle of the triangles, weighted by area, mm.
    pub middle: Vec3,
    /// Root mean square distance of their points, mm.
    pub rms: f64,
    /// Largest distance of their points, mm.
    pub residual: f64,
}

/// Triangles around a seed that hypotheses are made from.
const PATCH: usize = 48;
/// Neighbours in such a patch differ by less than this, degrees.
const SMOOTH: f64 = 40.0;
/// Normals of a plane's triangles differ from its own by less than this, degrees.
const PLANE_ANGLE: f64 = 8.0;
/// Rounds of growing and fitting.
const ROUNDS: usize = 8;
/// A cylinder must turn by at least this, degrees: less is as well a plane or a freeform surface.
const MIN_TURN: f64 = 40.0;
/// All growing together visits at most this many triangles for each triangle of the mesh.
const VISITS: usize = 60;

/// Finds planes and cylinders, the largest first.
///
/// 1. Visit the triangles in random order. Around each one take a patch of smooth neighbours; from its normals make one
///    plane, and one cylinder from each of some random pairs of triangles; keep what most of the patch's area follows.
/// 2. Let the surface grow over the mesh from the seed, fit it to its points by least squares, repeat until it stays.
/// 3. Keep it when it is large enough; its triangles are used up.
/// 4. Merge pieces of one surface, fit them together without outliers, measure them.
///
/// After: R. Schnabel, R. Wahl, R. Klein (2007), Efficient RANSAC for point-cloud shape detection, Computer Graphics Forum 26(2),
/// doi 10.1111/j.1467-8659.2007.01016.x.
///
/// The same mesh and seed give the same result. Limits: no cones, spheres and tori; work is bounded to a fixed number of
/// visits for each triangle, so that on meshes of pure noise the last seeds may not be looked at.
///
/// # Errors
/// [`Cancelled`].
pub fn surfaces(
    mesh: &crate::mesh::TriMesh,
    options: &RecogniseOptions,
    monitor: &Monitor,
) -> Result<Vec<Candidate>, Cancelled> {
    let facets = Facets::new(mesh);
    search(&facets, options, monitor)
}

pub(super) fn search(
    facets: &Facets,
    options: &RecogniseOptions,
    monitor: &Monitor,
) -> Result<Vec<Candidate>, Cancelled> {
    let n = facets.areas.len();
    let mut search = Search {
        facets,
        tolerance: options.tolerance * facets.edge,
        normal: options.normal_angle.to_radians().cos(),
        min_area: options.min_area * facets.edge * facets.edge,
        tries: options.tries,
        random: Random(options.seed),
        used: vec![false; n],
        tried: vec![false; n],
        mark: vec![0; n],
        stamp: 0,
        visits: 0,
    };
    let mut order: Vec<u32> = (0..n as u32).collect();
    for i in (1..n).rev() {
        order.swap(i, search.random.below(i + 1));
    }
    let mut found = Vec::new();
    for (k, &seed) in order.iter().enumerate() {
        if k % 1024 == 0 {
            monitor.step("recognise", "planes and cylinders", k as f64 / n as f64)?;
        }
        if search.visits > VISITS * n {
            break;
        }
        if !search.used[seed as usize] && !search.tried[seed as usize] {
            found.extend(search.at_seed(seed));
        }
    }
    let merged = merge(facets, found, search.tolerance);
    let mut out: Vec<Candidate> = merged
        .into_iter()
        .filter_map(|(surface, triangles)| measure(facets, surface, triangles))
        .filter(|c| c.angle == 0.0 || c.angle.to_degrees() >= MIN_TURN)
        .collect();
    out.sort_by(|a, b| {
        b.area
            .total_cmp(&a.area)
            .then(a.triangles.cmp(&b.triangles))
    });
    Ok(out)
}

/// SplitMix64.
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) % n.max(1) as u64) as usize
    }
}

struct Search<'a> {
    facets: &'a Facets<'a>,
    tolerance: f64,
    /// Cosine.
    normal: f64,
    min_area: f64,
    tries: u32,
    random: Random,
    used: Vec<bool>,
    tried: Vec<bool>,
    mark: Vec<u32>,
    stamp: u32,
    visits: usize,
}

impl Search<'_> {
    fn at_seed(&mut self, seed: u32) -> Option<(Primitive, Vec<u32>)> {
        self.tried[seed as usize] = true;
        let patch = self.patch(seed);
        if patch.len() < 2 {
            return None;
        }
        let whole = self.facets.area(&patch);
        let mut best: Option<(f64, Primitive, Vec<u32>)> = None;
        let plane = self.plane(seed, &patch);
        let flat = self.score(&plane, &patch, 1.0);
        self.try_growing(seed, plane, &mut best);
        if (flat < 0.9 * whole || best.is_none())
            && let Some(cylinder) = self.best_cylinder(&patch, flat)
        {
            self.try_growing(seed, cylinder, &mut best);
        }
        let (area, surface, triangles) = best?;
        for &t in &triangles {
            self.tried[t as usize] = true;
        }
        if area < self.min_area {
            return None;
        }
        for &t in &triangles {
            self.used[t as usize] = true;
        }
        Some((surface, triangles))
    }

    /// Grows and keeps what covers more area. A cylinder must cover clearly more than a plane.
    fn try_growing(
        &mut self,
        seed: u32,
        start: Primitive,
        best: &mut Option<(f64, Primitive, Vec<u32>)>,
    ) {
        if let Some((surface, triangles)) = self.grow_and_fit(seed, start) {
            let area = self.facets.area(&triangles);
            if best.as_ref().is_none_or(|b| area > 1.1 * b.0) {
                *best = Some((area, surface, triangles));
            }
        }
    }

    /// Smooth neighbours of the seed that are not used up.
    fn patch(&mut self, seed: u32) -> Vec<u32> {
        let smooth = SMOOTH.to_radians().cos();
        let (facets, used) = (self.facets, std::mem::take(&mut self.used));
        let out = self.spread(seed, PATCH, |from, to| {
            !used[to as usize]
                && facets.normals[from as usize].dot(&facets.normals[to as usize]) >= smooth
        });
        self.used = used;
        out
    }

    /// Breadth-first over neighbours that `joins(from, to)`.
    fn spread(&mut self, seed: u32, most: usize, joins: impl Fn(u32, u32) -> bool) -> Vec<u32> {
        self.stamp += 1;
        self.mark[seed as usize] = self.stamp;
        let mut out = vec![seed];
        let mut at = 0;
        while let Some(&from) = out.get(at).filter(|_| out.len() < most) {
            at += 1;
            for to in self.facets.next[from as usize] {
                if to != NONE && self.mark[to as usize] != self.stamp && joins(from, to) {
                    self.mark[to as usize] = self.stamp;
                    out.push(to);
                }
            }
        }
        self.visits += out.len();
        out
    }

    fn plane(&self, seed: u32, patch: &[u32]) -> Primitive {
        let own = self.facets.normals[seed as usize];
        // The normals of the seed's flat surroundings; the seed's own may be that of a sliver.
        let near = |t: &&u32| self.facets.normals[**t as usize].dot(&own) > 0.98;
        let sum: Vec3 = patch
            .iter()
            .filter(near)
            .map(|&t| self.facets.normals[t as usize] * self.facets.areas[t as usize])
            .sum();
        let normal = sum.try_normalize(0.0).unwrap_or(own);
        Primitive::Plane {
            normal,
            offset: normal.dot(&self.facets.middles[seed as usize]),
        }
    }

    fn best_cylinder(&mut self, patch: &[u32], flat: f64) -> Option<Primitive> {
        let mut best: Option<(f64, Primitive)> = None;
        for k in 0..self.tries {
            let a = if k % 2 == 0 {
                0
            } else {
                self.random.below(patch.len())
            };
            let b = self.random.below(patch.len());
            let Some(cylinder) = self.through(patch[a], patch[b]) else {
                continue;
            };
            let score = self.score(&cylinder, patch, 2.0);
            if best.as_ref().is_none_or(|x| score > x.0) {
                best = Some((score, cylinder));
            }
        }
        best.filter(|(score, _)| *score > 1.1 * flat)
            .map(|(_, cylinder)| cylinder)
    }

    /// The cylinder through the middles of two triangles with their normals.
    fn through(&self, a: u32, b: u32) -> Option<Primitive> {
        let [(p, n), (q, m)] = [a, b].map(|t| {
            (
                self.facets.middles[t as usize],
                self.facets.normals[t as usize],
            )
        });
        let direction = n.cross(&m).try_normalize(0.1)?;
        // In the plane across the axis: p + s n = q + t m.
        let gap = (q - p) - direction * (q - p).dot(&direction);
        let side = direction.cross(&m);
        let s = gap.dot(&side) / n.dot(&side);
        let origin = p + n * s;
        let radius_q = (q - origin) - direction * (q - origin).dot(&direction);
        let radius = (s.abs() + radius_q.norm()) / 2.0;
        (radius.is_finite() && radius > 0.0).then_some(Primitive::Cylinder {
            origin,
            direction,
            radius,
            concave: s > 0.0,
        })
    }

    fn score(&self, surface: &Primitive, patch: &[u32], factor: f64) -> f64 {
        let limit = factor * self.tolerance;
        let on = |t: &&u32| self.lies_on(surface, **t, limit);
        patch
            .iter()
            .filter(on)
            .map(|&t| self.facets.areas[t as usize])
            .sum()
    }

    fn lies_on(&self, surface: &Primitive, t: u32, limit: f64) -> bool {
        let near = self
            .facets
            .mesh
            .corners(t as usize)
            .iter()
            .all(|p| distance(surface, p).abs() <= limit);
        let normal = self.facets.normals[t as usize];
        let (own, cosine) = match surface {
            Primitive::Plane { normal, .. } => (*normal, PLANE_ANGLE.to_radians().cos()),
            Primitive::Cylinder { .. } => (
                outward(surface, &self.facets.middles[t as usize]),
                self.normal,
            ),
        };
        near && (normal == Vec3::zeros() || normal.dot(&own) >= cosine)
    }

    fn grow(&mut self, seed: u32, surface: &Primitive, limit: f64) -> Vec<u32> {
        if !self.lies_on(surface, seed, limit) {
            return Vec::new();
        }
        self.stamp += 1;
        self.mark[seed as usize] = self.stamp;
        let mut out = vec![seed];
        let mut at = 0;
        while let Some(&from) = out.get(at) {
            at += 1;
            for to in self.facets.next[from as usize] {
                if to == NONE || self.mark[to as usize] == self.stamp || self.used[to as usize] {
                    continue;
                }
                self.mark[to as usize] = self.stamp;
                if self.lies_on(surface, to, limit) {
                    out.push(to);
                }
            }
        }
        self.visits += out.len();
        out
    }

    fn grow_and_fit(&mut self, seed: u32, start: Primitive) -> Option<(Primitive, Vec<u32>)> {
        let mut surface = start;
        let mut count = 0;
        for round in 0..ROUNDS {
            // The first surface comes from two normals only: it gets some slack.
            let limit = self.tolerance * if round == 0 { 2.0 } else { 1.0 };
            let triangles = self.grow(seed, &surface, limit);
            if triangles.len() < 2 {
                return None;
            }
            if round > 0 && triangles.len() == count || round + 1 == ROUNDS {
                return Some((surface, triangles));
            }
            count = triangles.len();
            surface = fit(self.facets, &surface, &triangles)?;
        }
        None
    }
}
