//! Feeding: sections that grow towards the feeders (Heuvers' circles), at least metal.

pub mod constraints;
mod error;
mod graph;
mod monotony;
mod options;
mod placing;
mod rules;
mod sizing;
#[cfg(test)]
mod tests;

use serde::Serialize;

pub use error::FeedError;
pub use graph::{Contact, Distances, EdgeKind, FeedEdge, FeedGraph, Seed, distances};
pub use monotony::{Monotony, monotony};
pub use options::{
    Chill, FeedMode, FeedOn, FeedOptions, GrowthKind, Measure, RadiusBound, area_factor,
};
pub use placing::{Placement, place_feeders};
pub use sizing::{FEEDER, FeedZone, FeederSize, NECK, feeder_size};

use crate::Vec3;
use crate::monitor::Monitor;
use crate::skeleton::Skeleton;
use rules::Rules;

/// Name of this stage in progress and warnings.
pub(crate) const STAGE: &str = "feed";

/// A place whose largest radius is too small for what the rules ask.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Infeasible {
    /// Index of the skeleton point.
    pub point: u32,
    /// Its position, mm.
    pub place: Vec3,
    /// Radius that the rules ask for, mm.
    pub wanted: f64,
    /// Largest radius allowed, mm.
    pub most: f64,
    /// The point whose radius asks for it, mm.
    pub origin: Vec3,
    /// Radius there, mm.
    pub origin_radius: f64,
    /// Skeleton points from there to here.
    pub path: Vec<u32>,
}

/// What one feeder feeds.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Zone {
    /// Where the feeder stands, mm.
    pub feeder: Vec3,
    /// Skeleton points that are nearest to it.
    pub points: usize,
    /// Shape and metal of the zone, after the edit.
    pub shape: FeedZone,
    /// Longest way to the feeder, mm.
    pub reach: f64,
    /// How far it feeds, mm.
    pub limit: f64,
    /// How large the feeder must be.
    pub size: FeederSize,
}

/// New radii and what they cost.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Fed {
    /// One a skeleton point, mm.
    #[serde(skip)]
    pub radii: Vec<f64>,
    /// Way to the feeder, mm; in the mode `direction` the height below the farthest point.
    #[serde(skip)]
    pub distance: Vec<f64>,
    /// The growth as a slope of the radius.
    pub slope: f64,
    /// Edges that feed; each is one rule.
    pub rules: usize,
    /// Of these, along how many sections fell short before.
    pub violations_before: usize,
    /// And after.
    pub violations: usize,
    /// Metal added, measured on the skeleton, mm3.
    pub added_volume: f64,
    /// Metal before, measured likewise, mm3.
    pub volume_before: f64,
    /// Radii that would have to exceed their bounds.
    pub infeasible: Vec<Infeasible>,
    /// Places without a way on in the mode `direction`, mm: each needs a feeder of its own.
    pub sinks: Vec<Vec3>,
    /// One a feeder, in their order.
    pub zones: Vec<Zone>,
    /// Metal of the part over metal poured.
    pub casting_yield: f64,
}

/// The least radii that make sections grow towards the feeders.
///
/// 1. The skeleton becomes a graph ([`FeedGraph`]); `d` is the distance of every point to the nearest feeder along it, in
///    the mode `direction` the height below the farthest point.
/// 2. Along every edge from `v` to a nearer `w` within `cone` of the way: `r_w >= r_v + g (d_v - d_w)`. The difference of
///    the potential, not the edge's length, counts, so the result does not depend on how the mesh zigzags.
/// 3. Wall transitions `r_w >= r_v - G l` both ways, draft on sheets that stand along the draw, least wall, bounds.
/// 4. All are difference constraints; their least solution ([`constraints::least_solution`]) is the one that costs least
///    in every measure that grows with the radii. With `neutral` the values change both ways instead, at equal volume.
/// 5. Radii above their upper bounds are cut there and told of, each with the path from the place that asks for it.
///
/// `contacts` are the non-design bodies: metal flows through them, radii inside stay, feeders may stand on them.
/// Deterministic, O(E log V); with draft O(V E) at worst.
///
/// Heuvers, A. (1929), the method of circles, is known to us through Wlodawer, Directional Solidification of Steel
/// Castings (1966), and foundry handbooks. It is a rule for steel.
///
/// # Errors
/// [`FeedError`]: options out of range, a feeder away from the part, a piece that no feeder reaches, contradictory rules
/// with their cycle, cancelled.
pub fn feed(
    skeleton: &Skeleton,
    contacts: &[Contact],
    options: &FeedOptions,
    monitor: &Monitor,
) -> Result<Fed, FeedError> {
    let graph = FeedGraph::new(skeleton, contacts);
    feed_graph(&graph, &skeleton.quads, contacts, options, monitor)
}

/// The same on any graph, such as that of a medial axis; draft is added on `quads`, which may be none.
///
/// # Errors
/// As [`feed`].
pub fn feed_graph(
    graph: &FeedGraph,
    quads: &[[u32; 4]],
    contacts: &[Contact],
    options: &FeedOptions,
    monitor: &Monitor,
) -> Result<Fed, FeedError> {
    check(options)?;
    if graph.points.is_empty() {
        return Err(FeedError::Empty);
    }
    monitor.step(STAGE, "distances to the feeders", 0.0)?;
    let mut fed = Fed {
        slope: options.slope(),
        ..Fed::default()
    };
    let (distances, seeds) = match options.mode {
        FeedMode::Direction => (rules::along(graph, options), Vec::new()),
        FeedMode::Point => {
            let seeds = seeds(graph, contacts, options)?;
            let distances = distances(graph, &seeds);
            reached(graph, &distances)?;
            (distances, seeds)
        }
    };
    if options.mode == FeedMode::Direction {
        let sinks = rules::sinks(graph, &distances);
        fed.sinks = sinks.iter().map(|&v| graph.points[v as usize]).collect();
    }
    monitor.step(STAGE, "least radii", 0.3)?;
    let rules = Rules::new(graph, quads, contacts, &distances, options);
    fed.rules = rules.feeding;
    fed.violations_before = rules.violations(&rules.base);
    let values = solve(graph, &rules, options, &mut fed)?;
    fed.violations = rules.violations(&values);
    fed.radii = rules.radii(&values);
    fed.volume_before = graph.volume(&graph.radii);
    let volume = graph.volume(&fed.radii);
    fed.added_volume = volume - fed.volume_before;
    fed.zones = zones(graph, &distances, &seeds, &fed.radii, options);
    let feeders: f64 = fed.zones.iter().map(|zone| zone.size.volume).sum();
    fed.casting_yield = volume / (volume + feeders);
    fed.distance = distances.distance;
    tell(&fed, options, monitor);
    Ok(fed)
}

/// The values of all points, cut at their upper bounds.
fn solve(
    graph: &FeedGraph,
    rules: &Rules,
    options: &FeedOptions,
    fed: &mut Fed,
) -> Result<Vec<f64>, FeedError> {
    let contradiction = |cycle: constraints::Cycle| rules::contradiction(graph, &cycle);
    let least = if options.neutral {
        let volume = |values: &[f64]| graph.volume(&rules.radii(values));
        let values = rules.balance(volume).map_err(contradiction)?;
        let previous = (0..values.len() as u32).collect();
        constraints::Least { values, previous }
    } else {
        rules.raise().map_err(contradiction)?
    };
    let mut values = least.values.clone();
    for (v, value) in values.iter_mut().enumerate() {
        if *value > rules.most[v] + 1e-9 {
            let path = least.path(v as u32);
            let origin = path[0] as usize;
            fed.infeasible.push(Infeasible {
                point: v as u32,
                place: graph.points[v],
                wanted: *value / rules.factors[v],
                most: rules.most[v] / rules.factors[v],
                origin: graph.points[origin],
                origin_radius: graph.radii[origin],
                path,
            });
            *value = rules.most[v];
        }
    }
    Ok(values)
}

/// The points at which every feeder feeds.
fn seeds(
    graph: &FeedGraph,
    contacts: &[Contact],
    options: &FeedOptions,
) -> Result<Vec<Seed>, FeedError> {
    if options.feeders.is_empty() {
        return Err(FeedError::NoFeeder);
    }
    let mut seeds = Vec::new();
    for (number, place) in options.feeders.iter().enumerate() {
        let place = Vec3::from(*place);
        let feeder = number as u32;
        let gap = |v: usize| (graph.points[v] - place).norm() - graph.radii[v];
        let all = 0..graph.points.len();
        let Some(nearest) = all.clone().min_by(|&a, &b| gap(a).total_cmp(&gap(b))) else {
            return Err(FeedError::Empty);
        };
        let before = seeds.len();
        for contact in contacts.iter().filter(|c| c.feeders.contains(&feeder)) {
            seeds.extend(contact.touching.iter().map(|&point| Seed {
                point,
                distance: (gap(point as usize) - options.feeder_radius).max(0.0),
                feeder,
            }));
        }
        let limit = options.feeder_radius + graph.radii[nearest];
        let distance = gap(nearest);
        if distance > limit && seeds.len() == before {
            return Err(FeedError::Outside {
                feeder: number,
                place,
                distance,
                limit,
            });
        }
        let at_once = all.filter(|&v| {
            v == nearest && seeds.len() == before
                || gap(v) <= options.feeder_radius && options.feeder_radius > 0.0
        });
        let at_once: Vec<Seed> = at_once
            .map(|v| Seed {
                point: v as u32,
                distance: 0.0,
                feeder,
            })
            .collect();
        seeds.extend(at_once);
    }
    Ok(seeds)
}

fn reached(graph: &FeedGraph, distances: &Distances) -> Result<(), FeedError> {
    let missed = |v: &usize| !distances.distance[*v].is_finite();
    let all = graph.points.len();
    let mut points = (0..all).filter(missed);
    match points.next() {
        Some(first) => Err(FeedError::Unreachable {
            points: points.count() + 1,
            all,
            place: graph.points[first],
        }),
        None => Ok(()),
    }
}

/// What each feeder feeds, and how large it must be.
fn zones(
    graph: &FeedGraph,
    distances: &Distances,
    seeds: &[Seed],
    radii: &[f64],
    options: &FeedOptions,
) -> Vec<Zone> {
    let factors = graph.shape_factors();
    let feeders = options.feeders.iter().enumerate();
    let zone = |(number, place): (usize, &[f64; 3])| {
        let own = |v: &usize| distances.feeder[*v] == number as u32;
        let points: Vec<usize> = (0..radii.len()).filter(own).collect();
        let feet = seeds.iter().filter(|s| s.feeder == number as u32);
        let feet = feet.map(|s| s.point as usize);
        let modulus = feet.map(|v| factors[v] * radii[v]).fold(0.0, f64::max);
        let shape = shape(graph, &points, radii, modulus);
        let far = points.iter().map(|&v| distances.distance[v]);
        Zone {
            feeder: Vec3::from(*place),
            points: points.len(),
            reach: far.fold(0.0, f64::max),
            limit: options.feeding_distance * shape.thickness,
            size: feeder_size(&shape),
            shape,
        }
    };
    match options.mode {
        FeedMode::Point => feeders.map(zone).collect(),
        FeedMode::Direction => Vec::new(),
    }
}

/// Shape of the metal around points with `radii`; the thickness is the mean over the metal.
fn shape(graph: &FeedGraph, points: &[usize], radii: &[f64], modulus: f64) -> FeedZone {
    let metal = |v: &usize| graph.volume_at(*v, radii[*v]);
    let volume: f64 = points.iter().map(metal).sum();
    let weighted: f64 = points.iter().map(|v| 2.0 * radii[*v] * metal(v)).sum();
    let thickness = weighted / volume.max(1e-300);
    let [length, width] = extents(graph, points);
    FeedZone {
        volume,
        length: length + thickness,
        width: width + thickness,
        thickness,
        modulus,
    }
}

/// Extents of points along the two longest of their principal axes, mm.
fn extents(graph: &FeedGraph, points: &[usize]) -> [f64; 2] {
    if points.is_empty() {
        return [0.0; 2];
    }
    let at = |v: &usize| graph.points[*v];
    let mean = points.iter().map(at).sum::<Vec3>() / points.len() as f64;
    let mut spread = nalgebra::Matrix3::zeros();
    for p in points.iter().map(at) {
        spread += (p - mean) * (p - mean).transpose();
    }
    let axes = nalgebra::SymmetricEigen::new(spread).eigenvectors;
    let mut extents = [0, 1, 2].map(|k| {
        let axis = axes.column(k);
        let along = points.iter().map(|v| (at(v) - mean).dot(&axis));
        let (lo, hi) = along.fold((0.0_f64, 0.0_f64), |(lo, hi), t| (lo.min(t), hi.max(t)));
        hi - lo
    });
    extents.sort_by(|a, b| b.total_cmp(a));
    [extents[0], extents[1]]
}

fn tell(fed: &Fed, options: &FeedOptions, monitor: &Monitor) {
    if let Some(worst) = fed
        .infeasible
        .iter()
        .max_by(|a, b| (a.wanted - a.most).total_cmp(&(b.wanted - b.most)))
    {
        let (p, q) = (worst.place, worst.origin);
        let text = format!(
            "{} skeleton points are bound below what feeding asks for, the worst at ({:.1}, {:.1}, {:.1}) mm: {:.2} mm wanted because of {:.2} mm at ({:.1}, {:.1}, {:.1}), {:.2} mm allowed; a feeder nearer, a chill there or less growth helps",
            fed.infeasible.len(),
            p.x,
            p.y,
            p.z,
            worst.wanted,
            worst.origin_radius,
            q.x,
            q.y,
            q.z,
            worst.most
        );
        monitor.warn(STAGE, text);
    }
    for sink in &fed.sinks {
        let text = format!(
            "nothing lies farther along feed.direction than ({:.1}, {:.1}, {:.1}) mm: the metal there needs a feeder of its own",
            sink.x, sink.y, sink.z
        );
        monitor.warn(STAGE, text);
    }
    for zone in fed.zones.iter().filter(|zone| zone.reach > zone.limit) {
        let (p, times) = (zone.feeder, options.feeding_distance);
        let text = format!(
            "the feeder at ({:.1}, {:.1}, {:.1}) mm has to feed over {:.0} mm, without growth it reaches {:.0} mm ({times} times the mean wall)",
            p.x, p.y, p.z, zone.reach, zone.limit
        );
        monitor.warn(STAGE, text);
    }
}

/// Checks the options.
///
/// # Errors
/// [`FeedError::Option`].
pub fn check(options: &FeedOptions) -> Result<(), FeedError> {
    let range = |name, value: f64, lo: f64, hi: f64, allowed| {
        if value.is_finite() && value >= lo && value <= hi {
            Ok(())
        } else {
            Err(FeedError::Option {
                name,
                value,
                allowed,
            })
        }
    };
    let slope = options.slope();
    if !(slope >= 0.0 && slope <= options.transition) {
        let (name, value) = ("growth", options.growth);
        let allowed = "as a slope 0 to feed.transition";
        return Err(FeedError::Option {
            name,
            value,
            allowed,
        });
    }
    range("transition", options.transition, 0.0, 1.0, "0 to 1")?;
    range("cone", options.cone, 0.0, 90.0, "0 to 90")?;
    range("feeder_radius", options.feeder_radius, 0.0, 1e6, "0 to 1e6")?;
    range("min_wall", options.min_wall, 0.0, 1e6, "0 to 1e6")?;
    range("draft", options.draft, 0.0, 45.0, "0 to 45")?;
    range("parting", options.parting, -1e9, 1e9, "a length")?;
    range(
        "feeding_distance",
        options.feeding_distance,
        0.0,
        1e3,
        "0 to 1000",
    )?;
    for (name, vector) in [("direction", options.direction), ("draw", options.draw)] {
        let length = Vec3::from(vector).norm();
        range(name, length, 1e-9, 1e9, "a vector that is not zero")?;
    }
    for place in options.feeders.iter().flatten() {
        range("feeders", *place, -1e9, 1e9, "places in mm")?;
    }
    for bound in &options.bounds {
        range("bounds.reach", bound.reach, 0.0, 1e9, "0 or more")?;
        range("bounds.least", bound.least, 0.0, 1e6, "0 to 1e6")?;
        let most = bound.most.unwrap_or(1.0);
        range("bounds.most", most, 1e-6, 1e6, "above 0")?;
        let place = bound.place.iter().sum();
        range("bounds.place", place, -1e10, 1e10, "a place in mm")?;
    }
    for chill in &options.chills {
        range("chills.reach", chill.reach, 0.0, 1e9, "0 or more")?;
        range("chills.factor", chill.factor, 1.0, 10.0, "1 to 10")?;
        let place = chill.place.iter().sum();
        range("chills.place", place, -1e10, 1e10, "a place in mm")?;
    }
    Ok(())
}
