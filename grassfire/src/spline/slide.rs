//! Slides borders of faces along the surface, out of the way of curves that a union draws on it.

use super::brep::{border_lines, vertices};
use super::coarsen::{folds, surface};
use super::half_edges::{QuadTopology, connect};
use super::quality::side_parameters;
use super::stencils::Stencils;
use super::{
    BrepOptions, ControlMesh, Patch, PatchOptions, SplineError, SurfacePoint, evaluate, patches,
};
use crate::Vec3;
use crate::mesh::self_intersection::self_intersections;
use crate::monitor::Monitor;

/// A place where something lies too close to a border of faces: the middle of a short edge of a union.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crowded {
    /// Where, mm.
    pub place: Vec3,
    /// Length of the edge, mm.
    pub length: f64,
}

/// Largest move of a border point, as a share of the shortest quad edge there: no quad may fold.
const LARGEST_MOVE: f64 = 0.2;
/// A border ends at a short edge when it passes its middle within this share of its length.
const AT_EDGE: f64 = 0.75;
/// Points looked at on each Bezier curve of a border.
const SAMPLES: usize = 64;

/// Slides borders of faces along the surface until they are `room` mm from crowded places; `None` where none can move.
///
/// 1. A corner of faces within `room` of a place moves straight away from it: the borders that meet in it then cross the
///    union's curve farther apart.
/// 2. Where no corner is near, every border that ends at the short edge moves away from its middle.
/// 3. Moves lie in the tangent plane and are at most a fifth of the shortest quad edge there. The control points follow
///    with the least change that moves the limit point so far, each in its own tangent plane. The surface itself moves by
///    about a tenth of that where quads are half as long as the radius of curvature, less on flatter places.
/// 4. A surface that cuts itself or folds more than before is refused.
///
/// # Errors
/// As for [`super::patches`].
pub fn slide_borders(
    mesh: &ControlMesh,
    options: (&PatchOptions, &BrepOptions),
    crowded: &[Crowded],
    room: f64,
    monitor: &Monitor,
) -> Result<Option<ControlMesh>, SplineError> {
    let topology = connect(mesh)?;
    let cut = border_lines(mesh, &topology, options.1)?;
    let [first, second] = topology.limit_tangents().map(|t| t.apply(&mesh.points));
    let normal = |(a, b): (&Vec3, &Vec3)| a.cross(b).try_normalize(0.0).unwrap_or_default();
    let slider = Slider {
        normals: first.iter().zip(&second).map(normal).collect(),
        limit: topology.limit_positions(),
        corners: vertices(&topology, &cut),
        patches: patches(mesh, options.0, monitor)?,
        mesh,
        cut,
        topology,
        room,
    };
    let mut slid = mesh.clone();
    let mut moved = false;
    for place in crowded {
        let moves = match slider.corner(place) {
            Some(step) => vec![step],
            None => slider.borders(place),
        };
        for step in moves {
            moved |= slider.apply(&step, &mut slid.points);
        }
    }
    let faults = |mesh: &ControlMesh| {
        let crossings = self_intersections(&surface(mesh)?).len();
        Ok::<_, SplineError>((crossings, folds(mesh, options.0)?))
    };
    if !moved {
        return Ok(None);
    }
    let (before, after) = (faults(mesh)?, faults(&slid)?);
    let sound = after.0 <= before.0 && after.1 <= before.1;
    Ok(sound.then_some(slid))
}

/// A point of a border, between two mesh points, and where it should go.
struct Move {
    ends: [u32; 2],
    /// Share of the second end.
    share: f64,
    by: Vec3,
}

struct Slider<'a> {
    mesh: &'a ControlMesh,
    patches: Vec<Patch>,
    topology: QuadTopology,
    /// Half-edges on borders.
    cut: Vec<bool>,
    /// Mesh points where borders end or meet.
    corners: Vec<u32>,
    limit: Stencils,
    /// Unit normals of the limit surface at the mesh points.
    normals: Vec<Vec3>,
    room: f64,
}

impl Slider<'_> {
    /// The move of the nearest corner of faces, when one is near.
    fn corner(&self, crowded: &Crowded) -> Option<Move> {
        let from = |v: u32| self.limit.apply_row(v as usize, &self.mesh.points) - crowded.place;
        let away = self.corners.iter().map(|&v| (from(v).norm(), v));
        let (distance, v) = away.min_by(|a, b| a.0.total_cmp(&b.0))?;
        if distance >= self.room {
            return None;
        }
        let h = self.topology.outgoing[v as usize];
        let by = self.tangential(h, 0.0, &from(v))? * (self.room - distance);
        let ends = [v, v];
        Some(Move {
            ends,
            share: 0.0,
            by,
        })
    }

    /// The moves of all borders that end at a short edge.
    fn borders(&self, crowded: &Crowded) -> Vec<Move> {
        let reach = AT_EDGE * crowded.length + 1e-3;
        let mut moves = Vec::new();
        for h in 0..self.topology.len() {
            if !self.cut[h as usize] || self.topology.twin[h as usize] < h {
                continue;
            }
            if self.chord(h, &crowded.place) > reach.max(self.room) {
                continue;
            }
            let (distance, t) = self.nearest(h, &crowded.place);
            if distance > reach || distance >= self.room {
                continue;
            }
            let from = self.at(h, t).position - crowded.place;
            if let Some(direction) = self.tangential(h, t, &from) {
                let ends = [self.topology.origin(h), self.topology.head(h)];
                moves.push(Move {
                    ends,
                    share: t,
                    by: direction * (0.5 * self.room - distance).max(0.0),
                });
            }
        }
        moves
    }

    /// Half-edge `h` of the surface at parameter `t`.
    fn at(&self, h: u32, t: f64) -> SurfacePoint {
        let [u, v] = side_parameters(h, t);
        evaluate(&self.patches[(h / 4) as usize], u, v)
    }

    /// How far a place is from half-edge `h` at least, roughly.
    fn chord(&self, h: u32, place: &Vec3) -> f64 {
        let [a, b] = [self.topology.origin(h), self.topology.head(h)]
            .map(|v| self.limit.apply_row(v as usize, &self.mesh.points));
        ((a + b) / 2.0 - place).norm() - (b - a).norm()
    }

    /// Distance of half-edge `h` of the surface from `place`, and the parameter there.
    fn nearest(&self, h: u32, place: &Vec3) -> (f64, f64) {
        let away = |t: f64| (self.at(h, t).position - place).norm();
        let samples = (0..=SAMPLES).map(|k| k as f64 / SAMPLES as f64);
        let best = samples.min_by(|a, b| away(*a).total_cmp(&away(*b)));
        let (best, step) = (best.unwrap_or(0.0), 1.0 / SAMPLES as f64);
        let (mut lo, mut hi) = ((best - step).max(0.0), (best + step).min(1.0));
        for _ in 0..SAMPLES / 2 {
            let third = (hi - lo) / 3.0;
            if away(lo + third) < away(hi - third) {
                hi -= third;
            } else {
                lo += third;
            }
        }
        let t = 0.5 * (lo + hi);
        (away(t), t)
    }

    /// Unit vector of the part of `from` in the tangent plane at parameter `t` of half-edge `h`.
    fn tangential(&self, h: u32, t: f64, from: &Vec3) -> Option<Vec3> {
        let normal = self.at(h, t).normal;
        (from - normal * normal.dot(from)).try_normalize(1e-9)
    }

    /// Moves the limit point with the least change of control points; false when there is nothing to move.
    fn apply(&self, step: &Move, points: &mut [Vec3]) -> bool {
        let shortest = step
            .ends
            .iter()
            .flat_map(|&v| {
                self.topology
                    .ring(v)
                    .map(move |h| (v, self.topology.head(h)))
            })
            .map(|(v, w)| (self.mesh.points[v as usize] - self.mesh.points[w as usize]).norm())
            .fold(f64::INFINITY, f64::min);
        let length = step.by.norm();
        if length.is_nan() || length <= 0.0 {
            return false;
        }
        let by = step.by * (LARGEST_MOVE * shortest / length).min(1.0);
        let mut mask = Stencils::new(points.len());
        let mut entries = Vec::new();
        for (&v, share) in step.ends.iter().zip([1.0 - step.share, step.share]) {
            let (indices, weights) = self.limit.row(v as usize);
            entries.extend(indices.iter().zip(weights).map(|(&i, &w)| (i, share * w)));
        }
        mask.push(&mut entries);
        let (indices, weights) = mask.row(0);
        let squares: f64 = weights.iter().map(|w| w * w).sum();
        for (&i, &w) in indices.iter().zip(weights) {
            // Each in its own tangent plane: else a curved surface would rise on one side and sink on the other.
            let normal = self.normals[i as usize];
            points[i as usize] += (by - normal * normal.dot(&by)) * (w / squares);
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::{CUBOID, cuboid_corners};

    type Test = Result<(), Box<dyn std::error::Error>>;

    /// A round body of 96 quads, about 20 mm across, with eight extraordinary points.
    fn ball() -> Result<ControlMesh, SplineError> {
        let mut mesh = ControlMesh {
            points: cuboid_corners(Vec3::repeat(-15.0), Vec3::repeat(15.0)),
            quads: CUBOID.to_vec(),
        };
        for _ in 0..2 {
            let (split, refined) = connect(&mesh)?.split()?;
            mesh = ControlMesh {
                points: split.apply(&mesh.points),
                quads: refined.quads,
            };
        }
        Ok(mesh)
    }

    fn slide(
        mesh: &ControlMesh,
        crowded: Crowded,
        room: f64,
    ) -> Result<Option<ControlMesh>, SplineError> {
        let options = (&PatchOptions::default(), &BrepOptions::default());
        slide_borders(mesh, options, &[crowded], room, &Monitor::default())
    }

    /// Largest distance of the limit points of one mesh from the limit surface of another.
    fn deviation(from: &ControlMesh, to: &ControlMesh) -> Result<f64, SplineError> {
        let tree_mesh = surface(to)?;
        let tree = crate::mesh::Bvh::new(&tree_mesh);
        let away = |p: &Vec3| tree.nearest(p, 10.0).map_or(10.0, |n| n.distance);
        Ok(surface(from)?.points.iter().map(away).fold(0.0, f64::max))
    }

    #[test]
    fn corners_of_faces_leave_crowded_places_and_the_surface_stays() -> Test {
        let mesh = ball()?;
        let topology = connect(&mesh)?;
        let corner = topology
            .valence
            .iter()
            .position(|n| *n == 3)
            .ok_or("no corner")?;
        let limit = topology.limit_positions();
        let before = limit.apply_row(corner, &mesh.points);
        let aside = before.cross(&Vec3::z()).normalize();
        let place = before + 0.05 * aside;
        let slid = slide(&mesh, Crowded { place, length: 0.1 }, 0.5)?.ok_or("nothing moved")?;
        let after = limit.apply_row(corner, &slid.points);
        let moved = (before - after).dot(&aside);
        assert!((moved - 0.45).abs() < 0.02, "moved {moved} mm");
        let change = deviation(&slid, &mesh)?.max(deviation(&mesh, &slid)?);
        // Quads as long as half the radius of the ball are about the worst case.
        assert!(change < 0.15 * moved, "the surface moved {change} mm");
        Ok(())
    }

    #[test]
    fn borders_leave_crowded_places_where_no_corner_is_near() -> Test {
        let mesh = ball()?;
        let patches = patches(&mesh, &PatchOptions::default(), &Monitor::default())?;
        let topology = connect(&mesh)?;
        let cut = border_lines(&mesh, &topology, &BrepOptions::default())?;
        let h = (0..topology.len())
            .find(|&h| cut[h as usize])
            .ok_or("no border")?;
        let [u, v] = side_parameters(h, 0.5);
        let middle = evaluate(&patches[(h / 4) as usize], u, v);
        let [u, v] = side_parameters(h, 0.51);
        let along = evaluate(&patches[(h / 4) as usize], u, v).position - middle.position;
        let place = middle.position + 0.03 * middle.normal.cross(&along).normalize();
        let slid = slide(&mesh, Crowded { place, length: 0.1 }, 0.6)?.ok_or("nothing moved")?;
        let patches = super::patches(&slid, &PatchOptions::default(), &Monitor::default())?;
        let nearest = (0..=100).map(|k| {
            let [u, v] = side_parameters(h, f64::from(k) / 100.0);
            (evaluate(&patches[(h / 4) as usize], u, v).position - place).norm()
        });
        let nearest = nearest.fold(f64::MAX, f64::min);
        assert!(nearest > 0.2, "the border passes at {nearest} mm");
        let change = deviation(&slid, &mesh)?;
        assert!(change < 0.15 * 0.3, "the surface moved {change} mm");
        Ok(())
    }

    #[test]
    fn nothing_moves_for_places_that_no_border_is_near() -> Test {
        let place = Vec3::zeros();
        assert_eq!(slide(&ball()?, Crowded { place, length: 0.1 }, 0.5)?, None);
        Ok(())
    }
}
