//! Upright walls of a body that leaves a mould lean inwards away from the parting, and pass what would shade them: neither a wave of
//! a fit nor the edge of a non-design body overhangs.

use std::collections::BTreeMap;

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::guard::guarded_step;
use super::round::Solver;
use super::shade::{Gaps, Pushes, Shade};
use super::surface::Surface;
use super::tangles::Tangles;
use super::targets::{IsoSamples, flow_to_surface};
use super::{FitError, FitOptions, Fitted, STAGE};
use crate::Vec3;
use crate::mesh::Winding;
use crate::monitor::Monitor;
use crate::remesh::Bosses;
use crate::spline::ControlMesh;
use crate::voxel::VoxelGrid;

/// Rounds, at most.
const ROUNDS: u32 = 12;
/// Rounds that bring nothing before it ends.
const PATIENCE: u32 = 3;
/// Lean asked for: the sine of half a degree.
const LEAN: f64 = 0.0087;
/// What is steeper than this in the proposal cannot overhang by waves.
const UPRIGHT: f64 = 0.35;
/// The proposal itself overhangs by more: a core's or a non-design body's work.
const OVERHANG: f64 = -0.05;
/// Normals of body and proposal with less than this cosine belong to two walls.
const AGREE: f64 = 0.5;
/// Half of the way along the draw direction over which the proposal tells where its mould parts, voxels.
const REACH: f64 = 3.0;
/// A wall that leans wrongly by an angle weighs as much as control points that move by this many voxels times the angle, at first.
const WEIGHT: f64 = 20.0;
/// Weight of a place beside a gap, a voxel away from where it must be, at first.
const PUSH: f64 = 4.0;
/// Growth of both in a round.
const GROWTH: f64 = 1.1;
/// Weight of bending what is added, against moving it.
const FAIRNESS: f64 = 1.0;
/// A control point moves by at most this, voxels.
const MOST: f64 = 1.5;

/// A piece of an upright wall.
struct Piece {
    /// Quad of the samples.
    quad: usize,
    /// 1 where the wall must look along the draw direction, -1 where against it.
    side: f64,
    /// Component of its normal along that.
    lean: f64,
    area: f64,
}

/// The control mesh of a fitted body with upright walls that do not overhang along the unit vector `draw`; none where none does.
///
/// 1. Pieces of upright walls (16 a quad) know from the proposal on which side of the parting they lie: along the draw direction its
///    field falls away from the parting. Pieces that overhang in the proposal, too, or lie hidden in `bosses` are left alone.
/// 2. Rounds turn the pieces that lean inwards by less than half a degree (linearised, with a weight that grows), by the least
///    further move of control points at the same volume, bent as little as possible. At the same time the body's side moves out past
///    every gap between material along the draw direction (lines a quarter of a voxel apart, through body and `bosses`)
///    which the proposal does not have, or a film that stands over it moves in. Steps are shortened where they would create an
///    intersection or a fold.
/// 3. The round that leaves the least overhang and gaps is kept.
///
/// `field` is the signed distance to the proposal, mm, positive inside.
///
/// # Errors
/// A mesh that cannot be subdivided, a system that cannot be factorised; cancelled.
pub fn leaned(
    fitted: &Fitted,
    (field, draw, bosses): (&VoxelGrid<f32>, &Vec3, &Bosses),
    options: &FitOptions,
    monitor: &Monitor,
) -> Result<Option<ControlMesh>, FitError> {
    let (surface, iso) = (Surface::new(&fitted.body, field)?, IsoSamples::default());
    let options = FitOptions {
        // Steps may come as near to a fold as the limit itself: places beside walls are stuck otherwise.
        fold_limit: options.fold_limit / 2.0,
        ..*options
    };
    let mut solver = Solver::new(surface, field, &iso, &options)?;
    let start: Vec<Vec3> = fitted
        .mesh
        .points
        .iter()
        .map(|p| field.to_grid(p))
        .collect();
    solver.volume = Some(solver.surface.volume(&start));
    let shade = Shade::new(field, draw, bosses);
    let mut pushes = Pushes::default();
    let mut now = solver.look(&start, &shade);
    let mut least = now.left();
    let mut found = Tangles::of(&solver, &start);
    let (mut here, mut best) = (start.clone(), None);
    let (mut weights, mut idle) = ([WEIGHT, PUSH], 0);
    for round in 0..ROUNDS {
        if least <= 0.0 || idle == PATIENCE {
            break;
        }
        let part = f64::from(round) / f64::from(ROUNDS);
        monitor.step(STAGE, "upright walls", part)?;
        pushes.renew(&now.gaps);
        let wanted = solver
            .turned(&start, &here, (&now, &pushes), draw, weights)
            .map_err(|reason| FitError::Solver { round, reason })?;
        let Some(step) = guarded_step(&mut solver, &here, &wanted, &found) else {
            break;
        };
        (here, found) = step;
        now = solver.look(&here, &shade);
        weights = weights.map(|weight| weight * GROWTH);
        idle += 1;
        if now.left() < least {
            (least, idle) = (now.left(), 0);
            best = Some(here.clone());
        }
    }
    Ok(best.map(|points| solver.surface.control_mesh(&points)))
}

/// What is wrong with a body.
struct Looked {
    /// Its samples, voxels.
    at: Vec<Vec3>,
    /// Pieces of upright walls.
    pieces: Vec<Piece>,
    gaps: Gaps,
}

impl Looked {
    /// What is left, squared voxels: area times lean of what overhangs, and the area of gaps as seen along the draw direction.
    fn left(&self) -> f64 {
        let overhang = self.pieces.iter().map(|p| p.area * (-p.lean).max(0.0));
        overhang.sum::<f64>() + self.gaps.area
    }
}

impl Solver<'_> {
    fn look(&self, points: &[Vec3], shade: &Shade) -> Looked {
        let at = self.surface.samples.apply(points);
        Looked {
            pieces: self.upright(&at, shade),
            gaps: shade.gaps(&self.surface.triangle_mesh(at.clone())),
            at,
        }
    }

    /// The pieces of upright walls.
    fn upright(&self, at: &[Vec3], shade: &Shade) -> Vec<Piece> {
        let (quads, draw) = (&self.surface.fine.quads, shade.draw());
        let hidden = Winding::new(&shade.walls);
        let piece = |quad: usize| {
            let [a, b, c, d] = quads[quad].map(|v| at[v as usize]);
            let across = (c - a).cross(&(d - b)) / 2.0;
            let area = across.norm();
            let normal = across.try_normalize(1e-12)?;
            let middle = (a + b + c + d) / 4.0;
            let (place, outward) = flow_to_surface(self.field, &middle, 6);
            let side = self.side(&place, draw)?;
            let (steep, lean) = (side * outward.dot(draw), side * normal.dot(draw));
            let wall = steep < UPRIGHT && steep > OVERHANG && outward.dot(&normal) > AGREE;
            (wall && hidden.at(&middle) < 0.5).then_some(Piece {
                quad,
                side,
                lean,
                area,
            })
        };
        (0..quads.len())
            .into_par_iter()
            .with_min_len(512)
            .filter_map(piece)
            .collect()
    }

    /// On which side of the parting a place of the proposal's surface lies.
    fn side(&self, place: &Vec3, draw: &Vec3) -> Option<f64> {
        let value = |way: f64| {
            let p = place + way * REACH * draw;
            let at = self.field.to_mm(&p);
            self.field.sample(&at)
        };
        let falls = value(-1.0) - value(1.0);
        (falls != 0.0).then(|| falls.signum())
    }

    /// Control points whose walls lean: those of `here`, moved as little as may be, and at most [`MOST`] away from `start`.
    fn turned(
        &mut self,
        start: &[Vec3],
        here: &[Vec3],
        (now, pushes): (&Looked, &Pushes),
        draw: &Vec3,
        [turning, pushing]: [f64; 2],
    ) -> Result<Vec<Vec3>, String> {
        let (normals, areas) = self.surface.normals_and_areas(&now.at);
        let mean_area = areas.iter().sum::<f64>() / here.len().max(1) as f64;
        self.equations.clear();
        for (p, place) in here.iter().enumerate() {
            self.equations.pin(p as u32, mean_area, place);
            let (indices, weights) = self.surface.bending.row(p);
            let block = FAIRNESS * mean_area * Matrix3::identity();
            let bent = self.surface.bending.apply_row(p, here);
            self.equations
                .add(indices, weights, &block, &(block * bent));
        }
        for piece in now.pieces.iter().filter(|piece| piece.lean < LEAN) {
            self.add_turn(piece, here, &now.at, (draw, turning));
        }
        self.add_pushes(pushes, &now.at, pushing);
        let mut points = self.solution(&normals, &areas)?;
        for (p, from) in points.iter_mut().zip(start) {
            let way = *p - from;
            *p = from + way * (MOST / way.norm().max(1e-9)).min(1.0);
        }
        Ok(points)
    }

    /// The row that turns a piece of a wall.
    fn add_turn(
        &mut self,
        piece: &Piece,
        points: &[Vec3],
        at: &[Vec3],
        (draw, weight): (&Vec3, f64),
    ) {
        let corners = self.surface.fine.quads[piece.quad];
        let [a, b, c, d] = corners.map(|v| at[v as usize]);
        // How the component of the normal along the draw direction changes with the corners.
        let scale = piece.side / (2.0 * piece.area);
        let along_c = scale * (d - b).cross(draw);
        let along_d = scale * draw.cross(&(c - a));
        let change = [-along_c, -along_d, along_c, along_d];
        let row = self.row_of(&corners, |k, w| w * change[k]);
        let here: f64 = row.iter().map(|(p, w)| w.dot(&points[*p as usize])).sum();
        let wanted = here + LEAN - piece.lean;
        self.equations
            .add_row(&row, weight * weight * piece.area, wanted);
    }

    /// The row, over control points, of a sum over samples: `share` gives what the control point that has weight `w` in sample `k`
    /// adds.
    pub(super) fn row_of(
        &self,
        samples: &[u32],
        share: impl Fn(usize, f64) -> Vec3,
    ) -> Vec<(u32, Vec3)> {
        let mut row: BTreeMap<u32, Vec3> = BTreeMap::new();
        for (k, sample) in samples.iter().enumerate() {
            let (controls, weights) = self.surface.samples.row(*sample as usize);
            for (p, w) in controls.iter().zip(weights) {
                *row.entry(*p).or_default() += share(k, *w);
            }
        }
        row.into_iter().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::{CUBOID, cuboid_corners};
    use crate::spline::catmull_clark::{QuadTopology, limit_mesh};
    use crate::thicken::ThickenedBody;

    /// A block of 18 x 18 x 18 mm whose walls wave along z, up to 4 degrees off.
    fn wavy_block() -> ControlMesh {
        let mut mesh = ControlMesh {
            points: cuboid_corners(Vec3::repeat(-10.0), Vec3::repeat(10.0)),
            quads: CUBOID.to_vec(),
        };
        for _ in 0..3 {
            let topology = QuadTopology::new(mesh.points.len(), &mesh.quads).expect("closed");
            let (operator, refined) = topology.split().expect("closed");
            mesh.points = operator.apply(&mesh.points);
            mesh.quads = refined.quads;
        }
        for p in &mut mesh.points {
            // Splits round a block off: back onto its faces.
            *p *= 9.0 / p.amax();
            let out = 1.0 + 0.015 * (0.6 * p.z).sin();
            (p.x, p.y) = (p.x * out, p.y * out);
        }
        mesh
    }

    /// Signed distance to a block of 17 x 17 x 18 mm with draft of 0.02 from its middle height, about.
    fn drafted() -> VoxelGrid<f32> {
        let mut field = VoxelGrid::filled(Vec3::repeat(-13.0), 0.5, [53, 53, 53], 0.0_f32);
        for v in 0..field.values.len() {
            let [i, j, k] = field.ijk(v);
            let p = field.origin + 0.5 * Vec3::new(i as f64, j as f64, k as f64);
            let wide = 8.5 - 0.02 * p.z.abs();
            let inside = (wide - p.x.abs())
                .min(wide - p.y.abs())
                .min(9.0 - p.z.abs());
            field.values[v] = inside as f32;
        }
        field
    }

    /// Area of upright walls that overhang by more than a twentieth of a degree, mm2.
    fn overhanging(mesh: &ControlMesh) -> f64 {
        let (fine, _) = limit_mesh(mesh, 3).expect("closed");
        let all = (0..fine.triangles.len()).map(|t| {
            let [a, b, c] = fine.corners(t);
            let (normal, z) = ((b - a).cross(&(c - a)) / 2.0, (a.z + b.z + c.z) / 3.0);
            let lean = z.signum() * normal.z / normal.norm();
            // Near the parting the sides of one triangle are both right.
            let wrong = lean < -1e-3 && z.abs() > 0.5 && z.abs() < 7.0;
            f64::from(u8::from(wrong)) * normal.norm()
        });
        all.sum()
    }

    #[test]
    fn waves_of_upright_walls_do_not_overhang_any_more() {
        let (mesh, field) = (wavy_block(), drafted());
        let fitted = |mesh: &ControlMesh| Fitted {
            mesh: mesh.clone(),
            body: ThickenedBody {
                mesh: mesh.clone(),
                ..ThickenedBody::default()
            },
            ..Fitted::default()
        };
        let (options, monitor) = (FitOptions::default(), Monitor::default());
        let (z, bosses) = (Vec3::z(), Bosses::default());
        let along = (&field, &z, &bosses);
        let turned = leaned(&fitted(&mesh), along, &options, &monitor).expect("it can be solved");
        let turned = turned.expect("walls overhang");
        let (before, after) = (overhanging(&mesh), overhanging(&turned));
        assert!(before > 100.0, "{before} mm2 before");
        assert!(after < 0.01 * before, "{after} of {before} mm2");
        let moves = mesh.points.iter().zip(&turned.points);
        let most = moves.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        assert!(most < 0.5, "moved by {most} mm");
        let again = leaned(&fitted(&turned), along, &options, &monitor).expect("it can be solved");
        let left = again.map_or(after, |mesh| overhanging(&mesh));
        assert!(left <= after, "{left} of {after} mm2");
    }
}
