//! Flat faces of the proposal with sharp borders: in the part they become exactly plane.

use super::facets::{Facets, NONE};
use super::ransac::Candidate;
use super::{Boss, FlatOptions};
use crate::Vec3;
use crate::cad::primitives::{Primitive, across};
use crate::mesh::TriMesh;

/// A flat face of the proposal.
#[derive(Debug, Clone, PartialEq)]
pub struct Flat {
    /// Unit normal, out of the material.
    pub normal: Vec3,
    /// Distance of the plane from the origin along the normal, mm.
    pub offset: f64,
    /// Convex polygon on the plane around the face and a margin, counter-clockwise seen from outside.
    pub outline: Vec<Vec3>,
    /// Middle of the face, mm.
    pub middle: Vec3,
    /// Area of the face, mm2.
    pub area: f64,
    /// Why it is not made plane, when it is not.
    pub reason: Option<String>,
}

/// All flat faces of a proposal.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Flats {
    /// The faces, the largest first.
    pub faces: Vec<Flat>,
    /// Triangles of those that are made plane; the tag is the number of the face.
    pub surface: TriMesh,
    /// A boss or a body ends on a face when it does within this, mm.
    pub tolerance: f64,
}

/// Sides of the outline: halves of right angles.
const SIDES: usize = 8;
/// The outline's margin, voxels: a fitted surface may bulge over the border of its face.
const MARGIN: f64 = 1.5;
/// Normals with this cosine are parallel but for the noise of a mesh: 0.5 degrees.
const PARALLEL: f64 = 0.999_96;
/// A boss or a body ends on a face when it does within this many voxels.
const SAME_PLANE: f64 = 0.05;
/// Material beside a face counts as standing on it when it is higher than this, voxels.
const STANDS: f64 = 0.5;

/// Finds the flat faces that can be cut plane.
///
/// 1. Planes of at least `min_area` squared voxels, of whose border at least `min_sharp` turns by `crease_angle` or more.
/// 2. Each gets a convex outline: eight sides around its points and a margin.
/// 3. Where material stands on it inside the outline, lower than `height`, it stays as it is, with the reason: a cut would
///    take that material away.
///
/// `candidates` are the surfaces of this mesh. Nothing without a crease angle.
pub fn flats(mesh: &TriMesh, candidates: &[Candidate], voxel: f64, options: &FlatOptions) -> Flats {
    let Some(crease) = options.crease_angle else {
        return Flats::default();
    };
    let facets = Facets::new(mesh);
    let mut out = Flats {
        tolerance: SAME_PLANE * voxel,
        ..Flats::default()
    };
    for candidate in candidates {
        let Primitive::Plane { normal, offset } = candidate.surface else {
            continue;
        };
        let large = candidate.area >= options.min_area * voxel * voxel;
        if !large || sharp(&facets, candidate, crease.to_radians()) < options.min_sharp {
            continue;
        }
        let points = facets.points(&candidate.triangles);
        let mut flat = Flat {
            normal,
            offset,
            outline: outline(&points, &normal, offset, MARGIN * voxel),
            middle: candidate.middle,
            area: candidate.area,
            reason: None,
        };
        flat.reason = standing(&facets, candidate, &flat, voxel, options.height);
        if flat.reason.is_none() {
            let number = out.faces.len() as u32;
            let first = out.surface.points.len() as u32;
            for (k, &t) in candidate.triangles.iter().enumerate() {
                out.surface.points.extend(mesh.corners(t as usize));
                let corner = first + 3 * k as u32;
                out.surface.triangles.push([corner, corner + 1, corner + 2]);
                out.surface.tags.push(number);
            }
        }
        out.faces.push(flat);
    }
    out
}

/// Share of a face's border, by length, at which the surface turns by at least `crease` radians.
fn sharp(facets: &Facets, candidate: &Candidate, crease: f64) -> f64 {
    let mut own = candidate.triangles.clone();
    own.sort_unstable();
    let Primitive::Plane { normal, .. } = candidate.surface else {
        return 0.0;
    };
    let (mut all, mut turned) = (0.0, 0.0);
    for &t in &own {
        let corners = facets.mesh.corners(t as usize);
        for k in 0..3 {
            let beside = facets.next[t as usize][k];
            if beside != NONE && own.binary_search(&beside).is_ok() {
                continue;
            }
            let length = (corners[(k + 1) % 3] - corners[k]).norm();
            all += length;
            if beside != NONE && facets.normals[beside as usize].dot(&normal) <= crease.cos() {
                turned += length;
            }
        }
    }
    if all > 0.0 { turned / all } else { 0.0 }
}

/// Eight sides around points on a plane, `margin` mm away from them.
fn outline(points: &[Vec3], normal: &Vec3, offset: f64, margin: f64) -> Vec<Vec3> {
    let [x, y] = across(normal);
    let side = |k: usize| {
        let (s, c) = (std::f64::consts::TAU * k as f64 / SIDES as f64).sin_cos();
        let farthest = |p: &Vec3| c * p.dot(&x) + s * p.dot(&y);
        let reach = points.iter().map(farthest).fold(f64::MIN, f64::max);
        ([c, s], reach + margin)
    };
    let corner = |k: usize| {
        let (([a, b], m), ([c, d], n)) = (side(k), side((k + 1) % SIDES));
        let det = a * d - b * c;
        let [u, v] = [(m * d - n * b) / det, (a * n - c * m) / det];
        x * u + y * v + normal * offset
    };
    (0..SIDES).map(corner).collect()
}

impl Flats {
    /// Lets faces that lie on a plane face of the given bodies lie on it exactly: a cut that is off by a few millionths would
    /// leave slivers. `surface` are triangles of the bodies.
    pub fn adopt_planes(&mut self, surface: &TriMesh) {
        let tolerance = self.tolerance;
        for flat in &mut self.faces {
            let own = (0..surface.triangles.len()).filter_map(|t| {
                let corners = surface.corners(t);
                let cross = (corners[1] - corners[0]).cross(&(corners[2] - corners[0]));
                let normal = cross.try_normalize(f64::MIN_POSITIVE)?;
                let on = |p: &Vec3| flat.height(p).abs() <= tolerance && flat.covers(p);
                (normal.dot(&flat.normal) > PARALLEL && corners.iter().all(on)).then_some((
                    cross.norm(),
                    normal,
                    normal.dot(&corners[0]),
                ))
            });
            if let Some((_, normal, offset)) = own.max_by(|a, b| a.0.total_cmp(&b.0)) {
                (flat.normal, flat.offset) = (normal, offset);
                for p in &mut flat.outline {
                    *p -= normal * (normal.dot(p) - offset);
                }
            }
        }
    }

    /// Lets a recognised boss end exactly on the faces that it nearly ends on, its axis across the larger one.
    pub fn end_on(&self, boss: &mut Boss) {
        let free = || self.faces.iter().filter(|flat| flat.reason.is_none());
        let ends = |boss: &Boss, flat: &&Flat, end: usize| {
            let p = boss.origin + boss.direction * boss.extent[end];
            let sign = if end == 0 { -1.0 } else { 1.0 };
            boss.direction.dot(&flat.normal) * sign > PARALLEL
                && flat.height(&p).abs() <= self.tolerance
                && flat.covers(&p)
        };
        // The faces are sorted, the largest first.
        let first = free().find(|flat| ends(boss, flat, 0) || ends(boss, flat, 1));
        if let Some(flat) = first {
            boss.direction = flat.normal * flat.normal.dot(&boss.direction).signum();
        }
        for end in 0..2 {
            if let Some(flat) = free().find(|flat| ends(boss, flat, end)) {
                boss.extent[end] = -flat.height(&boss.origin) / flat.normal.dot(&boss.direction);
            }
        }
    }
}

impl Flat {
    /// Height of a point above the plane, mm.
    pub fn height(&self, p: &Vec3) -> f64 {
        self.normal.dot(p) - self.offset
    }

    /// Whether a point lies above or below the outline's inside.
    pub fn covers(&self, p: &Vec3) -> bool {
        let n = self.outline.len();
        (0..n).all(|k| {
            let (a, b) = (self.outline[k], self.outline[(k + 1) % n]);
            (b - a).cross(&(p - a)).dot(&self.normal) >= 0.0
        })
    }
}

/// What stands on a face inside its outline, if anything does.
fn standing(
    facets: &Facets,
    candidate: &Candidate,
    flat: &Flat,
    voxel: f64,
    height: f64,
) -> Option<String> {
    let mut own = vec![false; facets.areas.len()];
    for &t in &candidate.triangles {
        own[t as usize] = true;
    }
    let stands = |p: &Vec3| {
        let h = flat.height(p);
        h > STANDS * voxel && h < height * voxel && flat.covers(p)
    };
    // Edges cross the space in between too: long triangles are looked at in steps.
    let step = 0.5 * voxel;
    for t in (0..own.len()).filter(|&t| !own[t]) {
        let corners = facets.mesh.corners(t);
        let heights = corners.map(|p| flat.height(&p));
        let least = heights.iter().copied().fold(f64::MAX, f64::min);
        let most = heights.iter().copied().fold(f64::MIN, f64::max);
        if most < STANDS * voxel || least > height * voxel {
            continue;
        }
        let longest = (0..3)
            .map(|k| (corners[(k + 1) % 3] - corners[k]).norm())
            .fold(0.0, f64::max);
        let steps = ((longest / step).ceil() as usize).clamp(1, 64);
        for i in 0..=steps {
            for j in 0..=steps - i {
                let (u, v) = (i as f64 / steps as f64, j as f64 / steps as f64);
                let p = corners[0] + (corners[1] - corners[0]) * u + (corners[2] - corners[0]) * v;
                if stands(&p) {
                    return Some(format!(
                        "material stands on it at ({:.1}, {:.1}, {:.1}) mm",
                        p.x, p.y, p.z
                    ));
                }
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::monitor::Monitor;
    use crate::non_design::{RecogniseOptions, surfaces};

    /// The surface of a set of unit cubes.
    fn cubes(filled: impl Fn([i32; 3]) -> bool, n: i32) -> TriMesh {
        let mut mesh = TriMesh::default();
        let corner = |c: [i32; 3]| Vec3::new(f64::from(c[0]), f64::from(c[1]), f64::from(c[2]));
        for x in 0..n {
            for y in 0..n {
                for z in 0..n {
                    if !filled([x, y, z]) {
                        continue;
                    }
                    for axis in 0..3 {
                        for side in 0..2 {
                            let mut beside = [x, y, z];
                            beside[axis] += 2 * side - 1;
                            if beside.iter().all(|c| (0..n).contains(c)) && filled(beside) {
                                continue;
                            }
                            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                            let mut quad = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[a, b]| {
                                let mut c = [x, y, z];
                                c[axis] += side;
                                c[u] += a;
                                c[v] += b;
                                corner(c)
                            });
                            if side == 0 {
                                quad.reverse();
                            }
                            let first = mesh.points.len() as u32;
                            mesh.points.extend(quad);
                            mesh.triangles.extend([
                                [first, first + 1, first + 2],
                                [first, first + 2, first + 3],
                            ]);
                        }
                    }
                }
            }
        }
        crate::mesh::repair(
            mesh,
            &crate::mesh::RepairOptions::default(),
            &Monitor::default(),
        )
        .expect("closed")
        .mesh
    }

    fn found(mesh: &TriMesh) -> Flats {
        let candidates = surfaces(mesh, &RecogniseOptions::default(), &Monitor::default())
            .expect("not cancelled");
        let options = FlatOptions {
            crease_angle: Some(40.0),
            ..FlatOptions::default()
        };
        flats(mesh, &candidates, 1.0, &options)
    }

    #[test]
    fn a_block_has_six_flat_faces_with_their_areas_and_normals() {
        let flats = found(&cubes(|_| true, 12));
        assert_eq!(flats.faces.len(), 6);
        for flat in &flats.faces {
            assert_eq!(flat.reason, None);
            assert!((flat.area - 144.0).abs() < 1e-9);
            assert!(flat.height(&Vec3::repeat(6.0)) < -5.9);
            assert!(flat.covers(&flat.middle));
            assert!(flat.outline.iter().all(|p| flat.height(p).abs() < 1e-9));
        }
        assert_eq!(flats.surface.tags.len(), 6 * 288);
    }

    #[test]
    fn a_face_with_a_low_pad_on_it_stays_and_says_where() {
        let pad = |c: [i32; 3]| c[2] < 10 || c[0] > 4 && c[1] > 4 && c[0] < 8 && c[1] < 8;
        let flats = found(&cubes(pad, 12));
        let top = flats.faces.iter().find(|f| f.normal.z > 0.9);
        let reason = top.and_then(|f| f.reason.clone()).expect("a reason");
        assert!(reason.contains("stands"), "{reason}");
        assert!(flats.faces.iter().filter(|f| f.reason.is_none()).count() >= 5);
    }

    #[test]
    fn a_boss_that_ended_a_millionth_off_a_face_ends_on_it() {
        let flats = found(&cubes(|_| true, 12));
        let mut boss = Boss {
            bore: 0,
            wall: None,
            ends: [None; 2],
            origin: Vec3::new(6.0, 6.0, 3.0),
            direction: Vec3::new(2e-5, 0.0, -1.0).normalize(),
            radius: 2.0,
            outer_radius: 3.0,
            extent: [-9.000_001, 2.999_998],
            notches: Vec::new(),
            free: 2.0,
            residual: 0.0,
        };
        flats.end_on(&mut boss);
        let end = |k: usize| boss.origin + boss.direction * boss.extent[k];
        assert!((boss.direction + Vec3::z()).norm() < 1e-9, "{boss:?}");
        assert!((end(0).z - 12.0).abs() < 1e-9 && end(1).z.abs() < 1e-9);
    }

    #[test]
    fn a_face_on_a_plane_of_a_given_body_takes_that_plane() {
        let mut flats = found(&cubes(|_| true, 12));
        let z = |x: f64| 1e-4 + 1e-5 * x;
        let corners = [[2.0, 2.0], [2.0, 9.0], [9.0, 2.0]];
        let points: Vec<Vec3> = corners.map(|[x, y]| Vec3::new(x, y, z(x))).to_vec();
        let below = TriMesh {
            points: points.clone(),
            triangles: vec![[0, 1, 2]],
            tags: Vec::new(),
        };
        flats.adopt_planes(&below);
        let bottom = flats.faces.iter().find(|f| f.normal.z < -0.9);
        let bottom = bottom.expect("a bottom");
        assert!(points.iter().all(|p| bottom.height(p).abs() < 1e-12));
    }

    #[test]
    fn without_a_crease_angle_nothing_is_plane() {
        let mesh = cubes(|_| true, 12);
        let candidates = surfaces(&mesh, &RecogniseOptions::default(), &Monitor::default())
            .expect("not cancelled");
        assert_eq!(
            flats(&mesh, &candidates, 1.0, &FlatOptions::default()),
            Flats::default()
        );
    }
}
