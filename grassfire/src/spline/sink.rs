//! Sinks the surface below walls that it is nearly flush with.

use super::catmull_clark::{limit_mesh, limit_operator, triangles_of};
use super::stencils::Stencils;
use super::{ControlMesh, PatchOptions, SplineError, jacobians, patches};
use crate::Vec3;
use crate::mesh::self_intersection::self_intersections;
use crate::mesh::{Bvh, TriMesh};
use crate::monitor::Monitor;

/// Splits of the quads whose points are looked at.
const LEVELS: u32 = 2;
/// Surface and wall are parallel within this angle: its cosine (20 degrees).
const PARALLEL: f64 = 0.94;
/// Rounds of moving and looking again.
const ROUNDS: usize = 8;
/// Attempts, each with more control points that stay.
const TRIES: usize = 5;
/// Nothing sinks for less than this share of the depth.
const ENOUGH: f64 = 0.05;

/// Moves the limit surface of `mesh` until it lies `depth` mm below every wall that it is nearly flush with; `None` where there is
/// none.
///
/// Two surfaces that lie within a fraction of a voxel of each other cross along lines that wander, at angles near zero: their
/// union has faces that end in needles, which no mesher can fill well.
///
/// 1. Points of the limit surface (two splits) are flush when the nearest point of `walls` is within `reach` sideways
///    and `depth` above or below, and both face the same way (20 degrees).
/// 2. Control points move against the wall's normal by the mean that their flush points lack, some rounds.
/// 3. Where that makes the surface cut itself or fold, the control points stay, and all is done once more.
///
/// Around them the surface follows over about two quads, as control points do.
///
/// # Errors
/// As for [`super::patches`].
pub fn sink_flush(
    mesh: &ControlMesh,
    walls: &TriMesh,
    (depth, reach): (f64, f64),
    options: &PatchOptions,
) -> Result<Option<ControlMesh>, SplineError> {
    if walls.triangles.is_empty() || depth <= 0.0 {
        return Ok(None);
    }
    let site = Site::new(mesh, walls, depth, reach)?;
    let before = faults(mesh, options)?;
    let mut held = vec![false; mesh.points.len()];
    for _ in 0..TRIES {
        let Some(sunk) = site.sink(mesh, &held) else {
            return Ok(None);
        };
        let after = faults(&sunk, options)?;
        let worse = |q: &usize| after[*q] && !before[*q];
        let worse: Vec<usize> = (0..mesh.quads.len()).filter(worse).collect();
        if worse.is_empty() {
            return Ok(Some(sunk));
        }
        let mut around: Vec<u32> = worse.iter().flat_map(|&q| mesh.quads[q]).collect();
        around.sort_unstable();
        let near = |q: &&[u32; 4]| q.iter().any(|v| around.binary_search(v).is_ok());
        let near = mesh.quads.iter().filter(near).flatten();
        near.for_each(|&v| held[v as usize] = true);
    }
    Ok(None)
}

/// Quads where the surface cuts itself or folds.
fn faults(mesh: &ControlMesh, options: &PatchOptions) -> Result<Vec<bool>, SplineError> {
    let all = jacobians(&patches(mesh, options, &Monitor::default())?);
    let mut out: Vec<bool> = all.iter().map(|j| j.value < options.fold_limit).collect();
    let (fine, owner) = limit_mesh(mesh, LEVELS)?;
    for pair in self_intersections(&fine) {
        pair.iter()
            .for_each(|&t| out[owner[t as usize] as usize] = true);
    }
    Ok(out)
}

/// Walls, and the limit points that are looked at.
struct Site<'a> {
    walls: &'a TriMesh,
    bvh: Bvh,
    /// From control points to limit points.
    operator: Stencils,
    triangles: Vec<[u32; 3]>,
    depth: f64,
    reach: f64,
}

impl<'a> Site<'a> {
    fn new(
        mesh: &ControlMesh,
        walls: &'a TriMesh,
        depth: f64,
        reach: f64,
    ) -> Result<Self, SplineError> {
        let (operator, refined) = limit_operator(mesh.points.len(), &mesh.quads, LEVELS)?;
        Ok(Self {
            walls,
            bvh: Bvh::new(walls),
            operator,
            triangles: triangles_of(&refined.quads, LEVELS).0,
            depth,
            reach,
        })
    }

    /// The mesh without its flush places but those of held control points; none when nothing moves.
    fn sink(&self, mesh: &ControlMesh, held: &[bool]) -> Option<ControlMesh> {
        let mut sunk = mesh.clone();
        for _ in 0..ROUNDS {
            let points = self.operator.apply(&sunk.points);
            let normals = normals(&points, &self.triangles);
            let mut sums = vec![(Vec3::zeros(), 0.0); mesh.points.len()];
            for (sample, (p, n)) in points.iter().zip(&normals).enumerate() {
                let Some((lack, normal)) = self.flush(p, n) else {
                    continue;
                };
                let (indices, weights) = self.operator.row(sample);
                let both = indices.iter().zip(weights);
                for (&v, &w) in both.filter(|(v, w)| **w > 0.0 && !held[**v as usize]) {
                    let sum = &mut sums[v as usize];
                    *sum = (sum.0 - w * lack * normal, sum.1 + w);
                }
            }
            let steps = sums.iter().map(|(sum, weight)| match *weight > 0.0 {
                true => sum / *weight,
                false => Vec3::zeros(),
            });
            let steps: Vec<Vec3> = steps.collect();
            let most = steps.iter().map(Vec3::norm).fold(0.0, f64::max);
            if most <= ENOUGH * self.depth {
                break;
            }
            sunk.points
                .iter_mut()
                .zip(steps)
                .for_each(|(p, step)| *p += step);
        }
        (sunk != *mesh).then_some(sunk)
    }

    /// How much deeper a point must lie, mm, and the wall's normal, when it is flush.
    fn flush(&self, p: &Vec3, n: &Vec3) -> Option<(f64, Vec3)> {
        let nearest = self.bvh.nearest(p, self.depth.hypot(self.reach))?;
        let [a, b, c] = self.walls.corners(nearest.triangle as usize);
        let normal = (b - a).cross(&(c - a)).try_normalize(0.0)?;
        let away = p - nearest.point;
        let height = away.dot(&normal);
        let sideways = (away - normal * height).norm();
        let parallel = n.dot(&normal) > PARALLEL;
        let here = height.abs() < self.depth && sideways < self.reach && parallel;
        here.then_some((self.depth + height, normal))
    }
}

/// Unit normals of the points of a triangle mesh, by area.
fn normals(points: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let mut out = vec![Vec3::zeros(); points.len()];
    for t in triangles {
        let [a, b, c] = t.map(|v| points[v as usize]);
        let area = (b - a).cross(&(c - a));
        t.iter().for_each(|&v| out[v as usize] += area);
    }
    out.iter_mut()
        .for_each(|n| *n = n.try_normalize(0.0).unwrap_or_default());
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::{CUBOID, cuboid, cuboid_corners};
    use crate::spline::catmull_clark::limit_mesh;

    type Test = Result<(), Box<dyn std::error::Error>>;

    /// A rounded block of many quads, its upper side at about z = 3.
    fn block() -> Result<ControlMesh, SplineError> {
        let mut mesh = ControlMesh {
            points: cuboid_corners(Vec3::new(-20.0, -20.0, -3.0), Vec3::new(20.0, 20.0, 3.0)),
            quads: CUBOID.to_vec(),
        };
        for _ in 0..4 {
            let topology = crate::spline::half_edges::connect(&mesh)?;
            let (split, refined) = topology.split()?;
            mesh = ControlMesh {
                points: split.apply(&mesh.points),
                quads: refined.quads,
            };
        }
        Ok(mesh)
    }

    /// Height of the upper side at a place.
    fn height(mesh: &ControlMesh, x: f64) -> Result<f64, SplineError> {
        let (fine, _) = limit_mesh(mesh, 2)?;
        let away = |p: &Vec3| (p.x - x).hypot(p.y);
        let above = fine.points.iter().filter(|p| p.z > 0.0);
        let found = above.min_by(|a, b| away(a).total_cmp(&away(b)));
        Ok(found.map_or(f64::NAN, |p| p.z))
    }

    #[test]
    fn a_flush_surface_ends_below_the_wall_and_stays_elsewhere() -> Test {
        let mesh = block()?;
        let top = height(&mesh, 8.0)?;
        for off in [0.1, -0.1] {
            let lid = cuboid(Vec3::new(4.0, -3.0, -1.0), Vec3::new(11.0, 3.0, top + off));
            let sunk = sink_flush(&mesh, &lid, (0.3, 0.5), &PatchOptions::default())?;
            let sunk = sunk.ok_or("nothing sank")?;
            let below = top + off - height(&sunk, 8.0)?;
            assert!((0.27..0.4).contains(&below), "{below} mm below the wall");
            let moved = height(&sunk, -9.0)? - height(&mesh, -9.0)?;
            assert!(moved.abs() < 1e-9, "{moved} mm far from it");
        }
        Ok(())
    }

    #[test]
    fn nothing_sinks_below_walls_that_are_not_flush() -> Test {
        let mesh = block()?;
        let tall = cuboid(Vec3::new(4.0, -3.0, -6.0), Vec3::new(11.0, 3.0, 6.0));
        let options = PatchOptions::default();
        assert_eq!(sink_flush(&mesh, &tall, (0.3, 0.5), &options)?, None);
        assert_eq!(
            sink_flush(&mesh, &TriMesh::default(), (0.3, 0.5), &options)?,
            None
        );
        Ok(())
    }
}
