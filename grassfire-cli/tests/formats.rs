//! Other files of the part, and a FreeCAD document made from its pieces: a plate whose hole has a ring as seat.

mod support;

#[cfg(feature = "occt")]
use std::path::Path;
use std::path::PathBuf;
#[cfg(feature = "occt")]
use std::process::{Command, Output};

#[cfg(feature = "occt")]
use serde_json::Value;
#[cfg(feature = "occt")]
use support::{HOLE, Run, THICK, number};
use support::{reconstruct, run_plate};

/// A ring along z in the plate's hole, as a text STL.
#[cfg(feature = "occt")]
fn ring(folder: &Path, low: f64, high: f64) -> PathBuf {
    let corner = |k: u32, j: u32| {
        let (s, c) = (std::f64::consts::TAU * f64::from(k % 64) / 64.0).sin_cos();
        let (r, z) = [
            (HOLE + 4.0, low),
            (HOLE + 4.0, high),
            (HOLE, high),
            (HOLE, low),
        ][(j % 4) as usize];
        [r * c, r * s, z]
    };
    let mut text = "solid ring\n".to_owned();
    for (k, j) in (0..64).flat_map(|k| (0..4).map(move |j| (k, j))) {
        let (a, b) = (corner(k, j), corner(k + 1, j));
        let (c, d) = (corner(k + 1, j + 1), corner(k, j + 1));
        for triangle in [[a, b, c], [a, c, d]] {
            text += "facet normal 0 0 0\nouter loop\n";
            for [x, y, z] in triangle {
                text += &format!("vertex {x} {y} {z}\n");
            }
            text += "endloop\nendfacet\n";
        }
    }
    let path = folder.join("seat.stl");
    std::fs::write(&path, text + "endsolid ring\n").expect("writes");
    path
}

/// The plate's extent along z, as the proposal has it.
#[cfg(feature = "occt")]
fn seated(folder: &Path, args: &[&str]) -> Run {
    let seat = ring(folder, 0.0, THICK).display().to_string();
    let all: Vec<&str> = ["--non-design", &seat]
        .iter()
        .chain(args)
        .copied()
        .collect();
    run_plate(folder, &all)
}

#[cfg(feature = "occt")]
fn listed(run: &Run) -> Vec<String> {
    let manifest: Value = serde_json::from_slice(&run.file("manifest.json")).expect("JSON");
    let files = manifest["files"].as_array().expect("files");
    let name = |file: &Value| file["path"].as_str().expect("a path").to_owned();
    files.iter().map(name).collect()
}

#[cfg(feature = "occt")]
#[test]
fn all_formats_are_written_listed_and_taken_away_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let asked = [
        "--format",
        "brep,3mf",
        "--format",
        "iges",
        "--format",
        "pieces,step",
    ];
    let first = seated(folder.path(), &asked);
    assert!(matches!(first.code, Some(0 | 1)), "{}", first.stderr);
    let extra = [
        "part.brep",
        "part.igs",
        "part.3mf",
        "pieces/organic.step",
        "pieces/body-01.step",
    ];
    let names = listed(&first);
    for name in extra.iter().chain(&["part.step", "part.stl"]) {
        assert!(
            names.iter().any(|n| n == name),
            "{name} is not in {names:?}"
        );
        assert!(!first.file(name).is_empty());
    }
    let report = first.report();
    assert_eq!(report["solid"]["valid"], true, "{}", first.stderr);
    let seat = &report["non_design"][0];
    assert_eq!(seat["piece"], "pieces/body-01.step");
    let bore = &seat["bores"][0];
    assert!((number(bore, "/radius") - HOLE).abs() < 1e-3, "{bore}");
    let length = number(bore, "/extent/1") - number(bore, "/extent/0");
    assert!((length - THICK).abs() < 1e-3, "{bore}");
    assert!(number(bore, "/cut/0") < number(bore, "/extent/0"));
    let step = String::from_utf8_lossy(&first.file("part.step")).into_owned();
    for name in ["'seat: bore'", "'organic'", "PRODUCT('plate','plate'"] {
        assert!(step.contains(name), "{name}");
    }
    let texts = ["--set", "step.author=Me", "--set", "step.product=bracket 7"];
    let second = seated(folder.path(), &texts);
    let names = listed(&second);
    for name in extra {
        assert!(!second.output.join(name).exists(), "{name} is an old file");
        assert!(!names.iter().any(|n| n == name), "{name}");
    }
    assert!(!second.output.join("pieces").exists());
    let step = String::from_utf8_lossy(&second.file("part.step")).into_owned();
    assert!(step.contains("('Me')") && step.contains("PRODUCT('bracket 7'"));
}

#[test]
fn three_mf_is_a_closed_input_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let first = run_plate(folder.path(), &["--format", "3mf"]);
    assert!(matches!(first.code, Some(0 | 1)), "{}", first.stderr);
    let again = folder.path().join("again");
    std::fs::create_dir(&again).expect("a folder");
    let part: PathBuf = first.output.join("part.3mf");
    let second = reconstruct(&part, &again.join("out"), &["--voxel", "0.8", "--strict"]);
    assert!(matches!(second.code, Some(0 | 1)), "{}", second.stderr);
    let (before, after) = (first.report(), second.report());
    let volume = |report: &serde_json::Value| support::number(report, "/volume/solid");
    let read = support::number(&after, "/input/volume");
    assert!((read / volume(&before) - 1.0).abs() < 5e-3, "{read}");
    for key in ["open_edges", "non_manifold_edges"] {
        assert_eq!(after["input"][key], 0, "{key}");
    }
}

#[test]
fn unknown_formats_and_chords_are_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut bad = vec![
        (vec!["--format", "fcstd"], "fcstd"),
        (vec!["--set", "files.formats=[\"dwg\"]"], "dwg"),
        (vec!["--set", "files.chord=0"], "files.chord"),
        (vec!["--crease-angle", "200"], "crease_angle"),
        (vec!["--set", "cad.fillet=0"], "cad.fillet"),
    ];
    if !cfg!(feature = "occt") {
        bad.push((vec!["--format", "iges"], "no OpenCASCADE"));
    }
    for (args, word) in bad {
        let run = run_plate(folder.path(), &args);
        assert_eq!(run.code, Some(2), "{}", run.stderr);
        let errors = run.lines("error: ");
        assert!(
            errors.len() == 1 && errors[0].contains(word),
            "{}",
            run.stderr
        );
        assert_eq!(run.lines("hint: ").len(), 1, "{}", run.stderr);
        assert!(!run.output.exists(), "a refused run must write nothing");
    }
}

#[cfg(feature = "occt")]
fn python(args: &[&str]) -> Option<Output> {
    let output = Command::new("python3").args(args).output().ok()?;
    (output.status.code() != Some(4)).then_some(output)
}

/// Opens the document, gives the first bore three radii one after the other, and prints validity and volume each time.
#[cfg(feature = "occt")]
const EDIT: &str = r#"
import json, sys
sys.path.insert(0, sys.argv[1])
import freecad_tree
app, part = freecad_tree.freecad()
document = app.openDocument(sys.argv[2])
bore, result = document.getObject("Bore"), document.getObject("Part")
radius, out = bore.Radius.Value, []
for change in (0.0, 1.0, -1.0):
    bore.Radius = radius + change
    document.recompute()
    valid = all(o.isValid() for o in document.Objects) and result.Shape.isValid()
    out.append([change, valid and len(result.Shape.Solids) == 1, result.Shape.Volume])
print(json.dumps(out))
"#;

/// Needs Debian's freecad-python3; skipped where it is not installed.
#[cfg(feature = "occt")]
#[test]
fn a_bore_changed_in_freecad_recomputes_the_part() {
    let tools = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tools");
    let script = tools.join("freecad_tree.py").display().to_string();
    let folder = tempfile::tempdir().expect("a folder");
    if python(&[&script, &folder.path().display().to_string()]).is_none() {
        println!("skipped: FreeCAD is not installed");
        return;
    }
    let run = seated(folder.path(), &["--format", "pieces"]);
    let out = run.output.display().to_string();
    let made = python(&[&script, &out, "--json"]).expect("FreeCAD is there");
    let error = String::from_utf8_lossy(&made.stderr).into_owned();
    assert_eq!(made.status.code(), Some(0), "{error}");
    let text = String::from_utf8_lossy(&made.stdout).into_owned();
    let line = text.lines().last().expect("a line");
    let made: Value = serde_json::from_str(line).expect("JSON");
    let labels: Vec<&str> = made["features"]
        .as_array()
        .expect("features")
        .iter()
        .filter_map(|f| f[1].as_str())
        .collect();
    assert_eq!(
        labels,
        ["organic body", "seat", "seat: bore", "fuse", "part"]
    );

    let tools = tools.display().to_string();
    let file = run.output.join("part.FCStd").display().to_string();
    let edited = python(&["-c", EDIT, &tools, &file]).expect("FreeCAD is there");
    let error = String::from_utf8_lossy(&edited.stderr).into_owned();
    assert!(edited.status.success(), "{error}");
    let text = String::from_utf8_lossy(&edited.stdout).into_owned();
    let rows: Vec<(f64, bool, f64)> =
        serde_json::from_str(text.lines().last().expect("a line")).expect("JSON");
    assert!(rows.iter().all(|row| row.1), "{rows:?}");
    for (change, _, volume) in &rows[1..] {
        let ring = (HOLE + change).powi(2) - HOLE * HOLE;
        let wanted = -std::f64::consts::PI * ring * THICK;
        let have = volume - rows[0].2;
        assert!(
            (have / wanted - 1.0).abs() < 1e-3,
            "{change} mm: {have} instead of {wanted} mm3"
        );
    }
}
