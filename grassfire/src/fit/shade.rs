//! Gaps between a body and non-design bodies along the draw direction: the body's side moves out past them, or what stands over
//! them as a film moves in, until there are none.

use std::collections::BTreeMap;

use super::round::Solver;
use crate::Vec3;
use crate::casting::mould::dexels::{Dexels, Lattice, axes, dexels_on};
use crate::mesh::{Bvh, TriMesh, Winding};
use crate::remesh::{Bosses, Capsule};
use crate::voxel::VoxelGrid;

/// Distance of the lines that are looked along, voxels.
const PITCH: f64 = 0.25;
/// Points along a gap are at most this far apart, voxels.
const STEP: f64 = 0.5;
/// The body's side moves past the gap by this, voxels: the union's edge there is no touch.
const PROUD: f64 = 0.1;
/// Of the material above and below a gap the shorter goes where it is a film no deeper than this, voxels, and nearer than the gap.
const FILM: f64 = 0.5;
/// Gaps farther from the body than this are not its work, voxels.
const REACH: f64 = 2.0;
/// Where the proposal itself has room of this depth the gap is a core's work, voxels.
const ROOM: f64 = 1.0;

/// Where a triangle of the samples must be: past a plane.
#[derive(Debug, Clone, Copy)]
struct Push {
    /// Weights of the triangle's corners.
    share: [f64; 3],
    /// Unit normal of the plane, the way that the triangle moves.
    normal: Vec3,
    /// Its distance from the origin along that, voxels.
    height: f64,
}

/// A triangle of the samples, and whether it is to move inwards.
type Side = (u32, bool);

/// What gaps ask for: the farthest of each triangle.
#[derive(Debug, Clone, Default)]
pub(super) struct Pushes(BTreeMap<Side, Push>);

impl Pushes {
    /// Asks more of the triangles beside gaps that are left.
    pub fn renew(&mut self, left: &Gaps) {
        self.0.extend(&left.pushes.0);
    }

    fn add(&mut self, side: Side, push: Push) {
        let most = self.0.entry(side).or_insert(push);
        if push.height > most.height {
            *most = push;
        }
    }
}

/// The gaps beside one body.
#[derive(Debug, Clone, Default)]
pub(super) struct Gaps {
    /// Area of the lines on which a gap is left that the body can close, squared voxels.
    pub area: f64,
    /// What they ask for.
    pub pushes: Pushes,
}

/// A body's surface that is looked at.
struct Looked<'a> {
    samples: &'a TriMesh,
    bvh: Bvh,
    hidden: Winding<'a>,
}

/// The non-design bodies as seen along the draw direction, in voxel units.
pub(super) struct Shade<'a> {
    field: &'a VoxelGrid<f32>,
    wall_mesh: TriMesh,
    /// Their surfaces.
    pub walls: Bvh,
    free: &'a [Capsule],
    axes: [Vec3; 3],
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
        }
    }

    pub fn draw(&self) -> &Vec3 {
        &self.axes[2]
    }

    /// The gaps between intervals of body and walls that the proposal does not have; `samples` is the surface of the body.
    pub fn gaps(&self, samples: &TriMesh) -> Gaps {
        let Some(dexels) = self.dexels(samples) else {
            return Gaps::default();
        };
        let looked = Looked {
            samples,
            bvh: Bvh::new(samples),
            hidden: Winding::new(&self.walls),
        };
        let mut out = Gaps::default();
        for line in 0..dexels.dims[0] * dexels.dims[1] {
            let mut left = false;
            for pair in dexels.line(line).windows(2) {
                let along = |range: [f64; 2], ends| points(&dexels, line, range, ends);
                for (side, push) in self.asked(&looked, [pair[0], pair[1]], along) {
                    out.pushes.add(side, push);
                    left = true;
                }
            }
            out.area += f64::from(u8::from(left)) * PITCH * PITCH;
        }
        out
    }

    /// What the gap between two intervals of a line asks for.
    ///
    /// The body's side moves out past the gap, unless the shorter of the two is a film of the body that is nearer to go: a member
    /// that stands a little over the upright wall of a non-design body above and below, and not between.
    fn asked(
        &self,
        looked: &Looked,
        [low, high]: [[f64; 2]; 2],
        along: impl Fn([f64; 2], bool) -> Vec<Vec3>,
    ) -> Vec<(Side, Push)> {
        let mut gap = along([low[1], high[0]], true);
        let value = |q: &Vec3| self.field.sample(&self.field.to_mm(q));
        if gap.iter().any(|q| value(q) < -ROOM * self.field.spacing) {
            return Vec::new();
        }
        let open = |q: &Vec3| self.free.iter().any(|bore| bore.contains(q));
        gap.retain(|q| !open(&self.field.to_mm(q)));
        if gap.is_empty() {
            return Vec::new();
        }
        let length = |i: &[f64; 2]| i[1] - i[0];
        let shorter = if length(&low) < length(&high) {
            low
        } else {
            high
        };
        let film = along(shorter, false);
        let past = |q| looked.push(q, REACH, false);
        let away = |q| looked.push(q, FILM, true);
        let fill: Vec<Option<Asked>> = gap.iter().map(past).collect();
        let trim: Vec<Option<Asked>> = film.iter().map(away).collect();
        let chosen = if deepest(&trim) < deepest(&fill) {
            trim
        } else {
            fill
        };
        chosen
            .into_iter()
            .flatten()
            .map(|a| (a.side, a.push))
            .collect()
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

/// What a point asks of the nearest triangle.
struct Asked {
    side: Side,
    push: Push,
    /// How far that is, voxels.
    way: f64,
}

/// The longest way; infinite where a point asks nothing.
fn deepest(asked: &[Option<Asked>]) -> f64 {
    let ways = asked
        .iter()
        .map(|a| a.as_ref().map_or(f64::INFINITY, |a| a.way));
    ways.fold(0.0, f64::max)
}

impl Looked<'_> {
    /// What a point, `inwards` one of a film outside the walls, asks of the nearest triangle within `reach`.
    fn push(&self, q: &Vec3, reach: f64, inwards: bool) -> Option<Asked> {
        let near = self.bvh.nearest(q, reach)?;
        let [a, b, c] = self.samples.corners(near.triangle as usize);
        let outward = (b - a).cross(&(c - a)).try_normalize(1e-12)?;
        let normal = if inwards { -outward } else { outward };
        let way = (q - near.point).dot(&normal);
        if way < 0.0 || (inwards && self.hidden.at(q) > 0.5) {
            return None;
        }
        let push = Push {
            share: shares(&near.point, [a, b, c]),
            normal,
            height: q.dot(&normal) + PROUD,
        };
        Some(Asked {
            side: (near.triangle, inwards),
            push,
            way,
        })
    }
}

/// Points of a range of a line, at most [`STEP`] apart, with its ends or without.
fn points(dexels: &Dexels, line: usize, [low, high]: [f64; 2], ends: bool) -> Vec<Vec3> {
    let count = ((high - low) / STEP).ceil().max(1.0);
    let (last, shift) = if ends {
        (count, 0.0)
    } else {
        (count - 1.0, 0.5)
    };
    let at = |k: usize| dexels.place(line, low + (high - low) * (k as f64 + shift) / count);
    (0..=last as usize).map(at).collect()
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
    /// The rows that move triangles past planes; `at` are the samples.
    pub(super) fn add_pushes(&mut self, pushes: &Pushes, at: &[Vec3], weight: f64) {
        for (&(triangle, _), push) in &pushes.0 {
            let corners = self.surface.triangles[triangle as usize];
            let place: Vec3 = (0..3)
                .map(|k| push.share[k] * at[corners[k] as usize])
                .sum();
            if place.dot(&push.normal) < push.height {
                let row = self.row_of(&corners, |k, w| push.share[k] * w * push.normal);
                self.equations.add_row(&row, weight * weight, push.height);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::cuboid;

    /// Members that met a lug above and below stood over its upright wall by some tenths of a voxel: lines beside the wall left the part
    /// between them, and no side of the body was near enough to fill that.
    #[test]
    fn a_film_over_the_wall_of_a_lug_goes_where_nothing_can_fill_the_gap_below() {
        let field = VoxelGrid::filled(Vec3::zeros(), 1.0, [25; 3], 0.0_f32);
        let bosses = Bosses {
            surface: cuboid(Vec3::zeros(), Vec3::new(10.0, 10.0, 20.0)),
            ..Bosses::default()
        };
        let (z, out) = (Vec3::z(), 10.3);
        let shade = Shade::new(&field, &z, &bosses);
        let body = |out: f64| {
            let mut body = cuboid(Vec3::new(5.0, 2.0, -2.0), Vec3::new(13.0, 8.0, 5.0));
            let film = cuboid(Vec3::new(5.0, 2.0, 15.0), Vec3::new(out, 8.0, 17.0));
            body.append(film.points.iter().copied(), film.triangles.iter().copied());
            body
        };
        let gaps = shade.gaps(&body(out));
        assert!((1.2..2.4).contains(&gaps.area), "{} of 0.3 x 6", gaps.area);
        let least = gaps.pushes.0.iter().map(|((_, inwards), push)| {
            assert!(*inwards);
            let side = (push.normal + Vec3::x()).norm() < 1e-9;
            if side { -push.height } else { f64::INFINITY }
        });
        let least = least.fold(f64::INFINITY, f64::min);
        assert!((9.85..10.0).contains(&least), "{least}");
        assert!(shade.gaps(&body(9.95)).area == 0.0);
    }
}
