//! Remesh of real parts: topology, distance, volume, noise, threads. Needs the corpus of test parts.

use std::collections::HashMap;
use std::path::PathBuf;

use grassfire::Vec3;
use grassfire::mesh::self_intersection::self_intersections;
use grassfire::mesh::{DistanceOptions, TriMesh, two_sided};
use grassfire::monitor::Monitor;
use grassfire::remesh::{ChangeKind, RemeshError, RemeshOptions, Remeshed, remesh};

/// A file of the corpus, or `None` with a note when there is none.
fn corpus(name: &str) -> Option<PathBuf> {
    let root = std::env::var_os("GRASSFIRE_CORPUS").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"),
        PathBuf::from,
    );
    let path = root.join(name);
    if path.exists() {
        return Some(path);
    }
    println!("skipped: no corpus ({name})");
    None
}

/// Minimal reader, so that these tests do not depend on `io`: OBJ by lines, binary STL welded by equal corners.
fn load(name: &str) -> Option<TriMesh> {
    let bytes = std::fs::read(corpus(name)?).expect("readable");
    let mut mesh = TriMesh::default();
    if name.ends_with(".obj") {
        for line in String::from_utf8_lossy(&bytes).lines() {
            let words: Vec<&str> = line.split_whitespace().collect();
            match words.first() {
                Some(&"v") => mesh.points.push(Vec3::from_iterator(
                    words[1..4]
                        .iter()
                        .map(|w| w.parse::<f64>().expect("a number")),
                )),
                Some(&"f") => {
                    let index = |w: &&str| {
                        w.split('/')
                            .next()
                            .and_then(|w| w.parse::<u32>().ok())
                            .expect("an index")
                            - 1
                    };
                    let face: Vec<u32> = words[1..].iter().map(index).collect();
                    mesh.triangles
                        .extend((1..face.len() - 1).map(|k| [face[0], face[k], face[k + 1]]));
                }
                _ => {}
            }
        }
        return Some(mesh);
    }
    let mut ids = HashMap::new();
    for record in bytes[84..].chunks_exact(50) {
        let float = |at: usize| {
            f32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]])
        };
        mesh.triangles.push(std::array::from_fn(|k| {
            let x: [f32; 3] = std::array::from_fn(|a| float(12 + 12 * k + 4 * a) + 0.0);
            *ids.entry(x.map(f32::to_bits)).or_insert_with(|| {
                mesh.points.push(Vec3::from(x.map(f64::from)));
                mesh.points.len() as u32 - 1
            })
        }));
    }
    Some(mesh)
}

fn run(mesh: &TriMesh) -> Remeshed {
    remesh(mesh, &RemeshOptions::default(), &Monitor::default()).expect("a solid")
}

#[test]
fn brackets_keep_their_bores_volume_and_place() {
    let parts = [
        ("simjeb_055", 9),
        ("simjeb_398", 7),
        ("simjeb_576", 13),
        ("simjeb_623", 9),
    ];
    for (name, genus) in parts {
        let Some(mesh) = load(&format!("dev/{name}.obj")) else {
            return;
        };
        let out = run(&mesh);
        assert_eq!(
            (out.genus_before, out.genus_after),
            (genus, genus),
            "{name}"
        );
        assert!(self_intersections(&out.solid).is_empty(), "{name}");
        assert!(
            (out.solid.volume() / mesh.volume() - 1.0).abs() < 0.005,
            "{name}"
        );
        assert!(
            out.distance_max < out.field.spacing,
            "{name}: {} mm",
            out.distance_max
        );
        assert!(
            (0.8..1.3).contains(&out.field.spacing),
            "{name}: {}",
            out.field.spacing
        );
        let distance = two_sided(
            &mesh,
            &out.solid,
            &DistanceOptions { samples: 10_000 },
            None,
        );
        assert!(
            distance.p95 < 0.3 * out.field.spacing,
            "{name}: {distance:?}"
        );
    }
}

#[test]
fn pinholes_of_a_proposal_close_and_windows_stay() {
    let Some(mesh) = load("wishbone/free23_2mm.stl") else {
        return;
    };
    let out = run(&mesh);
    // By persistent homology of the distance (GUDHI) 7 tunnels are wider than the limit, 6.2 to 23.6 mm, and all others
    // narrower than 5 mm.
    assert_eq!((out.genus_before, out.genus_after), (33, 7));
    assert!(
        out.changes
            .iter()
            .all(|c| c.kind == ChangeKind::TunnelClosed && c.size < 3.0 * 1.875)
    );
    assert!(self_intersections(&out.solid).is_empty());
    // The part is symmetric in y, and so are the changes.
    for c in &out.changes {
        let mirrored = Vec3::new(c.place.x, -c.place.y, c.place.z);
        assert!(
            out.changes
                .iter()
                .any(|d| (d.place - mirrored).norm() < 2.0),
            "{c:?}"
        );
    }
    assert!((out.solid.volume() / mesh.volume() - 1.0).abs() < 0.03);
}

#[test]
fn the_voxel_does_not_decide_which_tunnels_close() {
    // A pinhole beside a slit stayed open at 0.79 and 0.71 mm (genus 9) and was closed at 0.87 mm (genus 7).
    let Some(mesh) = load("wishbone/free23_2mm.stl") else {
        return;
    };
    for voxel in [0.715, 0.873] {
        let options = RemeshOptions {
            voxel: Some(voxel),
            ..RemeshOptions::default()
        };
        let out = remesh(&mesh, &options, &Monitor::default()).expect("a solid");
        assert_eq!(out.genus_after, 7, "voxel {voxel} mm");
    }
}

#[test]
fn narrow_bores_of_a_cad_mesh_are_real() {
    let Some(mesh) = load("dev/abc_00000125_strap.obj") else {
        return;
    };
    // Two of them are 1.9 mm wide, less than 3 voxels.
    let out = run(&mesh);
    assert_eq!((out.genus_before, out.genus_after), (3, 3));
    assert!(out.changes.is_empty(), "{:?}", out.changes);
}

#[test]
fn thin_walls_get_voxels_enough() {
    let Some(mesh) = load("wishbone/draw23_2mm.stl") else {
        return;
    };
    let out = run(&mesh);
    assert!(out.field.spacing < 1.0 && out.genus_after <= 7);
    assert!((out.solid.volume() / mesh.volume() - 1.0).abs() < 0.01);
}

#[test]
fn dirty_files_give_the_clean_part() {
    for (name, tolerance) in [
        ("01_open_hole", 0.01),
        ("02_open_1pct_missing", 0.01),
        ("12_tiny_islands", 0.005),
        ("20_unwelded_cracks", 0.005),
    ] {
        let Some(mesh) = load(&format!("bad/{name}.stl")) else {
            return;
        };
        let out = run(&mesh);
        assert_eq!(out.genus_after, 13, "{name}");
        assert!(
            (out.solid.volume() / 7.831e4 - 1.0).abs() < tolerance,
            "{name}: {}",
            out.solid.volume()
        );
        let islands = out
            .changes
            .iter()
            .filter(|c| c.kind == ChangeKind::IslandDropped)
            .count();
        assert_eq!(
            islands,
            // 4 of the 60 lie inside the part.
            if name.contains("islands") { 56 } else { 0 },
            "{name}"
        );
    }
}

#[test]
fn overlaps_unite_and_sheets_are_refused() {
    let Some(mesh) = load("bad/10_self_intersect_overlap.stl") else {
        return;
    };
    let volume = run(&mesh).solid.volume();
    assert!((7.9e4..1.56e5).contains(&volume), "{volume}");
    for name in [
        "bad/32_zero_thickness_sheet.stl",
        "bad/33_single_triangle.stl",
    ] {
        let Some(mesh) = load(name) else { return };
        assert!(
            matches!(
                remesh(&mesh, &RemeshOptions::default(), &Monitor::default()),
                Err(RemeshError::NotSolid { .. })
            ),
            "{name}"
        );
    }
}
