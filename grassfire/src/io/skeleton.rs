//! Quad skeletons with radii: PLY (read and written) and OBJ (read).

use std::path::Path;

use super::obj::parse_obj;
use super::ply::{corner_indices, points};
use super::ply_table::read_tables;
use super::source::{Source, find};
use super::{IoError, ReadOptions, atomic_write, read_file};
use crate::monitor::Monitor;
use crate::skeleton::Skeleton;

/// Reads a skeleton; see [`read_skeleton_bytes`].
///
/// # Errors
/// As [`read_skeleton_bytes`], and [`IoError::Open`].
pub fn read_skeleton(
    path: &Path,
    options: &ReadOptions,
    monitor: &Monitor,
) -> Result<Skeleton, IoError> {
    let bytes = read_file(path, options.max_file_bytes)?;
    read_skeleton_bytes(&path.display().to_string(), &bytes, options, monitor)
}

/// Reads a skeleton from PLY (elements `vertex` x y z radius, `face` with quads, `edge` vertex1 vertex2) or OBJ (`v x y z [radius]`,
/// `f` with four corners, `l`). A radius that is absent becomes NaN: the caller maps it from the medial axis.
///
/// # Errors
/// [`IoError::Element`] names the first face that is not a quad, the first element that uses a point twice or a missing one, and the first
/// radius that is not positive; [`IoError::Line`] and [`IoError::Byte`] for damaged files.
pub fn read_skeleton_bytes(
    name: &str,
    bytes: &[u8],
    options: &ReadOptions,
    monitor: &Monitor,
) -> Result<Skeleton, IoError> {
    let src = Source {
        name,
        bytes,
        options,
        monitor,
    };
    let mut skeleton = if bytes.starts_with(b"ply") {
        from_ply(&src)?
    } else if bytes.is_empty() {
        return Err(IoError::Empty {
            file: src.file(),
            what: "0 bytes",
        });
    } else if find(&bytes[..bytes.len().min(4096)], &[0]).is_some() {
        let found = "it is neither text nor begins with `ply`".to_owned();
        return Err(IoError::NotA {
            file: src.file(),
            expected: "a skeleton in PLY or OBJ",
            found,
        });
    } else {
        from_obj(&src)?
    };
    check(&src, &skeleton)?;
    for (p, radius) in skeleton.points.iter_mut().zip(&mut skeleton.radii) {
        *p *= options.scale;
        *radius *= options.scale;
    }
    Ok(skeleton)
}

fn from_ply(src: &Source) -> Result<Skeleton, IoError> {
    let tables = read_tables(src, &|element, property| match element {
        "vertex" => matches!(property, "x" | "y" | "z" | "radius"),
        "face" => matches!(property, "vertex_indices" | "vertex_index"),
        "edge" => matches!(property, "vertex1" | "vertex2"),
        _ => false,
    })?;
    let mut skeleton = Skeleton {
        points: points(src, &tables)?,
        ..Skeleton::default()
    };
    let count = skeleton.points.len();
    let table = |name: &str| tables.iter().find(|t| t.name == name);
    let radii = table("vertex")
        .and_then(|t| t.column("radius"))
        .filter(|c| c.values.len() == count);
    skeleton.radii = radii.map_or_else(|| vec![f64::NAN; count], |c| c.values.clone());
    let mut polygon = Vec::new();
    if let Some(faces) = table("face").filter(|t| t.rows > 0) {
        let corners = faces
            .corners()
            .ok_or_else(|| src.format("the faces have no list `vertex_indices`"))?;
        for (index, list) in corners.lists().enumerate() {
            corner_indices(src, "face", index, list, count, &mut polygon)?;
            skeleton.quads.push(quad(src, index, &polygon)?);
        }
    }
    if let Some(edges) = table("edge").filter(|t| t.rows > 0) {
        let (Some(first), Some(second)) = (edges.column("vertex1"), edges.column("vertex2")) else {
            return Err(src.format("the edges have no properties `vertex1` and `vertex2`"));
        };
        for (index, (&a, &b)) in first.values.iter().zip(&second.values).enumerate() {
            corner_indices(src, "edge", index, &[a, b], count, &mut polygon)?;
            skeleton.beams.push([polygon[0], polygon[1]]);
        }
    }
    Ok(skeleton)
}

fn from_obj(src: &Source) -> Result<Skeleton, IoError> {
    let data = parse_obj(src)?;
    let mut skeleton = Skeleton {
        beams: data.lines.clone(),
        ..Skeleton::default()
    };
    for (index, polygon) in data.polygons().enumerate() {
        skeleton.quads.push(quad(src, index, polygon)?);
    }
    skeleton.points = data.points;
    skeleton.radii = data.fourth;
    Ok(skeleton)
}

fn quad(src: &Source, index: usize, polygon: &[u32]) -> Result<[u32; 4], IoError> {
    polygon.try_into().map_err(|_| {
        src.element(
            "face",
            index,
            format!("has {} corners, a skeleton has quads only", polygon.len()),
        )
    })
}

fn check(src: &Source, skeleton: &Skeleton) -> Result<(), IoError> {
    if skeleton.quads.is_empty() && skeleton.beams.is_empty() {
        return Err(IoError::Empty {
            file: src.file(),
            what: "neither quads nor beams",
        });
    }
    if let Some(index) = skeleton
        .points
        .iter()
        .position(|p| !p.iter().all(|x| x.is_finite()))
    {
        return Err(src.element("point", index, "has a coordinate that is not finite"));
    }
    if let Some(index) = skeleton
        .radii
        .iter()
        .position(|&r| r <= 0.0 || r.is_infinite())
    {
        return Err(src.element(
            "point",
            index,
            format!("has radius {}, it must be positive", skeleton.radii[index]),
        ));
    }
    let twice = |corners: &[u32]| (1..corners.len()).any(|i| corners[..i].contains(&corners[i]));
    if let Some(index) = skeleton.quads.iter().position(|q| twice(q)) {
        return Err(src.element(
            "face",
            index,
            format!("uses a point twice: {:?}", skeleton.quads[index]),
        ));
    }
    if let Some(index) = skeleton.beams.iter().position(|b| twice(b)) {
        return Err(src.element(
            "edge",
            index,
            format!("begins and ends in point {}", skeleton.beams[index][0]),
        ));
    }
    Ok(())
}

/// Writes a skeleton as text PLY, atomically; every number reads back exactly.
///
/// # Errors
/// [`IoError::Write`].
pub fn write_skeleton(path: &Path, skeleton: &Skeleton) -> Result<(), IoError> {
    atomic_write(path, |w| {
        writeln!(
            w,
            "ply\nformat ascii 1.0\ncomment grassfire skeleton, mm\nelement vertex {}",
            skeleton.points.len()
        )?;
        writeln!(
            w,
            "property double x\nproperty double y\nproperty double z\nproperty double radius"
        )?;
        writeln!(
            w,
            "element face {}\nproperty list uchar int vertex_indices",
            skeleton.quads.len()
        )?;
        writeln!(
            w,
            "element edge {}\nproperty int vertex1\nproperty int vertex2\nend_header",
            skeleton.beams.len()
        )?;
        for (i, p) in skeleton.points.iter().enumerate() {
            let radius = skeleton.radii.get(i).copied().unwrap_or(f64::NAN);
            writeln!(w, "{} {} {} {radius}", p.x, p.y, p.z)?;
        }
        for [a, b, c, d] in &skeleton.quads {
            writeln!(w, "4 {a} {b} {c} {d}")?;
        }
        skeleton
            .beams
            .iter()
            .try_for_each(|[a, b]| writeln!(w, "{a} {b}"))
    })
}
