//! The remesh of small made-up parts.

use super::*;
use crate::mesh::shapes::cuboid;

/// A cube about the origin.
pub(super) fn cube(side: f64) -> TriMesh {
    let half = Vec3::repeat(side / 2.0);
    cuboid(-half, half)
}

fn remesh_at(mesh: &TriMesh, voxel: f64) -> Result<Remeshed, RemeshError> {
    remesh(
        mesh,
        &RemeshOptions {
            voxel: Some(voxel),
            ..RemeshOptions::default()
        },
        &Monitor::default(),
    )
}

#[test]
fn a_cube_keeps_volume_and_place() {
    let out = remesh_at(&cube(10.0), 0.37).expect("a cube");
    assert!(
        (out.solid.volume() - 1000.0).abs() < 10.0,
        "{}",
        out.solid.volume()
    );
    assert!(out.distance_max < 0.37, "{}", out.distance_max);
    assert_eq!(
        (out.genus_before, out.genus_after, out.changes.len()),
        (0, 0, 0)
    );
}

#[test]
fn what_is_no_solid_is_refused() {
    let mut inverted = cube(10.0);
    inverted.triangles.iter_mut().for_each(|t| t.swap(0, 1));
    let error = remesh_at(&inverted, 0.5).expect_err("inside out");
    assert!(error.hint().is_some_and(|h| h.contains("flip")), "{error}");
    let mut sheet = cube(10.0);
    sheet.triangles.truncate(2);
    assert!(matches!(
        remesh_at(&sheet, 0.5),
        Err(RemeshError::NotSolid { .. })
    ));
    assert_eq!(
        remesh_at(&TriMesh::default(), 0.5).err(),
        Some(RemeshError::Empty)
    );
    assert!(matches!(
        remesh_at(&cube(10.0), 1e-9),
        Err(RemeshError::TooManyVoxels { .. })
    ));
    assert!(matches!(
        remesh_at(&cube(10.0), f64::NAN),
        Err(RemeshError::BadOption { .. })
    ));
    let monitor = Monitor::default();
    monitor.cancel();
    assert!(matches!(
        remesh(&cube(1.0), &RemeshOptions::default(), &monitor),
        Err(RemeshError::Cancelled(_))
    ));
}

/// A plate 20 x 20 x 3 with square holes, as density on a unit grid.
fn plate(holes: &[(usize, usize, usize)]) -> VoxelGrid<f32> {
    let mut grid = VoxelGrid::filled(Vec3::zeros(), 1.0, [24, 24, 7], 0f32);
    for k in 2..5 {
        for j in 2..22 {
            for i in 2..22 {
                let open = holes
                    .iter()
                    .any(|&(x, y, n)| (x..x + n).contains(&i) && (y..y + n).contains(&j));
                let v = grid.index(i, j, k);
                grid.values[v] = if open { 0.0 } else { 1.0 };
            }
        }
    }
    grid
}

#[test]
fn pinholes_close_and_windows_stay() {
    let density = plate(&[(5, 5, 1), (12, 5, 2), (6, 12, 6)]);
    let out = remesh_density(
        &density,
        0.5,
        &RemeshOptions::default(),
        &Monitor::default(),
    )
    .expect("a plate");
    assert_eq!((out.genus_before, out.genus_after), (3, 1));
    assert_eq!(out.changes.len(), 2);
    assert!(
        out.changes
            .iter()
            .all(|c| c.kind == ChangeKind::TunnelClosed && c.size < 3.0)
    );
    let first = &out.changes[0];
    assert!(
        (first.place - Vec3::new(12.5, 5.5, 3.0)).norm() < 0.7,
        "{first:?}"
    );
    // The plug is as thick as the plate: no dent deeper than half a voxel of the source.
    let depth = out.field.sample(&Vec3::new(12.5, 5.5, 3.0));
    assert!(depth > 0.6, "{depth}");
    let off = RemeshOptions {
        min_tunnel: 0.0,
        ..RemeshOptions::default()
    };
    let out = remesh_density(&density, 0.5, &off, &Monitor::default()).expect("a plate");
    assert_eq!((out.genus_after, out.changes.len()), (3, 0));
}

#[test]
fn a_kept_bore_stays() {
    let density = plate(&[(5, 5, 2), (14, 14, 2)]);
    let bore = Capsule {
        a: Vec3::new(5.5, 5.5, 0.0),
        b: Vec3::new(5.5, 5.5, 6.0),
        radius: 2.0,
    };
    let options = RemeshOptions {
        keep_open: vec![bore],
        ..RemeshOptions::default()
    };
    let out = remesh_density(&density, 0.5, &options, &Monitor::default()).expect("a plate");
    assert_eq!((out.genus_before, out.genus_after), (2, 1));
}

/// A repair along a slanting draw direction left specks of a voxel in the mouth of a bore; they stayed, because bores are kept open, and
/// the body of each cut itself.
#[test]
fn a_speck_in_a_kept_bore_goes() {
    let mut density = plate(&[(5, 5, 4)]);
    let speck = density.index(7, 7, 3);
    density.values[speck] = 1.0;
    let bore = Capsule {
        a: Vec3::new(6.5, 6.5, 0.0),
        b: Vec3::new(6.5, 6.5, 6.0),
        radius: 2.0,
    };
    let options = RemeshOptions {
        keep_open: vec![bore],
        ..RemeshOptions::default()
    };
    let out = remesh_density(&density, 0.5, &options, &Monitor::default()).expect("a plate");
    let kinds: Vec<ChangeKind> = out.changes.iter().map(|c| c.kind).collect();
    assert_eq!(
        (kinds, out.genus_after),
        (vec![ChangeKind::IslandDropped], 1)
    );
}

#[test]
fn islands_cavities_and_short_bridges_go_and_struts_stay() {
    // Two blocks joined by a thick bar; beside it a thin short bridge.
    let mut grid = VoxelGrid::filled(Vec3::zeros(), 1.0, [30, 30, 16], 0f32);
    let mut fill = |x: std::ops::Range<usize>,
                    y: std::ops::Range<usize>,
                    z: std::ops::Range<usize>,
                    value: f32| {
        for k in z {
            for j in y.clone() {
                for i in x.clone() {
                    let v = grid.index(i, j, k);
                    grid.values[v] = value;
                }
            }
        }
    };
    fill(2..13, 2..28, 2..14, 1.0);
    fill(17..28, 2..28, 2..14, 1.0);
    fill(13..17, 2..10, 2..14, 1.0);
    fill(13..17, 24..25, 7..8, 1.0);
    fill(6..8, 15..17, 6..8, 0.0);
    fill(14..16, 27..29, 14..15, 1.0);
    let out =
        remesh_density(&grid, 0.5, &RemeshOptions::default(), &Monitor::default()).expect("blocks");
    let mut kinds: Vec<String> = out
        .changes
        .iter()
        .map(|c| format!("{:?}", c.kind))
        .collect();
    kinds.sort();
    assert_eq!(
        (out.genus_before, out.genus_after),
        (1, 1),
        "{kinds:?}: a bridge longer than the limit stays"
    );
    assert_eq!(kinds, ["CavityFilled", "IslandDropped"]);
}

#[test]
fn densities_that_cannot_work_are_refused() {
    let run = |grid: &VoxelGrid<f32>| {
        remesh_density(grid, 0.5, &RemeshOptions::default(), &Monitor::default())
    };
    let mut grid = VoxelGrid::filled(Vec3::zeros(), 1.0, [8; 3], 0f32);
    assert!(matches!(run(&grid), Err(RemeshError::NoMaterial { .. })));
    grid.values.fill(f32::NAN);
    assert!(matches!(run(&grid), Err(RemeshError::NoMaterial { .. })));
    grid.values.pop();
    assert!(matches!(run(&grid), Err(RemeshError::BadGrid { .. })));
    // A checkerboard is nothing but islands.
    let mut grid = VoxelGrid::filled(Vec3::zeros(), 1.0, [12; 3], 0f32);
    for v in 0..grid.values.len() {
        grid.values[v] = (grid.ijk(v).iter().sum::<usize>() % 2) as f32;
    }
    assert!(matches!(run(&grid), Err(RemeshError::Vanished { .. })));
}

#[test]
fn threads_do_not_change_a_bit() {
    let density = plate(&[(5, 5, 1), (6, 12, 6)]);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("a pool");
        pool.install(|| {
            remesh_density(
                &density,
                0.5,
                &RemeshOptions::default(),
                &Monitor::default(),
            )
        })
        .expect("a plate")
    };
    let (one, two) = (run(1), run(2));
    assert_eq!(one.field, two.field);
    assert_eq!(one.solid, two.solid);
    assert_eq!(one.changes, two.changes);
    assert_eq!(one.distance_max, two.distance_max);
}

#[test]
fn a_slot_beside_thick_flanges_gets_a_web_and_no_block() {
    // Two flanges, 10 thick, joined by a web, 2 thick; the web has a slot along one flange.
    let mut grid = VoxelGrid::filled(Vec3::zeros(), 1.0, [24, 24, 14], 0f32);
    for v in 0..grid.values.len() {
        let [i, j, k] = grid.ijk(v);
        let flange = (2..8).contains(&i) || (16..22).contains(&i);
        let web = (8..16).contains(&i) && (6..8).contains(&k);
        let slot = (8..10).contains(&i) && (8..16).contains(&j);
        let inside = (2..22).contains(&j) && (2..12).contains(&k);
        if inside && (flange || (web && !slot)) {
            grid.values[v] = 1.0;
        }
    }
    let out = remesh_density(&grid, 0.5, &RemeshOptions::default(), &Monitor::default())
        .expect("flanges");
    assert_eq!((out.genus_before, out.genus_after), (1, 0));
    let depth = |z: f64| out.field.sample(&Vec3::new(8.5, 11.5, z));
    assert!(depth(6.5) > 0.5, "{}", depth(6.5));
    // The web ends at 5.5 and 7.5.
    assert!(
        depth(5.1) < 0.0 && depth(7.9) < 0.0,
        "{} {}",
        depth(5.1),
        depth(7.9)
    );
}
