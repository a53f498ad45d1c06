//! Which format a file has: by content first, by extension second.

use super::source::{Source, find, parse, quote, tokens};
use super::{IoError, stl};

/// A format that can be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Format {
    StlAscii,
    StlBinary,
    Obj,
    Ply,
    Off,
    ThreeMf,
    Step,
    Vtk,
    Npy,
}

/// Beginnings of files that people hand in by mistake.
const FOREIGN: &[(&[u8], &str)] = &[
    (b"\x89PNG", "a PNG picture"),
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"GIF8", "a GIF picture"),
    (b"%PDF", "a PDF document"),
    (b"\x1f\x8b", "a gzip archive"),
    (b"7z\xbc\xaf", "a 7z archive"),
    (b"Rar!", "a RAR archive"),
    (b"\x7fELF", "a program"),
    (b"MZ", "a program"),
    (b"\x89HDF", "an HDF5 file"),
    (
        b"# vtk DataFile",
        "a legacy VTK file (save it as .vti or .vtu)",
    ),
    (b"glTF", "a glTF file"),
    (b"<!DOCTYPE", "a web page"),
    (b"<html", "a web page"),
];

/// Bytes looked at when text is told from binary data.
const HEAD: usize = 4096;

pub(super) fn detect(src: &Source) -> Result<Format, IoError> {
    let bytes = src.bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(src.bytes);
    if bytes.is_empty() {
        return Err(IoError::Empty {
            file: src.file(),
            what: "0 bytes",
        });
    }
    if let Some(format) = by_magic(bytes) {
        return Ok(format);
    }
    let extension = extension(src.name);
    let expected = match extension.as_str() {
        "stl" => "an STL file",
        "obj" => "an OBJ file",
        "ply" => "a PLY file",
        "off" => "an OFF file",
        "3mf" => "a 3MF file",
        "step" | "stp" => "a STEP file",
        "vti" | "vtu" => "a VTK XML file",
        "npy" => "an NPY file",
        _ => "a readable file",
    };
    let not = |found: String| IoError::NotA {
        file: src.file(),
        expected,
        found,
    };
    // The exact size proves a binary STL, whatever its 80 free header bytes look like.
    if stl::has_exact_binary_size(bytes) {
        return Ok(Format::StlBinary);
    }
    if let Some((_, what)) = FOREIGN.iter().find(|(magic, _)| bytes.starts_with(magic)) {
        return Err(not(format!("it begins like {what}")));
    }
    if is_text(bytes) {
        return match extension.as_str() {
            _ if starts_with_word(bytes, b"solid") => Ok(Format::StlAscii),
            "obj" => Ok(Format::Obj),
            _ if looks_like_obj(bytes) => Ok(Format::Obj),
            _ => Err(not(format!(
                "the text begins with {}",
                quote(first_line(bytes))
            ))),
        };
    }
    if (extension == "stl" || starts_with_word(bytes, b"solid")) && stl::is_plausible_binary(bytes)
    {
        return Ok(Format::StlBinary);
    }
    Err(not(format!(
        "it begins with the bytes {}",
        quote(&bytes[..bytes.len().min(8)])
    )))
}

fn by_magic(bytes: &[u8]) -> Option<Format> {
    let head = &bytes[..bytes.len().min(HEAD)];
    let first = tokens(head).next().unwrap_or_default();
    if bytes.starts_with(b"\x93NUMPY") {
        Some(Format::Npy)
    } else if bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(b"PK\x05\x06") {
        Some(Format::ThreeMf)
    } else if first == b"ply" {
        Some(Format::Ply)
    } else if first.starts_with(b"ISO-10303-21") {
        Some(Format::Step)
    } else if first.ends_with(b"OFF") && first.len() <= 7 {
        Some(Format::Off)
    } else if find(head, b"<VTKFile").is_some() {
        Some(Format::Vtk)
    } else {
        None
    }
}

fn extension(name: &str) -> String {
    std::path::Path::new(name)
        .extension()
        .map(|e| e.to_string_lossy().to_lowercase())
        .unwrap_or_default()
}

/// No zero byte and hardly a control character in the first bytes.
fn is_text(bytes: &[u8]) -> bool {
    let head = &bytes[..bytes.len().min(HEAD)];
    let control = head
        .iter()
        .filter(|b| b.is_ascii_control() && !b.is_ascii_whitespace())
        .count();
    !head.contains(&0) && control * 100 <= head.len()
}

fn starts_with_word(bytes: &[u8], word: &[u8]) -> bool {
    let start = bytes
        .iter()
        .position(|b| !b.is_ascii_whitespace())
        .unwrap_or(0);
    bytes[start..]
        .get(..word.len())
        .is_some_and(|w| w.eq_ignore_ascii_case(word))
}

fn first_line(bytes: &[u8]) -> &[u8] {
    bytes
        .split(|&b| b == b'\n' || b == b'\r')
        .find(|l| !l.trim_ascii().is_empty())
        .unwrap_or_default()
        .trim_ascii()
}

/// The first line that says something begins a point or is a keyword of the format.
fn looks_like_obj(bytes: &[u8]) -> bool {
    let head = &bytes[..bytes.len().min(HEAD)];
    let lines = head.split(|&b| b == b'\n').map(<[u8]>::trim_ascii);
    let Some(line) = lines
        .into_iter()
        .find(|l| !l.is_empty() && !l.starts_with(b"#"))
    else {
        return false;
    };
    let mut words = tokens(line);
    match words.next().unwrap_or_default() {
        b"mtllib" | b"usemtl" | b"o" | b"g" => true,
        b"v" | b"vn" | b"vt" => words.next().is_some_and(|w| parse::<f64>(w).is_some()),
        _ => false,
    }
}
