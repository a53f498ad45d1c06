//! Edits of the proposal's radii, before everything that is made from them.

use super::ReconstructOptions;
use super::bodies::Bodies;
use super::error::{PipelineError, StageError};
use super::feeding::{belonging, keep_free, solid_of};
use super::record::Record;
use crate::edit::{cells_of, check_edits, edit_radii, grow};
use crate::medial;
use crate::monitor::Monitor;
use crate::radii;
use crate::remesh::Remeshed;
use crate::report::EditBlock;
use crate::skeleton;

/// Name of this stage in progress and warnings.
const STAGE: &str = "edit";
/// Walls are kept this many voxels thick at least, as radii.
const LEAST: f64 = 1.0;

/// The proposal with the edits of the options; none when there are none.
///
/// 1. The skeleton of the proposal and its radii; points that belong to non-design bodies are kept.
/// 2. The edits in their order ([`edit_radii`]).
/// 3. The proposal's field moves by what the radii changed ([`grow`]) and is remeshed: where gaps close or walls vanish, the
///    topology changes here, with a warning, and is known to all later stages.
///
/// # Errors
/// Those of edits that hold nothing or thin too much, and of the stages.
pub(super) fn edited(
    record: &mut Record,
    from: &Remeshed,
    bodies: &Bodies,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<Option<Remeshed>, PipelineError> {
    if options.edits.is_empty() {
        return Ok(None);
    }
    record.stage("options", || check_edits(&options.edits))?;
    let voxel = from.field.spacing;
    let axis = record.stage("medial", || {
        medial::medial_axis(&from.field, &options.medial, monitor)
    })?;
    let before = record.stage("skeleton", || {
        let mut quads = skeleton::quad_skeleton(&axis.mesh, voxel, &options.skeleton, monitor)?;
        radii::smooth(&mut quads.skeleton, options.radii.smoothing);
        Ok::<_, StageError>(quads.skeleton)
    })?;
    let mut after = before.clone();
    let kept = belonging(bodies, &before.points, &before.radii);
    let done = record.stage(STAGE, || {
        edit_radii(&mut after, &kept, &options.edits, LEAST * voxel)
    })?;
    let changed = record.stage(STAGE, || {
        let pairs = after.radii.iter().zip(&before.radii);
        let growth: Vec<f64> = pairs.map(|(a, b)| a - b).collect();
        let surface = from.solid.mesh();
        let mut field = grow(&from.field, surface, &cells_of(&before), &growth);
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
        edits: done,
    });
    Ok(Some(changed))
}
