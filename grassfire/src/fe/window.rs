//! Rows of a field around one row of nodes, written out in full.

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
