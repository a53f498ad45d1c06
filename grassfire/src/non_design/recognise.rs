//! Recognition from the proposal alone: surfaces, bosses, and the table of both.

use super::RecogniseOptions;
use super::bosses::{Boss, pair};
use super::facets::Facets;
use super::ransac::{Candidate, search};
use crate::mesh::TriMesh;
use crate::monitor::{Cancelled, Monitor};

/// What was recognised in a proposal.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Recognised {
    /// Planes and cylinders, the largest first.
    pub candidates: Vec<Candidate>,
    /// Through bores with sleeves, in the order of their bores.
    pub bosses: Vec<Boss>,
    /// Concave cylinders that are no bosses, and why.
    pub rejected: Vec<(usize, String)>,
}

/// Finds planes, cylinders and bosses in a repaired mesh.
///
/// 1. [`super::surfaces`]: planes and cylinders by RANSAC, merged and fitted by least squares.
/// 2. [`super::bosses`]: through bores with their walls and ends.
///
/// Two bores on one axis that overlap, such as the steps of a counterbore, give one boss: the narrower one.
///
/// # Errors
/// [`Cancelled`].
pub fn recognise(
    mesh: &TriMesh,
    options: &RecogniseOptions,
    monitor: &Monitor,
) -> Result<Recognised, Cancelled> {
    let facets = Facets::new(mesh);
    if facets.edge <= 0.0 {
        return Ok(Recognised::default());
    }
    let candidates = search(&facets, options, monitor)?;
    monitor.step("recognise", "bosses", 0.9)?;
    let mut out = Recognised::default();
    for (bore, result) in pair(&facets, &candidates, options) {
        match result {
            Ok(boss) => out.bosses.push(boss),
            Err(reason) => out.rejected.push((bore, reason)),
        }
    }
    out.candidates = candidates;
    apart(&mut out);
    Ok(out)
}

/// Drops the wider one of two bosses that overlap on one axis.
fn apart(found: &mut Recognised) {
    let mut order: Vec<usize> = (0..found.bosses.len()).collect();
    order.sort_by(|&a, &b| found.bosses[a].radius.total_cmp(&found.bosses[b].radius));
    let mut keep: Vec<usize> = Vec::new();
    for b in order {
        let boss = &found.bosses[b];
        if keep.iter().any(|&k| overlap(&found.bosses[k], boss)) {
            let reason = "a narrower bore lies in it".to_owned();
            found.rejected.push((boss.bore, reason));
        } else {
            keep.push(b);
        }
    }
    keep.sort_unstable();
    found.bosses = keep.iter().map(|&k| found.bosses[k].clone()).collect();
    found.rejected.sort();
}

/// Whether two sleeves on nearly one axis share material.
fn overlap(a: &Boss, b: &Boss) -> bool {
    let offset = b.origin - a.origin;
    let along = offset.dot(&a.direction);
    let sign = b.direction.dot(&a.direction).signum();
    let mut range = b.extent.map(|t| along + sign * t);
    range.sort_by(f64::total_cmp);
    b.direction.dot(&a.direction).abs() > 0.99
        && (offset - a.direction * along).norm() < 0.5 * a.radius
        && range[0] < a.extent[1]
        && range[1] > a.extent[0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;
    use std::f64::consts::TAU;

    /// A square plate with a hole about z as a mesh; `turn` of the hole's wall is there, the rest is dented outward.
    fn plate(radius: f64, n: usize, dent: impl Fn(f64) -> f64) -> TriMesh {
        let (half, thick) = (20.0, 8.0);
        let mut mesh = TriMesh::default();
        let rings = [(false, 0.0), (true, 0.0), (true, thick), (false, thick)];
        for (outer, z) in rings {
            for k in 0..n {
                let a = TAU * k as f64 / n as f64;
                let r = if outer {
                    half / a.cos().abs().max(a.sin().abs())
                } else {
                    radius + dent(a)
                };
                mesh.points.push(Vec3::new(r * a.cos(), r * a.sin(), z));
            }
        }
        for ring in 0..4 {
            for k in 0..n {
                let at = |r: usize, k: usize| ((r % 4) * n + k % n) as u32;
                let (a, b) = (at(ring, k), at(ring, k + 1));
                let (c, d) = (at(ring + 1, k + 1), at(ring + 1, k));
                mesh.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        if mesh.volume() < 0.0 {
            mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        mesh
    }

    fn find(mesh: &TriMesh) -> Recognised {
        recognise(mesh, &RecogniseOptions::default(), &Monitor::default()).expect("not cancelled")
    }

    #[test]
    fn a_drilled_plate_has_one_boss_with_two_ends() {
        let found = find(&plate(5.0, 96, |_| 0.0));
        assert_eq!(found.bosses.len(), 1, "{:?}", found.rejected);
        let boss = &found.bosses[0];
        assert!((boss.radius - 5.0).abs() < 1e-6, "{}", boss.radius);
        assert!(boss.direction.dot(&Vec3::z()).abs() > 1.0 - 1e-9);
        assert!(boss.ends.iter().all(Option::is_some));
        assert!((boss.extent[1] - boss.extent[0] - 8.0).abs() < 1e-6);
        assert!(boss.outer_radius > 6.0 && boss.outer_radius < 20.0);
        assert!((boss.free - 5.0).abs() < 1e-9);
    }

    #[test]
    fn a_wavy_hole_is_no_bore() {
        let found = find(&plate(5.0, 96, |a| 0.8 * (5.0 * a).sin()));
        assert!(found.bosses.is_empty());
    }

    #[test]
    fn a_hole_with_half_a_wall_is_no_bore() {
        let found = find(&plate(5.0, 96, |a| {
            if a < TAU / 2.0 {
                0.0
            } else {
                3.0 * (2.0 * a).sin().abs()
            }
        }));
        assert!(found.bosses.is_empty());
        assert!(
            found
                .rejected
                .iter()
                .any(|(_, why)| why.contains("circumference")),
            "{:?}",
            found.rejected
        );
    }

    #[test]
    fn the_seed_decides_the_result() {
        let mesh = plate(5.0, 96, |_| 0.0);
        assert_eq!(find(&mesh), find(&mesh));
    }

    #[test]
    fn empty_and_flat_meshes_have_no_surfaces() {
        assert_eq!(find(&TriMesh::default()), Recognised::default());
        let point = TriMesh {
            points: vec![Vec3::zeros(); 3],
            triangles: vec![[0, 1, 2]],
            tags: Vec::new(),
        };
        assert_eq!(find(&point), Recognised::default());
    }
}
