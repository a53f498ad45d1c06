//! Every bad file of the corpus through the program: no panic, no hang, bounded work and memory, and the exit code that its
//! damage deserves. What each file is worth is in the table that the readers' test uses.

#[path = "../../grassfire/tests/bad_corpus/mod.rs"]
#[allow(dead_code, reason = "the words of the repairs are the readers' matter")]
mod bad_corpus;
mod support;

use std::path::Path;
use std::sync::Mutex;

use bad_corpus::{BRACKET, Density, Mesh, Refused, TABLE, Want, corpus};
use support::{Run, number, reconstruct};

/// Highest memory of a run, MB.
const MEMORY: f64 = 2048.0;
/// A run that needs this many times the median processor time of all that make a part is stuck. A ratio, since the same run
/// takes 30 s on one machine and 62 s on another. What hangs for good is ended by nextest.
const WORK: f64 = 6.0;
/// Largest relative difference to the volume of the clean part.
const VOLUME: f64 = 0.02;
/// Runs at a time.
const AT_ONCE: usize = 2;

/// The default voxel where the damage may reach the later stages. What reading mends for good leaves the clean bracket, which a coarser one is enough
/// for; the bulky plate needs one of its own.
fn arguments(name: &str) -> &'static [&'static str] {
    match &name[..2] {
        "03" | "04" | "05" | "06" | "14" | "15" | "21" => &["--voxel", "1.8"],
        // The plate is in inches.
        "07" | "23" | "24" | "25" => &["--voxel", "0.06"],
        _ => &[],
    }
}

/// The volume that a file must give, mm3; 18 is below what CAD kernels resolve and is enlarged to the clean size.
fn clean_volume(name: &str, volume: f64) -> f64 {
    if name.starts_with("18") {
        BRACKET
    } else {
        volume
    }
}

/// What is wrong with a run; empty when it is as wanted.
fn complaints(name: &str, want: Want, run: &Run) -> Vec<String> {
    let mut found = Vec::new();
    if run.peak_memory > MEMORY {
        found.push(format!("{:.0} MB", run.peak_memory));
    }
    if run.stderr.contains("panicked") {
        found.push("panics".to_owned());
    }
    match want {
        Refused(_) => refused(run, &mut found),
        Mesh(volume, _) => {
            made(run, &mut found);
            kept(run, clean_volume(name, volume), &mut found);
        }
        // Voxels that touch in corners only: nothing may be left of them.
        Density(_) if name.starts_with("40") && run.code == Some(2) => refused(run, &mut found),
        Density(_) => made(run, &mut found),
    }
    found
}

/// Exit 2, one `error:` line, at most one `hint:`, nothing written.
fn refused(run: &Run, found: &mut Vec<String>) {
    if run.code != Some(2) {
        found.push(format!("ends with {:?}", run.code));
    }
    if run.lines("error: ").len() != 1 || run.lines("hint: ").len() > 1 || !run.stdout.is_empty() {
        found.push(format!("does not say so in one line: {}", run.stderr));
    }
    if run.output.exists() {
        found.push("writes something".to_owned());
    }
}

/// Exit 0 or 1 with a part.
fn made(run: &Run, found: &mut Vec<String>) {
    if !matches!(run.code, Some(0 | 1)) {
        let why = run.lines("error: ").join(" ");
        found.push(format!("ends with {:?}: {why}", run.code));
    }
    for name in ["report.json", "report.html", "body.obj", "part.stl"] {
        if !run.output.join(name).is_file() {
            found.push(format!("there is no {name}"));
        }
    }
    if cfg!(feature = "occt") && !run.output.join("part.step").is_file() {
        found.push("there is no part.step".to_owned());
    }
}

/// The volume after repair is that of the clean part.
fn kept(run: &Run, volume: f64, found: &mut Vec<String>) {
    if !run.output.join("report.json").is_file() {
        return;
    }
    let report = run.report();
    let off = |pointer: &str| (number(&report, pointer) / volume - 1.0).abs();
    let best = off("/input/volume").min(off("/remesh/volume"));
    if best.is_nan() || best > VOLUME {
        found.push(format!("its volume is {:.1} % off", 100.0 * best));
    }
}

#[test]
fn every_bad_file_ends_as_its_damage_deserves() {
    let Some(corpus) = corpus() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let waiting = Mutex::new(TABLE.iter());
    let ended = Mutex::new(Vec::new());
    let next = || waiting.lock().expect("no test panics in here").next();
    let work = || {
        while let Some((name, want)) = next() {
            let one = one(&corpus, folder.path(), name, *want);
            ended.lock().expect("no test panics in here").push(one);
        }
    };
    std::thread::scope(|scope| (0..AT_ONCE).for_each(|_| drop(scope.spawn(work))));
    let ended = ended.into_inner().expect("all threads have ended");
    let mut trouble: Vec<String> = ended.iter().flat_map(|one| one.trouble.clone()).collect();
    trouble.extend(stuck(&ended));
    assert!(trouble.is_empty(), "{}", trouble.join("\n"));
}

/// A file that has ended.
struct Ended {
    name: &'static str,
    /// Processor time, s.
    work: f64,
    makes_a_part: bool,
    trouble: Vec<String>,
}

/// Files that need far more work than a usual one.
fn stuck(ended: &[Ended]) -> Vec<String> {
    let parts = ended.iter().filter(|one| one.makes_a_part);
    let mut usual: Vec<f64> = parts.map(|one| one.work).collect();
    usual.sort_by(f64::total_cmp);
    let median = usual[usual.len() / 2];
    ended
        .iter()
        .filter(|one| one.work > WORK * median)
        .map(|one| {
            let (name, work) = (one.name, one.work);
            format!("{name}: works for {work:.0} s, the median is {median:.0} s")
        })
        .collect()
}

fn one(corpus: &Path, folder: &Path, name: &'static str, want: Want) -> Ended {
    let part = corpus.join("bad").join(name);
    let mut args = vec!["--threads", "1"];
    args.extend(arguments(name));
    let run = reconstruct(&part, &folder.join(name), &args);
    println!(
        "{name}: exit {:?}, {:.1} s ({:.1} s of work), {:.0} MB",
        run.code, run.seconds, run.processor_seconds, run.peak_memory
    );
    let trouble = complaints(name, want, &run).into_iter();
    Ended {
        name,
        work: run.processor_seconds,
        makes_a_part: matches!(run.code, Some(0 | 1)),
        trouble: trouble.map(|text| format!("{name}: {text}")).collect(),
    }
}
