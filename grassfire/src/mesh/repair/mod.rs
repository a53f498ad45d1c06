//! Repair of triangle soup: what files get wrong, mended in a fixed order and told by name and number.

mod edges;
mod faces;
mod holes;
mod intersections;
mod loops;
mod orient;
mod rays;
mod report;
mod shells;
#[cfg(test)]
mod tests;
mod weld;

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use report::{Repair, RepairError, RepairKind, RepairReport, Repaired};

use super::TriMesh;
use crate::monitor::Monitor;
use edges::Edges;

/// Coarser coordinates, as a share of the diagonal, are worth a warning.
const COARSE: f64 = 1e-4;
/// Coarser coordinates carry no shape.
const HOPELESS: f64 = 5e-2;
/// Smaller parts, mm, are worth a warning: most likely the unit is wrong.
const TINY: f64 = 1e-2;
/// Most triangles: half-edges are counted in 32 bits.
const MAX_TRIANGLES: usize = u32::MAX as usize / 3;

/// Options of [`repair`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RepairOptions {
    /// Refuse a mesh that needs a repair instead of repairing it.
    pub strict: bool,
    /// Pieces with less than this share of the largest piece's volume are dropped.
    pub min_volume_share: f64,
    /// Share of open edges from which points are united within a tolerance.
    pub weld_open_share: f64,
    /// Largest tolerance for that, as a share of the diagonal.
    pub weld_tolerance: f64,
    /// Flaps with less than this share of the surface are dropped.
    pub max_fin_share: f64,
    /// Refused when the holes have more than this share of the surface.
    pub max_hole_share: f64,
    /// Longest diagonal, mm.
    pub max_size: f64,
}

impl Default for RepairOptions {
    fn default() -> Self {
        Self {
            strict: false,
            min_volume_share: 1e-3,
            weld_open_share: 0.01,
            weld_tolerance: 1e-3,
            max_fin_share: 0.05,
            max_hole_share: 0.45,
            max_size: 1e6,
        }
    }
}

/// Mends triangle soup so that the voxel remesh can tell inside from outside.
///
/// 1. Faces with missing or repeated corners or with coordinates that are not finite are dropped; size and precision are checked.
/// 2. Points that are equal within the step of the file's numbers are united; the figures of the report describe the mesh here. With many open edges, points within a tolerance follow.
/// 3. Double faces, faces without area and fins are dropped.
/// 4. Neighbours are oriented alike across edges with two faces, each patch the way most of its area was.
/// 5. Pieces that are too small are dropped; the others are turned outward, or inward when they lie inside another (odd nesting is a void).
/// 6. Holes bounded by simple loops are filled with a surface of small area.
///
/// All tolerances are relative to the part, so its size does not matter. Points are not moved except by uniting; tags are kept. Bodies that
/// overlap and edges with more than two faces stay: the remesh decides by the winding number. Results do not depend on the thread count.
///
/// # Errors
/// [`RepairError`]: nothing usable, a sheet without volume, mostly holes, too large, too coarse, or any repair when `strict`.
pub fn repair(
    mesh: TriMesh,
    options: &RepairOptions,
    monitor: &Monitor,
) -> Result<Repaired, RepairError> {
    let step = |what: &str, done: f64| monitor.step("input", what, done);
    let mut report = RepairReport {
        triangles: mesh.triangles.len(),
        ..RepairReport::default()
    };
    if mesh.triangles.len() > MAX_TRIANGLES || mesh.points.len() > u32::MAX as usize {
        return Err(RepairError::TooMany {
            triangles: mesh.triangles.len(),
            limit: MAX_TRIANGLES,
        });
    }
    step("checking", 0.0)?;
    let mut mesh = mesh;
    drop_unusable(&mut mesh, &mut report)?;
    let resolution = check_scale(&mesh, options, &mut report)?;

    step("uniting points", 0.1)?;
    weld::exact(&mut mesh, resolution);
    let edges = Edges::new(&mesh);
    report.open_edges = edges.open();
    report.non_manifold_edges = edges.non_manifold();
    report.components = edges.components(mesh.triangles.len()).count;
    let share = report.open_edges as f64 / edges.len().max(1) as f64;
    if share > options.weld_open_share {
        weld::tolerant(&mut mesh, &edges, options, &mut report.repairs, monitor)?;
    }

    step("dropping bad faces", 0.3)?;
    faces::drop_duplicates(&mut mesh, &mut report.repairs);
    faces::drop_degenerate(&mut mesh, &mut report.repairs, monitor)?;
    faces::drop_fins(&mut mesh, options, &mut report.repairs);
    if mesh.triangles.is_empty() {
        let why = "no area";
        return Err(RepairError::Empty {
            triangles: report.triangles,
            dropped: report.triangles,
            why,
        });
    }

    step("orienting", 0.5)?;
    orient::orient(&mut mesh, &mut report.repairs);
    shells::sort_out(&mut mesh, options, &mut report.repairs, monitor)?;

    step("filling holes", 0.8)?;
    holes::fill(&mut mesh, options, &mut report.repairs, monitor)?;
    finish(mesh, report, options, monitor)
}

/// Last checks on the mended mesh.
fn finish(
    mut mesh: TriMesh,
    mut report: RepairReport,
    options: &RepairOptions,
    monitor: &Monitor,
) -> Result<Repaired, RepairError> {
    let edges = Edges::new(&mesh);
    if edges.open() > 0 {
        let text = format!(
            "{} open edges left: inside and outside are told by the winding number there",
            edges.open()
        );
        report
            .repairs
            .push(Repair::new(RepairKind::LeftOpen, edges.open(), text));
    }
    if edges.non_manifold() > 0 {
        let text = format!(
            "{} edges with more than two faces left to the remesh",
            edges.non_manifold()
        );
        report.repairs.push(Repair::new(
            RepairKind::NonManifold,
            edges.non_manifold(),
            text,
        ));
    }
    drop_unused_points(&mut mesh);
    monitor.step("input", "looking for faces that cross", 0.9)?;
    let crossing = intersections::intersecting_faces(&mesh);
    if crossing > 0 {
        let text = format!("{crossing} faces run through others: the winding number decides there");
        report
            .repairs
            .push(Repair::new(RepairKind::SelfIntersection, crossing, text));
    }
    report.volume = mesh.volume();
    let area = mesh.area();
    check_volume(report.volume, area)?;
    let changes = report.repairs.iter().filter(|r| r.kind.changes_mesh());
    if let (true, Some(first)) = (options.strict, changes.clone().next()) {
        return Err(RepairError::Strict {
            count: changes.count(),
            first: first.text.clone(),
        });
    }
    for repair in report.repairs.iter().filter(|r| r.kind.is_warning()) {
        monitor.warn("input", repair.text.clone());
    }
    Ok(Repaired { mesh, report })
}

/// A sheet has area but no volume. A ball has `volume / area^1.5 = 0.094`, a plate of 1000 x 1000 x 1 still 3.5e-4.
fn check_volume(volume: f64, area: f64) -> Result<(), RepairError> {
    const LIMIT: f64 = 1e-6;
    if volume > LIMIT * area * area.sqrt() {
        return Ok(());
    }
    Err(RepairError::NotASolid {
        why: format!("the volume is {volume:.3e} mm3 for an area of {area:.3e} mm2"),
    })
}

/// Drops faces that name missing points, name one twice, or have coordinates that are not finite.
fn drop_unusable(mesh: &mut TriMesh, report: &mut RepairReport) -> Result<(), RepairError> {
    let count = mesh.points.len();
    let tags = mesh.tags.len() == mesh.triangles.len();
    if !tags {
        mesh.tags.clear();
    }
    let finite: Vec<bool> = mesh
        .points
        .iter()
        .map(|p| p.iter().all(|x| x.is_finite()))
        .collect();
    let missing = |t: &[u32; 3]| t.iter().any(|&v| v as usize >= count);
    let infinite = |t: &[u32; 3]| {
        t.iter()
            .any(|&v| !finite.get(v as usize).copied().unwrap_or(true))
    };
    let (mut bad, mut wild, mut first) = (0, 0, None);
    let mut keep = Vec::with_capacity(mesh.triangles.len());
    for (index, t) in mesh.triangles.iter().enumerate() {
        let (m, w) = (missing(t), infinite(t));
        bad += usize::from(m);
        wild += usize::from(!m && w);
        if w && !m && first.is_none() {
            first = Some(index);
        }
        keep.push(!m && !w);
    }
    retain(mesh, &keep);
    if bad > 0 {
        let text = format!("{bad} faces that name missing points dropped");
        report
            .repairs
            .push(Repair::new(RepairKind::BadFaces, bad, text));
    }
    if let Some(first) = first {
        let text = format!(
            "{wild} faces with coordinates NaN or infinite dropped, the first is face {first}"
        );
        report
            .repairs
            .push(Repair::new(RepairKind::NonFinite, wild, text));
    }
    if mesh.triangles.is_empty() {
        let why = if bad > 0 {
            "missing points"
        } else {
            "no finite coordinates"
        };
        return Err(RepairError::Empty {
            triangles: report.triangles,
            dropped: bad + wild,
            why,
        });
    }
    drop_unused_points(mesh);
    Ok(())
}

/// Refuses parts without sensible size, notes coarse coordinates; gives the step between numbers at the largest coordinate.
fn check_scale(
    mesh: &TriMesh,
    options: &RepairOptions,
    report: &mut RepairReport,
) -> Result<f64, RepairError> {
    let Some((lower, upper)) = mesh.bounds() else {
        return Ok(0.0);
    };
    let size = (upper - lower).norm();
    if size.is_nan() || size > options.max_size {
        return Err(RepairError::TooLarge {
            size,
            limit: options.max_size,
        });
    }
    if size <= 0.0 {
        return Err(RepairError::NotASolid {
            why: "all points lie in one place".into(),
        });
    }
    let offset = lower.amax().max(upper.amax());
    let single = mesh
        .points
        .par_iter()
        .all(|p| p.iter().all(|x| f64::from(*x as f32) == *x));
    let digits = if single { 23 } else { 52 };
    let step = (offset.log2().floor() - f64::from(digits)).exp2();
    if step > HOPELESS * size {
        return Err(RepairError::PrecisionLost { offset, step, size });
    }
    if step > COARSE * size {
        let text = format!(
            "coordinates lie {offset:.3e} mm from the origin, where numbers step by {step:.3} mm: the shape is only known to {:.2} % of its {size:.1} mm",
            100.0 * step / size
        );
        report.repairs.push(Repair::new(
            RepairKind::PrecisionLoss,
            mesh.points.len(),
            text,
        ));
    }
    if size < TINY {
        let text =
            format!("the part is only {size:.3e} mm long: check the unit of the file (`scale`)");
        report.repairs.push(Repair::new(RepairKind::Scale, 1, text));
    }
    Ok(step)
}

/// Keeps the triangles that `keep` marks, with their tags.
fn retain(mesh: &mut TriMesh, keep: &[bool]) {
    let mut flags = keep.iter();
    mesh.triangles
        .retain(|_| flags.next().copied().unwrap_or(false));
    let mut flags = keep.iter();
    mesh.tags.retain(|_| flags.next().copied().unwrap_or(false));
}

/// Drops points that no triangle uses; the order of the others stays.
fn drop_unused_points(mesh: &mut TriMesh) {
    let mut used = vec![false; mesh.points.len()];
    for &v in mesh.triangles.iter().flatten() {
        used[v as usize] = true;
    }
    let mut new = vec![0u32; used.len()];
    let mut count = 0;
    for (slot, used) in new.iter_mut().zip(&used) {
        *slot = count;
        count += u32::from(*used);
    }
    let mut flags = used.iter();
    mesh.points
        .retain(|_| flags.next().copied().unwrap_or(false));
    for v in mesh.triangles.iter_mut().flatten() {
        *v = new[*v as usize];
    }
}
