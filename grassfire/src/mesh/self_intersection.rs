//! Pairs of triangles of one mesh that cut each other.

use rayon::prelude::*;
use robust::{Coord, Coord3D, orient2d, orient3d};

use super::TriMesh;
use super::bvh::{Bvh, Node, boxes_overlap, triangle_box};
use crate::Vec3;

/// Two triangles with a common edge count as folded over when, seen along that edge, they leave it
/// in directions closer than half a degree (this is the cosine).
const FOLDED: f64 = 0.999_961_923;

/// Pairs `[i, j]`, `i < j`, of triangles that intersect, in ascending order.
///
/// 1. A bounding volume tree over the triangles gives candidate pairs, each once.
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
    let tree = Bvh::new(mesh);
    let boxes: Vec<[Vec3; 2]> = tree.corners.iter().map(triangle_box).collect();
    let leaves: Vec<&Node> = tree.nodes.iter().filter(|node| node.right == 0).collect();
    let mut found: Vec<[u32; 2]> = leaves
        .par_iter()
        .with_min_len(64)
        .flat_map_iter(|leaf| {
            let mut pairs = Vec::new();
            overlapping_pairs(&tree, &boxes, leaf, |[a, b]| {
                let (i, j) = (tree.ids[a].min(tree.ids[b]), tree.ids[a].max(tree.ids[b]));
                if intersect(mesh, i as usize, j as usize) {
                    pairs.push([i, j]);
                }
            });
            pairs
        })
        .collect();
    found.sort_unstable();
    found
}

/// Pairs of triangles, by their places in the order of the tree, whose boxes overlap: the first is in `leaf`, the second behind it.
/// So each pair is met once.
fn overlapping_pairs(
    tree: &Bvh,
    boxes: &[[Vec3; 2]],
    leaf: &Node,
    mut visit: impl FnMut([usize; 2]),
) {
    let range = |node: &Node| node.first as usize..(node.first + node.count) as usize;
    let mut stack = vec![0u32];
    while let Some(top) = stack.pop() {
        let node = &tree.nodes[top as usize];
        if range(node).end <= range(leaf).start || !leaf.overlaps(&node.lo, &node.hi) {
            continue;
        }
        if node.right != 0 {
            stack.push(node.right);
            stack.push(top + 1);
            continue;
        }
        for a in range(leaf) {
            for b in range(node).filter(|&b| b > a) {
                if boxes_overlap(boxes[a].each_ref(), boxes[b].each_ref()) {
                    visit([a, b]);
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

/// All on one side of a plane, none in it.
fn apart(sides: &[f64]) -> bool {
    sides.iter().all(|&s| s > 0.0) || sides.iter().all(|&s| s < 0.0)
}

/// The segment, whose ends lie on these sides of the triangle's plane, meets the triangle in a point, their planes not
/// coinciding.
fn crosses([p, q]: [&Vec3; 2], sides: [f64; 2], t: &[Vec3; 3]) -> bool {
    if apart(&sides) || sides == [0.0, 0.0] {
        return false;
    }
    let turn = |a: &Vec3, b: &Vec3| orient3d(coord(p), coord(q), coord(a), coord(b));
    let turns = [turn(&t[0], &t[1]), turn(&t[1], &t[2]), turn(&t[2], &t[0])];
    turns.iter().all(|&s| s >= 0.0) || turns.iter().all(|&s| s <= 0.0)
}

fn intersect(mesh: &TriMesh, i: usize, j: usize) -> bool {
    let (ti, tj) = (mesh.triangles[i], mesh.triangles[j]);
    if !distinct(ti) || !distinct(tj) {
        return false;
    }
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
        [] => disjoint_corners_meet(&a, &b),
        [(k, m)] => others_meet(&a, k, &b, m),
        [(k, m), (l, n)] => folded(&a, 3 - k - l, &b, 3 - m - n),
        _ => true,
    }
}

fn distinct([a, b, c]: [u32; 3]) -> bool {
    a != b && b != c && c != a
}

/// Two triangles without a common point intersect.
fn disjoint_corners_meet(a: &[Vec3; 3], b: &[Vec3; 3]) -> bool {
    let of_a = a.map(|p| side(b, &p));
    if apart(&of_a) {
        return false;
    }
    let of_b = b.map(|p| side(a, &p));
    if apart(&of_b) {
        return false;
    }
    let edge = |t: &[Vec3; 3], sides: &[f64; 3], k: usize, other: &[Vec3; 3]| {
        let next = (k + 1) % 3;
        crosses([&t[k], &t[next]], [sides[k], sides[next]], other)
    };
    (0..3).any(|k| edge(a, &of_a, k, b) || edge(b, &of_b, k, a))
        || (of_a == [0.0; 3] && of_b == [0.0; 3] && coplanar_overlap(a, b))
}

/// Two triangles with one common point, their corners `k` and `m`, intersect elsewhere, too.
fn others_meet(a: &[Vec3; 3], k: usize, b: &[Vec3; 3], m: usize) -> bool {
    let (of_a, of_b) = (opposite(a, k), opposite(b, m));
    let sides = of_a.map(|p| side(b, p));
    if apart(&sides) {
        return false;
    }
    crosses(of_a, sides, b) || crosses(of_b, of_b.map(|p| side(a, p)), a)
}

/// Ends of the edge opposite to a corner.
fn opposite(t: &[Vec3; 3], corner: usize) -> [&Vec3; 2] {
    [&t[(corner + 1) % 3], &t[(corner + 2) % 3]]
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

/// Triangles in one plane overlap there.
fn coplanar_overlap(a: &[Vec3; 3], b: &[Vec3; 3]) -> bool {
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
