//! Memory layout of fields on a structured grid of hexahedra: only nodes of elements that may have stiffness are stored.

use rayon::prelude::*;

/// Nodes that are worked on together; every vector width up to 16 divides it.
pub(super) const BLOCK: usize = 16;
/// Runs of nodes that are nearer than this become one: a run costs more than some nodes without stiffness.
const GAP: usize = 8;

/// A run of stored nodes along x.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Run {
    /// First node.
    pub x: usize,
    /// Nodes.
    pub len: usize,
    /// Place of the first node in its plane.
    pub at: usize,
}

/// A grid of `n` elements along x, y, z and of one node more each way.
///
/// Rows of nodes are cut into runs, and the runs of a plane lie one behind the other. A scalar field holds the planes, a
/// node field for every plane its three components. Element (x, y, z) lies between the nodes (x, y, z) and
/// (x+1, y+1, z+1); a field of elements is a scalar field in which it has the place of node (x, y, z).
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct NodeGrid {
    /// Elements along x, y, z.
    pub n: [usize; 3],
    runs: Vec<Run>,
    /// First run of every row `[z][y]`, and their number.
    rows: Vec<usize>,
    /// First place of every plane in a scalar field, and the number of places.
    planes: Vec<usize>,
}

impl NodeGrid {
    /// `occupied`: elements that may have stiffness, `[z][y][x]`.
    pub fn new(n: [usize; 3], occupied: &[bool]) -> Self {
        let mut out = Self {
            n,
            runs: Vec::new(),
            rows: vec![0],
            planes: vec![0],
        };
        let mut used = vec![false; n[0] + 1];
        for z in 0..=n[2] {
            let mut count = 0;
            for y in 0..=n[1] {
                used.fill(false);
                for z in z.saturating_sub(1)..(z + 1).min(n[2]) {
                    for y in y.saturating_sub(1)..(y + 1).min(n[1]) {
                        let row = &occupied[(z * n[1] + y) * n[0]..][..n[0]];
                        for (x, _) in row.iter().enumerate().filter(|(_, full)| **full) {
                            used[x] = true;
                            used[x + 1] = true;
                        }
                    }
                }
                out.cut(&used, &mut count);
            }
            out.planes.push(out.planes[z] + count);
        }
        out
    }

    /// Cuts a row into runs; `count`: places of its plane so far.
    fn cut(&mut self, used: &[bool], count: &mut usize) {
        let first = self.runs.len();
        for (x, _) in used.iter().enumerate().filter(|(_, used)| **used) {
            match self.runs[first..].last_mut() {
                Some(run) if x < run.x + run.len + GAP => {
                    *count += x + 1 - run.x - run.len;
                    run.len = x + 1 - run.x;
                }
                _ => {
                    self.runs.push(Run {
                        x,
                        len: 1,
                        at: *count,
                    });
                    *count += 1;
                }
            }
        }
        self.rows.push(self.runs.len());
    }

    /// The runs of a row of nodes.
    #[inline]
    pub fn row(&self, y: usize, z: usize) -> &[Run] {
        let row = z * (self.n[1] + 1) + y;
        &self.runs[self.rows[row]..self.rows[row + 1]]
    }

    /// Writes a row out in full, node x at `BLOCK + x`, with zeros where nothing is stored. `plane`: a component of the row's
    /// plane, from its first place.
    #[inline(always)]
    pub fn write_out<F: Copy, T: Copy + Default>(
        &self,
        plane: &[F],
        [y, z]: [usize; 2],
        convert: impl Fn(F) -> T,
        to: &mut [T],
    ) {
        to.fill(T::default());
        for run in self.row(y, z) {
            let from = &plane[run.at..][..run.len];
            for (to, &v) in to[BLOCK + run.x..][..run.len].iter_mut().zip(from) {
                *to = convert(v);
            }
        }
    }

    /// Stored nodes of a plane.
    #[inline]
    pub fn count(&self, z: usize) -> usize {
        self.planes[z + 1] - self.planes[z]
    }

    /// First place of a plane in a scalar field.
    #[inline]
    pub fn first(&self, z: usize) -> usize {
        self.planes[z]
    }

    /// Places of a scalar field.
    pub fn len(&self) -> usize {
        self.planes[self.n[2] + 1]
    }

    /// Place of a node in its plane; none when it is not stored.
    #[inline]
    pub fn place(&self, [x, y, z]: [usize; 3]) -> Option<usize> {
        let runs = self.row(y, z).iter();
        let run = runs.rev().find(|run| run.x <= x)?;
        (x < run.x + run.len).then_some(run.at + x - run.x)
    }

    /// Place of a component of a node in a node field.
    #[inline]
    pub fn node(&self, at: [usize; 3], component: usize) -> Option<usize> {
        let z = at[2];
        Some(3 * self.planes[z] + component * self.count(z) + self.place(at)?)
    }

    /// A scalar field of zeros.
    pub fn scalar<T: Copy + Default>(&self) -> Vec<T> {
        vec![T::default(); self.len()]
    }

    /// A node field of zeros.
    pub fn field<T: Copy + Default>(&self) -> Vec<T> {
        vec![T::default(); 3 * self.len()]
    }

    /// The planes of a field of one or three components, in parallel, in the order of their z.
    pub fn planes<'a, T: Send>(
        &self,
        components: usize,
        field: &'a mut [T],
    ) -> impl IndexedParallelIterator<Item = &'a mut [T]> {
        self.slabs(1, components, field)
    }

    /// The same for slabs of `thick` planes, of which the last may be thinner.
    pub fn slabs<'a, T: Send>(
        &self,
        thick: usize,
        components: usize,
        field: &'a mut [T],
    ) -> impl IndexedParallelIterator<Item = &'a mut [T]> {
        let starts = self.planes[..=self.n[2]].iter().step_by(thick);
        let ends: Vec<usize> = starts
            .chain(self.planes.last())
            .map(|at| components * at)
            .collect();
        cut(field, &ends).into_par_iter()
    }
}

/// The parts of a field between places, which ascend from 0.
pub(crate) fn cut<'a, T>(field: &'a mut [T], places: &[usize]) -> Vec<&'a mut [T]> {
    let mut rest = field;
    let mut out = Vec::with_capacity(places.len());
    for pair in places.windows(2) {
        let (part, others) = std::mem::take(&mut rest).split_at_mut(pair[1] - pair[0]);
        out.push(part);
        rest = others;
    }
    out
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
