//! The feeding edit: radii that grow towards the feeders, and the body that follows them.

use super::ReconstructOptions;
use super::bodies::Bodies;
use super::casting::drawn_out_again;
use super::error::{PipelineError, StageError};
use super::even;
use super::follow;
use super::record::Record;
use super::shape::{Base, Shape};
use crate::Vec3;
use crate::casting::feed::{
    self, Contact, Fed, FeedError, FeedOn, FeedOptions, Monotony, area_factor, feed, monotony,
};
use crate::edit::{cells_of, grow};
use crate::medial::{self, MedialMesh};
use crate::mesh::{Bvh, TriMesh, Winding};
use crate::monitor::Monitor;
use crate::radii;
use crate::remesh::{Capsule, RemeshError, RemeshOptions, Remeshed, remesh, remesh_density};
use crate::report::{FeedBlock, FeederBlock, InfeasibleBlock};
use crate::skeleton::{self, Skeleton};
use crate::voxel::VoxelGrid;

/// A skeleton point touches a body when the body is nearer than this many radii.
const TOUCHES: f64 = 1.25;
/// And belongs to it when it lies deeper in it than this many radii.
const BELONGS: f64 = 0.5;
/// A feeder stands on a body when that is nearer than this, mm, or than the feeder's radius.
const STANDS: f64 = 1.0;

/// Growth below this many voxels is left to the body's own radii.
const LEAST_GROWTH: f64 = 0.5;

/// Feeders may be given this far from the part, as a share of its diagonal: people point at a parting plane or a top face.
const NEAR: f64 = 0.05;
/// Feeders nearer than this many voxels stand on the part.
const ON_PART: f64 = 1.0;

/// The options with every feeder on the surface of the part.
///
/// # Errors
/// [`FeedError::Outside`] for a feeder far from it.
pub(super) fn placed(
    options: &ReconstructOptions,
    remeshed: &Remeshed,
    monitor: &Monitor,
) -> Result<ReconstructOptions, FeedError> {
    feed::check(&options.feed)?;
    let mut placed = options.clone();
    let mesh = remeshed.solid.mesh();
    let bvh = Bvh::new(mesh);
    let diagonal = mesh.bounds().map_or(0.0, |(lo, hi)| (hi - lo).norm());
    let limit = options.feed.feeder_radius.max(NEAR * diagonal);
    for (feeder, at) in placed.feed.feeders.iter_mut().enumerate() {
        let place = Vec3::from(*at);
        let Some(nearest) = bvh.nearest(&place, f64::INFINITY) else {
            return Err(FeedError::Empty);
        };
        let distance = nearest.distance;
        if distance > limit {
            return Err(FeedError::Outside {
                feeder,
                place,
                distance,
                limit,
            });
        }
        if distance > ON_PART * remeshed.field.spacing {
            *at = nearest.point.into();
            let text = format!(
                "the feeder given at ({:.1}, {:.1}, {:.1}) mm stands on the part at ({:.1}, {:.1}, {:.1}) mm, {distance:.1} mm away",
                place.x, place.y, place.z, at[0], at[1], at[2]
            );
            monitor.warn("feed", text);
        }
    }
    Ok(placed)
}

/// A proposal whose sections grow towards the feeders.
pub(super) struct Grown {
    pub(super) solid: Remeshed,
    /// No gap closed: a body of the ungrown proposal's skeleton can grow as far.
    pub(super) same_topology: bool,
}

/// The proposal with sections that grow towards the feeders; none when nothing is to be fed or nothing has to grow.
///
/// 1. The least radii on the proposal's skeleton or medial axis ([`feed()`], [`even::balls_fed`]).
/// 2. The proposal's field moves outward by what they grew ([`grow`]); bores that stay free stay so.
/// 3. The grown field is remeshed: where gaps close, the topology changes here and is known to all later stages. Gaps below
///    `mould.min_gap` close, too.
///
/// It is for the case that the body itself cannot grow ([`fed`]); what its skeleton asks for then is done on its body.
/// Growing the field again and again was tried: junctions swell round after round until no body of the skeleton is sound.
///
/// Scaling the offsets of a finished body instead makes it cut itself wherever gaps close. The report gets what the
/// skeleton of the proposal says before the edit.
///
/// # Errors
/// As [`feed`], [`medial::medial_axis`] and [`remesh_density`].
pub(super) fn edit(
    record: &mut Record,
    remeshed: &Remeshed,
    bodies: &Bodies,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<Option<Grown>, PipelineError> {
    if !options.feed.active() {
        return Ok(None);
    }
    let (fed, grown) = one_round(record, remeshed, bodies, options, monitor)?;
    record.report.feed = Some(block(&fed, options));
    Ok(grown.map(|solid| Grown {
        same_topology: follow::same_topology(&solid, remeshed),
        solid,
    }))
}

/// What feeding says of a solid, and the solid grown by it when that is worth while.
fn one_round(
    record: &mut Record,
    from: &Remeshed,
    bodies: &Bodies,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<(Fed, Option<Remeshed>), PipelineError> {
    let (feeding, voxel) = (&options.feed, from.field.spacing);
    let mut axis = record.stage("medial", || {
        medial::medial_axis(&from.field, &options.medial, monitor)
    })?;
    let skeleton = record.stage("skeleton", || {
        let mut quads = skeleton::quad_skeleton(&axis.mesh, voxel, &options.skeleton, monitor)?;
        radii::smooth(&mut quads.skeleton, options.radii.smoothing);
        Ok::<_, StageError>(quads.skeleton)
    })?;
    record.stage("feed", || {
        let (cells, before, fed) = match feeding.on {
            FeedOn::Skeleton => {
                let (points, radii) = (&skeleton.points, &skeleton.radii);
                let contacts = contacts(bodies, points, radii, feeding, true);
                let fed = feed(&skeleton, &contacts, feeding, monitor)?;
                (cells_of(&skeleton), radii, fed)
            }
            FeedOn::Medial => {
                let fed = even::balls_fed(&mut axis.mesh, bodies, options, monitor)?;
                (cells(&axis.mesh), &axis.mesh.radii, fed)
            }
        };
        let growth: Vec<f64> = fed.radii.iter().zip(before).map(|(a, b)| a - b).collect();
        let most = growth.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
        if most < LEAST_GROWTH * voxel {
            return Ok((fed, None));
        }
        let mut field = grow(&from.field, from.solid.mesh(), &cells, &growth);
        keep_free(&mut field, &bodies.bosses.free);
        let grown = solid_of(field, bodies, options, monitor)?;
        let grown = drawn_out_again(grown, bodies, options, monitor)?;
        Ok::<_, StageError>((fed, Some(grown)))
    })
}

/// Triangles of a medial mesh, its curves as triangles without area.
pub(super) fn cells(mesh: &MedialMesh) -> TriMesh {
    let mut triangles = mesh.triangles.clone();
    triangles.extend(mesh.edges.iter().map(|e| [e[0], e[1], e[1]]));
    TriMesh {
        points: mesh.points.clone(),
        triangles,
        tags: Vec::new(),
    }
}

/// Takes the free lengths of bores out of a field.
pub(super) fn keep_free(field: &mut VoxelGrid<f32>, free: &[Capsule]) {
    for v in 0..field.values.len() {
        let [i, j, k] = field.ijk(v);
        let p = field.centre(i, j, k);
        let depth = free.iter().map(|bore| bore.depth_in_cylinder(&p));
        let depth = depth.fold(f64::NEG_INFINITY, f64::max);
        field.values[v] = f64::from(field.values[v]).min(-depth) as f32;
    }
}

/// The solid of a signed distance field.
pub(super) fn solid_of(
    field: VoxelGrid<f32>,
    bodies: &Bodies,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<Remeshed, RemeshError> {
    let h = field.spacing;
    let on_grid = bodies.kept_open(&options.remesh, Some(h));
    // As a density: a half at the surface.
    let density = VoxelGrid {
        values: field.values.iter().map(|f| 0.5 + f / h as f32).collect(),
        ..field
    };
    remesh_density(&density, 0.5, &on_grid, monitor)
}

/// The proposal with the growth of a body that followed its radii, none when nothing is to be fed; or why it could not.
pub(super) type Followed = Result<Option<Remeshed>, StageError>;

/// The shape with the radii that feeding asks for on its own skeleton, and the proposal with the same growth. With `first`
/// nothing has grown before.
///
/// 1. The least radii ([`feed`]).
/// 2. The proposal with this growth ([`even::grown`]), or with more where balls of its medial axis count, too. Where gaps close a
///    body of the same skeleton would cut itself: then it stays as it is.
/// 3. The body follows ([`follow`]); where it would not be sound with what the balls ask for, it follows the skeleton alone, and
///    it stays as it is when it would not be sound then either.
///
/// # Errors
/// As [`feed`], [`follow`] and [`even::grown`].
pub(super) fn fed(
    record: &mut Record,
    shape: Shape,
    base: &Base,
    whole: &Remeshed,
    bodies: &Bodies,
    options: &ReconstructOptions,
    first: bool,
) -> Result<(Shape, Followed), PipelineError> {
    let feeding = &options.feed;
    if !feeding.active() {
        return Ok((shape, Ok(None)));
    }
    let before = &shape.skeleton.skeleton;
    let quiet = Monitor::default();
    let on_skeleton = |skeleton: &Skeleton| {
        // In a design part the bodies are not part of the skeleton: members only run on into their walls.
        let inside = base.united.is_none();
        let contacts = contacts(bodies, &skeleton.points, &skeleton.radii, feeding, inside);
        feed(skeleton, &contacts, feeding, &quiet)
    };
    let least = record.stage("feed", || on_skeleton(before))?;
    let growth = least.radii.iter().zip(&before.radii).map(|(a, b)| a - b);
    let most = growth.fold(0.0_f64, |m, g| m.max(g.abs()));
    if most <= 0.0 && feeding.on == FeedOn::Skeleton {
        tell_report(record, &least, options, first);
        return Ok((shape, Ok(None)));
    }
    let site = even::Site {
        shape: &shape,
        base,
        whole,
        bodies,
        options,
    };
    let mut ways = vec![FeedOn::Skeleton];
    if feeding.on == FeedOn::Medial && !feeding.neutral {
        ways.insert(0, FeedOn::Medial);
    }
    let mut why = CLOSES;
    for on in ways {
        let grown = record.stage("feed", || {
            even::grown(&site, least.clone(), on, on_skeleton, &quiet)
        })?;
        let Some(even::Grown { fed, growth, solid }) = grown else {
            continue;
        };
        let edited = record.stage("fit", || {
            follow::follow(&shape, base, &fed.radii, &growth, options, &quiet)
        })?;
        if let Some(edited) = edited {
            tell_report(record, &fed, options, first);
            return Ok((edited, Ok(Some(solid))));
        }
        why = CUTS;
    }
    let told = tell_report(record, &least, options, first);
    told.violations = least.violations_before;
    told.shortfall = most;
    let error = StageError::Growth {
        most,
        broken: least.violations_before,
        rules: least.rules,
        why,
    };
    Ok((shape, Err(error)))
}

/// Puts what the body's own skeleton says into the report, as if its radii can be had.
fn tell_report<'a>(
    record: &'a mut Record,
    fed: &Fed,
    options: &ReconstructOptions,
    first: bool,
) -> &'a mut FeedBlock {
    let feed = &mut record.report.feed;
    let told = feed.get_or_insert_with(|| block(fed, options));
    told.rules_after = fed.rules;
    told.violations = fed.violations;
    told.shortfall = 0.0;
    if first {
        told.rules = fed.rules;
        told.violations_before = fed.violations_before;
        told.added_volume_skeleton = fed.added_volume;
    }
    told
}

/// Why a body cannot grow.
const CUTS: &str = "the body would cut itself";
const CLOSES: &str = "gaps would close";

/// Far points whose ways to the feeders are looked at.
const PATHS: usize = 20;
/// Inscribed balls are known to this share of a voxel.
const KNOWN: f64 = 0.5;

/// Looks whether inscribed balls grow towards the feeders in the proposal and in the finished part, on medial axes of both.
pub(super) fn prove(
    record: &mut Record,
    remeshed: &Remeshed,
    part: &TriMesh,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<(), PipelineError> {
    let feeding = &options.feed;
    if feeding.feeders.is_empty() || record.report.feed.is_none() {
        return Ok(());
    }
    let voxel = remeshed.field.spacing;
    let of = |remeshed: &Remeshed| -> Result<Monotony, StageError> {
        let axis = medial::medial_axis(&remeshed.field, &options.medial, monitor)?;
        let reach = feeding.feeder_radius;
        Ok(monotony(
            &axis.mesh,
            &feeding.feeders,
            reach,
            PATHS,
            KNOWN * voxel,
        ))
    };
    let looked = record.stage("feed", || {
        let on_grid = RemeshOptions {
            voxel: Some(voxel),
            ..options.remesh.clone()
        };
        let finished = remesh(part, &on_grid, monitor)?;
        Ok::<_, StageError>([of(remeshed)?, of(&finished)?])
    });
    let [before, after] = match looked {
        Ok(looked) => looked,
        Err(error) if error.is_cancelled() => return Err(error),
        Err(error) => {
            let text = format!(
                "growth on the medial axis could not be measured: {}",
                error.source
            );
            monitor.warn("feed", text);
            return Ok(());
        }
    };
    if let Some(block) = &mut record.report.feed {
        block.falling_before = before;
        block.falling = after;
    }
    Ok(())
}

/// The feeders of the report; its yield becomes that of the finished part of `volume`, and what was added `added`, mm3.
pub(super) fn poured(record: &mut Record, volume: f64, added: f64) -> Vec<FeederBlock> {
    let Some(block) = &mut record.report.feed else {
        return Vec::new();
    };
    block.added_volume = added;
    let feeders: f64 = block.zones.iter().map(|zone| zone.volume).sum();
    block.casting_yield = volume / (volume + feeders);
    block.zones.clone()
}

/// Which points of a skeleton belong to a body.
pub(super) fn belonging(bodies: &Bodies, points: &[Vec3], radii: &[f64]) -> Vec<bool> {
    let mut out = vec![false; points.len()];
    for contact in contacts(bodies, points, radii, &FeedOptions::default(), true) {
        contact.inside.iter().for_each(|&v| out[v as usize] = true);
    }
    out
}

/// How the bodies touch balls of a skeleton or medial axis, one contact a body.
pub(super) fn contacts(
    bodies: &Bodies,
    points: &[Vec3],
    radii: &[f64],
    options: &FeedOptions,
    inside: bool,
) -> Vec<Contact> {
    let FeedOptions {
        feeders,
        feeder_radius,
        ..
    } = options;
    let surface = &bodies.bosses.surface;
    let count = surface.tags.iter().max().map_or(0, |n| n + 1);
    let one = |number: u32| {
        let all = surface.triangles.iter().zip(&surface.tags);
        let mesh = TriMesh {
            points: surface.points.clone(),
            triangles: all.filter(|t| *t.1 == number).map(|t| *t.0).collect(),
            tags: Vec::new(),
        };
        let bvh = Bvh::new(&mesh);
        let winding = Winding::new(&bvh);
        let depth = |p: &Vec3| {
            let distance = bvh
                .nearest(p, f64::INFINITY)
                .map_or(f64::INFINITY, |n| n.distance);
            if winding.at(p) > 0.5 {
                distance
            } else {
                -distance
            }
        };
        let depths = points.iter().map(&depth);
        let depths: Vec<f64> = depths.collect();
        let which = |wanted: &dyn Fn(f64, f64) -> bool| {
            let each = depths.iter().zip(radii).enumerate();
            let found = each.filter(|(_, (depth, radius))| wanted(**depth, **radius));
            found.map(|(v, _)| v as u32).collect::<Vec<u32>>()
        };
        let reach = feeder_radius.max(STANDS);
        let stands = |place: &&[f64; 3]| depth(&Vec3::from(**place)) >= -reach;
        let feeders = feeders.iter().enumerate().filter(|f| stands(&f.1));
        Contact {
            touching: which(&|depth, radius| depth >= -TOUCHES * radius),
            inside: if inside {
                which(&|depth, radius| depth >= BELONGS * radius)
            } else {
                Vec::new()
            },
            feeders: feeders.map(|(number, _)| number as u32).collect(),
        }
    };
    (0..count).map(one).collect()
}

fn block(fed: &Fed, options: &ReconstructOptions) -> FeedBlock {
    let feeders = fed.zones.iter().map(|zone| FeederBlock {
        place: zone.feeder.into(),
        points: zone.points,
        reach: zone.reach,
        limit: zone.limit,
        modulus: zone.shape.modulus,
        diameter: zone.size.diameter,
        neck: zone.size.neck,
        volume: zone.size.volume,
    });
    let infeasible = fed.infeasible.iter().map(|place| InfeasibleBlock {
        place: place.place.into(),
        wanted: place.wanted,
        limit: place.most,
        origin: place.origin.into(),
        origin_radius: place.origin_radius,
    });
    FeedBlock {
        feeders: options.feed.feeders.clone(),
        growth: fed.slope,
        k_area: area_factor(fed.slope),
        rules: fed.rules,
        rules_after: fed.rules,
        violations_before: fed.violations_before,
        violations: fed.violations,
        shortfall: 0.0,
        added_volume: 0.0,
        added_volume_skeleton: fed.added_volume,
        casting_yield: fed.casting_yield,
        falling_before: Monotony::default(),
        falling: Monotony::default(),
        sinks: fed.sinks.iter().map(|&p| p.into()).collect(),
        zones: feeders.collect(),
        infeasible: infeasible.collect(),
    }
}
