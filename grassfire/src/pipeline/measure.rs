//! Figures of the report: topology, distance to the proposal, volume.

use super::bodies::Bodies;
use super::shape::Shape;
use super::union::Part;
use crate::medial::MedialAxis;
use crate::mesh::{Distance, DistanceOptions, two_sided};
use crate::monitor::{Cancelled, Monitor};
use crate::remesh::Remeshed;
use crate::report::{
    BodyBlock, DistanceBlock, RemeshBlock, SkeletonBlock, TopologyBlock, VolumeBlock,
};
use crate::topology::{Betti, SurfaceTopology};

/// The non-design region reaches this far from the bodies, voxels: there the proposal is not the reference.
pub(super) const REGION_MARGIN: f64 = 2.0;
/// Places farther from the proposal than this are listed, voxels.
const WORTH_NAMING: f64 = 1.5;

pub(super) fn remesh_block(remeshed: &Remeshed) -> RemeshBlock {
    RemeshBlock {
        voxel: remeshed.field.spacing,
        triangles: remeshed.solid.triangles.len(),
        volume: remeshed.solid.volume(),
        distance_max: remeshed.distance_max,
        genus_before: remeshed.genus_before,
        genus_after: remeshed.genus_after,
        changes: remeshed.changes.iter().map(Into::into).collect(),
    }
}

pub(super) fn topology_block(
    axis: &MedialAxis,
    shape: &Shape,
    united: Option<Betti>,
) -> TopologyBlock {
    // The thickening has asserted that every body is closed, oriented and manifold.
    let surface = |body: &crate::thicken::BodyTopology| SurfaceTopology {
        chi: body.chi,
        genus: i64::from(body.shells) - body.chi / 2,
        closed: true,
        manifold: true,
    };
    TopologyBlock {
        solid: axis.solid,
        complex: axis.complex,
        skeleton: shape.skeleton.topology,
        body: shape.body.bodies.iter().map(surface).collect(),
        united,
    }
}

pub(super) fn skeleton_block(axis: &MedialAxis, shape: &Shape, layout: &str) -> SkeletonBlock {
    let stats = &shape.skeleton.stats;
    SkeletonBlock {
        layout: layout.to_owned(),
        quads: stats.quads,
        beams: stats.beams,
        sheets: stats.sheets,
        seams: stats.seams,
        rims: stats.rims,
        spheres: axis.mesh.points.len(),
        regular_fraction: stats.regular_fraction,
        corner_deviation: stats.corner_deviation,
        radius: stats.radius,
        ..SkeletonBlock::default()
    }
}

pub(super) fn body_block(shape: &Shape) -> BodyBlock {
    let mesh = &shape.fitted.mesh;
    let mut valence = vec![0_u32; mesh.points.len()];
    for &v in mesh.quads.iter().flatten() {
        valence[v as usize] += 1;
    }
    BodyBlock {
        quads: mesh.quads.len(),
        extraordinary: valence.iter().filter(|n| **n != 4 && **n != 0).count(),
        self_intersections: shape.fitted.self_intersections.len(),
        folds: super::shape::flipped(&shape.fitted),
        construction: if shape.wrapped {
            "wrapped"
        } else {
            "thickened"
        }
        .to_owned(),
    }
}

/// Distance between the part and the remeshed proposal, both ways, away from the non-design region.
pub(super) fn distance(
    remeshed: &Remeshed,
    part: &Part,
    bodies: &Bodies,
    monitor: &Monitor,
) -> Result<Distance, Cancelled> {
    monitor.step("measure", "distance to the proposal", 0.0)?;
    let voxel = remeshed.field.spacing;
    let region = bodies.region(REGION_MARGIN * voxel);
    let ignore = |p: &crate::Vec3| region.contains(p);
    Ok(two_sided(
        &part.mesh,
        remeshed.solid.mesh(),
        &DistanceOptions::default(),
        Some(&ignore),
    ))
}

/// Warns of places far off.
pub(super) fn name_far_places(distance: &Distance, voxel: f64, monitor: &Monitor) {
    for (place, mm) in distance
        .worst
        .iter()
        .filter(|(_, mm)| *mm > WORTH_NAMING * voxel)
    {
        monitor.warn(
            "measure",
            format!(
                "the part is {mm:.2} mm ({:.1} voxels) from the proposal at ({:.1}, {:.1}, {:.1}) mm",
                mm / voxel,
                place.x,
                place.y,
                place.z
            ),
        );
    }
}

pub(super) fn distance_block(
    distance: &Distance,
    remeshed: &Remeshed,
    part: &Part,
) -> DistanceBlock {
    DistanceBlock {
        rms: distance.rms,
        p95: distance.p95,
        max: distance.max,
        voxel: remeshed.field.spacing,
        non_design_max: part.non_design_max,
    }
}

pub(super) fn volume_block(remeshed: &Remeshed, part: &Part) -> VolumeBlock {
    let proposal = remeshed.solid.volume();
    VolumeBlock {
        proposal,
        solid: part.volume,
        relative_difference: (part.volume - proposal) / proposal,
    }
}
