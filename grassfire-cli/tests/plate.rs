//! A plate with a hole, made here: the whole chain without the corpus, a skeleton fed back, exit codes, Ctrl-C.

mod support;

use std::time::Duration;

use serde_json::Value;
use support::{HOLE, SIDE, THICK, finish, number, plate, reconstruct, run_plate, start};

#[test]
fn plate_becomes_a_good_part() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = run_plate(folder.path(), &["--json"]);
    assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
    let printed: Value = serde_json::from_str(&run.stdout).expect("--json prints JSON");
    assert_eq!(printed, run.report());
    // The hole is a polygon with 64 corners, which takes less than a circle does.
    let hole = 32.0 * HOLE * HOLE * (std::f64::consts::TAU / 64.0).sin();
    let volume = (SIDE * SIDE - hole) * THICK;
    let off = number(&printed, "/input/volume") / volume - 1.0;
    assert!(off.abs() < 1e-6, "{off}");
    assert_eq!(printed["remesh"]["genus_after"], 1);
    assert_eq!(
        printed["topology"]["solid"],
        printed["topology"]["skeleton"]
    );
    if cfg!(feature = "occt") {
        let solid = &printed["solid"];
        assert_eq!(
            (&solid["valid"], solid["genus"].as_i64()),
            (&Value::Bool(true), Some(1))
        );
    }
    let listed = printed["files"].as_array().expect("files");
    for file in listed {
        let name = file["path"].as_str().expect("a name");
        assert!(run.output.join(name).is_file(), "{name}");
    }
}

/// The plain layout is not compared with any other; otherwise the report says which was taken, and why not the regular one.
#[test]
fn the_plain_layout_of_quads_can_be_asked_for() {
    let folder = tempfile::tempdir().expect("a folder");
    let layout = |args: &[&str]| {
        let args = [&["--recognise", "off"], args].concat();
        run_plate(folder.path(), &args).report()["skeleton"].take()
    };
    let plain = layout(&["--set", "skeleton.layout=plain"]);
    assert_eq!(plain["layout"], "plain");
    assert!(plain["regular_refused"].is_null());
    let auto = layout(&[]);
    let refused = auto["regular_refused"].is_string();
    assert_eq!(auto["layout"], if refused { "plain" } else { "regular" });
}

/// Skeletons changed with every voxel: what was edited before did not fit any more. A finer voxel brings a closer body.
#[test]
fn a_voxel_ten_percent_finer_gives_the_same_skeleton() {
    let folder = tempfile::tempdir().expect("a folder");
    let part = plate(folder.path());
    let made = |args: &[&str]| {
        let run = reconstruct(&part, &folder.path().join("out"), args);
        assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
        let skeleton = std::fs::read(run.output.join("skeleton.ply")).expect("a skeleton");
        (run.report(), skeleton)
    };
    let (first, skeleton) = made(&[]);
    let voxel = number(&first, "/distance/voxel");
    let (finer, same) = made(&["--voxel", &(0.9 * voxel).to_string()]);
    assert!(same == skeleton, "another skeleton");
    assert_eq!(number(&finer, "/skeleton/voxel"), voxel);
    assert!((number(&finer, "/distance/voxel") - 0.9 * voxel).abs() < 1e-9);
    assert!(number(&finer, "/distance/rms") < 1.1 * number(&first, "/distance/rms"));
}

/// One corner gets thicker, the far one stays; an edit of a place without skeleton is refused before anything is written.
#[test]
fn edits_thicken_their_place_only() {
    let folder = tempfile::tempdir().expect("a folder");
    let half =
        r#"edits=[{"within":{"box":{"min":[-100,-100,-100],"max":[100,-10,100]}},"scale":1.3}]"#;
    let run_with = |edits: &str| run_plate(folder.path(), &["--recognise", "off", "--set", edits]);
    let report = run_with(half).report();
    let edits = &report["edits"];
    assert!(number(edits, "/edits/0/points") >= 4.0, "{edits}");
    let radii = ["mean_before", "mean_after"].map(|key| number(edits, &format!("/edits/0/{key}")));
    assert!((radii[1] / radii[0] - 1.3).abs() < 1e-9, "{radii:?}");
    let grown = number(edits, "/volume_after") / number(edits, "/volume_before");
    assert!((1.03..1.25).contains(&grown), "{grown}");
    assert!(number(&report, "/volume/relative_difference").abs() < 0.02);
    let nowhere = r#"edits=[{"within":{"sphere":{"centre":[500,0,0],"radius":1}},"scale":1.3}]"#;
    let refused = run_with(nowhere);
    assert_eq!(refused.code, Some(2), "{}", refused.stderr);
    assert!(refused.stderr.contains("mm away"), "{}", refused.stderr);
}

/// The upper rim moves 8 mm outward, then a quarter of the ring goes: a longer C, still a good part.
#[test]
fn edits_move_and_delete_members() {
    let folder = tempfile::tempdir().expect("a folder");
    let edits = r#"edits=[{"within":{"box":{"min":[-100,15,-100],"max":[100,100,100]}},"move":[0,8,0]},
        {"within":{"box":{"min":[-100,-100,-100],"max":[0,0,100]}},"delete":true}]"#;
    let run = run_plate(folder.path(), &["--recognise", "off", "--set", edits]);
    let report = run.report();
    assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
    let done = |key: &str| report["edits"]["edits"].pointer(key).cloned();
    assert_eq!(done("/0/kind"), Some("move".into()));
    assert_eq!(done("/0/moved"), Some(8.0.into()));
    assert_eq!(done("/0/before/topology"), done("/0/after/topology"));
    assert_eq!(done("/0/largest_change"), Some(0.0.into()));
    let loops = ["/1/before/topology/b1", "/1/after/topology/b1"].map(done);
    assert_eq!(loops, [Some(1.into()), Some(0.into())]);
    assert!(run.stderr.contains("loops from 1 to 0"), "{}", run.stderr);
    assert!(run.stderr.contains("genus from 1 to 0"), "{}", run.stderr);
    // A strip of 8 mm came, less than a quarter of the ring went: what is left of it ends round.
    let strip = SIDE * 8.0 * THICK;
    let quarter = (SIDE * SIDE / 4.0 - HOLE * HOLE * std::f64::consts::FRAC_PI_4) * THICK;
    let volume = |when: &str| number(&report, &format!("/edits/volume_{when}"));
    let came = volume("after") - volume("before");
    let wanted = strip - quarter;
    assert!((came - wanted).abs() < 0.25 * quarter, "{came} {wanted}");
    assert_eq!(
        report["body"]["self_intersections"], 0,
        "{}",
        report["body"]
    );
    if cfg!(feature = "occt") {
        assert_eq!(report["solid"]["valid"], true);
    }
}

/// A second plate above the first, and walls from outer rim to outer rim: a box with a hole in its lid and in its bottom.
#[test]
fn edits_copy_and_bridge_members() {
    let folder = tempfile::tempdir().expect("a folder");
    let edits =
        r#"edits=[{"duplicate":[0,0,14]},{"bridge":{"from":[17.5,0,16.5],"to":[17.5,0,2.5]}}]"#;
    let run = run_plate(folder.path(), &["--recognise", "off", "--set", edits]);
    assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
    let report = run.report();
    let pieces = |n: usize| report["edits"]["edits"][n]["after"]["topology"]["b0"].clone();
    assert_eq!([pieces(0), pieces(1)], [2, 1]);
    let topology = &report["topology"]["solid"];
    assert_eq!((&topology["b0"], &topology["b1"]), (&1.into(), &2.into()));
    assert_eq!(
        report["body"]["self_intersections"], 0,
        "{}",
        report["body"]
    );
}

#[test]
fn skeleton_comes_back_as_ply_and_as_obj() {
    let folder = tempfile::tempdir().expect("a folder");
    // With its bore cut out the plate is one ring of members, which an OBJ cannot hold.
    let first = run_plate(folder.path(), &["--recognise", "off"]);
    let (quads, topology) = {
        let report = first.report();
        (
            report["skeleton"]["quads"].clone(),
            report["topology"]["skeleton"].clone(),
        )
    };
    let ply = folder.path().join("mine.ply");
    std::fs::write(&ply, first.file("skeleton.ply")).expect("writes");
    let obj = folder.path().join("mine.obj");
    std::fs::write(&obj, obj_of(&first.file("skeleton.ply"))).expect("writes");
    for skeleton in [ply, obj] {
        let again = run_plate(
            folder.path(),
            &[
                "--recognise",
                "off",
                "--skeleton",
                &skeleton.display().to_string(),
            ],
        );
        assert!(matches!(again.code, Some(0 | 1)), "{}", again.stderr);
        let report = again.report();
        assert_eq!(report["skeleton"]["quads"], quads, "{}", skeleton.display());
        assert_eq!(
            report["topology"]["skeleton"],
            topology,
            "{}",
            skeleton.display()
        );
        assert!(number(&report, "/volume/relative_difference").abs() < 0.02);
        if cfg!(feature = "occt") {
            assert_eq!(report["solid"]["valid"], true);
        }
    }
}

/// The points and quads of a text PLY as OBJ, as a modeller would export them: without radii.
fn obj_of(ply: &[u8]) -> String {
    let text = String::from_utf8_lossy(ply);
    let (header, body) = text.split_once("end_header\n").expect("a text PLY");
    assert!(header.contains("format ascii"), "{header}");
    let count = |name: &str| {
        let line = header.lines().find_map(|line| line.strip_prefix(name));
        line.and_then(|n| n.trim().parse::<usize>().ok())
            .unwrap_or(0)
    };
    let lines: Vec<Vec<&str>> = body
        .lines()
        .map(|line| line.split_whitespace().collect())
        .collect();
    let (points, faces) = (count("element vertex "), count("element face "));
    let mut obj = String::new();
    for point in &lines[..points] {
        obj += &format!("v {}\n", point[..3].join(" "));
    }
    for face in &lines[points..points + faces] {
        let corners = face[1..5]
            .iter()
            .map(|v| v.parse::<usize>().expect("an index") + 1);
        obj += &format!(
            "f {}\n",
            corners.map(|v| v.to_string()).collect::<Vec<_>>().join(" ")
        );
    }
    obj
}

#[test]
fn a_stage_that_fails_ends_with_3() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = run_plate(folder.path(), &["--set", "retry.quad_sizes=[]"]);
    assert_eq!(run.code, Some(3), "{}", run.stderr);
    assert_eq!(
        (run.lines("error: ").len(), run.lines("hint: ").len()),
        (1, 1),
        "{}",
        run.stderr
    );
    assert!(!run.output.join("part.step").exists() && !run.output.join("report.json").exists());
}

#[test]
fn a_missed_check_ends_with_1_and_everything_is_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = run_plate(folder.path(), &["--set", "report.limits.distance_rms=0"]);
    assert_eq!(run.code, Some(1), "{}", run.stderr);
    assert!(
        run.stdout.contains("not met") && run.stdout.contains("distance.rms"),
        "{}",
        run.stdout
    );
    assert!(run.output.join("report.html").is_file() && run.output.join("body.obj").is_file());
}

#[test]
fn fewest_faces_are_as_smooth_and_stay_near() {
    let folder = tempfile::tempdir().expect("a folder");
    let faces = |mode: &str| {
        let run = run_plate(folder.path(), &["--faces", mode]);
        assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
        run.report()
    };
    let [exact, fewest, quads] = ["exact", "fewest", "quads"].map(faces);
    if cfg!(feature = "occt") {
        let count = |report: &Value| number(report, "/solid/faces");
        assert!(count(&fewest) <= count(&exact) && count(&exact) < count(&quads));
        for report in [&exact, &fewest, &quads] {
            assert!(number(report, "/solid/g1_max") <= 0.01);
            let jump = number(report, "/solid/curvature_jump/max");
            assert!(jump.is_finite() && number(report, "/solid/curvature_jump/rms") <= jump);
        }
        assert!(number(&fewest, "/solid/faces_deviation") <= 0.5 * 0.8);
        assert!(exact["solid"].get("faces_deviation").is_none());
    }
}

/// A cube of 4 mm with its low corner at `x` as a text STL.
fn cube(x: f64) -> String {
    let quads = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let mut text = "solid cube\n".to_owned();
    for [a, b, c, d] in quads {
        for triangle in [[a, b, c], [a, c, d]] {
            text += "facet normal 0 0 0\nouter loop\n";
            for corner in triangle {
                let at = |d: u32| f64::from(corner >> d & 1) * 4.0;
                text += &format!("vertex {} {} {}\n", x + at(0), at(1), at(2));
            }
            text += "endloop\nendfacet\n";
        }
    }
    text + "endsolid cube\n"
}

#[test]
fn a_body_that_cannot_be_united_ends_with_1_and_lies_beside_the_part() {
    let folder = tempfile::tempdir().expect("a folder");
    let loose = folder.path().join("loose.stl");
    std::fs::write(&loose, cube(60.0)).expect("writes");
    let run = run_plate(
        folder.path(),
        &["--non-design", &loose.display().to_string()],
    );
    if cfg!(feature = "occt") {
        assert_eq!(run.code, Some(1), "{}{}", run.stdout, run.stderr);
        let report = run.report();
        assert_eq!(report["solid"]["valid"], false);
        assert_eq!(report["solid"]["bodies"], 2);
        assert!(run.stderr.contains("does not overlap"), "{}", run.stderr);
        let step = String::from_utf8_lossy(&run.file("part.step")).into_owned();
        assert!(step.contains("NOT VALID"));
    }
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_with_130_and_leaves_no_half_written_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = folder.path().join("out");
    // Fine enough to run for a while after the first file.
    let child = start(&plate(folder.path()), &output, &["--voxel", "0.25"]);
    let begin = std::time::Instant::now();
    while !output.join("proposal.stl").exists() && begin.elapsed() < Duration::from_secs(300) {
        std::thread::sleep(Duration::from_millis(5));
    }
    // The shell's own kill: a bare machine has no program of that name.
    let kill = std::process::Command::new("sh")
        .args(["-c", &format!("kill -INT {}", child.id())])
        .status();
    assert!(kill.expect("the shell runs").success());
    let run = finish(child, &output);
    assert_eq!(run.code, Some(130), "{}", run.stderr);
    assert!(!output.join("report.json").exists() && !output.join("part.step").exists());
    let names: Vec<String> = std::fs::read_dir(&output)
        .expect("the folder is there")
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .collect();
    let whole = [
        "proposal.stl",
        "poles.ply",
        "thickness.ply",
        "medial.ma",
        "skeleton.ply",
        "body.obj",
        "body.stl",
    ];
    assert!(
        names.iter().all(|name| whole.contains(&name.as_str())),
        "{names:?}"
    );
    let proposal = run.file("proposal.stl");
    let triangles = u32::from_le_bytes([proposal[80], proposal[81], proposal[82], proposal[83]]);
    assert_eq!(proposal.len(), 84 + 50 * triangles as usize);
}
