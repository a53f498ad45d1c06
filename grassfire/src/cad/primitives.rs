//! Planes, cylinders and cones in a triangle mesh: connected parts, smooth regions, least-squares fits.

use std::collections::HashMap;

use nalgebra::{DMatrix, DVector, Matrix3};
use serde::Serialize;

use super::CadError;
use crate::Vec3;
use crate::mesh::TriMesh;

/// Points closer than this share of the bounding box's diagonal are one.
const WELD: f64 = 1e-7;

/// A surface fitted to a region.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub enum Primitive {
    /// Plane: `normal . p = offset`, normal out of the material.
    Plane {
        /// Unit normal.
        normal: Vec3,
        /// Distance from the origin along the normal, mm.
        offset: f64,
    },
    /// Cylinder.
    Cylinder {
        /// Point of the axis, mm.
        origin: Vec3,
        /// Unit direction.
        direction: Vec3,
        /// Radius, mm.
        radius: f64,
        /// The material is outside.
        concave: bool,
    },
}

/// A smooth region of a mesh.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Region {
    /// Triangles of the region.
    pub triangles: Vec<u32>,
    /// Fitted surface; `None` when neither plane nor cylinder fits.
    pub primitive: Option<Primitive>,
    /// Largest distance of a vertex to it, mm.
    pub residual: f64,
}

/// Welds a mesh and splits it into closed connected parts, each with positive volume.
///
/// # Errors
/// [`CadError::BadMesh`] (empty, bad index, coordinate not finite), [`CadError::OpenMesh`].
pub fn parts(name: &str, mesh: &TriMesh) -> Result<Vec<TriMesh>, CadError> {
    let bad = |text: String| CadError::BadMesh {
        name: name.to_owned(),
        text,
    };
    if mesh.triangles.is_empty() {
        return Err(bad("the mesh has no triangles".into()));
    }
    if let Some(i) = mesh
        .points
        .iter()
        .position(|p| p.iter().any(|x| !x.is_finite()))
    {
        return Err(bad(format!("point {i} has a coordinate that is no number")));
    }
    if let Some(t) = mesh
        .triangles
        .iter()
        .position(|t| t.iter().any(|&v| v as usize >= mesh.points.len()))
    {
        return Err(bad(format!("triangle {t} names a missing point")));
    }
    let welded = weld(mesh);
    let label = components(&welded);
    let count = label.iter().map(|&l| l as usize + 1).max().unwrap_or(0);
    let mut out = vec![TriMesh::default(); count];
    let mut number = vec![u32::MAX; welded.points.len()];
    for (t, triangle) in welded.triangles.iter().enumerate() {
        let part = &mut out[label[t] as usize];
        part.triangles.push(triangle.map(|v| {
            let n = &mut number[v as usize];
            if *n == u32::MAX {
                *n = part.points.len() as u32;
                part.points.push(welded.points[v as usize]);
            }
            *n
        }));
    }
    for part in &mut out {
        check_closed(name, part)?;
        if part.volume() < 0.0 {
            part.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
    }
    Ok(out)
}

fn weld(mesh: &TriMesh) -> TriMesh {
    let Some((low, high)) = mesh.bounds() else {
        return TriMesh::default();
    };
    let cell = ((high - low).norm() * WELD).max(f64::MIN_POSITIVE);
    let mut cells: HashMap<[i64; 3], u32> = HashMap::with_capacity(mesh.points.len());
    let mut out = TriMesh::default();
    let mut map = Vec::with_capacity(mesh.points.len());
    for p in &mesh.points {
        let key: [i64; 3] = std::array::from_fn(|k| ((p[k] - low[k]) / cell).floor() as i64);
        let near = (0..27).find_map(|n| {
            let at = [
                key[0] + n % 3 - 1,
                key[1] + n / 3 % 3 - 1,
                key[2] + n / 9 - 1,
            ];
            cells
                .get(&at)
                .copied()
                .filter(|&i: &u32| (out.points[i as usize] - p).norm() <= cell)
        });
        map.push(near.unwrap_or_else(|| {
            let i = out.points.len() as u32;
            cells.insert(key, i);
            out.points.push(*p);
            i
        }));
    }
    let triangles = mesh.triangles.iter().map(|t| t.map(|v| map[v as usize]));
    out.triangles = triangles
        .filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0])
        .collect();
    out
}

fn find(parent: &mut [u32], mut a: u32) -> u32 {
    while parent[a as usize] != a {
        parent[a as usize] = parent[parent[a as usize] as usize];
        a = parent[a as usize];
    }
    a
}

/// Label of the connected part of each triangle, numbered by first appearance.
fn components(mesh: &TriMesh) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..mesh.points.len() as u32).collect();
    for t in &mesh.triangles {
        for k in 1..3 {
            let (a, b) = (find(&mut parent, t[0]), find(&mut parent, t[k]));
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    let mut label = vec![u32::MAX; mesh.points.len()];
    let mut next = 0;
    let label_of = |t: &[u32; 3]| {
        let root = find(&mut parent, t[0]) as usize;
        if label[root] == u32::MAX {
            label[root] = next;
            next += 1;
        }
        label[root]
    };
    mesh.triangles.iter().map(label_of).collect()
}

/// For each triangle the neighbour across each of its three edges (corner k to k + 1).
pub(crate) fn neighbours(mesh: &TriMesh) -> Result<Vec<[u32; 3]>, (usize, [u32; 2])> {
    let mut half: HashMap<(u32, u32), (u32, u8)> = HashMap::with_capacity(mesh.triangles.len() * 3);
    let mut twice = Vec::new();
    for (t, v) in mesh.triangles.iter().enumerate() {
        for k in 0..3 {
            let edge = (v[k], v[(k + 1) % 3]);
            if half.insert(edge, (t as u32, k as u8)).is_some() {
                twice.push([edge.0, edge.1]);
            }
        }
    }
    let mut open = twice;
    let mut out = vec![[u32::MAX; 3]; mesh.triangles.len()];
    for (t, v) in mesh.triangles.iter().enumerate() {
        for k in 0..3 {
            match half.get(&(v[(k + 1) % 3], v[k])) {
                Some(&(other, _)) => out[t][k] = other,
                None => open.push([v[k], v[(k + 1) % 3]]),
            }
        }
    }
    match open.first() {
        Some(&edge) => Err((open.len(), edge)),
        None => Ok(out),
    }
}

fn check_closed(name: &str, part: &TriMesh) -> Result<(), CadError> {
    match neighbours(part) {
        Ok(_) => Ok(()),
        Err((edges, [a, b])) => {
            let place = (part.points[a as usize] + part.points[b as usize]) / 2.0;
            Err(CadError::OpenMesh {
                name: name.to_owned(),
                edges,
                place: place.into(),
            })
        }
    }
}

/// Cuts a closed mesh at edges sharper than `sharp_angle` degrees and fits a plane or a cylinder to every piece.
pub fn regions(mesh: &TriMesh, sharp_angle: f64, tolerance: f64) -> Vec<Region> {
    let Ok(next) = neighbours(mesh) else {
        return Vec::new();
    };
    let normal: Vec<Vec3> = (0..mesh.triangles.len())
        .map(|t| {
            let [a, b, c] = mesh.corners(t);
            (b - a)
                .cross(&(c - a))
                .try_normalize(0.0)
                .unwrap_or_else(Vec3::zeros)
        })
        .collect();
    let limit = sharp_angle.to_radians().cos();
    let mut seen = vec![false; mesh.triangles.len()];
    let mut out = Vec::new();
    for start in 0..mesh.triangles.len() {
        if std::mem::replace(&mut seen[start], true) {
            continue;
        }
        let mut triangles = vec![start as u32];
        let mut at = 0;
        while let Some(&t) = triangles.get(at) {
            at += 1;
            for &n in &next[t as usize] {
                // A sliver without a normal joins whatever it touches.
                let sharp = normal[t as usize].dot(&normal[n as usize]) < limit
                    && normal[n as usize] != Vec3::zeros();
                if !seen[n as usize] && !sharp {
                    seen[n as usize] = true;
                    triangles.push(n);
                }
            }
        }
        triangles.sort_unstable();
        out.push(fit(mesh, &normal, triangles, tolerance));
    }
    out
}

fn fit(mesh: &TriMesh, normal: &[Vec3], triangles: Vec<u32>, tolerance: f64) -> Region {
    let mut vertices: Vec<u32> = triangles
        .iter()
        .flat_map(|&t| mesh.triangles[t as usize])
        .collect();
    vertices.sort_unstable();
    vertices.dedup();
    let points: Vec<Vec3> = vertices.iter().map(|&v| mesh.points[v as usize]).collect();
    let weighted: Vec<(Vec3, Vec3, f64)> = triangles
        .iter()
        .map(|&t| {
            let [a, b, c] = mesh.corners(t as usize);
            (
                (a + b + c) / 3.0,
                normal[t as usize],
                (b - a).cross(&(c - a)).norm() / 2.0,
            )
        })
        .collect();
    let (plane, flat) = fit_plane(&points, &weighted);
    if flat <= tolerance {
        return Region {
            triangles,
            primitive: Some(plane),
            residual: flat,
        };
    }
    match fit_cylinder(&points, &weighted) {
        Some((cylinder, residual)) if residual <= tolerance => Region {
            triangles,
            primitive: Some(cylinder),
            residual,
        },
        other => Region {
            triangles,
            primitive: None,
            residual: other.map_or(flat, |o| o.1.min(flat)),
        },
    }
}

pub(crate) fn fit_plane(points: &[Vec3], weighted: &[(Vec3, Vec3, f64)]) -> (Primitive, f64) {
    let centre = points.iter().sum::<Vec3>() / points.len().max(1) as f64;
    let mut spread = Matrix3::zeros();
    for p in points {
        spread += (p - centre) * (p - centre).transpose();
    }
    let eigen = spread.symmetric_eigen();
    let mut normal: Vec3 = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into();
    let outward: Vec3 = weighted.iter().map(|(_, n, area)| n * *area).sum();
    if normal.dot(&outward) < 0.0 {
        normal = -normal;
    }
    let residual = points
        .iter()
        .map(|p| (p - centre).dot(&normal).abs())
        .fold(0.0, f64::max);
    (
        Primitive::Plane {
            normal,
            offset: normal.dot(&centre),
        },
        residual,
    )
}

/// Axis from the normals (they lie in a plane), circle by linear least squares, then Gauss-Newton on all five parameters.
pub(crate) fn fit_cylinder(
    points: &[Vec3],
    weighted: &[(Vec3, Vec3, f64)],
) -> Option<(Primitive, f64)> {
    let mut spread = Matrix3::zeros();
    for (_, n, area) in weighted {
        spread += n * n.transpose() * *area;
    }
    let eigen = spread.symmetric_eigen();
    let mut direction: Vec3 = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into();
    let mut origin = points.iter().sum::<Vec3>() / points.len() as f64;
    let mut radius = 0.0;
    for round in 0..20 {
        let [e1, e2] = across(&direction);
        let local = |p: &Vec3| {
            [
                (p - origin).dot(&e1),
                (p - origin).dot(&e2),
                (p - origin).dot(&direction),
            ]
        };
        if round == 0 {
            let rows = points.iter().map(local).collect::<Vec<_>>();
            let a = DMatrix::from_fn(
                rows.len(),
                3,
                |i, k| if k < 2 { 2.0 * rows[i][k] } else { 1.0 },
            );
            let b = DVector::from_fn(rows.len(), |i, _| rows[i][0].powi(2) + rows[i][1].powi(2));
            let s = (a.transpose() * &a).lu().solve(&(a.transpose() * b))?;
            radius = (s[2] + s[0] * s[0] + s[1] * s[1]).max(0.0).sqrt();
            origin += e1 * s[0] + e2 * s[1];
            continue;
        }
        // distance = |q| - r; moves: origin by x, y; direction by e1 * tilt1 + e2 * tilt2; radius.
        let mut normal_matrix = nalgebra::Matrix5::<f64>::zeros();
        let mut right = nalgebra::Vector5::<f64>::zeros();
        for p in points {
            let [x, y, z] = local(p);
            let r = x.hypot(y).max(1e-300);
            let (c, s) = (x / r, y / r);
            let row = nalgebra::Vector5::new(-c, -s, -c * z, -s * z, -1.0);
            normal_matrix += row * row.transpose();
            right -= row * (r - radius);
        }
        let step = normal_matrix.lu().solve(&right)?;
        origin += e1 * step[0] + e2 * step[1];
        direction = (direction + e1 * step[2] + e2 * step[3]).try_normalize(1e-9)?;
        radius += step[4];
        if step.amax() < 1e-13 * radius.abs() {
            break;
        }
    }
    if !(radius.is_finite() && radius > 0.0) {
        return None;
    }
    let radial = |p: Vec3| {
        let q = p - origin;
        q - direction * q.dot(&direction)
    };
    let residual = points
        .iter()
        .map(|&p| (radial(p).norm() - radius).abs())
        .fold(0.0, f64::max);
    let outward: f64 = weighted
        .iter()
        .map(|(centre, n, area)| radial(*centre).dot(n) * area)
        .sum();
    let flip = direction[direction.iamax()] < 0.0;
    let direction = if flip { -direction } else { direction };
    Some((
        Primitive::Cylinder {
            origin,
            direction,
            radius,
            concave: outward < 0.0,
        },
        residual,
    ))
}

/// Two unit vectors across an axis.
pub(crate) fn across(direction: &Vec3) -> [Vec3; 2] {
    let side = if direction.x.abs() < 0.8 {
        Vec3::x()
    } else {
        Vec3::y()
    };
    let first = direction.cross(&side).normalize();
    [first, direction.cross(&first)]
}
