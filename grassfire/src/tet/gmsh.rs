//! Meshes by gmsh.

use std::path::Path;
use std::str::FromStr;

use super::{TetError, TetMesh, TetOptions, program};
use crate::Vec3;
use crate::monitor::Monitor;

/// Edges may be shorter than asked for by this where the surface is curved or narrow.
const LEAST: f64 = 0.25;
/// gmsh's number of the ten-node tetrahedron.
const TETRAHEDRON: &str = "11";

/// Fills the solid of a STEP file with ten-node tetrahedra of edge `size` (mm) by gmsh, an external program.
///
/// # Errors
/// [`TetError::Program`] when it is not there, [`TetError::ProgramFailed`] with what it said, [`TetError::Mesh`].
pub fn mesh_step(
    step: &Path,
    size: f64,
    options: &TetOptions,
    monitor: &Monitor,
) -> Result<TetMesh, TetError> {
    let is_step =
        |e: &std::ffi::OsStr| e.eq_ignore_ascii_case("step") || e.eq_ignore_ascii_case("stp");
    if !step.extension().is_some_and(is_step) {
        return Err(TetError::NoStep {
            path: step.to_owned(),
        });
    }
    let refused = |reason: std::io::Error| TetError::Program {
        program: options.gmsh.clone(),
        reason: reason.to_string(),
    };
    let program = find(&options.gmsh);
    let folder = tempfile::tempdir().map_err(refused)?;
    // Its own name could look like an option to gmsh.
    std::fs::copy(step, folder.path().join("part.step")).map_err(refused)?;
    let (most, least) = (size.to_string(), (LEAST * size).to_string());
    let arguments = [
        "part.step",
        "-3",
        "-order",
        "2",
        "-format",
        "msh22",
        "-nopopup",
        "-nt",
        "1",
        "-v",
        "3",
        "-clmax",
        &most,
        "-clmin",
        &least,
        "-clcurv",
        "8",
        // Short curved edges stay whole: three nodes nearly on a line make flat elements.
        "-setnumber",
        "Mesh.MinimumCurveNodes",
        "2",
        // Curved elements are not turned inside out.
        "-setnumber",
        "Mesh.HighOrderOptimize",
        "2",
        "-setnumber",
        "Mesh.HighOrderThresholdMin",
        "0.3",
        "-setnumber",
        "Mesh.OptimizeNetgen",
        "1",
        "-o",
        "part.msh",
    ];
    program::run(
        &program,
        &arguments,
        folder.path(),
        "gmsh.log",
        options.patience,
        monitor,
    )?;
    let bytes = crate::io::read_file(&folder.path().join("part.msh"), 1 << 32)?;
    parse(&options.gmsh, &String::from_utf8_lossy(&bytes))
}

/// A relative path with folders counts from here, not from the folder that the program runs in.
pub(super) fn find(program: &str) -> String {
    let path = Path::new(program);
    match std::path::absolute(path) {
        Ok(whole) if path.components().count() > 1 => whole.display().to_string(),
        _ => program.to_owned(),
    }
}

/// Reads the nodes and the ten-node tetrahedra of an MSH 2.2 text. Nodes of no tetrahedron are left out.
pub(super) fn parse(program: &str, text: &str) -> Result<TetMesh, TetError> {
    let mut lines = text.lines().enumerate();
    let fail = |line: usize, what: &str| TetError::Mesh {
        program: program.to_owned(),
        line: line + 1,
        what: what.to_owned(),
    };
    let mut tags: Vec<(u64, Vec3)> = Vec::new();
    let mut cells: Vec<[u64; 10]> = Vec::new();
    while let Some((number, line)) = lines.next() {
        if !matches!(line, "$Nodes" | "$Elements") {
            continue;
        }
        let nodes = line == "$Nodes";
        let count = lines
            .next()
            .and_then(|(_, l)| l.trim().parse::<usize>().ok());
        let count = count.ok_or_else(|| fail(number + 1, "a count is missing"))?;
        for _ in 0..count {
            let (number, line) = lines.next().ok_or_else(|| fail(number, "it ends early"))?;
            let words: Vec<&str> = line.split_ascii_whitespace().collect();
            if nodes {
                let place = numbers::<f64, 3>(words.get(1..4));
                let tag = words.first().and_then(|w| w.parse().ok());
                let (Some(tag), Some(place)) = (tag, place) else {
                    return Err(fail(number, "a node needs a number and a place"));
                };
                tags.push((tag, Vec3::from(place)));
            } else if words.get(1) == Some(&TETRAHEDRON) {
                let skip = words.get(2).and_then(|w| w.parse::<usize>().ok());
                let range = skip.map(|s| s.saturating_add(3)..s.saturating_add(13));
                let cell = numbers::<u64, 10>(range.and_then(|r| words.get(r)));
                cells.push(cell.ok_or_else(|| fail(number, "a tetrahedron needs ten nodes"))?);
            }
        }
    }
    if cells.is_empty() {
        return Err(fail(0, "it holds no ten-node tetrahedra"));
    }
    compact(tags, cells).ok_or_else(|| fail(0, "a tetrahedron names a node that is not there"))
}

fn numbers<T: FromStr, const N: usize>(words: Option<&[&str]>) -> Option<[T; N]> {
    let all: Vec<T> = words?.iter().filter_map(|w| w.parse().ok()).collect();
    all.try_into().ok()
}

/// Numbers the nodes that tetrahedra use from 0, in the order of their tags.
fn compact(mut tags: Vec<(u64, Vec3)>, cells: Vec<[u64; 10]>) -> Option<TetMesh> {
    tags.sort_by_key(|(tag, _)| *tag);
    let place = |tag: u64| tags.binary_search_by_key(&tag, |(t, _)| *t).ok();
    let mut used = vec![u32::MAX; tags.len()];
    for cell in &cells {
        for &tag in cell {
            used[place(tag)?] = 0;
        }
    }
    let mut points = Vec::new();
    for (slot, (_, p)) in used.iter_mut().zip(&tags).filter(|(slot, _)| **slot == 0) {
        *slot = points.len() as u32;
        points.push(*p);
    }
    let number = |tag: u64| place(tag).map_or(0, |i| used[i]);
    // gmsh numbers the middles of 23 and 13 the other way round.
    let cell = |c: [u64; 10]| [0, 1, 2, 3, 4, 5, 6, 7, 9, 8].map(|i| number(c[i]));
    Some(TetMesh {
        cells: cells.into_iter().map(cell).collect(),
        points,
    })
}
