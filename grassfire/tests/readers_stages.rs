//! Files between stages: skeletons, medial meshes and control meshes read back what was written.

use grassfire::Vec3;
use grassfire::io::*;
use grassfire::medial::MedialMesh;
use grassfire::monitor::Monitor;
use grassfire::skeleton::Skeleton;
use grassfire::spline::ControlMesh;

fn options() -> ReadOptions {
    ReadOptions::default()
}

fn awkward_points(count: usize) -> Vec<Vec3> {
    (0..count)
        .map(|i| {
            Vec3::new(
                1.0 / (i as f64 + 3.0),
                -1e-17 * i as f64,
                1e5 + 0.1 * i as f64,
            )
        })
        .collect()
}

#[test]
fn skeleton_reads_back_exactly() {
    let skeleton = Skeleton {
        points: awkward_points(6),
        radii: vec![0.1, 0.2, 1.0 / 3.0, 4.0, 5.0, 6e-3],
        quads: vec![[0, 1, 2, 3]],
        beams: vec![[3, 4], [4, 5]],
    };
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("skeleton.ply");
    write_skeleton(&path, &skeleton).unwrap();
    assert_eq!(
        read_skeleton(&path, &options(), &Monitor::default()).unwrap(),
        skeleton
    );
}

#[test]
fn skeleton_obj_with_and_without_radii() {
    let text = "v 0 0 0 1.5\nv 1 0 0\nv 1 1 0 2\nv 0 1 0 2\nv 5 5 5 1\nf 1 2 3 4\nl 4 5 1\n";
    let read =
        read_skeleton_bytes("a.obj", text.as_bytes(), &options(), &Monitor::default()).unwrap();
    assert_eq!(read.quads, [[0, 1, 2, 3]]);
    assert_eq!(read.beams, [[3, 4], [4, 0]]);
    assert_eq!(read.radii[0], 1.5);
    assert!(read.radii[1].is_nan());
}

#[test]
fn skeleton_faults_are_named() {
    let points = "v 0 0 0 1\nv 1 0 0 1\nv 1 1 0 1\nv 0 1 0 1\n";
    for (rest, words) in [
        ("f 1 2 3 4\nf 1 2 3\n", "face 1: has 3 corners"),
        ("f 1 2 3 3\n", "face 0: uses a point twice"),
        ("l 1 1\n", "edge 0: begins and ends in point 0"),
        ("v 0 0 1 -2\nf 1 2 3 4\n", "point 4: has radius -2"),
        (
            "v inf 0 1 1\nf 1 2 3 4\n",
            "point 4: has a coordinate that is not finite",
        ),
        ("", "neither quads nor beams"),
    ] {
        let text = format!("{points}{rest}");
        let error = read_skeleton_bytes("a.obj", text.as_bytes(), &options(), &Monitor::default());
        let error = error.expect_err("this must be refused").to_string();
        assert!(error.contains(words), "{error}");
    }
}

#[test]
fn medial_mesh_reads_back_exactly() {
    let medial = MedialMesh {
        points: awkward_points(5),
        radii: vec![0.1, 0.2, 0.3, 0.0, 1.0 / 3.0],
        edges: vec![[3, 4]],
        triangles: vec![[0, 1, 2], [2, 1, 3]],
    };
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("medial.ma");
    write_medial(&path, &medial).unwrap();
    assert_eq!(
        read_medial(&path, &options(), &Monitor::default()).unwrap(),
        medial
    );
    write_poles(&dir.path().join("poles.ply"), &medial).unwrap();
    let poles = read_input(
        &dir.path().join("poles.ply"),
        &options(),
        &Monitor::default(),
    );
    assert!(matches!(poles, Ok(Input::Mesh { mesh, .. }) if mesh.triangles == medial.triangles));
}

#[test]
fn medial_edges_of_triangles_are_dropped_and_faults_named() {
    let text =
        "4 4 1\nv 0 0 0 1\nv 1 0 0 1\nv 0 1 0 1\nv 0 0 1 1\ne 0 1\ne 2 1\ne 0 2\ne 3 0\nf 0 1 2\n";
    let read =
        |text: &str| read_medial_bytes("a.ma", text.as_bytes(), &options(), &Monitor::default());
    assert_eq!(read(text).unwrap().edges, [[3, 0]]);
    for (from, to, words) in [
        ("4 4 1", "4 4 2", "promises"),
        ("f 0 1 2", "f 0 1 4", "index 4"),
        ("e 3 0", "e 3 3", "twice"),
        ("v 1 0 0 1", "v 1 0 0 -1", "radius"),
        ("v 1 0 0 1", "v 1 0 0", "the radius is missing"),
        ("e 3 0", "x 3 0", "none of"),
    ] {
        let error = read(&text.replace(from, to))
            .expect_err("this must be refused")
            .to_string();
        assert!(error.contains("line ") && error.contains(words), "{error}");
    }
}

#[test]
fn control_mesh_reads_back_exactly() {
    let mesh = ControlMesh {
        points: awkward_points(8),
        quads: vec![[0, 1, 2, 3], [7, 6, 5, 4]],
    };
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("body.obj");
    write_control_mesh(&path, &mesh).unwrap();
    assert_eq!(
        read_control_mesh(&path, &options(), &Monitor::default()).unwrap(),
        mesh
    );
    let error = read_control_mesh_bytes(
        "a.obj",
        b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        &options(),
        &Monitor::default(),
    );
    assert!(
        error
            .expect_err("a triangle")
            .to_string()
            .contains("face 0: has 3 corners")
    );
}
