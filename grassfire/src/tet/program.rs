//! Programs outside.

use std::fs::File;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use super::TetError;
use crate::monitor::Monitor;

/// How often a running program is looked at.
const LOOK: Duration = Duration::from_millis(50);
/// How much of what it printed goes into a message, characters.
const TAIL: usize = 300;

/// Runs a program in a folder until it ends; its output goes into `log` there. It is ended when the user stops the run or its time is
/// up.
pub(super) fn run(
    program: &str,
    arguments: &[&str],
    folder: &Path,
    log: &str,
    patience: f64,
    monitor: &Monitor,
) -> Result<(), TetError> {
    let refused = |reason: String| TetError::Program {
        program: program.to_owned(),
        reason,
    };
    let path = folder.join(log);
    let out = File::create(&path).map_err(|e| refused(e.to_string()))?;
    let errors = out.try_clone().map_err(|e| refused(e.to_string()))?;
    let mut child = Command::new(program)
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(out)
        .stderr(errors)
        .spawn()
        .map_err(|e| refused(e.to_string()))?;
    let begin = Instant::now();
    let failed = |how: String| {
        let printed = std::fs::read(&path).unwrap_or_default();
        let text = String::from_utf8_lossy(&printed);
        let skip = text.chars().count().saturating_sub(TAIL);
        TetError::ProgramFailed {
            program: program.to_owned(),
            how,
            said: text
                .chars()
                .skip(skip)
                .collect::<String>()
                .trim()
                .replace('\n', "; "),
        }
    };
    loop {
        match child.try_wait() {
            Ok(Some(status)) if status.success() => return Ok(()),
            Ok(Some(status)) => return Err(failed(format!("ended with {status}"))),
            Ok(None) => {}
            Err(e) => return Err(refused(e.to_string())),
        }
        let late = begin.elapsed().as_secs_f64() > patience;
        let stopped = monitor.check();
        if late || stopped.is_err() {
            // It may have ended meanwhile; then there is nothing to end.
            let _ = child.kill();
            let _ = child.wait();
            stopped?;
            return Err(failed(format!("did not end within {patience:.0} s")));
        }
        std::thread::sleep(LOOK);
    }
}
