//! Rows of a field around one row of nodes, written out in full.

use rayon::prelude::*;

use super::grid::{BLOCK, NodeGrid};

/// The nine rows at y-1..=y+1 and z-1..=z+1, with zeros where nothing is stored and `BLOCK` zeros at both ends: operators
/// read neighbours from it as on a full grid. Copying costs little beside the arithmetic on a row.
pub(super) struct Window<T> {
    components: usize,
    width: usize,
    rows: Vec<T>,
    /// What the places hold: y + 1 of the rows there, by the remainder of that by three.
    held: [Option<usize>; 3],
}

impl<T: Copy + Default> Window<T> {
    /// For fields of `components` on `grid`.
    pub fn new(grid: &NodeGrid, components: usize) -> Self {
        let width = (grid.n[0] + 2).next_multiple_of(BLOCK) + 2 * BLOCK;
        Self {
            components,
            width,
            rows: vec![T::default(); 9 * components * width],
            held: [None; 3],
        }
    }

    /// Forgets what it holds: another plane or another field follows.
    pub fn clear(&mut self) {
        self.held = [None; 3];
    }

    /// Moves to row (y, z); rows that it holds already are kept.
    #[inline(always)]
    pub fn load<F: Copy>(
        &mut self,
        grid: &NodeGrid,
        field: &[F],
        convert: impl Fn(F) -> T,
        y: usize,
        z: usize,
    ) {
        for above in y..y + 3 {
            if self.held[above % 3] == Some(above) {
                continue;
            }
            self.held[above % 3] = Some(above);
            for dz in 0..3 {
                for c in 0..self.components {
                    let first = ((above % 3 * 3 + dz) * self.components + c) * self.width;
                    let row = &mut self.rows[first..first + self.width];
                    let (Some(y), Some(z)) = (above.checked_sub(1), (z + dz).checked_sub(1)) else {
                        row.fill(T::default());
                        continue;
                    };
                    if y > grid.n[1] || z > grid.n[2] {
                        row.fill(T::default());
                        continue;
                    }
                    let plane = self.components * grid.first(z) + c * grid.count(z);
                    grid.write_out(&field[plane..], [y, z], &convert, row);
                }
            }
        }
    }

    /// Component `c` of the row at `y - 1 + dy`, `z - 1 + dz`; node x lies at `BLOCK + x`.
    #[inline(always)]
    pub fn row(&self, y: usize, dy: usize, dz: usize, c: usize) -> &[T] {
        let first = (((y + dy) % 3 * 3 + dz) * self.components + c) * self.width;
        &self.rows[first..first + self.width]
    }
}

/// For every node `value` of the sum of a field of elements, each after `convert`, over the eight around it.
pub(super) fn sums_around<T: Send>(
    grid: &NodeGrid,
    field: &[f64],
    convert: impl Fn(f64) -> f64 + Sync,
    out: &mut [T],
    value: impl Fn(f64) -> T + Sync,
) {
    let planes = grid.planes(1, out).enumerate();
    planes.for_each_init(
        || Window::<f64>::new(grid, 1),
        |around, (z, out)| {
            around.clear();
            for y in 0..=grid.n[1] {
                around.load(grid, field, &convert, y, z);
                for run in grid.row(y, z) {
                    for (x, out) in (run.x..).zip(&mut out[run.at..][..run.len]) {
                        let element = |i: usize| {
                            let row = around.row(y, 1 - (i >> 1 & 1), 1 - (i >> 2), 0);
                            row[BLOCK + x - (i & 1)]
                        };
                        *out = value((0..8).map(element).sum());
                    }
                }
            }
        },
    );
}
