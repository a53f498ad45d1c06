//! One degree 5 patch per quad, exactly tangent-continuous.

use std::sync::LazyLock;

use nalgebra::{Matrix4, SMatrix};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::corner::{CornerData, corner_data, edge_cosine};
use super::half_edges::{QuadTopology, connect, next, previous};
use super::quality::jacobians;
use super::{ControlMesh, Patch, STAGE, SplineError};
use crate::Vec3;
use crate::monitor::Monitor;

/// Shape of the patches.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PatchOptions {
    /// Weight of edge curvature against twist where 3, 5 or more quads meet; 0 keeps the bicubic twist.
    pub curvature_weight: f64,
    /// Patches whose smallest normalised Jacobian is below this are reported as folded or nearly so.
    pub fold_limit: f64,
}

impl Default for PatchOptions {
    fn default() -> Self {
        Self {
            curvature_weight: 0.3,
            fold_limit: 0.05,
        }
    }
}

/// Turns every quad of a closed control mesh into one polynomial patch of degree 5 x 5; neighbours share their boundary
/// curve bit for bit and their tangent planes exactly.
///
/// 1. Bicubic approximation of the Catmull-Clark limit surface at every point (Loop and Schaefer 2008,
///    doi:10.1145/1330511.1330519): position, edge and face points. At regular points (four quads) tangents and twists
///    follow and patches without extraordinary corner are the uniform bicubic B-spline, degree-raised.
/// 2. At extraordinary points the tangents are those of the Catmull-Clark limit surface, scaled; they form an affine
///    regular n-gon.
/// 3. Along an edge from a to b the two transversal derivatives p and q must satisfy `p + q = alpha b'`, with alpha
///    linear between two extraordinary points and quadratic, with a double zero at the regular end, otherwise.
/// 4. The derivative of that condition at an extraordinary point binds twists and edge curvatures. They are the
///    pull-back of one quadratic form, fitted to the bicubic data, which satisfies it for every valence and every
///    neighbourhood.
/// 5. Edge curves interpolate this data (degree 3, 4 or 5); the difference p - q is the cubic Hermite interpolant.
/// 6. The inner 2 x 2 control points minimise the fourth differences along rows and columns, which reproduces bicubics.
///
/// Edges between regular points are C1, all others exactly G1. The patches are computed in parallel; the result does
/// not depend on the number of threads.
///
/// # Errors
/// The mesh must be closed, oriented and manifold with at least three quads around every point.
///
/// # Limits
/// Folds of the control mesh stay folds: they are reported as a warning.
pub fn patches(
    mesh: &ControlMesh,
    options: &PatchOptions,
    monitor: &Monitor,
) -> Result<Vec<Patch>, SplineError> {
    let half_edges = connect(mesh)?;
    monitor.step(STAGE, "corners", 0.0)?;
    let weight = if options.curvature_weight.is_finite() {
        options.curvature_weight.max(0.0)
    } else {
        0.3
    };
    let corners = corner_data(mesh, &half_edges, weight);
    monitor.step(STAGE, "patches", 0.3)?;
    let strips = strips(&half_edges, &corners);
    let patches: Vec<Patch> = (0..mesh.quads.len() as u32)
        .into_par_iter()
        .map(|q| patch(&half_edges, &corners, &strips, q))
        .collect();
    monitor.step(STAGE, "folds", 0.8)?;
    warn_of_folds(&patches, options.fold_limit, monitor);
    monitor.step(STAGE, "patches", 1.0)?;
    Ok(patches)
}

fn warn_of_folds(patches: &[Patch], limit: f64, monitor: &Monitor) {
    let all = jacobians(patches);
    let worst = all
        .iter()
        .enumerate()
        .min_by(|a, b| a.1.value.total_cmp(&b.1.value));
    let Some((quad, worst)) = worst.filter(|(_, worst)| worst.value < limit) else {
        return;
    };
    let count = all.iter().filter(|jacobian| jacobian.value < limit).count();
    let (place, value) = (<[f64; 3]>::from(worst.place), worst.value);
    monitor.warn(
        STAGE,
        format!(
            "{count} of {} patches fold or nearly fold, because the control mesh does; worst: quad {quad} at {place:.2?} \
             with normalised Jacobian {value:.3} (limit {limit})",
            patches.len()
        ),
    );
}

/// Inner control points (2 and 3) of the boundary row and of the second row along a half-edge.
#[derive(Clone, Copy, Default)]
struct Strip {
    boundary: [Vec3; 2],
    second: [Vec3; 2],
}

fn strips(half_edges: &QuadTopology, corners: &CornerData) -> Vec<Strip> {
    let pairs: Vec<Option<[Strip; 2]>> = (0..half_edges.len())
        .into_par_iter()
        .map(|h| (h < half_edges.twin[h as usize]).then(|| edge_strips(half_edges, corners, h)))
        .collect();
    let mut strips = vec![Strip::default(); pairs.len()];
    for (h, pair) in pairs.iter().enumerate() {
        if let Some([left, right]) = pair {
            strips[h] = *left;
            strips[half_edges.twin[h] as usize] = *right;
        }
    }
    strips
}

/// Strips of the quads left and right of half-edge `h`, each in the sense of its own half-edge.
fn edge_strips(half_edges: &QuadTopology, corners: &CornerData, h: u32) -> [Strip; 2] {
    let g = half_edges.twin[h as usize];
    let tangent = |h: u32| corners.tangent[h as usize];
    let twist = |h: u32| corners.twist[h as usize];
    let (boundary, shear) = boundary(half_edges, corners, h);
    let start = tangent(half_edges.rotate(h)) - tangent(next(g));
    let end = tangent(next(h)) - tangent(half_edges.rotate(g));
    let start_slope = twist(h) - twist(next(g));
    let end_slope = twist(g) - twist(next(h));
    let difference = raise_cubic([start, start + start_slope / 3.0, end - end_slope / 3.0, end]);
    let left = [0, 1].map(|i| boundary[i] + (shear[i] + difference[i]) / 10.0);
    let right = [1, 0].map(|i| boundary[i] + (shear[i] - difference[i]) / 10.0);
    [
        Strip {
            boundary,
            second: left,
        },
        Strip {
            boundary: [boundary[1], boundary[0]],
            second: right,
        },
    ]
}

/// Control points 2 and 3 of the edge curve b of `h` and of `alpha b'`, both of degree 5.
fn boundary(half_edges: &QuadTopology, corners: &CornerData, h: u32) -> ([Vec3; 2], [Vec3; 2]) {
    let g = half_edges.twin[h as usize];
    let [a, b] = [h, g].map(|h| half_edges.origin(h));
    let [p, q] = [a, b].map(|v| corners.position[v as usize]);
    let [s, t] = [h, g].map(|h| corners.tangent[h as usize]);
    let [bend_a, bend_b] = [h, g].map(|h| corners.bend[h as usize]);
    let [cos_a, cos_b] = [a, b].map(|v| edge_cosine(half_edges.valence[v as usize]));
    match (half_edges.is_regular(a), half_edges.is_regular(b)) {
        (true, true) => (
            raise_cubic([p, p + s / 3.0, q + t / 3.0, q]),
            [Vec3::zeros(); 2],
        ),
        (false, true) => {
            let (first, third) = (p + s / 4.0, q + t / 4.0);
            let second = first * 2.0 - p + bend_a / 12.0;
            // alpha = 2 cos_a (1 - u)^2
            let shear = [
                (third - second) * (2.4 * cos_a),
                (q - third) * (0.8 * cos_a),
            ];
            (raise_quartic([first, second, third]), shear)
        }
        (true, false) => {
            let (first, third) = (p + s / 4.0, q + t / 4.0);
            let second = third * 2.0 - q + bend_b / 12.0;
            // alpha = -2 cos_b u^2
            let shear = [
                (first - p) * (-0.8 * cos_b),
                (second - first) * (-2.4 * cos_b),
            ];
            (raise_quartic([first, second, third]), shear)
        }
        (false, false) => {
            let (first, fourth) = (p + s / 5.0, q + t / 5.0);
            let second = first * 2.0 - p + bend_a / 20.0;
            let third = fourth * 2.0 - q + bend_b / 20.0;
            // alpha = 2 cos_a (1 - u) - 2 cos_b u; b' has Bezier points 5 (b_i+1 - b_i)
            let slope = [second - first, third - second, fourth - third].map(|d| d * 5.0);
            let product = |low: Vec3, high: Vec3, k: f64| {
                high * (2.0 * cos_a * (5.0 - k) / 5.0) - low * (2.0 * cos_b * k / 5.0)
            };
            (
                [second, third],
                [
                    product(slope[0], slope[1], 2.0),
                    product(slope[1], slope[2], 3.0),
                ],
            )
        }
    }
}

/// Points 2 and 3 of a cubic raised to degree 5.
fn raise_cubic([a, b, c, d]: [Vec3; 4]) -> [Vec3; 2] {
    [
        (a + b * 6.0 + c * 3.0) / 10.0,
        (b * 3.0 + c * 6.0 + d) / 10.0,
    ]
}

/// Points 2 and 3 of a quartic, given by its inner points, raised to degree 5.
fn raise_quartic([b, c, d]: [Vec3; 3]) -> [Vec3; 2] {
    [(b * 2.0 + c * 3.0) / 5.0, (c * 3.0 + d * 2.0) / 5.0]
}

fn patch(half_edges: &QuadTopology, corners: &CornerData, strips: &[Strip], quad: u32) -> Patch {
    let mut control = [[Vec3::zeros(); 6]; 6];
    for k in 0..4 {
        let h = 4 * quad + k;
        // (along, inward) from corner k, turned to the axes of the patch
        let place = |along: usize, inward: usize| match k {
            0 => [along, inward],
            1 => [5 - inward, along],
            2 => [5 - along, 5 - inward],
            _ => [inward, 5 - along],
        };
        let mut set = |along: usize, inward: usize, value: Vec3| {
            let [i, j] = place(along, inward);
            control[i][j] = value;
        };
        let position = corners.position[half_edges.origin(h) as usize];
        let along = corners.tangent[h as usize];
        let inward = corners.tangent[half_edges.twin[previous(h) as usize] as usize];
        let strip = &strips[h as usize];
        set(0, 0, position);
        set(1, 0, position + along / 5.0);
        set(0, 1, position + inward / 5.0);
        set(
            1,
            1,
            position + (along + inward) / 5.0 + corners.twist[h as usize] / 25.0,
        );
        set(2, 0, strip.boundary[0]);
        set(3, 0, strip.boundary[1]);
        set(2, 1, strip.second[0]);
        set(3, 1, strip.second[1]);
    }
    fill_inner(&mut control);
    Patch { control }
}

const INNER: [[usize; 2]; 4] = [[2, 2], [2, 3], [3, 2], [3, 3]];

/// Weights of the 36 control points in each inner one; inner points themselves weigh nothing.
static INNER_WEIGHTS: LazyLock<[[f64; 36]; 4]> = LazyLock::new(|| {
    // All fourth differences along rows and columns, as far as they touch inner points, should vanish.
    const DIFFERENCE: [f64; 5] = [1.0, -4.0, 6.0, -4.0, 1.0];
    let mut normal = Matrix4::<f64>::zeros();
    let mut right = SMatrix::<f64, 4, 36>::zeros();
    for line in 0..6 {
        for shift in 0..2 {
            for transposed in [false, true] {
                let mut row = [0.0; 36];
                for (m, x) in DIFFERENCE.iter().enumerate() {
                    let at = shift + m;
                    row[if transposed {
                        6 * at + line
                    } else {
                        6 * line + at
                    }] = *x;
                }
                let inner = INNER.map(|[i, j]| std::mem::take(&mut row[6 * i + j]));
                for a in 0..4 {
                    for b in 0..4 {
                        normal[(a, b)] += inner[a] * inner[b];
                    }
                    for (c, x) in row.iter().enumerate() {
                        right[(a, c)] -= inner[a] * x;
                    }
                }
            }
        }
    }
    let solved = normal.try_inverse().expect("a constant regular matrix") * right;
    std::array::from_fn(|a| std::array::from_fn(|c| solved[(a, c)]))
});

fn fill_inner(control: &mut [[Vec3; 6]; 6]) {
    // Weights sum to one: taken about a corner the sum keeps its precision far from the origin.
    let base = control[0][0];
    let inner: [Vec3; 4] = std::array::from_fn(|a| {
        let mut sum = base;
        for (c, w) in INNER_WEIGHTS[a].iter().enumerate() {
            if *w != 0.0 {
                sum += (control[c / 6][c % 6] - base) * *w;
            }
        }
        sum
    });
    for (a, [i, j]) in INNER.iter().enumerate() {
        control[*i][*j] = inner[a];
    }
}
