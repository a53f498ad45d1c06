//! The medial axis keeps the topology of the voxel solid, whatever the shape.

use grassfire::Vec3;
use grassfire::medial::{MedialAxis, MedialError, MedialOptions, PoleOptions, medial_axis, poles};
use grassfire::mesh::{Solid, TriMesh};
use grassfire::monitor::Monitor;
use grassfire::topology::Betti;
use grassfire::voxel::VoxelGrid;
use proptest::prelude::*;

/// A grid of `n` voxels of 0.5 mm with the solid where `f` (of the voxel indices) is positive.
fn grid(n: [usize; 3], f: impl Fn(Vec3) -> f64) -> VoxelGrid<f32> {
    let mut grid = VoxelGrid::filled(Vec3::new(-3.0, 10.0, 200.0), 0.5, n, 0.0f32);
    for index in 0..grid.values.len() {
        let at = grid.ijk(index);
        grid.values[index] = (0.5 * f(Vec3::from_fn(|k, _| at[k] as f64))) as f32;
    }
    grid
}

fn axis(field: &VoxelGrid<f32>) -> MedialAxis {
    let axis = medial_axis(field, &MedialOptions::default(), &Monitor::default())
        .expect("a solid has a medial axis");
    let mesh = &axis.mesh;
    assert_eq!(mesh.points.len(), mesh.radii.len());
    assert!(mesh.points.iter().all(|p| p.iter().all(|x| x.is_finite())));
    assert!(mesh.radii.iter().all(|r| r.is_finite() && *r > 0.0));
    let mut used = vec![false; mesh.points.len()];
    mesh.triangles
        .iter()
        .flatten()
        .chain(mesh.edges.iter().flatten())
        .for_each(|&v| used[v as usize] = true);
    assert!(used.iter().all(|u| *u), "a point belongs to nothing");
    axis
}

fn capsule(p: Vec3, a: [f64; 3], b: [f64; 3], r: f64) -> f64 {
    let (a, b) = (Vec3::from(a), Vec3::from(b));
    let t = ((p - a).dot(&(b - a)) / (b - a).norm_squared()).clamp(0.0, 1.0);
    r - (p - a - t * (b - a)).norm()
}

fn block(p: Vec3, centre: [f64; 3], half: [f64; 3]) -> f64 {
    let q = (p - Vec3::from(centre)).abs() - Vec3::from(half);
    -(q.sup(&Vec3::zeros()).norm() + q.max().min(0.0))
}

#[test]
fn ball_becomes_one_short_edge() {
    let result = axis(&grid([24; 3], |p| 9.0 - (p - Vec3::repeat(11.3)).norm()));
    assert_eq!(result.pruned, Betti::from_chi(1, 0, 1));
    assert_eq!(
        (result.mesh.triangles.len(), result.mesh.edges.len()),
        (0, 1)
    );
    let centre = Vec3::new(-3.0, 10.0, 200.0) + Vec3::repeat(0.5 * 11.3);
    for (p, r) in result.mesh.points.iter().zip(&result.mesh.radii) {
        assert!(
            (p - centre).norm() < 0.5 && (r - 4.5).abs() < 0.3,
            "{p} {r}"
        );
    }
    assert!((result.mesh.points[0] - result.mesh.points[1]).norm() > 0.2);
}

#[test]
fn rod_becomes_a_curve_of_its_length() {
    let result = axis(&grid([60, 16, 16], |p| {
        capsule(p, [8.0, 7.4, 7.7], [51.0, 7.9, 7.4], 4.4)
    }));
    assert_eq!(result.pruned, Betti::from_chi(1, 0, 1));
    assert!(result.mesh.triangles.is_empty());
    let x = |wanted: fn(f64, f64) -> f64| {
        result
            .mesh
            .points
            .iter()
            .map(|p| p.x)
            .reduce(wanted)
            .unwrap_or_default()
    };
    let length = x(f64::max) - x(f64::min);
    assert!((length - 21.5).abs() < 2.5, "length {length}");
}

#[test]
fn torus_becomes_a_loop() {
    let result = axis(&grid([44, 44, 16], |p| {
        let q = p - Vec3::new(21.6, 21.2, 7.4);
        4.2 - ((q.x.hypot(q.y) - 15.0).powi(2) + q.z * q.z).sqrt()
    }));
    assert_eq!(result.pruned, Betti::from_chi(1, 0, 0));
    assert!(result.mesh.triangles.is_empty());
}

#[test]
fn plate_keeps_its_extent_and_thickness() {
    let result = axis(&grid([50, 40, 14], |p| {
        block(p, [24.5, 19.5, 6.5], [20.0, 15.0, 3.0])
    }));
    assert_eq!(result.pruned, Betti::from_chi(1, 0, 1));
    assert!(result.mesh.edges.is_empty() && !result.mesh.triangles.is_empty());
    let mut radii = result.mesh.radii.clone();
    radii.sort_by(f64::total_cmp);
    assert!(
        (radii[radii.len() / 2] - 1.5).abs() < 0.15,
        "median radius {}",
        radii[radii.len() / 2]
    );
    let x = |wanted: fn(f64, f64) -> f64| {
        result
            .mesh
            .points
            .iter()
            .map(|p| p.x)
            .reduce(wanted)
            .unwrap_or_default()
    };
    assert!(
        x(f64::max) - x(f64::min) > 16.0,
        "the rims did not grow back"
    );
}

#[test]
fn a_short_thick_neck_between_plates_became_a_beam() {
    // The neck is 1.8 times as wide as it is thick; where it is long it is a member.
    let beams = |length: f64, neck_length: f64| {
        let plate = |p: Vec3, x: f64| block(p, [x, 19.5, 6.5], [12.0, 16.0, 3.0]);
        let neck = [0.5 * length + 2.0, 5.4, 3.0];
        let field = grid([54 + length as usize, 40, 14], |p| {
            plate(p, 14.5).max(plate(p, 38.5 + length)).max(block(
                p,
                [26.5 + 0.5 * length, 19.5, 6.5],
                neck,
            ))
        });
        let options = MedialOptions {
            sheet_ratio: 1.4,
            neck_length,
            ..MedialOptions::default()
        };
        let result = medial_axis(&field, &options, &Monitor::default()).expect("a medial axis");
        result.mesh.edges.len()
    };
    assert!(beams(10.0, 0.0) > 10);
    assert_eq!(beams(10.0, 5.0), 0);
    assert!(beams(40.0, 5.0) > 10);
}

#[test]
fn branches_and_seams() {
    let tee = |p: Vec3| {
        block(p, [24.5, 19.5, 6.5], [20.0, 15.0, 2.5]).max(block(
            p,
            [24.5, 19.5, 14.5],
            [20.0, 2.5, 9.0],
        ))
    };
    let result = axis(&grid([50, 40, 28], tee));
    assert_eq!(result.pruned, Betti::from_chi(1, 0, 1));
    assert!(result.mesh.edges.is_empty());
    let tips = [[8.0, 8.0, 9.0], [52.0, 10.0, 9.0], [30.0, 48.0, 9.0]];
    let wye = |p: Vec3| {
        tips.into_iter()
            .map(|tip| capsule(p, [30.0, 24.0, 9.0], tip, 4.3))
            .fold(f64::MIN, f64::max)
    };
    let result = axis(&grid([60, 56, 18], wye));
    assert_eq!(result.pruned, Betti::from_chi(1, 0, 1));
    let mut degree = vec![0; result.mesh.points.len()];
    result
        .mesh
        .edges
        .iter()
        .flatten()
        .for_each(|&v| degree[v as usize] += 1);
    assert_eq!(degree.iter().filter(|d| **d == 1).count(), 3);
}

#[test]
fn cavities_and_components() {
    let shell = |p: Vec3| 3.2 - ((p - Vec3::new(14.6, 14.2, 14.9)).norm() - 10.0).abs();
    assert_eq!(axis(&grid([30; 3], shell)).pruned, Betti::from_chi(1, 1, 2));
    // A shell, a shell in it, a ball in that, and a rod beside them.
    let nested = |p: Vec3| {
        let d = (p - Vec3::repeat(22.3)).norm();
        (2.5 - (d - 18.0).abs())
            .max(2.5 - (d - 10.0).abs())
            .max(4.0 - d)
            .max(capsule(p, [50.0, 8.0, 8.0], [50.0, 8.0, 34.0], 3.5))
    };
    assert_eq!(
        axis(&grid([56, 46, 46], nested)).pruned,
        Betti::from_chi(4, 2, 6)
    );
}

fn gyroid(p: Vec3) -> f64 {
    let q = 0.22 * p;
    2.2 - 4.0 * (q.x.sin() * q.y.cos() + q.y.sin() * q.z.cos() + q.z.sin() * q.x.cos()).abs()
}

#[test]
fn gyroid_keeps_many_handles() {
    let result = axis(&grid([48, 44, 40], gyroid));
    assert!(result.solid.b1 > 5, "{:?}", result.solid);
    assert_eq!(result.solid, result.pruned);
}

#[test]
fn topology_does_not_depend_on_pose() {
    // A plate with a round hole and a strut from one end to the other.
    let shape = |p: Vec3| {
        let hole = (p.x - 5.0).hypot(p.y) - 5.0;
        let plate = block(p, [0.0; 3], [16.0, 11.0, 3.0]).min(hole);
        plate
            .max(capsule(p, [-13.0, 0.0, 0.0], [-13.0, 0.0, 14.0], 3.4))
            .max(capsule(p, [13.0, 8.0, 0.0], [-13.0, 0.0, 13.0], 3.2))
    };
    for turn in 0..4 {
        let turns = f64::from(turn);
        let rotation = nalgebra::Rotation3::from_euler_angles(0.3 * turns, 0.7 * turns, 0.2);
        let shift = Vec3::new(26.0, 26.0, 26.0) + 0.37 * turns * Vec3::new(1.0, 0.5, 0.2);
        let result = axis(&grid([53; 3], |p| shape(rotation.inverse() * (p - shift))));
        assert_eq!(result.pruned, Betti::from_chi(1, 0, -1), "turn {turn}");
    }
}

#[test]
fn result_does_not_depend_on_threads() {
    let field = grid([40, 36, 32], gyroid);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("a small thread pool");
        pool.install(|| axis(&field).mesh)
    };
    assert!(run(1) == run(2));
}

#[test]
fn smallest_solids() {
    for n in [[1, 1, 1], [2, 1, 1], [5, 1, 1], [3, 3, 1], [1, 1, 40]] {
        assert_eq!(
            axis(&grid(n, |_| 1.0)).pruned,
            Betti::from_chi(1, 0, 1),
            "{n:?}"
        );
    }
}

#[test]
fn bad_input_is_named() {
    let run = |field: &VoxelGrid<f32>, options: &MedialOptions| {
        medial_axis(field, options, &Monitor::default()).map(|_| ())
    };
    let options = MedialOptions::default();
    assert_eq!(
        run(&grid([0, 4, 4], |_| 1.0), &options),
        Err(MedialError::Empty)
    );
    assert_eq!(
        run(&grid([4; 3], |_| -1.0), &options),
        Err(MedialError::Empty)
    );
    assert_eq!(
        run(&grid([4; 3], |_| f64::NAN), &options),
        Err(MedialError::Empty)
    );
    let mut short = grid([4; 3], |_| 1.0);
    short.values.pop();
    assert!(matches!(
        run(&short, &options),
        Err(MedialError::BadGrid { .. })
    ));
    let wrong = MedialOptions {
        sheet_ratio: f64::NAN,
        ..options
    };
    assert!(matches!(
        run(&grid([4; 3], |_| 1.0), &wrong),
        Err(MedialError::BadOption {
            name: "sheet_ratio",
            ..
        })
    ));
    let monitor = Monitor::default();
    monitor.cancel();
    let cancelled = medial_axis(&grid([4; 3], |_| 1.0), &MedialOptions::default(), &monitor);
    assert!(matches!(
        cancelled.map(|_| ()),
        Err(MedialError::Cancelled(_))
    ));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(192))]

    /// Any voxels at all: thin, touching along edges and corners, with pockets.
    #[test]
    fn any_voxels_keep_their_topology(n in prop::array::uniform3(1usize..8), share in 0.2..0.9f64, seed in any::<u64>()) {
        let mut state = seed | 1;
        let mut field = grid(n, |_| -1.0);
        for value in &mut field.values {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            *value = if ((state >> 33) as f64) < share * 2f64.powi(31) { 1.0 } else { -1.0 };
        }
        match medial_axis(&field, &MedialOptions::default(), &Monitor::default()) {
            Ok(result) => prop_assert_eq!(result.solid, result.pruned),
            Err(error) => prop_assert_eq!(error, MedialError::Empty),
        }
    }

}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    /// Any thresholds at all.
    #[test]
    fn any_options_keep_the_topology(o in prop::array::uniform8(0.0..4.0f64)) {
        let options = MedialOptions {
            sheet_noise: o[0],
            sheet_ratio: o[1],
            neck_length: 2.0 * o[6],
            neck_ratio: o[7],
            ribbon_ratio: o[2],
            regrow_sine: 0.3 * o[3],
            island_ratio: o[4],
            curve_noise: o[5],
            curve_ratio: o[6],
            tip_ratio: o[3],
            refit_rest: o[7],
            refit_move: o[0],
        };
        let field = grid([26, 24, 22], |p| gyroid(1.7 * p));
        let result = medial_axis(&field, &options, &Monitor::default());
        prop_assert!(result.is_ok(), "{:?}", result.err());
    }
}

/// The surface of a box of `n` cells of `h` mm, squares cut in two.
fn box_surface(n: [i32; 3], h: f64) -> TriMesh {
    let mut index = std::collections::BTreeMap::new();
    let mut mesh = TriMesh::default();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for (side, a, b) in [0, n[axis]]
            .into_iter()
            .flat_map(|s| (0..n[u]).flat_map(move |a| (0..n[v]).map(move |b| (s, a, b))))
        {
            let mut quad = [[a, b], [a + 1, b], [a + 1, b + 1], [a, b + 1]].map(|[a, b]| {
                let mut at = [0; 3];
                (at[axis], at[u], at[v]) = (side, a, b);
                *index.entry(at).or_insert_with(|| {
                    mesh.points.push(Vec3::from_fn(|k, _| h * f64::from(at[k])));
                    mesh.points.len() as u32 - 1
                })
            });
            if side == 0 {
                quad.reverse();
            }
            mesh.triangles
                .extend([[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]);
        }
    }
    mesh
}

#[test]
fn poles_measure_the_thickness_of_a_plate() {
    let solid = Solid::try_from(box_surface([40, 30, 6], 0.37)).expect("a closed box");
    let result =
        poles(&solid, &PoleOptions::default(), &Monitor::default()).expect("a box has poles");
    assert_eq!(result.points.len(), solid.points.len());
    assert_eq!(result.triangles, solid.triangles);
    let half = 0.37 * 3.0;
    assert!(
        result
            .thickness
            .iter()
            .all(|t| *t > 0.0 && *t < 1.02 * half * 3f64.sqrt())
    );
    for (p, (pole, t)) in solid
        .points
        .iter()
        .zip(result.points.iter().zip(&result.thickness))
    {
        let border = [p.x, p.y, 14.8 - p.x, 11.1 - p.y]
            .into_iter()
            .fold(f64::MAX, f64::min);
        if border > 2.0 * half {
            assert!((t - half).abs() < 0.03 * half, "{p}: {t}");
            assert!((pole.z - half).abs() < 0.03 * half);
        }
    }
}

#[test]
fn poles_of_a_tetrahedron_exist() {
    let mesh = TriMesh {
        points: vec![Vec3::zeros(), Vec3::x(), Vec3::y(), Vec3::z()],
        triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
        tags: Vec::new(),
    };
    let solid = Solid::try_from(mesh).expect("a tetrahedron is a solid");
    let result = poles(&solid, &PoleOptions::default(), &Monitor::default()).expect("poles");
    assert!(result.radii.iter().all(|r| r.is_finite()));
}
