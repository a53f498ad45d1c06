//! A coarser control mesh with nearly the same surface: fewer extraordinary points, fewer faces.

use std::collections::BTreeSet;

use super::blocks::rectangular_blocks;
use super::catmull_clark::limit_mesh;
use super::half_edges::connect;
use super::motorcycle::cut_lines;
use super::quality::jacobians;
use super::refit::{Target, refit};
use super::removal::take_quads_out;
use super::{ControlMesh, PatchOptions, SplineError, patches};
use crate::mesh::self_intersection::self_intersections;
use crate::mesh::{Bvh, DistanceOptions, TriMesh, two_sided};
use crate::monitor::Monitor;

/// Name of this work in progress.
const STAGE: &str = "fewest";
/// Strips and quads that are tried at most.
const TRIES: usize = 400;
/// What goes may turn by this many tolerances: the fit takes up most of it.
const BEND: f64 = 16.0;
/// Rings of points around it that are fitted again.
const RINGS: usize = 2;
/// Strips with more points to fit are left alone: the equations are dense.
const MOST_POINTS: usize = 700;
/// Splits of the control mesh for the distance between two surfaces.
const LEVELS: u32 = 2;

/// A coarser control mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct Coarse {
    /// The mesh.
    pub mesh: ControlMesh,
    /// The number that each of its points had before.
    pub kept: Vec<u32>,
    /// Strips and single quads that were taken out.
    pub steps: usize,
    /// Largest distance between the limit surfaces before and after, either way, at samples, mm.
    pub deviation: f64,
}

/// Takes strips of quads and single quads out of a control mesh as long as its limit surface stays within `tolerance` mm of the first one.
///
/// 1. Take out what costs least for what it gains; see [`take_quads_out`].
/// 2. Fit the control points around it to the first limit surface again.
/// 3. Keep that when the number of faces does not rise, the surfaces are within the tolerance of each other, both ways, and the new
///    one does not cut itself or fold more than the first; else refuse it. Go on until nothing is left.
///
/// The faces are made from the coarser mesh just as exactly as from the first, so they are just as smooth.
///
/// # Errors
/// As for [`super::patches`].
pub fn coarsen(
    mesh: &ControlMesh,
    tolerance: f64,
    options: &PatchOptions,
    monitor: &Monitor,
) -> Result<Coarse, SplineError> {
    connect(mesh)?;
    let first = surface(mesh)?;
    let search = Search {
        crossings: self_intersections(&first).len(),
        folds: folds(mesh, options)?,
        target: Target {
            tree: Bvh::new(&first),
            mesh: first,
        },
        tolerance,
        options,
    };
    let (mut current, mut steps, mut deviation) = (mesh.clone(), 0, 0.0);
    let mut faces = face_count(mesh)?;
    let mut refused = BTreeSet::new();
    for round in 0..TRIES {
        monitor.step(STAGE, "coarser meshes", round as f64 / TRIES as f64)?;
        let Some(step) = take_quads_out(&current, &refused, BEND * tolerance)? else {
            break;
        };
        let seeds: Vec<u32> = step.merged.iter().map(|[a, _]| *a).collect();
        let fewer = face_count(&step.mesh)?;
        // A strip makes way for others even where it saves no face by itself.
        let worth = fewer < faces || fewer == faces && seeds.len() > 1;
        let accepted = if worth {
            search.accept(step.mesh, &seeds)?
        } else {
            None
        };
        match accepted {
            Some((mesh, distance)) => {
                (current, deviation, faces) = (mesh, distance, fewer);
                steps += 1;
            }
            None => refused.extend(step.merged.iter().map(|[a, b]| [*a.min(b), *a.max(b)])),
        }
    }
    let (mesh, kept) = compact(&current);
    Ok(Coarse {
        mesh,
        kept,
        steps,
        deviation,
    })
}

struct Search<'a> {
    target: Target,
    crossings: usize,
    folds: usize,
    tolerance: f64,
    options: &'a PatchOptions,
}

impl Search<'_> {
    /// The mesh fitted again and its deviation, when it is good enough.
    fn accept(
        &self,
        mut mesh: ControlMesh,
        seeds: &[u32],
    ) -> Result<Option<(ControlMesh, f64)>, SplineError> {
        let free = around(&mesh, seeds);
        if free.len() > MOST_POINTS || refit(&mut mesh, &free, &self.target)? > self.tolerance {
            return Ok(None);
        }
        if folds(&mesh, self.options)? > self.folds {
            return Ok(None);
        }
        let after = surface(&mesh)?;
        let samples = DistanceOptions::default();
        let distance = two_sided(&after, &self.target.mesh, &samples, None).max;
        let near = distance <= self.tolerance;
        let sound = near && self_intersections(&after).len() <= self.crossings;
        Ok(sound.then_some((mesh, distance)))
    }
}

/// Faces that the mesh gets.
fn face_count(mesh: &ControlMesh) -> Result<usize, SplineError> {
    let half_edges = connect(mesh)?;
    let mut cut = cut_lines(&half_edges);
    Ok(rectangular_blocks(mesh, &half_edges, &mut cut)?.len())
}

pub(super) fn surface(mesh: &ControlMesh) -> Result<TriMesh, SplineError> {
    Ok(limit_mesh(mesh, LEVELS)?.0)
}

/// Patches that fold or nearly fold.
pub(super) fn folds(mesh: &ControlMesh, options: &PatchOptions) -> Result<usize, SplineError> {
    let all = jacobians(&patches(mesh, options, &Monitor::default())?);
    let folded = all.iter().filter(|j| j.value < options.fold_limit);
    Ok(folded.count())
}

/// The seeds and the points within a few rings of quads, ascending.
fn around(mesh: &ControlMesh, seeds: &[u32]) -> Vec<u32> {
    let mut inside = vec![false; mesh.points.len()];
    seeds.iter().for_each(|v| inside[*v as usize] = true);
    for _ in 0..RINGS {
        let touched: Vec<&[u32; 4]> = mesh
            .quads
            .iter()
            .filter(|quad| quad.iter().any(|v| inside[*v as usize]))
            .collect();
        let points = touched.into_iter().flatten();
        points.for_each(|v| inside[*v as usize] = true);
    }
    let all = 0..mesh.points.len() as u32;
    all.filter(|v| inside[*v as usize]).collect()
}

/// The mesh without the points that no quad uses, and the old number of each point.
fn compact(mesh: &ControlMesh) -> (ControlMesh, Vec<u32>) {
    let mut number = vec![u32::MAX; mesh.points.len()];
    let used = mesh.quads.iter().flatten();
    used.for_each(|v| number[*v as usize] = 0);
    let kept: Vec<u32> = (0..number.len() as u32)
        .filter(|v| number[*v as usize] == 0)
        .collect();
    for (new, old) in kept.iter().enumerate() {
        number[*old as usize] = new as u32;
    }
    let quads = mesh.quads.iter();
    let mesh = ControlMesh {
        points: kept.iter().map(|v| mesh.points[*v as usize]).collect(),
        quads: quads.map(|q| q.map(|v| number[v as usize])).collect(),
    };
    (mesh, kept)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;

    /// A closed tube of `n` x `m` quads about a circle, with one quad in the middle of its top replaced by five.
    fn stamped_torus(n: u32, m: u32) -> ControlMesh {
        let mut mesh = ControlMesh::default();
        for (i, j) in (0..n).flat_map(|i| (0..m).map(move |j| (i, j))) {
            let turn = |k: u32, of: u32| std::f64::consts::TAU * f64::from(k) / f64::from(of);
            let ((s, c), (t, d)) = (turn(i, n).sin_cos(), turn(j, m).sin_cos());
            let r = 30.0 + 8.0 * d;
            mesh.points.push(Vec3::new(r * c, r * s, 8.0 * t));
            let at = |i: u32, j: u32| (i % n) * m + j % m;
            mesh.quads
                .push([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
        let outer = mesh.quads[0];
        let corner = |v: u32| mesh.points[v as usize];
        let centre = outer.iter().map(|v| corner(*v)).sum::<Vec3>() / 4.0;
        let inner = [0, 1, 2, 3].map(|k| mesh.points.len() as u32 + k);
        let points = outer.map(|v| centre.lerp(&corner(v), 0.5));
        mesh.points.extend(points);
        mesh.quads[0] = inner;
        for k in 0..4 {
            let l = (k + 1) % 4;
            mesh.quads.push([outer[k], outer[l], inner[l], inner[k]]);
        }
        mesh
    }

    #[test]
    fn needless_points_go_and_the_surface_stays() {
        let (mesh, options) = (stamped_torus(24, 10), PatchOptions::default());
        let monitor = Monitor::default();
        let coarse = coarsen(&mesh, 0.3, &options, &monitor).expect("a valid mesh");
        assert_eq!(coarse.steps, 1);
        assert_eq!(coarse.mesh.quads.len(), 240);
        let valence = connect(&coarse.mesh).expect("a valid mesh").valence;
        assert!(valence.iter().all(|n| *n == 4));
        assert_eq!(coarse.kept.len(), coarse.mesh.points.len());
        assert!(coarse.deviation > 0.0 && coarse.deviation <= 0.3);
        let samples = DistanceOptions { samples: 90_000 };
        let [a, b] = [&mesh, &coarse.mesh].map(|m| surface(m).expect("a valid mesh"));
        let measured = two_sided(&a, &b, &samples, None).max;
        assert!(measured <= 1.05 * coarse.deviation, "{measured} {coarse:?}");
        let again = coarsen(&mesh, 0.3, &options, &monitor).expect("a valid mesh");
        assert_eq!(coarse, again);
    }

    #[test]
    fn nothing_goes_without_tolerance() {
        let (mesh, options) = (stamped_torus(24, 10), PatchOptions::default());
        let same = coarsen(&mesh, 0.0, &options, &Monitor::default()).expect("a valid mesh");
        assert_eq!((same.steps, same.deviation), (0, 0.0));
        assert_eq!(same.mesh, mesh);
    }

    #[test]
    fn cancelled_search_ends() {
        let monitor = Monitor::default();
        monitor.cancel();
        let result = coarsen(
            &stamped_torus(9, 6),
            0.3,
            &PatchOptions::default(),
            &monitor,
        );
        assert!(matches!(result, Err(SplineError::Cancelled(_))));
    }
}
