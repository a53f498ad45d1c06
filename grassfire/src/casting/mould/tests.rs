use super::*;
use crate::mesh::shapes::{self, cuboid};

fn boxes(list: &[[f64; 6]]) -> TriMesh {
    let mut mesh = TriMesh::default();
    for [x0, y0, z0, x1, y1, z1] in list {
        let one = cuboid(Vec3::new(*x0, *y0, *z0), Vec3::new(*x1, *y1, *z1));
        mesh.append(one.points, one.triangles);
    }
    mesh
}

/// An I-beam along x: two flanges of 30 x 4 and a web of 4, 24 high inside: along z 13 x 24 x 60 mm3 hidden on each side.
fn beam() -> TriMesh {
    boxes(&[
        [0.0, -15.0, 0.0, 60.0, 15.0, 4.0],
        [0.0, -15.0, 28.0, 60.0, 15.0, 32.0],
        [0.0, -2.0, 0.0, 60.0, 2.0, 32.0],
    ])
}

fn look(mesh: &TriMesh, options: &MouldOptions) -> Mould {
    mould(mesh, options, &Monitor::default()).expect("a part")
}

fn along(draw: [f64; 3]) -> MouldOptions {
    MouldOptions {
        draw: Some(draw),
        wall_samples: 2000,
        ..MouldOptions::default()
    }
}

#[test]
fn undercuts_of_a_beam_are_known() {
    let mesh = beam();
    let found = look(&mesh, &along([0.0, 0.0, 1.0]));
    assert_eq!(found.undercuts.len(), 2);
    let exact = 2.0 * 13.0 * 24.0 * 60.0;
    let layer = 2.0 * 24.0 * 60.0 * found.direction.draw.norm() * 60.0 / 256.0;
    assert!(
        (found.undercut_volume - exact).abs() <= layer,
        "{}",
        found.undercut_volume
    );
    let place = found.undercuts[0].place;
    assert!((place.z - 16.0).abs() < 1e-6 && (place.y.abs() - 8.5).abs() < 0.2);
    // Along y the flanges are no hindrance.
    let found = look(&mesh, &along([0.0, 1.0, 0.0]));
    assert!(found.undercuts.is_empty() && found.undercut_volume < 1e-6);
    assert!(found.parting_flatness < 1e-9);
}

#[test]
fn the_best_direction_of_a_beam_is_across() {
    let tilt = nalgebra::Rotation3::from_euler_angles(0.3, -0.5, 0.8);
    let mut mesh = beam();
    for p in &mut mesh.points {
        *p = tilt * *p;
    }
    let options = MouldOptions {
        directions: 60,
        lines: 64,
        wall_samples: 200,
        ..MouldOptions::default()
    };
    let found = look(&mesh, &options);
    let across = tilt * Vec3::y();
    let angle = found.draw.dot(&across).abs().min(1.0).acos().to_degrees();
    assert!(angle < 1.0, "{angle:.2} degrees off");
    assert!(found.undercuts.is_empty());
}

/// On a strap the search stopped 55 degrees away from a direction with less undercut, whose low is a few degrees wide.
#[test]
fn no_direction_of_a_finer_spread_is_better_than_the_best() {
    use super::directions::{FINER, allowed, best_of, judge, spiral};
    // A block with deep slanted slots between its plates: each way out of one of them is narrow.
    let mut mesh = TriMesh::default();
    for k in 0..6 {
        let turn = nalgebra::Rotation3::from_euler_angles(0.35, 0.1 * f64::from(k), 0.7);
        let at = 7.0 * f64::from(k);
        let mut plate = boxes(&[[at, 0.0, 0.0, at + 4.0, 40.0, 60.0]]);
        plate.points.iter_mut().for_each(|p| *p = turn * *p);
        mesh.append(plate.points, plate.triangles);
    }
    let (lines, draft) = (16, 1.0);
    let found = best_direction(&mesh, 60, lines, draft, &Monitor::default()).expect("in time");
    let spread = spiral(1500);
    let seen = spread
        .iter()
        .map(|draw| judge(&mesh, draw, FINER * lines, draft));
    let mut seen: Vec<Direction> = seen.collect();
    seen.push(found);
    let equal = allowed(&seen, &mesh, FINER * lines);
    let best = best_of(&seen, equal, 1)[0];
    assert_eq!(best, found, "{best:?} is better than {found:?}");
}

#[test]
fn draft_of_a_wedge_is_known() {
    // A truncated pyramid with sides at 5 degrees.
    let d = 20.0 * 5.0_f64.to_radians().tan();
    let mut mesh = cuboid(Vec3::zeros(), Vec3::new(30.0, 30.0, 20.0));
    for p in &mut mesh.points {
        if p.z > 10.0 {
            p.x += if p.x > 15.0 { -d } else { d };
            p.y += if p.y > 15.0 { -d } else { d };
        }
    }
    let found = look(&mesh, &along([0.0, 0.0, 1.0]));
    assert!((found.min_draft - 5.0).abs() < 1e-9, "{}", found.min_draft);
    assert!(found.findings.iter().all(|f| f.rule != "min_draft"));
    let upright = cuboid(Vec3::zeros(), Vec3::new(30.0, 30.0, 20.0));
    let found = look(&upright, &along([0.0, 0.0, 1.0]));
    assert!(found.min_draft == 0.0);
    let finding = found
        .findings
        .iter()
        .find(|f| f.rule == "min_draft")
        .expect("a finding");
    assert!(finding.limit == 1.0 && !finding.source.is_empty());
}

#[test]
fn filling_leaves_one_interval_a_line_and_the_least_volume() {
    let mesh = beam();
    let options = MouldOptions {
        repair: Repair::Fill,
        // Upright walls of a voxel surface waver by a little: with draft they cannot hide anything.
        repair_draft: Some(1.0),
        cell: Some(1.0),
        ..along([0.0, 0.0, 1.0])
    };
    let found = look(&mesh, &options);
    let repaired = found.repaired.expect("asked for");
    assert!(
        repaired.multiple[0] > 500 && repaired.multiple[1] == 0,
        "{:?}",
        repaired.multiple
    );
    let whole = 60.0 * 30.0 * 32.0;
    assert!(
        (repaired.volume[1] / whole - 1.0).abs() < 0.05,
        "{}",
        repaired.volume[1]
    );
    let again = look(&repaired.mesh, &along([0.0, 0.0, 1.0]));
    assert!(
        again.undercut_volume < 1e-3 * whole,
        "{}",
        again.undercut_volume
    );
}

#[test]
fn gaps_too_narrow_for_sand_go_solid() {
    // Three plates, 3 and 8 mm apart, on voxels of 0.5 mm.
    let mesh = boxes(&[
        [0.0, 0.0, 0.0, 4.0, 40.0, 20.0],
        [7.0, 0.0, 0.0, 11.0, 40.0, 20.0],
        [19.0, 0.0, 0.0, 23.0, 40.0, 20.0],
    ]);
    let volume = |min_gap: f64| {
        let options = MouldOptions {
            min_gap,
            cell: Some(0.5),
            ..along([0.0, 0.0, 1.0])
        };
        let repaired = look(&mesh, &options).repaired.expect("asked for");
        repaired.volume[1] / repaired.volume[0]
    };
    let plates = |wide: f64| wide / 12.0;
    // A groove, a millimetre deep at most, is left along the rim of a closed gap.
    for (min_gap, wanted) in [(2.0, 12.0), (5.0, 15.0), (16.0, 23.0)] {
        let found = volume(min_gap);
        let off = found / plates(wanted) - 1.0;
        assert!(off.abs() < 0.05, "{min_gap}: {found:.3} times");
    }
}

#[test]
fn keeping_drops_the_lesser_flange_when_filling_is_dear() {
    // The lower flange is twice as thick as the upper one.
    let mesh = boxes(&[
        [0.0, -15.0, 0.0, 60.0, 15.0, 8.0],
        [0.0, -15.0, 28.0, 60.0, 15.0, 32.0],
        [0.0, -2.0, 0.0, 60.0, 2.0, 32.0],
    ]);
    let options = MouldOptions {
        repair: Repair::Keep,
        fill_cost: 1.0,
        cell: Some(1.0),
        ..along([0.0, 0.0, 1.0])
    };
    let repaired = look(&mesh, &options).repaired.expect("asked for");
    assert_eq!(repaired.multiple[1], 0);
    let wanted = 60.0 * (30.0 * 8.0 + 4.0 * 24.0);
    assert!(
        (repaired.volume[1] / wanted - 1.0).abs() < 0.06,
        "{}",
        repaired.volume[1]
    );
}

#[test]
fn walls_and_options_are_checked() {
    let plate = cuboid(Vec3::zeros(), Vec3::new(60.0, 40.0, 2.5));
    let found = look(&plate, &along([0.0, 0.0, 1.0]));
    assert!((found.min_wall.expect("walls") - 2.5).abs() < 1e-9);
    let finding = found
        .findings
        .iter()
        .find(|f| f.rule == "min_wall")
        .expect("a finding");
    assert_eq!(finding.limit, 6.0);
    let zero = mould(&plate, &along([0.0; 3]), &Monitor::default());
    assert!(matches!(zero, Err(MouldError::Option { name: "draw", .. })));
    let none = mould(
        &TriMesh::default(),
        &along([0.0, 0.0, 1.0]),
        &Monitor::default(),
    );
    assert!(matches!(none, Err(MouldError::Empty)));
}

#[test]
fn a_core_keeps_its_undercut_open() {
    let mesh = beam();
    let options = MouldOptions {
        repair: Repair::Fill,
        repair_draft: Some(1.0),
        cell: Some(1.0),
        cores: vec![[30.0, 8.0, 16.0]],
        ..along([0.0, 0.0, 1.0])
    };
    let repaired = look(&mesh, &options).repaired.expect("asked for");
    assert_eq!(repaired.multiple[1], 0);
    let wanted = 60.0 * (30.0 * 32.0 - 13.0 * 24.0);
    assert!(
        (repaired.volume[1] / wanted - 1.0).abs() < 0.05,
        "{}",
        repaired.volume[1]
    );
    let again = look(&repaired.mesh, &along([0.0, 0.0, 1.0]));
    let off = again.undercut_volume / (13.0 * 24.0 * 60.0) - 1.0;
    assert!(off.abs() < 0.1, "{off}");
    assert!(again.undercuts[0].place.y > 5.0);
    let nowhere = MouldOptions {
        cores: vec![[30.0, 80.0, 16.0]],
        ..options
    };
    let refused = mould(&mesh, &nowhere, &Monitor::default());
    assert!(
        matches!(refused, Err(MouldError::Place { list: "cores", distance }) if distance > 60.0)
    );
    // Once sections have grown the undercut of a core may be gone.
    let grown = RepairOptions {
        cores_may_close: true,
        ..nowhere.repair_options(15.0, 1.0)
    };
    let monitor = Monitor::default();
    let filled = repair(&mesh, &Vec3::z(), &grown, &monitor).expect("it is told");
    assert_eq!((filled.multiple[1], monitor.warnings().len()), (0, 1));
}

/// A box section along x, 60 mm long: 40 wide and 30 high outside, its upper flange 6 mm and all else 4 mm thick.
fn box_section() -> TriMesh {
    boxes(&[
        [0.0, -20.0, 0.0, 60.0, 20.0, 4.0],
        [0.0, -20.0, 24.0, 60.0, 20.0, 30.0],
        [0.0, -20.0, 0.0, 60.0, -16.0, 30.0],
        [0.0, 16.0, 0.0, 60.0, 20.0, 30.0],
    ])
}

#[test]
fn the_lesser_side_of_a_room_is_removed() {
    let mesh = box_section();
    let along_z = along([0.0, 0.0, 1.0]);
    let asked = along_z.repair_options(15.0, 1.0);
    let found = rooms(&mesh, &Vec3::z(), &asked, 50.0, &Monitor::default()).expect("a part");
    let [room] = &found[..] else {
        panic!("{found:?}");
    };
    let off = |value: f64, wanted: f64| (value / wanted - 1.0).abs();
    assert!(off(room.volume, 60.0 * 32.0 * 20.0) < 0.08, "{room:?}");
    // Voxels count whole: a layer more or less.
    let layer = 60.0 * 32.0;
    let thick = room.lesser / layer;
    assert!((thick - 4.0).abs() < 1.0, "{room:?}");
    assert!(
        (room.place - Vec3::new(30.0, 0.0, 14.0)).norm() < 1.5,
        "{room:?}"
    );
    let options = MouldOptions {
        repair: Repair::Fill,
        cell: Some(1.0),
        removals: vec![room.place.into()],
        ..along_z
    };
    let repaired = look(&mesh, &options).repaired.expect("asked for");
    assert_eq!(repaired.multiple[1], 0);
    // A channel is left: the thicker flange and the webs, with a degree of draft inside (20 mm high) and outside (twice 15 mm).
    // Draft that grew from what the removal had emptied filled half of the room.
    let draft = 1.0_f64.to_radians().tan() * (20.0 * 20.0 + 2.0 * 15.0 * 15.0);
    let wanted = 60.0 * (40.0 * 6.0 + 2.0 * 4.0 * 24.0 + draft);
    assert!(off(repaired.volume[1], wanted) < 0.08, "{repaired:?}");
    let nowhere = MouldOptions {
        removals: vec![[30.0, 80.0, 16.0]],
        ..options
    };
    let refused = mould(&mesh, &nowhere, &Monitor::default());
    assert!(matches!(
        refused,
        Err(MouldError::Place {
            list: "removals",
            ..
        })
    ));
}

/// The free length of a bore ends in the air beside its lug. As material there it made a room above a base plate, which was filled.
#[test]
fn a_bore_is_a_core_only_where_it_is_undercut() {
    let mesh = boxes(&[
        [0.0, 0.0, 0.0, 60.0, 30.0, 4.0],
        [0.0, 0.0, 0.0, 20.0, 30.0, 12.0],
        [0.0, 0.0, 22.0, 20.0, 30.0, 30.0],
        [0.0, 0.0, 0.0, 20.0, 10.0, 30.0],
        [0.0, 20.0, 0.0, 20.0, 30.0, 30.0],
    ]);
    let mut asked = along([0.0, 0.0, 1.0]).repair_options(15.0, 1.0);
    asked.kind = Repair::Fill;
    asked.bores = vec![crate::remesh::Capsule {
        a: Vec3::new(-20.0, 15.0, 17.0),
        b: Vec3::new(60.0, 15.0, 17.0),
        radius: 8.0,
    }];
    let monitor = Monitor::default();
    let found = rooms(&mesh, &Vec3::z(), &asked, 10.0, &monitor).expect("a part");
    assert_eq!(found, []);
    let repaired = repair(&mesh, &Vec3::z(), &asked, &monitor).expect("a part");
    let [before, after] = repaired.volume;
    // The room would have had a fifth of the volume.
    assert!((after / before - 1.0).abs() < 0.05, "{before} {after}");
}

/// Walls of 8 mm along z, 120 mm long, 70 mm from one end to the other, as a raster of rows from the lowest y on.
fn meeting(rows: &[&str]) -> TriMesh {
    let borders = [-35.0, -4.0, 4.0, 35.0];
    shapes::walls(&borders, &borders, rows, 120.0)
}

fn sheet(mesh: &TriMesh) -> Mould {
    let options = MouldOptions {
        wall_samples: 20_000,
        lines: 64,
        ..along([0.0, 0.0, 1.0])
    };
    look(mesh, &options)
}

#[test]
fn balls_in_junctions_of_equal_walls_are_known() {
    // The circle that touches one flat side and two corners; four corners; two outer sides and the inner corner.
    let l = 2.0 / (1.0 + 1.0 / 2.0_f64.sqrt());
    for (rows, kind, exact) in [
        (["...", "###", ".#."], JunctionKind::T, 1.25),
        ([".#.", "###", ".#."], JunctionKind::X, 2.0_f64.sqrt()),
        (["...", ".##", ".#."], JunctionKind::L, l),
    ] {
        let found = sheet(&meeting(&rows)).junctions;
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!(found[0].kind, kind);
        assert!((found[0].wall - 8.0).abs() < 0.08, "{found:?}");
        assert!((found[0].ratio / exact - 1.0).abs() < 0.005, "{found:?}");
        assert!(found[0].place.xy().norm() < 2.0);
    }
    // A wall alone has none.
    assert!(sheet(&meeting(&["...", "###", "..."])).junctions.is_empty());
}

#[test]
fn sharp_inner_edges_are_found_and_fillets_measured() {
    let rule = |found: &Mould, name: &str| {
        let named = found.findings.iter().filter(|f| f.rule == name);
        named.cloned().collect::<Vec<_>>()
    };
    let sharp = sheet(&meeting(&["...", "###", ".#."]));
    let fillets = rule(&sharp, "fillet");
    assert!(!fillets.is_empty() && sharp.inner_edges.short > 0.02);
    for finding in &fillets {
        assert!(finding.value < 0.05, "{finding:?}");
        assert!((finding.limit - 0.2 * 16.0).abs() < 0.05, "{finding:?}");
        let from_edge =
            finding.place - Vec3::new(4.0_f64.copysign(finding.place.x), 4.0, finding.place.z);
        assert!(from_edge.norm() < 0.1, "{finding:?}");
    }
    // A quarter of a hollow cylinder between the two walls: 5 mm are more than 3.2, 2 mm are less.
    for (radius, broken) in [(5.0, false), (2.0, true)] {
        let found = rule(&sheet(&filleted(radius)), "fillet");
        assert_eq!(!found.is_empty(), broken, "{found:?}");
        for finding in found {
            assert!((finding.value / radius - 1.0).abs() < 0.15, "{finding:?}");
        }
    }
}

/// Two walls of 8 mm at right angles with a fillet of facets of 15 degrees, no ends, in the inner edge at (4, 4).
fn filleted(radius: f64) -> TriMesh {
    let mut outline = vec![
        [35.0, 4.0],
        [35.0, -4.0],
        [-4.0, -4.0],
        [-4.0, 35.0],
        [4.0, 35.0],
    ];
    let arc = (0..=6).map(|k| {
        let angle = (180.0 + 15.0 * f64::from(k)).to_radians();
        [
            4.0 + radius + radius * angle.cos(),
            4.0 + radius + radius * angle.sin(),
        ]
    });
    outline.extend(arc);
    let at = |k: usize, z: f64| {
        let [x, y] = outline[k % outline.len()];
        Vec3::new(x, y, z)
    };
    let count = outline.len() as u32;
    let side = |k: u32| {
        let (a, b) = (2 * k, 2 * ((k + 1) % count));
        [[b, a, a + 1], [b, a + 1, b + 1]]
    };
    TriMesh {
        points: (0..outline.len())
            .flat_map(|k| [at(k, 0.0), at(k, 120.0)])
            .collect(),
        triangles: (0..count).flat_map(side).collect(),
        tags: Vec::new(),
    }
}

#[test]
fn steps_of_walls_and_narrow_holes_are_found() {
    let step = shapes::walls(&[0.0, 40.0, 80.0], &[0.0, 5.0, 10.0], &["##", "#."], 60.0);
    let found = sheet(&step);
    assert!(found.transition > 0.5, "{}", found.transition);
    assert!(found.findings.iter().any(|f| f.rule == "transition"));
    let even = shapes::walls(&[0.0, 80.0], &[0.0, 5.0], &["#"], 60.0);
    assert!(sheet(&even).transition < 1e-6);
    let (xs, ys) = ([0.0, 30.0, 34.0, 64.0], [0.0, 30.0, 34.0, 64.0]);
    let hole = sheet(&shapes::walls(&xs, &ys, &["###", "#.#", "###"], 10.0));
    let gaps: Vec<_> = hole
        .findings
        .iter()
        .filter(|f| f.rule == "min_hole")
        .collect();
    assert!(!gaps.is_empty());
    assert!(
        gaps.iter()
            .all(|f| (f.value - 4.0).abs() < 1e-6 && f.limit == 5.0)
    );
}
