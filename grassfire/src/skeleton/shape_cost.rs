//! What the shape of a quad costs, and the smoothing that goes with it.

use super::coarsen::Sizing;
use super::complex::Class;
use super::quad_mesh::{QuadMesh, Undo};
use super::reference::Reference;
use crate::Vec3;

/// Cost of corners at 45 degrees, against irregular body valences.
const CORNER: f64 = 0.8;
/// Cost of a side e times too long or too short.
const SIZE: f64 = 0.5;
/// Sides longer than this many times the wanted length cost much.
const LONG: f64 = 1.35;
const TOO_LONG: f64 = 20.0;
/// Cost of a corner that is folded over.
const FOLD: f64 = 6.0;

/// Corners off the right angle, folds, and sides off the wanted length.
pub(crate) fn shape_cost(m: &QuadMesh, q: &[u32; 4], sizing: &Sizing) -> f64 {
    let p = q.map(|v| m.points[v as usize]);
    let side: [Vec3; 4] = std::array::from_fn(|k| p[(k + 1) % 4] - p[k]);
    let squared = side.map(|s| s.norm_squared().max(1e-30));
    let normal = (p[2] - p[0]).cross(&(p[3] - p[1]));
    let wanted = sizing.at(q.iter().map(|&v| m.radii[v as usize]).sum::<f64>() / 4.0);
    let mut sum = 0.0;
    for k in 0..4 {
        let before = (k + 3) % 4;
        let dot = -side[k].dot(&side[before]);
        let cos2 = dot * dot / (squared[k] * squared[before]);
        sum += 2.0 * CORNER * cos2;
        // From 60 degrees off the price rises fast; a reflex corner is a fold.
        if cos2 > 0.75 {
            sum += 4.0 * FOLD * (cos2 - 0.75);
        }
        if side[before].cross(&side[k]).dot(&normal) <= 0.0 {
            sum += FOLD;
        }
        let ratio = (squared[k] / (wanted * wanted)).sqrt();
        sum += SIZE * ratio.ln().powi(2);
        if ratio > LONG {
            sum += TOO_LONG * (ratio - LONG).powi(2);
        }
    }
    sum
}

/// Laplace steps of the movable vertices among these, in the planes of their quads; remembered in `undo`.
pub(crate) fn smooth_near(m: &mut QuadMesh, vertices: &[u32], undo: &mut Undo) {
    for round in 0..2 {
        for &v in vertices {
            if m.class[v as usize] != Class::Interior || m.around[v as usize].is_empty() {
                continue;
            }
            let x = m.points[v as usize];
            let ends = m.spoke_ends(v);
            let mean = ends.iter().map(|&w| m.points[w as usize]).sum::<Vec3>() / ends.len() as f64;
            let mut step = mean - x;
            if let Some(n) = plane(m, v) {
                step -= n * n.dot(&step);
            }
            if round == 0 {
                undo.moved.push((v, x));
            }
            m.points[v as usize] = x + step * 0.7;
        }
    }
}

/// Normal of the sheet at `v`; quads have no common orientation, so each turns to the first.
fn plane(m: &QuadMesh, v: u32) -> Option<Vec3> {
    let mut sum = Vec3::zeros();
    for &i in &m.around[v as usize] {
        let p = m.quad(i)?.map(|v| m.points[v as usize]);
        let n = (p[2] - p[0]).cross(&(p[3] - p[1]));
        sum += if sum.dot(&n) < 0.0 { -n } else { n };
    }
    sum.try_normalize(1e-30)
}

/// Laplace on all vertices inside sheets and along smooth rims, put back onto the fine sheets and rims.
pub(crate) fn settle(m: &mut QuadMesh, reference: &Reference, rounds: usize) {
    for _ in 0..rounds {
        for v in 0..m.points.len() as u32 {
            if m.around[v as usize].is_empty() {
                continue;
            }
            let class = m.class[v as usize];
            let ends = match class {
                Class::Interior => m.spoke_ends(v),
                Class::Rim => m.rim_ends(v),
                _ => continue,
            };
            if ends.is_empty() {
                continue;
            }
            let x = m.points[v as usize];
            let mean = ends.iter().map(|&w| m.points[w as usize]).sum::<Vec3>() / ends.len() as f64;
            let target = x * 0.4 + mean * 0.6;
            let found = if class == Class::Interior {
                reference.on_sheet(&target, |_| true)
            } else {
                reference.on_arc(&target, Class::Rim, &[x])
            };
            let reach = ends
                .iter()
                .map(|&w| (m.points[w as usize] - x).norm())
                .fold(f64::INFINITY, f64::min);
            // The nearest fine rim may be another one: then the vertex waits.
            if let Some((y, r)) = found
                && (y - target).norm() <= 0.5 * reach
            {
                m.points[v as usize] = y;
                m.radii[v as usize] = r;
            }
        }
    }
}
