//! Every bad file of the corpus, read and repaired: what each must give.

mod bad_corpus;

use std::path::Path;

use bad_corpus::{BRACKET, Density, Mesh, PLATE, Refused, STRAP, TABLE, Want, corpus};
use grassfire::io::{Input, ReadOptions, read_input};
use grassfire::mesh::{Repair, RepairOptions, RepairReport, repair};
use grassfire::monitor::Monitor;

/// What a file gave.
enum Outcome {
    Mesh(RepairReport),
    Density(Vec<Repair>),
    Step,
    Refused(String),
}

fn outcome(path: &Path) -> Outcome {
    let monitor = Monitor::default();
    match read_input(path, &ReadOptions::default(), &monitor) {
        Err(error) => Outcome::Refused(error.to_string()),
        Ok(Input::Step(_)) => Outcome::Step,
        Ok(Input::Density { notes, .. }) => Outcome::Density(notes),
        Ok(Input::Mesh { mesh, notes }) => {
            match repair(mesh, &RepairOptions::default(), &monitor) {
                Err(error) => Outcome::Refused(error.to_string()),
                Ok(mut repaired) => {
                    repaired.report.repairs.splice(0..0, notes);
                    Outcome::Mesh(repaired.report)
                }
            }
        }
    }
}

/// What is wrong with an outcome; nothing when it is as wanted.
fn complaint(want: Want, got: &Outcome) -> Option<String> {
    let (words, text) = match (want, got) {
        (Mesh(volume, words), Outcome::Mesh(report)) => {
            let off = report.volume / volume - 1.0;
            if off.abs() > 0.02 {
                return Some(format!(
                    "volume {} is {:.2} % off",
                    report.volume,
                    100.0 * off
                ));
            }
            (words, texts(&report.repairs))
        }
        (Density(words), Outcome::Density(notes)) => (words, texts(notes)),
        (Refused(words), Outcome::Refused(line)) => {
            if line.contains('\n') || line.len() > 400 {
                return Some(format!("not one line: {line}"));
            }
            (words, line.clone())
        }
        (_, got) => return Some(format!("gave {}", describe(got))),
    };
    let missing = words.iter().find(|word| !text.contains(*word))?;
    Some(format!("{missing:?} is not told: {text}"))
}

fn texts(repairs: &[Repair]) -> String {
    repairs
        .iter()
        .map(|r| r.text.as_str())
        .collect::<Vec<_>>()
        .join("; ")
}

fn describe(outcome: &Outcome) -> String {
    match outcome {
        Outcome::Mesh(r) => format!(
            "{} triangles, volume {:.5e}, {} open, {} non-manifold, {} components: {}",
            r.triangles,
            r.volume,
            r.open_edges,
            r.non_manifold_edges,
            r.components,
            texts(&r.repairs)
        ),
        Outcome::Density(notes) => format!("densities: {}", texts(notes)),
        Outcome::Step => "STEP".into(),
        Outcome::Refused(line) => format!("refused: {line}"),
    }
}

#[test]
fn every_bad_file_gives_what_the_table_says() {
    let Some(corpus) = corpus() else { return };
    let mut complaints = Vec::new();
    for (name, want) in TABLE {
        let begin = std::time::Instant::now();
        let got = outcome(&corpus.join("bad").join(name));
        println!(
            "{name}: {} ms, {}",
            begin.elapsed().as_millis(),
            describe(&got)
        );
        complaints.extend(complaint(*want, &got).map(|c| format!("{name}: {c}")));
    }
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

#[test]
fn the_table_names_every_bad_file() {
    let Some(corpus) = corpus() else { return };
    let entries = std::fs::read_dir(corpus.join("bad")).expect("the folder is there");
    let names = entries
        .filter_map(Result::ok)
        .map(|e| e.file_name().to_string_lossy().into_owned());
    let unknown: Vec<String> = names
        .filter(|n| n != "INDEX.md" && !TABLE.iter().any(|(t, _)| t == n))
        .collect();
    assert!(unknown.is_empty(), "not in the table: {unknown:?}");
}

#[test]
fn strict_refuses_what_would_be_repaired_and_passes_the_clean_file() {
    let Some(corpus) = corpus() else { return };
    let strict = RepairOptions {
        strict: true,
        ..RepairOptions::default()
    };
    let monitor = Monitor::default();
    let run = |name: &str| match read_input(&corpus.join(name), &ReadOptions::default(), &monitor) {
        Ok(Input::Mesh { mesh, .. }) => repair(mesh, &strict, &monitor),
        other => panic!("{name}: {other:?}"),
    };
    assert!(run("dev/simjeb_576.obj").is_ok());
    let error = run("bad/01_open_hole.stl").expect_err("a hole needs a repair");
    assert!(error.to_string().contains("1 holes filled"), "{error}");
}

#[test]
fn clean_parts_pass_unchanged() {
    let Some(corpus) = corpus() else { return };
    let parts = [
        ("simjeb_055.obj", 8.962e4, 1),
        ("simjeb_398.obj", 6.527e4, 1),
        ("simjeb_576.obj", BRACKET, 1),
        ("simjeb_623.obj", 4.697e4, 1),
        ("abc_00000125_strap.obj", STRAP, 1),
        ("featuretype.stl", PLATE, 1),
        ("ge_design_domain.stl", 4.78e5, 1),
        ("ge_rigid_domain.stl", 1.291e4, 1),
        ("ge_solid_domain.stl", 4870.0, 6),
        ("topadd_bracket_DES.stl", 4.858e6, 1),
        ("topadd_bracket_FIX.stl", 2.008e4, 4),
        ("topadd_bracket_LOD.stl", 5020.0, 1),
    ];
    for (name, volume, components) in parts {
        let got = outcome(&corpus.join("dev").join(name));
        println!("{name}: {}", describe(&got));
        let Outcome::Mesh(report) = got else {
            panic!("{name} is refused")
        };
        assert!(
            (report.volume / volume - 1.0).abs() < 2e-3,
            "{name}: {}",
            report.volume
        );
        assert_eq!(report.components, components, "{name}");
        assert!(
            !report.repairs.iter().any(|r| r.kind.changes_mesh()),
            "{name}: {}",
            texts(&report.repairs)
        );
    }
}

#[test]
fn repaired_meshes_do_not_depend_on_the_thread_count() {
    let Some(corpus) = corpus() else { return };
    let run = |threads: usize, name: &str| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("a small pool");
        let path = corpus.join("bad").join(name);
        pool.install(
            || match read_input(&path, &ReadOptions::default(), &Monitor::default()) {
                Ok(Input::Mesh { mesh, .. }) => {
                    repair(mesh, &RepairOptions::default(), &Monitor::default()).ok()
                }
                _ => None,
            },
        )
    };
    for name in [
        "02_open_1pct_missing.stl",
        "12_tiny_islands.stl",
        "20_unwelded_cracks.stl",
    ] {
        let one = run(1, name);
        assert!(one.is_some() && one == run(2, name), "{name}");
    }
}
