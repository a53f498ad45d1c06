//! Supports and loads of a project file on the boundary of a mesh.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::Path;

use nalgebra::Matrix3;

use super::element::{gauss, gauss_shapes, triangle_shape};
use super::{TetError, TetLoads, TetMesh, TetModel};
use crate::Vec3;
use crate::case::{Case, LoadCaseTable, LoadPlace, Places, Support, forces_on};
use crate::monitor::Monitor;

/// Tolerances of selections, as a share of the mean edge on the boundary: its nodes lie on the exact surface.
const SLACK: f64 = 0.05;
/// Quadrature of degree four on a triangle: barycentric coordinates (one, the other two) and weight, three points each. D. A.
/// Dunavant, 1985, doi:10.1002/nme.1620210612.
const QUADRATURE: [(f64, f64, f64); 2] = [
    (
        0.108_103_018_168_070,
        0.445_948_490_915_965,
        0.223_381_589_678_011,
    ),
    (
        0.816_847_572_980_459,
        0.091_576_213_509_771,
        0.109_951_743_655_322,
    ),
];

/// A six-node face of the boundary: corners, then the middles of 01, 12, 20.
pub(super) type Face = [u32; 6];

/// Faces of elements that no other element shares, ascending by their element.
pub(super) fn boundary(mesh: &TetMesh) -> Vec<Face> {
    // Corners and middles of the face opposite to each corner.
    const FACES: [[usize; 6]; 4] = [
        [1, 2, 3, 5, 9, 8],
        [0, 3, 2, 7, 9, 6],
        [0, 1, 3, 4, 8, 7],
        [0, 2, 1, 6, 5, 4],
    ];
    let faces = mesh
        .cells
        .iter()
        .flat_map(|c| FACES.map(|f| f.map(|i| c[i])));
    let key = |f: &Face| {
        let mut key = [f[0], f[1], f[2]];
        key.sort_unstable();
        key
    };
    let mut times: HashMap<[u32; 3], u8> = HashMap::new();
    for face in faces.clone() {
        *times.entry(key(&face)).or_default() += 1;
    }
    faces.filter(|f| times[&key(f)] == 1).collect()
}

pub(super) fn on_boundary(
    case: &Case,
    folder: &Path,
    mesh: &TetMesh,
    monitor: &Monitor,
) -> Result<TetModel, TetError> {
    let faces = boundary(mesh);
    let nodes: BTreeSet<u32> = faces.iter().flatten().copied().collect();
    let edge = |f: &Face| (mesh.points[f[0] as usize] - mesh.points[f[1] as usize]).norm();
    let mean = faces.iter().map(edge).sum::<f64>() / faces.len().max(1) as f64;
    let places = |slack, points| Places::new(case, folder, points, slack, monitor);
    let on_nodes = nodes.iter().map(|&n| mesh.points[n as usize]).collect();
    let site = Site {
        mesh,
        faces,
        nodes: nodes.into_iter().collect(),
        surface: places(SLACK * mean, on_nodes)?,
        volume: places(0.0, mesh.points.clone())?,
        monitor,
    };
    let cases = case
        .case
        .iter()
        .map(|table| site.loads(table, table.body_force(&case.material)));
    Ok(TetModel {
        cases: cases.collect::<Result<_, _>>()?,
        fixed: site.supports(case)?,
        springs: site.springs(case, mean)?,
        young: case.material.young,
        nu: case.material.nu,
    })
}

struct Site<'a> {
    mesh: &'a TetMesh,
    faces: Vec<Face>,
    /// Nodes of the boundary, ascending.
    nodes: Vec<u32>,
    /// Selections on the nodes of the boundary.
    surface: Places<'a>,
    /// Selections on all nodes, without tolerance.
    volume: Places<'a>,
    monitor: &'a Monitor,
}

impl Site<'_> {
    /// Faces whose nodes are all selected.
    fn chosen(&self, name: &str) -> Result<Vec<&Face>, TetError> {
        let mut held = vec![false; self.mesh.points.len()];
        for i in self.surface.select(name, self.monitor)? {
            held[self.nodes[i] as usize] = true;
        }
        let whole = |f: &&Face| f.iter().all(|&n| held[n as usize]);
        Ok(self.faces.iter().filter(whole).collect())
    }

    fn supports(&self, case: &Case) -> Result<Vec<(u32, usize)>, TetError> {
        let mut fixed = BTreeSet::new();
        let fixing = |s: &&Support| !s.fixed().is_empty();
        for support in case.support.iter().filter(fixing) {
            let faces = self.chosen(&support.on)?;
            let within = self.volume.select(&support.on, self.monitor)?;
            let inside = within.into_iter().map(|i| i as u32);
            let nodes: BTreeSet<u32> = faces.iter().flat_map(|f| **f).chain(inside).collect();
            if nodes.is_empty() {
                return Err(TetError::NotOnPart {
                    what: "support",
                    name: support.on.clone(),
                });
            }
            let axes = support.fixed().into_iter();
            fixed.extend(axes.flat_map(|axis| nodes.iter().map(move |&n| (n, axis))));
        }
        Ok(fixed.into_iter().collect())
    }

    /// Springs at the nodes of faces, each with the share that its shape function has in the area: those at the corners of flat
    /// faces come to zero. `edge`: mean edge of the boundary, mm.
    fn springs(&self, case: &Case, edge: f64) -> Result<Vec<(u32, Matrix3<f64>)>, TetError> {
        let mut sums: BTreeMap<u32, Matrix3<f64>> = BTreeMap::new();
        for support in &case.support {
            if support.stiffness(1.0).is_none() {
                continue;
            }
            let points = self.points(&support.on, "support")?;
            let area: f64 = points.iter().map(|p| p.area.norm()).sum();
            let beneath = case.material.young * area / edge;
            let stiffness = support.stiffness(beneath).unwrap_or_default() / area;
            for point in points {
                for (&node, shape) in point.face.iter().zip(point.shape) {
                    *sums.entry(node).or_default() += shape * point.area.norm() * stiffness;
                }
            }
        }
        Ok(sums.into_iter().collect())
    }

    /// Quadrature points of the faces of a selection.
    fn points(&self, name: &str, what: &'static str) -> Result<Vec<Point>, TetError> {
        let faces = self.chosen(name)?;
        if faces.is_empty() {
            return Err(TetError::NotOnPart {
                what,
                name: name.to_owned(),
            });
        }
        Ok(faces
            .iter()
            .flat_map(|f| quadrature(self.mesh, f))
            .collect())
    }

    fn loads(&self, table: &LoadCaseTable, body_force: Vec3) -> Result<TetLoads, TetError> {
        let mut sums = weight(self.mesh, body_force);
        for load in &table.loads {
            let points = self.points(&load.on, "load")?;
            let places: Vec<LoadPlace> = points
                .iter()
                .map(|p| LoadPlace::on_surface(p.place, p.area))
                .collect();
            for (point, force) in points.iter().zip(forces_on(&places, load)?) {
                for (&node, shape) in point.face.iter().zip(point.shape) {
                    *sums.entry(node).or_default() += shape * force;
                }
            }
        }
        Ok(TetLoads {
            name: table.name.clone(),
            weight: table.weight,
            forces: sums.into_iter().collect(),
        })
    }
}

/// The forces of a body force (N/mm3) on the nodes, N; none without one.
fn weight(mesh: &TetMesh, force: Vec3) -> BTreeMap<u32, Vec3> {
    let mut out: BTreeMap<u32, Vec3> = BTreeMap::new();
    if force == Vec3::zeros() {
        return out;
    }
    let shapes = gauss_shapes();
    for cell in &mesh.cells {
        let corners = cell.map(|n| mesh.points[n as usize]);
        for (point, shape) in gauss(&corners).iter().zip(&shapes) {
            for (&node, s) in cell.iter().zip(shape) {
                *out.entry(node).or_default() += s * point.volume * force;
            }
        }
    }
    out
}

/// Quadrature points of a curved face.
pub(super) fn quadrature(mesh: &TetMesh, face: &Face) -> Vec<Point> {
    let corners = face.map(|n| mesh.points[n as usize]);
    let mut out = Vec::with_capacity(6);
    for (one, two, weight) in QUADRATURE {
        for k in 0..3 {
            let mut l = [two; 3];
            l[k] = one;
            let shape = triangle_shape(l);
            out.push(Point {
                face: *face,
                shape,
                place: corners.iter().zip(shape).map(|(c, s)| s * c).sum(),
                area: weight * area(&corners, l),
            });
        }
    }
    out
}

/// A quadrature point.
pub(super) struct Point {
    pub face: Face,
    pub shape: [f64; 6],
    pub place: Vec3,
    /// Its share of the area times the outward normal, mm2.
    pub area: Vec3,
}

/// Area of a curved face, times its outward normal, if all of it were as at one point.
fn area(corners: &[Vec3; 6], l: [f64; 3]) -> Vec3 {
    let slope = |k: usize| -> Vec3 {
        // Coordinate 0 is the rest to one.
        let d = |i: usize| f64::from(u8::from(i == k)) - f64::from(u8::from(i == 0));
        let corner = (0..3)
            .map(|i| (4.0 * l[i] - 1.0) * d(i) * corners[i])
            .sum::<Vec3>();
        let pairs = [(0, 1), (1, 2), (2, 0)].into_iter().enumerate();
        corner
            + pairs
                .map(|(e, (i, j))| 4.0 * (l[i] * d(j) + l[j] * d(i)) * corners[3 + e])
                .sum::<Vec3>()
    };
    slope(1).cross(&slope(2)) / 2.0
}
