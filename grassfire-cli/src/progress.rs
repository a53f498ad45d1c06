//! The progress bar on stderr.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use grassfire::monitor::Progress;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// A bar appears once a stage takes longer than this.
const PATIENCE: Duration = Duration::from_secs(1);
/// Steps of the bar.
const STEPS: u64 = 1000;

/// How much to say.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Talk {
    /// Errors only.
    Quiet,
    /// A bar when stderr is a terminal.
    Normal,
    /// A line for every finished stage as well.
    Verbose,
}

/// One bar that follows the stages; nothing is drawn when stderr is not a terminal.
pub struct Bar {
    bar: ProgressBar,
    talk: Talk,
    now: Mutex<Now>,
}

struct Now {
    stage: String,
    what: String,
    started: Instant,
    shown: bool,
}

impl Bar {
    /// A bar that is not visible yet.
    pub fn new(talk: Talk) -> Self {
        let bar = ProgressBar::with_draw_target(Some(STEPS), ProgressDrawTarget::hidden());
        let line = "{prefix:>9} {bar:28.cyan/dim} {percent:>3} % {msg} {eta_text}";
        if let Ok(style) = ProgressStyle::with_template(line) {
            let left = |state: &indicatif::ProgressState, out: &mut dyn std::fmt::Write| {
                let seconds = state.eta().as_secs();
                let _ = if seconds > 0 {
                    write!(out, "({seconds} s left)")
                } else {
                    Ok(())
                };
            };
            bar.set_style(style.with_key("eta_text", left).progress_chars("━━─"));
        }
        let now = Now {
            stage: String::new(),
            what: String::new(),
            started: Instant::now(),
            shown: false,
        };
        Self {
            bar,
            talk,
            now: Mutex::new(now),
        }
    }

    /// Ends the last stage and removes the bar.
    pub fn finish(&self) {
        if let Ok(mut now) = self.now.lock() {
            self.end_stage(&now);
            now.stage.clear();
        }
        self.bar.finish_and_clear();
    }

    fn end_stage(&self, now: &Now) {
        if self.talk == Talk::Verbose && !now.stage.is_empty() {
            let line = format!(
                "{:>9} {:.1} s",
                now.stage,
                now.started.elapsed().as_secs_f64()
            );
            self.bar.suspend(|| eprintln!("{line}"));
        }
    }
}

impl Progress for Bar {
    fn update(&self, stage: &str, what: &str, done: f64) {
        if self.talk == Talk::Quiet {
            return;
        }
        let Ok(mut now) = self.now.lock() else { return };
        if now.stage != stage {
            self.end_stage(&now);
            now.stage = stage.to_owned();
            now.started = Instant::now();
            self.bar.set_prefix(stage.to_owned());
            self.bar.reset();
        }
        if now.what != what {
            now.what = what.to_owned();
            self.bar.set_message(what.to_owned());
        }
        if !now.shown && now.started.elapsed() > PATIENCE {
            self.bar
                .set_draw_target(ProgressDrawTarget::stderr_with_hz(8));
            self.bar.enable_steady_tick(Duration::from_millis(250));
            now.shown = true;
        }
        self.bar
            .set_position((done.clamp(0.0, 1.0) * STEPS as f64) as u64);
    }
}

/// Lets the pipeline's monitor and the command share one bar.
pub struct Shared(pub std::sync::Arc<Bar>);

impl Progress for Shared {
    fn update(&self, stage: &str, what: &str, done: f64) {
        self.0.update(stage, what, done);
    }
}
