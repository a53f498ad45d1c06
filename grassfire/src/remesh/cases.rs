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

/// The lines in which the surface cuts the faces of a cell, as pairs of crossed edges: one about every run of solid corners
/// of a face, so two solid corners on a diagonal are apart. They go around the surface counter-clockwise seen from the
/// empty side.
fn lines(case: usize) -> Vec<(usize, usize)> {
    let mut out = Vec::new();
    for face in 0..6 {
        let mut q = face_corners(face / 2, face % 2);
        if face % 2 == 0 {
            q.reverse();
        }
        let solid = |i: usize| case >> q[i % 4] & 1 == 1;
        let edge = |i: usize| edge_between(q[i % 4], q[(i + 1) % 4]);
        for first in (0..4).filter(|&i| solid(i) && !solid(i + 3)) {
            let end = (first..first + 4).find(|&i| !solid(i + 1));
            out.push((edge(first + 3), edge(end.unwrap_or(first))));
        }
    }
    out
}

/// The polygons of all 256 ways in which the corners of a cell can be solid: crossed edges, counter-clockwise seen from the
/// empty side.
pub(super) fn polygons() -> Vec<Vec<Vec<usize>>> {
    let polygons = |case| {
        let mut next = [None; 12];
        for (from, to) in lines(case) {
            next[from] = Some(to);
        }
        let mut out = Vec::new();
        for edge in 0..12 {
            let mut polygon = Vec::new();
            let mut at = edge;
            while let Some(to) = next[at].take() {
                polygon.push(at);
                at = to;
            }
            if !polygon.is_empty() {
                out.push(polygon);
            }
        }
        out
    };
    (0..256).map(polygons).collect()
}

/// The components of all 256 ways in which the corners of a cell can be solid (bit c) or empty: the crossed edges of each
/// polygon.
pub(super) fn cases() -> Vec<Case> {
    let case = |polygons: Vec<Vec<usize>>| {
        let mut component = [NONE; 12];
        for (number, polygon) in polygons.iter().enumerate() {
            for &edge in polygon {
                component[edge] = number as u8;
            }
        }
        Case {
            component,
            count: polygons.len() as u8,
        }
    };
    polygons().into_iter().map(case).collect()
}
