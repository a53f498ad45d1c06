//! Non-manifold isotropic remeshing to the size of the quads wanted.
//!
//! 1. Split edges longer than 4/3 of their target (not in the first two rounds).
//! 2. Collapse edges shorter than 0.5, later 0.8 of it: link condition, no fold, rims along rims, seams along seams,
//!    beams along beams; corners meet only along a short arc.
//! 3. Flip edges inside sheets toward even valence.
//! 4. Relax; every vertex is put back onto its fine rim, seam, beam or sheet.

use super::complex::{Class, Complex};
use super::reduce::{SpurLimits, prune_spurs};
use super::reference::Reference;
use crate::Vec3;
use crate::monitor::{Cancelled, Monitor};

/// Wanted edge length from the radius, mm.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sizing {
    /// Times the radius.
    pub factor: f64,
    /// Lower bound, mm.
    pub least: f64,
    /// Upper bound, mm.
    pub most: f64,
}

impl Sizing {
    /// The same with lengths `factor` times as long.
    pub fn times(&self, factor: f64) -> Self {
        Self {
            factor: self.factor * factor,
            least: self.least * factor,
            most: self.most * factor,
        }
    }

    /// Wanted length at a sphere of radius `r`.
    pub fn at(&self, r: f64) -> f64 {
        (self.factor * r).clamp(self.least, self.most)
    }

    /// Wanted length of edge `ab`.
    pub fn edge(&self, c: &Complex, a: u32, b: u32) -> f64 {
        (self.at(c.radii[a as usize]) + self.at(c.radii[b as usize])) / 2.0
    }
}

const ROUNDS: usize = 7;

/// Remeshes `c` to `sizing`; `unit` is the lattice length of the fine complex.
pub(crate) fn coarsen(
    c: &mut Complex,
    reference: &Reference,
    sizing: &Sizing,
    unit: f64,
    monitor: &Monitor,
) -> Result<(), Cancelled> {
    for round in 0..ROUNDS {
        monitor.step("skeleton", "coarsening", round as f64 / ROUNDS as f64)?;
        if round > 1 {
            split_long(c, reference, sizing);
        }
        for _ in 0..2 {
            monitor.check()?;
            collapse_short(c, sizing, round, unit);
        }
        c.compact();
        for [a, b] in c.edges() {
            if c.connected(a, b) {
                flip(c, a, b);
            }
        }
        for _ in 0..3 {
            relax(c, reference);
        }
        if round == 4 {
            prune_spurs(
                c,
                &SpurLimits {
                    absolute: 3.0 * unit,
                    relative: 0.8,
                    ..SpurLimits::default()
                },
            );
            c.compact();
        }
    }
    Ok(())
}

fn split_long(c: &mut Complex, reference: &Reference, sizing: &Sizing) {
    let mut edges: Vec<(f64, [u32; 2])> = c
        .edges()
        .into_iter()
        .map(|e| (c.length(e[0], e[1]), e))
        .collect();
    edges.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)));
    for (l, [a, b]) in edges {
        if l > 4.0 / 3.0 * sizing.edge(c, a, b) && c.connected(a, b) {
            let ends = [a, b].map(|v| c.points[v as usize]);
            let m = c.split_middle(a, b);
            reference.project(c, m, &ends);
        }
    }
}

fn collapse_short(c: &mut Complex, sizing: &Sizing, round: usize, unit: f64) {
    let fraction = if round > 1 { 0.8 } else { 0.5 };
    let mut edges: Vec<(f64, [u32; 2])> = c
        .edges()
        .into_iter()
        .map(|e| (c.length(e[0], e[1]), e))
        .filter(|&(l, [a, b])| l <= 2.0 * fraction * sizing.edge(c, a, b))
        .collect();
    edges.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
    for (_, [a, b]) in edges {
        if !c.used(a) || !c.used(b) || !c.connected(a, b) {
            continue;
        }
        let (l, target) = (c.length(a, b), sizing.edge(c, a, b));
        if l > fraction * target {
            continue;
        }
        let (ka, kb) = (c.class(a), c.class(b));
        let tries = if ka <= kb {
            [(a, b, ka, kb), (b, a, kb, ka)]
        } else {
            [(b, a, kb, ka), (a, b, ka, kb)]
        };
        for (p, q, kp, kq) in tries {
            if try_collapse(c, p, q, [kp, kq], l / target, target, round, unit) {
                break;
            }
        }
    }
}

/// Contracts `p` into `q` when the rules allow it. `ratio` is length over target.
#[allow(clippy::too_many_arguments)]
fn try_collapse(
    c: &mut Complex,
    p: u32,
    q: u32,
    [kp, kq]: [Class; 2],
    ratio: f64,
    target: f64,
    round: usize,
    unit: f64,
) -> bool {
    let (faces, beam) = (c.face_count(p, q), c.is_beam(p, q));
    let on_arc = beam || faces != 2;
    let sheets = |v: u32| !c.vertex_triangles[v as usize].is_empty();
    // Never let two sheets touch in a point.
    if beam && sheets(p) && sheets(q) {
        return false;
    }
    let allowed = match kp {
        Class::Interior => true,
        Class::Rim => faces == 1,
        Class::Seam => faces >= 3,
        Class::Beam => beam,
        Class::Corner => {
            kq == Class::Corner
                && (ratio < 0.75 && round > 0 && on_arc || ratio < 0.45 && round > 1)
        }
    };
    if !allowed {
        return false;
    }
    if kp != Class::Corner
        && c.neighbours(p)
            .iter()
            .any(|&w| w != q && c.length(q, w) > 1.5 * target)
    {
        return false;
    }
    let cos_min = if kp == Class::Corner { -0.2 } else { 0.3 };
    if !c.link_condition(p, q)
        || c.would_flip(p, q, &c.points[q as usize], cos_min, 1e-2 * unit * unit)
    {
        return false;
    }
    let (p, q) = (p as usize, q as usize);
    let middle = (
        (c.points[p] + c.points[q]) / 2.0,
        (c.radii[p] + c.radii[q]) / 2.0,
    );
    c.collapse(p as u32, q as u32);
    if kp == Class::Corner {
        (c.points[q], c.radii[q]) = middle;
    }
    true
}

/// Neighbours of `v` inside sheet `sheet`.
fn sheet_valence(c: &Complex, v: u32, sheet: u32) -> i64 {
    let mut around: Vec<u32> = Vec::with_capacity(12);
    for &t in &c.vertex_triangles[v as usize] {
        if c.sheet[t as usize] == sheet {
            around.extend(c.tri(t).into_iter().filter(|&w| w != v));
        }
    }
    around.sort_unstable();
    around.dedup();
    around.len() as i64
}

fn ideal_valence(c: &Complex, v: u32) -> i64 {
    if c.class(v) == Class::Interior { 6 } else { 4 }
}

fn flip(c: &mut Complex, a: u32, b: u32) {
    let on = c.on_edge(a, b);
    let [t0, t1] = on[..] else { return };
    let apex = |t: u32| c.tri(t).into_iter().find(|&w| w != a && w != b);
    let (Some(x), Some(y)) = (apex(t0), apex(t1)) else {
        return;
    };
    if x == y || c.is_beam(a, b) || c.connected(x, y) {
        return;
    }
    let sheet = c.sheet[t0 as usize];
    let cost =
        |v: u32, change: i64| (sheet_valence(c, v, sheet) + change - ideal_valence(c, v)).pow(2);
    let before = cost(a, 0) + cost(b, 0) + cost(x, 0) + cost(y, 0);
    let after = cost(a, -1) + cost(b, -1) + cost(x, 1) + cost(y, 1);
    let shorter = c.length(x, y).powi(2) < 0.8 * c.length(a, b).powi(2);
    if after > before || after == before && !shorter {
        return;
    }
    let at = |v: u32| c.points[v as usize];
    let normal = |p: u32, q: u32, r: u32| (at(q) - at(p)).cross(&(at(r) - at(p)));
    let (n1, n2) = (normal(a, y, x), normal(y, b, x));
    let (l1, l2) = (n1.norm(), n2.norm());
    if n1.dot(&n2) < 0.6 * l1 * l2 || l1.min(l2) < 0.12 * c.length(x, y).powi(2) {
        return;
    }
    c.remove_triangle(t0);
    c.remove_triangle(t1);
    c.add_triangle([a, y, x], sheet);
    c.add_triangle([y, b, x], sheet);
}

fn relax(c: &mut Complex, reference: &Reference) {
    let mut moved: Vec<(u32, Vec3, Vec3)> = Vec::new();
    for v in c.vertices() {
        let around: Vec<u32> = match c.class(v) {
            Class::Corner => continue,
            Class::Interior | Class::Beam => c.neighbours(v),
            Class::Rim => c
                .neighbours(v)
                .into_iter()
                .filter(|&w| c.face_count(v, w) == 1)
                .collect(),
            Class::Seam => c
                .neighbours(v)
                .into_iter()
                .filter(|&w| c.face_count(v, w) >= 3)
                .collect(),
        };
        let mean =
            around.iter().map(|&w| c.points[w as usize]).sum::<Vec3>() / around.len().max(1) as f64;
        let from = c.points[v as usize];
        moved.push((v, from, from * 0.4 + mean * 0.6));
    }
    for &(v, _, x) in &moved {
        c.points[v as usize] = x;
    }
    for &(v, from, _) in &moved {
        reference.project(c, v, &[from]);
    }
}
