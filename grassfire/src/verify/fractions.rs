//! The share of material in every voxel of a grid.

use super::VerifyError;
use crate::Vec3;
use crate::casting::mould::{Lattice, dexels_on};
use crate::mesh::TriMesh;
use crate::topopt::{FROZEN, OUTSIDE, Problem};

/// Shares of material on a grid.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Fractions {
    /// Lower corner of voxel (0, 0, 0), mm.
    pub origin: Vec3,
    /// Edge of a voxel, mm.
    pub h: f64,
    /// Voxels along x, y, z.
    pub dims: [usize; 3],
    /// 0 to 1, `[z][y][x]`.
    pub values: Vec<f64>,
}

impl Fractions {
    /// Volume of the material, mm3.
    pub fn volume(&self) -> f64 {
        self.values.iter().sum::<f64>() * self.h.powi(3)
    }

    /// Voxels with material.
    pub fn elements(&self) -> usize {
        self.values.iter().filter(|&&f| f > 0.0).count()
    }

    /// The voxel around a point; the nearest one when it lies outside of the grid.
    pub(super) fn cell_of(&self, p: &Vec3) -> [usize; 3] {
        let r = (p - self.origin) / self.h;
        [0, 1, 2].map(|d| (r[d].floor().max(0.0) as usize).min(self.dims[d].saturating_sub(1)))
    }

    /// Where a node lies, mm.
    pub fn node_place(&self, node: [usize; 3]) -> Vec3 {
        self.origin + self.h * Vec3::from(node.map(|i| i as f64))
    }

    /// The grid as a problem whose material is all frozen: indices and places of nodes and voxels.
    pub(super) fn problem(&self) -> Problem {
        let label = |&f: &f64| if f > 0.0 { FROZEN } else { OUTSIDE };
        Problem {
            origin: self.origin,
            h: self.h,
            dims: self.dims,
            labels: self.values.iter().map(label).collect(),
            ..Problem::default()
        }
    }
}

/// Shares this near to 0 and 1 are rounding.
const ROUNDING: f64 = 1e-6;
/// Volumes by lines and by triangles that differ by more than this share are no accident: the surface is not closed.
const OPEN: f64 = 0.02;
/// Lines lie this far (in line distances) beside their even places: planes of CAD parts would hold them.
const ASIDE: [f64; 2] = [1.3e-5, 1.7e-5];

/// Measures the share of a closed surface in every voxel of a grid.
///
/// 1. Every voxel is pierced by `lines` x `lines` lines along x, y and z each; the intervals of material on them are exact.
/// 2. Of the three directions the one counts in which most lines enter or leave the material in the voxel: across the
///    surface, so that faces along the voxels are exact too. The share is the mean length of its intervals over the edge.
/// 3. The sum is compared with the volume by the triangles.
///
/// # Errors
/// [`VerifyError::Empty`]; [`VerifyError::Open`] when the volumes differ by more than 2 %.
pub fn fractions(
    mesh: &TriMesh,
    origin: Vec3,
    h: f64,
    dims: [usize; 3],
    lines: usize,
) -> Result<Fractions, VerifyError> {
    let count = dims.iter().product();
    let mut out = Fractions {
        origin,
        h,
        dims,
        values: vec![0.0; count],
    };
    let mut most = vec![0_u16; count];
    for axis in 0..3 {
        let found = along(mesh, &out, axis, lines);
        for (v, (length, cut)) in found.into_iter().enumerate() {
            if axis == 0 || cut > most[v] {
                out.values[v] = f64::from(length) / (lines * lines) as f64;
                most[v] = cut;
            }
        }
    }
    for f in &mut out.values {
        if *f < ROUNDING {
            *f = 0.0;
        } else if *f > 1.0 - ROUNDING {
            *f = 1.0;
        }
    }
    let (found, wanted) = (out.volume(), mesh.volume());
    if found <= 0.0 {
        return Err(VerifyError::Empty);
    }
    if (found - wanted).abs() > OPEN * wanted.abs() {
        return Err(VerifyError::Open { found, wanted });
    }
    Ok(out)
}

/// For every voxel the length of material on its lines along an axis (in edges, summed), and how many of them enter or
/// leave the material in it.
fn along(mesh: &TriMesh, grid: &Fractions, axis: usize, lines: usize) -> Vec<(f32, u16)> {
    let cut = dexels_on(mesh, &lattice(grid, axis, lines));
    let [nx, ny, nz] = grid.dims;
    let stride = [1, nx, nx * ny];
    let [u, v] = across(axis);
    let mut out = vec![(0.0_f32, 0_u16); nx * ny * nz];
    for line in 0..cut.start.len() - 1 {
        let (i, j) = (line % cut.dims[0] / lines, line / cut.dims[0] / lines);
        let first = i * stride[u] + j * stride[v];
        for &[a, b] in cut.line(line) {
            let [a, b] = [a, b].map(|x| (x - grid.origin[axis]) / grid.h);
            let last = grid.dims[axis] - 1;
            let range = (a.max(0.0) as usize).min(last)..=(b.max(0.0) as usize).min(last);
            for k in range {
                let length = b.min(k as f64 + 1.0) - a.max(k as f64);
                let cell = &mut out[first + k * stride[axis]];
                cell.0 += length.max(0.0) as f32;
                cell.1 += u16::from(length > 0.0 && length < 1.0);
            }
        }
    }
    out
}

/// The two axes across another, so that the three are right-handed.
fn across(axis: usize) -> [usize; 2] {
    [(axis + 1) % 3, (axis + 2) % 3]
}

/// For every voxel whether its centre lies in the material.
pub(super) fn centres_inside(mesh: &TriMesh, origin: Vec3, h: f64, dims: [usize; 3]) -> Vec<bool> {
    let grid = Fractions {
        origin,
        h,
        dims,
        values: Vec::new(),
    };
    let cut = dexels_on(mesh, &lattice(&grid, 0, 1));
    let [nx, ny, nz] = dims;
    let mut out = vec![false; nx * ny * nz];
    for line in 0..ny * nz {
        for &[a, b] in cut.line(line) {
            let from = ((a - origin.x) / h - 0.5).ceil().max(0.0) as usize;
            let to = ((b - origin.x) / h - 0.5).floor();
            let end = if to < 0.0 {
                0
            } else {
                (to as usize + 1).min(nx)
            };
            out[line * nx..][..nx]
                .iter_mut()
                .take(end)
                .skip(from)
                .for_each(|v| *v = true);
        }
    }
    out
}

/// Lines along an axis through the middles of the squares into which the faces of voxels are cut.
fn lattice(grid: &Fractions, axis: usize, lines: usize) -> Lattice {
    let pitch = grid.h / lines as f64;
    let unit = [Vec3::x(), Vec3::y(), Vec3::z()];
    let across = across(axis);
    Lattice {
        axes: [unit[across[0]], unit[across[1]], unit[axis]],
        origin: [0, 1].map(|d| grid.origin[across[d]] + pitch * (0.5 + ASIDE[d])),
        pitch,
        dims: across.map(|d| grid.dims[d] * lines),
    }
}
