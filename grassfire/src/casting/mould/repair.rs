//! Repair of undercuts on the voxel field: fill, or keep the best interval of every line; draft on request.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::cores::cored;
use super::dexels::axes;
use super::gaps::{close_gaps, density};
use super::rooms::remove_lesser;
use super::taper::taper;
use super::{MouldError, STAGE};
use crate::Vec3;
use crate::fe::components;
use crate::mesh::TriMesh;
use crate::monitor::Monitor;
use crate::remesh::films::without_films;
use crate::remesh::{Capsule, RemeshError, RemeshOptions, remesh, remesh_density};
use crate::voxel::VoxelGrid;

/// What is done about undercuts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Repair {
    /// Nothing.
    #[default]
    Off,
    /// Everything between the lowest and the highest material of a line is filled: the least part that leaves the mould and
    /// holds the given one.
    Fill,
    /// Of two members with a room between them that only a core makes, the lesser is taken away; what is left undercut is filled.
    Remove,
    /// Such members are turned by 90 degrees about their long axes, so that they stand along the draw direction; the rest is filled.
    Turn,
    /// Every line keeps the interval that is worth most: material counts 1, filling costs `mould.fill_cost`.
    Keep,
    /// For every room that only a core makes: filled, cored, its lesser side removed, or its members turned, whichever gives the
    /// stiffest part for its metal and cores. Every variant is made and proved.
    Best,
}

impl Repair {
    /// Whether members of the skeleton are edited first.
    pub fn edits_members(self) -> bool {
        matches!(self, Self::Remove | Self::Turn)
    }

    /// Whether a finished solid, which has no skeleton, can be repaired so.
    pub fn takes_solids(self) -> bool {
        !self.edits_members() && self != Self::Best
    }
}

/// How undercuts are removed.
#[derive(Debug, Clone, PartialEq)]
pub struct RepairOptions {
    /// What is done.
    pub kind: Repair,
    /// For [`Repair::Keep`]: what filling a volume costs against removing one.
    pub fill_cost: f64,
    /// Draft to add, degrees.
    pub draft: f64,
    /// Height of the parting plane along the draw direction, mm.
    pub parting: f64,
    /// Edge of a voxel, mm.
    pub cell: f64,
    /// A place in each undercut that a core makes, mm: it stays open.
    pub cores: Vec<Vec3>,
    /// Such an undercut may have closed since its place was named: that is told, not refused.
    pub cores_may_close: bool,
    /// Bores that cores make likewise.
    pub bores: Vec<Capsule>,
    /// Surface of the given bodies: with draft, films over their walls go. Empty where there are none.
    pub walls: TriMesh,
    /// A place in each undercut whose lesser side is taken away, mm.
    pub removals: Vec<Vec3>,
    /// Gaps narrower than this go solid, mm; 0 keeps all.
    pub min_gap: f64,
}

/// A part without undercuts.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Repaired {
    /// Its surface, mm.
    pub mesh: TriMesh,
    /// Volume of the surface before, on the same voxels, and after, mm3.
    pub volume: [f64; 2],
    /// Lines with more than one interval, before and after, on the voxels; cores count as material.
    pub multiple: [usize; 2],
}

/// Removes undercuts along the unit vector `draw`.
///
/// 1. The part is turned so that the draw direction is z and measured on voxels of `cell` mm (signed distances).
///    What cores make counts as material until the end.
/// 2. The lesser sides at `removals` go; pieces that hang on nothing any more go, too, with a warning.
/// 3. [`Repair::Fill`]: every value becomes at least the smaller of the largest values above and below it on its line. All
///    level sets of the result are single intervals, so the surface between voxels is, too.
/// 4. [`Repair::Keep`]: on every line the interval with the largest sum of +1 a solid and `-cost` an empty voxel (Kadane's
///    maximum subarray, exact); what lies outside goes, what lies inside is filled as above. Loose
///    pieces go as before.
/// 5. With `min_gap` narrower gaps go solid, but not what cores make; what that hides is filled.
/// 6. Draft: from both ends towards `parting`, or to what of a wall is nearest to it, every value becomes at least the one before
///    plus the tangent of the draft times the step.
/// 7. With draft, films up to 1.5 voxels thick over `walls` go, those of the draft and those of the part: a copy of a given body on
///    voxels is larger than the body here and there. How much that is is told as a warning.
/// 8. The surface is extracted and turned back.
///
/// # Errors
/// [`MouldError::Grid`] when the part cannot be put on the grid, [`MouldError::Place`] for a place without an undercut; cancelled.
pub fn repair(
    mesh: &TriMesh,
    draw: &Vec3,
    options: &RepairOptions,
    monitor: &Monitor,
) -> Result<Repaired, MouldError> {
    let Laid {
        frame,
        mut field,
        open,
        volume: volume_before,
    } = laid(mesh, draw, options, monitor)?;
    let before = multiple(&field);
    remove_lesser(&mut field, &turned(&options.removals, &frame))?;
    match options.kind {
        Repair::Off => {}
        Repair::Fill | Repair::Remove | Repair::Turn | Repair::Best => fill(&mut field),
        Repair::Keep => keep(&mut field, options.fill_cost),
    }
    if (options.kind == Repair::Keep || !options.removals.is_empty())
        && let Some((pieces, lost)) = drop_loose(&mut field)
    {
        monitor.warn(
            STAGE,
            format!("the repair cut off {pieces} pieces of {lost:.0} mm3, which are left out"),
        );
    }
    if options.min_gap > 0.0 {
        close_gaps(&mut field, options.min_gap, &grid(options.cell), monitor)
            .map_err(|source| refused(source, options.cell))?;
        if options.kind != Repair::Off {
            fill(&mut field);
        }
    }
    if options.draft > 0.0 {
        settle_empty(&mut field);
        let tangent = options.draft.to_radians().tan();
        taper(&mut field, tangent, options.parting);
        let walls = turn(&options.walls, |p| into(p, &frame));
        let taken = take_films(&mut field, &walls, monitor);
        if taken && options.kind != Repair::Off {
            // Beside a member that stays a film that went in part leaves slots.
            fill(&mut field);
        }
    }
    let after = multiple(&field);
    for (v, value) in open {
        field.values[v] = value;
    }
    let out = remesh_density(&density(&field), 0.5, &grid(options.cell), monitor)
        .map_err(|source| refused(source, options.cell))?;
    Ok(Repaired {
        mesh: turn(out.solid.mesh(), |p| back(p, &frame)),
        volume: [volume_before, out.solid.volume()],
        multiple: [before, after],
    })
}

/// Takes away the films over the walls of given bodies; whether there were any.
fn take_films(field: &mut VoxelGrid<f32>, walls: &TriMesh, monitor: &Monitor) -> bool {
    let cleared = without_films(field, walls);
    let taken = filled(field) - filled(&cleared);
    // Less than a voxel is nothing.
    if taken <= field.spacing.powi(3) {
        return false;
    }
    monitor.warn(
        STAGE,
        format!(
            "films of {taken:.0} mm3 over the walls of given bodies are taken away with the repair"
        ),
    );
    *field = cleared;
    true
}

/// Volume of a signed distance, mm3: voxels at the surface count in part.
fn filled(field: &VoxelGrid<f32>) -> f64 {
    let h = field.spacing;
    let share = |&f: &f32| (0.5 + f64::from(f) / h).clamp(0.0, 1.0);
    h.powi(3) * field.values.iter().map(share).sum::<f64>()
}

/// A part on voxels with the draw direction as z.
pub(super) struct Laid {
    frame: [Vec3; 3],
    /// Signed distances; what cores make is material.
    pub(super) field: VoxelGrid<f32>,
    /// The voxels that cores make, and their own values.
    open: Vec<(usize, f32)>,
    /// Volume without the cores, mm3.
    volume: f64,
}

impl Laid {
    /// A point of the grid's frame as it lies in the part.
    pub(super) fn back(&self, p: &Vec3) -> Vec3 {
        back(p, &self.frame)
    }
}

/// Turns a part so that the unit vector `draw` is z, and measures it on voxels.
pub(super) fn laid(
    mesh: &TriMesh,
    draw: &Vec3,
    options: &RepairOptions,
    monitor: &Monitor,
) -> Result<Laid, MouldError> {
    let (frame, cell) = (axes(draw), options.cell);
    let part = turn(mesh, |p| into(p, &frame));
    let remeshed = remesh(&part, &grid(cell), monitor).map_err(|source| refused(source, cell))?;
    let (mut field, volume) = (remeshed.field, remeshed.solid.volume());
    let open = fill_cores(&mut field, options, &frame, monitor)?;
    Ok(Laid {
        frame,
        field,
        open,
        volume,
    })
}

fn grid(cell: f64) -> RemeshOptions {
    RemeshOptions {
        voxel: Some(cell),
        min_tunnel: 0.0,
        ..RemeshOptions::default()
    }
}

fn refused(source: RemeshError, cell: f64) -> MouldError {
    match source {
        RemeshError::Cancelled(cancelled) => MouldError::Cancelled(cancelled),
        source => MouldError::Grid { cell, source },
    }
}

fn into(p: &Vec3, frame: &[Vec3; 3]) -> Vec3 {
    Vec3::new(p.dot(&frame[0]), p.dot(&frame[1]), p.dot(&frame[2]))
}

fn back(p: &Vec3, frame: &[Vec3; 3]) -> Vec3 {
    p.x * frame[0] + p.y * frame[1] + p.z * frame[2]
}

fn turned(places: &[Vec3], frame: &[Vec3; 3]) -> Vec<Vec3> {
    places.iter().map(|p| into(p, frame)).collect()
}

/// Makes material of what cores make; gives the values that were there.
fn fill_cores(
    field: &mut VoxelGrid<f32>,
    options: &RepairOptions,
    frame: &[Vec3; 3],
    monitor: &Monitor,
) -> Result<Vec<(usize, f32)>, MouldError> {
    let along = |bore: &Capsule| Capsule {
        a: into(&bore.a, frame),
        b: into(&bore.b, frame),
        ..*bore
    };
    let bores: Vec<Capsule> = options.bores.iter().map(along).collect();
    let places = turned(&options.cores, frame);
    let cores = cored(field, &places, &bores, options.cores_may_close, monitor)?;
    let within = (0..cores.len()).filter(|&v| cores[v]);
    let open: Vec<(usize, f32)> = within.map(|v| (v, field.values[v])).collect();
    for (v, _) in &open {
        field.values[*v] = 0.5 * field.spacing as f32;
    }
    Ok(open)
}

fn turn(mesh: &TriMesh, f: impl Fn(&Vec3) -> Vec3) -> TriMesh {
    TriMesh {
        points: mesh.points.iter().map(f).collect(),
        triangles: mesh.triangles.clone(),
        tags: mesh.tags.clone(),
    }
}

/// Lines along z with more than one interval of material.
pub(super) fn multiple(field: &VoxelGrid<f32>) -> usize {
    let [nx, ny, nz] = field.dims;
    let inside = |i: usize, j: usize, k: usize| field.values[field.index(i, j, k)] > 0.0;
    let mut count = 0;
    for j in 0..ny {
        for i in 0..nx {
            let begins = (0..nz).filter(|&k| inside(i, j, k) && (k == 0 || !inside(i, j, k - 1)));
            count += usize::from(begins.count() > 1);
        }
    }
    count
}

/// Calls `change` with the values of every line along z.
pub(super) fn for_each_line(field: &mut VoxelGrid<f32>, mut change: impl FnMut(&mut [f32])) {
    let [nx, ny, nz] = field.dims;
    let mut line = vec![0.0; nz];
    for j in 0..ny {
        for i in 0..nx {
            for (k, value) in line.iter_mut().enumerate() {
                *value = field.values[field.index(i, j, k)];
            }
            change(&mut line);
            for (k, value) in line.iter().enumerate() {
                let at = field.index(i, j, k);
                field.values[at] = *value;
            }
        }
    }
}

fn fill(field: &mut VoxelGrid<f32>) {
    for_each_line(field, fill_line);
}

/// Every value at least the smaller of the largest on both sides.
fn fill_line(line: &mut [f32]) {
    let mut above = line.to_vec();
    for k in (0..line.len().saturating_sub(1)).rev() {
        above[k] = above[k].max(above[k + 1]);
    }
    let mut below = f32::NEG_INFINITY;
    for (value, above) in line.iter_mut().zip(above) {
        below = below.max(*value);
        *value = value.max(below.min(above));
    }
}

fn keep(field: &mut VoxelGrid<f32>, cost: f64) {
    let out = -0.5 * field.spacing as f32;
    for_each_line(field, |line| {
        let worth = line.iter().map(|f| if *f > 0.0 { 1.0 } else { -cost });
        let Some([first, last]) = best_interval(worth) else {
            return;
        };
        for (k, value) in line.iter_mut().enumerate() {
            if k < first || k > last {
                *value = value.min(out);
            }
        }
        fill_line(&mut line[first..=last]);
    });
}

/// Empty voxels without material beside them are far from it: what removals left behind is no surface that draft may grow from.
fn settle_empty(field: &mut VoxelGrid<f32>) {
    let [nx, ny, nz] = field.dims;
    let far = -3.0 * field.spacing as f32;
    let solid: Vec<bool> = field.values.iter().map(|f| *f > 0.0).collect();
    for v in (0..solid.len()).filter(|&v| !solid[v]) {
        let [i, j, k] = field.ijk(v);
        let low = [(i, 1), (j, nx), (k, nx * ny)];
        let high = [(i + 1 < nx, 1), (j + 1 < ny, nx), (k + 1 < nz, nx * ny)];
        let below = low.iter().any(|&(at, step)| at > 0 && solid[v - step]);
        let above = high.iter().any(|&(inside, step)| inside && solid[v + step]);
        if field.values[v] >= -0.5 * field.spacing as f32 && !below && !above {
            field.values[v] = far;
        }
    }
}

/// Empties all pieces but the largest; gives how many there were and their volume, mm3, none when there is one.
fn drop_loose(field: &mut VoxelGrid<f32>) -> Option<(usize, f64)> {
    let solid: Vec<bool> = field.values.iter().map(|f| *f > 0.0).collect();
    let (labels, pieces) = components(field.dims, &solid);
    let sizes = pieces.iter().enumerate().map(|(n, p)| (p.size, n));
    let largest = sizes.max()?.1 as u32;
    if pieces.len() < 2 {
        return None;
    }
    let loose = |label: u32| label != u32::MAX && label != largest;
    let (mut lost, out) = (0, -0.5 * field.spacing as f32);
    for (value, _) in (field.values.iter_mut().zip(labels)).filter(|(_, label)| loose(*label)) {
        *value = out;
        lost += 1;
    }
    let volume = f64::from(lost) * field.spacing.powi(3);
    Some((pieces.len() - 1, volume))
}

/// First and last of the interval with the largest positive sum (Kadane); none when no value is positive.
fn best_interval(worth: impl Iterator<Item = f64>) -> Option<[usize; 2]> {
    let (mut sum, mut first) = (0.0, 0);
    let mut best: Option<(f64, [usize; 2])> = None;
    for (k, w) in worth.enumerate() {
        if sum <= 0.0 {
            (sum, first) = (0.0, k);
        }
        sum += w;
        if sum > best.map_or(0.0, |b| b.0) {
            best = Some((sum, [first, k]));
        }
    }
    best.map(|b| b.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_interval_is_that_of_all_pairs() {
        let cases = [
            vec![1.0, -0.4, 1.0, -2.0, 1.0],
            vec![-1.0, -1.0],
            vec![1.0, 1.0, -0.1, -0.1, 1.0],
        ];
        for worth in cases {
            let mut best = (0.0, None);
            for a in 0..worth.len() {
                for b in a..worth.len() {
                    let sum: f64 = worth[a..=b].iter().sum();
                    if sum > best.0 + 1e-12 {
                        best = (sum, Some([a, b]));
                    }
                }
            }
            assert_eq!(best_interval(worth.iter().copied()), best.1);
        }
    }

    #[test]
    fn keeping_intervals_leaves_no_loose_pieces() {
        let mut field = VoxelGrid::filled(Vec3::zeros(), 2.0, [5, 2, 2], 1.0_f32);
        assert_eq!(drop_loose(&mut field), None);
        for v in 0..field.values.len() {
            if v % 5 == 3 {
                field.values[v] = -1.0;
            }
        }
        assert_eq!(drop_loose(&mut field), Some((1, 32.0)));
        let left = field.values.iter().filter(|f| **f > 0.0).count();
        assert_eq!(left, 12);
    }

    #[test]
    fn a_filled_line_has_one_hill() {
        let mut line = [-3.0, -1.0, 2.0, -1.0, -4.0, 1.0, -2.0];
        fill_line(&mut line);
        assert_eq!(line, [-3.0, -1.0, 2.0, 1.0, 1.0, 1.0, -2.0]);
    }
}
