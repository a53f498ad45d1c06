//! How far the patches are from the Catmull-Clark limit surface, sampled by subdivision.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use grassfire::Vec3;
use grassfire::spline::{ControlMesh, Patch, evaluate};

use crate::patches::build;
use crate::shapes;

/// Edge neighbours and diagonals of every point, counter-clockwise.
fn stars(mesh: &ControlMesh) -> Vec<Vec<[u32; 2]>> {
    // after[(v, a)]: the quad with the edge v a has the diagonal d and the other edge v b.
    let mut after = BTreeMap::new();
    for q in &mesh.quads {
        for k in 0..4 {
            after.insert((q[k], q[(k + 1) % 4]), [q[(k + 2) % 4], q[(k + 3) % 4]]);
        }
    }
    let mut stars = vec![Vec::new(); mesh.points.len()];
    for &(v, a) in after.keys() {
        if stars[v as usize].is_empty() {
            let mut edge = a;
            loop {
                let [diagonal, next] = after[&(v, edge)];
                stars[v as usize].push([edge, diagonal]);
                edge = next;
                if edge == a {
                    break;
                }
            }
        }
    }
    stars
}

/// One Catmull-Clark step; quad `4 q + k` is the part of quad `q` at its corner `k`.
fn subdivide(mesh: &ControlMesh) -> ControlMesh {
    let p = |v: u32| mesh.points[v as usize];
    let faces: Vec<Vec3> = mesh
        .quads
        .iter()
        .map(|q| q.iter().map(|&v| p(v)).sum::<Vec3>() / 4.0)
        .collect();
    let mut edges: BTreeMap<[u32; 2], (u32, Vec3)> = BTreeMap::new();
    let key = |a: u32, b: u32| [a.min(b), a.max(b)];
    for (q, face) in mesh.quads.iter().zip(&faces) {
        for k in 0..4 {
            edges
                .entry(key(q[k], q[(k + 1) % 4]))
                .or_insert((0, Vec3::zeros()))
                .1 += face;
        }
    }
    let mut points: Vec<Vec3> = Vec::new();
    let mut face_sum = vec![Vec3::zeros(); mesh.points.len()];
    for (q, face) in mesh.quads.iter().zip(&faces) {
        q.iter().for_each(|&v| face_sum[v as usize] += face);
    }
    for (v, star) in stars(mesh).iter().enumerate() {
        let n = star.len() as f64;
        let edge_sum: Vec3 = star.iter().map(|[e, _]| p(*e)).sum();
        points.push(mesh.points[v] * ((n - 2.0) / n) + (edge_sum + face_sum[v]) / (n * n));
    }
    for ([a, b], (number, sum)) in &mut edges {
        *number = points.len() as u32;
        points.push((p(*a) + p(*b) + *sum) / 4.0);
    }
    let first_face = points.len() as u32;
    points.extend(&faces);
    let mut quads = Vec::new();
    for (f, q) in mesh.quads.iter().enumerate() {
        for k in 0..4 {
            let (next, previous) = (
                edges[&key(q[k], q[(k + 1) % 4])].0,
                edges[&key(q[k], q[(k + 3) % 4])].0,
            );
            quads.push([q[k], next, first_face + f as u32, previous]);
        }
    }
    ControlMesh { points, quads }
}

/// Limit position and normal of every point.
fn limits(mesh: &ControlMesh) -> Vec<[Vec3; 2]> {
    let p = |v: u32| mesh.points[v as usize];
    let limit = |(v, star): (usize, &Vec<[u32; 2]>)| {
        let n = star.len() as f64;
        let (edges, diagonals) = star
            .iter()
            .fold((Vec3::zeros(), Vec3::zeros()), |(e, d), s| {
                (e + p(s[0]), d + p(s[1]))
            });
        let position = (mesh.points[v] * n * n + edges * 4.0 + diagonals) / (n * (n + 5.0));
        let root = (4.0 + (PI / n).cos().powi(2)).sqrt();
        let mut tangents = [Vec3::zeros(); 2];
        for (k, [e, d]) in star.iter().enumerate() {
            let (a, b) = (2.0 * PI * k as f64 / n, PI * (2 * k + 1) as f64 / n);
            let (x, y) = (p(*e) * (1.0 + (PI / n).cos() / root), p(*d) / root);
            tangents[0] += x * a.cos() + y * b.cos();
            tangents[1] += x * a.sin() + y * b.sin();
        }
        [position, tangents[0].cross(&tangents[1]).normalize()]
    };
    stars(mesh).iter().enumerate().map(limit).collect()
}

struct Deviation {
    /// Normal distance, parts of the diagonal of the box.
    max: f64,
    rms: f64,
    /// Largest angle between the normals, degrees.
    angle: f64,
    /// Smallest sine between the derivatives, signed by the limit normal.
    jacobian: f64,
}

/// Compares at all points of `levels` subdivisions.
fn deviation(mesh: &ControlMesh, patches: &[Patch], levels: u32) -> Deviation {
    let mut fine = mesh.clone();
    // Quad and parameters of the four corners of each fine quad.
    let mut places: Vec<(usize, [[f64; 2]; 4])> = (0..mesh.quads.len())
        .map(|q| (q, [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]))
        .collect();
    for _ in 0..levels {
        fine = subdivide(&fine);
        let mix = |a: [f64; 2], b: [f64; 2]| [(a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0];
        let split = |(q, c): &(usize, [[f64; 2]; 4])| {
            let (q, c) = (*q, *c);
            (0..4).map(move |k| {
                (
                    q,
                    [
                        c[k],
                        mix(c[k], c[(k + 1) % 4]),
                        mix(c[0], c[2]),
                        mix(c[k], c[(k + 3) % 4]),
                    ],
                )
            })
        };
        places = places.iter().flat_map(split).collect();
    }
    let limits = limits(&fine);
    let mut result = Deviation {
        max: 0.0,
        rms: 0.0,
        angle: 0.0,
        jacobian: 1.0,
    };
    let size = shapes::diagonal(mesh);
    for (quad, (owner, corners)) in fine.quads.iter().zip(&places) {
        for (v, [u, w]) in quad.iter().zip(corners) {
            let [position, normal] = limits[*v as usize];
            let point = evaluate(&patches[*owner], *u, *w);
            let distance = (point.position - position).dot(&normal).abs() / size;
            result.max = result.max.max(distance);
            result.rms += distance * distance / (4 * places.len()) as f64;
            result.angle = result.angle.max(
                point
                    .normal
                    .dot(&normal)
                    .clamp(-1.0, 1.0)
                    .acos()
                    .to_degrees(),
            );
            let sine = point.du.cross(&point.dv).dot(&normal) / (point.du.norm() * point.dv.norm());
            result.jacobian = result.jacobian.min(sine);
        }
    }
    result.rms = result.rms.sqrt();
    result
}

#[test]
fn patches_are_close_to_the_limit_surface() {
    for (name, mut mesh) in shapes::all() {
        shapes::jitter(&mut mesh, 0.05, 6);
        let coarse = deviation(&mesh, &build(&mesh), 3);
        println!(
            "{name}: max {:.5} rms {:.5} angle {:.1} jacobian {:.2}",
            coarse.max, coarse.rms, coarse.angle, coarse.jacobian
        );
        assert!(
            coarse.max < 0.009 && coarse.angle < 10.0 && coarse.jacobian > 0.6,
            "{name}"
        );
        let once = subdivide(&mesh);
        let fine = deviation(&once, &build(&once), 2);
        println!(
            "   after one step: max {:.5} rms {:.5} angle {:.1} jacobian {:.2}",
            fine.max, fine.rms, fine.angle, fine.jacobian
        );
        assert!(
            fine.max < 0.0009 && fine.rms < 0.0005 && fine.angle < 4.5 && fine.jacobian > 0.7,
            "{name}"
        );
    }
}
