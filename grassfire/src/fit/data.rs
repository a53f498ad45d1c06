//! The data terms of one round: samples of the limit surface and of the iso-surface pull point to plane.

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::round::{Schedule, Solver};
use super::targets::{PointGrid, flow_to_surface};
use crate::Vec3;

/// Samples whose normal and that of the proposal have at least this cosine pull.
const AGREE: f64 = 0.2;
/// The same for samples of the iso-surface.
const AGREE_ISO: f64 = 0.1;
/// Sunk samples count from this depth on, voxels.
const SUNK_DEPTH: f64 = 0.4;
/// Their weight against that of samples that agree: there are few, on the narrow floor of a slit.
const SUNK_PULL: f64 = 2.0;
/// Samples farther from the proposal than this are far, voxels.
const FAR: f64 = 1.0;
/// Control points with at least these weights in a sample are around it.
const AROUND_SUNK: f64 = 0.05;
const AROUND_FAR: f64 = 0.02;

/// What the samples around a control point show.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Nearby {
    /// One lies inside the proposal, in a slit of the body that is deeper than the proposal's: it looks across.
    pub sunk: bool,
    /// One is far from the proposal.
    pub far: bool,
}

/// Samples of the limit surface: places, outward normals and areas, in voxels.
#[derive(Clone, Copy)]
pub(super) struct Samples<'a> {
    pub at: &'a [Vec3],
    pub normals: &'a [Vec3],
    pub areas: &'a [f64],
}

/// What each sample adds to the normal equations.
struct Pulls {
    blocks: Vec<Matrix3<f64>>,
    pulls: Vec<Vec3>,
}

impl Pulls {
    fn pull(&mut self, j: usize, weight: f64, normal: &Vec3, place: &Vec3) {
        let across = weight * normal * normal.transpose();
        self.blocks[j] += across;
        self.pulls[j] += across * place;
    }
}

impl Solver<'_> {
    /// Point-to-plane rows both ways and tangential damping; returns the area-weighted distance sum.
    pub(super) fn add_data(&mut self, samples: Samples, schedule: &Schedule) -> f64 {
        let count = samples.at.len();
        self.nearby.fill(Nearby::default());
        let mut data = Pulls {
            blocks: vec![Matrix3::zeros(); count],
            pulls: vec![Vec3::zeros(); count],
        };
        let sum = self.pull_to_iso(&mut data, samples, schedule);
        self.pull_from_iso(&mut data, samples, schedule);
        for j in 0..count {
            let (points, weights) = self.surface.samples.row(j);
            self.equations
                .add(points, weights, &data.blocks[j], &data.pulls[j]);
        }
        sum
    }

    /// Samples of the limit surface pull to where the field takes them.
    ///
    /// Those that do not agree with the proposal's normal mostly flow to the wrong wall, and do not pull; but those inside
    /// the proposal, between walls of the body that nearly touch, have no other data, and pull outwards.
    fn pull_to_iso(&mut self, data: &mut Pulls, samples: Samples, schedule: &Schedule) -> f64 {
        let Samples { at, normals, areas } = samples;
        let flowed: Vec<(Vec3, Vec3)> = at
            .par_iter()
            .with_min_len(512)
            .map(|p| flow_to_surface(self.field, p, 6))
            .collect();
        let mut sum = 0.0;
        for (j, (place, outward)) in flowed.iter().enumerate() {
            let d = (place - at[j]).norm();
            sum += areas[j] * d;
            let weight = areas[j] * (schedule.cap / d.max(1e-9)).min(1.0);
            let cosine = outward.dot(&normals[j]);
            let inside = (place - at[j]).dot(outward) > 0.0;
            if cosine >= AGREE {
                let weight = self.trust[j] * weight * cosine.min(1.0);
                data.pull(j, weight, outward, place);
            } else if schedule.sunk && inside && d > SUNK_DEPTH {
                data.pull(j, SUNK_PULL * weight, outward, place);
                self.mark(j, AROUND_SUNK, |nearby| nearby.sunk = true);
            }
            if d > FAR {
                self.mark(j, AROUND_FAR, |nearby| nearby.far = true);
            }
            let damping = schedule.tangential * areas[j];
            data.blocks[j] += damping * Matrix3::identity();
            data.pulls[j] += damping * at[j];
        }
        sum
    }

    /// Samples of the iso-surface pull the nearest sample of the limit surface.
    fn pull_from_iso(&mut self, data: &mut Pulls, samples: Samples, schedule: &Schedule) {
        let Samples { at, normals, areas } = samples;
        let share = areas.iter().sum::<f64>() / self.iso.points.len().max(1) as f64;
        let iso = self.iso;
        let nearest = nearest_samples(at, &iso.points);
        for ((place, outward), found) in iso.points.iter().zip(&iso.normals).zip(&nearest) {
            let Some((j, d)) = *found else { continue };
            let j = j as usize;
            let cosine = outward.dot(&normals[j]);
            if cosine > AGREE_ISO {
                let weight = self.trust[j] * share * cosine * (schedule.cap / d.max(1e-9)).min(1.0);
                data.pull(j, weight, outward, place);
            }
            if (place - at[j]).dot(&normals[j]).abs() > FAR {
                self.mark(j, AROUND_FAR, |nearby| nearby.far = true);
            }
        }
    }

    /// Marks the control points that have at least `least` weight in sample `j`.
    fn mark(&mut self, j: usize, least: f64, set: impl Fn(&mut Nearby)) {
        let (points, weights) = self.surface.samples.row(j);
        for (p, _) in points.iter().zip(weights).filter(|(_, w)| **w > least) {
            set(&mut self.nearby[*p as usize]);
        }
    }
}

/// The sample of the limit surface nearest to each place, and its distance.
pub(super) fn nearest_samples(at: &[Vec3], places: &[Vec3]) -> Vec<Option<(u32, f64)>> {
    let grid = PointGrid::new(at, 1.5);
    let nearest = |p: &Vec3| grid.nearest(at, p);
    places.par_iter().with_min_len(512).map(nearest).collect()
}
