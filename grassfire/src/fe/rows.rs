//! Rows of nodes around the rows of elements of a slab, written out in full, and the forces on them.

use std::ops::{Add, Range, Sub};

use super::grid::{BLOCK, NodeGrid};

/// What forces are added with.
pub(super) trait Number: Copy + Default + Add<Output = Self> + Sub<Output = Self> {}
impl Number for f32 {}
impl Number for f64 {}

/// Rows of one width, each with `BLOCK` places in front and behind, on whole cache lines.
struct Buffer<T> {
    data: Vec<T>,
    first: usize,
    width: usize,
}

impl<T: Number> Buffer<T> {
    fn new(rows: usize, width: usize) -> Self {
        let data = vec![T::default(); rows * width + BLOCK];
        // Where the allocator begins on a line anyway, or where that cannot be told, nothing is skipped.
        let first = data.as_ptr().align_offset(64);
        Self {
            first: if first < BLOCK { first } else { 0 },
            data,
            width,
        }
    }

    #[inline(always)]
    fn range(&self, row: usize) -> Range<usize> {
        let at = self.first + row * self.width;
        at..at + self.width
    }

    #[inline(always)]
    fn row(&self, row: usize) -> &[T] {
        &self.data[self.range(row)]
    }

    #[inline(always)]
    fn row_mut(&mut self, row: usize) -> &mut [T] {
        let range = self.range(row);
        &mut self.data[range]
    }
}

/// The rows y and y + 1 of all planes of nodes that the elements of a slab touch.
pub(super) struct Rows<T> {
    /// First plane.
    z: usize,
    /// Planes.
    planes: usize,
    /// Per plane, y mod 2 and component: sums of a place and the next one, and differences.
    nodes: Buffer<T>,
    /// The forces there, likewise.
    forces: Buffer<T>,
    moduli: Buffer<T>,
    /// A row before sums are made.
    plain: Buffer<T>,
    /// Rows of nodes that are written out.
    held: [Option<usize>; 2],
}

/// Number of a row; `order`: 0 sums, 1 differences.
#[inline(always)]
fn number(plane: usize, y: usize, component: usize, order: usize) -> usize {
    ((plane * 2 + y % 2) * 3 + component) * 2 + order
}

impl<T: Number> Rows<T> {
    /// For slabs whose elements touch `planes` planes at most.
    pub fn new(grid: &NodeGrid, planes: usize) -> Self {
        let width = (grid.n[0] + 1).next_multiple_of(BLOCK) + 2 * BLOCK;
        Self {
            z: 0,
            planes,
            nodes: Buffer::new(12 * planes, width),
            forces: Buffer::new(12 * planes, width),
            moduli: Buffer::new(1, width),
            plain: Buffer::new(1, width),
            held: [None; 2],
        }
    }

    /// Another slab follows, whose elements touch these planes.
    pub fn begin(&mut self, planes: Range<usize>) {
        self.z = planes.start;
        self.planes = planes.len();
        self.held = [None; 2];
    }

    /// Writes out the rows y and y + 1 of all planes.
    #[inline(always)]
    pub fn load<F: Copy>(
        &mut self,
        grid: &NodeGrid,
        field: &[F],
        convert: impl Fn(F) -> T,
        y: usize,
    ) {
        for y in [y, y + 1] {
            if self.held[y % 2] == Some(y) {
                continue;
            }
            self.held[y % 2] = Some(y);
            for plane in 0..self.planes {
                let z = self.z + plane;
                for c in 0..3 {
                    let from = 3 * grid.first(z) + c * grid.count(z);
                    let plain = self.plain.row_mut(0);
                    grid.write_out(&field[from..], [y, z], &convert, plain);
                    let (at, row) = (number(plane, y, c, 0), self.plain.row(0));
                    let to = self.nodes.row_mut(at);
                    for (to, (&at, &next)) in to.iter_mut().zip(row.iter().zip(&row[1..])) {
                        *to = at + next;
                    }
                    let to = self.nodes.row_mut(at + 1);
                    for (to, (&at, &next)) in to.iter_mut().zip(row.iter().zip(&row[1..])) {
                        *to = at - next;
                    }
                }
            }
        }
    }

    /// Writes out the moduli of the elements of row y, layer z.
    #[inline(always)]
    pub fn load_moduli(
        &mut self,
        grid: &NodeGrid,
        e: &[f64],
        convert: impl Fn(f64) -> T,
        y: usize,
        z: usize,
    ) {
        grid.write_out(
            &e[grid.first(z)..],
            [y, z],
            &convert,
            self.moduli.row_mut(0),
        );
    }

    /// The elements of row y, layer z, of one order a component.
    #[inline(always)]
    pub fn elements(&mut self, y: usize, z: usize, orders: [usize; 3]) -> Elements<'_, T> {
        let mut rows = [0; 12];
        for (c, &order) in orders.iter().enumerate() {
            for corner in 0..4 {
                rows[4 * c + corner] = number(z - self.z + corner / 2, y + corner % 2, c, order);
            }
        }
        let mut nodes = [self.nodes.row(0); 12];
        let mut ranges = [const { 0..0 }; 12];
        for (i, &row) in rows.iter().enumerate() {
            nodes[i] = self.nodes.row(row);
            ranges[i] = self.forces.range(row);
        }
        let forces = self.forces.data.get_disjoint_mut(ranges);
        Elements {
            moduli: self.moduli.row(0),
            nodes,
            forces: forces.expect("twelve different rows"),
        }
    }

    /// Adds the forces on row y to the planes that the result has, and clears those of all planes: another slab has other
    /// planes in their places.
    #[inline(always)]
    pub fn add_to(&mut self, grid: &NodeGrid, y: usize, planes: &Range<usize>, out: &mut [T]) {
        if self.held[y % 2] != Some(y) {
            return;
        }
        for z in self.z..self.z + self.planes {
            for c in 0..3 {
                let row = number(z - self.z, y, c, 0);
                if planes.contains(&z) {
                    let plane = 3 * (grid.first(z) - grid.first(planes.start));
                    let (sum, difference) = (self.forces.row(row), self.forces.row(row + 1));
                    for run in grid.row(y, z) {
                        let (at, before) = (BLOCK + run.x, BLOCK + run.x - 1);
                        let here = sum[at..].iter().zip(&difference[at..]);
                        let there = sum[before..].iter().zip(&difference[before..]);
                        let to = &mut out[plane + c * grid.count(z) + run.at..][..run.len];
                        for (to, ((&s, &d), (&t, &e))) in to.iter_mut().zip(here.zip(there)) {
                            *to = (s + d) + (t - e);
                        }
                    }
                }
                self.forces.row_mut(row).fill(T::default());
                self.forces.row_mut(row + 1).fill(T::default());
            }
        }
    }
}

/// A row of elements, for one order a component; nodes and forces `4 * component + corner`, corner `dy + 2 dz`.
pub(super) struct Elements<'a, T> {
    pub moduli: &'a [T],
    pub nodes: [&'a [T]; 12],
    pub forces: [&'a mut [T]; 12],
}
