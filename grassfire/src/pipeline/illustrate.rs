//! A picture of every stage, all from the same side.

use rayon::prelude::*;

use super::bodies::Bodies;
use super::measure::REGION_MARGIN;
use super::shape::Shape;
use super::union::Part;
use crate::medial::{MedialAxis, Poles};
use crate::mesh::Bvh;
use crate::monitor::Monitor;
use crate::remesh::{Remeshed, split_long_edges};
use crate::report::render::{RenderError, pictures::Studio};
use crate::report::{Picture, ReportError, ReportOptions};

/// Edge of the triangles that carry the colours of the deviation, voxels.
const PIECE: f64 = 3.0;

type Shot<'a> = Box<dyn Fn(&Studio) -> Result<Picture, RenderError> + Sync + 'a>;

/// What the pictures show: the result of every stage.
pub(super) struct Stages<'a> {
    pub(super) remeshed: &'a Remeshed,
    pub(super) poles: &'a Poles,
    pub(super) axis: &'a MedialAxis,
    pub(super) shape: &'a Shape,
    pub(super) part: &'a Part,
    pub(super) non_design: &'a Bodies,
}

/// Draws proposal, thickness, medial axis, skeleton, body, part and its deviation from the proposal.
pub(super) fn pictures(
    stages: &Stages,
    options: &ReportOptions,
    monitor: &Monitor,
) -> Result<Vec<Picture>, super::StageError> {
    let Stages {
        remeshed,
        poles,
        axis,
        shape,
        part,
        non_design,
    } = *stages;
    if !options.pictures {
        return Ok(Vec::new());
    }
    monitor.step("pictures", "drawing", 0.0)?;
    let proposal = remeshed.solid.mesh();
    let studio = Studio::new(&proposal.points, options.picture_size());
    // Plane faces have few triangles: colours between their corners would tell of the corners only.
    let fine = split_long_edges(&part.mesh, PIECE * remeshed.field.spacing);
    let voxels = deviation(remeshed, &fine.points, non_design);
    let bodies: Vec<u32> = (1..=part.non_design.len() as u32).collect();
    let shots: Vec<Shot> = vec![
        Box::new(|studio| studio.proposal(proposal)),
        Box::new(|studio| studio.thickness(proposal, &poles.thickness)),
        Box::new(|studio| studio.medial(&axis.mesh)),
        Box::new(|studio| studio.skeleton(&shape.skeleton.skeleton)),
        Box::new(|studio| studio.body(&shape.fitted.mesh)),
        Box::new(|studio| studio.solid(&part.mesh, &bodies)),
        Box::new(|studio| studio.error(&fine, &voxels)),
    ];
    let drawn: Result<Vec<Picture>, RenderError> =
        shots.par_iter().map(|shot| shot(&studio)).collect();
    Ok(drawn.map_err(ReportError::from)?)
}

/// Signed distance of points of the part to the proposal, voxels; positive outside.
///
/// NaN near non-design bodies, where the proposal is not the reference: drawn grey.
fn deviation(remeshed: &Remeshed, points: &[crate::Vec3], non_design: &Bodies) -> Vec<f64> {
    let field = &remeshed.field;
    let nearest = Bvh::new(remeshed.solid.mesh());
    let region = non_design.region(REGION_MARGIN * field.spacing);
    let signed = |p: &crate::Vec3| {
        if region.contains(p) {
            return f64::NAN;
        }
        let distance = nearest
            .nearest(p, f64::INFINITY)
            .map_or(0.0, |hit| hit.distance);
        -distance.copysign(field.sample(p)) / field.spacing
    };
    points.par_iter().map(signed).collect()
}
