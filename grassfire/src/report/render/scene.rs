//! What a picture shows.

use std::collections::HashMap;

use rayon::prelude::*;

use super::Legend;
use crate::Vec3;

/// Red, green, blue, 0..=255 (sRGB).
pub type Rgb = [u8; 3];

/// Colours of a mesh.
#[derive(Debug, Clone, PartialEq)]
pub enum Colours {
    /// One colour everywhere.
    Uniform(Rgb),
    /// One colour a point, blended across triangles.
    Points(Vec<Rgb>),
    /// One colour a triangle.
    Triangles(Vec<Rgb>),
}

/// How normals are found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shading {
    /// One normal a triangle.
    Flat,
    /// Normals averaged over triangles that meet at less than this angle, degrees.
    Smooth(f64),
}

/// Triangles to draw; both sides are visible.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneMesh {
    /// Positions, mm.
    pub points: Vec<Vec3>,
    /// Point indices.
    pub triangles: Vec<[u32; 3]>,
    /// Surface colours.
    pub colours: Colours,
    /// How normals are found.
    pub shading: Shading,
}

impl SceneMesh {
    /// Triangles in one colour.
    pub fn triangles(points: &[Vec3], triangles: &[[u32; 3]], colour: Rgb) -> Self {
        Self {
            points: points.to_vec(),
            triangles: triangles.to_vec(),
            colours: Colours::Uniform(colour),
            shading: Shading::Smooth(40.0),
        }
    }

    /// Quads in one colour, each cut into two triangles.
    pub fn quads(points: &[Vec3], quads: &[[u32; 4]], colour: Rgb) -> Self {
        let triangles = quads
            .iter()
            .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
            .collect();
        Self {
            points: points.to_vec(),
            triangles,
            colours: Colours::Uniform(colour),
            shading: Shading::Flat,
        }
    }
}

/// A straight line with a width in pixels, hidden by what is clearly in front of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneLine {
    /// Start, mm.
    pub from: Vec3,
    /// End, mm.
    pub to: Vec3,
    /// Colour, not shaded.
    pub colour: Rgb,
    /// Width, pixels.
    pub width: f64,
}

/// A shaded ball.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneSphere {
    /// Centre, mm.
    pub centre: Vec3,
    /// Radius, mm.
    pub radius: f64,
    /// Colour.
    pub colour: Rgb,
}

/// A text in a box at a place, in front of everything.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneLabel {
    /// Middle of the box, mm.
    pub place: Vec3,
    /// A few characters.
    pub text: String,
}

/// Everything that one picture shows.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Scene {
    /// Surfaces.
    pub meshes: Vec<SceneMesh>,
    /// Lines.
    pub lines: Vec<SceneLine>,
    /// Balls.
    pub spheres: Vec<SceneSphere>,
    /// Texts.
    pub labels: Vec<SceneLabel>,
    /// Colour scale drawn at the right edge.
    pub legend: Option<Legend>,
}

impl Scene {
    /// Adds a line for every edge of `edges` (indices into `points`; edges with missing points are left out).
    pub fn add_edges(&mut self, points: &[Vec3], edges: &[[u32; 2]], colour: Rgb, width: f64) {
        let at = |v: u32| points.get(v as usize).copied();
        let lines = edges.iter().filter_map(|&[a, b]| {
            Some(SceneLine {
                from: at(a)?,
                to: at(b)?,
                colour,
                width,
            })
        });
        self.lines.extend(lines);
    }
}

/// One normal a corner. Triangles need not be consistently oriented: neighbours are turned to agree.
///
/// Points at the same place count as one, so that tessellations that repeat points along face borders look smooth.
/// Indices must be valid and points finite.
pub(super) fn corner_normals(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    shading: Shading,
) -> Vec<[Vec3; 3]> {
    let normals: Vec<Vec3> = triangles
        .par_iter()
        .map(|t| area_vector(points, t))
        .collect();
    let Shading::Smooth(degrees) = shading else {
        return normals.into_iter().map(|n| [n; 3]).collect();
    };
    let limit = degrees.to_radians().cos();
    let place = same_places(points);
    let corners = triangles.iter().flatten().map(|&v| place[v as usize]);
    let mut first = vec![0u32; points.len() + 1];
    corners.clone().for_each(|p| first[p as usize + 1] += 1);
    (0..points.len()).for_each(|p| first[p + 1] += first[p]);
    let mut fill = first.clone();
    let mut around = vec![0u32; triangles.len() * 3];
    for (corner, p) in corners.enumerate() {
        around[fill[p as usize] as usize] = (corner / 3) as u32;
        fill[p as usize] += 1;
    }
    (0..triangles.len())
        .into_par_iter()
        .map(|t| {
            triangles[t].map(|v| {
                let p = place[v as usize] as usize;
                let mine = normals[t];
                let mut sum = Vec3::zeros();
                // Very many triangles in one point (a fan of a flat cap) do not need all their votes.
                for &other in around[first[p] as usize..first[p + 1] as usize]
                    .iter()
                    .take(64)
                {
                    let other = normals[other as usize];
                    let product = mine.dot(&other);
                    if product.abs() >= limit * mine.norm() * other.norm() {
                        sum += other * product.signum();
                    }
                }
                if sum.norm_squared() > 0.0 {
                    sum.normalize()
                } else {
                    mine
                }
            })
        })
        .collect()
}

fn area_vector(points: &[Vec3], t: &[u32; 3]) -> Vec3 {
    let [a, b, c] = t.map(|v| points[v as usize]);
    (b - a).cross(&(c - a))
}

/// For every point the lowest index of a point at exactly the same place.
fn same_places(points: &[Vec3]) -> Vec<u32> {
    let mut seen = HashMap::with_capacity(points.len());
    let key = |p: &Vec3| [p.x, p.y, p.z].map(|x| (x + 0.0).to_bits());
    (0..points.len() as u32)
        .map(|n| *seen.entry(key(&points[n as usize])).or_insert(n))
        .collect()
}
