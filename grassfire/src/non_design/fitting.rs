//! Planes and cylinders fitted to facets: what a candidate measures, and which candidates are one surface.

use super::facets::Facets;
use super::ransac::Candidate;
use crate::Vec3;
use crate::cad::primitives::{Primitive, across, fit_cylinder, fit_plane};

/// Points beyond this many median deviations do not take part in the last fit.
const OUTLIER: f64 = 4.0;

/// Signed distance to a plane along its normal, to a cylinder away from its axis, mm.
pub(super) fn distance(surface: &Primitive, p: &Vec3) -> f64 {
    match surface {
        Primitive::Plane { normal, offset } => normal.dot(p) - offset,
        Primitive::Cylinder {
            origin,
            direction,
            radius,
            ..
        } => {
            let from = p - origin;
            (from - direction * from.dot(direction)).norm() - radius
        }
    }
}

/// Normal of the surface out of the material.
pub(super) fn outward(surface: &Primitive, p: &Vec3) -> Vec3 {
    match surface {
        Primitive::Plane { normal, .. } => *normal,
        Primitive::Cylinder {
            origin,
            direction,
            concave,
            ..
        } => {
            let from = p - origin;
            let away = (from - direction * from.dot(direction))
                .try_normalize(0.0)
                .unwrap_or_else(Vec3::zeros);
            if *concave { -away } else { away }
        }
    }
}

/// Least squares over the points of `triangles`.
pub(super) fn fit(facets: &Facets, like: &Primitive, triangles: &[u32]) -> Option<Primitive> {
    fit_points(facets, like, triangles, &facets.points(triangles))
}

fn fit_points(
    facets: &Facets,
    like: &Primitive,
    triangles: &[u32],
    points: &[Vec3],
) -> Option<Primitive> {
    let weighted = facets.weighted(triangles);
    match like {
        Primitive::Plane { .. } => Some(fit_plane(points, &weighted).0),
        Primitive::Cylinder { concave, .. } => {
            let (fitted, _) = fit_cylinder(points, &weighted)?;
            // A fit that turned inside out is none.
            matches!(fitted, Primitive::Cylinder { concave: c, .. } if c == *concave)
                .then_some(fitted)
        }
    }
}

/// Fits again without the points that lie far off: rims of fillets and chamfers.
pub(super) fn refine(facets: &Facets, surface: Primitive, triangles: &[u32]) -> Primitive {
    let all = facets.points(triangles);
    let mut surface = surface;
    for _ in 0..5 {
        let mut sorted: Vec<f64> = all.iter().map(|p| distance(&surface, p).abs()).collect();
        let middle = sorted.len() / 2;
        let median = *sorted.select_nth_unstable_by(middle, f64::total_cmp).1;
        let limit = OUTLIER * median + 1e-6 * facets.edge;
        let good: Vec<Vec3> = all
            .iter()
            .filter(|p| distance(&surface, p).abs() <= limit)
            .copied()
            .collect();
        if good.len() < 6 {
            break;
        }
        match fit_points(facets, &surface, triangles, &good) {
            Some(next) => surface = next,
            None => break,
        }
    }
    surface
}

/// Joins pieces that lie on one surface.
pub(super) fn merge(
    facets: &Facets,
    found: Vec<(Primitive, Vec<u32>)>,
    tolerance: f64,
) -> Vec<(Primitive, Vec<u32>)> {
    let mut groups: Vec<(Primitive, Vec<u32>)> = Vec::new();
    let mut found = found;
    found.sort_by(|a, b| {
        facets
            .area(&b.1)
            .total_cmp(&facets.area(&a.1))
            .then(a.1.cmp(&b.1))
    });
    for (surface, triangles) in found {
        let same = groups.iter().position(|(other, own)| {
            same_surface(facets, other, own, &surface, &triangles, tolerance)
        });
        match same {
            Some(g) => groups[g].1.extend(triangles),
            None => groups.push((surface, triangles)),
        }
    }
    for (surface, triangles) in &mut groups {
        triangles.sort_unstable();
        *surface = refine(facets, *surface, triangles);
    }
    groups
}

fn same_surface(
    facets: &Facets,
    a: &Primitive,
    a_triangles: &[u32],
    b: &Primitive,
    b_triangles: &[u32],
    tolerance: f64,
) -> bool {
    let parallel = 0.9998; // one degree
    match (a, b) {
        (Primitive::Plane { normal: n, .. }, Primitive::Plane { normal: m, .. }) => {
            n.dot(m) > parallel
                && b_triangles
                    .iter()
                    .all(|&t| distance(a, &facets.middles[t as usize]).abs() <= 2.0 * tolerance)
        }
        (
            Primitive::Cylinder {
                direction: d,
                radius,
                concave: c,
                ..
            },
            Primitive::Cylinder {
                direction: e,
                concave: f,
                ..
            },
        ) => {
            let [from, to] = extent(facets, a, a_triangles);
            let [low, high] = extent(facets, a, b_triangles);
            c == f
                && d.dot(e).abs() > parallel
                && low <= to + radius
                && high >= from - radius
                && b_triangles
                    .iter()
                    .flat_map(|&t| facets.mesh.corners(t as usize))
                    .all(|p| distance(a, &p).abs() <= 2.0 * tolerance)
        }
        _ => false,
    }
}

/// Range of the triangles' points along the axis.
pub(super) fn extent(facets: &Facets, surface: &Primitive, triangles: &[u32]) -> [f64; 2] {
    let Primitive::Cylinder {
        origin, direction, ..
    } = surface
    else {
        return [0.0; 2];
    };
    triangles
        .iter()
        .flat_map(|&t| facets.mesh.corners(t as usize))
        .map(|p| (p - origin).dot(direction))
        .fold([f64::MAX, f64::MIN], |[lo, hi], t| [lo.min(t), hi.max(t)])
}

pub(super) fn measure(
    facets: &Facets,
    surface: Primitive,
    triangles: Vec<u32>,
) -> Option<Candidate> {
    let points = facets.points(&triangles);
    let (mut squares, mut residual) = (0.0, 0.0f64);
    for p in &points {
        let d = distance(&surface, p);
        squares += d * d;
        residual = residual.max(d.abs());
    }
    let area = facets.area(&triangles);
    let middle: Vec3 = triangles
        .iter()
        .map(|&t| facets.middles[t as usize] * facets.areas[t as usize])
        .sum();
    let out = Candidate {
        angle: turn(facets, &surface, &triangles),
        extent: extent(facets, &surface, &triangles),
        middle: middle / area,
        rms: (squares / points.len() as f64).sqrt(),
        residual,
        surface,
        triangles,
        area,
    };
    (area > 0.0 && out.rms.is_finite()).then_some(out)
}

/// Angle of the circumference that the triangles cover, radians; counted in steps of a degree.
pub(super) fn turn(facets: &Facets, surface: &Primitive, triangles: &[u32]) -> f64 {
    let Primitive::Cylinder {
        origin, direction, ..
    } = surface
    else {
        return 0.0;
    };
    let [e, f] = across(direction);
    let angle = |p: Vec3| {
        (p - origin)
            .dot(&f)
            .atan2((p - origin).dot(&e))
            .to_degrees()
    };
    let mut seen = [false; 360];
    for &t in triangles {
        let middle = angle(facets.middles[t as usize]);
        let offsets = facets
            .mesh
            .corners(t as usize)
            .map(|p| (angle(p) - middle + 540.0).rem_euclid(360.0) - 180.0);
        let low = offsets.iter().copied().fold(0.0, f64::min) + middle;
        let high = offsets.iter().copied().fold(0.0, f64::max) + middle;
        for degree in low.floor() as i64..=high.floor() as i64 {
            seen[degree.rem_euclid(360) as usize] = true;
        }
    }
    (seen.iter().filter(|s| **s).count() as f64).to_radians()
}
