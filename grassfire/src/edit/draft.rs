//! A skeleton while a list of edits is replayed, and what its solid needs to follow.

use super::envelope::{Ball, Hull};
use super::list::Edited;
use crate::Vec3;
use crate::skeleton::{Skeleton, UnionFind};

/// A skeleton after edits: what of the proposal's material still lies where its quads and beams are, and what does not.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct EditedSkeleton {
    /// The skeleton with all edits.
    pub skeleton: Skeleton,
    /// What each edit did.
    pub done: Vec<Edited>,
    /// Points that belong to non-design bodies: no edit touches them.
    pub(super) kept: Vec<bool>,
    /// The radii that the proposal has at the points, mm.
    pub(super) base: Vec<f64>,
    /// Quads and beams where the proposal has no material of theirs: they were moved or made.
    pub(super) fresh_quads: Vec<bool>,
    /// The same for beams.
    pub(super) fresh_beams: Vec<bool>,
    /// The material of the proposal that is taken away.
    pub(super) gone: Vec<Hull>,
    /// Material that no quad or beam stands for.
    pub(super) filling: Vec<Hull>,
}

impl EditedSkeleton {
    /// A skeleton before all edits; `kept` has one flag a point.
    pub(super) fn new(skeleton: &Skeleton, kept: &[bool]) -> Self {
        Self {
            skeleton: skeleton.clone(),
            done: Vec::new(),
            kept: kept.to_vec(),
            base: skeleton.radii.clone(),
            fresh_quads: vec![false; skeleton.quads.len()],
            fresh_beams: vec![false; skeleton.beams.len()],
            gone: Vec::new(),
            filling: Vec::new(),
        }
    }

    /// Balls of quads and beams with the radii `radii`, those of `fresh` ones or of the others.
    pub(super) fn hulls(&self, fresh: bool, radii: &[f64]) -> Vec<Hull> {
        let quads = self.skeleton.quads.iter().zip(&self.fresh_quads);
        let beams = self.skeleton.beams.iter().zip(&self.fresh_beams);
        let quads = quads.filter(|q| *q.1 == fresh).map(|q| &q.0[..]);
        let beams = beams.filter(|b| *b.1 == fresh).map(|b| &b.0[..]);
        let cells = quads.chain(beams);
        cells.flat_map(|cell| self.halves(cell, radii)).collect()
    }

    /// A quad as two triangles, a beam as a triangle without area.
    fn halves(&self, cell: &[u32], radii: &[f64]) -> Vec<Hull> {
        let ball = |k: usize| Ball {
            centre: self.skeleton.points[cell[k] as usize],
            radius: radii[cell[k] as usize],
        };
        match cell.len() {
            2 => vec![[ball(0), ball(1), ball(1)]],
            _ => vec![[ball(0), ball(1), ball(2)], [ball(0), ball(2), ball(3)]],
        }
    }

    /// Takes the material of all quads and beams with a point in `points` away, where it is the proposal's: they will move.
    pub(super) fn touch(&mut self, points: &[bool]) {
        let touched = |cell: &[u32]| cell.iter().any(|&v| points[v as usize]);
        let quads = self.skeleton.quads.iter().map(|q| touched(q)).collect();
        let beams = self.skeleton.beams.iter().map(|b| touched(b)).collect();
        self.take_away(quads, beams);
    }

    fn take_away(&mut self, quads: Vec<bool>, beams: Vec<bool>) {
        for q in (0..quads.len()).filter(|&q| quads[q]) {
            if !std::mem::replace(&mut self.fresh_quads[q], true) {
                let halves = self.halves(&self.skeleton.quads[q], &self.base);
                self.gone.extend(halves);
            }
        }
        for b in (0..beams.len()).filter(|&b| beams[b]) {
            if !std::mem::replace(&mut self.fresh_beams[b], true) {
                let halves = self.halves(&self.skeleton.beams[b], &self.base);
                self.gone.extend(halves);
            }
        }
    }

    /// Removes quads and beams with their material, and points that nothing uses then.
    pub(super) fn remove(&mut self, quads: &[bool], beams: &[bool]) {
        self.take_away(quads.to_vec(), beams.to_vec());
        self.drop_cells(quads, beams);
    }

    /// Removes quads and beams, not their material, and points that nothing uses then.
    fn drop_cells(&mut self, quads: &[bool], beams: &[bool]) {
        keep_unless(&mut self.skeleton.quads, quads);
        keep_unless(&mut self.fresh_quads, quads);
        keep_unless(&mut self.skeleton.beams, beams);
        keep_unless(&mut self.fresh_beams, beams);
        let mut unused = vec![true; self.skeleton.points.len()];
        let Skeleton { quads, beams, .. } = &self.skeleton;
        for &v in quads.iter().flatten().chain(beams.iter().flatten()) {
            unused[v as usize] = false;
        }
        let mut number = vec![u32::MAX; unused.len()];
        let left = (0..unused.len()).filter(|&v| !unused[v]);
        left.enumerate().for_each(|(n, v)| number[v] = n as u32);
        keep_unless(&mut self.skeleton.points, &unused);
        keep_unless(&mut self.skeleton.radii, &unused);
        keep_unless(&mut self.kept, &unused);
        keep_unless(&mut self.base, &unused);
        let Skeleton { quads, beams, .. } = &mut self.skeleton;
        let corners = quads.iter_mut().flatten().chain(beams.iter_mut().flatten());
        corners.for_each(|v| *v = number[*v as usize]);
    }

    /// A new point with a radius; gives its number.
    pub(super) fn add_point(&mut self, place: Vec3, radius: f64) -> u32 {
        self.skeleton.points.push(place);
        self.skeleton.radii.push(radius);
        self.base.push(radius);
        self.kept.push(false);
        self.skeleton.points.len() as u32 - 1
    }

    /// Means over some points: place, radius, and radius in the proposal.
    pub(super) fn mean(&self, of: &[u32]) -> (Vec3, f64, f64) {
        let count = of.len() as f64;
        let sum = |values: &[f64]| of.iter().map(|&v| values[v as usize]).sum::<f64>();
        let places = of.iter().map(|&v| self.skeleton.points[v as usize]);
        let place = places.sum::<Vec3>() / count;
        (
            place,
            sum(&self.skeleton.radii) / count,
            sum(&self.base) / count,
        )
    }

    /// A new point in the middle of some; gives its number.
    pub(super) fn add_mean(&mut self, of: &[u32]) -> u32 {
        let (place, radius, base) = self.mean(of);
        let kept = of.iter().all(|&v| self.kept[v as usize]);
        let number = self.add_point(place, radius);
        self.base[number as usize] = base;
        self.kept[number as usize] = kept;
        number
    }

    /// A new quad.
    pub(super) fn add_quad(&mut self, quad: [u32; 4], fresh: bool) {
        self.skeleton.quads.push(quad);
        self.fresh_quads.push(fresh);
    }

    /// A new beam edge.
    pub(super) fn add_beam(&mut self, beam: [u32; 2], fresh: bool) {
        self.skeleton.beams.push(beam);
        self.fresh_beams.push(fresh);
    }

    /// The pieces that hang together: number of points and first point of each, the largest first.
    pub(super) fn pieces(&self) -> Vec<(usize, usize)> {
        let n = self.skeleton.points.len();
        let mut sets = UnionFind::new(n);
        for q in &self.skeleton.quads {
            q.iter().for_each(|&v| sets.join(q[0], v));
        }
        self.skeleton
            .beams
            .iter()
            .for_each(|b| sets.join(b[0], b[1]));
        let mut size = vec![0_usize; n];
        (0..n as u32).for_each(|v| size[sets.find(v) as usize] += 1);
        let roots = (0..n).filter(|&v| size[v] > 0);
        let mut pieces: Vec<(usize, usize)> = roots.map(|v| (size[v], v)).collect();
        pieces.sort_by_key(|&(size, first)| (std::cmp::Reverse(size), first));
        pieces
    }
}

fn keep_unless<T>(list: &mut Vec<T>, out: &[bool]) {
    let mut flags = out.iter();
    list.retain(|_| !flags.next().copied().unwrap_or(false));
}
