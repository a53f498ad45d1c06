//! The best repair of a proposal's undercuts: every variant is made, proved and compared.

use std::path::{Path, PathBuf};

use super::edits::skeleton_of;
use super::error::{PipelineError, StageError};
use super::record::Record;
use super::{ReconstructJob, ReconstructOptions, finish, prepared, rebuild, verify};
use crate::Vec3;
use crate::case::Case;
use crate::casting::mould::{
    self, Conflict, Repair, Room, best_direction, choose, conflicts, dexels, parting, rooms,
};
use crate::edit::Edit;
use crate::monitor::Monitor;
use crate::remesh::Remeshed;
use crate::report::{RepairsBlock, Report, RoomBlock, VariantBlock};

/// Name of this stage.
const STAGE: &str = "repairs";
/// Folder of the variants.
const FOLDER: &str = "repairs";
/// Rooms with fewer voxels are steps of the surface: they are filled in every variant.
const LEAST: f64 = 64.0;
/// What a core costs when nobody says so: the metal of this share of the proposal.
const PRICE: f64 = 0.1;
/// Voxels across the mean wall with which variants are compared, when the project file gives no edge.
const ACROSS: f64 = 4.0;

/// The loads that variants are judged by.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Loads {
    /// The project file as read.
    pub case: Case,
    /// Where it lies: its paths begin there.
    pub path: PathBuf,
}

/// What is done about one room.
#[derive(Debug, Clone, PartialEq)]
enum Way {
    Fill,
    Core,
    Remove,
    Turn(Box<[Edit; 2]>),
}

impl Way {
    fn name(&self) -> &'static str {
        match self {
            Self::Fill => "fill",
            Self::Core => "core",
            Self::Remove => "remove",
            Self::Turn(_) => "turn",
        }
    }
}

/// The proposal along its draw direction, and what can be done about its rooms.
struct Search<'a> {
    job: &'a ReconstructJob,
    draw: Vec3,
    rooms: Vec<Room>,
    ways: Vec<Vec<Way>>,
    /// Of one core, mm3 of metal.
    price: f64,
    loads: Option<Loads>,
    variants: Vec<VariantBlock>,
}

/// The job with the best repair in place of the search for it.
///
/// 1. The draw direction, where none is given, is the best of the proposal. Rooms are its connected undercuts along it, without
///    the bores of non-design bodies and the undercuts of `mould.cores`.
/// 2. A room can be filled, or left to a core. With loads, its lesser side can be removed too, and members that shadow each other
///    there can be turned ([`conflicts`]): without loads nobody knows what they carry.
/// 3. Variants ([`choose`]) are made by the whole chain into folders of their own; with loads the stiffness of each is computed, all
///    on grids of the same edge.
/// 4. The least strain energy times volume is the best, where a core counts as volume of metal (`mould.core_price`); without
///    loads the least volume so counted. Parts that meet all checks go before others, parts that are not valid are out.
///
/// A variant that cannot be made is a row that says why.
///
/// # Errors
/// Those of reading and remeshing the proposal; cancelled. Where no variant is valid, everything is filled, with a warning.
pub(super) fn best(
    record: &mut Record,
    job: &ReconstructJob,
    monitor: &Monitor,
) -> Result<ReconstructJob, PipelineError> {
    let told = monitor.warnings().len();
    let found = record.stage(STAGE, || Ok::<_, StageError>(searched(job, told, monitor)))?;
    monitor.keep_warnings(told);
    let (mut search, best) = found?;
    if best.is_none() {
        let text = "no variant gives a valid part: all undercuts are filled";
        monitor.warn(STAGE, text);
    }
    let best = best.unwrap_or_else(|| vec![0; search.rooms.len()]);
    let name = search.name(&best);
    for variant in &mut search.variants {
        variant.chosen = variant.name == name;
    }
    let job = ReconstructJob {
        options: search.options(&best),
        ..job.clone()
    };
    record.report.repairs = Some(search.block());
    Ok(job)
}

fn searched<'a>(
    job: &'a ReconstructJob,
    told: usize,
    monitor: &Monitor,
) -> Result<(Search<'a>, Option<Vec<usize>>), PipelineError> {
    let mut search = Search::new(job, monitor)?;
    let counts: Vec<usize> = search.ways.iter().map(Vec::len).collect();
    let most = job.options.mould.tries;
    let best = choose(&counts, most, |ways| {
        monitor.keep_warnings(told);
        search.judge(ways, monitor)
    })?;
    Ok((search, best))
}

impl<'a> Search<'a> {
    fn new(job: &'a ReconstructJob, monitor: &Monitor) -> Result<Self, PipelineError> {
        // The part that is chosen is read and remeshed once more, with figures of its own.
        let mut record = Record::start(&job.command);
        let first = prepared(&mut record, job, monitor)?;
        let from = first.edited.as_ref().unwrap_or(&first.remeshed);
        let (mesh, asked) = (from.solid.mesh(), &job.options.mould);
        let draw = record.stage("mould", || -> Result<Vec3, StageError> {
            mould::check(asked)?;
            Ok(match asked.draw {
                Some(draw) => Vec3::from(draw).normalize(),
                None => {
                    let lines = 128.min(asked.lines);
                    let draft = asked.rules.draft().value;
                    best_direction(mesh, asked.directions, lines, draft, monitor)?.draw
                }
            })
        })?;
        let cell = from.field.spacing;
        let (_, height) = parting(&dexels(mesh, &draw, asked.lines));
        let mut base = asked.repair_options(height, cell);
        base.kind = Repair::Fill;
        base.bores.clone_from(&first.bodies.bosses.free);
        let least = asked.least_undercut.unwrap_or(LEAST * cell.powi(3));
        let rooms = record.stage("mould", || rooms(mesh, &draw, &base, least, monitor))?;
        let ways = ways(&mut record, job, from, &draw, &rooms, monitor)?;
        Ok(Self {
            job,
            draw,
            price: asked.core_price.unwrap_or(PRICE * from.solid.volume()),
            rooms,
            ways,
            loads: job.loads.clone().map(comparable),
            variants: Vec::new(),
        })
    }

    fn picked<'b>(&'b self, ways: &'b [usize]) -> impl Iterator<Item = (&'b Room, &'b Way)> {
        let way = |(n, room): (usize, &'b Room)| (room, &self.ways[n][ways[n]]);
        self.rooms.iter().enumerate().map(way)
    }

    /// Such as `1-core_2-turn`; rooms that are filled are not named.
    fn name(&self, ways: &[usize]) -> String {
        let named = self.picked(ways).enumerate();
        let parts: Vec<String> = named
            .filter(|(_, (_, way))| **way != Way::Fill)
            .map(|(n, (_, way))| format!("{}-{}", n + 1, way.name()))
            .collect();
        if parts.is_empty() {
            return "fill".to_owned();
        }
        parts.join("_")
    }

    /// The options of a variant.
    fn options(&self, ways: &[usize]) -> ReconstructOptions {
        let mut out = self.job.options.clone();
        out.mould.draw = Some(self.draw.into());
        out.mould.repair = Repair::Fill;
        for (room, way) in self.picked(ways) {
            match way {
                Way::Fill => {}
                Way::Core => out.mould.cores.push(room.place.into()),
                Way::Remove => out.mould.removals.push(room.place.into()),
                Way::Turn(edits) => out.edits.extend(edits.iter().cloned()),
            }
        }
        out
    }

    /// Makes and proves a variant and adds its row; gives whether a check is not met, and its cost.
    fn judge(
        &mut self,
        ways: &[usize],
        monitor: &Monitor,
    ) -> Result<Option<(bool, f64)>, PipelineError> {
        let name = self.name(ways);
        monitor.step(STAGE, &name, 0.0).map_err(|e| PipelineError {
            stage: STAGE,
            source: e.into(),
        })?;
        let mut row = VariantBlock {
            cores: self.picked(ways).filter(|w| *w.1 == Way::Core).count(),
            ways: self.picked(ways).map(|w| w.1.name().to_owned()).collect(),
            ..VariantBlock::default()
        };
        match self.made(&name, ways, monitor) {
            Err(error) if error.is_cancelled() => return Err(error),
            Err(error) => row.error = Some(format!("{}: {}", error.stage, error.source)),
            Ok(report) => fill_row(&mut row, &report),
        }
        row.name = name;
        let metal = row.volume.map(|v| v + row.cores as f64 * self.price);
        row.cost = match self.loads {
            Some(_) => metal.zip(row.strain_energy).map(|(v, c)| v * c),
            None => metal,
        };
        let missed = row.checks_met < row.checks;
        let cost = row.cost.filter(|_| row.valid && row.error.is_none());
        self.variants.push(row);
        Ok(cost.map(|cost| (missed, cost)))
    }

    fn made(
        &mut self,
        name: &str,
        ways: &[usize],
        monitor: &Monitor,
    ) -> Result<Report, PipelineError> {
        let mut options = self.options(ways);
        options.report.pictures = false;
        let variant = ReconstructJob {
            output: self.job.output.join(FOLDER).join(name),
            command: format!("{} (variant {name})", self.job.command),
            options,
            ..self.job.clone()
        };
        let mut record = Record::start(&variant.command);
        let made = rebuild(&mut record, &variant, monitor)?;
        if let Some(loads) = &mut self.loads {
            let folder = loads.path.parent().unwrap_or(Path::new(""));
            let case = &loads.case;
            let found = verify::prove(&mut record, case, folder, &made.mesh, None, monitor)?;
            // The same edge for all.
            loads.case.verify.h.get_or_insert(found.coarse.grid.h);
        }
        let options = &variant.options.report;
        let outcome = finish(record, &made.delivery, &[], options, monitor)?;
        Ok(outcome.report)
    }

    fn block(self) -> RepairsBlock {
        let rooms = self.rooms.iter().map(|room| RoomBlock {
            place: room.place.into(),
            volume: room.volume,
            lesser: room.lesser,
        });
        RepairsBlock {
            draw: self.draw.into(),
            by_stiffness: self.loads.is_some(),
            core_price: self.price,
            rooms: rooms.collect(),
            variants: self.variants,
        }
    }
}

/// Loads for a comparison: a grid that is fine enough for that, and no other volume.
fn comparable(mut loads: Loads) -> Loads {
    let options = &mut loads.case.verify;
    options.voxels_across = options.voxels_across.min(ACROSS);
    options.equal_volume = None;
    options.tetrahedra.enabled = false;
    // Without a fraction there is no volume to compare at.
    loads.case.optimize.volume_fraction = 0.0;
    loads
}

/// What can be done about each room, filling first.
fn ways(
    record: &mut Record,
    job: &ReconstructJob,
    from: &Remeshed,
    draw: &Vec3,
    rooms: &[Room],
    monitor: &Monitor,
) -> Result<Vec<Vec<Way>>, PipelineError> {
    let mut out = vec![vec![Way::Fill, Way::Core]; rooms.len()];
    if job.loads.is_none() || rooms.is_empty() {
        return Ok(out);
    }
    for ways in &mut out {
        ways.push(Way::Remove);
    }
    let skeleton = skeleton_of(record, from, &job.options, monitor)?;
    for conflict in conflicts(&skeleton, draw, from.field.spacing) {
        if let Some(n) = between(&conflict, rooms) {
            out[n].push(Way::Turn(Box::new(conflict.turn)));
        }
    }
    Ok(out)
}

/// The room nearest to the middle between two members, no farther from it than they are.
fn between(conflict: &Conflict, rooms: &[Room]) -> Option<usize> {
    let [a, b] = conflict.places;
    let away = |n: &usize| (rooms[*n].place - (a + b) / 2.0).norm();
    let nearest = (0..rooms.len()).min_by(|m, n| away(m).total_cmp(&away(n)));
    nearest.filter(|n| away(n) <= (b - a).norm())
}

/// The figures of a finished variant.
fn fill_row(row: &mut VariantBlock, report: &Report) {
    let (proof, mould) = (report.verify.as_ref(), report.mould.as_ref());
    row.volume = report.volume.as_ref().map(|v| v.solid);
    row.strain_energy = proof.map(|p| p.strain_energy);
    row.lines_before = mould.and_then(|m| m.multiple_lines_before);
    row.lines_repaired = mould.and_then(|m| m.multiple_lines);
    row.lines = mould.and_then(|m| m.multiple_lines_finished);
    row.undercut = mould.and_then(|m| m.undercut_finished);
    row.valid = report.solid.as_ref().is_none_or(|s| s.valid);
    // Those of the part: the proof is as rough as a comparison may be.
    let own = || {
        report
            .checks
            .iter()
            .filter(|c| !c.name.starts_with("verify."))
    };
    row.checks_met = own().filter(|c| c.met).count();
    row.checks = own().count();
    row.seconds = report.stages.iter().map(|s| s.seconds).sum();
}
