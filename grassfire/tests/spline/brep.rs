//! Faces: few, rectangular, and exactly the same surface as the patches.

use std::collections::BTreeMap;

use grassfire::Vec3;
use grassfire::monitor::Monitor;
use grassfire::spline::{
    Brep, BrepFace, BrepOptions, ControlMesh, FaceMode, PatchOptions, SplineError, build_brep,
    volume,
};
use proptest::prelude::*;

use crate::patches::build;
use crate::shapes;

fn brep(mesh: &ControlMesh, faces: FaceMode) -> Brep {
    build_brep(
        mesh,
        &build(mesh),
        &BrepOptions {
            faces,
            ..BrepOptions::default()
        },
        &Monitor::default(),
    )
    .expect("a valid mesh")
}

/// Knots 0..=spans of multiplicity 6, 4, .., 4, 6.
fn knots(spans: u32) -> Vec<f64> {
    (0..=spans)
        .flat_map(|k| vec![f64::from(k); if k == 0 || k == spans { 6 } else { 4 }])
        .collect()
}

/// B-spline basis of degree 5 and its derivative at `t`, by the recursion of Cox and de Boor: independent of Bezier nets.
fn basis(spans: u32, t: f64) -> (Vec<f64>, Vec<f64>) {
    let knots = knots(spans);
    let last = spans - 1;
    let span = (t.floor() as u32).min(last);
    let mut values: Vec<f64> = knots
        .windows(2)
        .map(|k| {
            if k[0] == f64::from(span) && k[1] > k[0] {
                1.0
            } else {
                0.0
            }
        })
        .collect();
    let mut slopes = Vec::new();
    for degree in 1..=5 {
        let part = |i: usize| (knots[i], knots[i + degree]);
        let ratio = |top: f64, bottom: f64| if bottom > 0.0 { top / bottom } else { 0.0 };
        let next = (0..values.len() - 1).map(|i| {
            let ((a, b), (c, d)) = (part(i), part(i + 1));
            (
                ratio(t - a, b - a) * values[i] + ratio(d - t, d - c) * values[i + 1],
                degree as f64 * (ratio(values[i], b - a) - ratio(values[i + 1], d - c)),
            )
        });
        (values, slopes) = next.unzip();
    }
    (values, slopes)
}

/// Position and first derivatives of a face.
fn evaluate_face(face: &BrepFace, u: f64, v: f64) -> [Vec3; 3] {
    let ((bu, su), (bv, sv)) = (basis(face.spans[0], u), basis(face.spans[1], v));
    let columns = bv.len();
    assert_eq!(face.control.len(), bu.len() * columns);
    let mut sum = [Vec3::zeros(); 3];
    for (k, p) in face.control.iter().enumerate() {
        let (i, j) = (k / columns, k % columns);
        sum[0] += p * (bu[i] * bv[j]);
        sum[1] += p * (su[i] * bv[j]);
        sum[2] += p * (bu[i] * sv[j]);
    }
    sum
}

/// Volume from the faces, knot span by knot span, by a Gauss rule of its own (9 points).
fn face_volume(brep: &Brep) -> f64 {
    const X: [f64; 5] = [
        0.0,
        0.324_253_423_403_808_9,
        0.613_371_432_700_590_4,
        0.836_031_107_326_635_8,
        0.968_160_239_507_626_1,
    ];
    const W: [f64; 5] = [
        0.330_239_355_001_259_8,
        0.312_347_077_040_002_84,
        0.260_610_696_402_935_46,
        0.180_648_160_694_857_4,
        0.081_274_388_361_574_41,
    ];
    let rule: Vec<(f64, f64)> = (0..5)
        .flat_map(|k| {
            if k == 0 {
                vec![(0.5, W[0] / 2.0)]
            } else {
                vec![
                    (0.5 - X[k] / 2.0, W[k] / 2.0),
                    (0.5 + X[k] / 2.0, W[k] / 2.0),
                ]
            }
        })
        .collect();
    let base = brep.vertices[0];
    let mut sum = 0.0;
    for face in &brep.faces {
        for i in 0..face.spans[0] {
            for j in 0..face.spans[1] {
                for (x, wx) in &rule {
                    for (y, wy) in &rule {
                        let [p, du, dv] = evaluate_face(face, f64::from(i) + x, f64::from(j) + y);
                        sum += wx * wy * (p - base).dot(&du.cross(&dv));
                    }
                }
            }
        }
    }
    sum / 3.0
}

/// Edge curves, parameter curves and vertices lie on the faces.
fn assert_on_faces(name: &str, mesh: &ControlMesh, brep: &Brep) {
    let limit =
        1e-12 * shapes::diagonal(mesh).max(mesh.points.iter().fold(0.0, |m, p| m.max(p.amax())));
    for edge in &brep.edges {
        assert_eq!(edge.control.len(), 4 * edge.spans as usize + 2);
        assert_eq!(edge.control[0], brep.vertices[edge.vertices[0] as usize]);
        assert_eq!(
            edge.control[edge.control.len() - 1],
            brep.vertices[edge.vertices[1] as usize]
        );
    }
    for face in &brep.faces {
        for side in &face.uses {
            let edge = &brep.edges[side.edge as usize];
            for k in 0..=4 {
                let t = f64::from(k) / 4.0;
                let (weights, _) = basis(edge.spans, t * f64::from(edge.spans));
                let on_edge: Vec3 = edge.control.iter().zip(&weights).map(|(p, w)| p * *w).sum();
                let [u, v] = [0, 1].map(|a| side.start[a] + (side.end[a] - side.start[a]) * t);
                let length =
                    (side.end[0] - side.start[0]).abs() + (side.end[1] - side.start[1]).abs();
                assert_eq!(
                    length,
                    f64::from(edge.spans),
                    "{name}: speed of the parameter curve"
                );
                let gap = (on_edge - evaluate_face(face, u, v)[0]).norm();
                assert!(
                    gap <= limit,
                    "{name}: edge {} is {gap:e} off its face",
                    side.edge
                );
            }
        }
    }
}

fn assert_valid(name: &str, mesh: &ControlMesh, brep: &Brep) {
    let mut uses: BTreeMap<u32, Vec<bool>> = BTreeMap::new();
    for face in &brep.faces {
        let mut visited: Vec<u32> = Vec::new();
        for (k, side) in face.uses.iter().enumerate() {
            uses.entry(side.edge).or_default().push(side.reversed);
            let (from, to) = if side.reversed {
                (side.end, side.start)
            } else {
                (side.start, side.end)
            };
            let after = &face.uses[(k + 1) % face.uses.len()];
            assert_eq!(
                to,
                if after.reversed {
                    after.end
                } else {
                    after.start
                },
                "{name}: closed loop"
            );
            assert_ne!(from, to);
            visited.push(brep.edges[side.edge as usize].vertices[usize::from(side.reversed)]);
        }
        visited.sort_unstable();
        let count = visited.len();
        visited.dedup();
        assert_eq!(visited.len(), count, "{name}: a face visits a vertex twice");
    }
    assert_eq!(uses.len(), brep.edges.len());
    assert!(
        uses.values().all(|u| u.len() == 2 && u[0] != u[1]),
        "{name}: two uses in opposite senses"
    );
    let euler = brep.vertices.len() as i64 - brep.edges.len() as i64 + brep.faces.len() as i64;
    assert_eq!(euler, shapes::euler(mesh), "{name}");
    let cells: u32 = brep.faces.iter().map(|f| f.spans[0] * f.spans[1]).sum();
    assert_eq!(cells as usize, mesh.quads.len(), "{name}");
    let listed: usize = brep.shells.iter().map(Vec::len).sum();
    assert_eq!(listed, brep.faces.len(), "{name}");
    let volume = face_volume(brep);
    assert!(
        (volume - brep.volume).abs() <= 1e-11 * brep.volume.abs(),
        "{name}: {volume} {}",
        brep.volume
    );
    assert_on_faces(name, mesh, brep);
}

#[test]
fn shapes_give_valid_faces() {
    for (name, mesh) in shapes::all() {
        let quads = brep(&mesh, FaceMode::Quads);
        assert_eq!(quads.faces.len(), mesh.quads.len());
        assert_valid(name, &mesh, &quads);
        let blocks = brep(&mesh, FaceMode::Exact);
        assert_valid(name, &mesh, &blocks);
        assert_eq!(blocks.volume, volume(&build(&mesh)));
        println!(
            "{name}: {} faces for {} quads",
            blocks.faces.len(),
            quads.faces.len()
        );
    }
}

#[test]
fn simple_shapes_have_known_numbers_of_faces() {
    let count = |mesh: &ControlMesh| brep(mesh, FaceMode::Exact).faces.len();
    assert_eq!(count(&shapes::block(1)), 6);
    assert_eq!(count(&shapes::block(4)), 6);
    assert_eq!(count(&shapes::torus(12, 8)), 4);
    assert_eq!(brep(&shapes::two_bodies(), FaceMode::Exact).shells.len(), 2);
}

#[test]
fn real_bodies_give_valid_faces() {
    for (name, mesh) in shapes::bodies() {
        let blocks = brep(&mesh, FaceMode::Exact);
        assert_valid(&name, &mesh, &blocks);
        println!(
            "{name}: {} quads, {} faces, {} edges, {} vertices",
            mesh.quads.len(),
            blocks.faces.len(),
            blocks.edges.len(),
            blocks.vertices.len()
        );
    }
}

#[test]
fn patches_of_another_mesh_are_refused() {
    let mesh = shapes::block(3);
    let build =
        |patches: &[_]| build_brep(&mesh, patches, &BrepOptions::default(), &Monitor::default());
    assert!(matches!(
        build(&[]),
        Err(SplineError::PatchCount {
            patches: 0,
            quads: 54
        })
    ));
    let mut wrong = crate::patches::build(&mesh);
    for patch in &mut wrong {
        patch.control[1][2].x += 0.1;
    }
    assert!(matches!(build(&wrong), Err(SplineError::NotSmooth { .. })));
}

#[test]
fn one_and_two_threads_give_the_same_faces() {
    let mut mesh = shapes::two_bodies();
    shapes::jitter(&mut mesh, 0.1, 3);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("threads");
        pool.install(|| brep(&mesh, FaceMode::Exact))
    };
    assert!(run(1) == run(2));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]
    #[test]
    fn any_manifold_set_of_cubes_gives_valid_faces(chosen in prop::collection::vec(any::<bool>(), 27)) {
        let cells: Vec<[i32; 3]> = (0..27).filter(|k| chosen[*k as usize]).map(|k| [k % 3, k / 3 % 3, k / 9]).collect();
        let mesh = shapes::voxels(&cells);
        if let Ok(patches) = grassfire::spline::patches(&mesh, &PatchOptions::default(), &Monitor::default()) {
            let brep = build_brep(&mesh, &patches, &BrepOptions::default(), &Monitor::default()).expect("a valid mesh");
            assert_valid("cubes", &mesh, &brep);
        }
    }
}
