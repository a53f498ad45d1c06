//! `grassfire verify` and `grassfire run` from outside.

mod support;

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;
use support::{number, plate_with_hole};

fn grassfire(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_grassfire"))
        .args(args)
        .args(["--set", "reconstruct.report.picture_width=200"])
        .output()
        .expect("the program starts")
}

fn report(folder: &Path) -> Value {
    let bytes = std::fs::read(folder.join("report.json")).expect("a report");
    serde_json::from_slice(&bytes).expect("JSON")
}

/// A plate of 40 x 40 x 6 mm with a hole, held at one end and pulled at the other.
const PLATE: &str = r#"
units = "mm-N-MPa"
[grid]
h = 2.0
[material]
young = 70000.0
nu = 0.3
yield_strength = 200.0
[design]
space = [{ box = { min = [-20, -20, 0], max = [20, 20, 6] } }]
[select]
left = { plane = { point = [-20, 0, 0], normal = [1, 0, 0] } }
right = { plane = { point = [20, 0, 0], normal = [1, 0, 0] } }
[[support]]
on = "left"
fix = "xyz"
[[case]]
name = "pull"
loads = [{ on = "right", force = [12000, 0, 0] }]
[optimize]
volume_fraction = 0.8
[verify]
h = 2.0
"#;

#[test]
fn a_plate_is_verified() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name).display().to_string();
    std::fs::write(at("plate.stl"), plate_with_hole(40.0, 10.0, 6.0)).expect("writable");
    std::fs::write(at("case.toml"), PLATE).expect("writable");
    let run = |out: &str, threads: &str| {
        let (part, case, out) = (at("plate.stl"), at("case.toml"), at(out));
        let args = ["verify", &part, "--case", &case, "-o", &out];
        let output = grassfire(&[&args[..], &["--threads", threads]].concat());
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(0), "{text}");
        std::fs::read(Path::new(&out).join("result.vtu")).expect("result.vtu")
    };
    assert_eq!(run("one", "1"), run("two", "2"));
    let report = report(&folder.path().join("one"));
    let of = |key: &str| number(&report, &format!("/verify/{key}"));
    // 12 kN on 240 mm2 are 50 MPa; the hole takes the ligament and adds a notch: three times as much there.
    let bar = 0.5 * 12e3 * 50.0 / 70e3 * 40.0;
    let ratio = of("strain_energy") / bar;
    assert!(ratio > 1.05 && ratio < 2.5, "{ratio}");
    assert!(of("stress_max") > 100.0 && of("stress_max") < 300.0);
    assert!((of("yield_margin") - (200.0 / of("stress_max") - 1.0)).abs() < 1e-9);
    assert!((of("cv") / (of("strain_energy") * of("volume")) - 1.0).abs() < 1e-12);
    assert!(of("cv_equal_volume") > 0.0 && of("u_max") > 0.0);
    assert!(of("reaction_error") < 1e-4 && of("energy_error_estimate") < 0.05);
    assert!(of("elements") > 1000.0 && of("nodes") > of("elements"));
}

#[test]
fn what_cannot_be_verified_is_refused_and_nothing_is_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name).display().to_string();
    std::fs::write(at("plate.stl"), plate_with_hole(40.0, 10.0, 6.0)).expect("writable");
    std::fs::write(at("case.toml"), PLATE).expect("writable");
    std::fs::write(at("far.toml"), PLATE.replace("[-20, 0, 0]", "[-90, 0, 0]")).expect("writable");
    let refused = |args: &[&str], wanted: &str| {
        let out = at("out");
        let output = grassfire(&[args, &["-o", &out]].concat());
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{args:?}: {text}");
        assert!(text.contains(wanted), "{args:?}: {text}");
        assert!(!Path::new(&out).exists(), "{args:?}");
    };
    let (plate, case, far) = (at("plate.stl"), at("case.toml"), at("far.toml"));
    refused(&["verify", &plate], "--case");
    refused(&["verify", &case], "part.step");
    refused(&["verify", &case, "--case", &case], "not a solid");
    refused(&["verify", &at("none.stl"), "--case", &case], "none.stl");
    refused(&["verify", &plate, "--case", &far], "left");
    let wrong = ["verify", &plate, "--case", &case, "--proposal", &plate];
    refused(&wrong, "density.vti");
    refused(&["run", &at("none.toml")], "none.toml");
    // Said before the optimization begins.
    refused(&["run", &case, "--set", "verify.h=-1"], "verify.h");
    refused(&["run", &case, "--set", "files.chord=-1"], "files.chord");
}

#[test]
fn check_draws_what_the_selections_hold() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("case.toml");
    std::fs::write(&file, PLATE).expect("writable");
    let pictures = folder.path().join("deep/pictures");
    let output = grassfire(&[
        "check",
        &file.display().to_string(),
        "-o",
        &pictures.display().to_string(),
    ]);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(output.status.code(), Some(0), "{text}");
    for name in ["check.png", "check-below.png"] {
        assert!(text.contains(name), "{text}");
        let bytes = std::fs::read(pictures.join(name)).expect("a picture");
        assert!(bytes.starts_with(b"\x89PNG"));
    }
}

#[test]
fn bad_cases_end_with_exit_code_2_and_the_reason() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("case.toml");
    let refused = |from: &str, to: &str, wanted: &str| {
        assert!(PLATE.contains(from), "{from}");
        std::fs::write(&file, PLATE.replacen(from, to, 1)).expect("writable");
        let out = folder.path().join("out").display().to_string();
        let output = grassfire(&["optimize", &file.display().to_string(), "-o", &out]);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{to}: {text}");
        assert!(text.contains(wanted), "{to}: {text}");
        assert!(!Path::new(&out).exists(), "{to}");
    };
    let support = "[[support]]\non = \"left\"\nfix = \"xyz\"\n";
    refused(support, "", "support");
    // The middle is cut out, and the load sits there.
    let cut = "cut = [{ box = { min = [-8, -8, -2], max = [8, 8, 8] } }]\n[select]\n\
               void = { box = { min = [-4, -4, 0], max = [4, 4, 6] } }\n";
    let held = "on = \"right\", force = [12000, 0, 0]";
    let loaded = PLATE.replacen("[select]\n", cut, 1);
    std::fs::write(
        &file,
        loaded.replacen(held, &held.replace("right", "void"), 1),
    )
    .expect("writable");
    let args = ["check", &file.display().to_string()];
    let output = grassfire(&args);
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(text.contains("void"), "{text}");
    refused("point = [20, 0, 0]", "point = [90, 0, 0]", "right");
    refused(
        "volume_fraction = 0.8",
        "volume_fraction = 0",
        "volume_fraction",
    );
    refused(
        "volume_fraction = 0.8",
        "volume_fraction = 1.2",
        "volume_fraction",
    );
    let outside = "[[non_design]]\nname = \"pin\"\n\
                   shapes = [{ box = { min = [60, 0, 0], max = [64, 4, 4] } }]\n[select]";
    refused("[select]", outside, "pin");
    let roof = "[[keep_out]]\nname = \"bore\"\n\
                shapes = [{ box = { min = [-4, -4, 0], max = [4, 4, 4] } }]\n\
                [[non_design]]\nname = \"roof\"\n\
                shapes = [{ box = { min = [-4, -4, 4], max = [4, 4, 6] } }]\n\
                [optimize]\ndraw = { dir = [0, 0, 1], parting = \"plane\", at = 0 }\n";
    refused("[optimize]\n", roof, "shadow");
    refused("[12000, 0, 0]", "[nan, 0, 0]", "force");
    refused("h = 2.0", "h = 0.0005", "MB");
    refused("volume_fraction", "volum_fraction", "volume_fraction");
    refused("mm-N-MPa", "m-N-Pa", "mm-N-MPa");
    refused("young = 70000.0", "young = 7e10", "Pa");
}
