//! Progress, cancellation and warnings: one object handed through all stages.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use serde::Serialize;

/// The user asked to stop (Ctrl-C or the page's cancel button).
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("cancelled")]
pub struct Cancelled;

/// Partial trouble that goes into the report.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Warning {
    /// Stage that met it, as in `report.json`.
    pub stage: String,
    /// What happened, where, the value and the limit.
    pub text: String,
}

/// Receives progress; the command line draws a bar, the page sends an event.
pub trait Progress: Send + Sync {
    /// `done` of 0..=1 within `stage`; `what` is a short phrase such as "Delaunay".
    fn update(&self, stage: &str, what: &str, done: f64);
}

/// Progress, cancellation and warnings of one run. Cheap to share by reference between threads.
#[derive(Default)]
pub struct Monitor {
    cancelled: AtomicBool,
    warnings: Mutex<Vec<Warning>>,
    progress: Option<Box<dyn Progress>>,
}

impl Monitor {
    /// A monitor that reports progress to `progress`.
    pub fn with_progress(progress: Box<dyn Progress>) -> Self {
        Self {
            progress: Some(progress),
            ..Self::default()
        }
    }

    /// Asks all stages to stop at their next [`Monitor::check`].
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// `Err(Cancelled)` once [`Monitor::cancel`] was called; stages call it in every long loop.
    pub fn check(&self) -> Result<(), Cancelled> {
        if self.cancelled.load(Ordering::Relaxed) {
            Err(Cancelled)
        } else {
            Ok(())
        }
    }

    /// Tells how far `stage` is and checks for cancellation.
    pub fn step(&self, stage: &str, what: &str, done: f64) -> Result<(), Cancelled> {
        if let Some(progress) = &self.progress {
            progress.update(stage, what, done);
        }
        self.check()
    }

    /// Records partial trouble for the report.
    pub fn warn(&self, stage: &str, text: impl Into<String>) {
        let warning = Warning {
            stage: stage.to_owned(),
            text: text.into(),
        };
        if let Ok(mut list) = self.warnings.lock() {
            list.push(warning);
        }
    }

    /// Forgets the warnings, so that the next of several runs starts without them.
    pub fn clear_warnings(&self) {
        self.keep_warnings(0);
    }

    /// Forgets all warnings but the first `count`.
    pub fn keep_warnings(&self, count: usize) {
        if let Ok(mut list) = self.warnings.lock() {
            list.truncate(count);
        }
    }

    /// All warnings so far, in order.
    pub fn warnings(&self) -> Vec<Warning> {
        self.warnings
            .lock()
            .map(|list| list.clone())
            .unwrap_or_default()
    }
}
