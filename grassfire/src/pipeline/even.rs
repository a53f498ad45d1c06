//! The proposal that grows towards the feeders, evened out where balls of its medial axis count, too (`feed.on = medial`).

use super::ReconstructOptions;
use super::bodies::Bodies;
use super::error::StageError;
use super::feeding::{cells, contacts};
use super::follow::{self, Balls, Growth};
use super::shape::{Base, Shape};
use crate::casting::feed::{Fed, FeedError, FeedGraph, FeedOn, FeedOptions, feed_graph};
use crate::edit::interpolate;
use crate::medial::{self, MedialMesh};
use crate::mesh::Bvh;
use crate::monitor::Monitor;
use crate::remesh::Remeshed;
use crate::skeleton::Skeleton;

/// Most rounds: what has grown has balls of its own.
const ROUNDS: usize = 3;
/// Balls that lack less than this many voxels are large enough.
const ENOUGH: f64 = 0.25;

/// Passes of smoothing that take the lattice's noise out of medial radii: every bump would be carried to the feeder.
const SMOOTHING: usize = 4;

/// What grows.
pub(super) struct Site<'a> {
    pub(super) shape: &'a Shape,
    pub(super) base: &'a Base<'a>,
    pub(super) whole: &'a Remeshed,
    pub(super) bodies: &'a Bodies,
    pub(super) options: &'a ReconstructOptions,
}

/// What has grown.
pub(super) struct Grown {
    /// The skeleton's radii, among them what balls asked for.
    pub(super) fed: Fed,
    /// The growth of the field.
    pub(super) growth: Growth,
    /// The whole proposal with it.
    pub(super) solid: Remeshed,
}

/// The proposal with the growth of `least`, the radii that the shape's skeleton asks for; none where gaps close.
///
/// On the medial axis, in rounds:
/// 1. The least radii of the balls of what has grown so far: those of junctions count there, which the skeleton does not know, and
///    waves of the surface that are shorter than its quads.
/// 2. The field grows around every ball by what it lacks. Where gaps would close then, the round before stands.
/// 3. The skeleton's radii take up what grew around them, and are fed again `on_skeleton`.
///
/// # Errors
/// As [`medial::medial_axis`], [`feed_graph`] and [`follow::reference`].
pub(super) fn grown(
    site: &Site,
    least: Fed,
    on: FeedOn,
    on_skeleton: impl Fn(&Skeleton) -> Result<Fed, FeedError>,
    monitor: &Monitor,
) -> Result<Option<Grown>, StageError> {
    let before = &site.shape.skeleton.skeleton;
    let mut taken_up = vec![0.0; before.points.len()];
    let mut out: Option<Grown> = None;
    let mut fed = least.clone();
    let mut balls: Vec<Balls> = Vec::new();
    for round in 0..=ROUNDS {
        let radii = fed.radii.iter().zip(&before.radii);
        let skeleton = radii.zip(&taken_up).map(|((r, b), t)| r - b - t);
        let growth = Growth {
            skeleton: skeleton.collect(),
            balls: balls.clone(),
        };
        let solid = site.solid(&growth, monitor)?;
        if !follow::same_topology(&solid, site.whole) {
            break;
        }
        let lacking = if on == FeedOn::Medial && round < ROUNDS {
            lacking(&solid, site.bodies, site.options, monitor)?
        } else {
            None
        };
        out = Some(Grown { fed, growth, solid });
        let Some(lacking) = lacking else { break };
        let places = Bvh::new(&lacking.cells);
        for (p, taken) in before.points.iter().zip(&mut taken_up) {
            *taken += lacking.at(&places, p);
        }
        let radii = least.radii.iter().zip(&taken_up);
        let raised = Skeleton {
            radii: radii.map(|(r, t)| r + t).collect(),
            ..before.clone()
        };
        let again = on_skeleton(&raised)?;
        fed = Fed {
            added_volume: again.volume_before + again.added_volume - least.volume_before,
            volume_before: least.volume_before,
            violations_before: least.violations_before,
            ..again
        };
        balls.push(lacking);
    }
    Ok(out)
}

impl Site<'_> {
    fn solid(&self, growth: &Growth, monitor: &Monitor) -> Result<Remeshed, StageError> {
        let target = follow::target(self.base, self.shape, growth);
        let (whole, shape, bodies, options) = (self.whole, self.shape, self.bodies, self.options);
        follow::reference(&target, whole, shape, growth, bodies, options, monitor)
    }
}

impl Balls {
    /// Growth at the nearest place.
    fn at(&self, places: &Bvh, p: &crate::Vec3) -> f64 {
        places.nearest(p, f64::INFINITY).map_or(0.0, |nearest| {
            let corners = self.cells.triangles[nearest.triangle as usize];
            interpolate(&self.cells, corners, &nearest.point, &self.growth)
        })
    }
}

/// What the balls of a solid lack to grow towards the feeders; none where that is hardly anything.
fn lacking(
    solid: &Remeshed,
    bodies: &Bodies,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<Option<Balls>, StageError> {
    let mut axis = medial::medial_axis(&solid.field, &options.medial, monitor)?.mesh;
    let fed = balls_fed(&mut axis, bodies, options, monitor)?;
    let growth = fed.radii.iter().zip(&axis.radii).map(|(a, b)| a - b);
    let growth: Vec<f64> = growth.collect();
    let most = growth.iter().copied().fold(0.0, f64::max);
    Ok((most >= ENOUGH * solid.field.spacing).then(|| Balls {
        cells: cells(&axis),
        growth,
    }))
}

/// The least radii of the balls of a medial axis, whose own are smoothed before. Balls in non-design bodies stay.
///
/// Balls shrink towards rims and in junctions by nature: neither transitions nor least walls are asked of them, they would thicken
/// every rim.
///
/// # Errors
/// As [`feed_graph`].
pub(super) fn balls_fed(
    axis: &mut MedialMesh,
    bodies: &Bodies,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<Fed, FeedError> {
    smooth(axis);
    let feeding = FeedOptions {
        transition: 1.0,
        min_wall: 0.0,
        ..options.feed.clone()
    };
    let contacts = contacts(bodies, &axis.points, &axis.radii, &feeding, true);
    let graph = FeedGraph::of_medial(axis, &contacts);
    feed_graph(&graph, &[], &contacts, &feeding, monitor)
}

/// Half-way to the mean of the neighbours, some times.
fn smooth(mesh: &mut MedialMesh) {
    let graph = FeedGraph::of_medial(mesh, &[]);
    for _ in 0..SMOOTHING {
        let mean = |v: usize| {
            let around = graph.neighbours(v as u32);
            let sum: f64 = around.iter().map(|n| mesh.radii[n.0 as usize]).sum();
            let own = mesh.radii[v];
            if around.is_empty() {
                own
            } else {
                (own + sum / around.len() as f64) / 2.0
            }
        };
        mesh.radii = (0..mesh.radii.len()).map(mean).collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;

    /// In junctions of equal walls the ball is a quarter larger than in the wall; the skeleton's radii do not know it.
    #[test]
    fn a_ball_in_a_junction_asks_for_growth_on_its_way() {
        let count = 40;
        let mut axis = MedialMesh {
            points: (0..count)
                .map(|i| Vec3::new(f64::from(i), 0.0, 0.0))
                .collect(),
            radii: (0..count)
                .map(|i| if (8..14).contains(&i) { 2.5 } else { 2.0 })
                .collect(),
            edges: (1..count as u32).map(|i| [i - 1, i]).collect(),
            ..MedialMesh::default()
        };
        let mut options = ReconstructOptions::default();
        options.feed.feeders = vec![[f64::from(count) - 1.0, 0.0, 0.0]];
        options.feed.growth = 0.005;
        let monitor = Monitor::default();
        let fed = balls_fed(&mut axis, &Bodies::default(), &options, &monitor).expect("it feeds");
        assert!(
            fed.radii.windows(2).all(|r| r[1] >= r[0]),
            "{:?}",
            fed.radii
        );
        assert!(fed.radii[39] > 2.5 && fed.radii[0] < 2.1);
    }
}
