//! Feeding, mould and freezing of a plate made here: feeders as bodies, and what is refused with which exit code.

mod support;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;
use support::{HOLE, Run, SIDE, THICK, number, plate, plate_with_hole, reconstruct, run_plate};

fn command(name: &str, folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_grassfire"))
        .arg(name)
        .arg(plate(folder))
        .arg("-o")
        .arg(folder.join("out"))
        .args(args)
        .output()
        .expect("the program starts")
}

/// Two plates side by side.
fn two_plates(folder: &Path) -> PathBuf {
    let one = plate_with_hole(SIDE, HOLE, THICK);
    let mut both = one.clone();
    let count = 2 * u32::from_le_bytes([one[80], one[81], one[82], one[83]]);
    both[80..84].copy_from_slice(&count.to_le_bytes());
    for triangle in one[84..].chunks(50) {
        let mut moved = triangle.to_vec();
        for corner in 0..3 {
            let at = 12 + 12 * corner;
            let x: [u8; 4] = moved[at..at + 4].try_into().expect("four bytes");
            let x = f32::from_le_bytes(x) + 60.0;
            moved[at..at + 4].copy_from_slice(&x.to_le_bytes());
        }
        both.extend(moved);
    }
    let path = folder.join("plates.stl");
    std::fs::write(&path, both).expect("writes");
    path
}

#[test]
fn sections_grow_and_the_part_is_measured_against_the_grown_proposal() {
    let folder = tempfile::tempdir().expect("a folder");
    let args = ["--feeder", "18,0,2.5", "--growth", "0.05"];
    #[cfg(feature = "occt")]
    let args = [&args[..], &["--format", "casting"]].concat();
    let run = run_plate(folder.path(), &args);
    assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
    let report = run.report();
    assert!(number(&report, "/feed/violations_before") > 0.0);
    assert_eq!(number(&report, "/feed/violations"), 0.0);
    assert!(number(&report, "/feed/added_volume") > 100.0);
    let off = number(&report, "/volume/relative_difference");
    assert!(off.abs() < 0.02, "{off}");
    // On a plate nothing falls before; afterwards no more than corners and the voxels' noise do.
    let after = number(&report, "/feed/falling/falling");
    assert!(after < 0.05, "{after}");
    #[cfg(feature = "occt")]
    {
        let text = String::from_utf8(run.file("casting.step")).expect("text");
        assert_eq!(text.matches("MANIFOLD_SOLID_BREP(").count(), 3);
        assert!(text.contains("'feeder 1'") && text.contains("'neck 1'"));
        let yields = number(&report, "/feed/casting_yield");
        let feeder = number(&report, "/feed/zones/0/volume");
        let part = number(&report, "/volume/solid");
        assert!((yields - part / (part + feeder)).abs() < 1e-6, "{yields}");
    }
}

#[test]
fn feeding_that_cannot_be_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let refused = |run: Run, code: i32, word: &str| {
        assert_eq!(run.code, Some(code), "{}", run.stderr);
        let errors = run.lines("error: ");
        assert!(
            errors.len() == 1 && errors[0].contains(word),
            "{}",
            run.stderr
        );
        assert_eq!(run.lines("hint: ").len(), 1, "{}", run.stderr);
        assert!(!run.output.join("part.step").exists());
    };
    let place = |args: &[&str]| run_plate(folder.path(), args);
    let outside = place(&["--feeder", "80,0,2.5"]);
    refused(outside, 2, "from the part's surface");
    let steep = place(&["--feeder", "18,0,2.5", "--growth", "0.5"]);
    refused(steep, 2, "feed.growth is 0.5");
    if cfg!(feature = "occt") {
        let none = place(&["--format", "casting"]);
        refused(none, 2, "no feeder is given");
    }
    // Draft along x from a parting plane at one end, feeding from the other.
    let draft = ["feed.draft=2", "feed.draw=[1,0,0]", "feed.parting=-20"];
    let mut args = vec!["--feeder", "18,0,2.5", "--growth", "0.05"];
    draft.iter().for_each(|set| args.extend(["--set", *set]));
    let contradicts = place(&args);
    // Two places of the cycle, and by how much a radius would have to exceed itself.
    let said = contradicts.lines("error: ").join("");
    assert!(
        said.matches('(').count() >= 2 && said.contains("mm larger than itself"),
        "{said}"
    );
    refused(contradicts, 3, "contradict each other: around");
    let plates = two_plates(folder.path());
    let args = ["--voxel", "0.8", "--feeder", "18,0,2.5"];
    let apart = reconstruct(&plates, &folder.path().join("out"), &args);
    refused(apart, 2, "not connected to one");
}

#[test]
fn freezing_without_data_or_sand_and_moulds_without_undercut_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let metal = r#"solidify.metal={"name":"bronze","solidus":900,"liquidus":1000,"pour":1100,"density":8000,"conductivity":[],"heat_capacity":[[20,400]],"latent_heat":2e5,"feeding_ends":0.5,"interface":[[20,500]],"niyama":0.5,"shrinkage":0.04,"source":"none"}"#;
    for (name, args, word) in [
        ("solidify", vec!["--set", metal], "table conductivity"),
        (
            "solidify",
            vec!["--set", "solidify.material=bronze"],
            "bronze",
        ),
        (
            "solidify",
            vec!["--set", "solidify.padding=0.1"],
            "the sand must be at least",
        ),
        (
            "mould",
            vec![
                "--draw",
                "0,0,1",
                "--set",
                "mould.repair=fill",
                "--set",
                "mould.cores=[[0,0,0]]",
            ],
            "mould.cores",
        ),
        (
            "mould",
            vec!["--draw", "0,0,1", "--set", "mould.repair=turn"],
            "skeleton",
        ),
    ] {
        let output = command(name, folder.path(), &args);
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {stderr}");
        assert!(stderr.contains(word), "{args:?}: {stderr}");
        assert!(!folder.path().join("out").join("report.json").exists());
    }
}

#[test]
fn a_proposal_with_an_undercut_is_filled_before_its_skeleton_is_made() {
    // Along x the hole of the plate lies between material.
    let folder = tempfile::tempdir().expect("a folder");
    let args = [
        "--draw",
        "1,0,0",
        "--set",
        "mould.repair=fill",
        "--recognise",
        "off",
    ];
    let run = run_plate(folder.path(), &args);
    assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
    let report = run.report();
    assert!(number(&report, "/mould/multiple_lines_before") > 20.0);
    assert_eq!(number(&report, "/mould/multiple_lines"), 0.0);
    assert!(number(&report, "/volume/solid") > 0.98 * SIDE * SIDE * THICK);
    assert_eq!(report["topology"]["solid"]["b1"], 0);
    // Faces along the draw waver by less than a tenth of a voxel; the hole was an undercut of its whole volume.
    let left = number(&report, "/mould/undercut_volume");
    let hole = std::f64::consts::PI * HOLE * HOLE * THICK;
    assert!(left < 0.1 * hole, "{left}");
}

#[test]
fn a_core_stays_open_when_sections_grow_and_gaps_close() {
    // Along x the hole is undercut. It is narrower than the least gap, before and after the plate grows.
    let folder = tempfile::tempdir().expect("a folder");
    let args = [
        "--draw",
        "1,0,0",
        "--set",
        "mould.cores=[[0,0,2.5]]",
        "--set",
        "mould.repair=fill",
        "--set",
        "mould.min_gap=25",
        "--feeder",
        "18,0,2.5",
        "--growth",
        "0.05",
        "--recognise",
        "off",
    ];
    let run = run_plate(folder.path(), &args);
    assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
    let report = run.report();
    assert_eq!(report["topology"]["solid"]["b1"], 1);
    assert!(number(&report, "/feed/added_volume") > 100.0);
    assert_eq!(number(&report, "/mould/multiple_lines"), 0.0);
    let hole = std::f64::consts::PI * HOLE * HOLE * THICK;
    let left = number(&report, "/mould/undercut_volume");
    assert!(left > 0.6 * hole && left < 1.2 * hole, "{left} {hole}");
}

/// A prism along y as binary STL; its section is made of rectangles (low x, low z, high x, high z) that share whole edges.
fn prism(section: &[[f32; 4]], length: f32) -> Vec<u8> {
    let corners = |[a, b, c, d]: [f32; 4]| [[a, b], [c, b], [c, d], [a, d]];
    let edges = |rectangle| {
        let c = corners(rectangle);
        [0, 1, 2, 3].map(|k| [c[k], c[(k + 1) % 4]])
    };
    let all: Vec<[[f32; 2]; 2]> = section.iter().flat_map(|r| edges(*r)).collect();
    let at = |[x, z]: [f32; 2], y: f32| [x, y, z];
    let mut quads: Vec<[[f32; 3]; 4]> = Vec::new();
    for rectangle in section {
        let c = corners(*rectangle);
        quads.push(c.map(|p| at(p, 0.0)));
        quads.push([c[3], c[2], c[1], c[0]].map(|p| at(p, length)));
        for [a, b] in edges(*rectangle) {
            if !all.contains(&[b, a]) {
                quads.push([at(a, 0.0), at(a, length), at(b, length), at(b, 0.0)]);
            }
        }
    }
    let mut out = vec![0; 80];
    out.extend((2 * quads.len() as u32).to_le_bytes());
    for [a, b, c, d] in quads {
        for triangle in [[a, b, c], [a, c, d]] {
            out.extend([0; 12]);
            out.extend(triangle.iter().flatten().flat_map(|x| x.to_le_bytes()));
            out.extend([0; 2]);
        }
    }
    out
}

/// A channel 40 mm long with its open side across the draw; its lower flange is the smaller one.
fn channel(folder: &Path) -> PathBuf {
    let section = [
        [0.0, 0.0, 4.0, 4.0],
        [0.0, 4.0, 4.0, 24.0],
        [0.0, 24.0, 4.0, 28.0],
        [4.0, 0.0, 16.0, 4.0],
        [4.0, 24.0, 22.0, 28.0],
    ];
    let path = folder.join("channel.stl");
    std::fs::write(&path, prism(&section, 40.0)).expect("writes");
    path
}

/// The channel as a cantilever that is bent along z.
const BENT: &str = r#"
units = "mm-N-MPa"
[grid]
h = 2.0
[material]
young = 70000.0
nu = 0.3
[design]
space = [{ box = { min = [0, 0, 0], max = [22, 40, 28] } }]
[select]
root = { plane = { point = [0, 0, 0], normal = [0, 1, 0] } }
tip = { plane = { point = [0, 40, 0], normal = [0, 1, 0] } }
[[support]]
on = "root"
fix = "xyz"
[[case]]
name = "bend"
loads = [{ on = "tip", force = [0, 0, 1000] }]
[verify]
h = 2.0
"#;

#[test]
fn the_best_repair_has_the_least_energy_times_volume_with_cores_as_metal() {
    let folder = tempfile::tempdir().expect("a folder");
    let (part, case) = (channel(folder.path()), folder.path().join("case.toml"));
    std::fs::write(&case, BENT).expect("writes");
    let case = case.display().to_string();
    let shared = [
        "--draw",
        "0,0,1",
        "--set",
        "mould.repair=best",
        "--recognise",
        "off",
    ];
    let coarse = ["--voxel", "1.2", "--set", "report.pictures=false"];
    let run = |name: &str, more: &[&str]| {
        let args = [&shared, &coarse[..], more].concat();
        let run = reconstruct(&part, &folder.path().join(name), &args);
        assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
        run.report()
    };
    let report = run("loaded", &["--case", &case]);
    let block = &report["repairs"];
    let rows = block["variants"].as_array().expect("variants");
    let names: Vec<&str> = rows.iter().filter_map(|row| row["name"].as_str()).collect();
    assert_eq!(names, ["fill", "1-core", "1-remove", "1-turn"]);
    let of = |row: &Value, key: &str| row[key].as_f64().expect("a number");
    let price = of(block, "core_price");
    for row in rows {
        assert_eq!(of(row, "lines_repaired"), 0.0, "{row}");
        assert_eq!(row["valid"], true, "{row}");
        let metal = of(row, "volume") + of(row, "cores") * price;
        let cost = metal * of(row, "strain_energy");
        assert!((of(row, "cost") / cost - 1.0).abs() < 1e-12, "{row}");
    }
    let least = |a: &&Value, b: &&Value| of(a, "cost").total_cmp(&of(b, "cost"));
    let best = rows.iter().min_by(least).expect("rows");
    assert_eq!(best["chosen"], true);
    assert_eq!(number(&report, "/volume/solid"), of(best, "volume"));
    // Without loads nothing is taken away or turned, and with cores for nothing the least metal is the best.
    let report = run("unloaded", &["--set", "mould.core_price=0"]);
    let rows = report["repairs"]["variants"].as_array().expect("variants");
    let chosen: Vec<bool> = rows.iter().map(|row| row["chosen"] == true).collect();
    assert_eq!(chosen, [false, true]);
    assert_eq!(rows[1]["name"], "1-core");
    // A finished solid has no members to choose among.
    let refused = command("mould", folder.path(), &["--set", "mould.repair=best"]);
    assert_eq!(refused.status.code(), Some(2));
}

/// Without the smaller flange of the channel nothing has to be filled.
#[test]
fn the_lesser_of_two_members_with_a_room_between_is_removed() {
    let folder = tempfile::tempdir().expect("a folder");
    let part = channel(folder.path());
    let args = [
        "--draw",
        "0,0,1",
        "--set",
        "mould.repair=remove",
        "--recognise",
        "off",
        "--voxel",
        "0.8",
    ];
    let run = reconstruct(&part, &folder.path().join("out"), &args);
    assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
    let said = run.lines("warning: edit: the repair adds the edit {");
    assert!(
        said.len() == 1 && said[0].contains("\"delete\":true"),
        "{}",
        run.stderr
    );
    let report = run.report();
    assert_eq!(report["edits"]["edits"][0]["kind"], "delete");
    assert_eq!(number(&report, "/mould/multiple_lines"), 0.0);
    // Web and upper flange, and the foot at which the lower one was; filled it would be a block 16 mm wide and more.
    let angle = (28.0 + 22.0 - 4.0) * 4.0 * 40.0;
    let block = 28.0 * 16.0 * 40.0;
    let volume = number(&report, "/volume/solid");
    assert!(
        volume > angle && volume < 0.6 * block,
        "{volume} {angle} {block}"
    );
}
