//! Wavefront OBJ: polygons and polylines over points.

use std::borrow::Cow;

use super::source::{Source, parse, quote, tokens};
use super::{IoError, atomic_write};
use crate::Vec3;
use crate::mesh::{Repair, RepairKind, TriMesh};

/// What an OBJ file holds, before it is made into triangles or quads.
#[derive(Default)]
pub(super) struct ObjData {
    pub points: Vec<Vec3>,
    /// Fourth value of each `v` line; NaN where there is none.
    pub fourth: Vec<f64>,
    /// Corner indices of all polygons, one after the other.
    pub corners: Vec<u32>,
    /// Where each polygon ends in `corners`.
    pub ends: Vec<usize>,
    /// Object or group of each polygon.
    pub groups: Vec<u32>,
    /// Consecutive pairs of `l` lines.
    pub lines: Vec<[u32; 2]>,
    /// Lines of kinds that carry no geometry for us, such as free-form curves.
    pub skipped: usize,
}

impl ObjData {
    /// Corner indices of each polygon.
    pub fn polygons(&self) -> impl Iterator<Item = &[u32]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts
            .zip(&self.ends)
            .map(|(start, &end)| &self.corners[start..end])
    }
}

pub(super) fn read(src: &Source, notes: &mut Vec<Repair>) -> Result<TriMesh, IoError> {
    let data = parse_obj(src)?;
    if data.skipped > 0 {
        let text = format!(
            "{} lines of free-form curves, surfaces or unknown kinds ignored",
            data.skipped
        );
        notes.push(Repair::new(RepairKind::Skipped, data.skipped, text));
    }
    let mut mesh = TriMesh::default();
    for (polygon, &group) in data.polygons().zip(&data.groups) {
        fan(polygon, &mut mesh.triangles);
        mesh.tags.resize(mesh.triangles.len(), group);
        src.check_triangles(mesh.triangles.len())?;
    }
    mesh.points = data.points;
    Ok(mesh)
}

/// Splits a polygon into triangles around its first corner.
pub(super) fn fan(polygon: &[u32], triangles: &mut Vec<[u32; 3]>) {
    if let Some((&first, rest)) = polygon.split_first() {
        triangles.extend(rest.windows(2).map(|pair| [first, pair[0], pair[1]]));
    }
}

/// Reads all `v`, `f` and `l` lines. Indices may be negative (counted from the end) and may point ahead.
pub(super) fn parse_obj(src: &Source) -> Result<ObjData, IoError> {
    let mut data = ObjData::default();
    // Indices beyond the points read so far, judged at the end of the file.
    let mut ahead: Vec<(usize, u32)> = Vec::new();
    let mut group = 0u32;
    let mut lines = src.lines();
    while let Some((number, line)) = lines.next() {
        if number % 100_000 == 0 {
            src.monitor.check()?;
        }
        let mut line = Cow::Borrowed(line);
        while line.last() == Some(&b'\\') {
            line.to_mut().pop();
            let Some((_, more)) = lines.next() else { break };
            line.to_mut().push(b' ');
            line.to_mut().extend_from_slice(more);
        }
        let line = line.split(|&b| b == b'#').next().unwrap_or_default();
        let mut words = tokens(line);
        match words.next().unwrap_or_default() {
            b"v" => read_vertex(src, number, &mut words, &mut data)?,
            b"f" => {
                read_corners(src, number, &mut words, &mut data, &mut ahead)?;
                data.groups.push(group);
            }
            b"l" => read_polyline(src, number, &mut words, &mut data, &mut ahead)?,
            b"o" | b"g" => group = group.saturating_add(1),
            b"" | b"vn" | b"vt" | b"vp" | b"vc" | b"s" | b"mtllib" | b"usemtl" | b"p" => {}
            word if data.points.is_empty() && data.ends.is_empty() && !word.is_ascii() => {
                return Err(src.line(number, format!("{} is no OBJ keyword", quote(word))));
            }
            _ => data.skipped += 1,
        }
    }
    let count = data.points.len();
    match ahead.iter().find(|(_, index)| *index as usize >= count) {
        Some(&(line, index)) => Err(src.line(
            line,
            format!(
                "index {} but there are only {count} points",
                u64::from(index) + 1
            ),
        )),
        None => Ok(data),
    }
}

fn read_vertex<'t>(
    src: &Source,
    line: usize,
    words: &mut impl Iterator<Item = &'t [u8]>,
    data: &mut ObjData,
) -> Result<(), IoError> {
    let p = src.next_point(line, words)?;
    // A lone fourth value is a weight or a radius; six values are a point and its colour.
    let fourth = words.next().map(|w| src.number(line, w)).transpose()?;
    let coloured = words.next().is_some();
    data.points.push(p);
    data.fourth
        .push(fourth.filter(|_| !coloured).unwrap_or(f64::NAN));
    if data.points.len() > i32::MAX as usize {
        return Err(src.limit("the number of points", data.points.len(), i32::MAX as usize));
    }
    Ok(())
}

fn read_corners<'t>(
    src: &Source,
    line: usize,
    words: &mut impl Iterator<Item = &'t [u8]>,
    data: &mut ObjData,
    ahead: &mut Vec<(usize, u32)>,
) -> Result<(), IoError> {
    let start = data.corners.len();
    for word in words {
        let index = corner(src, line, word, data.points.len())?;
        if index as usize >= data.points.len() {
            ahead.push((line, index));
        }
        data.corners.push(index);
    }
    let count = data.corners.len() - start;
    if count < 3 {
        return Err(src.line(
            line,
            format!("a face needs 3 corners, this one has {count}"),
        ));
    }
    data.ends.push(data.corners.len());
    Ok(())
}

fn read_polyline<'t>(
    src: &Source,
    line: usize,
    words: &mut impl Iterator<Item = &'t [u8]>,
    data: &mut ObjData,
    ahead: &mut Vec<(usize, u32)>,
) -> Result<(), IoError> {
    let mut last = None;
    for word in words {
        let index = corner(src, line, word, data.points.len())?;
        if index as usize >= data.points.len() {
            ahead.push((line, index));
        }
        if let Some(last) = last {
            data.lines.push([last, index]);
        }
        last = Some(index);
    }
    Ok(())
}

/// One of `7`, `7/1`, `7//3`, `7/1/3`, `-1/...`: the point's index from 0.
fn corner(src: &Source, line: usize, word: &[u8], points: usize) -> Result<u32, IoError> {
    let mut parts = word.split(|&b| b == b'/');
    let first = parts.next().unwrap_or_default();
    let fits = parts.all(|p| p.is_empty() || parse::<i64>(p).is_some())
        && word.iter().filter(|&&b| b == b'/').count() <= 2;
    let index: i64 = match parse(first) {
        Some(index) if fits => index,
        _ => {
            return Err(src.line(
                line,
                format!(
                    "corner {} is not of the form 7, 7/1, 7//3 or 7/1/3",
                    quote(word)
                ),
            ));
        }
    };
    let from_zero = if index < 0 {
        points as i64 + index
    } else {
        index - 1
    };
    match u32::try_from(from_zero) {
        // A point takes bytes: so many cannot follow.
        Ok(found) if found as usize > src.bytes.len() => Err(src.line(
            line,
            format!("index {index} but there are only {points} points"),
        )),
        Ok(found) => Ok(found),
        Err(_) if index == 0 => Err(src.line(line, "index 0: OBJ counts from 1")),
        Err(_) => Err(src.line(
            line,
            format!("index {index} but there are only {points} points before this line"),
        )),
    }
}

/// Writes points and polygons as OBJ, atomically; every number reads back exactly.
pub(super) fn write_obj<const N: usize>(
    path: &std::path::Path,
    points: &[Vec3],
    faces: &[[u32; N]],
) -> Result<(), IoError> {
    atomic_write(path, |w| {
        for p in points {
            writeln!(w, "v {} {} {}", p.x, p.y, p.z)?;
        }
        for face in faces {
            w.write_all(b"f")?;
            for v in face {
                write!(w, " {}", u64::from(*v) + 1)?;
            }
            w.write_all(b"\n")?;
        }
        Ok(())
    })
}
