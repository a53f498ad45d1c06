//! Where one to three feeders stand best.

use rayon::prelude::*;
use serde::Serialize;

use super::error::FeedError;
use super::graph::{Contact, FeedGraph, Seed, distances};
use super::options::{FeedMode, FeedOptions};
use super::rules::{Rules, contradiction};
use super::sizing::{FeedZone, feeder_size};
use super::{check, shape};
use crate::monitor::Monitor;
use crate::skeleton::Skeleton;

/// As many sets are all tried.
const ALL: usize = 1000;
/// Sets that are worked out at once, before those left are compared with the best: the same on any number of threads.
const AT_ONCE: usize = 32;
/// Rounding of bounds, as a share.
const ROUNDING: f64 = 1e-9;

/// A set of feeders and what it costs.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Placement {
    /// Skeleton points that the feeders stand at.
    pub points: Vec<u32>,
    /// Metal added to the part, mm3.
    pub added: f64,
    /// Metal of the feeders, mm3.
    pub feeders: f64,
}

impl Placement {
    /// Metal in all, mm3.
    pub fn cost(&self) -> f64 {
        self.added + self.feeders
    }
}

/// The cheapest places for `count` feeders among `candidates` (skeleton points).
///
/// The cost is the metal that feeding adds to the part plus that of the feeders ([`feeder_size`]).
/// 1. One feeder: every candidate is tried; likewise every set of more feeders where there are at most a thousand.
/// 2. Else the best one more is added to those chosen so far; then, as long as that saves metal, one of them is moved to
///    the best other candidate. The result is at least as good as every single exchange, not always the best of all sets.
/// 3. Of many sets each gets a lower bound first: sections grow along the shortest ways at least, and the feeders are as large
///    as the moduli at their feet ask for then. Sets are worked out in the order of their bounds, until those left cannot be
///    better.
///
/// Places that do not reach all of the part cost infinitely much. O(candidates * count * E log V) a round; the result does
/// not depend on the number of threads.
///
/// # Errors
/// [`FeedError`]: bad options, contradictory rules, no set of this size that reaches all of the part, cancelled.
pub fn place_feeders(
    skeleton: &Skeleton,
    contacts: &[Contact],
    candidates: &[u32],
    count: usize,
    options: &FeedOptions,
    monitor: &Monitor,
) -> Result<Placement, FeedError> {
    check(options)?;
    if count == 0 || candidates.is_empty() || options.mode == FeedMode::Direction {
        return Err(FeedError::NoFeeder);
    }
    let graph = FeedGraph::new(skeleton, contacts);
    let site = Site {
        rules: Rules::bare(&graph, contacts, options),
        factors: graph.shape_factors(),
        graph,
        skeleton,
        options,
    };
    let sets = sets(candidates, count);
    let mut best = Placement::default();
    if sets.is_empty() {
        for _ in 0..count {
            best = site.extended(&best.points, candidates, monitor)?;
        }
    } else {
        best = site.cheapest(&sets, monitor)?;
    }
    // The one chosen last is the best beside the others; then each in turn is looked at, the oldest first.
    let mut kept = 1;
    while sets.is_empty() && kept < count {
        let mut rest = best.points.clone();
        rest.remove(0);
        let other = site.extended(&rest, candidates, monitor)?;
        if other.cost() < best.cost() * (1.0 - ROUNDING) {
            best = other;
            kept = 1;
        } else {
            best.points.rotate_left(1);
            kept += 1;
        }
    }
    if !best.cost().is_finite() {
        let reach = distances(&site.graph, &seeds(&best.points));
        super::reached(&site.graph, &reach)?;
    }
    Ok(best)
}

struct Site<'a> {
    graph: FeedGraph,
    skeleton: &'a Skeleton,
    /// Without arcs.
    rules: Rules,
    /// Modulus over radius.
    factors: Vec<f64>,
    options: &'a FeedOptions,
}

impl Site<'_> {
    /// `chosen` and the candidate that costs least with them.
    fn extended(
        &self,
        chosen: &[u32],
        candidates: &[u32],
        monitor: &Monitor,
    ) -> Result<Placement, FeedError> {
        let extended = candidates.iter().map(|&candidate| {
            let mut points = chosen.to_vec();
            points.push(candidate);
            points
        });
        self.cheapest(&extended.collect::<Vec<_>>(), monitor)
    }

    /// The set that costs least; of equal ones the first.
    fn cheapest(&self, sets: &[Vec<u32>], monitor: &Monitor) -> Result<Placement, FeedError> {
        let bounds = sets.par_iter().map(|points| {
            monitor.check()?;
            Ok(self.least_cost(points))
        });
        let bounds: Vec<f64> = bounds.collect::<Result<_, FeedError>>()?;
        let mut order: Vec<usize> = (0..sets.len()).collect();
        order.sort_by(|&a, &b| bounds[a].total_cmp(&bounds[b]));
        let mut best: Option<(usize, Placement)> = None;
        // Of places that do not reach all of the part, the one that misses least: the next feeder can reach the rest.
        let key = |(set, placed): &(usize, Placement)| (placed.cost(), placed.feeders, *set);
        for some in order.chunks(AT_ONCE) {
            let enough = best.as_ref().map_or(f64::INFINITY, |b| b.1.cost());
            if bounds[some[0]] * (1.0 - ROUNDING) > enough {
                break;
            }
            let tried = some.par_iter().map(|&set| {
                monitor.check()?;
                Ok((set, self.placed(sets[set].clone())?))
            });
            let tried: Vec<(usize, Placement)> = tried.collect::<Result<_, FeedError>>()?;
            best = best.into_iter().chain(tried).min_by(|a, b| {
                let (a, b) = (key(a), key(b));
                let equal = a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1));
                equal.then(a.2.cmp(&b.2))
            });
        }
        Ok(best.map(|b| b.1).unwrap_or_default())
    }

    /// No set with these points costs less; infinite where they do not reach all of the part.
    fn least_cost(&self, points: &[u32]) -> f64 {
        let graph = &self.graph;
        let distances = distances(graph, &seeds(points));
        if distances.distance.iter().any(|d| !d.is_finite()) {
            return f64::INFINITY;
        }
        let slope = self.options.slope();
        let values = self.rules.raised_along_ways(graph, &distances, slope);
        let radii = self.rules.radii(&values);
        let feeders = points.iter().map(|&foot| {
            let foot = foot as usize;
            let zone = FeedZone {
                modulus: self.factors[foot] * radii[foot],
                ..FeedZone::default()
            };
            feeder_size(&zone).volume
        });
        graph.volume(&radii) - graph.volume(&graph.radii) + feeders.sum::<f64>()
    }

    fn placed(&self, points: Vec<u32>) -> Result<Placement, FeedError> {
        let graph = &self.graph;
        let distances = distances(graph, &seeds(&points));
        let missed = distances.distance.iter().filter(|d| !d.is_finite());
        let missed = missed.count();
        if missed > 0 {
            return Ok(Placement {
                points,
                added: f64::INFINITY,
                feeders: missed as f64,
            });
        }
        let quads = &self.skeleton.quads;
        let rules = self.rules.towards(graph, quads, &distances, self.options);
        let least = rules.raise().map_err(|c| contradiction(graph, &c))?;
        let radii = rules.radii(&least.values);
        let added = graph.volume(&radii) - graph.volume(&graph.radii);
        let feeders = points.iter().enumerate().map(|(number, &foot)| {
            let own = |v: &usize| distances.feeder[*v] == number as u32;
            let zone: Vec<usize> = (0..radii.len()).filter(own).collect();
            let foot = foot as usize;
            let modulus = self.factors[foot] * radii[foot];
            feeder_size(&shape(graph, &zone, &radii, modulus)).volume
        });
        let feeders = feeders.sum();
        Ok(Placement {
            points,
            added,
            feeders,
        })
    }
}

/// All sets of `count` candidates; none when there are more than [`ALL`].
fn sets(candidates: &[u32], count: usize) -> Vec<Vec<u32>> {
    let mut sets: Vec<Vec<usize>> = vec![Vec::new()];
    for _ in 0..count {
        let mut longer = Vec::new();
        for set in &sets {
            let from = set.last().map_or(0, |last| last + 1);
            for next in from..candidates.len() {
                let mut set = set.clone();
                set.push(next);
                longer.push(set);
            }
            if longer.len() > ALL {
                return Vec::new();
            }
        }
        sets = longer;
    }
    let places = |set: &Vec<usize>| set.iter().map(|n| candidates[*n]).collect();
    sets.iter().map(places).collect()
}

fn seeds(points: &[u32]) -> Vec<Seed> {
    let each = points.iter().enumerate();
    each.map(|(number, &point)| Seed {
        point,
        distance: 0.0,
        feeder: number as u32,
    })
    .collect()
}
