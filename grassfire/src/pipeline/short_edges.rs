//! Unions without short edges and needles: the body sinks below walls that it is flush with, the borders of its faces slide away.

use super::construct::Site;
use super::error::{PipelineError, StageError};
use super::shape::{self, Shape, Surface};
use super::union::{self, Joined};
use crate::fit::leaned;
use crate::spline::{Crowded, sink_flush, slide_borders};

/// Times that borders are slid.
const ROUNDS: usize = 3;
/// A border that is in the way slides this many times the least edge away.
const ROOM: f64 = 2.0;

/// Edges shorter than this share of the least one are worth another union.
const MUCH_SHORTER: f64 = 1.0 / 3.0;
/// The body sinks below walls up to this many times the depth beside them.
const SIDEWAYS: f64 = 3.0;

/// Length of the shortest edge: infinite when none is too short, 0 when there is no union.
fn length(short: Option<&[Crowded]>) -> f64 {
    short.map_or(0.0, |edges| {
        edges.first().map_or(f64::INFINITY, |e| e.length)
    })
}

impl Site<'_> {
    /// [`Site::joined`] for the body sunk below walls that it is nearly flush with; where that leaves very short edges also for
    /// the body as it is, and the one whose shortest edge is longer is kept. Where the proposal got draft, the walls of both lean.
    pub(super) fn joined_below(
        &mut self,
        shape: &mut Shape,
    ) -> Result<(Surface, Joined), PipelineError> {
        let (options, walls) = (self.options, &self.bodies.bosses.surface);
        let depth = options.cad.sink * self.remeshed.field.spacing;
        let sunk = self.record.stage("spline", || {
            let lengths = (depth, SIDEWAYS * depth);
            sink_flush(&shape.fitted.mesh, walls, lengths, &options.patches)
        })?;
        let Some(mesh) = sunk else {
            self.lean(shape)?;
            let surface = self.surface(shape)?;
            let (surface, joined, _) = self.joined(shape, surface)?;
            return Ok((surface, joined));
        };
        let mut deeper = shape.clone();
        deeper.fitted.mesh = mesh;
        self.lean(&mut deeper)?;
        let surface = self.surface(&deeper)?;
        let (surface, joined, shortest) = self.joined(&mut deeper, surface)?;
        if shortest < MUCH_SHORTER * options.cad.least_edge * self.remeshed.field.spacing {
            self.lean(shape)?;
            let plain = self.surface(shape)?;
            let plain = self.joined(shape, plain)?;
            if plain.2 > shortest {
                return Ok((plain.0, plain.1));
            }
            self.deliver_surface(&deeper, &surface)?;
        }
        *shape = deeper;
        Ok((surface, joined))
    }

    /// Makes upright walls lean as those of the proposal do, where it was repaired for a mould.
    pub(super) fn lean(&mut self, shape: &mut Shape) -> Result<(), PipelineError> {
        let (options, field) = (self.options, &self.remeshed.field);
        let Some(draw) = options.mould.leans() else {
            return Ok(());
        };
        let along = (field, &draw, &self.bodies.bosses);
        let fitted = &shape.fitted;
        let turned = self
            .record
            .stage("fit", || leaned(fitted, along, &options.fit, self.monitor))?;
        if let Some(mesh) = turned {
            shape.fitted.mesh = mesh;
        }
        Ok(())
    }

    /// Puts the non-design bodies to the body. While the union has edges shorter than `cad.least_edge`, where meshes of the
    /// part would have flat elements, the borders of the body's faces slide away from them and it is made again; the last
    /// union whose shortest edge became longer is kept, with its body and surface. The length of its shortest edge is
    /// infinite when none is too short, and 0 when there is no union.
    pub(super) fn joined(
        &mut self,
        shape: &mut Shape,
        mut surface: Surface,
    ) -> Result<(Surface, Joined, f64), PipelineError> {
        let (options, monitor) = (self.options, self.monitor);
        let voxel = self.remeshed.field.spacing;
        let least = options.cad.least_edge * voxel;
        let (mut joined, short) = self.union(&surface, least)?;
        let mut least_length = length(short.as_deref());
        let mut short = short.unwrap_or_default();
        let mut better = false;
        for _ in 0..ROUNDS {
            if short.is_empty() {
                break;
            }
            let how = (&options.patches, &options.brep);
            let slid = self.record.stage("spline", || {
                slide_borders(&shape.fitted.mesh, how, &short, ROOM * least, monitor)
            })?;
            let Some(mesh) = slid else { break };
            let next = self
                .record
                .stage("spline", || shape::surface(&mesh, voxel, options, monitor))?;
            let (union, left) = self.union(&next, least)?;
            let now = length(left.as_deref());
            if now <= least_length {
                break;
            }
            better = true;
            least_length = now;
            shape.fitted.mesh = mesh;
            (surface, joined, short) = (next, union, left.unwrap_or_default());
        }
        if better {
            self.deliver_surface(shape, &surface)?;
        }
        Ok((surface, joined, least_length))
    }

    /// The union and its edges shorter than `least` mm, `None` when it failed.
    fn union(
        &mut self,
        surface: &Surface,
        least: f64,
    ) -> Result<(Joined, Option<Vec<Crowded>>), PipelineError> {
        let (options, monitor, bodies) = (self.options, self.monitor, &*self.bodies);
        self.record.stage("cad", || {
            let joined = union::join(surface, bodies, options, monitor)?;
            let short = joined.short_edges(least)?;
            Ok::<_, StageError>((joined, short))
        })
    }
}
