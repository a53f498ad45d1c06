//! The bytes of a file with their name, and the small text helpers that all readers share.

use super::{IoError, ReadOptions};
use crate::monitor::Monitor;

/// A file in memory.
#[derive(Clone, Copy)]
pub(super) struct Source<'a> {
    pub name: &'a str,
    pub bytes: &'a [u8],
    pub options: &'a ReadOptions,
    pub monitor: &'a Monitor,
}

impl Source<'_> {
    pub fn file(&self) -> String {
        self.name.to_owned()
    }

    pub fn line(&self, line: usize, what: impl Into<String>) -> IoError {
        IoError::Line {
            file: self.file(),
            line,
            what: what.into(),
        }
    }

    pub fn byte(&self, byte: usize, what: impl Into<String>) -> IoError {
        IoError::Byte {
            file: self.file(),
            byte,
            what: what.into(),
        }
    }

    pub fn element(&self, element: &'static str, index: usize, what: impl Into<String>) -> IoError {
        IoError::Element {
            file: self.file(),
            element,
            index,
            what: what.into(),
        }
    }

    pub fn format(&self, what: impl Into<String>) -> IoError {
        IoError::Format {
            file: self.file(),
            what: what.into(),
        }
    }

    pub fn limit(&self, what: impl Into<String>, value: usize, limit: usize) -> IoError {
        IoError::Limit {
            file: self.file(),
            what: what.into(),
            value: value as u64,
            limit: limit as u64,
        }
    }

    /// Refuses more triangles than the options allow.
    pub fn check_triangles(&self, count: usize) -> Result<(), IoError> {
        let limit = self.options.max_triangles.min(u32::MAX as usize / 3);
        if count > limit {
            Err(self.limit("the number of triangles", count, limit))
        } else {
            Ok(())
        }
    }

    /// Number of voxels of a grid, refused when the options forbid it.
    pub fn check_voxels(&self, dims: [usize; 3]) -> Result<usize, IoError> {
        let limit = self.options.max_voxels;
        let count = dims
            .iter()
            .try_fold(1usize, |n, &d| n.checked_mul(d))
            .unwrap_or(usize::MAX);
        if count > limit {
            return Err(self.limit("the number of voxels", count, limit));
        }
        if count == 0 {
            return Err(IoError::Empty {
                file: self.file(),
                what: "no voxels",
            });
        }
        Ok(count)
    }

    /// Lines with their number; ends of CRLF lines are cut.
    pub fn lines(&self) -> impl Iterator<Item = (usize, &[u8])> {
        let lines = self.bytes.split(|&b| b == b'\n').enumerate();
        lines.map(|(i, line)| (i + 1, line.strip_suffix(b"\r").unwrap_or(line)))
    }

    /// `token` as a number; a clear error otherwise.
    pub fn number(&self, line: usize, token: &[u8]) -> Result<f64, IoError> {
        match parse(token) {
            Some(value) => Ok(value),
            None if is_comma_number(token) => Err(self.line(
                line,
                format!("{} has a decimal comma, numbers need a point", quote(token)),
            )),
            None => Err(self.line(line, format!("{} is not a number", quote(token)))),
        }
    }

    /// The next token as a number; a clear error otherwise. `what` names it when it is missing.
    pub fn next_number<'t>(
        &self,
        line: usize,
        tokens: &mut impl Iterator<Item = &'t [u8]>,
        what: &str,
    ) -> Result<f64, IoError> {
        match tokens.next() {
            Some(token) => self.number(line, token),
            None => Err(self.line(line, format!("{what} is missing"))),
        }
    }

    /// The next token as a whole number of at least 0.
    pub fn next_index<'t>(
        &self,
        line: usize,
        tokens: &mut impl Iterator<Item = &'t [u8]>,
        what: &str,
    ) -> Result<usize, IoError> {
        match tokens.next() {
            Some(token) => parse(token).ok_or_else(|| {
                self.line(
                    line,
                    format!("{what} is {}, not a whole number", quote(token)),
                )
            }),
            None => Err(self.line(line, format!("{what} is missing"))),
        }
    }

    /// The next three tokens as coordinates.
    pub fn next_point<'t>(
        &self,
        line: usize,
        tokens: &mut impl Iterator<Item = &'t [u8]>,
    ) -> Result<crate::Vec3, IoError> {
        let mut p = crate::Vec3::zeros();
        for (a, what) in ["coordinate x", "coordinate y", "coordinate z"]
            .into_iter()
            .enumerate()
        {
            p[a] = self.next_number(line, tokens, what)?;
        }
        Ok(p)
    }
}

/// Non-empty pieces between white space.
pub(super) fn tokens(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(|b| b.is_ascii_whitespace())
        .filter(|t| !t.is_empty())
}

/// `token` as a value of type `T`.
pub(super) fn parse<T: std::str::FromStr>(token: &[u8]) -> Option<T> {
    std::str::from_utf8(token).ok()?.parse().ok()
}

fn is_comma_number(token: &[u8]) -> bool {
    let point: Vec<u8> = token
        .iter()
        .map(|&b| if b == b',' { b'.' } else { b })
        .collect();
    token.contains(&b',') && parse::<f64>(&point).is_some()
}

/// Text from a file for a one-line message: short and without control characters.
pub(super) fn quote(text: &[u8]) -> String {
    const MOST: usize = 40;
    let short = String::from_utf8_lossy(&text[..text.len().min(MOST)]);
    format!(
        "\"{}{}\"",
        short.escape_debug(),
        if text.len() > MOST { "..." } else { "" }
    )
}

/// Position of `needle` in `hay`.
pub(super) fn find(hay: &[u8], needle: &[u8]) -> Option<usize> {
    hay.windows(needle.len().max(1)).position(|w| w == needle)
}
