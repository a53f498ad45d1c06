//! Balls about voxel centres, for openings and closings of fields.

use crate::voxel::VoxelGrid;

/// The voxels around a voxel.
pub(super) struct Ball {
    /// Steps of index to them with their lengths, mm.
    steps: Vec<(isize, f64)>,
    /// The longest of these, mm.
    reach: f64,
}

impl Ball {
    /// All voxels within `radius` voxels.
    pub(super) fn new(grid: &VoxelGrid<f32>, radius: f64) -> Self {
        let n = radius.ceil() as isize;
        let [nx, ny, _] = grid.dims.map(|d| d as isize);
        let mut steps = Vec::new();
        for k in -n..=n {
            for j in -n..=n {
                for i in -n..=n {
                    let length = ((i * i + j * j + k * k) as f64).sqrt();
                    if length <= radius {
                        steps.push(((k * ny + j) * nx + i, length * grid.spacing));
                    }
                }
            }
        }
        let reach = steps.iter().map(|s| s.1).fold(0.0, f64::max);
        Self { steps, reach }
    }

    /// How deep voxel `v` lies in the balls about the voxels around it, each as large as its value times `side`; only
    /// balls of at least `least` count. Negative outside all of them, at least the negative reach.
    pub(super) fn covered(&self, grid: &VoxelGrid<f32>, side: f64, v: usize, least: f64) -> f64 {
        let mut best = -self.reach;
        for &(step, length) in &self.steps {
            let Some(&value) = v.checked_add_signed(step).and_then(|n| grid.values.get(n)) else {
                continue;
            };
            let value = side * f64::from(value);
            if value > 0.0 && value >= least {
                best = best.max(value - length);
            }
        }
        best
    }
}
