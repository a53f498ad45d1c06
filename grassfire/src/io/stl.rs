//! STL, text and binary.

use std::io::Write;
use std::path::Path;

use super::source::{Source, parse, quote};
use super::{IoError, atomic_write};
use crate::Vec3;
use crate::mesh::{Repair, RepairKind, TriMesh};

const HEADER: usize = 84;
const RECORD: usize = 50;

/// Number of facets that a binary header claims.
fn claimed(bytes: &[u8]) -> Option<usize> {
    let count: [u8; 4] = bytes.get(80..HEADER)?.try_into().ok()?;
    Some(u32::from_le_bytes(count) as usize)
}

pub(super) fn has_exact_binary_size(bytes: &[u8]) -> bool {
    claimed(bytes).is_some_and(|count| bytes.len() == HEADER + RECORD * count)
}

/// The first records hold sensible numbers; told from other binary data when the size does not fit.
pub(super) fn is_plausible_binary(bytes: &[u8]) -> bool {
    let Some(body) = bytes.get(HEADER..) else {
        return false;
    };
    let records = body.chunks_exact(RECORD).take(200);
    let total = records.len();
    let sensible = |x: f32| x == 0.0 || (1e-30..1e30).contains(&x.abs());
    let good = records
        .filter(|r| corners(r).iter().flatten().all(|&x| sensible(x)))
        .count();
    total > 0 && good * 10 >= total * 9
}

fn corners(record: &[u8]) -> [[f32; 3]; 3] {
    let mut out = [[0.0; 3]; 3];
    for (k, value) in record[12..48].chunks_exact(4).enumerate() {
        out[k / 3][k % 3] = f32::from_le_bytes([value[0], value[1], value[2], value[3]]);
    }
    out
}

/// Binary STL. The size of the file is believed, not the count: a count that is off is noted, a file that ends inside a record is
/// refused because what is missing cannot be known.
pub(super) fn read_binary(src: &Source, notes: &mut Vec<Repair>) -> Result<TriMesh, IoError> {
    let body = src.bytes.get(HEADER..).unwrap_or_default();
    let Some(claimed) = claimed(src.bytes) else {
        return Err(src.byte(
            src.bytes.len(),
            format!("the file ends inside the {HEADER} byte header of a binary STL"),
        ));
    };
    let (present, rest) = (body.len() / RECORD, body.len() % RECORD);
    if claimed > present && rest != 0 {
        let what = format!("the file ends inside facet {present} of {claimed}: it was cut short");
        return Err(src.byte(src.bytes.len(), what));
    }
    // Extra bytes that are no whole record are somebody's appendix; whole records are facets that the count forgot.
    let count = if rest == 0 { present } else { claimed };
    src.check_triangles(count)?;
    if count != claimed {
        let text = format!(
            "the header claims {claimed} facets, the file holds {count}: the file size is believed"
        );
        notes.push(Repair::new(RepairKind::CountMismatch, 1, text));
    } else if body.len() > count * RECORD {
        let extra = body.len() - count * RECORD;
        notes.push(Repair::new(
            RepairKind::TrailingData,
            extra,
            format!("{extra} bytes behind the last facet ignored"),
        ));
    }
    let mut mesh = soup(count);
    for (t, record) in body.chunks_exact(RECORD).take(count).enumerate() {
        if t % 100_000 == 0 {
            src.monitor.check()?;
        }
        mesh.points
            .extend(corners(record).map(|p| Vec3::from(p.map(f64::from))));
        mesh.triangles
            .push([3 * t as u32, 3 * t as u32 + 1, 3 * t as u32 + 2]);
    }
    Ok(mesh)
}

fn soup(count: usize) -> TriMesh {
    TriMesh {
        points: Vec::with_capacity(3 * count),
        triangles: Vec::with_capacity(count),
        tags: Vec::new(),
    }
}

/// Words of a text with the line of each.
struct Words<'a> {
    bytes: &'a [u8],
    at: usize,
    line: usize,
}

impl<'a> Words<'a> {
    /// The next word; empty at the end of the file. `line` is then the line of that word.
    fn next(&mut self) -> &'a [u8] {
        while let Some(b) = self.bytes.get(self.at).filter(|b| b.is_ascii_whitespace()) {
            self.line += usize::from(*b == b'\n');
            self.at += 1;
        }
        let rest = &self.bytes[self.at..];
        let length = rest
            .iter()
            .position(|b| b.is_ascii_whitespace())
            .unwrap_or(rest.len());
        self.at += length;
        &rest[..length]
    }

    fn skip_line(&mut self) {
        let rest = &self.bytes[self.at..];
        self.at += rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
    }

    fn expect(&mut self, src: &Source, wanted: &str) -> Result<(), IoError> {
        let word = self.next();
        if word.eq_ignore_ascii_case(wanted.as_bytes()) {
            Ok(())
        } else if self.at == self.bytes.len() {
            let what = format!(
                "the file ends with {} where `{wanted}` should stand: it was cut short",
                quote(word)
            );
            Err(src.line(self.line, what))
        } else {
            Err(src.line(
                self.line,
                format!("{} where `{wanted}` should stand", quote(word)),
            ))
        }
    }
}

/// Text STL, any case, any white space, any line ends; several solids become tags.
pub(super) fn read_ascii(src: &Source, notes: &mut Vec<Repair>) -> Result<TriMesh, IoError> {
    let mut words = Words {
        bytes: src.bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(src.bytes),
        at: 0,
        line: 1,
    };
    let mut mesh = TriMesh::default();
    let (mut solids, mut open) = (0u32, false);
    loop {
        let word = words.next();
        if word.eq_ignore_ascii_case(b"facet") {
            read_facet(src, &mut words, &mut mesh)?;
            mesh.tags.push(solids.saturating_sub(1));
            src.check_triangles(mesh.triangles.len())?;
            if mesh.triangles.len() % 10_000 == 0 {
                src.monitor.check()?;
            }
        } else if word.eq_ignore_ascii_case(b"solid") {
            words.skip_line();
            solids = solids.saturating_add(1);
            open = true;
        } else if word.eq_ignore_ascii_case(b"endsolid") {
            words.skip_line();
            open = false;
        } else if word.is_empty() {
            break;
        } else {
            return Err(src.line(
                words.line,
                format!("{} where `facet` or `endsolid` should stand", quote(word)),
            ));
        }
    }
    if open {
        let text = format!("line {}: `endsolid` is missing at the end", words.line);
        notes.push(Repair::new(RepairKind::MissingEnd, 1, text));
    }
    Ok(mesh)
}

fn read_facet(src: &Source, words: &mut Words, mesh: &mut TriMesh) -> Result<(), IoError> {
    words.expect(src, "normal")?;
    for _ in 0..3 {
        let word = words.next();
        // The stored normal is not used, and some exporters print it as "-nan(ind)".
        let lower = word.to_ascii_lowercase();
        if parse::<f64>(word).is_none()
            && !lower
                .windows(3)
                .any(|w| w == b"nan" || w == b"inf" || w == b"ind")
        {
            return Err(number_error(
                src,
                words.line,
                word,
                "a normal needs three numbers",
            ));
        }
    }
    words.expect(src, "outer")?;
    words.expect(src, "loop")?;
    let first = mesh.points.len() as u32;
    for _ in 0..3 {
        words.expect(src, "vertex")?;
        let mut p = Vec3::zeros();
        for a in 0..3 {
            let word = words.next();
            p[a] = parse(word).ok_or_else(|| {
                number_error(src, words.line, word, "a vertex needs three numbers")
            })?;
        }
        mesh.points.push(p);
    }
    words.expect(src, "endloop")?;
    words.expect(src, "endfacet")?;
    mesh.triangles.push([first, first + 1, first + 2]);
    Ok(())
}

fn number_error(src: &Source, line: usize, word: &[u8], rule: &str) -> IoError {
    if word.is_empty() {
        return src.line(
            line,
            format!("the file ends inside a facet, {rule}: it was cut short"),
        );
    }
    match src.number(line, word) {
        Err(IoError::Line { what, .. }) => src.line(line, format!("{what}; {rule}")),
        _ => src.line(line, rule.to_owned()),
    }
}

/// Writes a binary STL, atomically. Coordinates are rounded to float32.
///
/// # Errors
/// [`IoError::Write`].
pub fn write_stl(path: &Path, mesh: &TriMesh) -> Result<(), IoError> {
    atomic_write(path, |w| {
        let mut header = [b' '; 80];
        header[..17].copy_from_slice(b"grassfire, mm    ");
        w.write_all(&header)?;
        let too_many = || std::io::Error::other("an STL file holds at most 4294967295 triangles");
        let count = u32::try_from(mesh.triangles.len()).map_err(|_| too_many())?;
        w.write_all(&count.to_le_bytes())?;
        (0..mesh.triangles.len()).try_for_each(|t| write_facet(w, mesh.corners(t)))
    })
}

fn write_facet(w: &mut dyn Write, [a, b, c]: [Vec3; 3]) -> std::io::Result<()> {
    let normal = (b - a)
        .cross(&(c - a))
        .try_normalize(0.0)
        .unwrap_or_default();
    let mut record = [0u8; RECORD];
    for (slot, value) in record
        .chunks_exact_mut(4)
        .zip([normal, a, b, c].iter().flat_map(|p| p.iter()))
    {
        slot.copy_from_slice(&(*value as f32).to_le_bytes());
    }
    w.write_all(&record)
}
