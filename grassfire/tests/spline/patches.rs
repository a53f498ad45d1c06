//! Smoothness, shared boundaries, volume, determinism.

use grassfire::Vec3;
use grassfire::monitor::Monitor;
use grassfire::spline::{
    BrepOptions, ControlMesh, Patch, PatchOptions, TessellateOptions, area, build_brep,
    curvature_jump, evaluate, g1_max, jacobians, patches, tessellate, volume,
};
use proptest::prelude::*;

use crate::shapes;

pub fn build(mesh: &ControlMesh) -> Vec<Patch> {
    patches(mesh, &PatchOptions::default(), &Monitor::default()).expect("a valid mesh")
}

fn smallest_jacobian(patches: &[Patch]) -> f64 {
    jacobians(patches)
        .iter()
        .fold(f64::INFINITY, |least, j| least.min(j.value))
}

fn assert_smooth(name: &str, mesh: &ControlMesh, patches: &[Patch]) {
    let report = g1_max(mesh, patches).expect("a valid mesh");
    // The normal itself is only known to rounding over the sine between the derivatives.
    let smallest = smallest_jacobian(patches);
    let limit = if smallest > 1e-3 { 1e-6 } else { 1e-3 };
    assert!(
        report.max_angle_deg <= limit,
        "{name}: {report:?}, {smallest}"
    );
    assert!(
        report.max_gap <= 1e-12 * shapes::diagonal(mesh),
        "{name}: {report:?}"
    );
}

/// The control row of each side, from corner to corner.
fn row(patch: &Patch, side: usize) -> [Vec3; 6] {
    let c = &patch.control;
    std::array::from_fn(|k| [c[k][0], c[5][k], c[5 - k][5], c[0][5 - k]][side])
}

fn assert_shared_rows(name: &str, mesh: &ControlMesh, patches: &[Patch]) {
    let mut rows = std::collections::BTreeMap::new();
    for (quad, patch) in mesh.quads.iter().zip(patches) {
        for side in 0..4 {
            rows.insert([quad[side], quad[(side + 1) % 4]], row(patch, side));
        }
    }
    for ([a, b], row) in &rows {
        let mut other = rows[&[*b, *a]];
        other.reverse();
        assert!(
            *row == other,
            "{name}: edge {a} {b} differs by {:?}",
            row[2] - other[2]
        );
    }
}

#[test]
fn shapes_are_smooth_and_share_rows_exactly() {
    for (name, mesh) in shapes::all() {
        let patches = build(&mesh);
        assert_smooth(name, &mesh, &patches);
        assert_shared_rows(name, &mesh, &patches);
    }
}

#[test]
fn real_bodies_are_smooth_and_share_rows_exactly() {
    for (name, mesh) in shapes::bodies() {
        let patches = build(&mesh);
        assert_smooth(&name, &mesh, &patches);
        assert_shared_rows(&name, &mesh, &patches);
        let folds = jacobians(&patches)
            .iter()
            .filter(|j| j.value < 0.05)
            .count();
        println!(
            "{name}: {:?} folds {folds} smallest {} area {}",
            g1_max(&mesh, &patches),
            smallest_jacobian(&patches),
            area(&patches)
        );
    }
}

#[test]
fn curvature_jumps_only_around_extraordinary_points_and_like_one_over_the_size() {
    let mut torus = shapes::torus(10, 7);
    shapes::jitter(&mut torus, 0.2, 3);
    let none = curvature_jump(&torus, &build(&torus)).expect("a valid mesh");
    assert!(none.edges == 0 && none.max == 0.0 && none.relative == 0.0);
    for (name, mut mesh) in [("bracket", shapes::bracket()), ("plus", shapes::plus())] {
        shapes::jitter(&mut mesh, 0.05, 11);
        let small = curvature_jump(&mesh, &build(&mesh)).expect("a valid mesh");
        assert!(
            small.edges > 0 && small.max.is_finite(),
            "{name}: {small:?}"
        );
        assert!(small.rms <= small.max && small.p95 <= small.max);
        mesh.points.iter_mut().for_each(|p| *p *= 10.0);
        let large = curvature_jump(&mesh, &build(&mesh)).expect("a valid mesh");
        assert!((10.0 * large.max - small.max).abs() < 1e-6 * small.max);
        assert!((large.relative - small.relative).abs() < 1e-6);
        assert_eq!(large.edges, small.edges);
    }
}

#[test]
fn regular_nets_give_the_bicubic_spline() {
    // On a regular net the patch is the uniform bicubic B-spline: compare with its basis functions.
    let mut mesh = shapes::torus(10, 7);
    shapes::jitter(&mut mesh, 0.3, 5);
    let patches = build(&mesh);
    let basis = |t: f64| {
        let s = 1.0 - t;
        [
            s * s * s,
            3.0 * t.powi(3) - 6.0 * t * t + 4.0,
            3.0 * s.powi(3) - 6.0 * s * s + 4.0,
            t * t * t,
        ]
        .map(|x| x / 6.0)
    };
    for (i, j, u, v) in [
        (0, 0, 0.3, 0.8),
        (4, 6, 0.5, 0.5),
        (9, 3, 0.0, 0.9),
        (2, 2, 1.0, 1.0),
    ] {
        let mut expected = Vec3::zeros();
        for (a, x) in basis(u).into_iter().enumerate() {
            for (b, y) in basis(v).into_iter().enumerate() {
                let (row, column) = ((i + a + 9) % 10, (j + b + 6) % 7);
                expected += mesh.points[row * 7 + column] * (x * y);
            }
        }
        let found = evaluate(&patches[i * 7 + j], u, v).position;
        assert!((found - expected).norm() < 1e-13, "{found} {expected}");
    }
}

#[test]
fn derivatives_agree_with_differences() {
    let mut mesh = shapes::bracket();
    shapes::jitter(&mut mesh, 0.1, 1);
    let patch = &build(&mesh)[3];
    let (u, v, h) = (0.37, 0.81, 1e-5);
    let at = |u: f64, v: f64| evaluate(patch, u, v).position;
    let point = evaluate(patch, u, v);
    assert!(((at(u + h, v) - at(u - h, v)) / (2.0 * h) - point.du).norm() < 1e-8);
    assert!(((at(u, v + h) - at(u, v - h)) / (2.0 * h) - point.dv).norm() < 1e-8);
    assert!((point.normal.norm() - 1.0).abs() < 1e-14 && point.normal.dot(&point.du).abs() < 1e-14);
}

#[test]
fn volume_and_area_follow_motion_and_scale() {
    let mut mesh = shapes::bracket();
    shapes::jitter(&mut mesh, 0.1, 2);
    let before = (volume(&build(&mesh)), area(&build(&mesh)));
    let turn = nalgebra::Rotation3::from_euler_angles(0.4, 1.1, -0.3);
    mesh.points
        .iter_mut()
        .for_each(|p| *p = turn * *p * 2.0 + Vec3::new(50.0, -20.0, 7.0));
    let after = build(&mesh);
    assert!((volume(&after) / before.0 - 8.0).abs() < 1e-11);
    assert!((area(&after) / before.1 - 4.0).abs() < 1e-11);
    mesh.quads.iter_mut().for_each(|q| q.reverse());
    assert!((volume(&build(&mesh)) / before.0 + 8.0).abs() < 1e-11);
}

#[test]
fn folds_are_reported_with_their_place() {
    let mut mesh = shapes::block(3);
    let middle = (0..mesh.points.len())
        .find(|&k| mesh.points[k] == Vec3::new(1.0, 1.0, 3.0))
        .expect("a point on top");
    let monitor = Monitor::default();
    patches(&mesh, &PatchOptions::default(), &monitor).expect("a valid mesh");
    assert!(monitor.warnings().is_empty());
    mesh.points[middle] = Vec3::new(6.0, 6.0, 3.0);
    patches(&mesh, &PatchOptions::default(), &monitor).expect("a valid mesh");
    let warnings = monitor.warnings();
    assert!(
        warnings.len() == 1 && warnings[0].text.contains("worst: quad"),
        "{warnings:?}"
    );
}

#[test]
fn cancelled_work_stops() {
    let monitor = Monitor::default();
    monitor.cancel();
    assert!(patches(&shapes::block(1), &PatchOptions::default(), &monitor).is_err());
}

#[test]
fn one_and_two_threads_give_the_same_bits() {
    let mut mesh = shapes::frame();
    shapes::jitter(&mut mesh, 0.1, 9);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("threads");
        pool.install(|| {
            let patches = build(&mesh);
            let volume = volume(&patches);
            (patches, volume.to_bits())
        })
    };
    assert!(run(1) == run(2));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    #[test]
    fn any_manifold_set_of_cubes_is_smooth(chosen in prop::collection::vec(any::<bool>(), 27), seed: u64, size in 0.0..0.2) {
        let cells: Vec<[i32; 3]> = (0..27).filter(|k| chosen[*k as usize]).map(|k| [k % 3, k / 3 % 3, k / 9]).collect();
        let mut mesh = shapes::voxels(&cells);
        shapes::jitter(&mut mesh, size, seed);
        // Cubes that touch along an edge or in a point only are refused.
        if let Ok(patches) = patches(&mesh, &PatchOptions::default(), &Monitor::default()) {
            assert_smooth("cubes", &mesh, &patches);
            assert_shared_rows("cubes", &mesh, &patches);
            prop_assert!(volume(&patches) > 0.0);
        }
    }

    #[test]
    fn soups_are_refused_without_panic(quads in prop::collection::vec(prop::array::uniform4(0u32..9), 0..12)) {
        let points = (0..9).map(|k| Vec3::new(f64::from(k % 3), f64::from(k / 3), f64::from(k * k))).collect();
        let mesh = ControlMesh { points, quads };
        let result = patches(&mesh, &PatchOptions::default(), &Monitor::default());
        if let Err(error) = &result {
            prop_assert!(!error.to_string().is_empty() && error.hint().is_some());
        }
        let patches = result.unwrap_or_default();
        prop_assert_eq!(build_brep(&mesh, &patches, &BrepOptions::default(), &Monitor::default()).is_ok(), !patches.is_empty());
        prop_assert_eq!(tessellate(&mesh, &patches, &TessellateOptions::default()).is_ok(), !patches.is_empty());
    }
}
