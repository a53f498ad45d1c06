//! Walls: thickness by rays into the material, inscribed balls, and how steeply the thickness changes.

use rayon::prelude::*;

use crate::Vec3;
use crate::mesh::distance::sample_surface;
use crate::mesh::tangent_ball::SMOOTH;
use crate::mesh::{Bvh, TangentBall, TangentBalls, TriMesh};

/// A wall that was measured.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Wall {
    /// Middle of the wall, mm.
    pub place: Vec3,
    /// mm.
    pub thickness: f64,
}

/// Faces count as the two sides of a wall when their normals differ by less than this from opposite (cosine).
const OPPOSITE: f64 = 0.7;

/// Walls at `samples` evenly spread places of the surface, thinnest first: the way along the inward normal to the opposite
/// face. Places without an opposite face (edges, tips) have none.
pub fn walls(mesh: &TriMesh, samples: usize) -> Vec<Wall> {
    let bvh = Bvh::new(mesh);
    let Some((lo, hi)) = bvh.bounds() else {
        return Vec::new();
    };
    let size = (hi - lo).norm();
    let normal = |t: u32| mesh.normal(t as usize);
    let measured = sample_surface(mesh, samples)
        .into_par_iter()
        .filter_map(|(p, t)| {
            let inward = -normal(t)?;
            let (thickness, other) = bvh.first_hit(&p, &inward, 1e-5 * size, size)?;
            (normal(other)?.dot(&inward) > OPPOSITE).then(|| Wall {
                place: p + inward * thickness / 2.0,
                thickness,
            })
        });
    let mut measured: Vec<Wall> = measured.collect();
    measured.sort_by(|a, b| a.thickness.total_cmp(&b.thickness));
    measured
}

/// The ball in the material at a place of the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inscribed {
    /// The place, mm.
    pub place: Vec3,
    /// Its triangle.
    pub triangle: u32,
    /// The largest ball that touches there.
    pub ball: TangentBall,
}

/// The largest balls in the material that touch at `samples` evenly spread places of the surface.
pub fn inscribed(mesh: &TriMesh, balls: &TangentBalls, samples: usize) -> Vec<Inscribed> {
    let Some((lo, hi)) = balls.bvh.bounds() else {
        return Vec::new();
    };
    let most = (hi - lo).norm() / 2.0;
    sample_surface(mesh, samples)
        .into_par_iter()
        .filter_map(|(place, triangle)| {
            let ball = balls.at(&place, triangle, true, most)?;
            Some(Inscribed {
                place,
                triangle,
                ball,
            })
        })
        .collect()
}

/// A ball lies between the two sides of one wall when it touches them within 15 degrees of opposite (cosine).
const TWO_SIDES: f64 = -0.966;
/// Two walls are one when their normals differ by less than 20 degrees (cosine).
const SAME: f64 = 0.94;

/// Balls whose two touches are the two sides of one wall, along x.
pub struct Walls<'a>(Vec<(&'a Inscribed, Vec3)>);

/// Normals of one side of a wall differ by less than this (cosine of 37 degrees).
const ALONG: f64 = 0.8;

impl<'a> Walls<'a> {
    /// Those of the inscribed balls that lie in walls.
    fn new(balls: &TangentBalls, inscribed: &'a [Inscribed]) -> Self {
        let opposite = |i: &&Inscribed| {
            let [one, two] = [i.place, i.ball.touch].map(|p| p - i.ball.centre);
            one.dot(&two) < TWO_SIDES * one.norm() * two.norm()
        };
        let walls = inscribed.iter().filter(opposite);
        let walls = walls.map(|i| (i, balls.normals[i.triangle as usize]));
        let mut walls: Vec<(&Inscribed, Vec3)> = walls.collect();
        walls.sort_by(|a, b| a.0.place.x.total_cmp(&b.0.place.x));
        Self(walls)
    }

    /// Thickness of the wall that has a place of the surface with this normal on one of its sides, mm: measured where the side is nearest; none
    /// where no wall is.
    pub fn thickness(&self, place: &Vec3, normal: &Vec3) -> Option<f64> {
        let mut nearest = (f64::INFINITY, None);
        let middle = self.0.partition_point(|w| w.0.place.x < place.x);
        // Away from the place along x, as far as something nearer may come.
        let (up, down) = (self.0[middle..].iter(), self.0[..middle].iter().rev());
        for way in [
            &mut up.into_iter() as &mut dyn Iterator<Item = _>,
            &mut down.into_iter(),
        ] {
            for (wall, side) in way {
                if (wall.place.x - place.x).powi(2) > nearest.0 {
                    break;
                }
                let away = (wall.place - place).norm_squared();
                if away < nearest.0 && side.dot(normal) > ALONG {
                    nearest = (away, Some(2.0 * wall.ball.radius));
                }
            }
        }
        nearest.1
    }

    /// Sum of the thickness of the two walls that meet in an edge at a place, mm; none where no wall is. `balls` are those of the surface.
    pub fn meeting(&self, balls: &TangentBalls, place: &Vec3) -> Option<f64> {
        let first = balls.bvh.nearest(place, f64::INFINITY)?;
        let normal = balls.normals[first.triangle as usize];
        let across = |t: u32, _: &Vec3| balls.normals[t as usize].dot(&normal) < SMOOTH;
        let second = balls.bvh.nearest_where(place, f64::INFINITY, across)?;
        let one = self.thickness(place, &normal);
        let other = self.thickness(place, &balls.normals[second.triangle as usize]);
        Some(one.or(other)? + other.or(one)?)
    }
}

/// What `look` finds by the balls of a surface, its inscribed balls at `samples` places, and its walls.
pub fn with_walls<R>(
    mesh: &TriMesh,
    samples: usize,
    look: impl FnOnce(&TangentBalls, &[Inscribed], &Walls) -> R,
) -> R {
    let balls = TangentBalls::new(mesh);
    let inscribed = inscribed(mesh, &balls, samples);
    let walls = Walls::new(&balls, &inscribed);
    look(&balls, &inscribed, &walls)
}

/// How steeply walls change, steepest first: the place, and change of thickness over the way along the wall.
///
/// Compared are places with two parallel sides, half a thickness to two thicknesses apart in the same wall: between them lies the step. Where a wall ends in
/// another one, or three meet, no sides are parallel.
pub fn transitions(walls: &Walls) -> Vec<(Vec3, f64)> {
    let mut walls = walls.0.clone();
    // Along x, so that those within reach are neighbours in the list.
    walls.sort_by(|a, b| a.0.ball.centre.x.total_cmp(&b.0.ball.centre.x));
    let steepest = |i: usize| {
        let (one, n) = walls[i];
        let reach = 4.0 * one.ball.radius;
        let slope = |(other, normal): &(&Inscribed, Vec3)| {
            let way = other.ball.centre - one.ball.centre;
            let change = (one.ball.radius - other.ball.radius).abs();
            let near = way.norm() <= reach && way.norm() >= one.ball.radius;
            let level = way.dot(&n).abs() <= change + 0.1 * one.ball.radius;
            let parallel = normal.dot(&n).abs() > SAME;
            (near && level && parallel).then(|| 2.0 * change / way.norm())
        };
        let centre = one.ball.centre;
        let up = walls[i + 1..]
            .iter()
            .take_while(|w| w.0.ball.centre.x - centre.x <= reach);
        let down = walls[..i]
            .iter()
            .rev()
            .take_while(|w| centre.x - w.0.ball.centre.x <= reach);
        let steepest = up.chain(down).filter_map(slope).max_by(f64::total_cmp);
        (centre, steepest.unwrap_or(0.0))
    };
    let mut out: Vec<(Vec3, f64)> = (0..walls.len()).into_par_iter().map(steepest).collect();
    out.sort_by(|a, b| b.1.total_cmp(&a.1));
    out
}
