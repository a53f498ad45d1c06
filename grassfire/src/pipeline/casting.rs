//! `solidify` and `mould`: a solid in, its freezing or its mould and a report out.

use std::path::PathBuf;

use super::bodies::Bodies;
use super::deliver::Delivery;
use super::error::{PipelineError, StageError};
use super::record::Record;
use super::{Outcome, ReconstructOptions, finish, inputs};
use crate::Vec3;
#[cfg(feature = "occt")]
use crate::cad;
use crate::casting::mould::{self, Mould, MouldOptions, Repair, dexels, mould, parting, remaining};
use crate::casting::solidify::{Cell, HotSpot, Solidification, solidify};
use crate::io::{self, Input};
use crate::mesh::{TriMesh, repair};
use crate::monitor::Monitor;
use crate::remesh::{Remeshed, remesh};
use crate::report::render::findings::findings;
use crate::report::render::{ColourMap, Legend, section::Section, section::section};
use crate::report::{
    FeedBlock, FindingBlock, HotSpotBlock, MouldBlock, Picture, ReportError, ReportOptions,
    SolidifyBlock, UndercutBlock,
};
use crate::voxel::VoxelGrid;

/// A finished solid to be looked at.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SolidJob {
    /// The solid: mesh or STEP.
    pub part: PathBuf,
    /// Folder for all results; made when it does not exist.
    pub output: PathBuf,
    /// What stands for the run in the report.
    pub command: String,
    /// Options; those of other stages are not looked at.
    pub options: ReconstructOptions,
}

/// Files that `solidify` writes.
const SOLIDIFY_FILES: &[(&str, &str)] = &[
    (
        "solidification.vti",
        "times of freezing and feeding, Niyama's criterion",
    ),
    ("report.html", "report to read"),
    ("report.json", "report for programs"),
    ("manifest.json", "inputs, versions, times"),
];

/// Computes how a solid freezes in sand.
///
/// 1. Reads the solid: a mesh is repaired, a STEP file tessellated.
/// 2. Computes freezing ([`solidify`]).
/// 3. Writes solidification.vti, sections as pictures, the report.
///
/// # Errors
/// [`PipelineError`] names the stage and its cause.
pub fn solidify_solid(job: &SolidJob, monitor: &Monitor) -> Result<Outcome, PipelineError> {
    let options = &job.options;
    let mut record = Record::start(&job.command);
    let mesh = record.stage("read", || solid(job, monitor))?;
    record.report.inputs = record.stage("read", || {
        inputs::fingerprint(&job.part, monitor).map(|file| vec![file])
    })?;
    let frozen = record.stage("solidify", || solidify(&mesh, &options.solidify, monitor))?;
    let delivery = record.stage("write", || Delivery::open(&job.output, SOLIDIFY_FILES))?;
    record.stage("write", || delivery.solidification(&frozen))?;
    record.report.solidify = Some(block(&frozen, &options.solidify.feeders));
    let pictures = record.stage("pictures", || sections(&frozen, &options.report))?;
    finish(record, &delivery, &pictures, &options.report, monitor)
}

/// Files that `mould` writes.
const MOULD_FILES: &[(&str, &str)] = &[
    ("repaired.stl", "the part without undercuts"),
    ("report.html", "report to read"),
    ("report.json", "report for programs"),
    ("manifest.json", "inputs, versions, times"),
];

/// Looks at how a solid leaves its mould; writes the report and, when a repair is asked for, repaired.stl.
///
/// # Errors
/// [`PipelineError`] names the stage and its cause.
pub fn mould_solid(job: &SolidJob, monitor: &Monitor) -> Result<Outcome, PipelineError> {
    let options = &job.options;
    let mut record = Record::start(&job.command);
    record.stage("options", || match options.mould.repair {
        repair if repair.takes_solids() => Ok(()),
        _ => Err(mould::MouldError::NoSkeleton),
    })?;
    let mesh = record.stage("read", || solid(job, monitor))?;
    record.report.inputs = record.stage("read", || {
        inputs::fingerprint(&job.part, monitor).map(|file| vec![file])
    })?;
    let found = record.stage("mould", || mould(&mesh, &options.mould, monitor))?;
    let delivery = record.stage("write", || Delivery::open(&job.output, MOULD_FILES))?;
    if let Some(repaired) = &found.repaired {
        record.stage("write", || delivery.stl("repaired.stl", &repaired.mesh))?;
    }
    record.report.mould = Some(mould_block(&found));
    let places = sheet_places(&record);
    let pictures = record.stage("pictures", || {
        sheet_pictures(&places, &mesh, &options.report)
    })?;
    finish(record, &delivery, &pictures, &options.report, monitor)
}

/// The proposal without undercuts; none when no draw direction or no repair is asked for.
///
/// [`mould::repair`] on the proposal's voxels; cores make the bores of the non-design bodies. The topology changes here and is known
/// to all later stages.
///
/// # Errors
/// Those of the options, of the repair and of the remesh.
pub(super) fn drawn_out(
    record: &mut Record,
    from: &Remeshed,
    bodies: &Bodies,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<Option<Remeshed>, PipelineError> {
    if options.mould.draw.is_none() || !options.mould.repairs() {
        return Ok(None);
    }
    let (repaired, solid) = record.stage("mould", || {
        mould::check(&options.mould)?;
        repaired(from, bodies, options, &options.mould, false, monitor)
    })?;
    record.report.mould = Some(MouldBlock {
        repaired_volume: Some(repaired.volume[1]),
        multiple_lines_before: Some(repaired.multiple[0]),
        multiple_lines: Some(repaired.multiple[1]),
        ..MouldBlock::default()
    });
    Ok(Some(solid))
}

/// What has grown after a repair, repaired once more where gaps must not be narrow (`mould.min_gap`): what growth left of a gap may
/// be too narrow for sand, and two walls that wave towards each other have no skeleton worth having. Sides that were removed stay
/// away, cores stay open where growth has not closed them.
///
/// # Errors
/// Those of the repair and of the remesh.
pub(super) fn drawn_out_again(
    from: Remeshed,
    bodies: &Bodies,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<Remeshed, StageError> {
    let asked = MouldOptions {
        removals: Vec::new(),
        ..options.mould.clone()
    };
    if asked.draw.is_none() || asked.min_gap <= 0.0 {
        return Ok(from);
    }
    Ok(repaired(&from, bodies, options, &asked, true, monitor)?.1)
}

/// A solid repaired on its own voxels as `asked`, and remeshed on them; undercuts of cores may have closed in one that has `grown`.
fn repaired(
    from: &Remeshed,
    bodies: &Bodies,
    options: &ReconstructOptions,
    asked: &MouldOptions,
    grown: bool,
    monitor: &Monitor,
) -> Result<(mould::Repaired, Remeshed), StageError> {
    let (mesh, cell) = (from.solid.mesh(), from.field.spacing);
    let draw = asked.draw.map_or_else(Vec3::z, Vec3::from).normalize();
    let (_, height) = parting(&dexels(mesh, &draw, asked.lines));
    let mut asked = asked.repair_options(height, cell);
    asked.bores.clone_from(&bodies.bosses.free);
    asked.cores_may_close = grown;
    // Recognised ones are made from the proposal's own walls; where sections grow, films do, too, and go in the fit.
    if !bodies.recognised && !options.feed.active() {
        asked.walls = bodies.bosses.surface.clone();
    }
    let repaired = mould::repair(mesh, &draw, &asked, monitor)?;
    let on_grid = bodies.kept_open(&options.remesh, Some(cell));
    let solid = remesh(&repaired.mesh, &on_grid, monitor)?;
    Ok((repaired, solid))
}

/// Looks at the mould of a finished part when a draw direction is given; what was repaired before on voxels of `cell` mm stays in
/// the report, beside what is left of it.
pub(super) fn mould_of(
    record: &mut Record,
    part: &TriMesh,
    (bodies, cell): (&Bodies, f64),
    options: &MouldOptions,
    monitor: &Monitor,
) -> Result<(), PipelineError> {
    let Some(draw) = options.draw else {
        return Ok(());
    };
    let mut finished = None;
    if options.repairs() {
        let mut asked = options.repair_options(0.0, cell);
        asked.bores = bodies.bosses.cored();
        let draw = Vec3::from(draw).normalize();
        finished = Some(record.stage("mould", || {
            monitor.check()?;
            Ok::<_, StageError>(remaining(part, &draw, &asked))
        })?);
    }
    let options = MouldOptions {
        repair: Repair::Off,
        repair_draft: None,
        min_gap: 0.0,
        removals: Vec::new(),
        ..options.clone()
    };
    let found = record.stage("mould", || mould(part, &options, monitor))?;
    let before = record.report.mould.take().unwrap_or_default();
    let mut block = mould_block(&found);
    if let Some(feed) = &record.report.feed {
        block.findings.extend(feeding_distances(feed));
    }
    record.report.mould = Some(MouldBlock {
        repaired_volume: before.repaired_volume,
        multiple_lines_before: before.multiple_lines_before,
        multiple_lines: before.multiple_lines,
        multiple_lines_finished: finished.map(|left| left.0),
        undercut_finished: finished.map(|left| left.1),
        ..block
    });
    Ok(())
}

/// Feeders that stand too far from what they feed.
fn feeding_distances(feed: &FeedBlock) -> impl Iterator<Item = FindingBlock> {
    let far = feed.zones.iter().filter(|zone| zone.reach > zone.limit);
    far.map(|zone| FindingBlock {
        rule: "feeding_distance".to_owned(),
        place: zone.place,
        value: zone.reach,
        limit: zone.limit,
        source: "feed.feeding_distance thicknesses; in plates of steel 2 from the feeder and 2.5 from the end (classic rule)".to_owned(),
    })
}

/// The places of the sheet's findings, mm.
pub(super) fn sheet_places(record: &Record) -> Vec<Vec3> {
    let found = record.report.mould.iter().flat_map(|b| &b.findings);
    found.map(|f| f.place.into()).collect()
}

/// Pictures of the part with the places of the sheet's findings.
pub(super) fn sheet_pictures(
    places: &[Vec3],
    mesh: &TriMesh,
    options: &ReportOptions,
) -> Result<Vec<Picture>, ReportError> {
    if !options.pictures {
        return Ok(Vec::new());
    }
    Ok(findings(mesh, places, options.picture_size())?)
}

fn mould_block(found: &Mould) -> MouldBlock {
    let undercuts = found.undercuts.iter().map(|one| UndercutBlock {
        place: one.place.into(),
        volume: one.volume,
        range: one.range,
    });
    let findings = found.findings.iter().map(|one| FindingBlock {
        rule: one.rule.clone(),
        place: one.place.into(),
        value: one.value,
        limit: one.limit,
        source: one.source.clone(),
    });
    let repaired = found.repaired.as_ref();
    MouldBlock {
        draw: found.draw.into(),
        undercut_volume: found.undercut_volume,
        undercuts: found.undercuts.len(),
        undercut_places: undercuts.collect(),
        parting_flatness: found.parting_flatness,
        parting: found.parting,
        min_draft: found.min_draft,
        draft: found.draft.clone(),
        min_wall: found.min_wall,
        wall_ratio: found.wall_ratio,
        transition: found.transition,
        short_fillets: found.inner_edges.short,
        junctions: found.junctions.clone(),
        findings: findings.collect(),
        repaired_volume: repaired.map(|r| r.volume[1]),
        multiple_lines_before: repaired.map(|r| r.multiple[0]),
        multiple_lines: repaired.map(|r| r.multiple[1]),
        multiple_lines_finished: None,
        undercut_finished: None,
    }
}

/// Triangles of the solid.
pub(super) fn solid(job: &SolidJob, monitor: &Monitor) -> Result<TriMesh, StageError> {
    let options = &job.options;
    match io::read_input(&job.part, &options.read, monitor)? {
        Input::Mesh { mesh, .. } => Ok(repair(mesh, &options.repair, monitor)?.mesh),
        Input::Density { .. } => Err(StageError::DensityBody {
            path: job.part.clone(),
        }),
        Input::Step(path) => step(path, options, monitor),
    }
}

/// Chord (mm) and facet angle (radians) of a STEP solid's triangles.
#[cfg(feature = "occt")]
const FINE: (f64, f64) = (0.05, 0.3);

#[cfg(feature = "occt")]
fn step(
    path: PathBuf,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<TriMesh, StageError> {
    Ok(cad::read_surface(
        &path,
        FINE,
        &options.non_design,
        monitor,
    )?)
}

#[cfg(not(feature = "occt"))]
fn step(path: PathBuf, _: &ReconstructOptions, _: &Monitor) -> Result<TriMesh, StageError> {
    Err(StageError::NoKernel { path })
}

fn block(frozen: &Solidification, feeders: &[[f64; 3]]) -> SolidifyBlock {
    let spots = frozen.hot_spots.iter().zip(&frozen.places);
    let spot = |(spot, place): (&HotSpot, &Vec3)| {
        let away = |f: &[f64; 3]| (Vec3::from(*f) - place).norm();
        HotSpotBlock {
            place: (*place).into(),
            volume: spot.volume,
            time: spot.time,
            persistence: spot.persistence,
            fed: spot.fed,
            feeder_distance: feeders.iter().map(away).min_by(f64::total_cmp),
        }
    };
    SolidifyBlock {
        material: frozen.metal.clone(),
        sand: frozen.sand.clone(),
        sources: frozen.sources.clone(),
        cells: frozen.cells,
        cell: frozen.cell,
        steps: frozen.steps,
        freeze_time: frozen.freeze_time,
        hot_spots: spots.map(spot).collect(),
        isolated_volume: frozen.isolated_volume,
        shrinkage_volume: frozen.shrinkage_volume,
        directional_fraction: frozen.directional,
        low_niyama_fraction: frozen.low_niyama,
        modulus: frozen.modulus,
        thermal_modulus: frozen.thermal_modulus,
        energy_drift: frozen.energy_drift,
        feeders: feeders.len(),
    }
}

/// Sections through the latest hot spot that is not fed, else through the middle, across z, y and x.
fn sections(frozen: &Solidification, options: &ReportOptions) -> Result<Vec<Picture>, ReportError> {
    if !options.pictures {
        return Ok(Vec::new());
    }
    let field = &frozen.feeding;
    let isolated = frozen
        .hot_spots
        .iter()
        .zip(&frozen.places)
        .find(|(s, _)| !s.fed);
    let place = isolated.or(frozen.hot_spots.iter().zip(&frozen.places).next());
    let centre = place.map_or(field.origin, |(_, p)| *p);
    let casting = frozen.content.iter().zip(&field.values);
    let times: Vec<f64> = casting
        .filter(|(c, _)| **c == Cell::Casting)
        .map(|(_, t)| f64::from(*t))
        .collect();
    let legend = Legend::spanning("fed until, s", &times, ColourMap::Viridis);
    let marks: Vec<Vec3> = frozen
        .hot_spots
        .iter()
        .zip(&frozen.places)
        .filter(|(spot, _)| !spot.fed)
        .map(|(_, p)| *p)
        .collect();
    let names = ["x", "y", "z"];
    [2, 1, 0]
        .map(|axis| {
            let cut = cut(frozen, field, axis, &centre, &marks);
            Ok(Picture {
                title: format!("Time to which metal can be fed, section {} = {:.1} mm", names[axis], centre[axis]),
                caption: format!(
                    "{} in {}; crosses: hot spots that no feeder reaches, within 5 mm of the section",
                    frozen.metal, frozen.sand
                ),
                png: section(&cut, &legend, options.picture_size())?,
            })
        })
        .into_iter()
        .collect()
}

/// Marks farther than this from a section are not shown, mm.
const NEAR: f64 = 5.0;

fn cut(
    frozen: &Solidification,
    field: &VoxelGrid<f32>,
    axis: usize,
    centre: &Vec3,
    marks: &[Vec3],
) -> Section {
    let (u, v) = [(1, 2), (0, 2), (0, 1)][axis];
    let at = field.to_grid(centre)[axis].round().max(0.0) as usize;
    let at = at.min(field.dims[axis] - 1);
    let mut out = Section {
        width: field.dims[u],
        ..Section::default()
    };
    for b in 0..field.dims[v] {
        for a in 0..field.dims[u] {
            let mut p = [at; 3];
            (p[u], p[v]) = (a, b);
            let i = field.index(p[0], p[1], p[2]);
            let metal = frozen.content[i].is_metal();
            out.values.push(metal.then_some(f64::from(field.values[i])));
        }
    }
    let near = marks
        .iter()
        .filter(|p| (p[axis] - centre[axis]).abs() < NEAR);
    out.marks = near
        .map(|p| field.to_grid(p))
        .map(|g| [g[u], g[v]])
        .collect();
    out
}
