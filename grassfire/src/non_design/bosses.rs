//! Bores with the material around them: concentric walls, end planes, sleeves.

use super::RecogniseOptions;
use super::facets::Facets;
use super::notches::{Notch, notches};
use super::ransac::Candidate;
use crate::Vec3;
use crate::cad::primitives::{Primitive, across};
use crate::mesh::{Bvh, Winding};

/// A through bore with the sleeve of material around it that is to be kept.
#[derive(Debug, Clone, PartialEq)]
pub struct Boss {
    /// Index of the bore among the candidates.
    pub bore: usize,
    /// Index of the concentric outer wall, where there is one.
    pub wall: Option<usize>,
    /// Indices of the flat faces across the axis at either end, where there are some.
    pub ends: [Option<usize>; 2],
    /// Point of the axis, mm.
    pub origin: Vec3,
    /// Unit direction of the axis.
    pub direction: Vec3,
    /// Radius of the bore, mm.
    pub radius: f64,
    /// Outer radius of the sleeve, mm.
    pub outer_radius: f64,
    /// The sleeve's ends, mm along `direction` from `origin`.
    pub extent: [f64; 2],
    /// Where the material ends before the outer wall; turns begin at `cad::primitives::across` of `direction`.
    pub notches: Vec<Notch>,
    /// How far the hole goes on free of material beyond its ends, mm; at most one radius is looked at.
    pub free: f64,
    /// Largest distance of the bore's points to its cylinder, mm.
    pub residual: f64,
}

/// Steps around the axis and along it in which walls are sampled.
const AROUND: usize = 24;
const ALONG: usize = 5;
/// Directions in which an outer wall is looked for.
const NOTCH_STEPS: usize = 72;
/// An outer wall is missing where the material ends by more than this before it, edge lengths.
const NOTCH_DEPTH: f64 = 1.5;
/// Share of the directions in which the wall may end earlier: a notch does not shorten the whole bore.
const NOTCH: f64 = 0.1;
/// Share of the material around a bore that may be thinner than the thickness a sleeve is made from.
const THIN: f64 = 0.15;
/// A sleeve is at least this thick, as a share of the bore's radius, or there is none.
const MIN_SLEEVE: f64 = 0.05;
/// A bore's wall is at least this long, as a share of its radius.
const MIN_LENGTH: f64 = 0.1;
/// How far a ball around the rim of a bore bulges out of it, over the rms of the bore's points: with less the wall may as
/// well be a band of a ball, for which this is 3.4 at most (the bulge is a parabola); bores of real parts have 100 and more.
const MIN_BULGE: f64 = 5.0;

/// Pairs bores with walls and end planes. For each candidate that is no plane: a boss, or why it is none.
///
/// 1. A bore is a concave cylinder around most of its circumference with nothing inside, open at both ends.
/// 2. Its ends: where the wall ends in nearly all directions; moved onto a flat face across the axis close by.
/// 3. Its outer wall: the smallest concentric convex cylinder, with notches where the material ends before it. Without one:
///    a sleeve that takes a share of the material around the bore, measured by rays away from the axis.
pub fn bosses(
    mesh: &crate::mesh::TriMesh,
    candidates: &[Candidate],
    options: &RecogniseOptions,
) -> Vec<(usize, Result<Boss, String>)> {
    pair(&Facets::new(mesh), candidates, options)
}

pub(super) fn pair(
    facets: &Facets,
    candidates: &[Candidate],
    options: &RecogniseOptions,
) -> Vec<(usize, Result<Boss, String>)> {
    let bvh = Bvh::new(facets.mesh);
    let winding = Winding::new(&bvh);
    let scene = Scene {
        facets,
        candidates,
        options,
        bvh: &bvh,
        winding: &winding,
    };
    let holes = (0..candidates.len()).filter(|&i| {
        matches!(
            candidates[i].surface,
            Primitive::Cylinder { concave: true, .. }
        )
    });
    holes.map(|i| (i, scene.boss(i))).collect()
}

/// The axis of a hole with its radius.
#[derive(Clone, Copy)]
struct Axis {
    origin: Vec3,
    direction: Vec3,
    radius: f64,
    across: [Vec3; 2],
}

impl Axis {
    fn away(&self, turn: f64) -> Vec3 {
        self.across[0] * turn.cos() + self.across[1] * turn.sin()
    }

    fn at(&self, t: f64, turn: f64, radius: f64) -> Vec3 {
        self.origin + self.direction * t + self.away(turn) * radius
    }

    /// The middle of the hole and eight points near its wall, at height `t`.
    fn ring(&self, t: f64, share: f64) -> Vec<Vec3> {
        let around = (0..8).map(|k| {
            let turn = 0.3 + std::f64::consts::TAU * f64::from(k) / 8.0;
            self.at(t, turn, share * self.radius)
        });
        std::iter::once(self.at(t, 0.0, 0.0))
            .chain(around)
            .collect()
    }
}

struct Scene<'a> {
    facets: &'a Facets<'a>,
    candidates: &'a [Candidate],
    options: &'a RecogniseOptions,
    bvh: &'a Bvh,
    winding: &'a Winding<'a>,
}

impl Scene<'_> {
    fn boss(&self, bore: usize) -> Result<Boss, String> {
        let candidate = &self.candidates[bore];
        let Primitive::Cylinder {
            origin,
            direction,
            radius,
            ..
        } = candidate.surface
        else {
            return Err("no cylinder".into());
        };
        let axis = Axis {
            origin,
            direction,
            radius,
            across: across(&direction),
        };
        let turn = candidate.angle.to_degrees();
        if turn < self.options.min_bore_angle {
            return Err(format!(
                "covers only {turn:.0} degrees of its circumference"
            ));
        }
        let wall_extent = self.wall_range(&axis, &candidate.triangles);
        let length = wall_extent[1] - wall_extent[0];
        if length < MIN_LENGTH * radius {
            return Err(format!(
                "its wall is only {:.3} mm long all around",
                length.max(0.0)
            ));
        }
        if length * length / (8.0 * radius) < MIN_BULGE * candidate.rms {
            return Err(format!(
                "its wall of {length:.3} mm may as well be a band of a ball"
            ));
        }
        if self.any_inside(&axis.ring((wall_extent[0] + wall_extent[1]) / 2.0, 0.7)) {
            return Err("there is material inside".into());
        }
        let (extent, ends) = self.ends(&axis, wall_extent);
        let beyond = 0.05 * radius;
        if [extent[0] - beyond, extent[1] + beyond]
            .iter()
            .any(|t| self.any_inside(&axis.ring(*t, 0.7)))
        {
            return Err("it is closed at one end".into());
        }
        let wall = self.wall(&axis, extent).and_then(|(wall, radius)| {
            Some((wall, radius, self.notches(&axis, wall_extent, radius)?))
        });
        let (wall, outer_radius, notches) = match wall {
            Some((wall, radius, notches)) => (Some(wall), radius, notches),
            None => (None, self.sleeve(&axis, wall_extent)?, Vec::new()),
        };
        if outer_radius - radius < MIN_SLEEVE * radius {
            return Err(format!(
                "only {:.3} mm of material around it",
                outer_radius - radius
            ));
        }
        Ok(Boss {
            bore,
            wall,
            ends,
            origin,
            direction,
            radius,
            outer_radius,
            extent,
            notches,
            free: self.free(&axis, extent),
            residual: candidate.residual,
        })
    }

    fn any_inside(&self, points: &[Vec3]) -> bool {
        points.iter().any(|p| self.winding.at(p) > 0.5)
    }

    /// The range along the axis in which the wall is there in nearly all directions.
    fn wall_range(&self, axis: &Axis, triangles: &[u32]) -> [f64; 2] {
        let mut ranges = vec![[f64::MAX, f64::MIN]; AROUND];
        let mut add = |p: Vec3| {
            let from = p - axis.origin;
            let turn = from.dot(&axis.across[1]).atan2(from.dot(&axis.across[0]));
            let share = turn / std::f64::consts::TAU + 0.5;
            let bin = ((share * AROUND as f64) as usize).min(AROUND - 1);
            let t = from.dot(&axis.direction);
            ranges[bin] = [ranges[bin][0].min(t), ranges[bin][1].max(t)];
        };
        for &t in triangles {
            let corners = self.facets.mesh.corners(t as usize);
            for k in 0..3 {
                for step in 0..4 {
                    add(corners[k].lerp(&corners[(k + 1) % 3], f64::from(step) / 4.0));
                }
            }
        }
        ranges.retain(|r| r[0] <= r[1]);
        let pick = |k: usize, share: f64| {
            let mut sorted: Vec<f64> = ranges.iter().map(|r| r[k]).collect();
            sorted.sort_by(f64::total_cmp);
            let last = sorted.len().saturating_sub(1) as f64;
            sorted
                .get((share * last).round() as usize)
                .copied()
                .unwrap_or(0.0)
        };
        [pick(0, 1.0 - NOTCH), pick(1, NOTCH)]
    }

    /// The ends, each on the flat face across the axis that is close enough, and those faces.
    fn ends(&self, axis: &Axis, wall: [f64; 2]) -> ([f64; 2], [Option<usize>; 2]) {
        let mut extent = wall;
        let mut planes = [None; 2];
        let reach = self.options.end_gap * axis.radius;
        for end in 0..2 {
            let sign = if end == 0 { -1.0 } else { 1.0 };
            let mut nearest = reach;
            for (i, candidate) in self.candidates.iter().enumerate() {
                let Primitive::Plane { normal, offset } = candidate.surface else {
                    continue;
                };
                if normal.dot(&axis.direction) * sign < 0.9998 {
                    continue;
                }
                let t = (offset - normal.dot(&axis.origin)) / normal.dot(&axis.direction);
                let gap = (t - wall[end]) * sign;
                // A little inward is allowed: the wall's last triangles may run into the fillet.
                if gap >= -0.2 * reach
                    && gap < nearest
                    && self.surrounds(axis, &candidate.triangles)
                {
                    (nearest, extent[end], planes[end]) = (gap, t, Some(i));
                }
            }
        }
        (extent, planes)
    }

    /// Whether a flat face has triangles close around the hole on at least half of its directions.
    fn surrounds(&self, axis: &Axis, triangles: &[u32]) -> bool {
        let mut seen = [false; AROUND];
        for &t in triangles {
            for p in self.facets.mesh.corners(t as usize) {
                let from = p - axis.origin;
                let [x, y] = axis.across.map(|e| from.dot(&e));
                if x.hypot(y) < 2.0 * axis.radius {
                    let share = y.atan2(x) / std::f64::consts::TAU + 0.5;
                    seen[((share * AROUND as f64) as usize).min(AROUND - 1)] = true;
                }
            }
        }
        2 * seen.iter().filter(|s| **s).count() >= AROUND
    }

    /// The smallest concentric outer wall beside the bore.
    fn wall(&self, axis: &Axis, extent: [f64; 2]) -> Option<(usize, f64)> {
        let near = 3.0 * self.options.tolerance * self.facets.edge;
        let mut best: Option<(usize, f64)> = None;
        for (i, candidate) in self.candidates.iter().enumerate() {
            let Primitive::Cylinder {
                origin,
                direction,
                radius,
                concave: false,
            } = candidate.surface
            else {
                continue;
            };
            let offset = origin - axis.origin;
            let along = offset.dot(&axis.direction);
            let sign = direction.dot(&axis.direction).signum();
            let mut range = candidate.extent.map(|t| along + sign * t);
            range.sort_by(f64::total_cmp);
            let concentric = direction.dot(&axis.direction).abs() > 0.9998
                && (offset - axis.direction * along).norm() < near;
            if concentric
                && radius > axis.radius
                && candidate.angle.to_degrees() >= self.options.min_wall_angle
                && range[0] < extent[1]
                && range[1] > extent[0]
                && best.is_none_or(|b| radius < b.1)
            {
                best = Some((i, radius));
            }
        }
        best
    }

    /// Where the outer wall of this radius is missing; `None` when that is too much of it.
    fn notches(&self, axis: &Axis, wall: [f64; 2], radius: f64) -> Option<Vec<Notch>> {
        let most = radius - axis.radius;
        let reach = (0..NOTCH_STEPS).map(|k| {
            let turn = std::f64::consts::TAU * k as f64 / NOTCH_STEPS as f64;
            let mut depths = self.depths(axis, wall, turn, most);
            depths.sort_by(f64::total_cmp);
            axis.radius + depths[ALONG / 2]
        });
        let reach: Vec<f64> = reach.collect();
        notches(&reach, radius - NOTCH_DEPTH * self.facets.edge)
    }

    /// Outer radius of a sleeve inside the material around the bore.
    fn sleeve(&self, axis: &Axis, wall: [f64; 2]) -> Result<f64, String> {
        let turns = (0..AROUND).map(|k| std::f64::consts::TAU * (k as f64 + 0.3) / AROUND as f64);
        let mut depths: Vec<f64> = turns
            .flat_map(|turn| self.depths(axis, wall, turn, axis.radius))
            .filter(|depth| *depth > 0.0)
            .collect();
        depths.sort_by(f64::total_cmp);
        let thickness = depths.get((THIN * depths.len() as f64) as usize);
        match thickness {
            Some(mm) if 2 * depths.len() >= AROUND * ALONG => {
                Ok(axis.radius + self.options.sleeve_share * mm)
            }
            _ => Err("there is no material around it".into()),
        }
    }

    /// Thickness of the material around the bore in one direction, at most `most` mm, at several heights; 0 for none.
    fn depths(&self, axis: &Axis, wall: [f64; 2], turn: f64, most: f64) -> [f64; ALONG] {
        let start = axis.radius + 0.02 * axis.radius;
        std::array::from_fn(|step| {
            let t = wall[0] + (wall[1] - wall[0]) * (step as f64 + 0.5) / ALONG as f64;
            let from = axis.at(t, turn, start);
            if self.winding.at(&from) <= 0.5 {
                return 0.0;
            }
            let hit = self.bvh.first_hit(&from, &axis.away(turn), 0.0, most);
            start - axis.radius + hit.map_or(most, |h| h.0)
        })
    }

    /// How far beyond both ends the hole goes on free, at most one radius.
    fn free(&self, axis: &Axis, extent: [f64; 2]) -> f64 {
        let mut free = axis.radius;
        for (t, along) in [(extent[0], -axis.direction), (extent[1], axis.direction)] {
            let start = along * (0.02 * axis.radius);
            for p in axis.ring(t, 0.95) {
                if let Some((d, _)) = self.bvh.first_hit(&(p + start), &along, 0.0, axis.radius) {
                    free = free.min(0.9 * d);
                }
            }
        }
        free
    }
}
