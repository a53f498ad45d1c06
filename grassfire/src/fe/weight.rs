//! Body forces: a share of the force on every element goes to each of its nodes.

use rayon::prelude::*;

use super::frame::Frame;
use super::galerkin::corner;
use super::grid::NodeGrid;
use super::window::sums_around;

/// The material that body forces act on.
pub(super) struct Weight {
    /// Field of elements: share of material, 0 to 1.
    shares: Vec<f64>,
    /// Scalar field of nodes: full elements that hang on the node.
    nodes: Vec<f64>,
}

impl Weight {
    /// Elements with a modulus are full.
    pub fn new(grid: &NodeGrid, e: &[f64]) -> Self {
        let full = |&e: &f64| if e > 0.0 { 1.0 } else { 0.0 };
        let mut out = Self {
            shares: e.iter().map(full).collect(),
            nodes: grid.scalar(),
        };
        out.sum_up(grid);
        out
    }

    /// Takes new shares of `voxels`, places in `[z][y][x]` over `dims`.
    pub fn set(
        &mut self,
        grid: &NodeGrid,
        [nx, ny, _]: [usize; 3],
        voxels: &[u32],
        shares: &[f64],
    ) {
        for (&v, &share) in voxels.iter().zip(shares) {
            let v = v as usize;
            let at = [v % nx, v / nx % ny, v / (nx * ny)];
            if let Some(place) = grid.place(at) {
                self.shares[grid.first(at[2]) + place] = share;
            }
        }
        self.sum_up(grid);
    }

    fn sum_up(&mut self, grid: &NodeGrid) {
        sums_around(
            grid,
            &self.shares,
            |share| share,
            &mut self.nodes,
            |sum| sum / 8.0,
        );
    }

    /// Forces of a body force (N/mm3) on free degrees of freedom as places and values, ascending; elements have edge `h`.
    pub fn forces<'a>(
        &'a self,
        frame: &'a Frame,
        h: f64,
        force: [f64; 3],
    ) -> impl Iterator<Item = (usize, f64)> + 'a {
        let grid = &frame.grid;
        let planes = (0..=grid.n[2]).flat_map(|z| (0..3).map(move |c| (z, c)));
        let all = planes.flat_map(move |(z, c)| {
            let (first, count) = (grid.first(z), grid.count(z));
            let volumes = self.nodes[first..first + count].iter();
            let at = 3 * first + c * count;
            (at..).zip(volumes.map(move |n| n * h.powi(3) * force[c]))
        });
        all.filter(|(at, f)| *f != 0.0 && frame.fixed.binary_search(at).is_err())
    }

    /// The sum of [`Weight::forces`], N.
    pub fn sum(&self, frame: &Frame, h: f64, force: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|c| {
            let mut only = [0.0; 3];
            only[c] = force[c];
            self.forces(frame, h, only).map(|(_, f)| f).sum()
        })
    }
}

/// Adds the work of `force` on every one of `voxels`, were they full, to `out`.
pub(super) fn add_work(
    grid: &NodeGrid,
    [nx, ny, _]: [usize; 3],
    u: &[f64],
    force: [f64; 3],
    voxels: &[u32],
    out: &mut [f64],
) {
    let pairs = out.par_iter_mut().zip(voxels);
    pairs.for_each(|(out, &v)| {
        let v = v as usize;
        let at = [v % nx, v / nx % ny, v / (nx * ny)];
        for a in 0..8 {
            for (c, f) in force.iter().enumerate() {
                let place = grid.node(corner(at, a), c);
                *out += f / 8.0 * place.map_or(0.0, |place| u[place]);
            }
        }
    });
}
