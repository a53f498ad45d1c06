//! The Delaunay triangulation against brute force.

use grassfire::Vec3;
use grassfire::medial::{Delaunay, MedialError, NONE, delaunay, delaunay_lattice};
use grassfire::monitor::Monitor;
use proptest::prelude::*;

fn coordinate(p: &Vec3) -> robust::Coord3D<f64> {
    robust::Coord3D {
        x: p.x,
        y: p.y,
        z: p.z,
    }
}

/// Every claim that makes a set of tetrahedra the Delaunay triangulation, in O(n m).
fn check(points: &[Vec3], triangulation: &Delaunay) {
    let mut used = vec![false; points.len()];
    for (t, tet) in triangulation.tets.iter().enumerate() {
        let corners = tet.vertices.map(|v| coordinate(&points[v as usize]));
        let [a, b, c, d] = corners;
        assert!(
            robust::orient3d(a, b, c, d) > 0.0,
            "tetrahedron {t} is flat or flipped"
        );
        for p in points {
            assert!(
                robust::insphere(a, b, c, d, coordinate(p)) <= 0.0,
                "{p} lies in the sphere of tetrahedron {t}"
            );
        }
        for k in 0..4 {
            used[tet.vertices[k] as usize] = true;
            let mate = tet.mates[k];
            if mate == NONE {
                let mut face = corners;
                for p in points {
                    face[k] = coordinate(p);
                    assert!(
                        robust::orient3d(face[0], face[1], face[2], face[3]) >= 0.0,
                        "{p} lies outside a hull facet"
                    );
                }
            } else {
                let (other, facet) = ((mate >> 2) as usize, (mate & 3) as usize);
                assert_eq!(
                    triangulation.tets[other].mates[facet],
                    4 * t as u32 + k as u32
                );
                assert_eq!(
                    facet_vertices(tet.vertices, k),
                    facet_vertices(triangulation.tets[other].vertices, facet)
                );
            }
        }
    }
    for (i, p) in points.iter().enumerate() {
        assert!(
            used[i] || points.iter().enumerate().any(|(j, q)| used[j] && p == q),
            "point {i} is missing"
        );
    }
}

fn facet_vertices(vertices: [u32; 4], opposite: usize) -> Vec<u32> {
    let mut v: Vec<u32> = (0..4)
        .filter(|&j| j != opposite)
        .map(|j| vertices[j])
        .collect();
    v.sort_unstable();
    v
}

/// Both routes: a valid triangulation or the right complaint.
fn check_lattice(points: &[[i32; 3]]) {
    let monitor = Monitor::default();
    let places: Vec<Vec3> = points
        .iter()
        .map(|p| Vec3::from_fn(|k, _| f64::from(p[k])))
        .collect();
    match (
        delaunay_lattice(points, &monitor),
        delaunay(&places, &monitor),
    ) {
        (Ok(integer), Ok(float)) => {
            check(&places, &integer);
            check(&places, &float);
        }
        (
            Err(MedialError::Flat { dimension: a, .. }),
            Err(MedialError::Flat { dimension: b, .. }),
        ) => assert_eq!(a, b),
        (a, b) => panic!("{:?} and {:?}", a.map(|_| ()), b.map(|_| ())),
    }
}

#[test]
fn degenerate_inputs_are_named() {
    let dimension = |points: &[[i32; 3]]| match delaunay_lattice(points, &Monitor::default()) {
        Err(MedialError::Flat { dimension, .. }) => dimension,
        other => panic!("{other:?}"),
    };
    assert_eq!(dimension(&[]), 0);
    assert_eq!(dimension(&[[1, 2, 3]]), 0);
    assert_eq!(dimension(&[[1, 2, 3]; 9]), 0);
    assert_eq!(
        dimension(&[[0, 0, 0], [1, 2, 3], [2, 4, 6], [-3, -6, -9], [1, 2, 3]]),
        1
    );
    assert_eq!(
        dimension(&[[0, 0, 5], [1, 0, 5], [0, 1, 5], [1, 1, 5], [7, 3, 5]]),
        2
    );
    let bad = |x: f64| {
        delaunay(
            &[Vec3::zeros(), Vec3::x(), Vec3::y(), Vec3::new(0.0, 0.0, x)],
            &Monitor::default(),
        )
    };
    assert_eq!(bad(f64::NAN), Err(MedialError::NotFinite { index: 3 }));
    assert!(matches!(
        bad(1e200),
        Err(MedialError::TooLarge { index: 3, .. })
    ));
    assert!(matches!(
        bad(1e-200),
        Err(MedialError::Flat { dimension: 2, .. })
    ));
    assert_eq!(bad(1e-30).map(|d| d.tets.len()), Ok(1));
}

#[test]
fn full_lattice() {
    let n = 6;
    let points: Vec<[i32; 3]> = (0..n * n * n)
        .map(|i| [i % n, i / n % n, i / (n * n)])
        .collect();
    check_lattice(&points);
    // Beyond the reach of plain f64: the same lattice stretched.
    check_lattice(
        &points
            .iter()
            .map(|p| p.map(|x| 7001 * x - 20_000))
            .collect::<Vec<_>>(),
    );
}

#[test]
fn cospherical_points() {
    let r = 15i32;
    let mut points = Vec::new();
    for (x, y) in (-r..=r).flat_map(|x| (-r..=r).map(move |y| (x, y))) {
        let rest = r * r - x * x - y * y;
        let z = f64::from(rest.max(0)).sqrt() as i32;
        if z * z == rest {
            points.extend([[x, y, z], [x, y, -z]]);
        }
    }
    check_lattice(&points);
}

#[test]
fn large_cavities() {
    // Points of a helix all see each other, so that points within it open cavities of hundreds of vertices.
    let mut points: Vec<Vec3> = (0..300)
        .map(|i| 0.04 * f64::from(i))
        .map(|t| Vec3::new(t.cos(), t.sin(), 0.1 * t))
        .collect();
    points.extend((0..60).map(|i| Vec3::new(0.001 * f64::from(i), 0.002, 0.02 * f64::from(i))));
    check(
        &points,
        &delaunay(&points, &Monitor::default()).expect("the points span space"),
    );
}

#[test]
fn cancelling_stops() {
    let monitor = Monitor::default();
    monitor.cancel();
    let points: Vec<[i32; 3]> = (0..27_000)
        .map(|i| [i % 30, i / 30 % 30, i / 900])
        .collect();
    assert!(matches!(
        delaunay_lattice(&points, &monitor),
        Err(MedialError::Cancelled(_))
    ));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn small_lattices(points in prop::collection::vec(prop::array::uniform3(0i32..5), 0..60)) {
        check_lattice(&points);
    }

    #[test]
    fn random_points(points in prop::collection::vec(prop::array::uniform3(-1.0..1.0f64), 4..80)) {
        let points: Vec<Vec3> = points.into_iter().map(Vec3::from).collect();
        check(&points, &delaunay(&points, &Monitor::default()).expect("random points span space"));
    }

    #[test]
    fn nearly_flat_points(points in prop::collection::vec((0i32..6, 0i32..6, -1.0..1.0f64), 5..50)) {
        let place = |&(x, y, z): &(i32, i32, f64)| Vec3::new(0.1 * f64::from(x), 0.3 * f64::from(y), 1e-13 * z);
        let points: Vec<Vec3> = points.iter().map(place).collect();
        match delaunay(&points, &Monitor::default()) {
            Ok(triangulation) => check(&points, &triangulation),
            Err(error) => {
                let flat = matches!(error, MedialError::Flat { .. });
                prop_assert!(flat);
            }
        }
    }
}
