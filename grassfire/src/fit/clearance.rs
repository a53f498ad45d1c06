//! What the body is fitted to near non-design bodies: it ends inside their walls.

use rayon::prelude::*;

use crate::Vec3;
use crate::mesh::Bvh;
use crate::remesh::films::{Beside, FILM, Walls};
use crate::remesh::{Bosses, Capsule};
use crate::voxel::VoxelGrid;

/// Outside the walls the drawing fades over this many voxels; over more of them members would lose volume.
const FADE: f64 = 1.0;
/// The body stays below walls at least so far where there is a film, voxels.
const BELOW: f64 = 0.5;

/// The field whose surface the body should follow, so that its union with the bodies cuts cleanly.
///
/// A proposal contains its non-design bodies, so a body fitted to it hugs their walls, and the union is full of slivers.
/// 1. Where the proposal's surface runs along a wall it is drawn `depth` mm into that body, fading out over one voxel
///    around it. Where a member meets the wall it runs on into it.
/// 2. Where `films` go, one over a wall, up to 1.5 voxels thick, does: there the body ends half a voxel below the wall. From 2.5 voxels
///    on it stays.
/// 3. In a bore it is moved `depth` mm into the hole, which is cut after the union: an eye keeps its thickness.
///
/// `field` is the signed distance to the proposal, mm, positive inside. The topology of the result may differ from that
/// of `field`; it is for fitting only. It does not depend on the number of threads.
pub fn clear_of(
    field: &VoxelGrid<f32>,
    bosses: &Bosses,
    depth: f64,
    films: bool,
) -> VoxelGrid<f32> {
    let bvh = Bvh::new(&bosses.surface);
    let (Some(walls), true) = (Walls::new(&bosses.surface, &bvh), depth > 0.0) else {
        return field.clone();
    };
    let voxel = field.spacing;
    let outside = if films { FILM[1] } else { FADE } * voxel;
    let below = depth.min(BELOW * voxel);
    let value = |(index, &f): (usize, &f32)| {
        let [i, j, k] = field.ijk(index);
        let p = field.origin + voxel * Vec3::new(i as f64, j as f64, k as f64);
        let f = f64::from(f);
        let Some(Beside { s, along, film }) = walls.beside(field, &p, f, outside) else {
            return f as f32;
        };
        let drawn = f - depth * along * (1.0 + s / (FADE * voxel)).clamp(0.0, 1.0);
        let film = if films { film } else { 0.0 };
        let drawn = drawn.min(f + film * ((s - below).min(f) - f));
        let band = bosses
            .bores
            .iter()
            .map(|bore| into_bore(bore, &p, depth, voxel));
        drawn.max(band.fold(f64::NEG_INFINITY, f64::max).min(s - depth)) as f32
    };
    VoxelGrid {
        values: field.values.par_iter().enumerate().map(value).collect(),
        ..field.clone()
    }
}

/// Signed distance to a tube that lines a bore: from `depth` inside the hole to somewhat outside its wall.
fn into_bore(bore: &Capsule, p: &Vec3, depth: f64, voxel: f64) -> f64 {
    let axis = bore.b - bore.a;
    let along = (p - bore.a).dot(&axis) / axis.norm_squared().max(1e-12);
    let radial = (p - bore.a - along * axis).norm();
    if !(0.0..=1.0).contains(&along) || radial > bore.radius + 2.0 * voxel {
        return f64::NEG_INFINITY;
    }
    radial - (bore.radius - depth).max(0.3 * bore.radius)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::TriMesh;

    fn grid(f: impl Fn(&Vec3) -> f64) -> VoxelGrid<f32> {
        let mut grid = VoxelGrid::filled(Vec3::repeat(-12.0), 0.5, [49, 49, 49], 0.0_f32);
        for v in 0..grid.values.len() {
            let [i, j, k] = grid.ijk(v);
            let p = grid.origin + 0.5 * Vec3::new(i as f64, j as f64, k as f64);
            grid.values[v] = f(&p) as f32;
        }
        grid
    }

    fn ball(radius: f64) -> TriMesh {
        const N: u32 = 48;
        let mut mesh = TriMesh::default();
        let at = |i: u32, j: u32| {
            let (s, c) = (std::f64::consts::PI * f64::from(i) / f64::from(N)).sin_cos();
            let (t, d) = (std::f64::consts::TAU * f64::from(j % N) / f64::from(N)).sin_cos();
            radius * Vec3::new(s * d, s * t, c)
        };
        for i in 0..N {
            for j in 0..N {
                for corners in [
                    [(i, j), (i + 1, j), (i + 1, j + 1)],
                    [(i, j), (i + 1, j + 1), (i, j + 1)],
                ] {
                    let first = mesh.points.len() as u32;
                    mesh.points.extend(corners.map(|(i, j)| at(i, j)));
                    mesh.triangles.push([first, first + 1, first + 2]);
                }
            }
        }
        mesh
    }

    #[test]
    fn a_wall_is_left_and_a_member_runs_on() {
        // A ball with a bar along x.
        let proposal = |p: &Vec3| (5.0 - p.norm()).max(2.0 - p.yz().norm());
        let bosses = Bosses {
            surface: ball(5.0),
            ..Bosses::default()
        };
        let cleared = clear_of(&grid(proposal), &bosses, 0.5, false);
        // The wall's own surface has moved in by the depth, away from the member.
        assert!((cleared.sample(&Vec3::new(0.0, 4.5, 0.0))).abs() < 0.05);
        assert!((cleared.sample(&Vec3::new(0.0, 0.0, -4.5))).abs() < 0.05);
        // The bar goes through the wall as thick as before.
        assert!(cleared.sample(&Vec3::new(5.0, 1.8, 0.0)) > 0.0);
        assert!((cleared.sample(&Vec3::new(7.0, 2.0, 0.0))).abs() < 0.02);
    }

    /// The copy of a boss in a proposal of coarse voxels was larger than the boss here and there, and stood out of its wall in patches.
    #[test]
    fn a_film_over_a_wall_goes_and_a_thick_member_along_it_stays() {
        // A ball 1.2 voxels larger than its body, and a bar; another 4 voxels larger.
        let bar = |p: &Vec3| 2.0 - p.yz().norm();
        let bosses = Bosses {
            surface: ball(5.0),
            ..Bosses::default()
        };
        let cleared = |more: f64| {
            clear_of(
                &grid(|p| (5.0 + more - p.norm()).max(bar(p))),
                &bosses,
                0.5,
                true,
            )
        };
        let film = cleared(0.6);
        for p in [Vec3::new(0.0, 4.9, 0.0), Vec3::new(0.0, 0.0, -5.3)] {
            assert!(film.sample(&p) < 0.0);
        }
        assert!(film.sample(&Vec3::new(0.0, 4.6, 0.0)) > 0.0);
        assert!(film.sample(&Vec3::new(6.5, 1.0, 0.0)) > 0.5);
        assert!(cleared(2.0).sample(&Vec3::new(0.0, 6.9, 0.0)) > 0.0);
    }

    #[test]
    fn an_eye_keeps_its_thickness() {
        // A long tube of 6 mm with a bore of 3 mm.
        let proposal = |p: &Vec3| (6.0 - p.xy().norm()).min(p.xy().norm() - 3.0);
        let mut surface = ball(6.0);
        for p in &mut surface.points {
            p.z *= 20.0;
        }
        let (a, b) = (Vec3::new(0.0, 0.0, -11.0), Vec3::new(0.0, 0.0, 11.0));
        let bores = vec![Capsule { a, b, radius: 3.0 }];
        let cleared = clear_of(
            &grid(proposal),
            &Bosses {
                surface,
                bores,
                ..Bosses::default()
            },
            0.5,
            false,
        );
        assert!(cleared.sample(&Vec3::new(2.6, 0.0, 0.0)) > 0.0);
        assert!(cleared.sample(&Vec3::new(2.3, 0.0, 0.0)) < 0.0);
        assert!((cleared.sample(&Vec3::new(5.5, 0.0, 0.0))).abs() < 0.1);
    }

    #[test]
    fn without_bodies_nothing_changes() {
        let field = grid(|p| 5.0 - p.norm());
        assert_eq!(
            clear_of(&field, &Bosses::default(), 0.5, true).values,
            field.values
        );
    }
}
