//! Polynomial pieces of the B-rep's faces: Bezier extraction, points and triangles, independent of the CAD kernel.

use crate::Vec3;
use crate::spline::{Brep, BrepEdge, BrepFace};

/// Control points of a bi-5 Bezier patch, `[u][v]`.
pub(crate) type Bezier = [[Vec3; 6]; 6];

/// The control points of a C1 degree-5 B-spline that make Bezier point `k` of span `span`, with weights.
///
/// With uniform knots of multiplicity 4 the joint of two spans is the middle of its neighbours.
fn extraction(span: usize, spans: usize, k: usize) -> [(usize, f64); 2] {
    match k {
        0 if span > 0 => [(4 * span, 0.5), (4 * span + 1, 0.5)],
        5 if span + 1 < spans => [(4 * span + 4, 0.5), (4 * span + 5, 0.5)],
        _ => [(4 * span + k, 1.0), (4 * span + k, 0.0)], // one point; the second does not count
    }
}

/// The Bezier patch of one span of a face.
pub(crate) fn bezier(face: &BrepFace, u: usize, v: usize) -> Bezier {
    let [wide, high] = face.spans.map(|s| s as usize);
    let columns = 4 * high + 2;
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let mut sum = Vec3::zeros();
            for (a, wa) in extraction(u, wide, i) {
                for (b, wb) in extraction(v, high, j) {
                    sum += face.control[a * columns + b] * (wa * wb);
                }
            }
            sum
        })
    })
}

/// The Bezier control points of one span of an edge.
pub(crate) fn edge_bezier(edge: &BrepEdge, span: usize) -> [Vec3; 6] {
    std::array::from_fn(|k| {
        extraction(span, edge.spans as usize, k)
            .iter()
            .map(|&(i, w)| edge.control[i] * w)
            .sum()
    })
}

/// All Bezier patches of a face.
pub(crate) fn face_beziers(face: &BrepFace) -> impl Iterator<Item = Bezier> + '_ {
    let [wide, high] = face.spans.map(|s| s as usize);
    (0..wide * high).map(move |k| bezier(face, k / high, k % high))
}

/// Box around the control points, which holds the patch.
pub(crate) fn bounds(patch: &Bezier) -> (Vec3, Vec3) {
    let first = patch[0][0];
    patch
        .iter()
        .flatten()
        .fold((first, first), |(lo, hi), p| (lo.inf(p), hi.sup(p)))
}

/// Points of a patch on a regular grid of `cells` x `cells`, cut into triangles with outward orientation.
pub(crate) fn triangles(patch: &Bezier, cells: usize, out: &mut Vec<[Vec3; 3]>) {
    let basis: Vec<[f64; 6]> = (0..=cells)
        .map(|i| bernstein(i as f64 / cells as f64))
        .collect();
    let n = cells + 1;
    let mut points = Vec::with_capacity(n * n);
    for bu in &basis {
        let row: [Vec3; 6] = std::array::from_fn(|j| (0..6).map(|i| patch[i][j] * bu[i]).sum());
        points.extend(
            basis
                .iter()
                .map(|bv| (0..6).map(|j| row[j] * bv[j]).sum::<Vec3>()),
        );
    }
    for i in 0..cells {
        for j in 0..cells {
            let at = |i: usize, j: usize| points[i * n + j];
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            out.push([a, b, c]);
            out.push([a, c, d]);
        }
    }
}

fn bernstein(t: f64) -> [f64; 6] {
    let s = 1.0 - t;
    [
        s.powi(5),
        5.0 * s.powi(4) * t,
        10.0 * s.powi(3) * t * t,
        10.0 * s * s * t.powi(3),
        5.0 * s * t.powi(4),
        t.powi(5),
    ]
}

/// Checks that all array lengths and indices of a B-rep fit, so that the rest can index freely.
pub(crate) fn check(brep: &Brep) -> Result<(), String> {
    for (e, edge) in brep.edges.iter().enumerate() {
        if edge.spans == 0 || edge.control.len() != 4 * edge.spans as usize + 2 {
            return Err(format!(
                "edge {e} has {} control points for {} spans",
                edge.control.len(),
                edge.spans
            ));
        }
        if edge
            .vertices
            .iter()
            .any(|&v| v as usize >= brep.vertices.len())
        {
            return Err(format!("edge {e} names a missing vertex"));
        }
    }
    let mut uses = vec![[0u32; 2]; brep.edges.len()];
    for (f, face) in brep.faces.iter().enumerate() {
        let wanted = face
            .spans
            .iter()
            .map(|&s| 4 * s as usize + 2)
            .product::<usize>();
        if face.spans.contains(&0) || face.control.len() != wanted {
            return Err(format!(
                "face {f} has {} control points for {:?} spans",
                face.control.len(),
                face.spans
            ));
        }
        for u in &face.uses {
            let Some(count) = uses.get_mut(u.edge as usize) else {
                return Err(format!("face {f} names the missing edge {}", u.edge));
            };
            count[usize::from(u.reversed)] += 1;
        }
    }
    if let Some(e) = uses.iter().position(|u| *u != [1, 1]) {
        return Err(format!(
            "edge {e} is used {} times along and {} times against it; 1 and 1 wanted",
            uses[e][0], uses[e][1]
        ));
    }
    let mut seen = vec![0u32; brep.faces.len()];
    for &f in brep.shells.iter().flatten() {
        match seen.get_mut(f as usize) {
            Some(times) => *times += 1,
            None => return Err(format!("a shell names the missing face {f}")),
        }
    }
    match seen.iter().position(|&times| times != 1) {
        Some(f) => Err(format!("face {f} is in {} shells; 1 wanted", seen[f])),
        None => Ok(()),
    }
}
