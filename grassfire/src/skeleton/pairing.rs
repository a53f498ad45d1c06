//! From the coarse triangulation to quads: even sheets, maximum-weight matching inside each sheet, rim splits.

use super::complex::{Class, Complex};
use super::edges::{EdgeTable, edge};
use super::polygons::{Polygon, edge_table, quad_quality};
use super::reference::Reference;
use crate::Vec3;
use crate::monitor::{Cancelled, Monitor};

/// Above this many triangles a sheet is paired greedily (best first) instead of by exact matching, to bound the time.
const EXACT_LIMIT: usize = 2000;

/// Splits what would break the pairing: one-edge seams (both ends inside sheets would give a body edge with four
/// faces), then one rim or seam edge of every sheet with an odd number of triangles. False when a sheet stays odd.
pub(crate) fn make_even(
    c: &mut Complex,
    reference: &Reference,
    target: impl Fn(&Complex, u32, u32) -> f64,
) -> bool {
    let split = |c: &mut Complex, [a, b]: [u32; 2]| {
        let ends = [a, b].map(|v| c.points[v as usize]);
        let m = c.split_middle(a, b);
        reference.project(c, m, &ends);
    };
    for arc in super::arcs::trace(c).arcs {
        if arc.kind == super::arcs::ArcKind::Seam && arc.vertices.len() == 2 {
            split(c, [arc.vertices[0], arc.vertices[1]]);
        }
    }
    let mut previous = usize::MAX;
    let mut stalled = 0;
    loop {
        let table = c.edge_table();
        let sheets = c.label_sheets(&table);
        let mut odd = vec![false; sheets];
        for t in c.alive() {
            odd[c.sheet[t as usize] as usize] ^= true;
        }
        let count = odd.iter().filter(|o| **o).count();
        let Some(first) = odd.iter().position(|o| *o) else {
            return true;
        };
        // Splitting a seam may only pass the odd sheet on; give up when that goes round.
        stalled = if count < previous { 0 } else { stalled + 1 };
        previous = previous.min(count);
        if stalled > 2 * sheets + 8 {
            return false;
        }
        let Some(e) = edge_to_split(c, &table, first as u32, &odd, &target) else {
            return false;
        };
        split(c, e);
    }
}

fn edge_to_split(
    c: &Complex,
    table: &EdgeTable,
    sheet: u32,
    odd: &[bool],
    target: impl Fn(&Complex, u32, u32) -> f64,
) -> Option<[u32; 2]> {
    let mut best: Option<((usize, f64), [u32; 2])> = None;
    for (e, f) in table.iter() {
        if f.len() == 2 || !f.iter().any(|&t| c.sheet[t as usize] == sheet) {
            continue;
        }
        // A rim settles one sheet alone, a seam between odd sheets several at once.
        let gain = if f.len() == 1 {
            1000
        } else {
            f.iter()
                .filter(|&&t| odd[c.sheet[t as usize] as usize])
                .count()
        };
        let rank = (gain, c.length(e[0], e[1]) / target(c, e[0], e[1]));
        if best.as_ref().is_none_or(|b| rank > b.0) {
            best = Some((rank, e));
        }
    }
    best.map(|b| b.1)
}

/// Pairs triangles into quads inside each sheet; never across an edge that has not exactly two triangles.
pub(crate) fn pair(c: &Complex, monitor: &Monitor) -> Result<Vec<Option<Polygon>>, Cancelled> {
    let table = c.edge_table();
    let sheets = c
        .alive()
        .map(|t| c.sheet[t as usize] + 1)
        .max()
        .unwrap_or(0) as usize;
    let mut members: Vec<Vec<u32>> = vec![Vec::new(); sheets];
    for t in c.alive() {
        members[c.sheet[t as usize] as usize].push(t);
    }
    let mut candidates: Vec<Vec<Candidate>> = (0..sheets).map(|_| Vec::new()).collect();
    for ([a, b], f) in table.iter() {
        if let [s, t] = *f
            && let Some(quad) = united(c.tri(s), c.tri(t), a, b)
        {
            let weight = (1000.0 * quad_quality(&c.points, &quad)).round() as i32 + 1;
            candidates[c.sheet[s as usize] as usize].push(Candidate { weight, s, t, quad });
        }
    }
    let mut out = Vec::new();
    for (sheet, (members, candidates)) in members.iter().zip(candidates).enumerate() {
        monitor.check()?;
        pair_sheet(c, sheet as u32, members, candidates, &mut out);
    }
    Ok(out)
}

struct Candidate {
    weight: i32,
    s: u32,
    t: u32,
    quad: [u32; 4],
}

/// The quad of two triangles over their edge `ab`; `None` when it would use a vertex twice.
fn united(s: [u32; 3], t: [u32; 3], a: u32, b: u32) -> Option<[u32; 4]> {
    let k = (0..3).find(|&k| s[k] != a && s[k] != b)?;
    let far = t.into_iter().find(|&w| w != a && w != b)?;
    (far != s[k]).then_some([s[k], s[(k + 1) % 3], far, s[(k + 2) % 3]])
}

fn pair_sheet(
    c: &Complex,
    sheet: u32,
    members: &[u32],
    mut candidates: Vec<Candidate>,
    out: &mut Vec<Option<Polygon>>,
) {
    let mut used = vec![false; members.len()];
    let local = |t: u32| members.partition_point(|&m| m < t);
    let mut take = |used: &mut Vec<bool>, x: &Candidate| {
        used[local(x.s)] = true;
        used[local(x.t)] = true;
        out.push(Some(Polygon::quad(x.quad, sheet)));
    };
    if members.len() <= EXACT_LIMIT {
        let edges = candidates
            .iter()
            .map(|x| (local(x.s), local(x.t), x.weight))
            .collect();
        let mate = mwmatching::Matching::new(edges).max_cardinality().solve();
        for x in &candidates {
            let (s, t) = (local(x.s), local(x.t));
            // Two triangles may share two edges: the first candidate takes the pair.
            if !used[s] && !used[t] && mate.get(s) == Some(&t) && mate.get(t) == Some(&s) {
                take(&mut used, x);
            }
        }
    } else {
        candidates.sort_by(|x, y| y.weight.cmp(&x.weight).then((x.s, x.t).cmp(&(y.s, y.t))));
        for x in &candidates {
            if !used[local(x.s)] && !used[local(x.t)] {
                take(&mut used, x);
            }
        }
    }
    for (i, &t) in members.iter().enumerate() {
        if !used[i] {
            out.push(Some(Polygon::triangle(c.tri(t), sheet)));
        }
    }
}

/// Gives a leftover triangle with a rim edge a new rim vertex, which makes it a quad without a walk. Where a sheet has an
/// odd number of leftovers without a rim, one rim triangle is kept to pair with. Returns how many were settled.
pub(crate) fn split_rims(
    polygons: &mut [Option<Polygon>],
    points: &mut Vec<Vec3>,
    radii: &mut Vec<f64>,
    reference: &Reference,
) -> usize {
    let table = edge_table(polygons);
    let rim_edge = |p: &Polygon| {
        let v = p.corners();
        (0..3).find(|&k| table.at(v[k], v[(k + 1) % 3]).len() == 1)
    };
    let sheets = polygons
        .iter()
        .flatten()
        .map(|p| p.sheet + 1)
        .max()
        .unwrap_or(0) as usize;
    let mut inner = vec![0usize; sheets];
    for p in polygons
        .iter()
        .flatten()
        .filter(|p| p.is_triangle() && rim_edge(p).is_none())
    {
        inner[p.sheet as usize] += 1;
    }
    let mut settled = 0;
    for slot in polygons.iter_mut() {
        let Some(p) = *slot else { continue };
        if !p.is_triangle() {
            continue;
        }
        let Some(k) = rim_edge(&p) else { continue };
        let held = &mut inner[p.sheet as usize];
        if *held % 2 == 1 {
            *held += 1;
            continue;
        }
        let v = p.corners();
        let (a, b, apex) = (v[k], v[(k + 1) % 3], v[(k + 2) % 3]);
        let ends = [points[a as usize], points[b as usize]];
        let middle = (ends[0] + ends[1]) / 2.0;
        let radius = (radii[a as usize] + radii[b as usize]) / 2.0;
        let (x, r) = reference
            .on_arc(&middle, Class::Rim, &ends)
            .unwrap_or((middle, radius));
        let far = (points[a as usize] - points[b as usize]).norm();
        let m = points.len() as u32;
        // The nearest fine rim may be another one: then the straight middle serves better.
        let near = (x - middle).norm() < 0.5 * far;
        points.push(if near { x } else { middle });
        radii.push(if near { r } else { radius });
        *slot = Some(Polygon::quad([a, m, b, apex], p.sheet));
        settled += 1;
    }
    settled
}

/// Splits every face at its middle, triangles into three quads and quads into four, and every beam in two:
/// all quads and conforming whatever came in. The last resort.
pub(crate) fn split_all(
    polygons: &[Option<Polygon>],
    beams: &[[u32; 2]],
    points: &mut Vec<Vec3>,
    radii: &mut Vec<f64>,
) -> (Vec<Option<Polygon>>, Vec<[u32; 2]>) {
    let table = edge_table(polygons);
    let base = points.len() as u32;
    let mut add = |corners: &[u32]| {
        let n = corners.len() as f64;
        let x = corners.iter().map(|&v| points[v as usize]).sum::<Vec3>() / n;
        let r = corners.iter().map(|&v| radii[v as usize]).sum::<f64>() / n;
        points.push(x);
        radii.push(r);
        points.len() as u32 - 1
    };
    for e in &table.edges {
        add(e);
    }
    let middle = |a: u32, b: u32| base + table.edges.partition_point(|e| *e < edge(a, b)) as u32;
    let mut out = Vec::new();
    for p in polygons.iter().flatten() {
        let (v, n) = (p.corners(), p.corners().len());
        let centre = add(v);
        for k in 0..n {
            let quad = [
                v[k],
                middle(v[k], v[(k + 1) % n]),
                centre,
                middle(v[(k + n - 1) % n], v[k]),
            ];
            out.push(Some(Polygon::quad(quad, p.sheet)));
        }
    }
    let mut halves = Vec::with_capacity(2 * beams.len());
    for b in beams {
        let m = add(b);
        halves.extend([[b[0], m], [m, b[1]]]);
    }
    (out, halves)
}
