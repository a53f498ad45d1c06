//! Feeders as cylinders on the casting.

use super::{SolidifyError, SolidifyOptions};
use crate::Vec3;
use crate::mesh::{Bvh, TriMesh};
use crate::voxel::VoxelGrid;

/// A feeder is rammed down to a surface that is not flat, or was pointed at from above, by this share of its diameter: as
/// deep as a neck is high.
const FOOT: f64 = 0.2;

pub(super) fn up(options: &SolidifyOptions) -> Vec3 {
    Vec3::from(options.up).normalize()
}

/// Adds the feeders to the distances; gives their feet and diameters.
///
/// A feeder is a cylinder as high as it is wide. Below its foot there is metal, too, wherever the part follows within [`FOOT`]: a
/// foot on a boss that is lower than the wall beside it would hang in the air otherwise, and feed nothing.
pub(super) fn add_feeders(
    field: &mut VoxelGrid<f32>,
    mesh: &TriMesh,
    thick: f64,
    options: &SolidifyOptions,
) -> Result<Vec<(Vec3, f64)>, SolidifyError> {
    let bvh = Bvh::new(mesh);
    let up = up(options);
    let mut feeders = Vec::new();
    for (number, place) in options.feeders.iter().enumerate() {
        let place = Vec3::from(*place);
        // D / 6 is the modulus of a cylinder as high as wide.
        let diameter = if options.feeder_diameter > 0.0 {
            options.feeder_diameter
        } else {
            6.0 * crate::casting::feed::FEEDER * thick
        };
        let distance = bvh
            .nearest(&place, f64::INFINITY)
            .map_or(f64::INFINITY, |n| n.distance);
        let limit = diameter / 2.0;
        if distance > limit {
            return Err(SolidifyError::Feeder {
                feeder: number,
                place,
                distance,
                limit,
            });
        }
        feeders.push((place, diameter));
    }
    if feeders.is_empty() {
        return Ok(feeders);
    }
    *field = roomy(field, &feeders, &up);
    let part = field.clone();
    for v in 0..field.values.len() {
        let [i, j, k] = field.ijk(v);
        let p = field.centre(i, j, k);
        let depth = feeders
            .iter()
            .map(|f| cylinder(&p, f, &up).max(below(&p, f, &up, &part)))
            .fold(f64::NEG_INFINITY, f64::max);
        let value = f64::from(field.values[v]);
        field.values[v] = value.max(depth.max(-4.0 * field.spacing)) as f32;
    }
    Ok(feeders)
}

/// Height of a point over a foot and its distance from the feeder's axis, mm.
fn from_foot(p: &Vec3, foot: &Vec3, up: &Vec3) -> (f64, f64) {
    let along = (p - foot).dot(up);
    (along, (p - foot - along * up).norm())
}

/// Depth in the metal between a foot and the part below it; negative infinity where the part does not follow.
fn below(p: &Vec3, feeder: &(Vec3, f64), up: &Vec3, part: &VoxelGrid<f32>) -> f64 {
    let (foot, diameter) = feeder;
    let (along, radial) = from_foot(p, foot, up);
    let (inside, left) = (diameter / 2.0 - radial, FOOT * diameter + along);
    if along >= 0.0 || inside <= 0.0 || left <= 0.0 {
        return f64::NEG_INFINITY;
    }
    let step = part.spacing / 2.0;
    let steps = (left / step) as usize;
    let hits = (0..=steps).any(|n| part.sample(&(p - n as f64 * step * up)) > 0.0);
    if hits { inside } else { f64::NEG_INFINITY }
}

/// The field on a grid that holds the feeders, too.
fn roomy(field: &VoxelGrid<f32>, feeders: &[(Vec3, f64)], up: &Vec3) -> VoxelGrid<f32> {
    let h = field.spacing;
    let top = |v: usize| field.dims[v] as f64 - 1.0;
    let (mut lo, mut hi) = (Vec3::zeros(), Vec3::new(top(0), top(1), top(2)));
    for (foot, diameter) in feeders {
        let reach = Vec3::repeat(diameter / 2.0 + 3.0 * h);
        for end in [*foot, foot + up * *diameter] {
            lo = lo.inf(&field.to_grid(&(end - reach)));
            hi = hi.sup(&field.to_grid(&(end + reach)));
        }
    }
    let before = lo.map(|x| (-x).ceil().max(0.0) as usize);
    let dims = [0, 1, 2].map(|a| (hi[a].ceil() as usize + 1).max(field.dims[a]) + before[a]);
    let shift = Vec3::new(before.x as f64, before.y as f64, before.z as f64) * h;
    let mut out = VoxelGrid::filled(field.origin - shift, h, dims, (-4.0 * h) as f32);
    for (v, &f) in field.values.iter().enumerate() {
        let [i, j, k] = field.ijk(v);
        let at = out.index(i + before.x, j + before.y, k + before.z);
        out.values[at] = f;
    }
    out
}

/// Depth in a feeder: a cylinder from its foot to one diameter above.
fn cylinder(p: &Vec3, (foot, diameter): &(Vec3, f64), up: &Vec3) -> f64 {
    let (along, radial) = from_foot(p, foot, up);
    (diameter / 2.0 - radial).min(diameter - along).min(along)
}

/// Whether a point lies in a feeder or in reach below its foot.
pub(super) fn in_feeder(p: &Vec3, (foot, diameter): &(Vec3, f64), up: &Vec3) -> bool {
    let (along, radial) = from_foot(p, foot, up);
    radial < diameter / 2.0 && along > -FOOT * diameter && along < *diameter
}
