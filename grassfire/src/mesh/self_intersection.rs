//! Pairs of triangles of one mesh that cut each other.

use rayon::prelude::*;
use robust::{Coord, Coord3D, orient2d, orient3d};

use super::TriMesh;
use crate::Vec3;

/// Two triangles with a common edge count as folded over when, seen along that edge, they leave it
/// in directions closer than half a degree (this is the cosine).
const FOLDED: f64 = 0.999_961_923;

/// Pairs `[i, j]`, `i < j`, of triangles that intersect, in ascending order.
///
/// 1. A bounding volume tree over the triangles gives candidate pairs.
/// 2. No common point: an edge of one must cross the other (exact orientation predicates, touching
///    counts), or both lie in one plane and overlap there.
/// 3. One common point: the edge opposite to it in either triangle must cross the other triangle.
/// 4. One common edge: reported when folded over, that is when both leave the edge in the same
///    direction within half a degree.
///
/// Triangles that name missing points, and degenerate ones, are ignored. The order of the result
/// does not depend on the number of threads. Predicates: J. R. Shewchuk, 1997,
/// doi:10.1007/PL00009321.
pub fn self_intersections(mesh: &TriMesh) -> Vec<[u32; 2]> {
    let n = mesh.points.len();
    let usable = |t: &[u32; 3]| {
        t.iter()
            .all(|&v| (v as usize) < n && mesh.points[v as usize].iter().all(|x| x.is_finite()))
            && t[0] != t[1]
            && t[1] != t[2]
            && t[2] != t[0]
    };
    let ids: Vec<u32> = (0..mesh.triangles.len() as u32)
        .filter(|&t| usable(&mesh.triangles[t as usize]))
        .collect();
    let boxes: Vec<Aabb> = ids
        .iter()
        .map(|&t| Aabb::around(&mesh.corners(t as usize)))
        .collect();
    let tree = Tree::new(&boxes);
    let found: Vec<Vec<[u32; 2]>> = (0..ids.len())
        .into_par_iter()
        .with_min_len(256)
        .map(|i| {
            let mut pairs = Vec::new();
            tree.overlapping(&boxes, &boxes[i], |j| {
                let (a, b) = (ids[i], ids[j as usize]);
                if a < b && intersect(mesh, a as usize, b as usize) {
                    pairs.push([a, b]);
                }
            });
            pairs.sort_unstable();
            pairs
        })
        .collect();
    found.into_iter().flatten().collect()
}

#[derive(Clone, Copy)]
struct Aabb {
    lo: Vec3,
    hi: Vec3,
}

impl Aabb {
    fn around(points: &[Vec3]) -> Self {
        let empty = Self {
            lo: Vec3::repeat(f64::INFINITY),
            hi: Vec3::repeat(f64::NEG_INFINITY),
        };
        points.iter().fold(empty, |b, p| Self {
            lo: b.lo.inf(p),
            hi: b.hi.sup(p),
        })
    }

    fn join(&self, other: &Self) -> Self {
        Self {
            lo: self.lo.inf(&other.lo),
            hi: self.hi.sup(&other.hi),
        }
    }

    fn overlaps(&self, other: &Self) -> bool {
        (0..3).all(|a| self.lo[a] <= other.hi[a] && other.lo[a] <= self.hi[a])
    }
}

const LEAF: usize = 4;

/// A binary tree over boxes, nodes in depth-first order.
struct Tree {
    /// Box, first item, item count (0: inner node), and where the right child is.
    nodes: Vec<(Aabb, u32, u32, u32)>,
    items: Vec<u32>,
}

impl Tree {
    fn new(boxes: &[Aabb]) -> Self {
        let mut tree = Self {
            nodes: Vec::new(),
            items: (0..boxes.len() as u32).collect(),
        };
        if !boxes.is_empty() {
            let mut items = std::mem::take(&mut tree.items);
            tree.build(boxes, &mut items, 0);
            tree.items = items;
        }
        tree
    }

    fn build(&mut self, boxes: &[Aabb], items: &mut [u32], first: u32) {
        let around = items
            .iter()
            .skip(1)
            .fold(boxes[items[0] as usize], |b, &i| b.join(&boxes[i as usize]));
        let here = self.nodes.len();
        self.nodes.push((around, first, items.len() as u32, 0));
        if items.len() <= LEAF {
            return;
        }
        let axis = (around.hi - around.lo).imax();
        let key = |i: u32| boxes[i as usize].lo[axis] + boxes[i as usize].hi[axis];
        let half = items.len() / 2;
        items.select_nth_unstable_by(half, |&a, &b| key(a).total_cmp(&key(b)).then(a.cmp(&b)));
        let (left, right) = items.split_at_mut(half);
        self.build(boxes, left, first);
        let at = self.nodes.len() as u32;
        self.build(boxes, right, first + half as u32);
        self.nodes[here].2 = 0;
        self.nodes[here].3 = at;
    }

    fn overlapping(&self, boxes: &[Aabb], query: &Aabb, mut visit: impl FnMut(u32)) {
        let mut stack = vec![0u32];
        while let Some(at) = stack.pop() {
            let Some((around, first, count, right)) = self.nodes.get(at as usize) else {
                continue;
            };
            if !around.overlaps(query) {
                continue;
            }
            if *count == 0 {
                stack.push(*right);
                stack.push(at + 1);
                continue;
            }
            for &item in &self.items[*first as usize..(*first + *count) as usize] {
                if boxes[item as usize].overlaps(query) {
                    visit(item);
                }
            }
        }
    }
}

fn coord(p: &Vec3) -> Coord3D<f64> {
    Coord3D {
        x: p.x,
        y: p.y,
        z: p.z,
    }
}

fn side(t: &[Vec3; 3], p: &Vec3) -> f64 {
    orient3d(coord(&t[0]), coord(&t[1]), coord(&t[2]), coord(p))
}

/// The segment meets the triangle in a point, their planes not coinciding.
fn crosses(p: &Vec3, q: &Vec3, t: &[Vec3; 3]) -> bool {
    let (sp, sq) = (side(t, p), side(t, q));
    if (sp > 0.0 && sq > 0.0) || (sp < 0.0 && sq < 0.0) || (sp == 0.0 && sq == 0.0) {
        return false;
    }
    let turn = |a: &Vec3, b: &Vec3| orient3d(coord(p), coord(q), coord(a), coord(b));
    let turns = [turn(&t[0], &t[1]), turn(&t[1], &t[2]), turn(&t[2], &t[0])];
    turns.iter().all(|&s| s >= 0.0) || turns.iter().all(|&s| s <= 0.0)
}

fn intersect(mesh: &TriMesh, i: usize, j: usize) -> bool {
    let (ti, tj) = (mesh.triangles[i], mesh.triangles[j]);
    let (a, b) = (mesh.corners(i), mesh.corners(j));
    let mut shared = [(0, 0); 9];
    let mut count = 0;
    for (k, v) in ti.iter().enumerate() {
        for (m, w) in tj.iter().enumerate() {
            if v == w {
                shared[count] = (k, m);
                count += 1;
            }
        }
    }
    match shared[..count] {
        [] => {
            let edge =
                |t: &[Vec3; 3], k: usize, other: &[Vec3; 3]| crosses(&t[k], &t[(k + 1) % 3], other);
            (0..3).any(|k| edge(&a, k, &b) || edge(&b, k, &a)) || coplanar_overlap(&a, &b)
        }
        [(k, m)] => {
            crosses(&a[(k + 1) % 3], &a[(k + 2) % 3], &b)
                || crosses(&b[(m + 1) % 3], &b[(m + 2) % 3], &a)
        }
        [(k, m), (l, n)] => folded(&a, 3 - k - l, &b, 3 - m - n),
        _ => true,
    }
}

/// Triangles over a common edge, `k` and `m` their third corners, lie on top of each other.
fn folded(a: &[Vec3; 3], k: usize, b: &[Vec3; 3], m: usize) -> bool {
    let (from, to) = (a[(k + 1) % 3], a[(k + 2) % 3]);
    let Some(axis) = (to - from).try_normalize(0.0) else {
        return false;
    };
    let across = |p: &Vec3| {
        let d = p - from;
        (d - axis * d.dot(&axis)).try_normalize(0.0)
    };
    match (across(&a[k]), across(&b[m])) {
        (Some(d), Some(e)) => d.dot(&e) > FOLDED,
        _ => false,
    }
}

/// All six points lie in one plane and the triangles overlap there.
fn coplanar_overlap(a: &[Vec3; 3], b: &[Vec3; 3]) -> bool {
    if b.iter().any(|p| side(a, p) != 0.0) || a.iter().any(|p| side(b, p) != 0.0) {
        return false;
    }
    let normal = (a[1] - a[0]).cross(&(a[2] - a[0]));
    let drop = normal.iamax();
    let flat = |p: &Vec3| Coord {
        x: p[(drop + 1) % 3],
        y: p[(drop + 2) % 3],
    };
    let (a, b) = (a.map(|p| flat(&p)), b.map(|p| flat(&p)));
    let apart = |s: &[Coord<f64>; 3], t: &[Coord<f64>; 3]| {
        let sense = orient2d(s[0], s[1], s[2]);
        (0..3).any(|k| {
            t.iter()
                .all(|&p| orient2d(s[k], s[(k + 1) % 3], p) * sense < 0.0)
        })
    };
    orient2d(a[0], a[1], a[2]) != 0.0
        && orient2d(b[0], b[1], b[2]) != 0.0
        && !apart(&a, &b)
        && !apart(&b, &a)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(points: &[[f64; 3]], triangles: &[[u32; 3]]) -> TriMesh {
        let points = points.iter().map(|p| Vec3::from(*p)).collect();
        TriMesh {
            points,
            triangles: triangles.to_vec(),
            tags: Vec::new(),
        }
    }

    #[test]
    fn a_pierced_triangle_is_found_and_a_near_miss_is_not() {
        let base = [[0., 0., 0.], [2., 0., 0.], [0., 2., 0.]];
        for (z, expected) in [(-0.5, 1), (0.0, 1), (1e-300, 0), (0.1, 0)] {
            let mut points = base.to_vec();
            points.extend([[0.5, 0.5, z], [0.5, 0.6, 1.0], [0.6, 0.5, 1.0]]);
            let found = self_intersections(&mesh(&points, &[[0, 1, 2], [3, 4, 5]]));
            assert_eq!(found.len(), expected, "at height {z}");
        }
    }

    #[test]
    fn neighbours_count_only_when_they_cut_or_fold() {
        let points = [
            [0., 0., 0.],
            [1., 0., 0.],
            [0., 1., 0.],
            [1., 1., 0.2],
            [0.2, 0.5, 0.0],
        ];
        assert!(self_intersections(&mesh(&points, &[[0, 1, 2], [1, 3, 2]])).is_empty());
        assert_eq!(
            self_intersections(&mesh(&points, &[[0, 1, 2], [2, 1, 4]])),
            [[0, 1]]
        );
        let fan = [
            [0., 0., 0.],
            [1., 0., 0.],
            [0., 1., 0.],
            [0.4, 0.4, -1.],
            [0.4, 0.4, 1.],
        ];
        assert_eq!(
            self_intersections(&mesh(&fan, &[[0, 1, 2], [0, 3, 4]])),
            [[0, 1]]
        );
    }

    #[test]
    fn coplanar_overlap_is_found() {
        let points = [
            [0., 0., 1.],
            [2., 0., 1.],
            [0., 2., 1.],
            [0.5, 0.5, 1.],
            [3., 0.5, 1.],
            [3., 3., 1.],
            [9., 0.5, 1.],
            [9., 3., 1.],
        ];
        let found = self_intersections(&mesh(&points, &[[0, 1, 2], [3, 4, 5], [4, 6, 7]]));
        assert_eq!(found, [[0, 1]]);
    }

    #[test]
    fn grids_that_cross_give_the_same_pairs_as_all_against_all() {
        let mut points = Vec::new();
        let mut triangles = Vec::new();
        for sheet in 0..2 {
            let base = points.len() as u32;
            for j in 0..12u32 {
                for i in 0..12u32 {
                    let (x, y) = (f64::from(i), f64::from(j) + 0.137);
                    let z = 0.3 * (x * 0.9).sin() + 0.21 * (y * 1.3).cos();
                    points.push(if sheet == 0 {
                        Vec3::new(x, y, z)
                    } else {
                        Vec3::new(x + 0.31, z + 5.0, y - 6.0)
                    });
                    if i > 0 && j > 0 {
                        let v = base + 12 * j + i;
                        triangles.extend([[v, v - 1, v - 13], [v, v - 13, v - 12]]);
                    }
                }
            }
        }
        let mesh = TriMesh {
            points,
            triangles,
            tags: Vec::new(),
        };
        let all: Vec<[u32; 2]> = (0..mesh.triangles.len())
            .flat_map(|i| (i + 1..mesh.triangles.len()).map(move |j| [i, j]))
            .filter(|&[i, j]| intersect(&mesh, i, j))
            .map(|[i, j]| [i as u32, j as u32])
            .collect();
        assert!(all.len() > 10);
        assert_eq!(self_intersections(&mesh), all);
    }
}
