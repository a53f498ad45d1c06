//! The casting rules as one system of difference constraints on the radii (or moduli) of the skeleton points.

use super::constraints::{Arc, Cycle, Least, least_solution};
use super::error::FeedError;
use super::graph::{Contact, Distances, EdgeKind, FeedGraph};
use super::options::{FeedOptions, Measure};
use crate::Vec3;

/// Arcs that gain less distance than this are level, mm.
const LEVEL: f64 = 1e-12;

/// The system in the measure of the options: `value = factor * radius`.
#[derive(Debug, Clone, Default)]
pub(super) struct Rules {
    /// The values as they are.
    pub base: Vec<f64>,
    /// Values may not fall below these, whatever they are now.
    pub least: Vec<f64>,
    /// They should not exceed these; infinite for none.
    pub most: Vec<f64>,
    /// Feeding arcs first, then wall transitions and draft.
    pub arcs: Vec<Arc>,
    /// How many feeding arcs there are.
    pub feeding: usize,
    /// `slope * distance`.
    pub potential: Vec<f64>,
    /// Value over radius.
    pub factors: Vec<f64>,
    /// Points whose radii stay.
    pub fixed: Vec<bool>,
}

impl Rules {
    pub fn new(
        graph: &FeedGraph,
        quads: &[[u32; 4]],
        contacts: &[Contact],
        distances: &Distances,
        options: &FeedOptions,
    ) -> Self {
        Self::bare(graph, contacts, options).towards(graph, quads, distances, options)
    }

    /// Bounds and fixed points, which do not depend on where feeders stand; no arcs.
    pub fn bare(graph: &FeedGraph, contacts: &[Contact], options: &FeedOptions) -> Self {
        let n = graph.points.len();
        let mut rules = Self {
            factors: factors(graph, options),
            fixed: vec![false; n],
            ..Self::default()
        };
        for contact in contacts {
            contact
                .inside
                .iter()
                .for_each(|&v| rules.fixed[v as usize] = true);
        }
        rules.bounds(graph, options);
        rules
    }

    /// The same with the arcs towards feeders.
    pub fn towards(
        &self,
        graph: &FeedGraph,
        quads: &[[u32; 4]],
        distances: &Distances,
        options: &FeedOptions,
    ) -> Self {
        let mut rules = self.clone();
        let slope = options.slope();
        let finite = |d: f64| if d.is_finite() { slope * d } else { 0.0 };
        rules.potential = distances.distance.iter().map(|&d| finite(d)).collect();
        rules.feed(graph, distances, options);
        rules.feeding = rules.arcs.len();
        for edge in graph.edges.iter().filter(|e| e.kind != EdgeKind::Link) {
            let [a, b] = edge.points;
            for (from, to) in [(a, b), (b, a)] {
                let gain = -options.transition * edge.length;
                rules.push(Arc { from, to, gain });
            }
        }
        if options.draft > 0.0 {
            rules.draft(graph, quads, options);
        }
        rules
    }

    /// Radii of points inside bodies stay, so nothing may ask them to change.
    fn push(&mut self, arc: Arc) {
        if !self.fixed[arc.to as usize] {
            self.arcs.push(arc);
        }
    }

    fn bounds(&mut self, graph: &FeedGraph, options: &FeedOptions) {
        let n = graph.points.len();
        let near = |p: &Vec3, place: [f64; 3], reach: f64| (p - Vec3::from(place)).norm() <= reach;
        for v in 0..n {
            let (factor, p) = (self.factors[v], &graph.points[v]);
            let (mut least, mut most) = (options.min_wall / 2.0, f64::INFINITY);
            for bound in &options.bounds {
                if near(p, bound.place, bound.reach) {
                    least = least.max(bound.least);
                    most = most.min(bound.most.unwrap_or(f64::INFINITY));
                }
            }
            let base = factor * graph.radii[v];
            self.base.push(base);
            self.least
                .push(if self.fixed[v] { base } else { factor * least });
            self.most
                .push(if self.fixed[v] { base } else { factor * most });
        }
    }

    fn feed(&mut self, graph: &FeedGraph, distances: &Distances, options: &FeedOptions) {
        let slope = options.slope();
        let cosine = options.cone.to_radians().cos();
        for edge in graph.edges.iter().filter(|e| e.kind != EdgeKind::Link) {
            let [a, b] = edge.points;
            for (from, to) in [(a, b), (b, a)] {
                let drop = distances.distance[from as usize] - distances.distance[to as usize];
                let straight = drop >= cosine * edge.length - LEVEL;
                let path = distances.parent[from as usize] == to;
                if drop > LEVEL && (straight || path) {
                    let gain = slope * drop;
                    self.push(Arc { from, to, gain });
                }
            }
        }
    }

    /// Sheets that stand along the draw direction thicken towards the parting plane, on both of its sides.
    fn draft(&mut self, graph: &FeedGraph, quads: &[[u32; 4]], options: &FeedOptions) {
        let draw = Vec3::from(options.draw).normalize();
        let tangent = options.draft.to_radians().tan();
        let height = |v: u32| (graph.points[v as usize].dot(&draw) - options.parting).abs();
        for quad in quads {
            let [a, b, c, d] = quad.map(|v| graph.points[v as usize]);
            let normal = (c - a).cross(&(d - b));
            if normal.dot(&draw).abs() > std::f64::consts::FRAC_1_SQRT_2 * normal.norm() {
                continue;
            }
            for k in 0..4 {
                let (v, w) = (quad[k], quad[(k + 1) % 4]);
                let (from, to) = if height(v) > height(w) {
                    (v, w)
                } else {
                    (w, v)
                };
                let gain = tangent * (height(from) - height(to));
                if gain > LEVEL {
                    self.push(Arc { from, to, gain });
                }
            }
        }
    }

    /// The least values above those as they are.
    pub fn raise(&self) -> Result<Least, Cycle> {
        let lower: Vec<f64> = zip(&self.base, &self.least, f64::max);
        least_solution(&lower, &self.arcs, &self.potential)
    }

    /// Lower bounds of the values of [`Rules::raise`]: those that the shortest ways alone ask for, each once from its far end.
    /// Rules without arcs will do. O(V log V).
    pub fn raised_along_ways(
        &self,
        graph: &FeedGraph,
        distances: &Distances,
        slope: f64,
    ) -> Vec<f64> {
        let mut values: Vec<f64> = zip(&self.base, &self.least, f64::max);
        let far = |v: usize| distances.distance[v];
        let mut order: Vec<usize> = (0..values.len()).collect();
        order.sort_unstable_by(|&a, &b| far(b).total_cmp(&far(a)));
        for v in order {
            let next = distances.parent[v] as usize;
            let drop = far(v) - far(next);
            if drop > LEVEL && !self.fixed[next] && !graph.is_link(v as u32, next as u32) {
                values[next] = values[next].max(values[v] + slope * drop);
            }
        }
        values
    }

    /// Values that keep to the rules, change as little as possible at most (in the maximum norm), and keep
    /// `volume(values)`.
    ///
    /// The mean of the least solution above and the greatest below the values is the nearest in the maximum norm; both
    /// are solutions, so their mean is one. It is then shifted as a whole, which keeps every difference, until the volume
    /// is met; lower bounds may raise it again.
    pub fn balance(&self, volume: impl Fn(&[f64]) -> f64) -> Result<Vec<f64>, Cycle> {
        let up = least_solution(&self.base, &self.arcs, &self.potential)?;
        let reversed: Vec<Arc> = self
            .arcs
            .iter()
            .map(|arc| Arc {
                from: arc.to,
                to: arc.from,
                gain: arc.gain,
            })
            .collect();
        let negative = |values: &[f64]| values.iter().map(|x| -x).collect::<Vec<f64>>();
        let below = negative(&self.base);
        let down = least_solution(&below, &reversed, &negative(&self.potential))?;
        let middle = zip(&up.values, &down.values, |u, d| (u - d) / 2.0);
        let wanted = volume(&self.base);
        let shifted = |by: f64| -> Result<Vec<f64>, Cycle> {
            let lower = (0..middle.len()).map(|v| {
                let free = if self.fixed[v] {
                    self.base[v]
                } else {
                    middle[v] + by
                };
                free.max(self.least[v])
            });
            let lower: Vec<f64> = lower.collect();
            Ok(least_solution(&lower, &self.arcs, &self.potential)?.values)
        };
        let span = self.base.iter().fold(0.0_f64, |m, x| m.max(*x));
        let (mut low, mut high) = (-span, span);
        for _ in 0..60 {
            let by = (low + high) / 2.0;
            if volume(&shifted(by)?) > wanted {
                high = by;
            } else {
                low = by;
            }
        }
        shifted((low + high) / 2.0)
    }

    /// Feeding arcs along which `values` grow less than they should.
    pub fn violations(&self, values: &[f64]) -> usize {
        let arcs = self.arcs[..self.feeding].iter();
        arcs.filter(|a| values[a.to as usize] < values[a.from as usize] + a.gain - 1e-9)
            .count()
    }

    pub fn radii(&self, values: &[f64]) -> Vec<f64> {
        zip(values, &self.factors, |value, factor| value / factor)
    }
}

/// A cycle as an error with its places.
pub(super) fn contradiction(graph: &FeedGraph, cycle: &Cycle) -> FeedError {
    FeedError::Contradiction {
        places: cycle
            .nodes
            .iter()
            .map(|&v| graph.points[v as usize])
            .collect(),
        gain: cycle.gain,
    }
}

/// Value over radius of every point: shape and chills in the mode `modulus`, chills alone in the mode `radius`.
fn factors(graph: &FeedGraph, options: &FeedOptions) -> Vec<f64> {
    let mut factors = match options.measure {
        Measure::Radius => vec![1.0; graph.points.len()],
        Measure::Modulus => graph.shape_factors(),
    };
    for chill in &options.chills {
        let place = Vec3::from(chill.place);
        for (factor, p) in factors.iter_mut().zip(&graph.points) {
            if (p - place).norm() <= chill.reach {
                *factor /= chill.factor;
            }
        }
    }
    factors
}

/// Distances of the mode `direction`: how far a point lies behind the farthest one.
pub(super) fn along(graph: &FeedGraph, options: &FeedOptions) -> Distances {
    let direction = Vec3::from(options.direction).normalize();
    let heights: Vec<f64> = graph.points.iter().map(|p| p.dot(&direction)).collect();
    let top = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    Distances {
        distance: heights.iter().map(|h| top - h).collect(),
        parent: (0..heights.len() as u32).collect(),
        feeder: vec![u32::MAX; heights.len()],
    }
}

/// In the mode `direction`: points without a neighbour farther along, which need a feeder each.
pub(super) fn sinks(graph: &FeedGraph, distances: &Distances) -> Vec<u32> {
    let lower = |v: u32| {
        let own = distances.distance[v as usize];
        let mut around = graph.neighbours(v).iter();
        around.any(|n| distances.distance[n.0 as usize] < own - LEVEL)
    };
    let all = 0..graph.points.len() as u32;
    all.filter(|&v| !graph.neighbours(v).is_empty() && !lower(v))
        .collect()
}

fn zip(a: &[f64], b: &[f64], f: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    a.iter().zip(b).map(|(&x, &y)| f(x, y)).collect()
}
