//! The best draw direction.

use std::cmp::Ordering;

use rayon::prelude::*;
use serde::Serialize;

use super::dexels::dexels;
use super::draft::low_draft;
use super::undercuts::{parting, undercuts};
use crate::Vec3;
use crate::mesh::TriMesh;
use crate::monitor::{Cancelled, Monitor};

/// A draw direction and what speaks against it.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Direction {
    /// Unit vector.
    pub draw: Vec3,
    /// Undercut, mm3.
    pub undercut: f64,
    /// Separate undercuts.
    pub undercuts: usize,
    /// How far the parting line leaves a plane, mm.
    pub flatness: f64,
    /// Share of the surface with too little draft.
    pub low_draft: f64,
}

impl Direction {
    /// Less undercut first (volumes within `slack` mm3 count as equal), then fewer, then a flatter parting line, then more
    /// draft.
    pub fn compare(&self, other: &Self, slack: f64) -> Ordering {
        let step = |d: &Self| (d.undercut / slack).round();
        let few = |d: &Self| if step(d) == 0.0 { 0 } else { d.undercuts };
        step(self)
            .total_cmp(&step(other))
            .then(few(self).cmp(&few(other)))
            .then(self.flatness.total_cmp(&other.flatness))
            .then(self.low_draft.total_cmp(&other.low_draft))
    }
}

/// Lines along the longer side in the first round.
const COARSE: usize = 48;
/// This many of the best are looked at closely.
const KEPT: usize = 12;
/// Turns tried around the best, degrees.
const TURNS: [f64; 4] = [4.0, 2.0, 1.0, 0.5];
/// Undercuts below this share of the part's volume are the lattice's.
pub const SLACK: f64 = 2e-4;

/// The direction along which a two-part mould opens best.
///
/// 1. `count` directions spread evenly over a half-space (a Fibonacci spiral), the axes and the normals that much area
///    shares, on a coarse lattice.
/// 2. The best of these on `lines` lines; then the best is turned by smaller and smaller angles as long as that helps.
///
/// O(directions * triangles); the result does not depend on the number of threads.
///
/// # Errors
/// Cancelled.
pub fn best_direction(
    mesh: &TriMesh,
    count: usize,
    lines: usize,
    draft: f64,
    monitor: &Monitor,
) -> Result<Direction, Cancelled> {
    let slack = SLACK * mesh.volume().abs();
    let look = |draws: &[Vec3], lines: usize| -> Result<Vec<Direction>, Cancelled> {
        let seen = draws.par_iter().map(|draw| {
            monitor.check()?;
            Ok(judge(mesh, draw, lines, draft))
        });
        let mut seen: Vec<Direction> = seen.collect::<Result<_, Cancelled>>()?;
        seen.sort_by(|a, b| a.compare(b, slack));
        Ok(seen)
    };
    let mut draws = spiral(count);
    draws.extend([Vec3::x(), Vec3::y(), Vec3::z()]);
    draws.extend(shared_normals(mesh));
    let coarse = look(&draws, lines.min(COARSE))?;
    let kept: Vec<Vec3> = coarse.iter().take(KEPT).map(|d| d.draw).collect();
    let mut best = look(&kept, lines)?[0];
    for turn in TURNS {
        loop {
            let [u, v, _] = super::dexels::axes(&best.draw);
            let tilt = turn.to_radians().tan();
            let around: Vec<Vec3> = [u, -u, v, -v, u + v, u - v, v - u, -u - v]
                .iter()
                .map(|t| (best.draw + tilt * t).normalize())
                .collect();
            let next = look(&around, lines)?[0];
            if next.compare(&best, slack) != Ordering::Less {
                break;
            }
            best = next;
        }
    }
    Ok(best)
}

/// What speaks against one direction.
pub fn judge(mesh: &TriMesh, draw: &Vec3, lines: usize, draft: f64) -> Direction {
    let lattice = dexels(mesh, draw, lines);
    let found = undercuts(&lattice);
    Direction {
        draw: *draw,
        undercut: found.iter().map(|u| u.volume).sum(),
        undercuts: found.len(),
        flatness: parting(&lattice).0,
        low_draft: low_draft(mesh, draw, draft),
    }
}

/// Evenly spread unit vectors with z > 0 (a Fibonacci spiral).
pub fn spiral(count: usize) -> Vec<Vec3> {
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    (0..count)
        .map(|i| {
            let z = (i as f64 + 0.5) / count as f64;
            let (sin, cos) = (golden * i as f64).sin_cos();
            let r = (1.0 - z * z).sqrt();
            Vec3::new(r * cos, r * sin, z)
        })
        .collect()
}

/// Normals that at least a fiftieth of the surface shares within 2 degrees.
fn shared_normals(mesh: &TriMesh) -> Vec<Vec3> {
    const WITHIN: f64 = 0.999_39;
    let mut groups: Vec<(Vec3, f64)> = Vec::new();
    let mut whole = 0.0;
    for t in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(t);
        let normal = (b - a).cross(&(c - a)) / 2.0;
        let area = normal.norm();
        whole += area;
        let Some(unit) = normal.try_normalize(1e-12) else {
            continue;
        };
        match groups.iter().position(|g| g.0.dot(&unit).abs() > WITHIN) {
            Some(group) => groups[group].1 += area,
            None if groups.len() < 400 => groups.push((unit, area)),
            None => {}
        }
    }
    let large = groups.into_iter().filter(|g| g.1 >= whole / 50.0);
    large.map(|g| g.0).collect()
}
