//! Moves some control points so that the limit surface follows another surface again.

use faer::Mat;
use faer::Side;
use faer::prelude::Solve;

use super::catmull_clark::limit_operator;
use super::stencils::Stencils;
use super::{ControlMesh, SplineError};
use crate::Vec3;
use crate::mesh::{Bvh, TriMesh};

/// Splits that give the samples: 16 a quad and more.
const LEVELS: u32 = 2;
const ROUNDS: usize = 5;
/// Weight of moves along the surface against the distance to it.
const TANGENTIAL: f64 = 0.02;
/// Weight of the distance of a control point to the middle of its neighbours.
const EVENNESS: f64 = 0.02;

/// A surface to follow.
pub(super) struct Target {
    pub(super) mesh: TriMesh,
    pub(super) tree: Bvh,
}

/// Least squares, point to plane: the samples of the limit surface that the `free` control points weigh in go to the nearest
/// point of the target, and the free points stay spread over the surface.
///
/// Returns the largest distance of those samples to the target after the last round, mm.
pub(super) fn refit(
    mesh: &mut ControlMesh,
    free: &[u32],
    target: &Target,
) -> Result<f64, SplineError> {
    let (operator, _) = limit_operator(mesh.points.len(), &mesh.quads, LEVELS)?;
    let mut number = vec![u32::MAX; mesh.points.len()];
    for (k, v) in free.iter().enumerate() {
        number[*v as usize] = k as u32;
    }
    let rows: Vec<usize> = (0..operator.rows())
        .filter(|&r| touches(&operator, r, &number))
        .collect();
    let even = evenness(mesh, free);
    for _ in 0..ROUNDS {
        let mut system = System::new(free.len());
        for &r in &rows {
            let x = operator.apply_row(r, &mesh.points);
            let Some(nearest) = target.tree.nearest(&x, f64::INFINITY) else {
                continue;
            };
            let [a, b, c] = target.mesh.corners(nearest.triangle as usize);
            let Some(normal) = (b - a).cross(&(c - a)).try_normalize(f64::MIN_POSITIVE) else {
                continue;
            };
            let off = normal.dot(&(nearest.point - x));
            system.add(operator.row(r), &number, Some((normal, off)), TANGENTIAL);
        }
        for r in 0..even.rows() {
            let off = even.apply_row(r, &mesh.points);
            system.add_vector(even.row(r), &number, -off, EVENNESS);
        }
        let Some(moves) = system.solve() else {
            return Ok(f64::INFINITY);
        };
        for (v, by) in free.iter().zip(moves) {
            mesh.points[*v as usize] += by;
        }
    }
    let distance = |&r: &usize| {
        let x = operator.apply_row(r, &mesh.points);
        target
            .tree
            .nearest(&x, f64::INFINITY)
            .map_or(f64::INFINITY, |nearest| nearest.distance)
    };
    Ok(rows.iter().map(distance).fold(0.0, f64::max))
}

fn touches(operator: &Stencils, r: usize, number: &[u32]) -> bool {
    let (points, _) = operator.row(r);
    points.iter().any(|v| number[*v as usize] != u32::MAX)
}

/// For each free point the mean of its neighbours in its quads, less itself.
fn evenness(mesh: &ControlMesh, free: &[u32]) -> Stencils {
    let mut around: Vec<Vec<(u32, f64)>> = vec![Vec::new(); mesh.points.len()];
    for quad in &mesh.quads {
        for k in 0..4 {
            around[quad[k] as usize].push((quad[(k + 1) % 4], 1.0));
        }
    }
    let mut out = Stencils::new(mesh.points.len());
    for v in free {
        let mut entries = std::mem::take(&mut around[*v as usize]);
        let n = entries.len() as f64;
        entries.iter_mut().for_each(|entry| entry.1 /= n);
        entries.push((*v, -1.0));
        out.push(&mut entries);
    }
    out
}

/// Normal equations of the moves of the free points.
struct System {
    matrix: Mat<f64>,
    right: Mat<f64>,
}

impl System {
    fn new(points: usize) -> Self {
        let mut matrix = Mat::zeros(3 * points, 3 * points);
        for k in 0..3 * points {
            matrix[(k, k)] = 1e-9;
        }
        Self {
            matrix,
            right: Mat::zeros(3 * points, 1),
        }
    }

    /// Wants the weighted sum of the moves to be `off` along a normal, and small otherwise with the weight `rest`.
    fn add(
        &mut self,
        (points, weights): (&[u32], &[f64]),
        number: &[u32],
        along: Option<(Vec3, f64)>,
        rest: f64,
    ) {
        let (normal, off) = along.unwrap_or((Vec3::zeros(), 0.0));
        let block = normal * normal.transpose() + nalgebra::Matrix3::identity() * rest;
        let known = points.iter().zip(weights);
        let known: Vec<(usize, f64)> = known
            .filter(|(v, _)| number[**v as usize] != u32::MAX)
            .map(|(v, w)| (3 * number[*v as usize] as usize, *w))
            .collect();
        for (i, a) in &known {
            for d in 0..3 {
                self.right[(i + d, 0)] += a * off * normal[d];
            }
            for (j, b) in known.iter().filter(|(j, _)| j <= i) {
                for (d, e) in (0..3).flat_map(|d| (0..3).map(move |e| (d, e))) {
                    self.matrix[(i + d, j + e)] += a * b * block[(d, e)];
                }
            }
        }
    }

    /// Wants the weighted sum of the moves to be `off`.
    fn add_vector(&mut self, row: (&[u32], &[f64]), number: &[u32], off: Vec3, weight: f64) {
        self.add(row, number, None, weight);
        for (v, w) in row.0.iter().zip(row.1) {
            let k = number[*v as usize];
            if k != u32::MAX {
                for d in 0..3 {
                    self.right[(3 * k as usize + d, 0)] += weight * w * off[d];
                }
            }
        }
    }

    fn solve(&self) -> Option<Vec<Vec3>> {
        let factor = self.matrix.llt(Side::Lower).ok()?;
        let x = factor.solve(&self.right);
        let at = |k: usize| Vec3::from_fn(|d, _| x[(3 * k + d, 0)]);
        let moves: Vec<Vec3> = (0..x.nrows() / 3).map(at).collect();
        let finite = moves.iter().all(|m| m.iter().all(|x| x.is_finite()));
        finite.then_some(moves)
    }
}
