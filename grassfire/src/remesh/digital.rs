//! Digital topology of a voxel set: solid 6-connected, empty 26-connected.

use rayon::prelude::*;

use crate::topology::Betti;

/// Bit of the neighbour (dx, dy, dz), each -1..=1, in a 27-bit neighbourhood.
const fn bit(dx: i32, dy: i32, dz: i32) -> usize {
    ((dz + 1) * 9 + (dy + 1) * 3 + dx + 1) as usize
}

const CENTRE: usize = 13;

const fn offset(b: usize) -> [i32; 3] {
    [
        (b % 3) as i32 - 1,
        (b / 3 % 3) as i32 - 1,
        (b / 9) as i32 - 1,
    ]
}

/// For each neighbour the mask of neighbours that differ from it by at most one step in each axis (`total` steps in all).
const fn adjacency(total: i32) -> [u32; 27] {
    let mut out = [0u32; 27];
    let mut a = 0;
    while a < 27 {
        let mut b = 0;
        while b < 27 {
            let (p, q) = (offset(a), offset(b));
            let d = [
                (p[0] - q[0]).abs(),
                (p[1] - q[1]).abs(),
                (p[2] - q[2]).abs(),
            ];
            let far = d[0] > 1 || d[1] > 1 || d[2] > 1;
            if a != b && a != CENTRE && b != CENTRE && !far && d[0] + d[1] + d[2] <= total {
                out[a] |= 1 << b;
            }
            b += 1;
        }
        a += 1;
    }
    out
}

const ADJACENT_6: [u32; 27] = adjacency(1);
const ADJACENT_26: [u32; 27] = adjacency(3);

const fn within(total: i32) -> u32 {
    let mut mask = 0;
    let mut b = 0;
    while b < 27 {
        let p = offset(b);
        if b != CENTRE && p[0].abs() + p[1].abs() + p[2].abs() <= total {
            mask |= 1 << b;
        }
        b += 1;
    }
    mask
}

const N6: u32 = within(1);
const N18: u32 = within(2);
const N26: u32 = within(3);

fn flood(seed: u32, set: u32, adjacent: &[u32; 27]) -> u32 {
    let mut seen = seed;
    let mut front = seed;
    while front != 0 {
        let b = front.trailing_zeros() as usize;
        front &= front - 1;
        let new = adjacent[b] & set & !seen;
        seen |= new;
        front |= new;
    }
    seen
}

/// Whether flipping the centre voxel between solid and empty keeps the homotopy type of both; `solid` is the 27-bit
/// mask of solid voxels (the centre bit is not looked at).
///
/// Exactly one 6-component of solid neighbours (within the 18-neighbourhood) touches the voxel by a face, and the empty
/// neighbours form exactly one 26-component. Bertrand and Malandain 1994, doi:10.1016/0167-8655(94)90046-9.
pub(super) fn is_simple(solid: u32) -> bool {
    let faces = solid & N6;
    let empty = !solid & N26;
    if faces == 0 || empty == 0 {
        return false;
    }
    let body = flood(faces & faces.wrapping_neg(), solid & N18, &ADJACENT_6);
    faces & !body == 0 && flood(empty & empty.wrapping_neg(), empty, &ADJACENT_26) == empty
}

/// Change of the Euler number of the solid when the centre voxel becomes solid.
pub(super) fn delta_chi(solid: u32) -> i64 {
    let has = |dx, dy, dz| i64::from(solid >> bit(dx, dy, dz) & 1);
    let mut chi = 1;
    for s in [-1, 1] {
        chi -= has(s, 0, 0) + has(0, s, 0) + has(0, 0, s);
        for t in [-1, 1] {
            chi += has(s, 0, 0) * has(0, t, 0) * has(s, t, 0);
            chi += has(0, s, 0) * has(0, 0, t) * has(0, s, t);
            chi += has(s, 0, 0) * has(0, 0, t) * has(s, 0, t);
            for u in [-1, 1] {
                chi -= has(s, 0, 0)
                    * has(0, t, 0)
                    * has(0, 0, u)
                    * has(s, t, 0)
                    * has(0, t, u)
                    * has(s, 0, u)
                    * has(s, t, u);
            }
        }
    }
    chi
}

/// A set of voxels in a grid; outside the grid everything is empty.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct VoxelSet {
    pub(super) dims: [usize; 3],
    pub(super) solid: Vec<bool>,
}

impl VoxelSet {
    /// The voxels of a field with a positive value.
    pub(super) fn positive(dims: [usize; 3], values: &[f32]) -> Self {
        Self {
            dims,
            solid: values.par_iter().map(|&v| v > 0.0).collect(),
        }
    }

    /// Whether the voxel touches the border of the grid.
    pub(super) fn on_border(&self, index: u32) -> bool {
        let at = self.ijk(index);
        (0..3).any(|a| at[a] == 0 || at[a] + 1 == self.dims[a])
    }

    pub(super) fn ijk(&self, index: u32) -> [usize; 3] {
        let [nx, ny, _] = self.dims;
        let index = index as usize;
        [index % nx, index / nx % ny, index / (nx * ny)]
    }

    /// The 27-bit mask of solid voxels around a voxel that is not on the border.
    pub(super) fn mask(&self, index: u32) -> u32 {
        let [nx, ny, _] = self.dims;
        let mut mask = 0;
        let base = index as usize - nx * ny - nx - 1;
        for dz in 0..3 {
            for dy in 0..3 {
                let row = base + dz * nx * ny + dy * nx;
                for (dx, &solid) in self.solid[row..row + 3].iter().enumerate() {
                    mask |= u32::from(solid) << (dz * 9 + dy * 3 + dx);
                }
            }
        }
        mask
    }

    /// Index offsets of the 26 neighbours.
    pub(super) fn neighbours_26(&self) -> [isize; 26] {
        let (nx, nxy) = (
            self.dims[0] as isize,
            (self.dims[0] * self.dims[1]) as isize,
        );
        let mut out = [0; 26];
        for (slot, b) in (0..27).filter(|&b| b != CENTRE).enumerate() {
            let [x, y, z] = offset(b).map(|v| v as isize);
            out[slot] = z * nxy + y * nx + x;
        }
        out
    }

    /// Index offsets of the 6 neighbours.
    pub(super) fn neighbours_6(&self) -> [isize; 6] {
        let (nx, nxy) = (
            self.dims[0] as isize,
            (self.dims[0] * self.dims[1]) as isize,
        );
        [-nxy, -nx, -1, 1, nx, nxy]
    }

    /// Euler number of the 6-connected solid: voxels - face contacts + full 2x2 squares - full 2x2x2 cubes.
    pub(super) fn chi(&self) -> i64 {
        let [nx, ny, nz] = self.dims;
        let at = |i: usize, j: usize, k: usize| {
            i < nx && j < ny && k < nz && self.solid[(k * ny + j) * nx + i]
        };
        let plane = |k: usize| {
            let mut chi = 0i64;
            for j in 0..ny {
                for i in 0..nx {
                    if !at(i, j, k) {
                        continue;
                    }
                    let (x, y, z) = (at(i + 1, j, k), at(i, j + 1, k), at(i, j, k + 1));
                    let xy = x && y && at(i + 1, j + 1, k);
                    let yz = y && z && at(i, j + 1, k + 1);
                    let xz = x && z && at(i + 1, j, k + 1);
                    let cube = xy && yz && xz && at(i + 1, j + 1, k + 1);
                    let count = |b: bool| i64::from(b);
                    chi += 1 - count(x) - count(y) - count(z) + count(xy) + count(yz) + count(xz)
                        - count(cube);
                }
            }
            chi
        };
        (0..nz).into_par_iter().map(plane).sum()
    }

    /// Components of the solid (6-connected) or the empty voxels (26-connected), in order of their first voxel.
    /// Voxels are listed only for components of at most `keep` voxels. The border of the grid must be empty.
    pub(super) fn components(&self, solid: bool, keep: usize) -> Vec<Component> {
        let (six, all) = (self.neighbours_6(), self.neighbours_26());
        let steps: &[isize] = if solid { &six } else { &all };
        let mut seen = vec![false; self.solid.len()];
        let mut out = Vec::new();
        let mut queue = Vec::new();
        for start in 0..self.solid.len() {
            if seen[start] || self.solid[start] != solid {
                continue;
            }
            let mut component = Component {
                size: 0,
                lo: [usize::MAX; 3],
                hi: [0; 3],
                voxels: Vec::new(),
            };
            seen[start] = true;
            queue.push(start as u32);
            while let Some(v) = queue.pop() {
                let at = self.ijk(v);
                let border = self.on_border(v);
                component.add(v, at, keep);
                for &step in steps {
                    let n = v as isize + step;
                    if border && !self.adjacent(at, n) {
                        continue;
                    }
                    let n = n as usize;
                    if !seen[n] && self.solid[n] == solid {
                        seen[n] = true;
                        queue.push(n as u32);
                    }
                }
            }
            out.push(component);
        }
        out
    }

    /// Whether index `n` exists and is a 26-neighbour of `at` (no wrap-around at the border).
    fn adjacent(&self, at: [usize; 3], n: isize) -> bool {
        if n < 0 || n as usize >= self.solid.len() {
            return false;
        }
        let other = self.ijk(n as u32);
        (0..3).all(|a| at[a].abs_diff(other[a]) <= 1)
    }

    /// Betti numbers of the solid.
    pub(super) fn betti(&self) -> Betti {
        let b0 = self.components(true, 0).len() as i64;
        let b2 = self.components(false, 0).len() as i64 - 1;
        Betti::from_chi(b0, b2, self.chi())
    }
}

/// One connected component.
#[derive(Debug, Clone)]
pub(super) struct Component {
    pub(super) size: usize,
    pub(super) lo: [usize; 3],
    pub(super) hi: [usize; 3],
    /// Empty when the component is larger than was asked for.
    pub(super) voxels: Vec<u32>,
}

impl Component {
    fn add(&mut self, v: u32, at: [usize; 3], keep: usize) {
        self.size += 1;
        for (a, &x) in at.iter().enumerate() {
            self.lo[a] = self.lo[a].min(x);
            self.hi[a] = self.hi[a].max(x);
        }
        if self.size <= keep {
            self.voxels.push(v);
        } else {
            self.voxels = Vec::new();
        }
    }

    /// Longest side of its box, voxels.
    pub(super) fn extent(&self) -> usize {
        (0..3)
            .map(|a| self.hi[a] - self.lo[a] + 1)
            .max()
            .unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn set(n: usize, solid: impl Fn(usize, usize, usize) -> bool) -> VoxelSet {
        let mut out = VoxelSet {
            dims: [n; 3],
            solid: vec![false; n * n * n],
        };
        for k in 1..n - 1 {
            for j in 1..n - 1 {
                for i in 1..n - 1 {
                    out.solid[(k * n + j) * n + i] = solid(i, j, k);
                }
            }
        }
        out
    }

    #[test]
    fn ball_ring_and_shell() {
        let ball = set(12, |i, j, k| {
            i.abs_diff(6).pow(2) + j.abs_diff(6).pow(2) + k.abs_diff(6).pow(2) < 16
        });
        assert_eq!(
            ball.betti(),
            Betti {
                b0: 1,
                b1: 0,
                b2: 0,
                chi: 1
            }
        );
        let ring = set(12, |i, j, k| {
            k == 5 && (i.abs_diff(6).max(j.abs_diff(6)) == 3)
        });
        assert_eq!(
            ring.betti(),
            Betti {
                b0: 1,
                b1: 1,
                b2: 0,
                chi: 0
            }
        );
        let shell = set(12, |i, j, k| {
            i.abs_diff(6).max(j.abs_diff(6)).max(k.abs_diff(6)) == 3
        });
        assert_eq!(
            shell.betti(),
            Betti {
                b0: 1,
                b1: 0,
                b2: 1,
                chi: 2
            }
        );
        // Two voxels that share an edge only are two bodies, and the empty side stays connected.
        let pair = set(6, |i, j, k| {
            k == 2 && ((i, j) == (2, 2) || (i, j) == (3, 3))
        });
        assert_eq!(
            pair.betti(),
            Betti {
                b0: 2,
                b1: 0,
                b2: 0,
                chi: 2
            }
        );
    }

    proptest! {
        #[test]
        fn local_rules_agree_with_global_counts(bits in prop::collection::vec(prop::bool::weighted(0.6), 27)) {
            let mut with = set(5, |i, j, k| bits[(k - 1) * 9 + (j - 1) * 3 + i - 1]);
            let centre = (2 * 5 + 2) * 5 + 2;
            with.solid[centre] = true;
            let mut without = with.clone();
            without.solid[centre] = false;
            let mask = with.mask(centre as u32);
            prop_assert_eq!(with.chi() - without.chi(), delta_chi(mask));
            if is_simple(mask) {
                prop_assert_eq!(with.betti(), without.betti());
            }
        }
    }
}
