//! Gaps between a body and non-design bodies along the draw direction: the body's side moves out until there are none.

use std::collections::BTreeMap;

use super::round::Solver;
use crate::Vec3;
use crate::casting::mould::dexels::{Dexels, Lattice, axes, dexels_on};
use crate::mesh::{Bvh, TriMesh};
use crate::remesh::{Bosses, Capsule};
use crate::voxel::VoxelGrid;

/// Distance of the lines that are looked along, voxels.
const PITCH: f64 = 0.25;
/// Points along a gap are at most this far apart, voxels.
const STEP: f64 = 0.5;
/// The body's side moves past the gap by this, voxels: the union's edge there is no touch.
const PROUD: f64 = 0.1;
/// Gaps farther from the body than this are not its work, voxels.
const REACH: f64 = 2.0;
/// Where the proposal itself has room of this depth the gap is a core's work, voxels.
const ROOM: f64 = 1.0;

/// Where a triangle of the samples must be: past a plane.
#[derive(Debug, Clone, Copy)]
pub(super) struct Push {
    /// Weights of the triangle's corners.
    share: [f64; 3],
    /// Outward unit normal of the plane.
    pub normal: Vec3,
    /// Its distance from the origin along that, voxels.
    pub height: f64,
}

/// The non-design bodies as seen along the draw direction, in voxel units.
pub(super) struct Shade<'a> {
    field: &'a VoxelGrid<f32>,
    wall_mesh: TriMesh,
    /// Their surfaces.
    pub walls: Bvh,
    free: &'a [Capsule],
    axes: [Vec3; 3],
    /// What has been asked of each triangle so far.
    pub pushes: BTreeMap<u32, Push>,
}

impl<'a> Shade<'a> {
    pub fn new(field: &'a VoxelGrid<f32>, draw: &Vec3, bosses: &'a Bosses) -> Self {
        let surface = &bosses.surface;
        let walls = TriMesh {
            points: surface.points.iter().map(|p| field.to_grid(p)).collect(),
            triangles: surface.triangles.clone(),
            tags: Vec::new(),
        };
        Self {
            field,
            walls: Bvh::new(&walls),
            wall_mesh: walls,
            free: &bosses.free,
            axes: axes(draw),
            pushes: BTreeMap::new(),
        }
    }

    pub fn draw(&self) -> &Vec3 {
        &self.axes[2]
    }

    /// Area of the lines on which a gap is left that the body should fill, squared voxels; `samples` is the surface of the body.
    pub fn area(&self, samples: &TriMesh) -> f64 {
        let (mut lines, bvh) = (0, Bvh::new(samples));
        self.each_gap(samples, |points| {
            lines += usize::from(points.iter().any(|q| self.push(samples, &bvh, q).is_some()));
        });
        lines as f64 * PITCH * PITCH
    }

    /// Asks more of the triangles beside gaps.
    pub fn look(&mut self, samples: &TriMesh) {
        let bvh = Bvh::new(samples);
        let mut found: BTreeMap<u32, Push> = BTreeMap::new();
        self.each_gap(samples, |points| {
            for (triangle, push) in points.iter().filter_map(|q| self.push(samples, &bvh, q)) {
                let most = found.entry(triangle).or_insert(push);
                if push.height > most.height {
                    *most = push;
                }
            }
        });
        // A triangle that still has a gap beside it must go farther than was asked before.
        self.pushes.extend(found);
    }

    /// What a point of a gap asks of the nearest triangle.
    fn push(&self, samples: &TriMesh, bvh: &Bvh, q: &Vec3) -> Option<(u32, Push)> {
        let near = bvh.nearest(q, REACH)?;
        let [a, b, c] = samples.corners(near.triangle as usize);
        let normal = (b - a).cross(&(c - a)).try_normalize(1e-12)?;
        let out = (q - near.point).dot(&normal);
        (out >= 0.0).then(|| {
            let push = Push {
                share: shares(&near.point, [a, b, c]),
                normal,
                height: q.dot(&normal) + PROUD,
            };
            (near.triangle, push)
        })
    }

    /// Calls `with` with the points of every gap between intervals of body and walls that the proposal does not have.
    fn each_gap(&self, samples: &TriMesh, mut with: impl FnMut(&[Vec3])) {
        let Some(dexels) = self.dexels(samples) else {
            return;
        };
        for line in 0..dexels.dims[0] * dexels.dims[1] {
            for pair in dexels.line(line).windows(2) {
                let (low, high) = (pair[0][1], pair[1][0]);
                let count = ((high - low) / STEP).ceil().max(1.0);
                let at = |k: usize| dexels.place(line, low + (high - low) * k as f64 / count);
                let points: Vec<Vec3> = (0..=count as usize).map(at).collect();
                let place = |q: &Vec3| self.field.to_mm(q);
                let room = -ROOM * self.field.spacing;
                if points.iter().any(|q| self.field.sample(&place(q)) < room) {
                    continue;
                }
                let open = |q: &&Vec3| !self.free.iter().any(|bore| bore.contains(&place(q)));
                let points: Vec<Vec3> = points.iter().filter(open).copied().collect();
                with(&points);
            }
        }
    }

    /// Intervals of body and walls together.
    fn dexels(&self, samples: &TriMesh) -> Option<Dexels> {
        let mut both = samples.clone();
        both.append(
            self.wall_mesh.points.iter().copied(),
            self.wall_mesh.triangles.iter().copied(),
        );
        let across = |p: &Vec3| [p.dot(&self.axes[0]), p.dot(&self.axes[1])];
        let places = both.points.iter().map(across);
        let bounds = places.fold(None, |bounds: Option<[[f64; 2]; 2]>, p| {
            let [lo, hi] = bounds.unwrap_or([p, p]);
            let least = [lo[0].min(p[0]), lo[1].min(p[1])];
            Some([least, [hi[0].max(p[0]), hi[1].max(p[1])]])
        });
        let [lo, hi] = bounds?;
        // Lines stay where they are while the body moves, off the planes of aligned walls.
        let from = lo.map(|l| (l.floor() - 1.0) + 0.487_231 * PITCH);
        let lattice = Lattice {
            axes: self.axes,
            origin: from,
            pitch: PITCH,
            dims: [0, 1].map(|a| ((hi[a] - from[a]) / PITCH).ceil().max(1.0) as usize),
        };
        Some(dexels_on(&both, &lattice))
    }
}

/// Weights of a triangle's corners at a point in its plane.
fn shares(p: &Vec3, [a, b, c]: [Vec3; 3]) -> [f64; 3] {
    let across = (b - a).cross(&(c - a));
    let part = |u: &Vec3, v: &Vec3| (u - p).cross(&(v - p)).dot(&across);
    let whole = across.norm_squared().max(1e-300);
    [
        part(&b, &c) / whole,
        part(&c, &a) / whole,
        part(&a, &b) / whole,
    ]
}

impl Solver<'_> {
    /// The rows that push triangles out.
    pub(super) fn add_pushes(&mut self, pushes: &BTreeMap<u32, Push>, weight: f64) {
        for (&triangle, push) in pushes {
            let corners = self.surface.triangles[triangle as usize];
            let row = self.row_of(&corners, |k, w| push.share[k] * w * push.normal);
            self.equations.add_row(&row, weight * weight, push.height);
        }
    }
}
