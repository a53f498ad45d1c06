//! Memory layout of fields on a structured grid of hexahedra, with a halo of zeros.

use rayon::prelude::*;

/// Nodes in a block: rows are padded to whole blocks, so that every vector width up to 16 divides them.
pub(super) const BLOCK: usize = 16;

/// A grid of `n` elements along x, y, z and of one node more each way.
///
/// Node fields hold `[z][y][component][x]`. A row ends with at least one unused place, a plane with one unused row, the
/// field with one unused plane, and as much stands in front: so the neighbours of every node exist, and are zero.
/// Element fields hold `[z][y][x]` in the same way; element (x, y, z) lies between the nodes (x, y, z) and (x+1, y+1, z+1).
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct NodeGrid {
    /// Elements along x, y, z.
    pub n: [usize; 3],
    /// Places in a row of one component.
    pub sx: usize,
    /// Places in a row of all three components.
    pub row: usize,
    /// Places in a plane of nodes.
    pub plane: usize,
    /// Places in front of node (0, 0, 0).
    pub front: usize,
    /// Places of a node field.
    pub len: usize,
}

impl NodeGrid {
    pub fn new(n: [usize; 3]) -> Self {
        let sx = (n[0] + 2).next_multiple_of(BLOCK);
        let (row, sy) = (3 * sx, n[1] + 2);
        let plane = row * sy;
        let front = plane + row + BLOCK;
        Self {
            n,
            sx,
            row,
            plane,
            front,
            len: front + plane * (n[2] + 1) + plane + row + BLOCK,
        }
    }

    /// Place of component 0 of a node; component `c` is `c * sx` further.
    #[inline]
    pub fn node(&self, x: usize, y: usize, z: usize) -> usize {
        self.front + z * self.plane + y * self.row + x
    }

    /// Places in a plane of elements.
    pub fn element_plane(&self) -> usize {
        self.sx * (self.n[1] + 2)
    }

    /// Places of an element field.
    pub fn element_len(&self) -> usize {
        self.element(0, 0, 0) + self.element_plane() * (self.n[2] + 2) + self.sx + BLOCK
    }

    /// Place of an element.
    #[inline]
    pub fn element(&self, x: usize, y: usize, z: usize) -> usize {
        let plane = self.element_plane();
        plane + self.sx + BLOCK + z * plane + y * self.sx + x
    }

    /// Blocks of nodes in a row.
    pub fn blocks(&self) -> usize {
        self.sx / BLOCK
    }

    /// A node field of zeros.
    pub fn field<T: Copy + Default>(&self) -> Vec<T> {
        vec![T::default(); self.len]
    }

    /// The planes of nodes of a field, in parallel, each with its z.
    pub fn planes<'a, T: Send>(
        &self,
        field: &'a mut [T],
    ) -> impl IndexedParallelIterator<Item = &'a mut [T]> {
        let (front, planes) = (self.front, self.n[2] + 1);
        field[front..front + planes * self.plane].par_chunks_mut(self.plane)
    }
}

/// Length of the pieces in which whole fields are worked on: sums do not depend on the threads.
pub(super) const PIECE: usize = 1 << 15;

/// Inner product of two fields.
pub(super) fn dot<A, B>(a: &[A], b: &[B]) -> f64
where
    A: Copy + Into<f64> + Sync,
    B: Copy + Into<f64> + Sync,
{
    let parts: Vec<f64> = a
        .par_chunks(PIECE)
        .zip(b.par_chunks(PIECE))
        .map(|(a, b)| {
            let mut lanes = [0f64; 8];
            let (pa, pb) = (a.chunks_exact(8), b.chunks_exact(8));
            let rest: f64 = pa
                .remainder()
                .iter()
                .zip(pb.remainder())
                .map(|(&x, &y)| x.into() * y.into())
                .sum();
            for (x, y) in pa.zip(pb) {
                for w in 0..8 {
                    lanes[w] += x[w].into() * y[w].into();
                }
            }
            lanes.iter().sum::<f64>() + rest
        })
        .collect();
    parts.iter().sum()
}
