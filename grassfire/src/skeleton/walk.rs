//! The triangle walk: two leftover triangles of a sheet meet by shifting one through the quads between them.
//!
//! Rims and seams are not touched, so neighbouring sheets stay conforming.

use std::collections::VecDeque;

use super::edges::{EdgeTable, betti, edge};
use super::polygons::{Polygon, edge_table, quad_quality};
use crate::Vec3;
use crate::monitor::{Cancelled, Monitor};

/// Of many leftovers only so many are tried as the start of the shortest walk.
const STARTS: usize = 32;

/// Pairs leftover triangles sheet by sheet. A sheet whose walk would change the topology is put back.
/// Returns how many triangles remain.
pub(crate) fn walk_triangles(
    polygons: &mut Vec<Option<Polygon>>,
    beams: &[[u32; 2]],
    points: &[Vec3],
    monitor: &Monitor,
) -> Result<usize, Cancelled> {
    let mut sheets: Vec<u32> = polygons
        .iter()
        .flatten()
        .filter(|p| p.is_triangle())
        .map(|p| p.sheet)
        .collect();
    sheets.sort_unstable();
    sheets.dedup();
    for sheet in sheets {
        let before = polygons.clone();
        let mut pairs = 0;
        loop {
            monitor.check()?;
            let table = edge_table(polygons);
            let Some(path) = shortest_path(polygons, &table, sheet) else {
                break;
            };
            let triangles = count_triangles(polygons, sheet);
            let done = follow(polygons, &path, points);
            pairs += 1;
            if !done || count_triangles(polygons, sheet) >= triangles {
                break;
            }
        }
        if pairs > 0
            && signature(points.len(), polygons, beams) != signature(points.len(), &before, beams)
        {
            *polygons = before;
        }
    }
    Ok(polygons
        .iter()
        .flatten()
        .filter(|p| p.is_triangle())
        .count())
}

fn signature(
    n: usize,
    polygons: &[Option<Polygon>],
    beams: &[[u32; 2]],
) -> (crate::topology::Betti, bool) {
    let list: Vec<Polygon> = polygons.iter().flatten().copied().collect();
    let distinct = list.iter().all(|p| {
        let mut v = p.corners().to_vec();
        v.sort_unstable();
        v.windows(2).all(|w| w[0] != w[1])
    });
    (betti(n, &list, beams), distinct)
}

fn count_triangles(polygons: &[Option<Polygon>], sheet: u32) -> usize {
    polygons
        .iter()
        .flatten()
        .filter(|p| p.sheet == sheet && p.is_triangle())
        .count()
}

/// Shortest dual path between two triangles of the sheet.
fn shortest_path(polygons: &[Option<Polygon>], table: &EdgeTable, sheet: u32) -> Option<Vec<u32>> {
    let triangle =
        |i: u32| polygons[i as usize].is_some_and(|p| p.sheet == sheet && p.is_triangle());
    let starts: Vec<u32> = (0..polygons.len() as u32)
        .filter(|&i| triangle(i))
        .take(STARTS)
        .collect();
    let mut best: Option<Vec<u32>> = None;
    for start in starts {
        let limit = best.as_ref().map_or(usize::MAX, Vec::len);
        if let Some(path) = search(polygons, table, start, limit, &triangle) {
            best = Some(path);
        }
    }
    best
}

/// Breadth-first search for the nearest other triangle, over edges with two faces; only paths shorter than `limit`.
fn search(
    polygons: &[Option<Polygon>],
    table: &EdgeTable,
    start: u32,
    limit: usize,
    triangle: &impl Fn(u32) -> bool,
) -> Option<Vec<u32>> {
    let mut parent: std::collections::HashMap<u32, (u32, usize)> = std::collections::HashMap::new();
    parent.insert(start, (start, 1));
    let mut queue = VecDeque::from([start]);
    while let Some(i) = queue.pop_front() {
        let depth = parent[&i].1;
        if depth + 1 >= limit {
            return None;
        }
        let p = polygons[i as usize]?;
        let v = p.corners();
        for k in 0..v.len() {
            let faces = table.at(v[k], v[(k + 1) % v.len()]);
            let [a, b] = *faces else { continue };
            let j = if a == i { b } else { a };
            if parent.contains_key(&j) {
                continue;
            }
            parent.insert(j, (i, depth + 1));
            if triangle(j) {
                let mut path = vec![j];
                while path[path.len() - 1] != start {
                    path.push(parent[&path[path.len() - 1]].0);
                }
                path.reverse();
                return Some(path);
            }
            queue.push_back(j);
        }
    }
    None
}

/// Moves the triangle along the path; false when it got stuck (the mesh is valid all the same).
fn follow(polygons: &mut [Option<Polygon>], path: &[u32], points: &[Vec3]) -> bool {
    let mut current = path[0];
    for (step, &next) in path.iter().enumerate().skip(1) {
        let (Some(t), Some(p)) = (polygons[current as usize], polygons[next as usize]) else {
            return false;
        };
        if !t.is_triangle() {
            return false;
        }
        let Some(k) = (0..3).find(|&k| {
            let v = t.corners();
            p.corners().contains(&v[k]) && p.corners().contains(&v[(k + 1) % 3])
        }) else {
            return false;
        };
        let v = t.corners();
        let (a, b, c) = (v[k], v[(k + 1) % 3], v[(k + 2) % 3]);
        let Some(quad) = p.as_quad() else {
            // Two triangles meet.
            let Some(&o) = p.corners().iter().find(|&&w| w != a && w != b) else {
                return false;
            };
            if o == c {
                return false;
            }
            polygons[next as usize] = Some(Polygon::quad([c, a, o, b], t.sheet));
            polygons[current as usize] = None;
            return true;
        };
        if quad.contains(&c) {
            // The quad wraps round the triangle (two shared edges): both become one triangle.
            let wrapped = (0..4).find(|&m| {
                [quad[m], quad[(m + 1) % 4], quad[(m + 3) % 4]]
                    .iter()
                    .all(|w| t.corners().contains(w))
            });
            let Some(m) = wrapped else { return false };
            let rest = [quad[(m + 1) % 4], quad[(m + 2) % 4], quad[(m + 3) % 4]];
            polygons[next as usize] = Some(Polygon::triangle(rest, t.sheet));
            polygons[current as usize] = None;
            current = next;
            continue;
        }
        let Some(target) = path.get(step + 1).and_then(|&i| polygons[i as usize]) else {
            return false;
        };
        let Some((triangle, left)) = shift([a, b, c], quad, &target, points) else {
            return false;
        };
        polygons[current as usize] = Some(Polygon::quad(left, t.sheet));
        polygons[next as usize] = Some(Polygon::triangle(triangle, t.sheet));
        current = next;
    }
    false
}

/// Triangle `abc` enters `quad` over `ab`: the five corners become a quad behind and a triangle that shares an edge with
/// `target`. Sheets need no orientation: the quad is turned to run b -> a here.
fn shift(
    [a, b, c]: [u32; 3],
    mut quad: [u32; 4],
    target: &Polygon,
    points: &[Vec3],
) -> Option<([u32; 3], [u32; 4])> {
    let mut m = quad.iter().position(|&w| w == a)?;
    if quad[(m + 1) % 4] == b {
        quad.reverse();
        m = quad.iter().position(|&w| w == a)?;
    }
    let (e, d) = (quad[(m + 1) % 4], quad[(m + 2) % 4]);
    let options = [
        ([c, a, e], [c, e, d, b], [a, e]),
        ([a, e, d], [a, d, b, c], [a, e]),
        ([a, e, d], [a, d, b, c], [e, d]),
        ([e, d, b], [c, a, e, b], [e, d]),
        ([e, d, b], [c, a, e, b], [d, b]),
        ([c, d, b], [c, a, e, d], [d, b]),
    ];
    let corners = target.corners();
    let n = corners.len();
    let side =
        |s: [u32; 2]| (0..n).any(|k| edge(corners[k], corners[(k + 1) % n]) == edge(s[0], s[1]));
    options
        .into_iter()
        .filter(|o| side(o.2))
        .max_by(|x, y| quad_quality(points, &x.1).total_cmp(&quad_quality(points, &y.1)))
        .map(|o| (o.0, o.1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_at_both_ends_of_a_strip_meet() {
        // A strip of quads with a triangle at either end.
        let points: Vec<Vec3> = (0..12)
            .map(|i| Vec3::new((i / 2) as f64, (i % 2) as f64, 0.0))
            .chain([Vec3::new(-1.0, 0.5, 0.0), Vec3::new(6.0, 0.5, 0.0)])
            .collect();
        let mut polygons: Vec<Option<Polygon>> = (0..5u32)
            .map(|i| Some(Polygon::quad([2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1], 0)))
            .collect();
        polygons.push(Some(Polygon::triangle([12, 0, 1], 0)));
        polygons.push(Some(Polygon::triangle([10, 13, 11], 0)));
        let left = walk_triangles(&mut polygons, &[], &points, &Monitor::default())
            .expect("not cancelled");
        assert_eq!(left, 0);
        assert_eq!(polygons.iter().flatten().count(), 6);
    }
}
