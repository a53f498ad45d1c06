//! How the surface can cross a cell of eight voxel centres.

/// Which edges of a cell carry one surface component: `component[edge]`, `NONE` where the edge is not crossed.
#[derive(Clone, Copy)]
pub(super) struct Case {
    pub(super) component: [u8; 12],
    pub(super) count: u8,
}

pub(super) const NONE: u8 = u8::MAX;

/// Edge `e = 4 axis + bu + 2 bv` runs along `axis` from the corner with bits bu, bv on the next two axes.
pub(super) fn edge_corners(e: usize) -> (usize, usize) {
    let (axis, bits) = (e / 4, e % 4);
    let low = (bits & 1) << ((axis + 1) % 3) | (bits >> 1) << ((axis + 2) % 3);
    (low, low | 1 << axis)
}

pub(super) fn edge_between(a: usize, b: usize) -> usize {
    let axis = (a ^ b).trailing_zeros() as usize;
    let low = a & b;
    4 * axis + (low >> ((axis + 1) % 3) & 1) + 2 * (low >> ((axis + 2) % 3) & 1)
}

/// Corners of face (axis, side) in cyclic order.
pub(super) fn face_corners(axis: usize, side: usize) -> [usize; 4] {
    let (u, v) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
    let base = side << axis;
    [base, base | u, base | u | v, base | v]
}

pub(super) fn is_ambiguous(case: usize, axis: usize, side: usize) -> bool {
    let s = face_corners(axis, side).map(|c| case >> c & 1);
    s[0] == s[2] && s[1] == s[3] && s[0] != s[1]
}

/// The components of all 256 ways in which the corners of a cell can be solid (bit c) or empty.
///
/// Crossed edges are linked across the faces; on a face with two solid corners on a diagonal the two edges of each
/// solid corner belong together, so the solid corners are apart.
pub(super) fn cases() -> Vec<Case> {
    (0..256usize)
        .map(|case| {
            let mut label: [u8; 12] = std::array::from_fn(|e| {
                let (a, b) = edge_corners(e);
                if (case >> a ^ case >> b) & 1 == 1 {
                    e as u8
                } else {
                    NONE
                }
            });
            let mut link = |a: usize, b: usize| {
                let (from, to) = (label[a].max(label[b]), label[a].min(label[b]));
                label
                    .iter_mut()
                    .filter(|l| **l == from)
                    .for_each(|l| *l = to);
            };
            for face in 0..6 {
                let q = face_corners(face / 2, face % 2);
                if is_ambiguous(case, face / 2, face % 2) {
                    for i in (0..4).filter(|&i| case >> q[i] & 1 == 1) {
                        link(
                            edge_between(q[(i + 3) % 4], q[i]),
                            edge_between(q[i], q[(i + 1) % 4]),
                        );
                    }
                    continue;
                }
                let crossed: Vec<usize> = (0..4)
                    .filter(|&i| (case >> q[i] ^ case >> q[(i + 1) % 4]) & 1 == 1)
                    .map(|i| edge_between(q[i], q[(i + 1) % 4]))
                    .collect();
                if let [a, b] = crossed[..] {
                    link(a, b);
                }
            }
            let mut names: Vec<u8> = label.iter().copied().filter(|&l| l != NONE).collect();
            names.sort_unstable();
            names.dedup();
            let component =
                label.map(|l| names.iter().position(|&n| n == l).map_or(NONE, |n| n as u8));
            Case {
                component,
                count: names.len() as u8,
            }
        })
        .collect()
}
