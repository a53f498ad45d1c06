//! Repair on small meshes made here.

use proptest::prelude::*;

use super::*;
use crate::Vec3;

/// A box from `lower` to `upper`, outward.
fn block(lower: [f64; 3], upper: [f64; 3]) -> TriMesh {
    let pick = |i: usize| Vec3::from_fn(|a, _| if i >> a & 1 == 1 { upper[a] } else { lower[a] });
    let quads: [[u32; 4]; 6] = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [1, 3, 7, 5],
        [3, 2, 6, 7],
        [2, 0, 4, 6],
    ];
    let triangles = quads
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
        .collect();
    TriMesh {
        points: (0..8).map(pick).collect(),
        triangles,
        tags: Vec::new(),
    }
}

fn join(parts: &[TriMesh]) -> TriMesh {
    let mut out = TriMesh::default();
    for (tag, part) in parts.iter().enumerate() {
        out.append(part.points.iter().copied(), part.triangles.iter().copied());
        out.tags.resize(out.triangles.len(), tag as u32);
    }
    out
}

fn mended(mesh: TriMesh) -> Repaired {
    repair(mesh, &RepairOptions::default(), &Monitor::default()).expect("this can be repaired")
}

fn count(report: &RepairReport, kind: RepairKind) -> Option<usize> {
    report
        .repairs
        .iter()
        .find(|r| r.kind == kind)
        .map(|r| r.count)
}

#[test]
fn a_clean_box_stays_as_it_is() {
    let mesh = block([0.0; 3], [1.0, 2.0, 3.0]);
    let out = mended(mesh.clone());
    assert_eq!(out.mesh, mesh);
    assert_eq!(out.report.repairs, []);
    assert_eq!((out.report.triangles, out.report.components), (12, 1));
}

#[test]
fn nested_boxes_alternate_between_body_and_void() {
    let parts = [
        block([0.0; 3], [10.0; 3]),
        block([2.0; 3], [8.0; 3]),
        block([4.0; 3], [6.0; 3]),
    ];
    let out = mended(join(&parts));
    assert!((out.report.volume - (1000.0 - 216.0 + 8.0)).abs() < 1e-9);
    assert_eq!(count(&out.report, RepairKind::Cavity), Some(1));
    assert_eq!(count(&out.report, RepairKind::Bodies), Some(2));
    assert_eq!(out.mesh.tags.len(), 36);
}

#[test]
fn an_inner_wall_between_two_boxes_goes() {
    let out = mended(join(&[
        block([0.0; 3], [1.0; 3]),
        block([1.0, 0.0, 0.0], [2.0, 1.0, 1.0]),
    ]));
    assert_eq!(
        out.mesh.triangles.len() + count(&out.report, RepairKind::DuplicateFaces).unwrap_or(0),
        24
    );
    assert!((out.report.volume - 2.0).abs() < 1e-9);
    assert_eq!(count(&out.report, RepairKind::LeftOpen), None);
}

#[test]
fn a_missing_lid_is_filled_and_its_area_told() {
    let mut mesh = block([0.0; 3], [2.0, 3.0, 4.0]);
    mesh.triangles.drain(..2);
    let out = mended(mesh);
    assert!((out.report.volume - 24.0).abs() < 1e-9);
    let text = &out.report.repairs[0].text;
    assert!(
        text.contains("1 holes filled with 2 faces, 6.0000 mm2"),
        "{text}"
    );
    assert_eq!(out.report.open_edges, 4);
}

#[test]
fn a_long_round_hole_is_filled_flat() {
    // A cylinder without its lids: each has more edges than the exact method takes.
    let n = 300u32;
    let ring = |z: f64| {
        (0..n).map(move |i| {
            Vec3::new(
                (f64::from(i) * 0.021).cos(),
                (f64::from(i) * 0.021).sin(),
                z,
            )
        })
    };
    let points = ring(0.0).chain(ring(5.0)).collect();
    let side = |i: u32| {
        [
            [i, (i + 1) % n, (i + 1) % n + n],
            [i, (i + 1) % n + n, i + n],
        ]
    };
    let mesh = TriMesh {
        points,
        triangles: (0..n).flat_map(side).collect(),
        tags: Vec::new(),
    };
    let out = mended(mesh);
    assert_eq!(count(&out.report, RepairKind::HolesFilled), Some(2));
    assert!(
        (out.report.volume / (5.0 * std::f64::consts::PI) - 1.0).abs() < 0.01,
        "{}",
        out.report.volume
    );
}

#[test]
fn sheets_and_nonsense_are_refused() {
    let sheet = TriMesh {
        points: vec![
            Vec3::zeros(),
            Vec3::x(),
            Vec3::new(1.0, 1.0, 0.1),
            Vec3::y(),
        ],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        tags: Vec::new(),
    };
    let refused =
        |mesh| repair(mesh, &RepairOptions::default(), &Monitor::default()).expect_err("no solid");
    assert!(matches!(
        refused(sheet.clone()),
        RepairError::NotASolid { .. }
    ));
    // The same sheet with a back side.
    let mut double = sheet.clone();
    double.triangles.extend([[0, 2, 1], [0, 3, 2]]);
    assert!(matches!(refused(double), RepairError::Empty { .. }));
    assert!(matches!(
        refused(TriMesh::default()),
        RepairError::Empty { .. }
    ));
    let missing = TriMesh {
        triangles: vec![[0, 1, 9]],
        ..sheet
    };
    assert!(matches!(refused(missing), RepairError::Empty { .. }));
    let far = join(&[block([0.0; 3], [1e9; 3])]);
    assert!(matches!(refused(far), RepairError::TooLarge { .. }));
}

#[test]
fn crossing_faces_are_counted_and_touching_ones_are_not() {
    let apart = join(&[
        block([0.0; 3], [2.0; 3]),
        block([1.0, 0.5, 2.0], [3.0, 1.5, 3.0]),
    ]);
    assert_eq!(
        count(&mended(apart).report, RepairKind::SelfIntersection),
        None
    );
    let crossing = join(&[
        block([0.0; 3], [2.0; 3]),
        block([1.0, 0.5, 0.25], [3.0, 1.5, 1.25]),
    ]);
    let report = mended(crossing).report;
    // The side x = 2 of the first, in two triangles, is pierced by the eight that run along x of the second.
    assert_eq!(count(&report, RepairKind::SelfIntersection), Some(10));
    assert_eq!(count(&report, RepairKind::Overlap), Some(1));
}

#[test]
fn cancelling_stops_the_repair() {
    let monitor = Monitor::default();
    monitor.cancel();
    let out = repair(
        block([0.0; 3], [1.0; 3]),
        &RepairOptions::default(),
        &monitor,
    );
    assert!(matches!(out, Err(RepairError::Cancelled(_))));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]

    #[test]
    fn turned_faces_are_turned_back(flips in proptest::collection::vec(any::<bool>(), 12), scale in -7i32..5) {
        let size = 10f64.powi(scale);
        let mut mesh = block([0.0; 3], [size, 2.0 * size, 3.0 * size]);
        for (t, flip) in mesh.triangles.iter_mut().zip(flips) {
            if flip {
                t.swap(0, 1);
            }
        }
        let out = mended(mesh);
        prop_assert!((out.report.volume / (6.0 * size.powi(3)) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn soup_never_panics(
        points in proptest::collection::vec(proptest::array::uniform3(0i8..4), 3..12),
        triangles in proptest::collection::vec(proptest::array::uniform3(0u32..13), 1..40),
    ) {
        let points = points.iter().map(|p| Vec3::from(p.map(f64::from))).collect();
        let mesh = TriMesh { points, triangles, tags: Vec::new() };
        if let Ok(out) = repair(mesh, &RepairOptions::default(), &Monitor::default()) {
            prop_assert!(out.report.volume > 0.0);
            prop_assert!(out.mesh.triangles.iter().flatten().all(|&v| (v as usize) < out.mesh.points.len()));
        }
    }
}
