//! Thirty generated solids of known sheets, seams and tunnels through the whole chain, three of a family.

#![cfg(feature = "occt")]

mod generator;
mod support;

use generator::{Family, Generated, generate};
use grassfire::io::write_stl;
use serde_json::{Value, json};
use support::{number, reconstruct};

/// Seeds of the solids of every family.
const SEEDS: std::ops::RangeInclusive<u64> = 1..=3;

fn through_the_chain(family: Family, seed: u64) {
    let solid = generate(family, seed);
    let folder = tempfile::tempdir().expect("a folder");
    let part = folder.path().join("part.stl");
    write_stl(&part, &solid.mesh).expect("the part can be written");
    let run = reconstruct(
        &part,
        &folder.path().join("out"),
        &["--voxel", &solid.voxel.to_string()],
    );
    let name = format!("{family:?} {seed}");
    println!("{name}: {:.1} s of work", run.processor_seconds);
    assert_eq!(run.code, Some(0), "{name}: {}{}", run.stdout, run.stderr);
    let report = run.report();
    for check in report["checks"].as_array().expect("checks") {
        assert_eq!(check["met"], true, "{name}: {check}");
    }
    if solid.betti.b1 == 0 {
        // A band of a hollow ball's inside was taken for a bore.
        let bodies = report["non_design"].as_array().map_or(0, Vec::len);
        assert_eq!(bodies, 0, "{name} has no bore");
    }
    keeps_its_topology(&name, &solid, &report);
    has_its_sheets(&name, &solid, &report);
}

/// Pieces, tunnels and cavities are those of the shape at every stage, and the body is one valid solid.
fn keeps_its_topology(name: &str, solid: &Generated, report: &Value) {
    let topology = &report["topology"];
    // Where bodies were recognised the stages see the part without them; the union is what the shape must be.
    let whole = match topology.get("united") {
        Some(united) if !united.is_null() => united,
        _ => &topology["solid"],
    };
    assert_eq!(whole, &json!(solid.betti), "{name}");
    assert_eq!(topology["complex"], topology["solid"], "{name}");
    assert_eq!(topology["skeleton"], topology["solid"], "{name}");
    assert_eq!(report["body"]["self_intersections"], 0, "{name}");
    let cad = &report["solid"];
    assert_eq!(cad["valid"], true, "{name}");
    assert_eq!(cad["bodies"], 1, "{name}");
    assert_eq!(cad["genus"], solid.betti.b1, "{name}");
    assert_eq!(
        report["remesh"]["changes"].as_array().map(Vec::len),
        Some(0),
        "{name}"
    );
}

/// The skeleton has the sheets of the shape and seams where it has some. A seam may end short of the rim, so that two sheets
/// run into each other around its end: no more sheets than the shape has, and none missing where it has no seam.
fn has_its_sheets(name: &str, solid: &Generated, report: &Value) {
    let sheets = number(report, "/skeleton/sheets") as usize;
    let seams = number(report, "/skeleton/seams") as usize;
    println!("{name}: {sheets} sheets of {}, {seams} seams", solid.sheets);
    if solid.seams {
        assert!((1..=solid.sheets).contains(&sheets), "{name}: {sheets}");
    } else {
        assert_eq!((sheets, seams), (solid.sheets, 0), "{name}");
    }
}

fn family(family: Family) {
    SEEDS.for_each(|seed| through_the_chain(family, seed));
}

#[test]
fn plates_with_holes() {
    family(Family::Plate);
}

#[test]
fn ribs_on_plates() {
    family(Family::RibOnPlate);
}

#[test]
fn plates_through_each_other() {
    family(Family::Cross);
}

#[test]
fn three_plates_from_a_line() {
    family(Family::Star);
}

#[test]
fn tubes() {
    family(Family::Tube);
}

#[test]
fn frames_of_rods() {
    family(Family::Frame);
}

#[test]
fn bowls() {
    family(Family::Bowl);
}

#[test]
fn hollow_balls() {
    family(Family::HollowBall);
}

#[test]
fn ribs_that_cross_on_plates() {
    family(Family::CrossedRibs);
}

#[test]
fn plates_held_apart_by_rods() {
    family(Family::Sandwich);
}
