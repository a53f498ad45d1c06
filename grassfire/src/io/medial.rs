//! Medial meshes as `.ma`: a line of three counts, then `v x y z r`, `e i j` and `f i j k`, indices from 0.

use std::path::Path;

use super::source::{Source, quote, tokens};
use super::{IoError, ReadOptions, atomic_write, read_file};
use crate::medial::MedialMesh;
use crate::monitor::Monitor;

/// Reads a `.ma` file; see [`read_medial_bytes`].
///
/// # Errors
/// As [`read_medial_bytes`], and [`IoError::Open`].
pub fn read_medial(
    path: &Path,
    options: &ReadOptions,
    monitor: &Monitor,
) -> Result<MedialMesh, IoError> {
    let bytes = read_file(path, options.max_file_bytes)?;
    read_medial_bytes(&path.display().to_string(), &bytes, options, monitor)
}

/// Reads a `.ma` file. Edges that belong to a triangle are dropped: some programs list all edges, [`MedialMesh`] only the loose ones.
///
/// # Errors
/// [`IoError::Line`] names a damaged line, an index out of range or a count that is not met.
pub fn read_medial_bytes(
    name: &str,
    bytes: &[u8],
    options: &ReadOptions,
    monitor: &Monitor,
) -> Result<MedialMesh, IoError> {
    let src = Source {
        name,
        bytes,
        options,
        monitor,
    };
    let mut lines = src
        .lines()
        .map(|(n, line)| (n, line.split(|&b| b == b'#').next().unwrap_or_default()))
        .filter(|(_, line)| !line.trim_ascii().is_empty());
    let Some((line, first)) = lines.next() else {
        return Err(IoError::Empty {
            file: src.file(),
            what: "no counts",
        });
    };
    let mut counts = [0; 3];
    let mut words = tokens(first);
    for (count, what) in counts.iter_mut().zip([
        "the count of points",
        "the count of edges",
        "the count of faces",
    ]) {
        *count = src.next_index(line, &mut words, what)?;
    }
    let mut mesh = MedialMesh::default();
    let mut end = line;
    for (n, text) in lines {
        end = n;
        if n % 100_000 == 0 {
            monitor.check()?;
        }
        let mut words = tokens(text);
        match words.next().unwrap_or_default() {
            b"v" => {
                let p = src.next_point(n, &mut words)? * options.scale;
                let radius = src.next_number(n, &mut words, "the radius")? * options.scale;
                if !(radius >= 0.0 && radius.is_finite() && p.iter().all(|x| x.is_finite())) {
                    return Err(src.line(
                        n,
                        "a sphere needs a finite centre and a finite radius of at least 0",
                    ));
                }
                mesh.points.push(p);
                mesh.radii.push(radius);
            }
            b"e" => mesh.edges.push(indices(&src, n, &mut words, counts[0])?),
            b"f" => mesh
                .triangles
                .push(indices(&src, n, &mut words, counts[0])?),
            other => return Err(src.line(n, format!("{} is none of `v`, `e`, `f`", quote(other)))),
        }
    }
    let found = [mesh.points.len(), mesh.edges.len(), mesh.triangles.len()];
    if found != counts {
        return Err(src.line(end, format!("the first line promises {counts:?} points, edges and faces, the file holds {found:?}")));
    }
    drop_triangle_edges(&mut mesh);
    Ok(mesh)
}

fn indices<'t, const N: usize>(
    src: &Source,
    line: usize,
    words: &mut impl Iterator<Item = &'t [u8]>,
    points: usize,
) -> Result<[u32; N], IoError> {
    let mut out = [0u32; N];
    for k in 0..N {
        let index = src.next_index(line, words, "an index")?;
        if index >= points.min(u32::MAX as usize) {
            return Err(src.line(
                line,
                format!("index {index} but there are only {points} points (counted from 0)"),
            ));
        }
        out[k] = index as u32;
        if out[..k].contains(&out[k]) {
            return Err(src.line(line, format!("uses point {index} twice")));
        }
    }
    Ok(out)
}

fn drop_triangle_edges(mesh: &mut MedialMesh) {
    let ordered = |a: u32, b: u32| [a.min(b), a.max(b)];
    let sides = mesh.triangles.iter().flat_map(|t| {
        [
            ordered(t[0], t[1]),
            ordered(t[1], t[2]),
            ordered(t[2], t[0]),
        ]
    });
    let mut sides: Vec<[u32; 2]> = sides.collect();
    sides.sort_unstable();
    mesh.edges
        .retain(|&[a, b]| sides.binary_search(&ordered(a, b)).is_err());
}

/// Writes a medial mesh as `.ma`, atomically; every number reads back exactly.
///
/// # Errors
/// [`IoError::Write`].
pub fn write_medial(path: &Path, mesh: &MedialMesh) -> Result<(), IoError> {
    atomic_write(path, |w| {
        writeln!(
            w,
            "{} {} {}",
            mesh.points.len(),
            mesh.edges.len(),
            mesh.triangles.len()
        )?;
        for (p, radius) in mesh.points.iter().zip(&mesh.radii) {
            writeln!(w, "v {} {} {} {radius}", p.x, p.y, p.z)?;
        }
        mesh.edges
            .iter()
            .try_for_each(|[a, b]| writeln!(w, "e {a} {b}"))?;
        mesh.triangles
            .iter()
            .try_for_each(|[a, b, c]| writeln!(w, "f {a} {b} {c}"))
    })
}
