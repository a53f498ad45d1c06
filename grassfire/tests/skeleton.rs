//! Quad skeletons of made-up medial meshes: the Betti numbers stay, everything is quads and beams.

use grassfire::Vec3;
use grassfire::medial::MedialMesh;
use grassfire::monitor::Monitor;
use grassfire::skeleton::{
    QuadSkeleton, SkeletonError, SkeletonOptions, check, quad_skeleton, topology,
};
use grassfire::topology::Betti;
use proptest::prelude::*;

fn build(medial: &MedialMesh) -> QuadSkeleton {
    let out = quad_skeleton(
        medial,
        1.0,
        &SkeletonOptions::default(),
        &Monitor::default(),
    )
    .expect("a skeleton");
    check(&out.skeleton).expect("a valid skeleton");
    assert_eq!(topology(&out.skeleton), out.topology);
    out
}

fn betti(b0: i64, b1: i64, b2: i64) -> Betti {
    Betti {
        b0,
        b1,
        b2,
        chi: b0 - b1 + b2,
    }
}

fn mesh(
    points: Vec<[f64; 3]>,
    radius: f64,
    edges: Vec<[u32; 2]>,
    triangles: Vec<[u32; 3]>,
) -> MedialMesh {
    MedialMesh {
        radii: vec![radius; points.len()],
        points: points
            .into_iter()
            .map(|p| Vec3::new(p[0], p[1], p[2]))
            .collect(),
        edges,
        triangles,
    }
}

/// Adds square cells over the parallelogram at `o` with the sides `u` and `v`; equal points are shared.
fn add_sheet(
    m: &mut MedialMesh,
    cells: u32,
    [o, u, v]: [Vec3; 3],
    radius: f64,
    keep: impl Fn(u32, u32) -> bool,
) {
    let mut id = |x: Vec3| match m.points.iter().position(|p| (p - x).norm() < 1e-9) {
        Some(i) => i as u32,
        None => {
            m.points.push(x);
            m.radii.push(radius);
            m.points.len() as u32 - 1
        }
    };
    let n = f64::from(cells);
    let at = |i: u32, j: u32| o + u * (f64::from(i) / n) + v * (f64::from(j) / n);
    let mut triangles = Vec::new();
    for i in 0..cells {
        for j in (0..cells).filter(|&j| keep(i, j)) {
            let corners = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            let [a, b, c, d] = corners.map(&mut id);
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    m.triangles.extend(triangles);
}

fn plate(size: f64, cells: u32, radius: f64, keep: impl Fn(u32, u32) -> bool) -> MedialMesh {
    let mut m = MedialMesh::default();
    add_sheet(
        &mut m,
        cells,
        [Vec3::zeros(), Vec3::x() * size, Vec3::y() * size],
        radius,
        keep,
    );
    m
}

#[test]
fn balls() {
    let point = [0.0; 3];
    for m in [
        mesh(vec![point], 5.0, vec![], vec![]),
        mesh(vec![point, [0.0, 0.0, 0.1]], 5.0, vec![[0, 1]], vec![]),
        mesh(vec![point, point], 5.0, vec![[0, 1]], vec![]),
        mesh(
            vec![point, [0.2, 0.0, 0.0], [0.0, 0.2, 0.0]],
            5.0,
            vec![],
            vec![[0, 1, 2]],
        ),
        mesh(
            vec![point, [9.0, 0.0, 0.0], [0.0, 9.0, 0.0]],
            2.0,
            vec![],
            vec![[0, 1, 2]],
        ),
    ] {
        let out = build(&m);
        assert_eq!(out.topology, betti(1, 0, 0));
        let s = &out.skeleton;
        for b in &s.beams {
            assert!((s.points[b[0] as usize] - s.points[b[1] as usize]).norm() > 0.1);
        }
    }
}

#[test]
fn torus_is_a_loop_of_beams() {
    let n = 200u32;
    let points = (0..n)
        .map(|i| {
            let a = std::f64::consts::TAU * f64::from(i) / f64::from(n);
            [30.0 * a.cos(), 30.0 * a.sin(), 0.0]
        })
        .collect();
    let out = build(&mesh(
        points,
        4.0,
        (0..n).map(|i| [i, (i + 1) % n]).collect(),
        vec![],
    ));
    assert_eq!(out.topology, betti(1, 1, 0));
    assert!(out.stats.beams >= 12 && out.stats.quads == 0);
    for p in &out.skeleton.points {
        assert!((p.norm() - 30.0).abs() < 0.6, "{p}");
    }
}

#[test]
fn hollow_box_keeps_its_cavity() {
    let mut m = MedialMesh::default();
    let [o, x, y, z] = [
        Vec3::zeros(),
        Vec3::x() * 30.0,
        Vec3::y() * 30.0,
        Vec3::z() * 30.0,
    ];
    for frame in [
        [o, x, y],
        [z, x, y],
        [o, y, z],
        [x, y, z],
        [o, z, x],
        [y, z, x],
    ] {
        add_sheet(&mut m, 20, frame, 2.0, |_, _| true);
    }
    let out = build(&m);
    assert_eq!(out.topology, betti(1, 0, 1));
    assert!(out.stats.quads > 50 && out.stats.rims == 0 && out.stats.beams == 0);
    // A wall inside makes two cavities and one closed seam.
    add_sheet(&mut m, 20, [x / 2.0, y, z], 2.0, |_, _| true);
    let out = build(&m);
    assert_eq!(out.topology, betti(1, 0, 2));
    assert_eq!((out.stats.sheets, out.stats.seams), (3, 1));
}

#[test]
fn plates_come_out_regular() {
    let out = build(&plate(60.0, 40, 2.0, |_, _| true));
    assert_eq!(out.topology, betti(1, 0, 0));
    assert!(
        out.stats.quads > 80 && out.stats.regular_fraction > 0.5,
        "{:?}",
        out.stats
    );
    let hole = |i, j| !(15..25).contains(&i) || !(15..25).contains(&j);
    let out = build(&plate(60.0, 40, 2.0, hole));
    assert_eq!(out.topology, betti(1, 1, 0));
    assert_eq!(out.stats.rims, 2);
}

#[test]
fn seam_of_three_plates_stays() {
    let mut m = plate(40.0, 30, 1.5, |_, _| true);
    let middle = Vec3::x() * 40.0 / 30.0 * 15.0;
    add_sheet(
        &mut m,
        30,
        [middle, Vec3::y() * 40.0, Vec3::z() * 40.0],
        1.5,
        |_, _| true,
    );
    let out = build(&m);
    assert_eq!(out.topology, betti(1, 0, 0));
    assert_eq!((out.stats.sheets, out.stats.seams), (3, 1));
}

#[test]
fn several_components_and_a_narrow_ring() {
    let ring = |i, j| !(2..38).contains(&i) || !(2..38).contains(&j);
    let mut m = plate(60.0, 40, 4.0, ring);
    let above = Vec3::z() * 50.0;
    add_sheet(
        &mut m,
        10,
        [above, Vec3::x() * 40.0, Vec3::y() * 40.0],
        2.0,
        |_, _| true,
    );
    m.points.push(Vec3::z() * 90.0);
    m.radii.push(3.0);
    let out = build(&m);
    assert_eq!(out.topology, betti(3, 1, 0));
    // The ring is a member: 3 mm wide at 8 mm thickness.
    assert!(
        out.stats.beams > 15 && out.stats.rims == 1,
        "{:?}",
        out.stats
    );
}

#[test]
fn quad_size_is_followed() {
    let m = plate(60.0, 60, 2.0, |_, _| true);
    let quads = |size| {
        let options = SkeletonOptions {
            quad_size: Some(size),
            ..SkeletonOptions::default()
        };
        let out = quad_skeleton(&m, 1.0, &options, &Monitor::default()).expect("a skeleton");
        out.stats.quads as f64
    };
    let (coarse, fine) = (quads(8.0), quads(4.0));
    assert!(
        fine > 2.5 * coarse && fine < 6.0 * coarse,
        "{coarse} {fine}"
    );
}

#[test]
fn broken_input_is_refused_by_index() {
    let monitor = Monitor::default();
    let options = SkeletonOptions::default();
    let run = |m: &MedialMesh, h: f64| quad_skeleton(m, h, &options, &monitor);
    let points = vec![[0.0; 3], [9.0, 0.0, 0.0], [0.0, 9.0, 0.0]];
    let good = mesh(points, 2.0, vec![], vec![[0, 1, 2]]);
    assert!(matches!(
        run(&MedialMesh::default(), 1.0),
        Err(SkeletonError::Empty(_))
    ));
    let nan = run(&good, f64::NAN);
    assert!(matches!(
        nan,
        Err(SkeletonError::Option {
            name: "spacing",
            ..
        })
    ));
    let mut bad = good.clone();
    bad.triangles.push([0, 1, 7]);
    assert!(matches!(
        run(&bad, 1.0),
        Err(SkeletonError::MissingPoint {
            what: "triangle",
            index: 1,
            point: 7,
            ..
        })
    ));
    let mut bad = good.clone();
    bad.edges.push([2, 2]);
    assert!(matches!(
        run(&bad, 1.0),
        Err(SkeletonError::Degenerate {
            what: "edge",
            index: 0,
            point: 2
        })
    ));
    let mut bad = good.clone();
    bad.radii[1] = 0.0;
    assert!(matches!(
        run(&bad, 1.0),
        Err(SkeletonError::BadRadius { point: 1, .. })
    ));
    let mut bad = good;
    bad.points[2].x = f64::INFINITY;
    assert!(matches!(
        run(&bad, 1.0),
        Err(SkeletonError::BadPoint { point: 2 })
    ));
    monitor.cancel();
    let cancelled = run(&plate(9.0, 9, 1.0, |_, _| true), 1.0);
    assert!(matches!(cancelled, Err(SkeletonError::Cancelled(_))));
}

#[test]
fn drawn_skeletons_are_checked() {
    let mut s = build(&plate(60.0, 20, 2.0, |_, _| true)).skeleton;
    s.radii[3] = f64::NAN;
    check(&s).expect("a missing radius is allowed");
    let mut twice = s.clone();
    let q = twice.quads[0];
    twice.quads.push([q[1], q[2], q[3], q[0]]);
    let found = check(&twice);
    assert!(matches!(
        found,
        Err(SkeletonError::Duplicate {
            what: "quad",
            other: 0,
            ..
        })
    ));
    let mut lying = s.clone();
    lying.beams.push([s.quads[0][1], s.quads[0][0]]);
    let found = check(&lying);
    assert!(
        matches!(found, Err(SkeletonError::Duplicate { what: "beam", .. })),
        "{found:?} {:?}",
        lying.beams
    );
    s.points.push(Vec3::zeros());
    s.radii.push(1.0);
    assert!(matches!(
        check(&s),
        Err(SkeletonError::Isolated { count: 1, .. })
    ));
}

/// A random 2-complex on a grid of 6 mm faces, each 4 x 4 cells, with a few chords as beams.
fn random_complex(seed: u64, radius: f64) -> MedialMesh {
    let mut state = seed.wrapping_mul(2).wrapping_add(1);
    let mut chance = move |p: f64| {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        ((state >> 33) as f64 / (1u64 << 31) as f64) < p
    };
    let mut m = MedialMesh::default();
    let axes = [Vec3::x() * 6.0, Vec3::y() * 6.0, Vec3::z() * 6.0];
    for cell in 0..48u32 {
        let [i, j, k] = [cell % 4, cell / 4 % 4, cell / 16].map(f64::from);
        let o = axes[0] * i + axes[1] * j + axes[2] * k;
        for d in 0..3 {
            if chance(0.3) {
                add_sheet(
                    &mut m,
                    4,
                    [o, axes[d], axes[(d + 1) % 3]],
                    radius,
                    |_, _| true,
                );
            }
        }
    }
    let n = m.points.len() as u32;
    for i in 0..n {
        if chance(0.01) && n > 1 {
            m.edges.push([i, (i + n / 2) % n]);
        }
    }
    m
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 10, ..ProptestConfig::default() })]
    #[test]
    fn any_complex_keeps_its_topology(seed in 0u64..1_000_000, radius in 0.3f64..4.0) {
        let m = random_complex(seed, radius);
        prop_assume!(!m.triangles.is_empty());
        let out = build(&m);
        let again = build(&m);
        prop_assert_eq!(out, again);
    }
}
