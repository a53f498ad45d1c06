//! The forces of a load on points of a surface.

use nalgebra::Matrix3;

use super::{CaseError, Load};
use crate::Vec3;
use crate::topopt::Problem;

/// A point that a load may act on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LoadPlace {
    /// The point, mm.
    pub place: Vec3,
    /// Its share of an even load.
    pub weight: f64,
    /// The surface's area there times its outward normal, mm2; zero where there is no surface.
    pub area: Vec3,
}

impl LoadPlace {
    /// A piece of a surface: its weight is its area.
    pub fn on_surface(place: Vec3, area: Vec3) -> Self {
        Self {
            place,
            weight: area.norm(),
            area,
        }
    }
}

/// The forces of a load on points, N; the kinds of a load add up.
///
/// 1. `force`: shares by weight; what it turns when it acts `at` another point than their centre comes on top of the moment.
/// 2. `moment`: the smallest forces that make it.
/// 3. `pressure`: against the outward normals, by area.
/// 4. `bearing`: a pressure that falls with the cosine of the angle to the force, on the half of the surface that faces it, as a
///    pin presses in a bore; scaled to the force. What it has across the force (none on a whole bore) is taken off evenly.
///
/// # Errors
/// [`CaseError::Moment`] when the points lie on a line and a moment is asked for; [`CaseError::NoSurface`] when a pressure finds no
/// area, or a bearing force none that faces it.
pub(crate) fn forces_on(places: &[LoadPlace], load: &Load) -> Result<Vec<Vec3>, CaseError> {
    let mut out = vec![Vec3::zeros(); places.len()];
    add_evenly(places, Vec3::from(load.force.unwrap_or_default()), &mut out);
    let mut moment = Vec3::from(load.moment.unwrap_or_default());
    if let (Some(at), Some(force)) = (load.at, load.force) {
        moment += (Vec3::from(at) - centre(places)).cross(&Vec3::from(force));
    }
    if moment != Vec3::zeros() {
        add_moment(places, load, moment, &mut out)?;
    }
    if let Some(pressure) = load.pressure {
        if places.iter().all(|p| p.area == Vec3::zeros()) {
            return Err(no_surface(places, load));
        }
        let pushes = out.iter_mut().zip(places);
        pushes.for_each(|(f, p)| *f -= pressure * p.area);
    }
    if let Some(force) = load.bearing.filter(|f| *f != [0.0; 3]) {
        add_bearing(places, load, Vec3::from(force), &mut out)?;
    }
    Ok(out)
}

fn no_surface(places: &[LoadPlace], load: &Load) -> CaseError {
    CaseError::NoSurface {
        name: load.on.clone(),
        points: places.len(),
    }
}

fn centre(places: &[LoadPlace]) -> Vec3 {
    let total: f64 = places.iter().map(|p| p.weight).sum();
    places.iter().map(|p| p.place * p.weight).sum::<Vec3>() / total
}

fn add_evenly(places: &[LoadPlace], force: Vec3, out: &mut [Vec3]) {
    let total: f64 = places.iter().map(|p| p.weight).sum();
    let shares = out.iter_mut().zip(places);
    shares.for_each(|(f, p)| *f += force * (p.weight / total));
}

fn add_moment(
    places: &[LoadPlace],
    load: &Load,
    moment: Vec3,
    out: &mut [Vec3],
) -> Result<(), CaseError> {
    let centre = centre(places);
    let inertia: Matrix3<f64> = places
        .iter()
        .map(|p| (p.place - centre, p.weight))
        .map(|(r, w)| (Matrix3::identity() * r.norm_squared() - r * r.transpose()) * w)
        .sum();
    let size = inertia.trace();
    let sound = inertia.symmetric_eigenvalues().min() > 1e-9 * size;
    let Some(inverse) = inertia.try_inverse().filter(|_| sound) else {
        return Err(CaseError::Moment {
            name: load.on.clone(),
            nodes: places.len(),
        });
    };
    let turn = inverse * moment;
    for (f, p) in out.iter_mut().zip(places) {
        *f += turn.cross(&(p.place - centre)) * p.weight;
    }
    Ok(())
}

fn add_bearing(
    places: &[LoadPlace],
    load: &Load,
    force: Vec3,
    out: &mut [Vec3],
) -> Result<(), CaseError> {
    let along = force.normalize();
    let push = |p: &LoadPlace| {
        let facing = -p.area.dot(&along);
        if facing > 0.0 {
            -p.area * (facing / p.area.norm())
        } else {
            Vec3::zeros()
        }
    };
    let pushes: Vec<Vec3> = places.iter().map(push).collect();
    let sum: Vec3 = pushes.iter().sum();
    let pressed = sum.dot(&along);
    let area: f64 = places.iter().map(|p| p.area.norm()).sum();
    if pressed <= 1e-6 * area || area == 0.0 {
        return Err(no_surface(places, load));
    }
    let scale = force.norm() / pressed;
    out.iter_mut()
        .zip(&pushes)
        .for_each(|(f, p)| *f += scale * p);
    add_evenly(places, force - scale * sum, out);
    Ok(())
}

/// For the chosen nodes (ascending numbers in `[z][y][x]` order) the area of the faces between a voxel with material and one
/// without that have all four corners among them, a quarter to each corner; outward.
pub(super) fn exposed(problem: &Problem, nodes: &[usize]) -> Vec<Vec3> {
    let [nx, ny, _] = problem.dims.map(|n| n + 1);
    let strides = [1, nx, nx * ny];
    let mut areas = vec![Vec3::zeros(); nodes.len()];
    let quarter = problem.h * problem.h / 4.0;
    let active = |at: [Option<usize>; 3]| {
        let [Some(x), Some(y), Some(z)] = at else {
            return false;
        };
        let inside = x < problem.dims[0] && y < problem.dims[1] && z < problem.dims[2];
        inside && problem.is_active(problem.index([x, y, z]))
    };
    for &node in nodes {
        let at = problem.at_node(node);
        // The face across each axis of which this node is the lower corner.
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let mut before = at.map(Some);
            before[axis] = at[axis].checked_sub(1);
            let outward = match (active(before), active(at.map(Some))) {
                (true, false) => 1.0,
                (false, true) => -1.0,
                _ => continue,
            };
            let corners = [0, strides[u], strides[v], strides[u] + strides[v]];
            let found = corners.map(|step| nodes.binary_search(&(node + step)).ok());
            if let [Some(a), Some(b), Some(c), Some(d)] = found {
                for corner in [a, b, c, d] {
                    areas[corner][axis] += outward * quarter;
                }
            }
        }
    }
    areas
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The wall of a bore of radius 4 and length 3 about z, in strips.
    fn bore() -> Vec<LoadPlace> {
        let n = 720;
        (0..n)
            .map(|i| {
                let (sin, cos) =
                    (std::f64::consts::TAU * (f64::from(i) + 0.5) / f64::from(n)).sin_cos();
                let area = 4.0 * 3.0 * std::f64::consts::TAU / f64::from(n);
                LoadPlace::on_surface(
                    Vec3::new(4.0 * cos, 4.0 * sin, 0.0),
                    Vec3::new(-cos, -sin, 0.0) * area,
                )
            })
            .collect()
    }

    #[test]
    fn a_bearing_force_presses_one_half_of_a_bore_with_the_cosine() {
        let load = Load {
            bearing: Some([300.0, 0.0, 0.0]),
            ..Load::default()
        };
        let places = bore();
        let forces = forces_on(&places, &load).unwrap();
        let sum: Vec3 = forces.iter().sum();
        assert!((sum - Vec3::new(300.0, 0.0, 0.0)).norm() < 1e-9, "{sum}");
        // Peak pressure of the cosine on a half circle: 4 F / (pi d l).
        let peak = 4.0 * 300.0 / (std::f64::consts::PI * 8.0 * 3.0);
        for (place, force) in places.iter().zip(&forces) {
            let cosine = place.place.x / 4.0;
            let wanted = if cosine > 0.0 { peak * cosine } else { 0.0 };
            let found = force.norm() / place.area.norm();
            assert!(
                (found - wanted).abs() < 1e-3 * peak,
                "{cosine}: {found} {wanted}"
            );
            assert!(force.dot(&place.place) >= -1e-9);
        }
    }

    #[test]
    fn loads_on_surfaces_are_refused_where_there_is_none() {
        let mut places = bore();
        places.iter_mut().for_each(|p| p.area = Vec3::zeros());
        for (pressure, bearing) in [(Some(2.0), None), (None, Some([1.0, 0.0, 0.0]))] {
            let load = Load {
                pressure,
                bearing,
                ..Load::default()
            };
            let found = forces_on(&places, &load);
            assert!(matches!(found, Err(CaseError::NoSurface { .. })));
        }
        // A bore's wall faces no force along its axis.
        let load = Load {
            bearing: Some([0.0, 0.0, 5.0]),
            ..Load::default()
        };
        let found = forces_on(&bore(), &load);
        assert!(matches!(found, Err(CaseError::NoSurface { .. })));
    }
}
