//! Where the surface should go: the field in voxel units, samples of f = 0, and nearest samples.

use super::{FitError, FitOptions, volume};
use crate::Vec3;
use crate::voxel::VoxelGrid;

/// What every start of the fit goes to.
pub(super) struct Target<'a> {
    pub field: &'a VoxelGrid<f32>,
    pub iso: IsoSamples,
    /// The volume wanted, mm3.
    pub volume: f64,
}

impl<'a> Target<'a> {
    pub fn new(field: &'a VoxelGrid<f32>, options: &FitOptions) -> Result<Self, FitError> {
        check(field)?;
        Ok(Self {
            field,
            iso: iso_samples(field, options.iso_samples)?,
            volume: options.volume.unwrap_or_else(|| volume(field)),
        })
    }
}

/// Refuses a field whose values are not finite or not as many as its voxels.
fn check(field: &VoxelGrid<f32>) -> Result<(), FitError> {
    let [nx, ny, nz] = field.dims;
    let count = nx.checked_mul(ny).and_then(|n| n.checked_mul(nz));
    let placed = field.spacing > 0.0
        && field.spacing.is_finite()
        && field.origin.iter().all(|x| x.is_finite());
    let finite = field.values.iter().all(|f| f.is_finite());
    if count != Some(field.values.len()) || field.dims.iter().any(|&n| n < 2) || !placed || !finite
    {
        return Err(FitError::BadField { dims: field.dims });
    }
    Ok(())
}

/// Samples of the iso-surface in voxel units.
#[derive(Debug, Clone, Default)]
pub(super) struct IsoSamples {
    pub points: Vec<Vec3>,
    /// Outward unit normals.
    pub normals: Vec<Vec3>,
}

/// The field around a point given in voxel units: value and gradient, both per voxel.
#[inline]
pub(super) fn value_and_gradient(field: &VoxelGrid<f32>, p: &Vec3) -> (f64, Vec3) {
    let at = field.to_mm(p);
    (field.sample(&at) / field.spacing, field.gradient(&at))
}

/// Moves `p` to f = 0 by clamped Newton steps along the gradient, and the outward normal there.
pub(super) fn flow_to_surface(field: &VoxelGrid<f32>, p: &Vec3, steps: u32) -> (Vec3, Vec3) {
    let top = Vec3::new(
        field.dims[0] as f64,
        field.dims[1] as f64,
        field.dims[2] as f64,
    ) - Vec3::repeat(1.0);
    let mut at = *p;
    for _ in 0..steps {
        let (value, gradient) = value_and_gradient(field, &at);
        let step = (value / gradient.norm_squared().max(0.04)).clamp(-2.0, 2.0);
        if !step.is_finite() {
            break;
        }
        at = (at - step * gradient).sup(&Vec3::zeros()).inf(&top);
        if step.abs() < 1e-6 {
            break;
        }
    }
    let (_, gradient) = value_and_gradient(field, &at);
    (
        at,
        (-gradient).try_normalize(1e-9).unwrap_or_else(Vec3::zeros),
    )
}

/// One point a cell that f = 0 passes (mean of the crossings of its edges), thinned to about `limit`.
fn iso_samples(field: &VoxelGrid<f32>, limit: usize) -> Result<IsoSamples, FitError> {
    let [nx, ny, nz] = field.dims;
    let mut cells = Vec::new();
    for k in 0..nz - 1 {
        for j in 0..ny - 1 {
            for i in 0..nx - 1 {
                cells.extend(cell_point(field, [i, j, k]));
            }
        }
    }
    if cells.is_empty() {
        return Err(FitError::BadField { dims: field.dims });
    }
    // Thin without the stripes that a fixed stride would leave: keep the lowest hashes.
    if cells.len() > limit {
        let hash = |i: usize| {
            (i as u64 + 1)
                .wrapping_mul(0x9e37_79b9_7f4a_7c15)
                .rotate_left(29)
                .wrapping_mul(0xbf58_476d_1ce4_e5b9)
        };
        let mut order: Vec<usize> = (0..cells.len()).collect();
        order.sort_by_key(|&i| hash(i));
        order.truncate(limit);
        order.sort_unstable();
        cells = order.into_iter().map(|i| cells[i]).collect();
    }
    let moved = cells.iter().map(|p| flow_to_surface(field, p, 3));
    let (points, normals) = moved.unzip();
    Ok(IsoSamples { points, normals })
}

fn cell_point(field: &VoxelGrid<f32>, [i, j, k]: [usize; 3]) -> Option<Vec3> {
    let values = corner_values(field, [i, j, k]);
    let inside = values.map(|f| f > 0.0);
    if inside.iter().all(|&b| b == inside[0]) || values.iter().any(|f| !f.is_finite()) {
        return None;
    }
    let corner = |c: usize| Vec3::new((c & 1) as f64, (c >> 1 & 1) as f64, (c >> 2) as f64);
    let (mut sum, mut count) = (Vec3::zeros(), 0.0);
    for a in 0..8 {
        for axis in 0..3 {
            let b = a | 1 << axis;
            if b != a && inside[a] != inside[b] {
                let t = values[a] / (values[a] - values[b]);
                sum += corner(a) + t * (corner(b) - corner(a));
                count += 1.0;
            }
        }
    }
    Some(Vec3::new(i as f64, j as f64, k as f64) + sum / count)
}

/// Field at the corners of a cell; bits 0, 1, 2 of the index are x, y, z.
pub(super) fn corner_values(field: &VoxelGrid<f32>, [i, j, k]: [usize; 3]) -> [f64; 8] {
    std::array::from_fn(|c| {
        f64::from(field.values[field.index(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2))])
    })
}

/// Points sorted into cubic cells for nearest-point queries.
pub(super) struct PointGrid {
    lo: Vec3,
    cell: f64,
    dims: [usize; 3],
    offsets: Vec<u32>,
    items: Vec<u32>,
}

impl PointGrid {
    /// Cells of about `cell` edge, larger when the points spread far.
    pub fn new(points: &[Vec3], cell: f64) -> Self {
        let first = points.first().copied().unwrap_or_else(Vec3::zeros);
        let (lo, hi) = points
            .iter()
            .fold((first, first), |(lo, hi), p| (lo.inf(p), hi.sup(p)));
        let cell = cell.max((hi - lo).max() / 400.0);
        let dims = [0, 1, 2].map(|a| (((hi[a] - lo[a]) / cell) as usize + 1).min(512));
        let mut grid = Self {
            lo,
            cell,
            dims,
            offsets: vec![0; dims.iter().product::<usize>() + 1],
            items: vec![0; points.len()],
        };
        let cells: Vec<usize> = points.iter().map(|p| grid.index(grid.cell_of(p))).collect();
        cells.iter().for_each(|&c| grid.offsets[c + 1] += 1);
        for c in 1..grid.offsets.len() {
            grid.offsets[c] += grid.offsets[c - 1];
        }
        let mut next = grid.offsets.clone();
        for (i, &c) in cells.iter().enumerate() {
            grid.items[next[c] as usize] = i as u32;
            next[c] += 1;
        }
        grid
    }

    fn cell_of(&self, p: &Vec3) -> [usize; 3] {
        [0, 1, 2]
            .map(|a| (((p[a] - self.lo[a]) / self.cell).max(0.0) as usize).min(self.dims[a] - 1))
    }

    fn index(&self, c: [usize; 3]) -> usize {
        (c[2] * self.dims[1] + c[1]) * self.dims[0] + c[0]
    }

    /// The nearest of `points` (those the grid was made of) to `p`, lowest index first; its distance.
    pub fn nearest(&self, points: &[Vec3], p: &Vec3) -> Option<(u32, f64)> {
        let centre = self.cell_of(p);
        let mut best: Option<(f64, u32)> = None;
        let reach = *self.dims.iter().max()?;
        // Cells of shell r are at least (r - 1) cells away from a query inside the box; queries
        // outside are only farther from them.
        for r in 0..=reach {
            if best.is_some_and(|(d, _)| d.sqrt() < (r as f64 - 1.0) * self.cell) {
                break;
            }
            self.visit_shell(centre, r, |i| {
                let d = (points[i as usize] - p).norm_squared();
                if best.is_none_or(|(e, j)| d < e || (d == e && i < j)) {
                    best = Some((d, i));
                }
            });
        }
        best.map(|(d, i)| (i, d.sqrt()))
    }

    fn visit_shell(&self, centre: [usize; 3], r: usize, mut visit: impl FnMut(u32)) {
        let range = |a: usize| centre[a].saturating_sub(r)..=(centre[a] + r).min(self.dims[a] - 1);
        let on_shell = |x: usize, a: usize| x.abs_diff(centre[a]) == r;
        for k in range(2) {
            for j in range(1) {
                let whole = on_shell(k, 2) || on_shell(j, 1);
                let mut cell = |i: usize| {
                    let c = self.index([i, j, k]);
                    let items = self.offsets[c] as usize..self.offsets[c + 1] as usize;
                    self.items[items].iter().for_each(|&i| visit(i));
                };
                if whole {
                    range(0).for_each(&mut cell);
                } else {
                    if centre[0] >= r {
                        cell(centre[0] - r);
                    }
                    if r > 0 && centre[0] + r < self.dims[0] {
                        cell(centre[0] + r);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ball(radius: f64) -> VoxelGrid<f32> {
        let mut field = VoxelGrid::filled(Vec3::repeat(-8.0), 0.5, [33, 33, 33], 0.0);
        for i in 0..field.values.len() {
            let [x, y, z] = field.ijk(i);
            field.values[i] = (radius - field.centre(x, y, z).norm()) as f32;
        }
        field
    }

    #[test]
    fn samples_lie_on_the_surface_with_outward_normals() {
        let field = ball(5.0);
        let iso = iso_samples(&field, 500).expect("a surface");
        assert_eq!(iso.points.len(), 500);
        for (p, n) in iso.points.iter().zip(&iso.normals) {
            let at = field.origin + field.spacing * p;
            assert!((at.norm() - 5.0).abs() < 0.05);
            assert!(at.normalize().dot(n) > 0.98);
        }
    }

    #[test]
    fn nearest_agrees_with_looking_at_all() {
        let mix = |i: u32| f64::from(i.wrapping_mul(2_654_435_761) >> 8) / f64::from(1 << 24);
        let point = |i: u32| 10.0 * Vec3::new(mix(3 * i), mix(3 * i + 1), 0.3 * mix(3 * i + 2));
        let points: Vec<Vec3> = (0..500).map(point).collect();
        let grid = PointGrid::new(&points, 0.8);
        for i in 500..700 {
            let p = 1.5 * point(i) - Vec3::repeat(2.0);
            let (_, d) = grid.nearest(&points, &p).expect("points");
            let least = points
                .iter()
                .map(|q| (q - p).norm())
                .fold(f64::INFINITY, f64::min);
            assert!((d - least).abs() < 1e-12);
        }
    }
}
