//! Real parts of the corpus through the program, with default options and nothing but a file name.

#![cfg(feature = "occt")]

#[path = "../../grassfire/tests/bad_corpus/mod.rs"]
#[allow(dead_code, reason = "only the folder of the corpus is wanted here")]
mod bad_corpus;
mod support;

use std::path::Path;

use bad_corpus::corpus;
use serde_json::Value;
use support::{Run, number, reconstruct};

/// Runs a part of the corpus; none without a corpus.
fn run(name: &str, args: &[&str]) -> Option<(tempfile::TempDir, Run)> {
    let part = corpus()?.join("dev").join(name);
    let folder = tempfile::tempdir().expect("a folder");
    let run = reconstruct(&part, &folder.path().join("out"), args);
    println!(
        "{name}: exit {:?}, {:.1} s, {:.0} MB\n{}",
        run.code, run.seconds, run.peak_memory, run.stdout
    );
    Some((folder, run))
}

/// What every good part must show, whatever its shape.
fn must_be_good(run: &Run) -> Value {
    assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
    let report = run.report();
    for check in report["checks"].as_array().expect("checks") {
        assert_eq!(check["met"], true, "{check}");
    }
    let topology = &report["topology"];
    assert_eq!(topology["solid"], topology["complex"]);
    assert_eq!(topology["solid"], topology["skeleton"]);
    let body = topology["body"].as_array().expect("surfaces of the body");
    let chi: i64 = body.iter().filter_map(|shell| shell["chi"].as_i64()).sum();
    assert_eq!(
        Some(chi),
        topology["skeleton"]["chi"].as_i64().map(|chi| 2 * chi)
    );
    for shell in body {
        assert_eq!(
            (&shell["closed"], &shell["manifold"]),
            (&Value::Bool(true), &Value::Bool(true))
        );
    }
    let solid = &report["solid"];
    assert_eq!(
        (&solid["valid"], solid["bodies"].as_u64()),
        (&Value::Bool(true), Some(1))
    );
    assert_eq!(solid["genus"], report["remesh"]["genus_after"]);
    let voxel = number(&report, "/distance/voxel");
    let at_most = |pointer: &str, limit: f64| {
        let value = number(&report, pointer).abs();
        assert!(value <= limit, "{pointer} is {value}, at most {limit}");
    };
    at_most("/solid/g1_max", 0.01);
    at_most("/solid/volume_check", 1e-4);
    at_most("/distance/rms", 0.5 * voxel);
    at_most("/distance/p95", voxel);
    at_most("/volume/relative_difference", 0.02);
    assert!(run.peak_memory <= 2048.0, "{} MB", run.peak_memory);
    report
}

/// A bracket whose tunnels are all real: the solid has the genus of the file, at most 200 faces, and is nowhere farther from
/// the file than `farthest` voxels.
fn bracket(name: &str, genus: i64, farthest: f64) {
    let Some((_folder, run)) = run(name, &[]) else {
        return;
    };
    let report = must_be_good(&run);
    assert_eq!(report["solid"]["genus"].as_i64(), Some(genus));
    let faces = report["solid"]["faces"].as_u64();
    assert!(faces.is_some_and(|n| n <= 200), "{faces:?} faces");
    let distance = |key: &str| number(&report, key) / number(&report, "/distance/voxel");
    let [rms, p95, max] = ["/distance/rms", "/distance/p95", "/distance/max"].map(distance);
    assert!(
        rms <= 0.25 && p95 <= 0.5 && max <= farthest,
        "{rms} rms, {p95} p95, {max} max"
    );
}

#[test]
fn simjeb_055_becomes_a_good_solid() {
    bracket("simjeb_055.obj", 9, 1.5);
}

#[test]
fn simjeb_398_becomes_a_good_solid() {
    bracket("simjeb_398.obj", 7, 1.5);
}

#[test]
fn simjeb_576_becomes_a_good_solid() {
    bracket("simjeb_576.obj", 13, 1.5);
}

#[test]
fn simjeb_623_had_slits_between_members_three_voxels_deep() {
    bracket("simjeb_623.obj", 9, 1.5);
}

#[test]
fn strap_becomes_a_good_solid_and_every_closed_tunnel_is_named() {
    let Some((_folder, run)) = run("abc_00000125_strap.obj", &[]) else {
        return;
    };
    let report = must_be_good(&run);
    let closed = report["remesh"]["changes"].as_array().map_or(0, Vec::len);
    assert_eq!(report["solid"]["genus"].as_i64(), Some(3 - closed as i64));
}

/// Area of the part's triangles that lie on a plane with this outward normal, mm2.
fn area_on(run: &Run, normal: [f64; 3], place: [f64; 3]) -> f64 {
    let stl = run.file("part.stl");
    let number = |at: usize| {
        f64::from(f32::from_le_bytes(
            stl[at..at + 4].try_into().expect("four"),
        ))
    };
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let minus = |a: [f64; 3], b: [f64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let mut area = 0.0;
    for triangle in (84..stl.len()).step_by(50) {
        let corner = |k: usize| [0, 1, 2].map(|d| number(triangle + 12 + 12 * k + 4 * d));
        let [a, b, c] = [corner(0), corner(1), corner(2)];
        // The file holds single precision.
        if [a, b, c]
            .iter()
            .all(|p| dot(minus(*p, place), normal).abs() < 1e-4)
        {
            let (u, v) = (minus(b, a), minus(c, a));
            let cross = [
                u[1] * v[2] - u[2] * v[1],
                u[2] * v[0] - u[0] * v[2],
                u[0] * v[1] - u[1] * v[0],
            ];
            area += dot(cross, normal) / 2.0;
        }
    }
    area
}

#[test]
fn mounting_faces_become_exactly_plane_on_request() {
    // The rings of the bracket end on its base, the strap is flat on most sides. One layout is enough for that.
    let args = ["--crease-angle", "30", "--set", "skeleton.layout=plain"];
    for (name, least) in [("abc_00000125_strap.obj", 7), ("simjeb_576.obj", 4)] {
        let Some((_folder, run)) = run(name, &args) else {
            return;
        };
        let report = must_be_good(&run);
        let all = report["flats"].as_array().expect("flat faces");
        let plane: Vec<&Value> = all.iter().filter(|flat| flat["plane"] == true).collect();
        assert!(plane.len() >= least, "{all:?}");
        for flat in plane {
            let vector = |key: &str| [0, 1, 2].map(|d| number(flat, &format!("/{key}/{d}")));
            let area = area_on(&run, vector("normal"), vector("place"));
            let proposal = number(flat, "/area");
            assert!(
                area > 0.8 * proposal && area < 1.5 * proposal,
                "{area} {flat}"
            );
        }
        for flat in all.iter().filter(|flat| flat["plane"] == false) {
            assert!(flat["reason"].is_string(), "{flat}");
        }
    }
}

#[test]
fn rings_stay_in_the_bracket_as_given() {
    let Some(corpus) = corpus() else { return };
    let rings = corpus.join("dev/ge_solid_domain.stl");
    let rings = rings.display().to_string();
    // How the quads lie is another test's matter.
    let args = ["--non-design", &rings, "--set", "skeleton.layout=plain"];
    let Some((_folder, run)) = run("simjeb_398.obj", &args) else {
        return;
    };
    let report = must_be_good(&run);
    let bodies = report["non_design"].as_array().expect("non-design bodies");
    assert_eq!(bodies.len(), 6);
    let step = String::from_utf8_lossy(&run.file("part.step")).into_owned();
    let cylinders = cylinder_radii(&step);
    for body in bodies {
        assert_eq!(body["kept"], true, "{body}");
        for radius in body["bore_radii"].as_array().expect("radii") {
            let radius = radius.as_f64().expect("a number");
            let found = cylinders.iter().any(|r| (r - radius).abs() < 1e-6);
            assert!(found, "no cylinder of radius {radius} in {cylinders:?}");
        }
    }
    assert!(number(&report, "/distance/non_design_max") <= 1e-3);
}

/// Radii of all cylinders of a STEP file.
fn cylinder_radii(step: &str) -> Vec<f64> {
    let one_line: String = step.split_whitespace().collect();
    one_line
        .split("CYLINDRICAL_SURFACE(")
        .skip(1)
        .filter_map(|rest| rest.split(')').next()?.rsplit(',').next()?.parse().ok())
        .collect()
}

#[test]
fn one_and_two_threads_write_the_same_bytes() {
    let name = "simjeb_576.obj";
    let (Some((_one, one)), Some((_two, two))) = (
        run(name, &["--threads", "1"]),
        run(name, &["--threads", "2"]),
    ) else {
        return;
    };
    for file in [
        "skeleton.ply",
        "body.obj",
        "part.step",
        "medial.ma",
        "proposal.stl",
    ] {
        let same = without_time(&one.file(file)) == without_time(&two.file(file));
        assert!(same, "{file} depends on the number of threads");
    }
}

#[test]
fn a_bulky_design_space_becomes_a_valid_solid_at_a_coarse_voxel() {
    let Some((_folder, run)) = run("topadd_bracket_DES.stl", &["--voxel", "5"]) else {
        return;
    };
    assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
    let report = run.report();
    for check in report["checks"].as_array().expect("checks") {
        assert_eq!(check["met"], true, "{check}");
    }
    let solid = &report["solid"];
    assert_eq!(
        (&solid["valid"], &solid["bodies"], &solid["genus"]),
        (&Value::Bool(true), &1.into(), &4.into())
    );
    assert_eq!(report["body"]["self_intersections"], 0);
}

/// A file without the line that carries the time of writing (STEP's `FILE_NAME`).
fn without_time(bytes: &[u8]) -> Vec<u8> {
    let lines = bytes.split_inclusive(|byte| *byte == b'\n');
    let kept = lines.filter(|line| !line.starts_with(b"FILE_NAME"));
    kept.flatten().copied().collect()
}

#[test]
fn the_second_run_into_a_folder_leaves_no_file_of_the_first() {
    let Some(corpus) = corpus() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let output = folder.path().join("out");
    let strap = corpus.join("dev/abc_00000125_strap.obj");
    let first = reconstruct(&strap, &output, &[]);
    assert!(Path::new(&first.output).join("part.step").is_file());
    let second = reconstruct(&strap, &output, &["--set", "retry.quad_sizes=[]"]);
    assert_eq!(second.code, Some(3), "{}", second.stderr);
    assert!(output.join("proposal.stl").is_file() && !output.join("part.step").exists());
}
