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
/// Cosine of 5 degrees: starts of descents lie farther apart.
const APART: f64 = 0.996;
/// Descents from directions of the first round.
const FOLLOWED: usize = 24;
/// Descents on the finest lattice.
const LAST: usize = 8;
/// Descents there by undercut alone.
const LEAST: usize = 4;
/// No descent on the finest lattice starts where this share of the part's volume more is undercut than at the best: a degree does not
/// bring so much.
const HOPELESS: f64 = 0.01;
/// Lines know an undercut the better the more they are: see [`allowed`].
pub const FINER: usize = 4;
/// Steps of a descent, degrees.
const TURNS: [f64; 4] = [4.0, 2.0, 1.0, 0.5];
/// The same on the finest lattice.
const LAST_TURNS: [f64; 3] = [1.0, 0.5, 0.25];
/// Undercuts below this share of the part's volume are the lattice's.
pub const SLACK: f64 = 2e-4;

/// The direction along which a two-part mould opens best.
///
/// 1. `count` directions spread evenly over a half-space (a Fibonacci spiral), the axes and the normals that much area
///    shares, on a coarse lattice.
/// 2. Descents on `lines` lines from the best of these that lie apart: a direction is turned by smaller and smaller angles as long as
///    that helps.
/// 3. Descents on [`FINER`] times as many lines from the best ends of these that lie apart: some by undercut alone, because the least
///    undercut decides what counts as equal, then some by all. The best that was seen there is taken.
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
    let search = |lines| Search {
        mesh,
        draft,
        monitor,
        lines,
        seen: Vec::new(),
    };
    let draws = |list: &[Direction]| list.iter().map(|d| d.draw).collect::<Vec<_>>();
    let mut marked = vec![Vec3::x(), Vec3::y(), Vec3::z()];
    marked.extend(shared_normals(mesh));
    let mut coarse = search(lines.min(COARSE));
    coarse.look(&spiral(count))?;
    let mut usual = search(lines);
    usual.look(&marked)?;
    usual.look(&draws(&coarse.best_apart(FOLLOWED, Goal::All)))?;
    for start in usual.best_apart(FOLLOWED, Goal::All) {
        usual.descend(start, &TURNS, Goal::All)?;
    }
    let mut fine = search(FINER * lines);
    // Most are in more than one of the lists, and lines are dear here.
    let mut starts = marked;
    for goal in [Goal::Undercut, Goal::All] {
        for draw in draws(&usual.best_apart(2 * LAST, goal)) {
            if !starts.contains(&draw) {
                starts.push(draw);
            }
        }
    }
    fine.look(&starts)?;
    for (goal, most) in [(Goal::Undercut, LEAST), (Goal::All, LAST)] {
        let hopeless = fine.equal(Goal::All) + HOPELESS * mesh.volume().abs();
        for start in fine.best_apart(most, goal) {
            if start.undercut <= hopeless {
                fine.descend(start, &LAST_TURNS, goal)?;
            }
        }
    }
    Ok(fine.best_apart(1, Goal::All)[0])
}

/// What a descent is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Goal {
    /// The least undercut, whatever else.
    Undercut,
    /// All that counts, in its order.
    All,
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

/// Directions judged on one lattice.
struct Search<'a> {
    mesh: &'a TriMesh,
    /// Degrees.
    draft: f64,
    monitor: &'a Monitor,
    lines: usize,
    /// All that were judged.
    seen: Vec<Direction>,
}

impl Search<'_> {
    /// Judges these.
    fn look(&mut self, draws: &[Vec3]) -> Result<&[Direction], Cancelled> {
        let looked = draws.par_iter().map(|draw| {
            self.monitor.check()?;
            Ok(judge(self.mesh, draw, self.lines, self.draft))
        });
        let looked = looked.collect::<Result<Vec<_>, _>>()?;
        let first = self.seen.len();
        self.seen.extend(looked);
        Ok(&self.seen[first..])
    }

    /// Undercuts that count as equal so far, mm3.
    fn equal(&self, goal: Goal) -> f64 {
        match goal {
            Goal::Undercut => 0.0,
            Goal::All => allowed(&self.seen, self.mesh, self.lines),
        }
    }

    /// The best so far, of which each lies apart from better ones; best first.
    fn best_apart(&self, most: usize, goal: Goal) -> Vec<Direction> {
        let all = best_of(&self.seen, self.equal(goal), self.seen.len());
        let near = |a: &Direction, b: &Direction| a.draw.dot(&b.draw).abs() > APART;
        apart(all, most, near)
    }

    /// Turns a direction by each of `turns` (degrees) as long as that helps.
    fn descend(&mut self, start: Direction, turns: &[f64], goal: Goal) -> Result<(), Cancelled> {
        let mut best = start;
        for turn in turns {
            loop {
                let [u, v, _] = super::dexels::axes(&best.draw);
                let tilt = turn.to_radians().tan();
                let around: Vec<Vec3> = [u, -u, v, -v, u + v, u - v, v - u, -u - v]
                    .iter()
                    .map(|t| (best.draw + tilt * t).normalize())
                    .collect();
                let looked = self.look(&around)?.to_vec();
                let equal = self.equal(goal);
                let next = best_of(&looked, equal, 1)[0];
                if next.compare(&best, equal) != Ordering::Less {
                    break;
                }
                best = next;
            }
        }
        Ok(())
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
