//! Object File Format: points and polygons in text.

use super::IoError;
use super::obj::fan;
use super::source::{Source, quote, tokens};
use crate::mesh::{Repair, RepairKind, TriMesh};

/// Reads OFF with or without colours, normals or texture coordinates (`COFF`, `NOFF`, `STOFF`); text only.
pub(super) fn read(src: &Source, notes: &mut Vec<Repair>) -> Result<TriMesh, IoError> {
    let mut lines = src
        .lines()
        .map(|(n, line)| (n, line.split(|&b| b == b'#').next().unwrap_or_default()))
        .filter(|(_, line)| !line.trim_ascii().is_empty());
    let (line, first) = lines.next().unwrap_or_default();
    let mut words = tokens(first.strip_prefix(b"\xef\xbb\xbf").unwrap_or(first)).peekable();
    let keyword = words.next().unwrap_or_default();
    if !matches!(
        keyword,
        b"OFF" | b"COFF" | b"NOFF" | b"CNOFF" | b"STOFF" | b"STCOFF" | b"STNOFF"
    ) {
        return Err(src.line(
            line,
            format!("{} is not a kind of OFF that can be read", quote(keyword)),
        ));
    }
    if words
        .peek()
        .is_some_and(|w| w.eq_ignore_ascii_case(b"BINARY"))
    {
        return Err(src.line(line, "binary OFF cannot be read, save it as text"));
    }
    // The counts stand on the keyword's line or on the next.
    let mut counts: Vec<&[u8]> = words.collect();
    let mut at = line;
    if counts.is_empty() {
        let (n, next) = lines
            .next()
            .ok_or_else(|| src.line(line, "the counts of points and faces are missing"))?;
        (counts, at) = (tokens(next).collect(), n);
    }
    let mut counts = counts.into_iter();
    let points = src.next_index(at, &mut counts, "the count of points")?;
    let faces = src.next_index(at, &mut counts, "the count of faces")?;
    // Every line takes at least two bytes: a lie about the counts is caught before memory is asked for.
    if points.saturating_add(faces) > src.bytes.len() {
        return Err(src.line(
            at,
            format!(
                "{points} points and {faces} faces do not fit into {} bytes",
                src.bytes.len()
            ),
        ));
    }
    let mut mesh = TriMesh::default();
    let mut end = at;
    for index in 0..points {
        let (n, text) = lines
            .next()
            .ok_or_else(|| src.line(end, format!("the file ends at point {index} of {points}")))?;
        mesh.points.push(src.next_point(n, &mut tokens(text))?);
        end = n;
        if index % 100_000 == 0 {
            src.monitor.check()?;
        }
    }
    let mut flat = 0;
    let mut polygon = Vec::new();
    for index in 0..faces {
        let (n, text) = lines
            .next()
            .ok_or_else(|| src.line(end, format!("the file ends at face {index} of {faces}")))?;
        end = n;
        read_face(src, n, text, points, &mut polygon)?;
        flat += usize::from(polygon.len() < 3);
        fan(&polygon, &mut mesh.triangles);
        src.check_triangles(mesh.triangles.len())?;
        if index % 100_000 == 0 {
            src.monitor.check()?;
        }
    }
    if flat > 0 {
        let text = format!("{flat} faces with fewer than 3 corners ignored");
        notes.push(Repair::new(RepairKind::Skipped, flat, text));
    }
    Ok(mesh)
}

fn read_face(
    src: &Source,
    line: usize,
    text: &[u8],
    points: usize,
    polygon: &mut Vec<u32>,
) -> Result<(), IoError> {
    let mut words = tokens(text);
    let corners = src.next_index(line, &mut words, "the count of corners")?;
    polygon.clear();
    for _ in 0..corners {
        let index = src.next_index(line, &mut words, "a corner")?;
        if index >= points {
            return Err(src.line(
                line,
                format!("corner {index} but there are only {points} points (counted from 0)"),
            ));
        }
        polygon.push(index as u32);
    }
    Ok(())
}
