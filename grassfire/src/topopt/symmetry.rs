//! Planes of symmetry of the design.

use super::options::SymmetryPlane;
use super::problem::DESIGN;
use super::{Problem, TopoptError};

/// Mirror images across the planes.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Symmetry {
    dims: [usize; 3],
    /// Axis, and the sum of the indices of a voxel and its image.
    planes: Vec<(usize, usize)>,
    /// Of every plane: numbers of design voxels and of their images, lower one first.
    mirrored: Vec<Vec<[u32; 2]>>,
}

impl Symmetry {
    pub fn new(problem: &Problem, planes: &[SymmetryPlane]) -> Result<Self, TopoptError> {
        let mut out = Self {
            dims: problem.dims,
            ..Self::default()
        };
        for plane in planes {
            let axis = plane.axis();
            let twice = 2.0 * (plane.at - problem.origin[axis]) / problem.h;
            let rounded = twice.round();
            let limit = 2.0 * problem.dims[axis] as f64;
            if (twice - rounded).abs() > 1e-6 || rounded < 1.0 || rounded > limit - 1.0 {
                return Err(TopoptError::Plane {
                    what: "the plane of symmetry",
                    at: plane.at,
                    h: problem.h,
                    nearest: problem.origin[axis]
                        + problem.h * rounded.clamp(1.0, limit - 1.0) / 2.0,
                });
            }
            out.planes.push((axis, rounded as usize - 1));
        }
        if out.planes.is_empty() {
            return Ok(out);
        }
        let mut numbers = vec![0u32; problem.labels.len()];
        for (number, v) in problem.design().enumerate() {
            numbers[v] = number as u32;
        }
        let mirrored = |p| -> Vec<[u32; 2]> {
            let pairs = out.pairs(p, problem);
            let design = pairs.filter(|&(i, _)| problem.labels[i] == DESIGN);
            design.map(|(i, j)| [numbers[i], numbers[j]]).collect()
        };
        out.mirrored = (0..out.planes.len()).map(mirrored).collect();
        Ok(out)
    }

    /// Pairs of voxels with the same label across plane `p`, lower index first.
    fn pairs<'a>(
        &'a self,
        p: usize,
        problem: &'a Problem,
    ) -> impl Iterator<Item = (usize, usize)> + 'a {
        let (axis, sum) = self.planes[p];
        (0..problem.labels.len()).filter_map(move |i| {
            let mut at = problem.at(i);
            let image = sum.checked_sub(at[axis]).filter(|&j| j < self.dims[axis])?;
            at[axis] = image;
            let j = problem.index(at);
            (j > i && problem.labels[i] == problem.labels[j]).then_some((i, j))
        })
    }

    /// Makes a field of the design voxels the mean of itself and its images.
    pub fn average(&self, field: &mut [f64]) {
        for &[i, j] in self.mirrored.iter().flatten() {
            let (i, j) = (i as usize, j as usize);
            let mean = 0.5 * (field[i] + field[j]);
            field[i] = mean;
            field[j] = mean;
        }
    }

    /// Copies one side of a field of the design voxels onto the others, so that it is symmetric to the last bit.
    pub fn copy(&self, field: &mut [f64]) {
        for &[i, j] in self.mirrored.iter().flatten() {
            field[j as usize] = field[i as usize];
        }
    }

    /// Largest difference between a field of the whole grid and its images, and the number of voxels without an image of the same label.
    pub fn error(&self, problem: &Problem, field: &[f64]) -> (f64, usize) {
        let mut worst: f64 = 0.0;
        let mut alone = 0;
        for p in 0..self.planes.len() {
            let mut paired = 0;
            for (i, j) in self.pairs(p, problem) {
                worst = worst.max((field[i] - field[j]).abs());
                paired += 2 * usize::from(problem.is_active(i));
            }
            let (axis, sum) = self.planes[p];
            let on_plane = (0..problem.labels.len())
                .filter(|&i| problem.is_active(i) && 2 * problem.at(i)[axis] == sum)
                .count();
            let active = (0..problem.labels.len())
                .filter(|&i| problem.is_active(i))
                .count();
            alone += active.saturating_sub(paired + on_plane);
        }
        (worst, alone)
    }
}
