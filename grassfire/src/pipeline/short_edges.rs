//! Unions without short edges: the borders of the body's faces slide away from them.

use super::construct::Site;
use super::error::{PipelineError, StageError};
use super::shape::{self, Shape, Surface};
use super::union::{self, Joined};
use crate::spline::{Crowded, slide_borders};

/// Times that borders are slid.
const ROUNDS: usize = 3;
/// A border that is in the way slides this many times the least edge away.
const ROOM: f64 = 2.0;

impl Site<'_> {
    /// Puts the non-design bodies to the body. While the union has edges shorter than `cad.least_edge`, where meshes of the
    /// part would have flat elements, the borders of the body's faces slide away from them and it is made again; the last
    /// union whose shortest edge became longer is kept, with its body and surface.
    pub(super) fn joined(
        &mut self,
        shape: &mut Shape,
        mut surface: Surface,
    ) -> Result<(Surface, Joined), PipelineError> {
        let (options, monitor) = (self.options, self.monitor);
        let voxel = self.remeshed.field.spacing;
        let least = options.cad.least_edge * voxel;
        let (mut joined, mut short) = self.union(&surface, least)?;
        let mut better = false;
        for _ in 0..ROUNDS {
            let Some(crowded) = short.as_ref().filter(|edges| !edges.is_empty()) else {
                break;
            };
            let how = (&options.patches, &options.brep);
            let slid = self.record.stage("spline", || {
                slide_borders(&shape.fitted.mesh, how, crowded, ROOM * least, monitor)
            })?;
            let Some(mesh) = slid else { break };
            let next = self
                .record
                .stage("spline", || shape::surface(&mesh, voxel, options, monitor))?;
            let (union, left) = self.union(&next, least)?;
            let Some(left) = left else { break };
            let longer = left.first().map_or(least, |edge| edge.length);
            if longer <= crowded[0].length {
                break;
            }
            better = true;
            shape.fitted.mesh = mesh;
            (surface, joined, short) = (next, union, Some(left));
        }
        if better {
            self.deliver_surface(shape, &surface)?;
        }
        Ok((surface, joined))
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
