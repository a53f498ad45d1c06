//! `grassfire demo`: the whole chain on a project file that is part of the program.

mod table;
mod variants;

use std::fmt::Write;
use std::path::{Path, PathBuf};

use grassfire::io::atomic_write;
use grassfire::pipeline::{self, RunJob};
use grassfire::report::Report;

use crate::args::{DemoArgs, Example};
use crate::failure::Failure;
use crate::{case, run};

const WISHBONE: &str = include_str!("../../examples/wishbone-thick/case.toml");
const FINE: &str = include_str!("../../examples/wishbone-fine/case.toml");

/// Table 1 of Mayer, Denk and Wartzack 2023: volume mm3, largest displacement mm, strain energy J, their product kJ mm3.
const PAPER: [(&str, [f64; 4]); 2] = [
    ("paper, II", [62_150.0, 3.44, 29.909, 1859.0]),
    ("paper, III", [105_880.0, 1.63, 14.045, 1487.0]),
];

/// Writes the example next to the results and runs it; then shows the table of the paper beside ours.
pub fn command(args: &DemoArgs) -> Result<u8, Failure> {
    let Example::Wishbone = args.example;
    let output = args.output.clone();
    let output = output.unwrap_or_else(|| PathBuf::from("out/wishbone"));
    if args.all {
        return variants::command(&output, &args.run);
    }
    let text = if args.fine { FINE } else { WISHBONE };
    let path = unpack(&output.join("input"), "case.toml", text.as_bytes())?;
    let job = RunJob {
        case: case::load(&path, &args.run)?,
        path,
        output,
        command: run::command_line(),
        ..RunJob::default()
    };
    let mut table = String::new();
    let code = run::run(job.case.threads, &job.output, &args.run, |monitor| {
        let outcome = pipeline::run(&job, monitor)?;
        table = beside_paper(&outcome.report);
        Ok(outcome)
    })?;
    if !args.run.json && !args.run.quiet {
        run::print(&table);
    }
    Ok(code)
}

fn unpack(folder: &Path, name: &str, bytes: &[u8]) -> Result<PathBuf, Failure> {
    let path = folder.join(name);
    std::fs::create_dir_all(folder)
        .map_err(|e| Failure::usage(format!("{}: cannot be made: {e}", folder.display()), None))?;
    atomic_write(&path, |file| file.write_all(bytes))
        .map_err(|e| Failure::usage(e.to_string(), None))?;
    Ok(path)
}

/// The paper's wishbone and ours, which was rebuilt from its pictures and numbers; empty without a verification.
fn beside_paper(report: &Report) -> String {
    let Some(block) = &report.verify else {
        return String::new();
    };
    let row = |volume: f64, u: f64, energy: f64| [volume, u, energy / 1e3, energy * volume / 1e6];
    let mut rows = PAPER.to_vec();
    rows.push((
        "CAD solid",
        row(block.volume, block.u_max, block.strain_energy),
    ));
    if let Some(voxels) = &block.proposal {
        rows.push((
            "its voxels",
            row(voxels.volume, voxels.u_max, voxels.strain_energy),
        ));
    }
    let mut text = String::from(
        "\nBeside Table 1 of Mayer et al. 2023 (its wishbone is not published; ours is rebuilt from its numbers)\n",
    );
    // Writing to a String cannot fail.
    let _ = writeln!(
        text,
        "{:>12}  {:>8}  {:>8}  {:>7}  {:>11}",
        "", "V, mm3", "u, mm", "U, J", "cv, kJ mm3"
    );
    for (name, [volume, u, energy, cv]) in rows {
        let _ = writeln!(
            text,
            "{name:>12}  {volume:>8.0}  {u:>8.3}  {energy:>7.3}  {cv:>11.0}"
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use grassfire::report::VerifyBlock;

    use super::*;

    #[test]
    fn the_table_has_the_units_of_the_paper() {
        let mut report = Report::default();
        assert_eq!(beside_paper(&report), "");
        report.verify = Some(VerifyBlock {
            volume: 62_150.0,
            u_max: 3.44,
            strain_energy: 29_909.0,
            ..VerifyBlock::default()
        });
        let text = beside_paper(&report);
        let line = |name: &str| {
            let found = text.lines().find_map(|l| l.trim_start().strip_prefix(name));
            found.map(str::to_owned)
        };
        assert!(line("CAD solid").is_some());
        let numbers = |name| line(name).map(|l| l.trim().to_owned());
        assert_eq!(numbers("CAD solid"), numbers("paper, II "));
    }
}
