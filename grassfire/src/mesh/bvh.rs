//! Bounding volume hierarchy over triangles: nearest point, first ray hit, box overlap.

use super::TriMesh;
use crate::Vec3;

/// Triangles in a leaf at most.
const LEAF: usize = 6;
/// Deep enough for a median-split tree over 2^32 triangles.
const STACK: usize = 72;

/// The point of the mesh nearest to a query.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nearest {
    /// The point, mm.
    pub point: Vec3,
    /// Index of the triangle it lies on.
    pub triangle: u32,
    /// Distance from the query, mm.
    pub distance: f64,
}

/// A tree of axis-aligned boxes over the triangles of a mesh, in one flat array.
///
/// The tree is built by median splits of the triangle centroids along the longest side of their box, so its depth is
/// `log2(n)` and it does not depend on threads. Triangles with a coordinate that is not finite or with an index out of
/// range are left out; degenerate triangles are kept as segments or points.
#[derive(Debug, Clone)]
pub struct Bvh {
    pub(crate) nodes: Vec<Node>,
    /// Corners in tree order.
    pub(crate) corners: Vec<[Vec3; 3]>,
    /// Index in the mesh of each triangle in tree order.
    pub(crate) ids: Vec<u32>,
}

/// The left child of an inner node follows it directly.
#[derive(Debug, Clone)]
pub(crate) struct Node {
    pub(crate) lo: Vec3,
    pub(crate) hi: Vec3,
    /// First triangle (tree order).
    pub(crate) first: u32,
    /// Triangles below this node.
    pub(crate) count: u32,
    /// Index of the right child; 0 for a leaf.
    pub(crate) right: u32,
}

impl Node {
    fn distance_squared(&self, p: &Vec3) -> f64 {
        let mut sum = 0.0;
        for a in 0..3 {
            let d = (self.lo[a] - p[a]).max(p[a] - self.hi[a]).max(0.0);
            sum += d * d;
        }
        sum
    }

    pub(crate) fn overlaps(&self, lo: &Vec3, hi: &Vec3) -> bool {
        boxes_overlap([&self.lo, &self.hi], [lo, hi])
    }

    /// Entry distance of the ray, or infinity when it misses the box before `limit`.
    fn entry(&self, origin: &Vec3, inverse: &Vec3, limit: f64) -> f64 {
        let (mut near, mut far) = (0.0f64, limit);
        for a in 0..3 {
            let t0 = (self.lo[a] - origin[a]) * inverse[a];
            let t1 = (self.hi[a] - origin[a]) * inverse[a];
            // A NaN (0 * inf, ray in the face plane) must not exclude the box: min and max ignore it.
            near = near.max(t0.min(t1));
            far = far.min(t0.max(t1));
        }
        if near <= far * (1.0 + 1e-12) {
            near
        } else {
            f64::INFINITY
        }
    }
}

impl Bvh {
    /// Builds the tree in O(n log n).
    pub fn new(mesh: &TriMesh) -> Self {
        let usable = |t: &usize| {
            mesh.triangles[*t].iter().all(|&v| {
                mesh.points
                    .get(v as usize)
                    .is_some_and(|p| p.iter().all(|x| x.is_finite()))
            })
        };
        let mut items: Vec<(Vec3, u32)> = (0..mesh.triangles.len())
            .filter(usable)
            .map(|t| {
                let [a, b, c] = mesh.corners(t);
                ((a + b + c) / 3.0, t as u32)
            })
            .collect();
        let mut nodes = Vec::with_capacity(2 * items.len() / (LEAF / 2) + 1);
        if !items.is_empty() {
            build(mesh, &mut items, 0, &mut nodes);
        }
        let ids: Vec<u32> = items.iter().map(|item| item.1).collect();
        let corners = ids.iter().map(|&t| mesh.corners(t as usize)).collect();
        Self {
            nodes,
            corners,
            ids,
        }
    }

    /// Lower and upper corner of the box around all triangles; `None` without triangles.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        self.nodes.first().map(|node| (node.lo, node.hi))
    }

    /// The nearest point of the mesh no farther than `max` (mm; infinity is allowed) from `p`.
    /// Among equally near triangles the one met first in the tree wins, which is the same in every run.
    pub fn nearest(&self, p: &Vec3, max: f64) -> Option<Nearest> {
        self.nearest_where(p, max, |_, _| true)
    }

    /// As [`Bvh::nearest`], of those triangles only whose index and point nearest to `p` please `keep`.
    pub fn nearest_where(
        &self,
        p: &Vec3,
        max: f64,
        keep: impl Fn(u32, &Vec3) -> bool,
    ) -> Option<Nearest> {
        let mut best = None;
        let mut limit = max * max;
        let mut stack = [(0u32, 0.0f64); STACK];
        let mut top = 0;
        if let Some(root) = self.nodes.first() {
            stack[0] = (0, root.distance_squared(p));
            top = 1;
        }
        while top > 0 {
            top -= 1;
            let (index, d) = stack[top];
            if d > limit {
                continue;
            }
            let node = &self.nodes[index as usize];
            if node.right == 0 {
                for t in node.first..node.first + node.count {
                    let q = nearest_on_triangle(p, &self.corners[t as usize]);
                    let d = (q - p).norm_squared();
                    if (d < limit || (d <= limit && best.is_none()))
                        && keep(self.ids[t as usize], &q)
                    {
                        limit = d;
                        best = Some((q, t));
                    }
                }
                continue;
            }
            let (left, right) = (index + 1, node.right);
            let dl = self.nodes[left as usize].distance_squared(p);
            let dr = self.nodes[right as usize].distance_squared(p);
            let (near, far) = if dl <= dr {
                ((left, dl), (right, dr))
            } else {
                ((right, dr), (left, dl))
            };
            stack[top] = far;
            stack[top + 1] = near;
            top += 2;
        }
        best.map(|(point, t)| Nearest {
            point,
            triangle: self.ids[t as usize],
            distance: limit.sqrt(),
        })
    }

    /// The first triangle hit by the ray `origin + t * direction` with `from < t < to`: `(t, triangle)`.
    pub fn first_hit(
        &self,
        origin: &Vec3,
        direction: &Vec3,
        from: f64,
        to: f64,
    ) -> Option<(f64, u32)> {
        let inverse = direction.map(|x| 1.0 / x);
        let mut best: Option<(f64, u32)> = None;
        let mut limit = to;
        let mut stack = vec![0u32];
        if self.nodes.is_empty() {
            return None;
        }
        while let Some(index) = stack.pop() {
            let node = &self.nodes[index as usize];
            if node.entry(origin, &inverse, limit) > limit {
                continue;
            }
            if node.right != 0 {
                let (left, right) = (index + 1, node.right);
                let tl = self.nodes[left as usize].entry(origin, &inverse, limit);
                let tr = self.nodes[right as usize].entry(origin, &inverse, limit);
                let (near, far) = if tl <= tr {
                    (left, right)
                } else {
                    (right, left)
                };
                stack.push(far);
                stack.push(near);
                continue;
            }
            for t in node.first..node.first + node.count {
                if let Some(x) = ray_triangle(origin, direction, &self.corners[t as usize])
                    && x > from
                    && x < limit
                {
                    limit = x;
                    best = Some((x, self.ids[t as usize]));
                }
            }
        }
        best
    }

    /// Calls `visit` with the index of every triangle whose own box overlaps the box `lo..hi`, in tree order.
    pub fn for_each_in_box(&self, lo: &Vec3, hi: &Vec3, mut visit: impl FnMut(u32)) {
        let mut stack = [0u32; STACK];
        let mut top = usize::from(!self.nodes.is_empty());
        while top > 0 {
            top -= 1;
            let index = stack[top];
            let node = &self.nodes[index as usize];
            if !node.overlaps(lo, hi) {
                continue;
            }
            if node.right != 0 {
                stack[top] = node.right;
                stack[top + 1] = index + 1;
                top += 2;
                continue;
            }
            for t in node.first..node.first + node.count {
                let [least, most] = triangle_box(&self.corners[t as usize]);
                if boxes_overlap([&least, &most], [lo, hi]) {
                    visit(self.ids[t as usize]);
                }
            }
        }
    }
}

/// Lower and upper corner of the box around a triangle.
#[inline]
pub(crate) fn triangle_box([a, b, c]: &[Vec3; 3]) -> [Vec3; 2] {
    [a.inf(b).inf(c), a.sup(b).sup(c)]
}

/// Two closed boxes, each by its lower and upper corner, have a point in common.
#[inline]
pub(crate) fn boxes_overlap(a: [&Vec3; 2], b: [&Vec3; 2]) -> bool {
    (0..3).all(|k| a[0][k] <= b[1][k] && b[0][k] <= a[1][k])
}

/// Appends the subtree over `items`, which start at `first` in tree order; its root comes first.
fn build(mesh: &TriMesh, items: &mut [(Vec3, u32)], first: u32, nodes: &mut Vec<Node>) {
    let mut lo = Vec3::repeat(f64::INFINITY);
    let mut hi = Vec3::repeat(f64::NEG_INFINITY);
    let (mut clo, mut chi) = (lo, hi);
    for (centroid, t) in items.iter() {
        for p in mesh.corners(*t as usize) {
            lo = lo.inf(&p);
            hi = hi.sup(&p);
        }
        clo = clo.inf(centroid);
        chi = chi.sup(centroid);
    }
    let at = nodes.len();
    nodes.push(Node {
        lo,
        hi,
        first,
        count: items.len() as u32,
        right: 0,
    });
    if items.len() <= LEAF {
        return;
    }
    let axis = (chi - clo).imax();
    let middle = items.len() / 2;
    items.select_nth_unstable_by(middle, |a, b| {
        a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1))
    });
    // The comparison is total (ties by index), so the two halves, and by recursion the tree, do not depend on the run.
    let (low, high) = items.split_at_mut(middle);
    build(mesh, low, first, nodes);
    let right = nodes.len() as u32;
    build(mesh, high, first + middle as u32, nodes);
    nodes[at].right = right;
}

/// Nearest point of a triangle, also of a degenerate one (Ericson, Real-Time Collision Detection, 2005, section 5.1.5).
pub fn nearest_on_triangle(p: &Vec3, [a, b, c]: &[Vec3; 3]) -> Vec3 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return *a;
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    if d3 >= 0.0 && d4 <= d3 {
        return *b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 && d1 - d3 > 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    if d6 >= 0.0 && d5 <= d6 {
        return *c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 && d2 - d6 > 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    let (e4, e5) = (d4 - d3, d5 - d6);
    if va <= 0.0 && e4 >= 0.0 && e5 >= 0.0 && e4 + e5 > 0.0 {
        return b + (c - b) * (e4 / (e4 + e5));
    }
    let sum = va + vb + vc;
    if sum > 0.0 {
        return a + ab * (vb / sum) + ac * (vc / sum);
    }
    // Rounding on a sliver: its sides hold the nearest point.
    [(a, b), (b, c), (c, a)]
        .map(|(u, v)| {
            let d = v - u;
            let t = if d.norm_squared() > 0.0 {
                (d.dot(&(p - u)) / d.norm_squared()).clamp(0.0, 1.0)
            } else {
                0.0
            };
            u + d * t
        })
        .into_iter()
        .min_by(|x, y| (x - p).norm_squared().total_cmp(&(y - p).norm_squared()))
        .unwrap_or(*a)
}

/// Ray parameter of the crossing with a triangle (Moeller and Trumbore 1997, doi:10.1080/10867651.1997.10487468).
fn ray_triangle(origin: &Vec3, direction: &Vec3, [a, b, c]: &[Vec3; 3]) -> Option<f64> {
    let (e1, e2) = (b - a, c - a);
    let h = direction.cross(&e2);
    let det = e1.dot(&h);
    if det == 0.0 {
        return None;
    }
    let s = (origin - a) / det;
    let u = s.dot(&h);
    let q = s.cross(&e1);
    let v = direction.dot(&q);
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| e2.dot(&q))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn soup(values: &[f64]) -> TriMesh {
        let points: Vec<Vec3> = values
            .chunks_exact(3)
            .map(|c| Vec3::new(c[0], c[1], c[2]))
            .collect();
        let triangles = (0..points.len() as u32 / 3)
            .map(|t| [3 * t, 3 * t + 1, 3 * t + 2])
            .collect();
        TriMesh {
            points,
            triangles,
            tags: vec![],
        }
    }

    proptest! {
        #[test]
        fn nearest_equals_brute_force(values in prop::collection::vec(-5.0f64..5.0, 9..400), p in prop::array::uniform3(-8.0f64..8.0)) {
            let mesh = soup(&values);
            let bvh = Bvh::new(&mesh);
            let p = Vec3::from(p);
            let wanted = (0..mesh.triangles.len())
                .map(|t| (nearest_on_triangle(&p, &mesh.corners(t)) - p).norm())
                .fold(f64::INFINITY, f64::min);
            let found = bvh.nearest(&p, f64::INFINITY).map(|n| n.distance).unwrap_or(f64::INFINITY);
            prop_assert!((found - wanted).abs() < 1e-12);
            prop_assert!(bvh.nearest(&p, wanted * 0.99 - 1e-9).is_none());
        }

        #[test]
        fn nearest_on_triangle_is_optimal(values in prop::collection::vec(-2.0f64..2.0, 12..=12), u in 0.0f64..1.0, v in 0.0f64..1.0) {
            let [a, b, c, p] = [0, 3, 6, 9].map(|k| Vec3::new(values[k], values[k + 1], values[k + 2]));
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let other = a + (b - a) * u + (c - a) * v;
            let best = nearest_on_triangle(&p, &[a, b, c]);
            prop_assert!((best - p).norm() <= (other - p).norm() + 1e-12);
        }
    }

    #[test]
    fn degenerate_and_broken_triangles_do_no_harm() {
        let mut mesh = soup(&[
            0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0,
            5.0,
        ]);
        mesh.points.push(Vec3::new(f64::NAN, 0.0, 0.0));
        mesh.triangles.push([0, 1, 6]);
        mesh.triangles.push([0, 1, 99]);
        let bvh = Bvh::new(&mesh);
        let near = bvh
            .nearest(&Vec3::new(1.5, 1.0, 0.0), 10.0)
            .expect("two triangles are usable");
        assert!((near.distance - 1.0).abs() < 1e-12);
        assert!(
            Bvh::new(&TriMesh::default())
                .nearest(&Vec3::zeros(), 1.0)
                .is_none()
        );
    }

    #[test]
    fn ray_hits_the_first_triangle() {
        let mesh = soup(&[
            0.0, -1.0, -1.0, 0.0, 1.0, -1.0, 0.0, 0.0, 1.0, 2.0, -1.0, -1.0, 2.0, 1.0, -1.0, 2.0,
            0.0, 1.0,
        ]);
        let bvh = Bvh::new(&mesh);
        let hit = bvh.first_hit(&Vec3::new(-1.0, 0.0, 0.0), &Vec3::x(), 1e-9, 10.0);
        assert_eq!(hit, Some((1.0, 0)));
        let hit = bvh.first_hit(&Vec3::new(0.0, 0.0, 0.0), &Vec3::x(), 1e-9, 10.0);
        assert_eq!(hit, Some((2.0, 1)));
    }
}
