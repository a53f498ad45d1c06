//! Squares up the quads: every quad pulls its corners toward its nearest rectangle, and the vertices stay on the sheet,
//! rim or seam they belong to (shape matching, after Bouaziz et al. 2012, <https://doi.org/10.1111/j.1467-8659.2012.03171.x>).

use super::complex::Class;
use super::polygons::{Polygon, angle, edge_table, quad_quality};
use super::reference::Reference;
use crate::Vec3;

const ROUNDS: usize = 100;
/// A rim or seam that turns by more than this at a vertex has a corner there, which stays, degrees.
const SHARP: f64 = 50.0;

/// Moves the vertices inside sheets, and those of smooth rims and seams along them; beams and corners stay. The state
/// with the best mean quality is kept.
pub(crate) fn square_up(
    points: &mut Vec<Vec3>,
    radii: &mut Vec<f64>,
    polygons: &[Option<Polygon>],
    beams: &[[u32; 2]],
    reference: &Reference,
) {
    let quads: Vec<[u32; 4]> = polygons
        .iter()
        .flatten()
        .filter_map(Polygon::as_quad)
        .collect();
    if quads.is_empty() {
        return;
    }
    let class = classes(points, polygons, beams);
    let reach = shortest_edges(points, &quads);
    let mut best = (quality(points, &quads), points.clone(), radii.clone());
    for _ in 0..ROUNDS {
        let mut sum = vec![(Vec3::zeros(), 0.0); points.len()];
        for q in &quads {
            for (v, x) in q.iter().zip(rectangle(q.map(|v| points[v as usize]))) {
                sum[*v as usize].0 += x;
                sum[*v as usize].1 += 1.0;
            }
        }
        for (v, (x, n)) in sum.into_iter().enumerate() {
            if n == 0.0 {
                continue;
            }
            let x = points[v] * 0.3 + x * (0.7 / n);
            let found = match class[v] {
                Class::Interior => reference.on_sheet(&x, |_| true),
                Class::Rim | Class::Seam => reference.on_arc(&x, class[v], &[points[v]]),
                Class::Beam | Class::Corner => None,
            };
            // The nearest fine rim may be another one: then the vertex waits.
            if let Some((y, r)) = found
                && (y - x).norm() <= 0.5 * reach[v]
            {
                points[v] = y;
                radii[v] = r;
            }
        }
        let now = quality(points, &quads);
        if now > best.0 {
            best = (now, points.clone(), radii.clone());
        }
    }
    (_, *points, *radii) = best;
}

/// Shortest edge at each vertex.
fn shortest_edges(points: &[Vec3], quads: &[[u32; 4]]) -> Vec<f64> {
    let mut out = vec![f64::INFINITY; points.len()];
    for q in quads {
        for k in 0..4 {
            let (a, b) = (q[k] as usize, q[(k + 1) % 4] as usize);
            let l = (points[a] - points[b]).norm();
            out[a] = out[a].min(l);
            out[b] = out[b].min(l);
        }
    }
    out
}

/// Mean quality, with the worst quad counted as much as a tenth of all.
fn quality(points: &[Vec3], quads: &[[u32; 4]]) -> f64 {
    let each = quads.iter().map(|q| quad_quality(points, q));
    let (sum, least) = each.fold((0.0, 1.0f64), |(s, l), q| (s + q, l.min(q)));
    sum / quads.len() as f64 + 0.1 * least
}

/// Corners of the rectangle nearest to a quad: same centre, mean side vectors turned to a right angle.
fn rectangle(p: [Vec3; 4]) -> [Vec3; 4] {
    let centre = (p[0] + p[1] + p[2] + p[3]) / 4.0;
    let (u, v) = (
        (p[1] + p[2] - p[0] - p[3]) / 2.0,
        (p[2] + p[3] - p[0] - p[1]) / 2.0,
    );
    let (lu, lv) = (u.norm(), v.norm());
    if lu < 1e-12 || lv < 1e-12 {
        return p;
    }
    let (Some(e), Some(f)) = (
        (u / lu + v / lv).try_normalize(1e-9),
        (u / lu - v / lv).try_normalize(1e-9),
    ) else {
        return p;
    };
    // Sides drift toward their mean, else slivers would stay slivers.
    let mean = (lu * lv).sqrt();
    let (lu, lv) = (0.75 * lu + 0.25 * mean, 0.75 * lv + 0.25 * mean);
    let half = std::f64::consts::FRAC_1_SQRT_2 / 2.0;
    let (u, v) = ((e + f) * (half * lu), (e - f) * (half * lv));
    [
        centre - u - v,
        centre + u - v,
        centre + u + v,
        centre - u + v,
    ]
}

/// What may move: inside a sheet, along a smooth rim or seam, or not at all (`Corner`).
pub(crate) fn classes(
    points: &[Vec3],
    polygons: &[Option<Polygon>],
    beams: &[[u32; 2]],
) -> Vec<Class> {
    let mut rim: Vec<Vec<u32>> = vec![Vec::new(); points.len()];
    let mut seam: Vec<Vec<u32>> = vec![Vec::new(); points.len()];
    for (e, f) in edge_table(polygons).iter().filter(|(_, f)| f.len() != 2) {
        let list = if f.len() == 1 { &mut rim } else { &mut seam };
        list[e[0] as usize].push(e[1]);
        list[e[1] as usize].push(e[0]);
    }
    let mut out: Vec<Class> = (0..points.len())
        .map(|v| {
            let smooth = |ends: &[u32]| {
                let [a, b] = *ends else { return false };
                angle(
                    &(points[a as usize] - points[v]),
                    &(points[b as usize] - points[v]),
                ) > 180.0 - SHARP
            };
            match (rim[v].len(), seam[v].len()) {
                (0, 0) => Class::Interior,
                (2, 0) if smooth(&rim[v]) => Class::Rim,
                (0, 2) if smooth(&seam[v]) => Class::Seam,
                _ => Class::Corner,
            }
        })
        .collect();
    for &v in beams.iter().flatten() {
        out[v as usize] = Class::Corner;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rectangles_stay_and_rhombi_straighten() {
        let square =
            [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|p| Vec3::new(p[0], p[1], 0.0));
        for (p, q) in square.iter().zip(rectangle(square)) {
            assert!((p - q).norm() < 1e-12);
        }
        let rhombus =
            [[0.0, 0.0], [1.0, 0.0], [1.5, 0.9], [0.5, 0.9]].map(|p| Vec3::new(p[0], p[1], 0.0));
        let r = rectangle(rhombus);
        assert!((angle(&(r[1] - r[0]), &(r[3] - r[0])) - 90.0).abs() < 1e-9);
    }
}
