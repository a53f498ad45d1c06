//! The list of edits of the proposal's skeleton, before everything that is made from it.

use super::ReconstructOptions;
use super::bodies::Bodies;
use super::error::{PipelineError, StageError};
use super::feeding::{belonging, keep_free, solid_of};
use super::record::Record;
use crate::Vec3;
use crate::casting::mould::{MouldOptions, Repair, conflicts};
use crate::edit::{Edited, EditedSkeleton, check_edits, edit, material};
use crate::medial;
use crate::mesh::{Bvh, Winding};
use crate::monitor::Monitor;
use crate::radii;
use crate::remesh::Remeshed;
use crate::report::EditBlock;
use crate::skeleton::{self, Skeleton};
use crate::voxel::VoxelGrid;

/// Name of this stage in progress and warnings.
const STAGE: &str = "edit";
/// Walls are kept this many voxels thick at least, as radii.
const LEAST: f64 = 1.0;

/// The proposal with the edits of the options, and with those of a mould repair that turns or removes members; none when there are
/// none.
///
/// 1. The skeleton of the proposal and its radii; points that belong to non-design bodies are kept.
/// 2. The edits in their order ([`edit`]), then those of the repair ([`conflicts`]); one of these that is refused is left out with
///    a warning.
/// 3. The proposal's field follows ([`material`]): it moves by what radii changed, loses what was moved or deleted and gets what
///    was moved or made. Nothing comes off non-design bodies.
/// 4. It is remeshed: where gaps close or walls vanish, the topology changes here, with a warning, and is known to all later
///    stages.
///
/// # Errors
/// Those of edits that hold nothing, thin too much or cut the skeleton, and of the stages.
pub(super) fn edited(
    record: &mut Record,
    from: &Remeshed,
    bodies: &Bodies,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<Option<Remeshed>, PipelineError> {
    if options.edits.is_empty() && !options.mould.repair.edits_members() {
        return Ok(None);
    }
    record.stage("options", || check_edits(&options.edits))?;
    let voxel = from.field.spacing;
    let before = skeleton_of(record, from, options, monitor)?;
    let kept = belonging(bodies, &before.points, &before.radii);
    let mut edited = record.stage(STAGE, || {
        edit(&before, &kept, &options.edits, LEAST * voxel)
    })?;
    part_members(&mut edited, &options.mould, voxel, monitor);
    for (number, done) in edited.done.iter().enumerate() {
        if let Some(text) = topology_change(done) {
            monitor.warn(STAGE, format!("edits[{number}] ({}) {text}", done.kind));
        }
    }
    let changed = record.stage(STAGE, || {
        let mut field = material(&from.field, from.solid.mesh(), &edited);
        keep_bodies(&mut field, &from.field, bodies);
        keep_free(&mut field, &bodies.bosses.free);
        solid_of(field, bodies, options, monitor)
    })?;
    let (old, new) = (from.genus_after, changed.genus_after);
    if old != new {
        monitor.warn(
            STAGE,
            format!("the edits change the genus from {old} to {new}"),
        );
    }
    record.report.edits = Some(EditBlock {
        volume_before: from.solid.volume(),
        volume_after: changed.solid.volume(),
        edits: edited.done,
    });
    Ok(Some(changed))
}

/// The skeleton of a proposal with its smoothed radii.
pub(super) fn skeleton_of(
    record: &mut Record,
    from: &Remeshed,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<Skeleton, PipelineError> {
    let axis = record.stage("medial", || {
        medial::medial_axis(&from.field, &options.medial, monitor)
    })?;
    record.stage("skeleton", || {
        let voxel = from.field.spacing;
        let mut quads = skeleton::quad_skeleton(&axis.mesh, voxel, &options.skeleton, monitor)?;
        radii::smooth(&mut quads.skeleton, options.radii.smoothing);
        Ok::<_, StageError>(quads.skeleton)
    })
}

/// Turns or removes members that shadow each other along the draw direction, when the repair is of that kind.
fn part_members(
    edited: &mut EditedSkeleton,
    options: &MouldOptions,
    voxel: f64,
    monitor: &Monitor,
) {
    let Some(draw) = options.draw.filter(|_| options.repair.edits_members()) else {
        return;
    };
    let draw = Vec3::from(draw).normalize();
    for conflict in conflicts(&edited.skeleton, &draw, voxel) {
        let edits = match options.repair {
            Repair::Turn => conflict.turn.to_vec(),
            _ => vec![conflict.remove],
        };
        for one in edits {
            let said = match edited.add(&one, LEAST * voxel) {
                Ok(()) => format!("the repair adds the edit {one}"),
                Err(why) => format!("an edit of the repair is left out, because it {why}: {one}"),
            };
            monitor.warn(STAGE, said);
        }
    }
}

/// What an edit changed of the skeleton's topology, none when it kept it.
fn topology_change(done: &Edited) -> Option<String> {
    let (before, after) = (done.before.topology, done.after.topology);
    let figures = [
        ("pieces", before.b0, after.b0),
        ("loops", before.b1, after.b1),
        ("cavities", before.b2, after.b2),
    ];
    let changed = figures.into_iter().filter(|f| f.1 != f.2);
    let texts: Vec<String> = changed
        .map(|(what, before, after)| format!("{what} from {before} to {after}"))
        .collect();
    let text = || format!("changes the skeleton's {}", texts.join(", "));
    (!texts.is_empty()).then(text)
}

/// Gives the material of `before` inside the bodies back to a field on a grid that holds its voxels.
fn keep_bodies(field: &mut VoxelGrid<f32>, before: &VoxelGrid<f32>, bodies: &Bodies) {
    let surface = Bvh::new(&bodies.bosses.surface);
    if surface.bounds().is_none() {
        return;
    }
    let winding = Winding::new(&surface);
    for v in 0..before.values.len() {
        let [i, j, k] = before.ijk(v);
        let p = before.centre(i, j, k);
        let at = field.to_grid(&p).map(|x| x.round() as usize);
        let at = field.index(at.x, at.y, at.z);
        let old = before.values[v];
        if field.values[at] >= old || winding.at(&p) < 0.5 {
            continue;
        }
        let depth = surface
            .nearest(&p, f64::INFINITY)
            .map_or(0.0, |n| n.distance);
        field.values[at] = field.values[at].max(old.min(depth as f32));
    }
}
