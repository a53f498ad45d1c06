//! How close is close enough.

use super::round::Solver;
use super::{Distances, FitOptions};
use crate::Vec3;

/// Weight of the volume: as much as this share of the volume off counts like a goal missed by its own size.
const VOLUME: f64 = 0.005;

/// Distances aimed at, voxels.
#[derive(Clone, Copy)]
pub(super) struct Goal {
    pub rms: f64,
    p95: f64,
    pub max: f64,
}

/// Distances both ways, voxels, and the volume over that of the proposal.
pub(super) struct Figures {
    both: [Distances; 2],
    volume: f64,
}

impl Figures {
    pub fn of(solver: &Solver, points: &[Vec3], iso_volume: f64) -> Self {
        let both = [solver.body_to_iso(points), solver.iso_to_body(points)];
        let volume = solver.surface.volume(points) / iso_volume;
        Self::new(both, volume, solver.field.spacing)
    }

    /// From the distances in mm.
    pub fn new(both: [Distances; 2], volume: f64, voxel: f64) -> Self {
        let scaled = |d: Distances| Distances {
            rms: d.rms / voxel,
            p95: d.p95 / voxel,
            max: d.max / voxel,
        };
        Self {
            both: both.map(scaled),
            volume,
        }
    }

    /// Root of the mean square distance of both ways, voxels.
    pub fn rms(&self) -> f64 {
        let [a, b] = self.both.map(|d| d.rms);
        ((a * a + b * b) / 2.0).sqrt()
    }

    /// The largest distance of both ways, voxels.
    pub fn farthest(&self) -> f64 {
        let [a, b] = self.both.map(|d| d.max);
        a.max(b)
    }
}

impl Goal {
    pub fn of(options: &FitOptions) -> Self {
        Self {
            rms: options.goal,
            p95: 2.0 * options.goal,
            max: 8.0 * options.goal,
        }
    }

    pub fn met(&self, figures: &Figures) -> bool {
        self.close(figures) && figures.farthest() <= self.max
    }

    /// Met on the whole, if not everywhere.
    pub fn close(&self, figures: &Figures) -> bool {
        let close = |d: &Distances| d.rms <= self.rms && d.p95 <= self.p95;
        figures.both.iter().all(close)
    }

    /// Distance and volume in one number, the lower the better. Single places count by how far they are beyond the goal.
    pub fn error(&self, figures: &Figures) -> f64 {
        let beyond = (figures.farthest() / self.max.max(1e-6) - 1.0).max(0.0);
        figures.rms() / self.rms.max(1e-6) + (figures.volume - 1.0).abs() / VOLUME + beyond
    }
}
