//! NPY: one NumPy array, taken as densities with axes z, y, x.

use super::number::Number;
use super::source::{Source, parse, quote};
use super::{IoError, density};
use crate::Vec3;
use crate::mesh::{Repair, RepairKind};
use crate::voxel::VoxelGrid;

/// Longest header; NumPy itself stays far below.
const MAX_HEADER: usize = 1 << 16;

struct Header {
    /// Byte order, kind and size, such as `<f4`.
    descr: String,
    fortran: bool,
    shape: Vec<usize>,
    /// Where the values begin.
    body: usize,
}

/// Reads a 3-D array (a 2-D one with `extrude_layers`) of numbers in C or Fortran order.
pub(super) fn read(src: &Source, notes: &mut Vec<Repair>) -> Result<VoxelGrid<f32>, IoError> {
    let header = read_header(src)?;
    let mut shape = header.shape.clone();
    // Leading or trailing axes of length 1, as batch axes, carry nothing.
    while shape.len() > 3 && shape.contains(&1) {
        if let Some(axis) = shape.iter().position(|&n| n == 1) {
            shape.remove(axis);
        }
    }
    let layers = if shape.len() == 2 {
        src.options.extrude_layers
    } else {
        1
    };
    if shape.len() == 2 && layers > 0 {
        shape.insert(0, 1);
    }
    let &[nz, ny, nx] = shape.as_slice() else {
        return Err(IoError::Shape {
            file: src.file(),
            shape: header.shape,
        });
    };
    let count = src.check_voxels([nx, ny, nz])?;
    src.check_voxels([nx, ny, nz.saturating_mul(layers)])?;
    let data = decode(src, &header, count)?;
    let values = if header.fortran {
        transpose(&data, [nx, ny, nz])
    } else {
        data
    }
    .repeat(layers);
    let origin = src.options.origin.map_or_else(Vec3::zeros, Vec3::from);
    if src.options.spacing.is_none() {
        let text = "the file states no voxel size: 1 mm is assumed".to_owned();
        notes.push(Repair::new(RepairKind::Assumed, 1, text));
    }
    let spacing = [src.options.spacing.unwrap_or(1.0); 3];
    density::cubic(src, origin, spacing, [nx, ny, nz * layers], values, notes)
}

fn read_header(src: &Source) -> Result<Header, IoError> {
    let bytes = src.bytes;
    let cut = || src.byte(bytes.len(), "the file ends inside the header");
    let version = *bytes.get(6).ok_or_else(cut)?;
    let (start, length) = if version == 1 {
        let b = bytes.get(8..10).ok_or_else(cut)?;
        (10, usize::from(u16::from_le_bytes([b[0], b[1]])))
    } else if version <= 3 {
        let b = bytes.get(8..12).ok_or_else(cut)?;
        (12, u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize)
    } else {
        return Err(src.byte(
            6,
            format!("NPY version {version} is not known (1 to 3 are)"),
        ));
    };
    if length > MAX_HEADER {
        return Err(src.limit("the length of the header", length, MAX_HEADER));
    }
    let text = bytes.get(start..start + length).ok_or_else(cut)?;
    let bad = |key: &str| {
        src.byte(
            start,
            format!("the header has no valid `{key}`: {}", quote(text)),
        )
    };
    let descr = value_of(text, b"descr")
        .and_then(string)
        .ok_or_else(|| bad("descr"))?;
    let fortran = match value_of(text, b"fortran_order") {
        Some(rest) if rest.starts_with(b"True") => true,
        Some(rest) if rest.starts_with(b"False") => false,
        _ => return Err(bad("fortran_order")),
    };
    let shape = value_of(text, b"shape")
        .and_then(tuple)
        .ok_or_else(|| bad("shape"))?;
    Ok(Header {
        descr,
        fortran,
        shape,
        body: start + length,
    })
}

/// What follows `'key':` in the header's dictionary.
fn value_of<'a>(text: &'a [u8], key: &[u8]) -> Option<&'a [u8]> {
    let quoted = [b'\'', b'"'].map(|q| [&[q][..], key, &[q]].concat());
    let at = quoted
        .iter()
        .find_map(|k| super::source::find(text, k).map(|at| at + k.len()))?;
    let rest = text[at..].trim_ascii_start();
    Some(rest.strip_prefix(b":")?.trim_ascii_start())
}

fn string(rest: &[u8]) -> Option<String> {
    let quote = *rest.first().filter(|&&b| b == b'\'' || b == b'"')?;
    let inner = rest[1..].split(|&b| b == quote).next()?;
    Some(String::from_utf8_lossy(inner).into_owned())
}

fn tuple(rest: &[u8]) -> Option<Vec<usize>> {
    let inner = rest.strip_prefix(b"(")?.split(|&b| b == b')').next()?;
    let parts = inner
        .split(|&b| b == b',')
        .map(<[u8]>::trim_ascii)
        .filter(|p| !p.is_empty());
    parts.map(parse).collect()
}

/// The first `count` values as float32.
fn decode(src: &Source, header: &Header, count: usize) -> Result<Vec<f32>, IoError> {
    let body = src.bytes.get(header.body..).unwrap_or_default();
    let (order, kind) = header.descr.split_at_checked(1).unwrap_or_default();
    let unknown = || {
        src.byte(
            header.body,
            format!(
                "values of type {} cannot be read (numbers can)",
                quote(header.descr.as_bytes())
            ),
        )
    };
    let number = number(kind)
        .filter(|_| "<>|=".contains(order))
        .ok_or_else(unknown)?;
    let need = count.saturating_mul(number.size());
    if need > body.len() {
        let what = format!(
            "shape {:?} of {} needs {need} bytes, the file holds {}",
            header.shape,
            header.descr,
            body.len()
        );
        return Err(src.byte(src.bytes.len(), what));
    }
    let values = number.decode_all(&body[..need], order == ">");
    Ok(values.map(|value| value as f32).collect())
}

/// The type of a name such as `f4`.
fn number(kind: &str) -> Option<Number> {
    Some(match kind {
        "f4" => Number::F32,
        "f8" => Number::F64,
        "b1" | "u1" => Number::U8,
        "i1" => Number::I8,
        "u2" => Number::U16,
        "i2" => Number::I16,
        "u4" => Number::U32,
        "i4" => Number::I32,
        "u8" => Number::U64,
        "i8" => Number::I64,
        _ => return None,
    })
}

/// From z fastest to x fastest.
fn transpose(data: &[f32], [nx, ny, nz]: [usize; 3]) -> Vec<f32> {
    let mut out = Vec::with_capacity(data.len());
    for k in 0..nz {
        for j in 0..ny {
            out.extend((0..nx).map(|i| data[(i * ny + j) * nz + k]));
        }
    }
    out
}
