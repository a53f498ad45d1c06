//! Triangles and quads of one conforming mesh while it is being turned into all quads.

use super::edges::EdgeTable;
use crate::Vec3;

/// A triangle (`n` = 3) or a quad of sheet `sheet`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Polygon {
    v: [u32; 4],
    n: u8,
    pub sheet: u32,
}

impl Polygon {
    pub fn triangle(v: [u32; 3], sheet: u32) -> Self {
        Self {
            v: [v[0], v[1], v[2], v[2]],
            n: 3,
            sheet,
        }
    }

    pub fn quad(v: [u32; 4], sheet: u32) -> Self {
        Self { v, n: 4, sheet }
    }

    pub fn corners(&self) -> &[u32] {
        &self.v[..self.n as usize]
    }

    pub fn is_triangle(&self) -> bool {
        self.n == 3
    }

    /// The quad's corners.
    pub fn as_quad(&self) -> Option<[u32; 4]> {
        (self.n == 4).then_some(self.v)
    }
}

impl AsRef<[u32]> for Polygon {
    fn as_ref(&self) -> &[u32] {
        self.corners()
    }
}

/// Edge table of polygons that are present.
pub(crate) fn edge_table(polygons: &[Option<Polygon>]) -> EdgeTable {
    EdgeTable::new(
        polygons
            .iter()
            .enumerate()
            .filter_map(|(i, p)| p.as_ref().map(|p| (i as u32, p.corners()))),
    )
}

/// Quality of a quad, 0.006 ..= 1: 1 for a flat rectangle, falling with the worst corner, folded quads low.
pub(crate) fn quad_quality(points: &[Vec3], q: &[u32; 4]) -> f64 {
    let p = q.map(|v| points[v as usize]);
    let worst = (0..4)
        .map(|k| (90.0 - angle(&(p[(k + 3) % 4] - p[k]), &(p[(k + 1) % 4] - p[k]))).abs())
        .fold(0.0, f64::max);
    let n1 = (p[1] - p[0]).cross(&(p[2] - p[0]));
    let n2 = (p[2] - p[0]).cross(&(p[3] - p[0]));
    let flat = n1.dot(&n2) > 0.7 * n1.norm() * n2.norm();
    (1.0 - worst / 90.0).max(0.02) * if flat { 1.0 } else { 0.3 }
}

/// Angle between two vectors, degrees; 0 when one of them vanishes.
pub(crate) fn angle(a: &Vec3, b: &Vec3) -> f64 {
    let l = a.norm() * b.norm();
    if l > 0.0 {
        (a.dot(b) / l).clamp(-1.0, 1.0).acos().to_degrees()
    } else {
        0.0
    }
}
