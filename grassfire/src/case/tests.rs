//! Every way in which a project file can be wrong, and the examples.

use std::path::Path;

use nalgebra::Matrix3;

use super::*;
use crate::Vec3;
use crate::fe::FeError;
use crate::monitor::Monitor;
use crate::topopt::{CORE, DESIGN, FROZEN, OUTSIDE, TopoptError, validate};

const GOOD: &str = r#"
units = "mm-N-MPa"
[grid]
h = 2.0
[material]
young = 1000.0
nu = 0.3
[design]
space = [{ box = { min = [0, 0, 0], max = [20, 10, 10] } }]
[[non_design]]
name = "ring"
shapes = [{ cylinder = { point = [16, 5, 0], axis = [0, 0, 1], radius = 4, from = 0, to = 10 } }]
[select]
left = { plane = { point = [0, 0, 0], normal = [1, 0, 0] } }
ring = { body = { name = "ring" } }
corner = { nearest = { point = [20, 10, 10] } }
[[support]]
on = "left"
fix = "xyz"
[[case]]
name = "pull"
loads = [{ on = "ring", force = [100, 0, 0] }]
[optimize]
volume_fraction = 0.5
"#;

fn try_build(text: &str) -> Result<Built, CaseError> {
    let case = Case::parse("case.toml", text, Path::new("."))?;
    let built = build(&case, Path::new("."), &Monitor::default())?;
    validate(&built.problem, &case.optimize, &case.solver)?;
    Ok(built)
}

/// The error of the good case with one part replaced.
fn broken(from: &str, to: &str) -> CaseError {
    assert!(GOOD.contains(from), "{from}");
    try_build(&GOOD.replace(from, to)).expect_err(to)
}

#[test]
fn a_good_case_becomes_voxels() {
    let built = try_build(GOOD).unwrap();
    let p = &built.problem;
    assert_eq!(p.dims, [10, 5, 5]);
    assert_eq!(p.count(DESIGN) + p.count(FROZEN), 250);
    assert_eq!(built.bodies, [("ring".to_owned(), p.count(FROZEN))]);
    assert_eq!(p.fixed.len(), 3 * 36);
    let sum: f64 = p.cases[0].forces.iter().map(|(_, f)| f[0]).sum();
    assert!((sum - 100.0).abs() < 1e-9);
    assert!(
        built
            .selections
            .iter()
            .any(|s| s.name == "ring" && s.on_frozen)
    );
}

#[test]
fn bad_cases_are_refused_by_name() {
    let is = |error: CaseError, good: bool| assert!(good, "{error}");
    let e = broken("volume_fraction", "volum_fraction");
    assert!(
        e.hint().is_some_and(|h| h.contains("volume_fraction")),
        "{e}"
    );
    is(broken("mm-N-MPa", "m-N-Pa"), true);
    let e = broken("young = 1000.0", "young = 2.1e11");
    assert!(e.to_string().contains("Pa"), "{e}");
    let e = broken("[[support]]\non = \"left\"\nfix = \"xyz\"\n", "");
    assert!(matches!(e, CaseError::NoSupport), "{e}");
    let e = broken("on = \"ring\"", "on = \"rng\"");
    assert!(e.hint().is_some_and(|h| h.contains("ring")), "{e}");
    let e = broken("point = [0, 0, 0], normal", "point = [-9, 0, 0], normal");
    assert!(matches!(e, CaseError::EmptySelection { .. }), "{e}");
    let e = broken("[100, 0, 0]", "[nan, 0, 0]");
    assert!(matches!(e, CaseError::Value { .. }), "{e}");
    for fraction in ["0", "1.5", "0.01"] {
        let e = broken(
            "volume_fraction = 0.5",
            &format!("volume_fraction = {fraction}"),
        );
        assert!(matches!(e, CaseError::Problem(_)), "{e}");
    }
    let e = broken("point = [16, 5, 0]", "point = [60, 5, 0]");
    assert!(matches!(e, CaseError::BodyOutside { .. }), "{e}");
    let e = broken("h = 2.0", "h = 0.0001");
    let memory = matches!(
        &e,
        CaseError::Problem(TopoptError::Fe(FeError::Memory { .. }))
    );
    assert!(memory && e.to_string().contains("MB"), "{e}");
    let e = broken("fix = \"xyz\"", "fix = \"x\"");
    assert!(
        matches!(&e, CaseError::Mechanism { modes } if modes.len() >= 3),
        "{e}"
    );
    let e = broken(
        "{ box = ",
        "{ file = { path = \"nothing.stl\" } }, { box = ",
    );
    assert!(matches!(e, CaseError::MissingFile { .. }), "{e}");
    let e = broken("fix = \"xyz\"", "fix = \"xyz\"\nroller = [1, 0, 0]");
    assert!(
        e.to_string().contains("one of fix, roller and spring"),
        "{e}"
    );
    let e = broken("fix = \"xyz\"", "spring = { stiffness = 0 }");
    assert!(e.to_string().contains("N/mm"), "{e}");
    let e = broken(
        "fix = \"xyz\"",
        "spring = { stiffness = 9, along = [1, 0, 0] }",
    );
    assert!(
        matches!(&e, CaseError::Mechanism { modes } if modes.len() >= 3),
        "{e}"
    );
    let e = broken("nu = 0.3", "nu = 0.3\ndensity = 7850.0");
    assert!(e.to_string().contains("t/mm3"), "{e}");
    let e = broken("[optimize]", "gravity = [0, 0, -9810]\n[optimize]");
    assert!(e.to_string().contains("material.density"), "{e}");
    let face = |what: &str| format!("ring = {{ step_face = {{ path = \"nothing.step\"{what} }} }}");
    let e = broken("ring = { body = { name = \"ring\" } }", &face(""));
    assert!(e.to_string().contains("like, name or colour"), "{e}");
    let e = broken(
        "ring = { body = { name = \"ring\" } }",
        &face(", colour = \"red\""),
    );
    assert!(e.to_string().contains("#ff8000"), "{e}");
    let e = broken(
        "ring = { body = { name = \"ring\" } }",
        &face(", name = \"red\""),
    );
    assert!(matches!(e, CaseError::MissingFile { .. }), "{e}");
    let e = broken("{ on = \"ring\", force", "{ on = \"corner\", moment");
    assert!(matches!(e, CaseError::Moment { .. }), "{e}");
}

#[test]
fn a_force_at_a_remote_point_turns_the_part_too() {
    let at = "on = \"ring\", at = [16, 5, 45], force = [100, 0, 0]";
    let built = try_build(&GOOD.replace("on = \"ring\", force = [100, 0, 0]", at)).unwrap();
    let p = &built.problem;
    let (mut force, mut moment) = (Vec3::zeros(), Vec3::zeros());
    for (node, f) in &p.cases[0].forces {
        let f = Vec3::from(*f);
        force += f;
        moment += (p.node(*node) - Vec3::new(16.0, 5.0, 45.0)).cross(&f);
    }
    assert!((force - Vec3::new(100.0, 0.0, 0.0)).norm() < 1e-9);
    assert!(moment.norm() < 1e-9, "{moment}");
}

#[test]
fn a_roller_holds_its_normal_and_a_spring_what_it_is_told() {
    let built = |support: &str| {
        let fixed = "[[support]]\non = \"left\"\nfix = \"xyz\"\n[[support]]\non = \"left\"\n";
        let text = GOOD.replace(
            "[[support]]\non = \"left\"\nfix = \"xyz\"",
            &format!("{fixed}{support}"),
        );
        try_build(&text).unwrap().problem
    };
    let along = built("roller = [-3, 0, 0]");
    assert_eq!((along.fixed.len(), along.springs.len()), (3 * 36, 0));
    let slanting = built("roller = [1, 1, 0]");
    assert_eq!(slanting.springs.len(), 36);
    let sum: Matrix3<f64> = slanting.springs.iter().map(|(_, k)| k).sum();
    // A hundred times E h for every node.
    assert!((sum.trace() / (100.0 * 1000.0 * 2.0 * 36.0) - 1.0).abs() < 1e-9);
    assert!((sum[(0, 1)] / sum[(0, 0)] - 1.0).abs() < 1e-9 && sum[(2, 2)] == 0.0);
    let soft = built("spring = { stiffness = 90, along = [0, 0, 2] }");
    let sum: Matrix3<f64> = soft.springs.iter().map(|(_, k)| k).sum();
    assert!((sum[(2, 2)] - 90.0).abs() < 1e-9 && (sum.trace() - 90.0).abs() < 1e-9);
}

#[test]
fn a_material_is_found_by_name_and_an_own_library_wins() {
    let values = "young = 1000.0\nnu = 0.3";
    let read = |material: &str, folder: &Path| {
        Case::parse("case.toml", &GOOD.replace(values, material), folder).map(|c| c.material)
    };
    let here = Path::new(".");
    let found = read("name = \"EN-GJS-400-15\"\nyield_strength = 240.0", here).unwrap();
    assert_eq!((found.young, found.nu), (169_000.0, 0.275));
    assert_eq!(found.yield_strength, Some(240.0));
    assert_eq!(found.source, "EN 1563");
    let e = read("name = \"EN-GJS-400-51\"", here).unwrap_err();
    assert!(e.hint().is_some_and(|h| h.contains("EN-GJS-400-15")), "{e}");
    let folder = tempfile::tempdir().unwrap();
    let own = "[wood]\nyoung = 1e4\nnu = 0.3\nsource = \"a guess\"\n";
    std::fs::write(folder.path().join("own.toml"), own).unwrap();
    let wood = "name = \"wood\"\nlibrary = \"own.toml\"";
    assert_eq!(read(wood, folder.path()).unwrap().young, 1e4);
    assert!(matches!(read(wood, here), Err(CaseError::Io(_))));
    let both = format!("{wood}\n{values}");
    assert!(matches!(
        read(&both, folder.path()),
        Err(CaseError::Value { .. })
    ));
}

#[test]
fn a_pressure_presses_every_face_of_a_wall_once() {
    let pressed = |pressure: &str| {
        let text = GOOD.replace("on = \"ring\", force = [100, 0, 0]", pressure);
        let text = text.replace(
            "corner = {",
            "right = { plane = { point = [20, 0, 0], normal = [1, 0, 0] } }\ncorner = {",
        );
        let text = text.replace("point = [16, 5, 0]", "point = [10, 5, 0]");
        try_build(&text).unwrap().problem.cases[0]
            .forces
            .iter()
            .map(|(_, f)| Vec3::from(*f))
            .collect::<Vec<_>>()
    };
    // 10 x 10 mm under 3 MPa; a corner node has a quarter of a voxel's face of 2 x 2 mm.
    let forces = pressed("on = \"right\", pressure = 3");
    let sum: Vec3 = forces.iter().sum();
    assert!((sum - Vec3::new(-300.0, 0.0, 0.0)).norm() < 1e-9, "{sum}");
    let least = forces
        .iter()
        .map(|f| f.norm())
        .fold(f64::INFINITY, f64::min);
    assert!((least - 3.0).abs() < 1e-9, "{least}");
    let sum: Vec3 = pressed("on = \"right\", bearing = [-7, 0, 0]").iter().sum();
    assert!((sum - Vec3::new(-7.0, 0.0, 0.0)).norm() < 1e-9, "{sum}");
}

#[test]
fn loads_on_nothing_are_refused() {
    let text = GOOD.replace(
        "max = [20, 10, 10] } }]",
        "max = [20, 10, 10] } }]\ncut = [{ box = { min = [0, 4, 0], max = [12, 10, 10] } }]",
    );
    let text = text.replace(
        "corner = {",
        "hole = { box = { min = [2, 8, 2], max = [8, 10, 8] } }\ncorner = {",
    );
    let text = text.replace("on = \"ring\"", "on = \"hole\"");
    let e = try_build(&text).unwrap_err();
    assert!(matches!(e, CaseError::OnVoid { .. }), "{e}");
}

#[test]
fn a_frozen_undercut_is_named_and_a_core_allows_it() {
    let draw = "volume_fraction = 0.5\ndraw = { dir = [0, 0, 1], parting = \"plane\", at = 0 }";
    let text = GOOD.replace("volume_fraction = 0.5", draw);
    assert!(try_build(&text).is_ok());
    let hole = "[[keep_out]]\nname = \"bore\"\nshapes = [{ box = { min = [6, 4, 2], max = [10, 6, 4] } }]\n[[non_design]]\nname = \"roof\"\nshapes = [{ box = { min = [6, 4, 6], max = [10, 6, 8] } }]\n[select]";
    let text = text.replace("[select]", hole);
    let e = try_build(&text).unwrap_err();
    assert!(
        matches!(&e, CaseError::Problem(TopoptError::FrozenUndercut { .. })),
        "{e}"
    );
    assert!(try_build(&text.replace("name = \"bore\"", "name = \"bore\"\ncore = true")).is_ok());
}

#[test]
fn pieces_without_support_are_left_out() {
    let text = GOOD.replace(
        "max = [20, 10, 10] } }]",
        "max = [20, 10, 10] } }, { box = { min = [30, 0, 0], max = [34, 4, 4] } }]",
    );
    let built = try_build(&text).unwrap();
    assert_eq!(
        built.problem.count(DESIGN) + built.problem.count(FROZEN),
        250
    );
    let loads = "loads = [{ on = \"far\", force = [1, 0, 0] }]\n[[case]]\nname = \"pull\"\nloads";
    let text = text.replace(
        "corner = {",
        "far = { box = { min = [30, 0, 0], max = [34, 4, 4] } }\ncorner = {",
    );
    let e = try_build(&text.replacen("loads", loads, 1)).unwrap_err();
    assert!(matches!(e, CaseError::LooseLoad { .. }), "{e}");
}

#[test]
fn examples_are_sound() {
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples");
    for name in [
        "wishbone",
        "wishbone-free",
        "wishbone-fine",
        "wishbone-thick",
        "cantilever",
        "mbb",
        "l-bracket",
        "ge-bracket",
    ] {
        let path = examples.join(name).join("case.toml");
        let case = Case::read(&path).unwrap_or_else(|e| panic!("{name}: {e}"));
        match build(&case, &examples.join(name), &Monitor::default()) {
            Ok(built) => validate(&built.problem, &case.optimize, &case.solver)
                .unwrap_or_else(|e| panic!("{name}: {e}")),
            // Its files are not in the repository.
            Err(CaseError::MissingFile { .. }) if name == "ge-bracket" => {}
            Err(e) => panic!("{name}: {e}"),
        }
    }
}

#[test]
fn the_wishbone_is_as_large_as_it_should_be() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/wishbone/case.toml");
    let case = Case::read(&path).unwrap();
    let built = build(&case, Path::new("."), &Monitor::default()).unwrap();
    let p = &built.problem;
    let cell = p.h.powi(3);
    let space = (p.count(DESIGN) + p.count(FROZEN)) as f64 * cell;
    let frozen = p.count(FROZEN) as f64 * cell;
    assert!((space / 268_380.0 - 1.0).abs() < 1e-3, "{space}");
    assert!((frozen / 24_840.0 - 1.0).abs() < 1e-3, "{frozen}");
    assert!(p.count(CORE) > 0 && p.count(OUTSIDE) > 0);
}
