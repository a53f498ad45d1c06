//! The best draw direction.

use std::cmp::Ordering;

use rayon::prelude::*;
use serde::Serialize;

use super::apart::apart;
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
    /// Separate undercuts, without those below [`SLACK`] of the part's volume.
    pub undercuts: usize,
    /// How far the parting line leaves a plane, mm.
    pub flatness: f64,
    /// Share of the surface with too little draft.
    pub low_draft: f64,
}

impl Direction {
    /// Less undercut first, then fewer, then a flatter parting line, then more draft. Undercuts up to `allowed` mm3 count as equal.
    pub fn compare(&self, other: &Self, allowed: f64) -> Ordering {
        let over = |d: &Self| (d.undercut - allowed).max(0.0);
        over(self)
            .total_cmp(&over(other))
            .then(self.undercuts.cmp(&other.undercuts))
            .then(self.flatness.total_cmp(&other.flatness))
            .then(self.low_draft.total_cmp(&other.low_draft))
    }
}

/// Lines along the longer side in the first round.
const COARSE: usize = 96;
/// This many of the best are looked at closely.
const KEPT: usize = 48;
/// This many of those are turned: the best, and each that lies more than [`APART`] from better ones.
const FOLLOWED: usize = 8;
/// Cosine of 10 degrees.
const APART: f64 = 0.985;
/// This many of the best are judged at last on [`FINER`] times as many lines.
const LAST: usize = 12;
/// Lines know an undercut the better the more they are: see [`allowed`].
pub const FINER: usize = 4;
/// Turns tried around the best, degrees.
const TURNS: [f64; 4] = [4.0, 2.0, 1.0, 0.5];
/// Those of [`TURNS`] that are tried again on the finest lattice.
const LAST_TURNS: usize = 2;
/// Undercuts below this share of the part's volume are the lattice's.
pub const SLACK: f64 = 2e-4;

/// The direction along which a two-part mould opens best.
///
/// 1. `count` directions spread evenly over a half-space (a Fibonacci spiral), the axes and the normals that much area
///    shares, on a coarse lattice.
/// 2. The best of these on `lines` lines; the best few that lie apart are turned by smaller and smaller angles as long as that helps.
/// 3. What these gave and the best as they were on [`FINER`] times as many lines; the best is turned a little there.
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
    let search = Search {
        mesh,
        draft,
        monitor,
    };
    let mut marked = vec![Vec3::x(), Vec3::y(), Vec3::z()];
    marked.extend(shared_normals(mesh));
    let spread = search.look(&spiral(count), lines.min(COARSE))?;
    let mut kept = marked.clone();
    kept.extend(best_of(&spread, 0.0, KEPT).iter().map(|d| d.draw));
    let seen = search.look(&kept, lines)?;
    let equal = allowed(&seen, mesh, lines);
    let seen = best_of(&seen, equal, seen.len());
    let mut last = marked;
    last.extend(seen.iter().take(LAST).map(|d| d.draw));
    let near = |a: &Direction, b: &Direction| a.draw.dot(&b.draw).abs() > APART;
    for start in apart(seen, FOLLOWED, near) {
        last.push(search.turned(start, &TURNS, lines, equal)?.draw);
    }
    let lines = FINER * lines;
    let seen = search.look(&last, lines)?;
    let equal = allowed(&seen, mesh, lines);
    let best = best_of(&seen, equal, 1)[0];
    search.turned(best, &TURNS[TURNS.len() - LAST_TURNS..], lines, equal)
}

/// Undercuts up to this, mm3, are as good as the least of all when seen with so many lines.
///
/// The error of a lattice falls with the power 3/2 of its lines: 128 know the bores of simjeb_576 to 3 %, more than lies between directions
/// 20 degrees apart, 512 to half a per cent.
pub fn allowed(seen: &[Direction], mesh: &TriMesh, lines: usize) -> f64 {
    let least = seen
        .iter()
        .map(|d| d.undercut)
        .fold(f64::INFINITY, f64::min);
    let error = 0.04 * (128.0 / lines as f64).powf(1.5);
    least * (1.0 + error) + SLACK * mesh.volume().abs()
}

/// The best of a list, best first, when undercuts up to `equal` mm3 count as equal.
pub fn best_of(list: &[Direction], equal: f64, most: usize) -> Vec<Direction> {
    let mut out = list.to_vec();
    out.sort_by(|a, b| a.compare(b, equal));
    out.truncate(most);
    out
}

/// What directions are judged by.
struct Search<'a> {
    mesh: &'a TriMesh,
    /// Degrees.
    draft: f64,
    monitor: &'a Monitor,
}

impl Search<'_> {
    /// All of them, in their order.
    fn look(&self, draws: &[Vec3], lines: usize) -> Result<Vec<Direction>, Cancelled> {
        let seen = draws.par_iter().map(|draw| {
            self.monitor.check()?;
            Ok(judge(self.mesh, draw, lines, self.draft))
        });
        seen.collect()
    }

    /// The direction turned by each of `turns` (degrees) as long as that helps, when undercuts up to `equal` mm3 count as equal.
    fn turned(
        &self,
        start: Direction,
        turns: &[f64],
        lines: usize,
        equal: f64,
    ) -> Result<Direction, Cancelled> {
        let mut best = start;
        for turn in turns {
            loop {
                let [u, v, _] = super::dexels::axes(&best.draw);
                let tilt = turn.to_radians().tan();
                let around: Vec<Vec3> = [u, -u, v, -v, u + v, u - v, v - u, -u - v]
                    .iter()
                    .map(|t| (best.draw + tilt * t).normalize())
                    .collect();
                let next = best_of(&self.look(&around, lines)?, equal, 1)[0];
                if next.compare(&best, equal) != Ordering::Less {
                    break;
                }
                best = next;
            }
        }
        Ok(best)
    }
}

/// What speaks against one direction.
pub fn judge(mesh: &TriMesh, draw: &Vec3, lines: usize, draft: f64) -> Direction {
    let lattice = dexels(mesh, draw, lines);
    let found = undercuts(&lattice);
    let least = SLACK * mesh.volume().abs();
    Direction {
        draw: *draw,
        undercut: found.iter().map(|u| u.volume).sum(),
        undercuts: found.iter().filter(|u| u.volume >= least).count(),
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
