//! Errors as the user sees them: one `error:` line, and a `hint:` line where there is one.

use std::error::Error;

use grassfire::pipeline::PipelineError;

use crate::settings::SettingError;

/// Why the command stopped.
#[derive(Debug)]
pub struct Failure {
    /// The whole chain of causes on one line.
    pub message: String,
    /// What to do about it.
    pub hint: Option<String>,
    /// Exit code.
    pub code: u8,
}

impl Failure {
    /// Bad input or usage.
    pub fn usage(message: impl Into<String>, hint: Option<String>) -> Self {
        Self {
            message: message.into(),
            hint,
            code: 2,
        }
    }

    /// Prints both lines on stderr.
    pub fn print(&self) {
        eprintln!("error: {}", one_line(&self.message));
        if let Some(hint) = &self.hint {
            eprintln!("hint: {}", one_line(hint));
        }
    }
}

impl From<PipelineError> for Failure {
    fn from(error: PipelineError) -> Self {
        Self {
            message: chain(&error),
            hint: error.hint(),
            code: error.exit_code(),
        }
    }
}

impl From<SettingError> for Failure {
    fn from(error: SettingError) -> Self {
        Self::usage(error.to_string(), Some(error.hint()))
    }
}

/// `error: cause: cause`; a cause that its parent already spelt out is left out.
pub fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut at = error.source();
    while let Some(cause) = at {
        let cause_text = cause.to_string();
        if !text.ends_with(&cause_text) {
            text = format!("{text}: {cause_text}");
        }
        at = cause.source();
    }
    text
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Turns clap's message into our two lines; the usage goes into the hint.
pub fn from_clap(error: &clap::Error) -> Failure {
    let text = error.render().to_string();
    let body = text.strip_prefix("error: ").unwrap_or(&text);
    let message = body.split("\n\n").next().unwrap_or(body);
    let line = |start: &str| {
        text.lines()
            .find_map(|line| line.trim().strip_prefix(start).map(str::to_owned))
    };
    let hint = line("tip: ")
        .or_else(|| line("Usage: ").map(|usage| format!("usage: {usage}")))
        .unwrap_or_else(|| "`grassfire --help` shows the usage".to_owned());
    Failure::usage(message, Some(hint))
}

#[cfg(test)]
mod tests {
    use grassfire::pipeline::StageError;

    use super::*;

    #[test]
    fn chain_names_every_cause_once() {
        let source = StageError::StepProposal {
            path: "part.step".into(),
        };
        let failure = Failure::from(PipelineError {
            stage: "read",
            source,
        });
        assert_eq!(
            failure.message,
            "read: part.step is a STEP file; the proposal must be a mesh or a density"
        );
        assert_eq!(failure.code, 2);
        assert!(failure.hint.is_some());
        assert_eq!(one_line("a\n  b"), "a b");
    }
}
