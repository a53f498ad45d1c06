//! Times and memory of the stages, and the report that grows with them.

use std::time::Instant;

use super::error::{PipelineError, StageError};
use crate::monitor::Monitor;
use crate::report::{Check, Limits, Report, StageEntry, judge, papers};

/// The report under construction.
pub(super) struct Record {
    pub(super) report: Report,
}

impl Record {
    pub(super) fn start(command: &str) -> Self {
        let report = Report {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            command: command.to_owned(),
            ..Report::default()
        };
        Self { report }
    }

    /// Runs one stage, notes its seconds and the process's peak memory, and names the stage in its error.
    /// A stage that runs again (a retry) adds to its entry.
    pub(super) fn stage<T, E>(
        &mut self,
        name: &'static str,
        run: impl FnOnce() -> Result<T, E>,
    ) -> Result<T, PipelineError>
    where
        StageError: From<E>,
    {
        let start = Instant::now();
        let result = run().map_err(|source| PipelineError {
            stage: name,
            source: source.into(),
        });
        let seconds = start.elapsed().as_secs_f64();
        let peak_memory = peak_memory();
        match self
            .report
            .stages
            .iter_mut()
            .find(|entry| entry.name == name)
        {
            Some(entry) => {
                entry.seconds += seconds;
                entry.peak_memory = peak_memory;
            }
            None => self.report.stages.push(StageEntry {
                name: name.to_owned(),
                seconds,
                peak_memory,
                cached: false,
            }),
        }
        result
    }

    /// Notes a stage whose result was taken from an earlier run.
    pub(super) fn cached(&mut self, name: &str) {
        self.report.stages.push(StageEntry {
            name: name.to_owned(),
            seconds: 0.0,
            peak_memory: peak_memory(),
            cached: true,
        });
    }

    /// Adds warnings, papers and verdicts; gives the checks that were not met, one line each.
    pub(super) fn finish(&mut self, limits: &Limits, monitor: &Monitor) -> Vec<String> {
        self.report.warnings = monitor.warnings();
        let stages: Vec<&str> = self
            .report
            .stages
            .iter()
            .map(|stage| stage.name.as_str())
            .collect();
        self.report.papers = papers::of_stages(stages)
            .iter()
            .map(|paper| paper.key.to_owned())
            .collect();
        self.report.checks = judge(&self.report, limits);
        self.report
            .checks
            .iter()
            .filter(|check| !check.met)
            .map(line)
            .collect()
    }
}

/// Largest resident set of this process so far, MB; 0 where the system does not tell.
fn peak_memory() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let kilobytes = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    kilobytes
        .and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok())
        .map_or(0.0, |kilobytes| kilobytes * 1024.0 / 1e6)
}

/// One verdict as a line of text.
fn line(check: &Check) -> String {
    let value = check
        .value
        .map_or_else(|| "not measured".to_owned(), |v| format!("{v:.4}"));
    format!(
        "{}: {} {} (limit {} {}), {}",
        check.name, value, check.unit, check.limit, check.unit, check.text
    )
}
