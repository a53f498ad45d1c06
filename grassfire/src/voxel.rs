//! Regular grids of values.

use crate::Vec3;

/// Values at the centres of cubic voxels; `index = (k * ny + j) * nx + i` (x runs fastest).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct VoxelGrid<T> {
    /// Centre of voxel (0, 0, 0), mm.
    pub origin: Vec3,
    /// Edge of a voxel, mm.
    pub spacing: f64,
    /// Voxels along x, y, z.
    pub dims: [usize; 3],
    /// One value a voxel.
    pub values: Vec<T>,
}

impl<T: Clone> VoxelGrid<T> {
    /// A grid filled with `value`.
    pub fn filled(origin: Vec3, spacing: f64, dims: [usize; 3], value: T) -> Self {
        Self {
            origin,
            spacing,
            dims,
            values: vec![value; dims[0] * dims[1] * dims[2]],
        }
    }
}

impl<T> VoxelGrid<T> {
    /// Index into `values` of voxel (i, j, k).
    #[inline]
    pub fn index(&self, i: usize, j: usize, k: usize) -> usize {
        (k * self.dims[1] + j) * self.dims[0] + i
    }

    /// (i, j, k) of an index into `values`.
    #[inline]
    pub fn ijk(&self, index: usize) -> [usize; 3] {
        let i = index % self.dims[0];
        let j = index / self.dims[0] % self.dims[1];
        [i, j, index / (self.dims[0] * self.dims[1])]
    }

    /// Centre of voxel (i, j, k), mm.
    #[inline]
    pub fn centre(&self, i: usize, j: usize, k: usize) -> Vec3 {
        self.origin + self.spacing * Vec3::new(i as f64, j as f64, k as f64)
    }

    /// Position in voxel units: (0, 0, 0) is the centre of the first voxel.
    #[inline]
    pub fn to_grid(&self, p: &Vec3) -> Vec3 {
        (p - self.origin) / self.spacing
    }

    /// Position in mm of a position in voxel units.
    #[inline]
    pub fn to_mm(&self, p: &Vec3) -> Vec3 {
        self.origin + self.spacing * p
    }
}

impl VoxelGrid<f32> {
    /// Trilinear value at `p` (mm); outside the grid the nearest border value.
    pub fn sample(&self, p: &Vec3) -> f64 {
        let (cell, t) = self.cell(p);
        let mut value = 0.0;
        for corner in 0..8 {
            let (weight, index) = self.corner(&cell, &t, corner);
            value += weight * f64::from(self.values[index]);
        }
        value
    }

    /// Trilinear interpolation of the central-difference gradient at `p` (value per mm).
    pub fn gradient(&self, p: &Vec3) -> Vec3 {
        let (cell, t) = self.cell(p);
        let mut gradient = Vec3::zeros();
        for corner in 0..8 {
            let (weight, index) = self.corner(&cell, &t, corner);
            if weight != 0.0 {
                gradient += weight * self.voxel_gradient(index);
            }
        }
        gradient
    }

    fn cell(&self, p: &Vec3) -> ([usize; 3], [f64; 3]) {
        let g = self.to_grid(p);
        let mut cell = [0; 3];
        let mut t = [0.0; 3];
        for a in 0..3 {
            let last = self.dims[a].saturating_sub(1);
            let x = if g[a].is_finite() {
                g[a].clamp(0.0, last as f64)
            } else {
                0.0
            };
            cell[a] = (x as usize).min(last.saturating_sub(1));
            t[a] = x - cell[a] as f64;
        }
        (cell, t)
    }

    fn corner(&self, cell: &[usize; 3], t: &[f64; 3], corner: usize) -> (f64, usize) {
        let mut weight = 1.0;
        let mut at = *cell;
        for a in 0..3 {
            if corner >> a & 1 == 1 {
                weight *= t[a];
                at[a] = (at[a] + 1).min(self.dims[a] - 1);
            } else {
                weight *= 1.0 - t[a];
            }
        }
        (weight, self.index(at[0], at[1], at[2]))
    }

    fn voxel_gradient(&self, index: usize) -> Vec3 {
        let at = self.ijk(index);
        let stride = [1, self.dims[0], self.dims[0] * self.dims[1]];
        let mut gradient = Vec3::zeros();
        for a in 0..3 {
            let back = if at[a] > 0 { stride[a] } else { 0 };
            let ahead = if at[a] + 1 < self.dims[a] {
                stride[a]
            } else {
                0
            };
            let span =
                (usize::from(back > 0) + usize::from(ahead > 0)).max(1) as f64 * self.spacing;
            gradient[a] = f64::from(self.values[index + ahead] - self.values[index - back]) / span;
        }
        gradient
    }
}
