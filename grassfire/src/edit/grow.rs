//! The target of a fit after an edit: the proposal's field moved outward by what the radii grew.

use rayon::prelude::*;

use crate::Vec3;
use crate::mesh::{Bvh, TriMesh};
use crate::skeleton::Skeleton;
use crate::voxel::VoxelGrid;

/// Voxels of certain emptiness kept around everything.
pub(super) const MARGIN: f64 = 3.0;

/// `field` with its surface moved outward by the growth of the radii of the nearest place on the skeleton.
///
/// 1. The grid is padded by the largest growth.
/// 2. `field` (signed distance, mm, positive inside, exact near its surface only) is measured anew from `surface`, its
///    zero surface, for as far outside as something grows.
/// 3. Every voxel gets the growth at the nearest place on the `cells` ([`cells_of`]), interpolated between their points: the value there is the old distance plus this. On a plate of constant growth that is the exact
///    distance; elsewhere its slope is off by that of the growth, a few percent.
///
/// `growth` is new minus old radius, mm, one a point of `cells`; negative values thin. Does not depend on the number of
/// threads. Memory is one f32 a voxel of the padded grid.
pub fn grow(
    field: &VoxelGrid<f32>,
    surface: &TriMesh,
    cells: &TriMesh,
    growth: &[f64],
) -> VoxelGrid<f32> {
    grow_by(field, surface, &[(cells, growth)])
}

/// [`grow`] by several growths at once, each of its own cells: they add up.
pub fn grow_by(
    field: &VoxelGrid<f32>,
    surface: &TriMesh,
    layers: &[(&TriMesh, &[f64])],
) -> VoxelGrid<f32> {
    let bound = |pick: fn(f64, f64) -> f64| -> f64 {
        let each = layers.iter();
        each.map(|l| l.1.iter().copied().fold(0.0, pick)).sum()
    };
    let [least, most] = [bound(f64::min), bound(f64::max)];
    if most <= 0.0 && least >= 0.0 {
        return field.clone();
    }
    let places: Vec<Bvh> = layers.iter().map(|l| Bvh::new(l.0)).collect();
    let by = |p: &Vec3| {
        let each = layers.iter().zip(&places);
        let found = each.map(|((cells, growth), places)| {
            let nearest = places.nearest(p, f64::INFINITY)?;
            let corners = cells.triangles[nearest.triangle as usize];
            Some(interpolate(cells, corners, &nearest.point, growth))
        });
        found.sum()
    };
    moved(field, surface, [least, most], 2.0 * field.spacing, by)
}

/// The signed distance, mm, moved outward by `by` everywhere: of `field` only the signs count, distances are to its zero `surface`.
pub(crate) fn offset(field: &VoxelGrid<f32>, surface: &TriMesh, by: f64) -> VoxelGrid<f32> {
    moved(field, surface, [by.min(0.0), by.max(0.0)], 0.0, |_| {
        Some(by)
    })
}

/// The field with its surface moved outward by what `growth` says of each place, from `least` to `most`; the field is exact below
/// `known`.
fn moved(
    field: &VoxelGrid<f32>,
    surface: &TriMesh,
    [least, most]: [f64; 2],
    known: f64,
    growth: impl Fn(&Vec3) -> Option<f64> + Sync,
) -> VoxelGrid<f32> {
    let h = field.spacing;
    let by = [(most / h).ceil() as usize + 1; 3];
    let out = padded(field, by, by);
    let reach = most.max(-least) + MARGIN * h;
    let distances = Bvh::new(surface);
    let value = |(index, &f): (usize, &f32)| {
        let [i, j, k] = out.ijk(index);
        let p = out.centre(i, j, k);
        let f = f64::from(f);
        let exact = if f.abs() < known {
            f
        } else {
            f.signum() * distances.nearest(&p, reach).map_or(reach, |n| n.distance)
        };
        if exact.abs() >= reach {
            return exact as f32;
        }
        (exact + growth(&p).unwrap_or(0.0)) as f32
    };
    let values = out.values.par_iter().enumerate().map(value).collect();
    VoxelGrid { values, ..out }
}

/// The same field on a grid that is larger by `low` and `high` voxels at the lower and upper ends of its axes, empty there.
pub(super) fn padded(field: &VoxelGrid<f32>, low: [usize; 3], high: [usize; 3]) -> VoxelGrid<f32> {
    let h = field.spacing;
    let dims = [0, 1, 2].map(|d| low[d] + field.dims[d] + high[d]);
    let origin = field.origin - Vec3::from(low.map(|n| n as f64 * h));
    let most = low.into_iter().chain(high).max().unwrap_or(0);
    let far = -(most as f64 + MARGIN) * h;
    let mut out = VoxelGrid::filled(origin, h, dims, far as f32);
    for k in 0..field.dims[2] {
        for j in 0..field.dims[1] {
            let from = field.index(0, j, k);
            let to = out.index(low[0], j + low[1], k + low[2]);
            let row = field.dims[0];
            out.values[to..to + row].copy_from_slice(&field.values[from..from + row]);
        }
    }
    out
}

/// The cells of a skeleton: quads as two triangles each, beams as triangles without area.
pub fn cells_of(skeleton: &Skeleton) -> TriMesh {
    let quads = skeleton.quads.iter();
    let mut triangles: Vec<[u32; 3]> = quads
        .flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]])
        .collect();
    triangles.extend(skeleton.beams.iter().map(|b| [b[0], b[1], b[1]]));
    TriMesh {
        points: skeleton.points.clone(),
        triangles,
        tags: Vec::new(),
    }
}

/// Value at `p` in a triangle, or on the segment that it is when its last two corners are one point.
pub(crate) fn interpolate(mesh: &TriMesh, corners: [u32; 3], p: &Vec3, values: &[f64]) -> f64 {
    let [a, b, c] = corners.map(|v| mesh.points[v as usize]);
    let [va, vb, vc] = corners.map(|v| values[v as usize]);
    let (u, v, w) = (b - a, c - a, p - a);
    let normal = u.cross(&v);
    let area = normal.norm_squared();
    if area < 1e-18 * u.norm_squared().max(v.norm_squared()).powi(2) || area == 0.0 {
        let t = (w.dot(&u) / u.norm_squared().max(1e-300)).clamp(0.0, 1.0);
        return va + t * (vb - va);
    }
    let s = w.cross(&v).dot(&normal) / area;
    let t = u.cross(&w).dot(&normal) / area;
    va + s.clamp(0.0, 1.0) * (vb - va) + t.clamp(0.0, 1.0) * (vc - va)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::cuboid;

    /// A plate |z| < 2 over 40 x 40 mm on a grid of 1 mm, and its skeleton.
    fn plate() -> (VoxelGrid<f32>, TriMesh, Skeleton) {
        let mut field = VoxelGrid::filled(Vec3::new(-24.5, -24.5, -6.5), 1.0, [50, 50, 14], 0_f32);
        for v in 0..field.values.len() {
            let [i, j, k] = field.ijk(v);
            let p = field.centre(i, j, k);
            field.values[v] = (2.0 - p.z.abs())
                .min(20.0 - p.x.abs())
                .min(20.0 - p.y.abs()) as f32;
        }
        let corner = Vec3::new(20.0, 20.0, 2.0);
        let skeleton = Skeleton {
            points: [(-1., -1.), (1., -1.), (1., 1.), (-1., 1.)]
                .map(|(x, y)| Vec3::new(18.0 * x, 18.0 * y, 0.0))
                .to_vec(),
            radii: vec![2.0; 4],
            quads: vec![[0, 1, 2, 3]],
            beams: Vec::new(),
        };
        (field, cuboid(-corner, corner), skeleton)
    }

    #[test]
    fn the_surface_moves_by_the_growth() {
        let (field, surface, skeleton) = plate();
        assert_eq!(
            grow(&field, &surface, &cells_of(&skeleton), &[0.0; 4]),
            field
        );
        // From 1 mm at x = -18 to 5 mm at x = 18.
        let grown = grow(
            &field,
            &surface,
            &cells_of(&skeleton),
            &[1.0, 5.0, 5.0, 1.0],
        );
        for x in [-16.0, -5.0, 0.0, 7.0, 16.0] {
            let wanted = 2.0 + 3.0 + 2.0 * x / 18.0;
            let at = grown.sample(&Vec3::new(x, 3.0, wanted));
            assert!(at.abs() < 0.1, "{x}: {at}");
        }
        let border = grown.ijk(0);
        assert!(grown.values[grown.index(border[0], border[1], border[2])] < -1.0);
    }

    #[test]
    fn beams_carry_their_growth() {
        let (field, surface, mut skeleton) = plate();
        skeleton.quads.clear();
        skeleton.beams = vec![[0, 2]];
        let grown = grow(
            &field,
            &surface,
            &cells_of(&skeleton),
            &[0.0, 0.0, 2.0, 0.0],
        );
        let at = grown.sample(&Vec3::new(0.0, 0.0, 3.0));
        assert!(at.abs() < 0.1, "{at}");
    }

    #[test]
    fn two_growths_add_up() {
        let (field, surface, skeleton) = plate();
        let cells = cells_of(&skeleton);
        let [one, other] = [[1.0, 3.0, 3.0, 1.0], [1.0, 1.0, 1.0, 1.0]];
        let layers: [(&TriMesh, &[f64]); 2] = [(&cells, &one), (&cells, &other)];
        let both = grow_by(&field, &surface, &layers);
        let once = grow(&field, &surface, &cells, &[2.0, 4.0, 4.0, 2.0]);
        assert_eq!(both.dims, once.dims);
        let mut pairs = both.values.iter().zip(&once.values);
        assert!(pairs.all(|(a, b)| (a - b).abs() < 1e-4));
    }
}
