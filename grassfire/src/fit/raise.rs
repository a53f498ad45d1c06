//! What the body is fitted to over flat faces that are cut plane afterwards: it bulges over them.

use rayon::prelude::*;

use crate::Vec3;
use crate::mesh::Bvh;
use crate::non_design::Flats;
use crate::voxel::VoxelGrid;

/// Around a face its rise fades over this many voxels.
const FADE: f64 = 1.0;
/// Below a face it fades over this many voxels: so slowly that the field still falls outwards.
const DEPTH: f64 = 2.5;
/// Above a face the field changes this far beyond the rise itself, voxels.
const REACH: f64 = 3.0;
/// The proposal's surface runs along a face where the cosine of their normals is above the second, not below the first.
const ALONG: [f64; 2] = [0.3, 0.8];

/// The field whose surface bulges `rise` mm over the flat faces of the proposal, fading out over one voxel around them.
///
/// `field` is the signed distance to the proposal, mm, positive inside. It changes only close to a face, and where its surface
/// runs along it: where non-design bodies were cut out nothing grows into them. Inside, the rise fades slowly, because a jump
/// there would lead samples of the body to the wrong wall. The result is for fitting only and does not depend on the number
/// of threads. None when there is no face.
pub fn raised(field: &VoxelGrid<f32>, flats: &Flats, rise: f64) -> Option<VoxelGrid<f32>> {
    let bvh = Bvh::new(&flats.surface);
    let (lo, hi) = bvh.bounds().filter(|_| rise > 0.0)?;
    let voxel = field.spacing;
    let reach = rise + REACH * voxel;
    let near = |p: &Vec3| (0..3).all(|a| lo[a] - reach <= p[a] && p[a] <= hi[a] + reach);
    let value = |(index, &f): (usize, &f32)| {
        let [i, j, k] = field.ijk(index);
        let p = field.origin + voxel * Vec3::new(i as f64, j as f64, k as f64);
        let nearest = if near(&p) {
            bvh.nearest(&p, reach)
        } else {
            None
        };
        let Some(nearest) = nearest else {
            return f;
        };
        let flat = &flats.faces[flats.surface.tags[nearest.triangle as usize] as usize];
        let height = flat.height(&p);
        let beside = (nearest.distance.powi(2) - height * height).max(0.0).sqrt();
        let slope = field.gradient(&p);
        let cosine = -slope.dot(&flat.normal) / slope.norm().max(1e-12);
        let along = ((cosine - ALONG[0]) / (ALONG[1] - ALONG[0])).clamp(0.0, 1.0);
        let around = (1.0 - beside / (FADE * voxel)).clamp(0.0, 1.0);
        let below = (1.0 + height / (DEPTH * voxel)).clamp(0.0, 1.0);
        (f64::from(f) + rise * along * around * below) as f32
    };
    Some(VoxelGrid {
        values: field.values.par_iter().enumerate().map(value).collect(),
        ..field.clone()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::TriMesh;
    use crate::non_design::Flat;

    /// The lower half space with a flat face on its border in which x and y are between -5 and 5.
    fn half_space() -> (VoxelGrid<f32>, Flats) {
        let mut field = VoxelGrid::filled(Vec3::repeat(-10.0), 0.5, [41, 41, 41], 0.0_f32);
        for v in 0..field.values.len() {
            let k = field.ijk(v)[2];
            field.values[v] = -(field.origin.z + 0.5 * k as f64) as f32;
        }
        let corners = [[-5.0, -5.0], [5.0, -5.0], [5.0, 5.0], [-5.0, 5.0]];
        let outline: Vec<Vec3> = corners.map(|[x, y]| Vec3::new(x, y, 0.0)).to_vec();
        let face = Flat {
            normal: Vec3::z(),
            offset: 0.0,
            outline: outline.clone(),
            middle: Vec3::zeros(),
            area: 100.0,
            reason: None,
        };
        let surface = TriMesh {
            points: outline,
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            tags: vec![0, 0],
        };
        let faces = vec![face];
        let tolerance = 0.0;
        (
            field,
            Flats {
                faces,
                surface,
                tolerance,
            },
        )
    }

    #[test]
    fn the_surface_bulges_over_the_face_and_nowhere_else() {
        let (field, flats) = half_space();
        let raised = raised(&field, &flats, 0.5).expect("a face");
        for (p, surface) in [
            (Vec3::new(0.0, 0.0, 0.5), true),
            (Vec3::new(4.5, -4.5, 0.5), true),
            (Vec3::new(7.0, 0.0, 0.0), true),
            (Vec3::new(0.0, 0.0, 0.0), false),
        ] {
            assert_eq!(raised.sample(&p).abs() < 1e-6, surface, "{p:?}");
        }
    }

    #[test]
    fn a_jump_inside_led_the_body_to_the_wrong_wall() {
        let (field, flats) = half_space();
        let raised = raised(&field, &flats, 0.5).expect("a face");
        for step in -15..10 {
            let at = |s: i32| raised.sample(&Vec3::new(0.5, 0.5, 0.2 * f64::from(s)));
            assert!(at(step) - at(step + 1) > 0.05, "height {step}");
        }
    }
}
