//! Thickening: every generated skeleton gives a closed, oriented, manifold quad body with twice its
//! Euler number.

mod thicken_support;

use grassfire::Vec3;
use grassfire::monitor::Monitor;
use grassfire::skeleton::Skeleton;
use grassfire::spline::catmull_clark::QuadTopology;
use grassfire::thicken::{ThickenError, ThickenOptions, ThickenedBody, thicken};
use proptest::prelude::*;
use thicken_support::{Builder, chi, read_skeleton, stages, v, x, y, z};

fn body(skeleton: &Skeleton) -> ThickenedBody {
    let options = ThickenOptions {
        scale: 1.0,
        ..ThickenOptions::default()
    };
    let body = thicken(skeleton, &options, &Monitor::default()).expect("thickens");
    let topology = QuadTopology::new(body.mesh.points.len(), &body.mesh.quads)
        .expect("closed, manifold, oriented");
    assert_eq!(topology.euler(), 2 * chi(skeleton));
    assert!(topology.valence.iter().all(|&n| n >= 3));
    assert!(
        body.bodies
            .iter()
            .all(|b| b.volume > 0.0 && b.chi == 2 * b.skeleton_chi)
    );
    assert_eq!(body.source.len(), body.mesh.points.len());
    assert!(
        body.source
            .iter()
            .all(|&s| (s as usize) < skeleton.points.len())
    );
    body
}

fn plate() -> Builder {
    let mut b = Builder::new(1.0);
    b.sheet(Vec3::zeros(), [x(40.0), y(30.0)], [8, 6]);
    b
}

#[test]
fn a_plate_has_the_expected_offsets() {
    let skeleton = plate().skeleton;
    let body = body(&skeleton);
    assert_eq!(body.mesh.quads.len(), 2 * 48 + 2 * 28);
    assert_eq!((body.bodies.len(), body.bodies[0].shells), (1, 1));
    for (p, &s) in body.mesh.points.iter().zip(&body.source) {
        assert!(((p - skeleton.points[s as usize]).norm() - 1.0).abs() < 1e-9);
    }
    let volume = body.bodies[0].volume;
    assert!(
        volume > 40.0 * 30.0 * 2.0 * 0.95 && volume < 42.0 * 32.0 * 2.0,
        "{volume}"
    );
}

#[test]
fn seams_of_three_and_four_sheets() {
    for directions in [
        vec![0.0, 120.0, 240.0],
        vec![0.0, 90.0, 180.0],
        vec![0.0, 90.0, 180.0, 270.0],
        vec![10.0, 80.0, 200.0, 290.0, 340.0],
    ] {
        let mut b = Builder::new(1.0);
        for angle in directions {
            let (s, c) = f64::to_radians(angle).sin_cos();
            b.sheet(Vec3::zeros(), [z(30.0), 20.0 * v(c, s, 0.0)], [6, 4]);
        }
        assert_eq!(body(&b.skeleton).bodies[0].shells, 1);
    }
}

/// A straight seam of sheets; `angles[i]` are the directions of the sheets at height `i`, degrees.
fn twisted_seam(angles: &[Vec<f64>]) -> Skeleton {
    let mut b = Builder::new(1.0);
    for sheet in 0..angles[0].len() {
        let at = |i: usize, out: f64| {
            let (s, c) = angles[i][sheet].to_radians().sin_cos();
            10.0 * v(out * c, out * s, i as f64)
        };
        for i in 0..angles.len() - 1 {
            let corners = [at(i, 0.0), at(i, 1.0), at(i + 1, 1.0), at(i + 1, 0.0)];
            let quad = corners.map(|p| b.point(p));
            b.skeleton.quads.push(quad);
        }
    }
    b.skeleton
}

#[test]
fn close_sheets_that_change_places_along_a_seam() {
    let plain = vec![0.0, 120.0, 240.0];
    let near = vec![0.0, 160.0, 200.0];
    let swapped = vec![0.0, 220.0, 140.0];
    // The last edge sees the second and third sheet the other way round.
    body(&twisted_seam(&[
        plain.clone(),
        near.clone(),
        swapped.clone(),
    ]));
    // Two edges in the middle do: neither vertex can be mended without the other edge.
    let rows = [
        &plain, &near, &swapped, &swapped, &swapped, &near, &plain, &plain,
    ];
    body(&twisted_seam(&rows.map(Vec::clone)));
    let five = |a: f64, b: f64| vec![0.0, 80.0, a, b, 290.0];
    let rows = [
        five(150.0, 220.0),
        five(190.0, 210.0),
        five(230.0, 180.0),
        five(190.0, 210.0),
    ];
    body(&twisted_seam(&rows));
}

#[test]
fn seam_ends_inside_a_sheet() {
    let mut b = plate();
    b.sheet(v(10.0, 15.0, 0.0), [x(20.0), z(15.0)], [4, 3]);
    assert_eq!(body(&b.skeleton).rules.seam_ends, 2);
    let mut fin = plate();
    fin.sheet(v(15.0, 15.0, 0.0), [x(5.0), z(5.0)], [1, 1]);
    assert_eq!(body(&fin.skeleton).rules.strips, 1);
}

#[test]
fn folded_and_rolled_sheets() {
    let mut corner = Builder::new(1.0);
    corner.sheet(Vec3::zeros(), [x(20.0), y(30.0)], [4, 6]);
    corner.sheet(Vec3::zeros(), [z(20.0), y(30.0)], [4, 6]);
    body(&corner.skeleton);
    for closed in [false, true] {
        let mut tube = Builder::new(1.0);
        let ring = |i: usize, h: usize| {
            let (s, c) = (i as f64 * std::f64::consts::TAU / 12.0).sin_cos();
            v(15.0 * c, 15.0 * s, 5.0 * h as f64)
        };
        for i in 0..12 {
            for h in 0..5 {
                let quad = [
                    ring(i, h),
                    ring(i + 1, h),
                    ring(i + 1, h + 1),
                    ring(i, h + 1),
                ]
                .map(|p| tube.point(p));
                tube.skeleton.quads.push(quad);
            }
        }
        if closed {
            let axis = [z(0.0), z(25.0)];
            for (centre, h) in axis.into_iter().zip([0, 5]) {
                let centre = tube.point(centre);
                for i in (0..12).step_by(2) {
                    let [a, c, d] = [i, i + 1, i + 2].map(|i| tube.point(ring(i, h)));
                    tube.skeleton.quads.push([centre, a, c, d]);
                }
            }
        }
        let made = body(&tube.skeleton);
        assert_eq!(made.bodies[0].shells, 1 + u32::from(closed));
        assert_eq!(made.bodies[0].chi, if closed { 4 } else { 0 });
    }
}

#[test]
fn a_moebius_strip_gives_one_closed_orientable_shell() {
    let mut b = Builder::new(0.5);
    let at = |i: usize, j: usize| {
        let turn = i as f64 / 24.0 * std::f64::consts::TAU;
        let (s, c) = (turn / 2.0).sin_cos();
        let w = (j as f64 - 1.0) * 4.0;
        v(
            (30.0 + w * c) * turn.cos(),
            (30.0 + w * c) * turn.sin(),
            w * s,
        )
    };
    for i in 0..24 {
        for j in 0..2 {
            let quad = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)].map(|p| b.point(p));
            b.skeleton.quads.push(quad);
        }
    }
    let made = body(&b.skeleton);
    assert_eq!((made.bodies[0].shells, made.bodies[0].chi), (1, 0));
}

#[test]
fn beam_feet_on_rim_inside_and_on_a_seam() {
    let mut rim = plate();
    rim.beam(v(20.0, 0.0, 0.0), v(20.0, -30.0, 8.0), 5);
    assert_eq!(body(&rim.skeleton).rules.ring_feet, 1);
    let mut corner = plate();
    corner.beam(Vec3::zeros(), v(-20.0, -20.0, 0.0), 1);
    body(&corner.skeleton);
    let mut inside = plate();
    inside.beam(v(20.0, 15.0, 0.0), v(20.0, 15.0, 30.0), 5);
    assert_eq!(body(&inside.skeleton).rules.plug_feet, 1);
    let mut both = plate();
    both.beam(v(20.0, 15.0, 30.0), v(20.0, 15.0, -30.0), 6);
    assert_eq!(body(&both.skeleton).rules.plug_feet, 2);
    let mut seam = plate();
    seam.sheet(v(0.0, 15.0, 0.0), [x(40.0), z(15.0)], [8, 3]);
    seam.beam(v(20.0, 15.0, 0.0), v(20.0, 0.0, -20.0), 4);
    body(&seam.skeleton);
    let mut end = plate();
    end.sheet(v(10.0, 15.0, 0.0), [x(20.0), z(15.0)], [4, 3]);
    end.beam(v(10.0, 15.0, 0.0), v(-10.0, 15.0, 20.0), 4);
    body(&end.skeleton);
    let mut along_normal = plate();
    along_normal.beam(v(20.0, 0.0, 0.0), v(20.0, 0.0, 30.0), 4);
    assert_eq!(body(&along_normal.skeleton).rules.plug_feet, 1);
}

#[test]
fn a_beam_through_two_sheets_and_a_loop_back_to_one_vertex() {
    let mut b = plate();
    b.sheet(z(20.0), [x(40.0), y(30.0)], [8, 6]);
    b.beam(v(20.0, 15.0, -10.0), v(20.0, 15.0, 40.0), 5);
    assert_eq!(chi(&b.skeleton), 1);
    body(&b.skeleton);
    let mut loop_back = plate();
    let c = v(20.0, 15.0, 0.0);
    loop_back.beam(c, v(10.0, 15.0, 20.0), 2);
    loop_back.beam(v(10.0, 15.0, 20.0), v(30.0, 15.0, 20.0), 2);
    loop_back.beam(v(30.0, 15.0, 20.0), c, 2);
    assert_eq!(body(&loop_back.skeleton).bodies[0].chi, 0);
}

#[test]
fn many_beams_on_one_sheet_vertex() {
    let mut b = plate();
    for i in 0..14 {
        let (s, c) = (f64::from(i) * 0.9).sin_cos();
        b.beam(
            v(20.0, 15.0, 0.0),
            v(20.0 + 9.0 * c, 15.0 + 9.0 * s, 20.0 - f64::from(i)),
            2,
        );
    }
    assert_eq!(body(&b.skeleton).rules.plug_feet, 14);
}

#[test]
fn a_short_loop_whose_two_feet_share_an_edge() {
    let mut b = plate();
    b.beam(v(15.0, 15.0, 0.0), v(17.5, 15.0, 4.0), 1);
    b.beam(v(17.5, 15.0, 4.0), v(20.0, 15.0, 0.0), 1);
    assert_eq!(body(&b.skeleton).rules.plug_feet, 2);
}

#[test]
fn loops_tips_balls_and_one_edge_beams() {
    let mut torus = Builder::new(2.0);
    for i in 0..13 {
        let at = |i: usize| {
            let (s, c) = ((i % 13) as f64 * std::f64::consts::TAU / 13.0).sin_cos();
            v(20.0 * c, 20.0 * s, 6.0 * (2.0 * c).sin())
        };
        torus.beam(at(i), at(i + 1), 1);
    }
    let made = body(&torus.skeleton);
    assert_eq!((made.rules.loops, made.bodies[0].chi), (1, 0));
    let mut ball = Builder::new(2.0);
    ball.beam(Vec3::zeros(), x(1.0), 1);
    let made = body(&ball.skeleton);
    assert_eq!(
        (made.mesh.quads.len(), made.rules.tips, made.rules.middles),
        (10, 2, 1)
    );
    let mut triangle = Builder::new(1.0);
    let corners = [v(0.0, 0.0, 0.0), v(20.0, 0.0, 0.0), v(0.0, 20.0, 0.0)];
    for k in 0..3 {
        triangle.beam(corners[k], corners[(k + 1) % 3], 1);
        triangle.beam(corners[k], corners[k] + z(15.0), 1);
    }
    body(&triangle.skeleton);
}

#[test]
fn sheets_that_touch_in_a_point() {
    let mut bow_tie = Builder::new(1.0);
    bow_tie.sheet(Vec3::zeros(), [x(10.0), y(10.0)], [2, 2]);
    bow_tie.sheet(Vec3::zeros(), [x(-10.0), y(-10.0)], [2, 2]);
    assert_eq!(body(&bow_tie.skeleton).rules.ring_feet, 1);
    let mut cups = Builder::new(0.5);
    for sign in [1.0, -1.0] {
        let at = |i: usize, j: usize| {
            let (a, b) = (5.0 * (i as f64 - 2.0), 5.0 * (j as f64 - 2.0));
            v(a, b, sign * 0.02 * (a * a + b * b))
        };
        for i in 0..4 {
            for j in 0..4 {
                let quad =
                    [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)].map(|p| cups.point(p));
                cups.skeleton.quads.push(quad);
            }
        }
    }
    assert_eq!(body(&cups.skeleton).rules.ties, 1);
    let mut standing = plate();
    standing.sheet(
        v(20.0, 15.0, 0.0),
        [v(5.0, 0.0, 9.0), v(-5.0, 0.0, 9.0)],
        [2, 2],
    );
    assert_eq!(body(&standing.skeleton).rules.ties, 1);
}

#[test]
fn several_bodies_are_counted() {
    let mut b = plate();
    b.sheet(z(50.0), [x(10.0), y(10.0)], [2, 2]);
    b.beam(z(100.0), z(130.0), 3);
    assert_eq!(body(&b.skeleton).bodies.len(), 3);
}

#[test]
fn bad_skeletons_are_refused_by_name() {
    let run = |s: &Skeleton| thicken(s, &ThickenOptions::default(), &Monitor::default());
    assert!(matches!(
        run(&Skeleton::default()),
        Err(ThickenError::Empty)
    ));
    let mut zero = plate().skeleton;
    zero.radii[3] = 0.0;
    assert!(matches!(
        run(&zero),
        Err(ThickenError::BadPoint { point: 3, .. })
    ));
    let mut missing = plate().skeleton;
    missing.quads[5][2] = 9999;
    assert!(matches!(
        run(&missing),
        Err(ThickenError::BadQuad { quad: 5 })
    ));
    let mut short = plate().skeleton;
    short.radii.pop();
    assert!(matches!(run(&short), Err(ThickenError::BadCount { .. })));
    let doubled = {
        let mut b = plate();
        b.beam(v(0.0, 0.0, 0.0), v(5.0, 0.0, 0.0), 1);
        b.skeleton
    };
    let monitor = Monitor::default();
    assert!(thicken(&doubled, &ThickenOptions::default(), &monitor).is_ok());
    assert_eq!(monitor.warnings().len(), 1);
    let stopped = Monitor::default();
    stopped.cancel();
    assert!(matches!(
        thicken(&doubled, &ThickenOptions::default(), &stopped),
        Err(ThickenError::Cancelled(_))
    ));
}

#[test]
fn real_parts_give_the_quads_of_the_prototype() {
    let Some(folder) = stages() else { return };
    for (part, quads) in [
        ("simjeb_055", 880),
        ("simjeb_398", 750),
        ("simjeb_576", 752),
        ("simjeb_623", 580),
    ] {
        let skeleton = read_skeleton(&folder.join(part).join("skeleton.ply"));
        let made = body(&skeleton);
        println!("{part}: {:?} {:?}", made.bodies, made.rules);
        assert!(
            made.mesh.quads.len().abs_diff(quads) <= 16,
            "{part}: {}",
            made.mesh.quads.len()
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn nodes_of_any_beams(directions in prop::collection::vec((-1.0f64..1.0, -1.0f64..1.0, -1.0f64..1.0), 2..9), steps in 1usize..4) {
        let mut b = Builder::new(1.0);
        for (i, (x, y, z)) in directions.iter().enumerate() {
            let d = v(*x, *y, *z) + Vec3::repeat(1e-3);
            b.beam(Vec3::zeros(), d.normalize() * (10.0 + i as f64), steps);
        }
        body(&b.skeleton);
    }

    #[test]
    fn seams_of_any_twisted_sheets(rows in prop::collection::vec(prop::collection::vec(0.0f64..360.0, 4), 2..8)) {
        body(&twisted_seam(&rows));
    }

    #[test]
    fn plates_with_random_holes_beams_and_walls(
        holes in prop::collection::vec((0usize..8, 0usize..6), 0..20),
        walls in prop::collection::vec((0usize..3, 0usize..7, 1usize..5), 0..2),
        beams in prop::collection::vec((0usize..9, 0usize..7, -1.0f64..1.0, -1.0f64..1.0, -1.0f64..1.0), 0..8),
    ) {
        let mut b = Builder::new(0.8);
        b.sheet_with_holes(Vec3::zeros(), [x(40.0), y(30.0)], [8, 6], |i, j| holes.contains(&(i, j)));
        for (i, j, n) in walls {
            b.sheet(v(5.0 * i as f64, 5.0 * j as f64, 0.0), [x(5.0 * (n + 1) as f64), z(10.0)], [n + 1, 2]);
        }
        for (k, (i, j, dx, dy, dz)) in beams.into_iter().enumerate() {
            let foot = v(5.0 * i as f64, 5.0 * j as f64, 0.0);
            b.beam(foot, foot + 9.0 * v(dx, dy, dz) + z(0.01 + 1e-3 * k as f64), 2);
        }
        if !b.skeleton.quads.is_empty() || !b.skeleton.beams.is_empty() {
            body(&b.skeleton);
        }
    }
}
