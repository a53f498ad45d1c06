//! Fit: the limit surface follows a known field; real parts meet the goals of the design.

mod thicken_support;

use grassfire::Vec3;
use grassfire::fit::{FitError, FitOptions, Fitted, fit};
use grassfire::monitor::Monitor;
use grassfire::skeleton::Skeleton;
use grassfire::spline::catmull_clark::limit_mesh;
use grassfire::thicken::{ThickenOptions, ThickenedBody, thicken};
use grassfire::voxel::VoxelGrid;
use thicken_support::{Builder, read_field, read_skeleton, stages, v, x, y};

fn field(lo: Vec3, dims: [usize; 3], f: impl Fn(&Vec3) -> f64) -> VoxelGrid<f32> {
    let mut grid = VoxelGrid::filled(lo, 1.0, dims, 0.0);
    for i in 0..grid.values.len() {
        let [a, b, c] = grid.ijk(i);
        grid.values[i] = f(&grid.centre(a, b, c)) as f32;
    }
    grid
}

fn body(skeleton: &Skeleton) -> ThickenedBody {
    thicken(skeleton, &ThickenOptions::default(), &Monitor::default()).expect("thickens")
}

fn fitted(skeleton: &Skeleton, field: &VoxelGrid<f32>) -> Fitted {
    fit(
        &body(skeleton),
        skeleton,
        field,
        &FitOptions::default(),
        &Monitor::default(),
    )
    .expect("fits")
}

fn plate() -> (Skeleton, VoxelGrid<f32>) {
    let mut b = Builder::new(3.0);
    b.sheet(Vec3::zeros(), [x(40.0), y(30.0)], [8, 6]);
    let rounded = |p: &Vec3| 3.0 - (p - v(p.x.clamp(0.0, 40.0), p.y.clamp(0.0, 30.0), 0.0)).norm();
    (
        b.skeleton,
        field(v(-6.0, -6.0, -6.0), [53, 43, 13], rounded),
    )
}

#[test]
fn a_plate_with_round_rims() {
    let (skeleton, field) = plate();
    let fitted = fitted(&skeleton, &field);
    assert!(
        fitted.body_to_iso.rms < 0.15 && fitted.iso_to_body.rms < 0.15,
        "{fitted:?}"
    );
    assert!((fitted.volume / fitted.iso_volume - 1.0).abs() < 0.01);
    assert!(fitted.self_intersections.is_empty());
    // The volume is that of the surface which the mesh describes.
    let (triangles, owner) = limit_mesh(&fitted.mesh, 4).expect("limit");
    assert!((triangles.volume() / fitted.volume - 1.0).abs() < 2e-3);
    assert_eq!(owner.len(), fitted.mesh.quads.len() * 512);
}

#[test]
fn a_torus_of_beams() {
    let mut b = Builder::new(4.0);
    let at = |i: usize| {
        let (s, c) = ((i % 12) as f64 * std::f64::consts::TAU / 12.0).sin_cos();
        v(20.0 * c, 20.0 * s, 0.0)
    };
    (0..12).for_each(|i| b.beam(at(i), at(i + 1), 1));
    let torus = |p: &Vec3| 4.0 - ((p.x.hypot(p.y) - 20.0).powi(2) + p.z * p.z).sqrt();
    let fitted = fitted(
        &b.skeleton,
        &field(v(-28.0, -28.0, -7.0), [57, 57, 15], torus),
    );
    let exact = 2.0 * std::f64::consts::PI.powi(2) * 20.0 * 16.0;
    assert!(
        (fitted.volume / exact - 1.0).abs() < 0.01,
        "{} {exact}",
        fitted.volume
    );
    assert!((fitted.iso_volume / exact - 1.0).abs() < 0.01);
    assert!(fitted.body_to_iso.max < 0.3 && fitted.self_intersections.is_empty());
}

/// A plate with a wave that its few quads cannot follow.
fn wavy_plate() -> (Skeleton, VoxelGrid<f32>) {
    let mut b = Builder::new(3.0);
    b.sheet(Vec3::zeros(), [x(40.0), y(30.0)], [4, 3]);
    let wave = |p: &Vec3| {
        let at = v(p.x.clamp(0.0, 40.0), p.y.clamp(0.0, 30.0), 0.0);
        3.0 - (p - at - v(0.0, 0.0, 1.5 * (at.x * 0.45).sin())).norm()
    };
    (b.skeleton, field(v(-6.0, -6.0, -7.0), [53, 43, 15], wave))
}

fn extraordinary(fitted: &Fitted) -> usize {
    let mut valence = vec![0; fitted.mesh.points.len()];
    let corners = fitted.mesh.quads.iter().flatten();
    corners.for_each(|&p| valence[p as usize] += 1);
    valence.iter().filter(|n| **n != 4).count()
}

#[test]
fn a_mesh_too_coarse_is_refined_without_extraordinary_points() {
    let (skeleton, field) = wavy_plate();
    let body = body(&skeleton);
    let run = |refinements: u32| {
        let options = FitOptions {
            refinements,
            ..FitOptions::default()
        };
        fit(&body, &skeleton, &field, &options, &Monitor::default()).expect("fits")
    };
    let (coarse, fine) = (run(0), run(3));
    assert_eq!(coarse.body, body);
    assert!(
        fine.body_to_iso.rms < 0.5 * coarse.body_to_iso.rms,
        "{fine:?}"
    );
    assert_eq!(extraordinary(&fine), extraordinary(&coarse));
    let quads = [&coarse, &fine].map(|f| f.mesh.quads.len());
    assert!(quads[1] > quads[0] && quads[1] <= 3 * quads[0]);
    assert!(fine.self_intersections.is_empty() && fine.folds.is_empty());
    // Edits of radii still find the skeleton point of every control point.
    assert_eq!(fine.body.mesh.quads, fine.mesh.quads);
    let same = [fine.body.source.len(), fine.body.foot.len()];
    assert_eq!(same, [fine.mesh.points.len(); 2]);
    assert!(fine.body.foot.iter().all(|p| p.z.abs() < 1e-9));
}

#[test]
fn a_sound_body_has_the_volume_of_the_proposal() {
    let (skeleton, field) = plate();
    let fitted = fitted(&skeleton, &field);
    assert!(
        (fitted.volume / fitted.iso_volume - 1.0).abs() < 1e-3,
        "{fitted:?}"
    );
}

#[test]
fn a_tangle_that_no_fit_can_cure_is_reported() {
    // Two beams that pass through each other, against a field that has both.
    let mut b = Builder::new(3.0);
    b.beam(v(-20.0, 0.0, 0.2), v(20.0, 0.0, 0.2), 5);
    b.beam(v(0.0, -20.0, -0.2), v(0.0, 20.0, -0.2), 5);
    let cross = |p: &Vec3| {
        let along_x = (p - v(p.x.clamp(-20.0, 20.0), 0.0, 0.0)).norm();
        let along_y = (p - v(0.0, p.y.clamp(-20.0, 20.0), 0.0)).norm();
        3.0 - along_x.min(along_y)
    };
    let field = field(v(-26.0, -26.0, -6.0), [53, 53, 13], cross);
    let monitor = Monitor::default();
    let fitted = fit(
        &body(&b.skeleton),
        &b.skeleton,
        &field,
        &FitOptions::default(),
        &monitor,
    )
    .expect("fits");
    assert!(!fitted.self_intersections.is_empty());
    let troubles = fitted.self_intersections.len() + fitted.folds.len();
    assert_eq!(monitor.warnings().len(), troubles);
    assert!(fitted.self_intersections[0].place.norm() < 12.0);
}

#[test]
fn one_and_two_threads_give_the_same_bits() {
    let (skeleton, field) = plate();
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("threads");
        pool.install(|| fitted(&skeleton, &field))
    };
    assert_eq!(run(1), run(2));
}

#[test]
fn bad_input_is_refused() {
    let (skeleton, field) = plate();
    let body = body(&skeleton);
    let monitor = Monitor::default();
    let run =
        |b: &ThickenedBody, f: &VoxelGrid<f32>, o: &FitOptions| fit(b, &skeleton, f, o, &monitor);
    let empty = VoxelGrid::filled(Vec3::zeros(), 1.0, [4, 4, 4], -1.0);
    assert!(matches!(
        run(&body, &empty, &FitOptions::default()),
        Err(FitError::BadField { .. })
    ));
    let mut torn = body.clone();
    torn.mesh.quads.pop();
    assert!(matches!(
        run(&torn, &field, &FitOptions::default()),
        Err(FitError::BadBody(_))
    ));
    let mut far = body.clone();
    far.source[2] = 9999;
    assert!(matches!(
        run(&far, &field, &FitOptions::default()),
        Err(FitError::BadPoint { point: 2, .. })
    ));
    let stiff = FitOptions {
        fairness: f64::NAN,
        ..FitOptions::default()
    };
    assert!(matches!(
        run(&body, &field, &stiff),
        Err(FitError::BadOption {
            name: "fairness",
            ..
        })
    ));
    monitor.cancel();
    assert!(matches!(
        run(&body, &field, &FitOptions::default()),
        Err(FitError::Cancelled(_))
    ));
}

fn meets_the_goals(part: &str) {
    let Some(folder) = stages() else { return };
    let skeleton = read_skeleton(&folder.join(part).join("skeleton.ply"));
    let field = read_field(&folder.join(part));
    let fitted = fitted(&skeleton, &field);
    assert!(
        fitted.self_intersections.is_empty(),
        "{part}: {:?}",
        fitted.self_intersections
    );
    for d in [fitted.body_to_iso, fitted.iso_to_body] {
        let [rms, p95, max] = [d.rms, d.p95, d.max].map(|x| x / field.spacing);
        assert!(
            rms <= 0.25 && p95 <= 0.5 && max <= 2.5,
            "{part}: {rms} {p95} {max}"
        );
    }
    assert!(
        (fitted.volume / fitted.iso_volume - 1.0).abs() < 0.01,
        "{part}"
    );
}

#[test]
fn simjeb_055_meets_the_goals() {
    meets_the_goals("simjeb_055");
}

#[test]
fn simjeb_398_meets_the_goals() {
    meets_the_goals("simjeb_398");
}

#[test]
fn simjeb_576_meets_the_goals() {
    meets_the_goals("simjeb_576");
}

#[test]
fn simjeb_623_meets_the_goals() {
    meets_the_goals("simjeb_623");
}
