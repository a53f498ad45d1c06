//! Quick checks of a STEP file (ISO 10303-21) before the CAD kernel sees it.

use super::IoError;
use super::source::Source;

/// Checks what a damaged file gets wrong:
///
/// 1. it ends with `END-ISO-10303-21;`, so it was not cut short, 2. it has a section `DATA` with entities,
/// 3. every `#id` that an entity refers to is defined.
///
/// Strings and comments are skipped. Geometry is left to the CAD kernel.
pub(super) fn check(src: &Source) -> Result<(), IoError> {
    let scan = scan(src)?;
    if let Some(line) = scan.open {
        return Err(src.line(
            line,
            "a string or comment begins here and never ends: the file was cut short",
        ));
    }
    if !scan.ended {
        let line = scan.lines;
        return Err(src.line(
            line,
            "the file ends without `END-ISO-10303-21;`: it was cut short",
        ));
    }
    if scan.defined.is_empty() {
        return Err(IoError::Empty {
            file: src.file(),
            what: "no entities",
        });
    }
    let mut defined: Vec<u64> = scan.defined;
    defined.sort_unstable();
    if let Some(twice) = defined.windows(2).find(|pair| pair[0] == pair[1]) {
        return Err(src.format(format!("#{} is defined twice", twice[0])));
    }
    let missing = scan
        .used
        .iter()
        .filter(|(id, _)| defined.binary_search(id).is_err());
    let count = missing.clone().count();
    match missing.min_by_key(|(_, line)| *line) {
        Some(&(id, line)) => Err(IoError::DanglingReference {
            file: src.file(),
            line,
            id,
            count,
        }),
        None => Ok(()),
    }
}

struct Scan {
    defined: Vec<u64>,
    /// Id and line of each reference.
    used: Vec<(u64, usize)>,
    ended: bool,
    lines: usize,
    /// Line of a string or comment that does not end.
    open: Option<usize>,
}

fn scan(src: &Source) -> Result<Scan, IoError> {
    let bytes = src.bytes;
    let mut scan = Scan {
        defined: Vec::new(),
        used: Vec::new(),
        ended: false,
        lines: 1,
        open: None,
    };
    let mut at = 0;
    while let Some(&b) = bytes.get(at) {
        match b {
            b'\n' => {
                scan.lines += 1;
                if scan.lines.is_multiple_of(100_000) {
                    src.monitor.check()?;
                }
                at += 1;
            }
            // A doubled quote inside a string reads as two strings in a row, which skips the same bytes.
            b'\'' => at = skip(&mut scan, bytes, at, 1, b"'"),
            b'/' if bytes.get(at + 1) == Some(&b'*') => at = skip(&mut scan, bytes, at, 2, b"*/"),
            b'#' => at = reference(&mut scan, bytes, at),
            b'E' if bytes[at..].starts_with(b"END-ISO-10303-21") => {
                scan.ended = true;
                at += 16;
            }
            _ => at += 1,
        }
    }
    Ok(scan)
}

/// Moves behind `end`, which is looked for from `at + opening`.
fn skip(scan: &mut Scan, bytes: &[u8], at: usize, opening: usize, end: &[u8]) -> usize {
    let start = (at + opening).min(bytes.len());
    let inner = &bytes[start..];
    let found = inner.windows(end.len()).position(|w| w == end);
    if found.is_none() {
        scan.open = Some(scan.lines);
    }
    let length = found.unwrap_or(inner.len());
    scan.lines += inner[..length].iter().filter(|&&b| b == b'\n').count();
    (start + length + end.len()).min(bytes.len())
}

fn reference(scan: &mut Scan, bytes: &[u8], at: usize) -> usize {
    let digits = bytes[at + 1..]
        .iter()
        .take_while(|b| b.is_ascii_digit())
        .count();
    let end = at + 1 + digits;
    // Ids beyond 64 bits are legal in no program; they count as references to nothing.
    let id = bytes[at + 1..end].iter().try_fold(0u64, |n, &d| {
        n.checked_mul(10)?.checked_add(u64::from(d - b'0'))
    });
    if digits > 0 {
        let after = bytes[end..].iter().find(|b| !b.is_ascii_whitespace());
        match (id, after) {
            (Some(id), Some(b'=')) => scan.defined.push(id),
            (id, _) => scan.used.push((id.unwrap_or(u64::MAX), scan.lines)),
        }
    }
    end
}
