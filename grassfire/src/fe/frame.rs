//! What all operators of one problem share: the finest grid, its fixed degrees of freedom and its springs.

use std::collections::HashMap;

use nalgebra::Matrix3;

use super::grid::NodeGrid;
use super::rigid::RigidModes;
use super::springs::{SpringNode, spring_nodes};

/// The finest grid and what holds it.
pub(super) struct Frame {
    pub grid: NodeGrid,
    /// Fixed degrees of freedom: places in a node field, ascending.
    pub fixed: Vec<usize>,
    /// Nodes that springs hold.
    pub springs: Vec<SpringNode>,
    /// Motions of the part that only they hold.
    pub rigid: Option<RigidModes>,
    /// By number of the element `[z][y][x]`: bit `3 corner + component` is set where fixed.
    masks: HashMap<usize, u32>,
    /// The elements of `masks`, ascending.
    masked: Vec<[usize; 3]>,
    rows: Vec<bool>,
}

impl Frame {
    /// `fixed`: (node, component) pairs, `springs`: nodes with stiffness, N/mm; doubles are allowed.
    pub fn new(
        grid: NodeGrid,
        fixed: &[([usize; 3], usize)],
        springs: &[([usize; 3], Matrix3<f64>)],
    ) -> Self {
        let n = grid.n;
        let mut places: Vec<usize> = fixed
            .iter()
            .filter_map(|&(node, c)| grid.node(node, c))
            .collect();
        places.sort_unstable();
        places.dedup();
        let mut masks: HashMap<usize, u32> = HashMap::new();
        let mut masked = Vec::new();
        let mut rows = vec![false; n[1] * n[2]];
        for &(node, c) in fixed {
            for corner in 0..8 {
                let below = |d: usize| node[d].checked_sub(corner >> d & 1).filter(|&i| i < n[d]);
                let (Some(x), Some(y), Some(z)) = (below(0), below(1), below(2)) else {
                    continue;
                };
                let mask = masks.entry((z * n[1] + y) * n[0] + x).or_insert_with(|| {
                    masked.push([x, y, z]);
                    0
                });
                *mask |= 1 << (3 * corner + c);
                rows[z * n[1] + y] = true;
            }
        }
        masked.sort_unstable();
        let mut out = Self {
            springs: spring_nodes(&grid, &places, springs),
            rigid: None,
            grid,
            fixed: places,
            masks,
            masked,
            rows,
        };
        out.rigid = RigidModes::new(&out, fixed);
        out
    }

    /// All elements with fixed corners, in order.
    pub fn masks(&self) -> impl Iterator<Item = ([usize; 3], u32)> + '_ {
        self.masked.iter().map(|&at| (at, self.mask(at)))
    }

    #[inline]
    pub fn mask(&self, [x, y, z]: [usize; 3]) -> u32 {
        let n = self.grid.n;
        let element = (z * n[1] + y) * n[0] + x;
        self.masks.get(&element).copied().unwrap_or(0)
    }

    #[inline]
    pub fn row_has_masks(&self, y: usize, z: usize) -> bool {
        self.rows[z * self.grid.n[1] + y]
    }
}
