//! Unstructured grids whose cells are equal axis-aligned boxes, as solvers write regular meshes.

use super::source::Source;
use super::vtk::{Piece, VtkFile};
use super::{IoError, density};
use crate::Vec3;
use crate::mesh::{Repair, RepairKind};
use crate::voxel::VoxelGrid;

const VOXEL: f64 = 11.0;
const HEXAHEDRON: f64 = 12.0;
/// Deviation from a regular box, as a share of the cell.
const REGULAR: f64 = 1e-2;

/// Puts cell or point values onto a regular grid; boxes that are missing are empty (0).
pub(super) fn read(
    src: &Source,
    file: &VtkFile,
    notes: &mut Vec<Repair>,
) -> Result<VoxelGrid<f32>, IoError> {
    let (section, name) = file.choose(src)?;
    let mut boxes = Boxes::default();
    let mut values = Vec::new();
    let mut places = Vec::new();
    for piece in &file.pieces {
        src.monitor.check()?;
        let points = points(src, file, piece)?;
        let first = boxes.centres.len();
        add_boxes(src, file, piece, &points, &mut boxes)?;
        let data = file.values(src, piece, &section, Some(&name))?;
        let at = if section == "CellData" {
            boxes.centres[first..].to_vec()
        } else {
            points
        };
        if data.len() != at.len() {
            return Err(src.format(format!(
                "array {name:?} has {} values for {} places",
                data.len(),
                at.len()
            )));
        }
        places.extend(at);
        values.extend(data);
    }
    if boxes.centres.is_empty() {
        return Err(IoError::Empty {
            file: src.file(),
            what: "no cells",
        });
    }
    scatter(src, &places, &values, boxes.size, notes)
}

#[derive(Default)]
struct Boxes {
    centres: Vec<Vec3>,
    size: Vec3,
}

fn points(src: &Source, file: &VtkFile, piece: &Piece) -> Result<Vec<Vec3>, IoError> {
    let flat = file.values(src, piece, "Points", None)?;
    let points: Vec<Vec3> = flat.chunks_exact(3).map(Vec3::from_column_slice).collect();
    match points.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
        Some(index) => Err(src.element("point", index, "has a coordinate that is not finite")),
        None => Ok(points),
    }
}

fn add_boxes(
    src: &Source,
    file: &VtkFile,
    piece: &Piece,
    points: &[Vec3],
    boxes: &mut Boxes,
) -> Result<(), IoError> {
    let corners = file.values(src, piece, "Cells", Some("connectivity"))?;
    let ends = file.values(src, piece, "Cells", Some("offsets"))?;
    let types = file.values(src, piece, "Cells", Some("types"))?;
    if types.len() != ends.len() {
        return Err(src.format(format!(
            "{} cell types for {} cells",
            types.len(),
            ends.len()
        )));
    }
    let mut start = 0.0;
    for (index, (&end, &kind)) in ends.iter().zip(&types).enumerate() {
        if kind != HEXAHEDRON && kind != VOXEL {
            return Err(src.element(
                "cell",
                index,
                format!("has VTK type {kind}; only hexahedra (12) and voxels (11) make a grid"),
            ));
        }
        if end - start != 8.0 || end > corners.len() as f64 {
            return Err(src.element(
                "cell",
                index,
                format!(
                    "runs from corner {start} to {end}, 8 of {} wanted",
                    corners.len()
                ),
            ));
        }
        let (lower, upper) = cell_box(src, index, &corners[start as usize..end as usize], points)?;
        let size = upper - lower;
        if boxes.centres.is_empty() {
            boxes.size = size;
        }
        if (size - boxes.size).amax() > REGULAR * boxes.size.amin() || boxes.size.amin() <= 0.0 {
            let what = format!(
                "is {} x {} x {}, the first cell {} x {} x {}: a grid needs equal boxes",
                size.x, size.y, size.z, boxes.size.x, boxes.size.y, boxes.size.z
            );
            return Err(src.element("cell", index, what));
        }
        boxes.centres.push((lower + upper) / 2.0);
        start = end;
    }
    Ok(())
}

/// The box of one cell; every corner must be a corner of the box.
fn cell_box(
    src: &Source,
    index: usize,
    corners: &[f64],
    points: &[Vec3],
) -> Result<(Vec3, Vec3), IoError> {
    let mut lower = Vec3::repeat(f64::INFINITY);
    let mut upper = Vec3::repeat(f64::NEG_INFINITY);
    let mut places = [Vec3::zeros(); 8];
    for (place, &corner) in places.iter_mut().zip(corners) {
        if !(corner >= 0.0 && corner < points.len() as f64) {
            return Err(src.element(
                "cell",
                index,
                format!("names point {corner}, there are {}", points.len()),
            ));
        }
        *place = points[corner as usize];
        lower = lower.inf(place);
        upper = upper.sup(place);
    }
    let slack = (upper - lower).amax() * REGULAR;
    let off = |p: &Vec3| (0..3).any(|a| (p[a] - lower[a]).min(upper[a] - p[a]) > slack);
    if places.iter().any(off) {
        return Err(src.element("cell", index, "is not an axis-aligned box"));
    }
    Ok((lower, upper))
}

fn scatter(
    src: &Source,
    places: &[Vec3],
    values: &[f64],
    size: Vec3,
    notes: &mut Vec<Repair>,
) -> Result<VoxelGrid<f32>, IoError> {
    let lower = places
        .iter()
        .fold(Vec3::repeat(f64::INFINITY), |lo, p| lo.inf(p));
    let upper = places
        .iter()
        .fold(Vec3::repeat(f64::NEG_INFINITY), |hi, p| hi.sup(p));
    let dims = [0, 1, 2].map(|a| ((upper[a] - lower[a]) / size[a]).round() as usize);
    let dims = dims.map(|n| n.saturating_add(1));
    let count = src.check_voxels(dims)?;
    let mut grid = vec![0.0f32; count];
    let mut seen = vec![false; count];
    let mut filled = 0;
    for (index, (p, &value)) in places.iter().zip(values).enumerate() {
        let at = (p - lower).component_div(&size);
        let cell = at.map(f64::round);
        if (at - cell).amax() > 0.1 {
            return Err(src.element(
                "cell",
                index,
                "does not lie on the regular grid of the others",
            ));
        }
        let [i, j, k] = [cell.x as usize, cell.y as usize, cell.z as usize];
        let slot = (k * dims[1] + j) * dims[0] + i;
        filled += usize::from(!std::mem::replace(&mut seen[slot], true));
        grid[slot] = value as f32;
    }
    if filled < count {
        let text = format!(
            "{} of {count} voxels of the surrounding box are not in the file and are empty",
            count - filled
        );
        notes.push(Repair::new(RepairKind::Assumed, count - filled, text));
    }
    if filled < places.len() {
        let text = format!(
            "{} cells lie in the same place as another",
            places.len() - filled
        );
        notes.push(Repair::new(
            RepairKind::DuplicateFaces,
            places.len() - filled,
            text,
        ));
    }
    density::cubic(src, lower, [size.x, size.y, size.z], dims, grid, notes)
}
