//! Films of a proposal over the walls of given bodies: copies of the bodies alone, as rough as the proposal's voxels.

use rayon::prelude::*;

use crate::Vec3;
use crate::mesh::{Bvh, TriMesh, Winding};
use crate::voxel::VoxelGrid;

/// Near the bodies distances are exact up to this many voxels; what lies deeper is left alone.
const REACH: f64 = 4.0;
/// What stands over a wall by up to the first number of voxels is the proposal's copy of the body alone, as rough as its own voxels; from
/// the second on it is a member.
pub(crate) const FILM: [f64; 2] = [1.5, 2.5];
/// Surfaces of proposal and body whose normals differ by less than the first cosine run along each other; from the
/// second on they count as crossing.
const ALONG: [f64; 2] = [0.8, 0.3];

/// Walls of given bodies beside a field.
pub(crate) struct Walls<'a> {
    surface: &'a TriMesh,
    bvh: &'a Bvh,
    winding: Winding<'a>,
    bounds: [Vec3; 2],
}

/// A place beside walls.
pub(crate) struct Beside {
    /// Signed distance to the nearest wall, mm, positive inside.
    pub s: f64,
    /// 1 where the surface of the field runs along that wall, 0 where it crosses it.
    pub along: f64,
    /// 1 where what stands over the wall is a film, 0 where it is a member.
    pub film: f64,
}

impl<'a> Walls<'a> {
    /// Nothing where there are no bodies; `bvh` is that of `surface`.
    pub fn new(surface: &'a TriMesh, bvh: &'a Bvh) -> Option<Self> {
        let (lo, hi) = bvh.bounds()?;
        Some(Self {
            surface,
            bvh,
            winding: Winding::new(bvh),
            bounds: [lo, hi],
        })
    }

    /// A place `p` where the field is `f`, in a body or at most `outside` mm away; none elsewhere, and far from the field's surface.
    pub fn beside(&self, field: &VoxelGrid<f32>, p: &Vec3, f: f64, outside: f64) -> Option<Beside> {
        let (voxel, [lo, hi]) = (field.spacing, self.bounds);
        let reach = REACH * voxel;
        let near = (0..3).all(|a| lo[a] - outside <= p[a] && p[a] <= hi[a] + outside);
        if f.abs() > reach || !near {
            return None;
        }
        let inside = self.winding.at(p) > 0.5;
        let nearest = self.bvh.nearest(p, reach);
        let distance = nearest.map_or(reach, |n| n.distance);
        let s = if inside { distance } else { -distance };
        if s <= -outside {
            return None;
        }
        let along = nearest.map_or(0.0, |n| {
            let [a, b, c] = self.surface.corners(n.triangle as usize);
            let off = (p - n.point) * if inside { 1.0 } else { -1.0 };
            let inward = off
                .try_normalize(1e-3 * voxel)
                .unwrap_or_else(|| -(b - a).cross(&(c - a)).normalize());
            let slope = field.gradient(p);
            let cosine = slope.dot(&inward) / slope.norm().max(1e-12);
            ((cosine - ALONG[1]) / (ALONG[0] - ALONG[1])).clamp(0.0, 1.0)
        });
        let film = along * ((FILM[1] - (f - s) / voxel) / (FILM[1] - FILM[0])).clamp(0.0, 1.0);
        Some(Beside { s, along, film })
    }
}

/// The signed distance `field`, mm, positive inside, without its films over the closed surface `walls` of given bodies, up to 1.5 voxels
/// thick: there it ends on the wall. From 2.5 voxels on what stands over a wall stays, between it goes in part.
pub(crate) fn without_films(field: &VoxelGrid<f32>, walls: &TriMesh) -> VoxelGrid<f32> {
    let bvh = Bvh::new(walls);
    let Some(walls) = Walls::new(walls, &bvh) else {
        return field.clone();
    };
    let value = |(index, &f): (usize, &f32)| {
        let [i, j, k] = field.ijk(index);
        let p = field.centre(i, j, k);
        let f = f64::from(f);
        let beside = walls.beside(field, &p, f, FILM[1] * field.spacing);
        let cleared = beside.map_or(f, |b| f + b.film * (b.s.min(f) - f));
        cleared as f32
    };
    VoxelGrid {
        values: field.values.par_iter().enumerate().map(value).collect(),
        ..field.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::cuboid;

    /// A proposal's copy of a boss was larger than the boss by a voxel; the part was compared with it and missed its volume, though the
    /// boss was as it was given.
    #[test]
    fn a_copy_ends_on_the_wall_of_its_body_and_a_member_over_it_stays() {
        let wall = cuboid(Vec3::repeat(-5.0), Vec3::repeat(5.0));
        let mut field = VoxelGrid::filled(Vec3::repeat(-12.0), 0.5, [49, 49, 49], 0.0_f32);
        let block = |p: &Vec3, half: f64| half - p.amax();
        for v in 0..field.values.len() {
            let [i, j, k] = field.ijk(v);
            let p = field.centre(i, j, k);
            // A copy half a millimetre too large, and a bar along x.
            field.values[v] = block(&p, 5.5).max(2.0 - p.y.abs().max(p.z.abs())) as f32;
        }
        let cleared = without_films(&field, &wall);
        let at = |x: f64, y: f64, z: f64| cleared.sample(&Vec3::new(x, y, z));
        assert!(at(0.0, 5.0, 0.0).abs() < 0.01 && at(3.0, 0.0, -5.0).abs() < 0.01);
        assert!(at(0.0, 5.25, 0.0) < -0.2);
        assert!((at(8.0, 1.0, 0.0) - 1.0).abs() < 0.01);
        assert_eq!(
            without_films(&field, &TriMesh::default()).values,
            field.values
        );
    }
}
