//! Inner poles of a surface: wall thickness and the pole skeleton.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::MedialError;
use super::delaunay::{Delaunay, delaunay};
use crate::Vec3;
use crate::mesh::{Solid, TriMesh};
use crate::monitor::Monitor;

/// How [`poles`] guards against unreliable Voronoi vertices.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PoleOptions {
    /// Least volume of a tetrahedron relative to the product of three of its edges; the centres of
    /// flatter ones are rounding noise and are not used.
    pub least_volume: f64,
}

impl Default for PoleOptions {
    fn default() -> Self {
        Self { least_volume: 1e-9 }
    }
}

/// The pole skeleton: one pole a surface point, in the same order.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Poles {
    /// Centres of the pole balls, mm.
    pub points: Vec<Vec3>,
    /// Radii of the pole balls, mm.
    pub radii: Vec<f64>,
    /// The triangles of the surface, carried over to the poles.
    pub triangles: Vec<[u32; 3]>,
    /// Local feature size at each surface point, mm: the radius of the largest inner ball that touches
    /// there, half the local wall thickness.
    pub thickness: Vec<f64>,
}

/// Inner pole of every surface point.
///
/// 1. Delaunay triangulation of the points; Voronoi vertices are the circumcentres.
/// 2. A Voronoi vertex counts as inside when it lies on the inner side of the tangent planes of at least three
///    of its four points (they are the nearest ones). Centres of flat tetrahedra are left out.
/// 3. The inner pole of a point is the farthest inside vertex of its Voronoi cell on the inner side of its
///    tangent plane. Unbounded cells need no care: they are unbounded outwards.
/// 4. Points without a pole (duplicates, flat surroundings) take the mean radius of their
///    neighbours along the inward normal; how many is reported as a warning.
///
/// The surface should be sampled finer than it is thick. This is a measure of thickness and a picture,
/// not a skeleton with the right topology: see [`medial_axis`](super::medial_axis).
///
/// # Errors
/// Those of [`delaunay`].
///
/// # Sources
/// N. Amenta, S. Choi, R. K. Kolluri, "The power crust, unions of balls, and the medial axis transform",
/// Computational Geometry 19 (2001), <https://doi.org/10.1016/S0925-7721(01)00017-7>.
pub fn poles(
    solid: &Solid,
    options: &PoleOptions,
    monitor: &Monitor,
) -> Result<Poles, MedialError> {
    let limit = options.least_volume;
    if !(limit.is_finite() && limit >= 0.0) {
        return Err(MedialError::BadOption {
            name: "least_volume",
            value: limit,
        });
    }
    monitor.step("medial", "poles", 0.0)?;
    let mesh = solid.mesh();
    let triangulation = delaunay(&mesh.points, monitor)?;
    let normals = normals(mesh);
    let farthest = farthest_centres(mesh, &triangulation, &normals, limit);
    drop(triangulation);
    let mut radii: Vec<f64> = mesh
        .points
        .iter()
        .zip(&farthest)
        .map(|(p, c)| c.map_or(f64::NAN, |c| (c - p).norm()))
        .collect();
    let missing = radii.iter().filter(|r| r.is_nan()).count();
    if missing > 0 {
        fill_from_neighbours(mesh, &mut radii);
        monitor.warn(
            "medial",
            format!(
                "{missing} of {} surface points have no inner pole; neighbours stand in",
                radii.len()
            ),
        );
    }
    let points = (0..radii.len())
        .map(|v| farthest[v].unwrap_or_else(|| mesh.points[v] - normals[v] * radii[v]))
        .collect();
    Ok(Poles {
        points,
        thickness: radii.clone(),
        radii,
        triangles: mesh.triangles.clone(),
    })
}

/// Unit normals of the points, weighted by area.
fn normals(mesh: &TriMesh) -> Vec<Vec3> {
    let mut normals = vec![Vec3::zeros(); mesh.points.len()];
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = mesh.corners(t);
        let normal = (b - a).cross(&(c - a));
        triangle.iter().for_each(|&v| normals[v as usize] += normal);
    }
    normals
        .iter()
        .map(|n| n.try_normalize(1e-300).unwrap_or_default())
        .collect()
}

fn farthest_centres(
    mesh: &TriMesh,
    triangulation: &Delaunay,
    normals: &[Vec3],
    least_volume: f64,
) -> Vec<Option<Vec3>> {
    let centres: Vec<Option<Vec3>> = triangulation
        .tets
        .par_iter()
        .map(|tet| {
            let corners = tet.vertices.map(|v| mesh.points[v as usize]);
            let below =
                |c: &Vec3, k: usize| (c - corners[k]).dot(&normals[tet.vertices[k] as usize]) < 0.0;
            circumcentre(&corners, least_volume)
                .filter(|c| (0..4).filter(|&k| below(c, k)).count() >= 3)
        })
        .collect();
    let mut farthest: Vec<Option<(f64, Vec3)>> = vec![None; mesh.points.len()];
    for (tet, centre) in triangulation.tets.iter().zip(&centres) {
        let Some(centre) = centre else { continue };
        for v in tet.vertices.map(|v| v as usize) {
            let away = centre - mesh.points[v];
            let distance = away.norm_squared();
            if away.dot(&normals[v]) < 0.0 && farthest[v].is_none_or(|(known, _)| distance > known)
            {
                farthest[v] = Some((distance, *centre));
            }
        }
    }
    farthest
        .into_iter()
        .map(|f| f.map(|(_, centre)| centre))
        .collect()
}

fn circumcentre(corners: &[Vec3; 4], least_volume: f64) -> Option<Vec3> {
    let [a, b, c] = [1, 2, 3].map(|k| corners[k] - corners[0]);
    let (bc, ca, ab) = (b.cross(&c), c.cross(&a), a.cross(&b));
    let volume = a.dot(&bc);
    if volume.abs() <= least_volume * a.norm() * b.norm() * c.norm() {
        return None;
    }
    let centre = corners[0]
        + (a.norm_squared() * bc + b.norm_squared() * ca + c.norm_squared() * ab) / (2.0 * volume);
    centre.iter().all(|x| x.is_finite()).then_some(centre)
}

/// Spreads radii over the edges into the points that have none (NaN); zero where nothing is in reach.
fn fill_from_neighbours(mesh: &TriMesh, radii: &mut [f64]) {
    let touches_gap = |radii: &[f64], t: &[u32; 3]| t.iter().any(|&v| radii[v as usize].is_nan());
    let mut open: Vec<[u32; 3]> = mesh
        .triangles
        .iter()
        .copied()
        .filter(|t| touches_gap(radii, t))
        .collect();
    loop {
        let mut sums = std::collections::BTreeMap::<u32, (f64, f64)>::new();
        for t in &open {
            for v in t.iter().filter(|&&v| radii[v as usize].is_nan()) {
                for r in t
                    .map(|w| radii[w as usize])
                    .into_iter()
                    .filter(|r| !r.is_nan())
                {
                    let sum = sums.entry(*v).or_default();
                    *sum = (sum.0 + r, sum.1 + 1.0);
                }
            }
        }
        if sums.is_empty() {
            break;
        }
        sums.iter()
            .for_each(|(&v, (sum, count))| radii[v as usize] = sum / count);
        open.retain(|t| touches_gap(radii, t));
    }
    radii
        .iter_mut()
        .filter(|r| r.is_nan())
        .for_each(|r| *r = 0.0);
}
