//! Runs the program with a hang guard and gives its report back.

#![allow(
    dead_code,
    reason = "each test program uses its own part of this module"
)]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

/// A run that takes longer hangs: ten times what the slowest part needs, so that a busy machine does not matter.
const HANG: Duration = Duration::from_secs(600);
const POLL: Duration = Duration::from_millis(20);

/// What a run gave.
pub struct Run {
    /// Exit code; none when a signal ended it.
    pub code: Option<i32>,
    /// What it printed.
    pub stdout: String,
    /// Messages, warnings and errors.
    pub stderr: String,
    /// Its folder for results.
    pub output: PathBuf,
    /// Highest memory, MB; 0 where the system does not tell.
    pub peak_memory: f64,
    /// How long it took.
    pub seconds: f64,
    /// How long the processors worked for it, s; 0 where the system does not tell.
    pub processor_seconds: f64,
}

impl Run {
    /// The bytes of a file in the result folder.
    pub fn file(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.output.join(name))
            .unwrap_or_else(|e| panic!("{name}: {e}\n{}", self.stderr))
    }

    /// `report.json`.
    pub fn report(&self) -> Value {
        serde_json::from_slice(&self.file("report.json")).expect("report.json is JSON")
    }

    /// Lines of stderr that begin so.
    pub fn lines(&self, start: &str) -> Vec<&str> {
        self.stderr
            .lines()
            .filter(|line| line.starts_with(start))
            .collect()
    }
}

/// A number of a report, such as `/solid/volume`.
pub fn number(report: &Value, pointer: &str) -> f64 {
    report
        .pointer(pointer)
        .and_then(Value::as_f64)
        .unwrap_or(f64::NAN)
}

/// Starts `grassfire reconstruct PART -o OUTPUT` without pictures; stdout and stderr go to files beside `output`.
pub fn start(part: &Path, output: &Path, args: &[&str]) -> Child {
    let log = |end: &str| {
        std::fs::File::create(output.with_extension(end)).expect("the folder can be written to")
    };
    Command::new(env!("CARGO_BIN_EXE_grassfire"))
        .arg("reconstruct")
        .arg(part)
        .arg("-o")
        .arg(output)
        .args(["--set", "report.pictures=false"])
        .args(args)
        .stdin(Stdio::null())
        .stdout(log("stdout"))
        .stderr(log("stderr"))
        .spawn()
        .expect("the program starts")
}

/// Waits for a started run; one that hangs is ended and fails the test.
pub fn finish(mut child: Child, output: &Path) -> Run {
    let begin = Instant::now();
    let (mut peak_memory, mut processor_seconds): (f64, f64) = (0.0, 0.0);
    let status = loop {
        peak_memory = peak_memory.max(memory(child.id()));
        processor_seconds = processor_seconds.max(work(child.id()));
        if let Some(status) = child.try_wait().expect("the program can be waited for") {
            break status;
        }
        if begin.elapsed() > HANG {
            child.kill().expect("the program can be ended");
            panic!("{} hangs", output.display());
        }
        std::thread::sleep(POLL);
    };
    let text =
        |end: &str| std::fs::read_to_string(output.with_extension(end)).expect("the log is there");
    Run {
        code: status.code(),
        stdout: text("stdout"),
        stderr: text("stderr"),
        output: output.to_owned(),
        peak_memory,
        seconds: begin.elapsed().as_secs_f64(),
        processor_seconds,
    }
}

/// Runs `grassfire reconstruct PART -o OUTPUT` to its end.
pub fn reconstruct(part: &Path, output: &Path, args: &[&str]) -> Run {
    finish(start(part, output, args), output)
}

/// Largest resident set of a running process so far, MB.
fn memory(process: u32) -> f64 {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))
        .unwrap_or_default();
    line.split_whitespace()
        .next()
        .and_then(|kb| kb.parse::<f64>().ok())
        .map_or(0.0, |kb| kb / 1024.0)
}

/// User and system time of a running process so far, s.
fn work(process: u32) -> f64 {
    /// Linux reports in ticks of a hundredth of a second on all its platforms.
    const TICKS: f64 = 100.0;
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    // The name in brackets may hold blanks; utime and stime are the 12th and 13th fields after it.
    let fields = stat.rsplit(')').next().unwrap_or_default();
    let times = fields.split_whitespace().skip(11).take(2);
    times.filter_map(|t| t.parse::<f64>().ok()).sum::<f64>() / TICKS
}

/// Side of the plate, radius of its hole, and its thickness, mm.
pub const SIDE: f64 = 40.0;
pub const HOLE: f64 = 10.0;
pub const THICK: f64 = 5.0;

/// Writes the plate with its hole.
pub fn plate(folder: &Path) -> PathBuf {
    let path = folder.join("plate.stl");
    std::fs::write(&path, plate_with_hole(SIDE, HOLE, THICK)).expect("writes");
    path
}

/// Runs the plate at a voxel of 0.8 mm.
pub fn run_plate(folder: &Path, args: &[&str]) -> Run {
    let all: Vec<&str> = ["--voxel", "0.8"].iter().chain(args).copied().collect();
    reconstruct(&plate(folder), &folder.join("out"), &all)
}

/// A square plate with a round hole in its middle, as binary STL: genus 1, `side` and `thick` mm.
pub fn plate_with_hole(side: f64, hole: f64, thick: f64) -> Vec<u8> {
    const SEGMENTS: usize = 64;
    let ring = |k: usize, outer: bool| {
        let angle = std::f64::consts::TAU * (k % SEGMENTS) as f64 / SEGMENTS as f64;
        let (x, y) = (angle.cos(), angle.sin());
        // The outer ring lies on the square; with 64 segments the corners are among its points.
        let radius = if outer {
            0.5 * side / x.abs().max(y.abs())
        } else {
            hole
        };
        [radius * x, radius * y]
    };
    let mut triangles: Vec<[[f64; 3]; 3]> = Vec::new();
    let mut quad = |a: [f64; 3], b: [f64; 3], c: [f64; 3], d: [f64; 3]| {
        triangles.extend([[a, b, c], [a, c, d]]);
    };
    for k in 0..SEGMENTS {
        let at = |n: usize, outer: bool, z: f64| {
            let [x, y] = ring(n, outer);
            [x, y, z]
        };
        let corners = |outer: bool, z: f64| (at(k, outer, z), at(k + 1, outer, z));
        let ((i0, i1), (o0, o1)) = (corners(false, 0.0), corners(true, 0.0));
        let ((ti0, ti1), (to0, to1)) = (corners(false, thick), corners(true, thick));
        quad(ti0, to0, to1, ti1);
        quad(i0, i1, o1, o0);
        quad(o0, o1, to1, to0);
        quad(i1, i0, ti0, ti1);
    }
    let mut bytes = vec![0_u8; 80];
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        bytes.extend([0_u8; 12]);
        for value in triangle.iter().flatten() {
            bytes.extend((*value as f32).to_le_bytes());
        }
        bytes.extend([0_u8; 2]);
    }
    bytes
}
