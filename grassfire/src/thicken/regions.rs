//! Offsets of sheets: the region rule, and the ring and polyhedron rules at nodes.

use std::collections::BTreeMap;

use super::complex::{Complex, Edge, Fan, coherent_signs, root};
use super::node::{self, Item, Ring};
use super::{RuleCounts, ThickenOptions, unit};
use crate::Vec3;

/// Not there.
pub(super) const NONE: u32 = u32::MAX;

/// How the beams of a vertex get their first section.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Foot {
    /// No beams here.
    None,
    /// Two beams and no quads: the section belongs to the chain.
    Chain,
    /// One beam and no quads.
    Tip,
    /// The sections are in [`Draft::sections`].
    Ready,
    /// On a quad of the body.
    Plug,
}

/// The body under construction. All quads run counter-clockwise seen from outside.
#[derive(Debug, Clone, Default)]
pub(super) struct Draft {
    pub points: Vec<Vec3>,
    /// Vertex of the complex behind each point.
    pub vertex: Vec<u32>,
    /// Quads; `None` once a beam took the place.
    pub quads: Vec<Option<[u32; 4]>>,
    /// Quads at each point, including removed ones.
    pub point_quads: Vec<Vec<u32>>,
    /// Points of each vertex of the complex.
    pub vertex_points: Vec<Vec<u32>>,
    /// Section at a vertex for the beam to another one, in the order of the quad it replaces.
    pub sections: BTreeMap<(u32, u32), [u32; 4]>,
    /// One a vertex of the complex.
    pub feet: Vec<Foot>,
}

impl Draft {
    /// Adds a point that belongs to vertex `v`.
    pub fn point(&mut self, at: Vec3, v: u32) -> u32 {
        let id = self.points.len() as u32;
        self.points.push(at);
        self.vertex.push(v);
        self.point_quads.push(Vec::new());
        self.vertex_points[v as usize].push(id);
        id
    }

    /// Adds a quad.
    pub fn quad(&mut self, quad: [u32; 4]) {
        let id = self.quads.len() as u32;
        for v in quad {
            self.point_quads[v as usize].push(id);
        }
        self.quads.push(Some(quad));
    }
}

/// Offset points of corners and rims.
struct Offsets {
    /// Union-find over `(4 quad + corner) * 2 + (side is -1)`.
    class: Vec<usize>,
    /// Offset point of every such corner side.
    side: Vec<u32>,
    /// Rim point at either end of every edge, `NONE` without one.
    rim: Vec<[u32; 2]>,
}

#[inline]
fn slot((q, k): (u32, u8), side: f64) -> usize {
    (4 * q as usize + k as usize) * 2 + usize::from(side < 0.0)
}

/// Steps 2 to 4 of [`super::thicken`].
pub(super) fn offset_sheets(
    complex: &Complex,
    options: &ThickenOptions,
    rules: &mut RuleCounts,
) -> Draft {
    let n = complex.points.len();
    let mut draft = Draft {
        vertex_points: vec![Vec::new(); n],
        feet: vec![Foot::None; n],
        ..Draft::default()
    };
    let mut offsets = Offsets {
        class: (0..8 * complex.quads.len()).collect(),
        side: vec![NONE; 8 * complex.quads.len()],
        rim: vec![[NONE; 2]; complex.edges.len()],
    };
    unite_sides(complex, &mut offsets.class);
    for v in 0..n as u32 {
        let fans = complex.fans(v);
        let beams = complex.beam_neighbours[v as usize].len();
        if fans.is_empty() && beams < 3 {
            draft.feet[v as usize] = [Foot::None, Foot::Tip, Foot::Chain][beams];
        } else if let Some(ring) = node::ring(complex, v, &fans, options) {
            draft.feet[v as usize] = Foot::Ready;
            build_ring(complex, v, &fans, &ring, options, &mut offsets, &mut draft);
            *(if fans.is_empty() {
                &mut rules.ring_nodes
            } else {
                &mut rules.ring_feet
            }) += 1;
        } else if fans.is_empty() {
            draft.feet[v as usize] = Foot::Ready;
            build_polyhedron(complex, v, &mut draft);
            rules.polyhedron_nodes += 1;
        } else {
            draft.feet[v as usize] = if beams > 0 { Foot::Plug } else { Foot::None };
            build_regions(complex, v, options, &mut offsets, &mut draft);
        }
    }
    emit_sheets(complex, &offsets, &mut draft, rules);
    draft
}

/// Unites the facing sides of consecutive quads around every edge.
pub(super) fn unite_sides(complex: &Complex, class: &mut [usize]) {
    for edge in &complex.edges {
        for (from, to) in facing_slots(complex, edge) {
            for (a, b) in from.into_iter().zip(to) {
                let (a, b) = (root(class, a), root(class, b));
                class[a.max(b)] = a.min(b);
            }
        }
    }
}

/// Corner sides, at the two ends of an edge, on either side of each of its sectors; a rim has none.
pub(super) fn facing_slots<'a>(
    complex: &'a Complex,
    edge: &'a Edge,
) -> impl Iterator<Item = ([usize; 2], [usize; 2])> + 'a {
    let count = if edge.uses.len() > 1 {
        edge.uses.len()
    } else {
        0
    };
    (0..count).map(move |j| {
        let (quad, next) = (edge.uses[j], edge.uses[(j + 1) % count]);
        (
            sides_at(complex, edge.ends, quad, 1.0),
            sides_at(complex, edge.ends, next, -1.0),
        )
    })
}

/// Corner sides of a quad at the two ends of an edge: the counter-clockwise ones about the edge
/// (`turn` 1) or the clockwise ones (-1).
fn sides_at(complex: &Complex, ends: [u32; 2], (q, k): (u32, u8), turn: f64) -> [usize; 2] {
    // Counter-clockwise about the edge lies the positive side of a quad whose cycle runs along it.
    let along = complex.quads[q as usize][k as usize] == ends[0];
    let side = if along { turn } else { -turn };
    let (first, second) = (slot((q, k), side), slot((q, (k + 1) % 4), side));
    if along {
        [first, second]
    } else {
        [second, first]
    }
}

fn build_ring(
    complex: &Complex,
    v: u32,
    fans: &[Fan],
    ring: &Ring,
    options: &ThickenOptions,
    offsets: &mut Offsets,
    draft: &mut Draft,
) {
    let (at, radius) = (complex.at(v), complex.radii[v as usize]);
    let top = draft.point(at + radius * ring.axis, v);
    let bottom = draft.point(at - radius * ring.axis, v);
    let gaps: Vec<u32> = ring
        .gaps
        .iter()
        .map(|(d, half)| {
            let mitre =
                (1.0 / half.min(std::f64::consts::FRAC_PI_2).sin()).min(options.mitre_limit);
            draft.point(at + radius * mitre * d, v)
        })
        .collect();
    for (k, item) in ring.items.iter().enumerate() {
        let (before, after) = (gaps[(k + gaps.len() - 1) % gaps.len()], gaps[k]);
        match *item {
            Item::Beam(w) => {
                draft.sections.insert((v, w), [top, before, bottom, after]);
            }
            Item::Fan(i) => {
                let fan = &fans[i];
                let mut signs = coherent_signs(complex, fan);
                let corners = || fan.corners.iter().zip(&signs);
                let up: f64 = corners()
                    .map(|(c, s)| s * complex.normals[c.0 as usize].dot(&ring.axis))
                    .sum();
                if up < 0.0 {
                    signs.iter_mut().for_each(|s| *s = -*s);
                }
                for (&corner, &sign) in fan.corners.iter().zip(&signs) {
                    offsets.side[slot(corner, sign)] = top;
                    offsets.side[slot(corner, -sign)] = bottom;
                    let [leaving, arriving] = complex.corner_edges(corner);
                    // The cycle of a quad whose positive side is up runs counter-clockwise, so the
                    // edge that leaves v is its clockwise end; never told from angles, fans may fold.
                    for (e, leaves) in [(leaving, true), (arriving, false)] {
                        if complex.edges[e as usize].uses.len() == 1 {
                            let end = usize::from(complex.edges[e as usize].ends[1] == v);
                            offsets.rim[e as usize][end] = if leaves == (sign > 0.0) {
                                before
                            } else {
                                after
                            };
                        }
                    }
                }
            }
        }
    }
}

fn build_polyhedron(complex: &Complex, v: u32, draft: &mut Draft) {
    let (at, radius) = (complex.at(v), complex.radii[v as usize]);
    let beams = &complex.beam_neighbours[v as usize];
    let directions: Vec<Vec3> = beams.iter().map(|&w| unit(complex.at(w) - at)).collect();
    let shape = node::polyhedron(&directions);
    let ids: Vec<u32> = shape
        .corners
        .iter()
        .map(|c| draft.point(at + radius * c, v))
        .collect();
    let mut open = vec![false; shape.quads.len()];
    for (&w, &q) in beams.iter().zip(&shape.quad_of_beam) {
        draft
            .sections
            .insert((v, w), shape.quads[q as usize].map(|c| ids[c as usize]));
        open[q as usize] = true;
    }
    for (quad, _) in shape.quads.iter().zip(&open).filter(|(_, open)| !**open) {
        draft.quad(quad.map(|c| ids[c as usize]));
    }
}

/// One offset point a class of corner sides, one rim point a group of classes joined by rims.
fn build_regions(
    complex: &Complex,
    v: u32,
    options: &ThickenOptions,
    offsets: &mut Offsets,
    draft: &mut Draft,
) {
    let (at, radius) = (complex.at(v), complex.radii[v as usize]);
    let corners = &complex.corners[v as usize];
    let mut sides: Vec<(usize, (u32, u8), f64)> = Vec::with_capacity(2 * corners.len());
    for &corner in corners {
        for side in [1.0, -1.0] {
            sides.push((root(&mut offsets.class, slot(corner, side)), corner, side));
        }
    }
    sides.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.cmp(&b.1)));
    for class in sides.chunk_by(|a, b| a.0 == b.0) {
        let normals = || {
            class
                .iter()
                .map(|&(_, (q, _), side)| side * complex.normals[q as usize])
        };
        let normal = unit(normals().sum());
        let cosine = normals().map(|n| n.dot(&normal)).sum::<f64>() / class.len() as f64;
        let mitre = (1.0 / cosine.max(1e-9)).clamp(1.0, options.mitre_limit);
        let id = draft.point(at + radius * mitre * normal, v);
        for &(_, corner, side) in class {
            offsets.side[slot(corner, side)] = id;
        }
    }
    build_rims(complex, v, offsets, draft);
}

fn build_rims(complex: &Complex, v: u32, offsets: &mut Offsets, draft: &mut Draft) {
    // Rims with the same class on both sides end inside a sheet: no rim point.
    let mut rims: Vec<(u32, (u32, u8), [usize; 2])> = Vec::new();
    for &corner in &complex.corners[v as usize] {
        for e in complex.corner_edges(corner) {
            if complex.edges[e as usize].uses.len() == 1 {
                let classes = [1.0, -1.0].map(|side| root(&mut offsets.class, slot(corner, side)));
                if classes[0] != classes[1] {
                    rims.push((e, corner, classes));
                }
            }
        }
    }
    let mut names: Vec<usize> = rims.iter().flat_map(|r| r.2).collect();
    names.sort_unstable();
    names.dedup();
    let local = |class: usize| names.binary_search(&class).unwrap_or(0);
    let mut group: Vec<usize> = (0..names.len()).collect();
    for (_, _, classes) in &rims {
        let (a, b) = (
            root(&mut group, local(classes[0])),
            root(&mut group, local(classes[1])),
        );
        group[a.max(b)] = a.min(b);
    }
    let mut keyed: Vec<(usize, u32, u32)> = rims
        .iter()
        .map(|&(e, (q, _), classes)| (root(&mut group, local(classes[0])), e, q))
        .collect();
    keyed.sort_unstable();
    let at = complex.at(v);
    for members in keyed.chunk_by(|a, b| a.0 == b.0) {
        let mut outward = Vec3::zeros();
        for &(_, e, q) in members {
            let [a, b] = complex.edges[e as usize].ends.map(|w| complex.at(w));
            let axis = unit(b - a);
            let d = (a + b) / 2.0 - complex.centres[q as usize];
            outward += unit(d - axis * d.dot(&axis));
        }
        if outward.norm() < 0.3 {
            let quads = complex.corners[v as usize].iter();
            outward = quads.map(|&(q, _)| at - complex.centres[q as usize]).sum();
        }
        let id = draft.point(at + complex.radii[v as usize] * unit(outward), v);
        for &(_, e, _) in members {
            let end = usize::from(complex.edges[e as usize].ends[1] == v);
            offsets.rim[e as usize][end] = id;
        }
    }
}

fn emit_sheets(complex: &Complex, offsets: &Offsets, draft: &mut Draft, rules: &mut RuleCounts) {
    for q in 0..complex.quads.len() as u32 {
        let side = |side: f64| [0, 1, 2, 3].map(|k| offsets.side[slot((q, k), side)]);
        let [a, b, c, d] = side(-1.0);
        draft.quad(side(1.0));
        draft.quad([d, c, b, a]);
    }
    for (edge, rim) in complex
        .edges
        .iter()
        .zip(&offsets.rim)
        .filter(|(e, _)| e.uses.len() == 1)
    {
        let (q, k) = edge.uses[0];
        let next = (k + 1) % 4;
        let side = |k: u8, side: f64| offsets.side[slot((q, k), side)];
        let (tp, tq, bp, bq) = (
            side(k, 1.0),
            side(next, 1.0),
            side(k, -1.0),
            side(next, -1.0),
        );
        let along = complex.quads[q as usize][k as usize] == edge.ends[0];
        let (rp, rq) = if along {
            (rim[0], rim[1])
        } else {
            (rim[1], rim[0])
        };
        rules.seam_ends += u32::from(rp == NONE) + u32::from(rq == NONE);
        match (rp, rq) {
            (NONE, NONE) => {}
            (NONE, rq) => draft.quad([tq, tp, bq, rq]),
            (rp, NONE) => draft.quad([tq, tp, rp, bp]),
            (rp, rq) => {
                draft.quad([tq, tp, rp, rq]);
                draft.quad([rq, rp, bp, bq]);
            }
        }
    }
}
