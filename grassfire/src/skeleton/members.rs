//! Narrow and tiny sheets burnt to beams, so that slender members do not flicker between sheet and beam.
//!
//! 1. Measure, inside each sheet, the distance to the rim. At a seam the two flattest faces go on into each other; the
//!    others end there, which is not a rim.
//! 2. Core: faces farther than half the member width from the rim; a core must somewhere be clearly wider (hysteresis).
//! 3. Wide: everything within that distance of a core (a geodesic opening); short gaps
//!    between wide parts are filled, pieces smaller than the member size drop out.
//! 4. The rest burns from its free edges inward, in the order of the distance: elementary collapses, so the homotopy type
//!    stays. Hairs that run straight toward the rim go at once; real spurs are left to the pruning by protrusion.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::build::SkeletonOptions;
use super::complex::Complex;
use super::cut::{Cut, Key, Pair, smooth_pairs};
use super::edges::{UnionFind, edge};
use crate::monitor::{Cancelled, Monitor};

/// A core must somewhere be wider than the member width by this factor.
const CLEARLY: f64 = 1.25;
/// The opening reaches a little farther than the core's distance: graph distances are over-estimates.
const REACH: f64 = 1.2;
/// A dangling edge whose rim distance falls faster than this toward its tip is a hair, not a member.
const HAIR: f64 = 0.4;
/// A gap between wide parts shorter than this many radii is no member.
const GAP: f64 = 2.5;
/// Burns narrow and tiny sheets of `c` to beams; compacts.
pub(crate) fn burn_members(
    c: &mut Complex,
    unit: f64,
    options: &SkeletonOptions,
    monitor: &Monitor,
) -> Result<(), Cancelled> {
    if c.alive().next().is_none() {
        return Ok(());
    }
    let table = c.edge_table();
    let pairs = smooth_pairs(c, &table);
    let cut = Cut::new(c, &pairs);
    let distance = cut.distances(&cut.rim_nodes(&table), f64::INFINITY);
    monitor.check()?;
    let wide = wide_faces(c, &pairs, &cut, &distance, unit, options);
    monitor.check()?;
    burn(c, &cut, &distance, &wide);
    c.compact();
    Ok(())
}

/// True for faces that stay a sheet.
fn wide_faces(
    c: &Complex,
    pairs: &[Pair],
    cut: &Cut,
    distance: &[f64],
    unit: f64,
    options: &SkeletonOptions,
) -> Vec<bool> {
    let half = options.member_width / 2.0;
    let radius = |t: u32| c.tri(t).iter().map(|&v| c.radii[v as usize]).sum::<f64>() / 3.0;
    let depth = |t: u32| {
        cut.node[t as usize]
            .iter()
            .map(|&n| distance[n as usize])
            .sum::<f64>()
            / 3.0
    };
    let n = c.triangles.len();
    let mut core = vec![false; n];
    for t in c.alive() {
        core[t as usize] = depth(t) > half * radius(t);
    }
    let clear: Vec<u32> = c
        .alive()
        .filter(|&t| depth(t) > CLEARLY * half * radius(t))
        .collect();
    let mut sets = components(pairs, &core);
    let mut keep = vec![false; n];
    for t in clear {
        keep[sets.find(t) as usize] = true;
    }
    let sources: Vec<u32> = c
        .alive()
        .filter(|&t| core[t as usize] && keep[sets.find(t) as usize])
        .flat_map(|t| cut.node[t as usize])
        .collect();
    let reach = cut.distances(&sources, f64::INFINITY);
    let mut wide = vec![false; n];
    for t in c.alive() {
        let near = |&m: &u32| {
            let r = c.radii[cut.vertex[m as usize] as usize];
            reach[m as usize] <= REACH * half * r + 0.6 * unit
        };
        wide[t as usize] = cut.node[t as usize].iter().all(near);
    }
    bridge_gaps(c, pairs, cut, distance, half, &mut wide);
    drop_tiny(c, pairs, &mut wide, options.member_size);
    wide
}

/// Gives short necks between wide parts back to the sheet (hysteresis): a member must be longer than `GAP` radii, and a
/// neck must not be narrower than half the member width.
fn bridge_gaps(
    c: &Complex,
    pairs: &[Pair],
    cut: &Cut,
    distance: &[f64],
    half: f64,
    wide: &mut [bool],
) {
    // Fronts: runs of pairs between a narrow and a wide face, joined where they share a vertex fan.
    let mut fronts = UnionFind::new(cut.vertex.len());
    let mut touched: Vec<u32> = Vec::new();
    for &Pair {
        edge: [a, b],
        faces: [s, t],
    } in pairs
    {
        if wide[s as usize] != wide[t as usize] {
            let (m, n) = (cut.node_at(s, a), cut.node_at(s, b));
            fronts.join(m, n);
            touched.extend([m, n]);
        }
    }
    touched.sort_unstable();
    touched.dedup();
    let narrow: Vec<u32> = c.alive().filter(|&t| !wide[t as usize]).collect();
    let mut inside = vec![false; cut.vertex.len()];
    for &t in &narrow {
        for n in cut.node[t as usize] {
            inside[n as usize] = true;
        }
    }
    // The two nearest fronts of every node, by one search that lets two fronts pass a node.
    let mut near: Vec<[(f64, u32); 2]> = vec![[(f64::INFINITY, u32::MAX); 2]; cut.vertex.len()];
    let mut heap = BinaryHeap::new();
    for &n in &touched {
        heap.push(Reverse((Key(0.0), n, fronts.find(n))));
    }
    while let Some(Reverse((Key(d), n, front))) = heap.pop() {
        let slot = &mut near[n as usize];
        if slot[0].1 == u32::MAX {
            slot[0] = (d, front);
        } else if slot[0].1 != front && slot[1].1 == u32::MAX {
            slot[1] = (d, front);
        } else {
            continue;
        }
        let limit = GAP * c.radii[cut.vertex[n as usize] as usize];
        for &(m, step) in &cut.near[n as usize] {
            if inside[m as usize] && d + step <= limit {
                heap.push(Reverse((Key(d + step), m, front)));
            }
        }
    }
    let total = |n: u32| near[n as usize][0].0 + near[n as usize][1].0;
    let bridge: Vec<u32> = narrow
        .into_iter()
        .filter(|&t| {
            let n = cut.node[t as usize];
            let r = c.tri(t).iter().map(|&v| c.radii[v as usize]).sum::<f64>() / 3.0;
            n.iter().map(|&n| total(n)).sum::<f64>() / 3.0 <= GAP * r
        })
        .collect();
    // Only where the neck is not too thin at its middle.
    let mut members = vec![false; wide.len()];
    for &t in &bridge {
        members[t as usize] = true;
    }
    let mut sets = components(pairs, &members);
    let mut thick = vec![false; wide.len()];
    for &t in &bridge {
        let n = cut.node[t as usize];
        let middle = n
            .iter()
            .any(|&n| (near[n as usize][0].0 - near[n as usize][1].0).abs() < 0.3 * total(n));
        let deep = n
            .iter()
            .any(|&n| distance[n as usize] > 0.5 * half * c.radii[cut.vertex[n as usize] as usize]);
        if middle && deep {
            thick[sets.find(t) as usize] = true;
        }
    }
    for &t in &bridge {
        wide[t as usize] = thick[sets.find(t) as usize];
    }
}

/// Faces of `set` joined over the pairs.
fn components(pairs: &[Pair], set: &[bool]) -> UnionFind {
    let mut sets = UnionFind::new(set.len());
    for &Pair { faces: [s, t], .. } in pairs {
        if set[s as usize] && set[t as usize] {
            sets.join(s, t);
        }
    }
    sets
}

fn drop_tiny(c: &Complex, pairs: &[Pair], wide: &mut [bool], size: f64) {
    let mut sets = components(pairs, wide);
    let mut area = vec![0.0; wide.len()];
    let mut weighted = vec![0.0; wide.len()];
    for t in c.alive().filter(|&t| wide[t as usize]) {
        let [p, q, s] = c.tri(t).map(|v| c.points[v as usize]);
        let a = (q - p).cross(&(s - p)).norm() / 2.0;
        let r = c.tri(t).iter().map(|&v| c.radii[v as usize]).sum::<f64>() / 3.0;
        let root = sets.find(t) as usize;
        area[root] += a;
        weighted[root] += a * r;
    }
    for t in c.alive() {
        let root = sets.find(t) as usize;
        if wide[t as usize] && area[root].powi(3) < (size * weighted[root]).powi(2) {
            wide[t as usize] = false;
        }
    }
}

/// Burns the faces that are not wide, nearest to the rim first.
fn burn(c: &mut Complex, cut: &Cut, distance: &[f64], wide: &[bool]) {
    let depth = |t: u32| {
        cut.node[t as usize]
            .iter()
            .map(|&n| distance[n as usize])
            .sum::<f64>()
            / 3.0
    };
    // Rim distance of a vertex: the farthest of its fans, which is the one that burns last.
    let mut height = vec![0.0f64; c.points.len()];
    for (n, &v) in cut.vertex.iter().enumerate() {
        if distance[n].is_finite() {
            height[v as usize] = height[v as usize].max(distance[n]);
        }
    }
    let old_beams = c.beams.len();
    let mut heap: BinaryHeap<Reverse<(Key, u32)>> = c
        .alive()
        .filter(|&t| !wide[t as usize])
        .map(|t| Reverse((Key(depth(t)), t)))
        .collect();
    let mut hairs: Vec<u32> = Vec::new();
    while let Some(Reverse((_, t))) = heap.pop() {
        if c.tri(t)[0] == super::complex::DEAD {
            continue;
        }
        let v = c.tri(t);
        let mut sides = [edge(v[0], v[1]), edge(v[1], v[2]), edge(v[2], v[0])];
        sides.sort_by(|x, y| {
            c.length(y[0], y[1])
                .total_cmp(&c.length(x[0], x[1]))
                .then(x.cmp(y))
        });
        let Some(&free) = sides.iter().find(|e| c.face_count(e[0], e[1]) == 1) else {
            continue;
        };
        c.remove_triangle(t);
        for e in sides {
            let faces = c.on_edge(e[0], e[1]);
            match faces[..] {
                [] if e != free => c.add_beam(e),
                [f] if !wide[f as usize] => heap.push(Reverse((Key(depth(f)), f))),
                _ => {}
            }
        }
        hairs.extend(v);
        while let Some(tip) = hairs.pop() {
            remove_hair(c, tip, old_beams, &height, &mut hairs);
        }
    }
}

fn remove_hair(c: &mut Complex, tip: u32, old_beams: usize, height: &[f64], next: &mut Vec<u32>) {
    let [beam] = c.vertex_beams[tip as usize][..] else {
        return;
    };
    if !c.vertex_triangles[tip as usize].is_empty() || (beam as usize) < old_beams {
        return;
    }
    let [p, q] = c.beams[beam as usize];
    let root = if p == tip { q } else { p };
    let alone =
        c.vertex_beams[root as usize].len() == 1 && c.vertex_triangles[root as usize].is_empty();
    let rise = height[root as usize] - height[tip as usize];
    if !alone && rise > HAIR * c.length(tip, root) {
        c.remove_beam(beam);
        next.push(root);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;

    /// A grid of `nx` by `ny` unit cells, two triangles each; `keep` chooses the cells.
    fn sheet(nx: u32, ny: u32, keep: impl Fn(u32, u32) -> bool) -> Complex {
        let points = (0..(nx + 1) * (ny + 1))
            .map(|i| Vec3::new(f64::from(i % (nx + 1)), f64::from(i / (nx + 1)), 0.0))
            .collect();
        let mut triangles = Vec::new();
        for y in 0..ny {
            for x in 0..nx {
                let a = y * (nx + 1) + x;
                let (b, d) = (a + 1, a + nx + 1);
                if keep(x, y) {
                    triangles.extend([[a, b, d + 1], [a, d + 1, d]]);
                }
            }
        }
        let n = ((nx + 1) * (ny + 1)) as usize;
        let mut c = Complex::new(points, vec![2.0; n], &triangles, &[]);
        c.compact();
        c
    }

    fn burnt(mut sheet: Complex) -> Complex {
        let before = sheet.betti();
        let options = SkeletonOptions::default();
        burn_members(&mut sheet, 1.0, &options, &Monitor::default()).expect("not cancelled");
        assert_eq!(sheet.betti(), before);
        sheet
    }

    #[test]
    fn ribbon_becomes_a_curve_and_plate_stays() {
        let ribbon = burnt(sheet(40, 2, |_, _| true));
        assert_eq!(ribbon.alive().count(), 0);
        assert!(ribbon.alive_beams().count() > 30);
        let plate = burnt(sheet(40, 20, |_, _| true));
        assert!(plate.alive().count() > 1500);
    }

    #[test]
    fn narrow_ring_keeps_its_loop() {
        let ring = burnt(sheet(20, 20, |x, y| {
            !(2..18).contains(&x) || !(2..18).contains(&y)
        }));
        assert_eq!(ring.alive().count(), 0);
    }
}
