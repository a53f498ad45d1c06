//! Rims, seams and beams as polylines between corners, and their smoothing.

use super::complex::{Class, Complex};
use super::edges::edge;
use crate::Vec3;

/// What a polyline is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ArcKind {
    Rim,
    Seam,
    Beam,
}

/// A maximal chain of edges of one kind; closed when the first vertex equals the last.
#[derive(Debug, Clone)]
pub(crate) struct Arc {
    pub kind: ArcKind,
    pub vertices: Vec<u32>,
}

/// All arcs, and which vertices are corners.
#[derive(Debug, Default)]
pub(crate) struct Arcs {
    pub arcs: Vec<Arc>,
    /// Class of every vertex on an arc; `None` elsewhere.
    pub class: Vec<Option<Class>>,
    /// Neighbours along the arcs.
    pub along: Vec<Vec<u32>>,
}

/// Traces the arcs of `c`.
pub(crate) fn trace(c: &Complex) -> Arcs {
    let table = c.edge_table();
    let mut edges: Vec<([u32; 2], ArcKind)> = Vec::new();
    for (e, f) in table.iter() {
        match f.len() {
            1 => edges.push((e, ArcKind::Rim)),
            2 => {}
            _ => edges.push((e, ArcKind::Seam)),
        }
    }
    edges.extend(c.alive_beams().map(|b| (edge(b[0], b[1]), ArcKind::Beam)));
    edges.sort_unstable_by_key(|e| e.0);

    let n = c.points.len();
    let mut out = Arcs {
        arcs: Vec::new(),
        class: vec![None; n],
        along: vec![Vec::new(); n],
    };
    let mut incident: Vec<Vec<u32>> = vec![Vec::new(); n];
    for (i, (e, _)) in edges.iter().enumerate() {
        for k in 0..2 {
            incident[e[k] as usize].push(i as u32);
            out.along[e[k] as usize].push(e[1 - k]);
        }
    }
    for v in 0..n as u32 {
        if !incident[v as usize].is_empty() {
            out.class[v as usize] = Some(c.class(v));
        }
    }
    let mut starts: Vec<(u32, u32)> = Vec::new();
    let corner = |v: u32| out.class[v as usize] == Some(Class::Corner);
    for v in (0..n as u32).filter(|&v| corner(v)) {
        starts.extend(incident[v as usize].iter().map(|&e| (v, e)));
    }
    // Loops without a corner come last, from their lowest edge.
    starts.extend(edges.iter().enumerate().map(|(i, (e, _))| (e[0], i as u32)));
    let mut done = vec![false; edges.len()];
    let mut arcs = Vec::new();
    for (from, first) in starts {
        if done[first as usize] {
            continue;
        }
        done[first as usize] = true;
        let mut path = vec![from, other(&edges[first as usize].0, from)];
        loop {
            let at = path[path.len() - 1];
            if corner(at) || at == from {
                break;
            }
            let Some(&next) = incident[at as usize].iter().find(|&&e| !done[e as usize]) else {
                break;
            };
            done[next as usize] = true;
            path.push(other(&edges[next as usize].0, at));
        }
        arcs.push(Arc {
            kind: edges[first as usize].1,
            vertices: path,
        });
    }
    out.arcs = arcs;
    out
}

fn other(e: &[u32; 2], v: u32) -> u32 {
    if e[0] == v { e[1] } else { e[0] }
}

/// Smooths in place: Taubin (0.5, -0.52; <https://doi.org/10.1145/218380.218473>) along the arcs, corners half-way to
/// the mean of their arc neighbours, then Laplace steps on the sheets with the arcs fixed. Radii follow lightly.
pub(crate) fn smooth(c: &mut Complex, arcs: &Arcs, arc_rounds: usize, sheet_rounds: usize) {
    let n = c.points.len() as u32;
    let plain: Vec<(u32, u32, u32)> = (0..n)
        .filter(|&v| arcs.class[v as usize].is_some_and(|k| k != Class::Corner))
        .filter_map(|v| match arcs.along[v as usize][..] {
            [a, b] => Some((v, a, b)),
            _ => None,
        })
        .collect();
    let corners: Vec<u32> = (0..n)
        .filter(|&v| arcs.class[v as usize] == Some(Class::Corner))
        .collect();
    smooth_arcs(c, arcs, &plain, &corners, arc_rounds);
    let radii: Vec<f64> = plain
        .iter()
        .map(|&(v, a, b)| {
            0.5 * c.radii[v as usize] + 0.25 * (c.radii[a as usize] + c.radii[b as usize])
        })
        .collect();
    for (&(v, _, _), r) in plain.iter().zip(radii) {
        c.radii[v as usize] = r;
    }
    smooth_sheets(c, arcs, sheet_rounds);
}

fn smooth_arcs(
    c: &mut Complex,
    arcs: &Arcs,
    plain: &[(u32, u32, u32)],
    corners: &[u32],
    rounds: usize,
) {
    let mut moved: Vec<Vec3> = Vec::with_capacity(plain.len());
    for round in 0..rounds {
        // The last two rounds only shrink: Taubin's second step would leave a ripple of one edge length.
        let back = if round + 2 < rounds { -0.52 } else { 0.0 };
        for (step, factor) in [0.5, back].into_iter().enumerate() {
            if factor == 0.0 {
                continue;
            }
            moved.clear();
            moved.extend(plain.iter().map(|&(v, a, b)| {
                let x = c.points[v as usize];
                x + ((c.points[a as usize] + c.points[b as usize]) / 2.0 - x) * factor
            }));
            for (&(v, _, _), x) in plain.iter().zip(&moved) {
                c.points[v as usize] = *x;
            }
            if step == 0 && round % 4 == 0 {
                smooth_corners(c, arcs, corners);
            }
        }
    }
}

fn smooth_corners(c: &mut Complex, arcs: &Arcs, corners: &[u32]) {
    let moved: Vec<Vec3> = corners
        .iter()
        .map(|&v| {
            let around = &arcs.along[v as usize];
            let mean = around.iter().map(|&w| c.points[w as usize]).sum::<Vec3>()
                / around.len().max(1) as f64;
            // A free tip has nothing to balance it: it would only shorten.
            if around.len() < 2 {
                c.points[v as usize]
            } else {
                (c.points[v as usize] + mean) / 2.0
            }
        })
        .collect();
    for (&v, x) in corners.iter().zip(moved) {
        c.points[v as usize] = x;
    }
}

fn smooth_sheets(c: &mut Complex, arcs: &Arcs, rounds: usize) {
    let inner: Vec<(u32, Vec<u32>)> = c
        .vertices()
        .into_iter()
        .filter(|&v| arcs.class[v as usize].is_none())
        .map(|v| (v, c.neighbours(v)))
        .collect();
    for _ in 0..rounds {
        let moved: Vec<(Vec3, f64)> = inner
            .iter()
            .map(|(v, around)| {
                let n = around.len().max(1) as f64;
                let x = around.iter().map(|&w| c.points[w as usize]).sum::<Vec3>() / n;
                let r = around.iter().map(|&w| c.radii[w as usize]).sum::<f64>() / n;
                let (x0, r0) = (c.points[*v as usize], c.radii[*v as usize]);
                (x0 + (x - x0) * 0.6, r0 + (r - r0) * 0.6)
            })
            .collect();
        for ((v, _), (x, r)) in inner.iter().zip(moved) {
            c.points[*v as usize] = x;
            c.radii[*v as usize] = r;
        }
    }
}
