//! The whole chain, top to bottom: a proposal in, a checked CAD solid and a report out.
//!
//! A newcomer reads the steps at [`reconstruct`], then `rebuild`: every stage is one call, its result one value that the next
//! stage takes.

mod bodies;
#[cfg(feature = "occt")]
mod case_bodies;
mod casting;
mod check;
mod construct;
mod deliver;
mod design;
mod edits;
mod error;
mod even;
mod exchange;
mod feeding;
mod fewest;
mod finished;
mod follow;
mod illustrate;
mod inputs;
mod lay_out;
mod measure;
#[cfg(feature = "occt")]
mod notches;
mod optimize;
mod proposal;
mod recognise;
mod record;
mod repairs;
mod run;
mod score;
mod shape;
mod short_edges;
mod sizes;
mod steady;
mod tetrahedra;
mod union;
mod verify;

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use casting::{SolidJob, mould_solid, solidify_solid};
pub use check::{check_case, draw_case};
pub use error::{PipelineError, StageError};
pub use exchange::{FileOptions, Format};
pub use optimize::{OptimizeJob, optimize};
pub use repairs::Loads;
pub use run::{RunJob, Stage, run, share_optimization};
pub use shape::RetryOptions;
pub use steady::SteadyLimits;
pub use verify::{VerifyJob, verify_solid};

use crate::cad::{CadOptions, NonDesignOptions, StepOptions};
use crate::case::Body;
use crate::casting::feed::FeedOptions;
use crate::casting::mould::{MouldOptions, Repair};
use crate::casting::solidify::SolidifyOptions;
use crate::edit::Edit;
use crate::fit::FitOptions;
use crate::io::ReadOptions;
use crate::medial::{self, MedialOptions, PoleOptions};
use crate::mesh::{RepairOptions, TriMesh};
use crate::monitor::Monitor;
use crate::non_design::FlatOptions;
use crate::radii::RadiiOptions;
use crate::remesh::{CutOutOptions, RemeshOptions, Remeshed, WrapOptions};
use crate::report::{Picture, Report, ReportOptions};
use crate::skeleton::{Layout, SkeletonOptions};
use crate::spline::{BrepOptions, PatchOptions, TessellateOptions};
use crate::thicken::ThickenOptions;

use bodies::Bodies;
use construct::Site;
use deliver::Delivery;
use finished::Finished;
use record::Record;

/// Options of all stages; each field is one table of the project file and one prefix of `--set`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ReconstructOptions {
    /// Threads; 0 takes all cores.
    pub threads: usize,
    /// Reading files.
    pub read: ReadOptions,
    /// Reading and rebuilding of the non-design bodies.
    pub non_design: NonDesignOptions,
    /// Flat faces that become exactly plane.
    pub flats: FlatOptions,
    /// Repair of the input mesh.
    pub repair: RepairOptions,
    /// Voxel remesh and topological noise.
    pub remesh: RemeshOptions,
    /// Cutting non-design bodies out of the proposal.
    pub cut_out: CutOutOptions,
    /// Medial axis.
    pub medial: MedialOptions,
    /// Pole skeleton and wall thickness.
    pub poles: PoleOptions,
    /// Quad skeleton.
    pub skeleton: SkeletonOptions,
    /// Radii of the skeleton.
    pub radii: RadiiOptions,
    /// Thickening.
    pub thicken: ThickenOptions,
    /// Fit to the proposal.
    pub fit: FitOptions,
    /// Edits of the proposal's skeleton, in their order.
    pub edits: Vec<Edit>,
    /// Sections that grow towards the feeders.
    pub feed: FeedOptions,
    /// What to do when a body cuts itself.
    pub retry: RetryOptions,
    /// The body's last resort on bulky parts.
    pub wrap: WrapOptions,
    /// G1 patches.
    pub patches: PatchOptions,
    /// Blocks and boundary representation.
    pub brep: BrepOptions,
    /// Tessellation of the limit surface.
    pub tessellate: TessellateOptions,
    /// CAD solid and its union with the non-design bodies.
    pub cad: CadOptions,
    /// Which files are written of the part.
    pub files: FileOptions,
    /// Texts in the STEP, IGES and 3MF files.
    pub step: StepOptions,
    /// Mould: undercuts, parting, draft, walls.
    pub mould: MouldOptions,
    /// Solidification.
    pub solidify: SolidifyOptions,
    /// Report and pictures.
    pub report: ReportOptions,
}

/// One reconstruction: what to read, where to write, and how.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ReconstructJob {
    /// The proposal: mesh or density file.
    pub part: PathBuf,
    /// Bodies to unite with the result as they are (STEP or STL).
    pub non_design: Vec<PathBuf>,
    /// The design space as STEP: its faces that the proposal still follows are non-design.
    pub design_space: Option<PathBuf>,
    /// A quad skeleton drawn elsewhere, in place of ours.
    pub skeleton: Option<PathBuf>,
    /// Bodies of a project file to unite as well; their paths begin at `folder`.
    pub bodies: Vec<Body>,
    /// Folder of the project file.
    pub folder: PathBuf,
    /// The loads by which repairs of undercuts are compared (`mould.repair=best`).
    pub loads: Option<Loads>,
    /// Folder for all results; made when it does not exist.
    pub output: PathBuf,
    /// What stands for the run in the report.
    pub command: String,
    /// Options of all stages.
    pub options: ReconstructOptions,
}

/// What a run gives back.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// The report as written to `report.json`.
    pub report: Report,
    /// Checks that were not met, one line each; empty when all is well.
    pub failed_checks: Vec<String>,
}

/// Turns a proposal into a checked CAD solid and a report.
///
/// 1. Reads the proposal and the non-design bodies; repairs the mesh; recognises bores and bosses in it.
/// 2. Remeshes it on voxels to a closed solid and removes topological noise.
/// 3. Replays the list of edits; with a draw direction and a repair, takes undercuts away (the best repair is looked for before
///    all this, among parts made by these steps). Computes wall thickness (poles).
/// 4. With feeders, lets the proposal's sections grow towards them.
/// 5. Cuts the non-design bodies out; steps 6 to 9 are done with what is left, and once more with the whole proposal when
///    that does not give a valid union.
/// 6. Computes the pruned medial axis; builds the quad skeleton (or reads the given one), maps and smooths its radii.
/// 7. Thickens it and fits the limit surface to the proposal; with feeders, radii that still fall short grow.
/// 8. Builds the G1 faces and the boundary representation.
/// 9. Builds the CAD solid, unites it with the non-design bodies, checks it.
/// 10. Measures distance and volume, draws the pictures, writes the report.
///
/// Files are written as their stage ends, each atomically; nothing is written when the input is refused.
///
/// # Errors
/// [`PipelineError`] names the stage and its cause. A result that was made but fails a check is not an error: see
/// [`Outcome::failed_checks`].
pub fn reconstruct(job: &ReconstructJob, monitor: &Monitor) -> Result<Outcome, PipelineError> {
    let mut record = Record::start(&job.command);
    let rebuilt = rebuild(&mut record, job, monitor)?;
    finish(
        record,
        &rebuilt.delivery,
        &rebuilt.pictures,
        &job.options.report,
        monitor,
    )
}

/// A finished part.
struct Rebuilt {
    delivery: Delivery,
    pictures: Vec<Picture>,
    /// Its triangles.
    mesh: TriMesh,
}

/// Verdicts and the report, the last files of every run.
fn finish(
    mut record: Record,
    delivery: &Delivery,
    pictures: &[Picture],
    options: &ReportOptions,
    monitor: &Monitor,
) -> Result<Outcome, PipelineError> {
    let failed_checks = record.finish(&options.limits, monitor);
    delivery
        .report(&mut record.report, pictures)
        .map_err(|source| PipelineError {
            stage: "report",
            source,
        })?;
    Ok(Outcome {
        report: record.report,
        failed_checks,
    })
}

/// A proposal that a part can be made of.
struct Prepared {
    bodies: Bodies,
    remeshed: Remeshed,
    /// The same at the voxel that its skeleton is made at, when that is coarser and nothing is done to the proposal.
    coarser: Option<Remeshed>,
    /// What the list of edits made of it, when there is one.
    edited: Option<Remeshed>,
    /// The surface that was read is noise.
    noisy: bool,
}

/// The first stages of [`rebuild`]: reading, recognition, remesh, edits.
fn prepared(
    record: &mut Record,
    job: &ReconstructJob,
    monitor: &Monitor,
) -> Result<Prepared, PipelineError> {
    let options = &job.options;
    let mut bodies = record.stage("non_design", || bodies::read(job, monitor))?;
    let proposal = record.stage("read", || inputs::proposal(job, monitor))?;
    record.stage("read", || bodies.check_unit(proposal.bounds()))?;
    record.report.inputs = record.stage("read", || inputs::fingerprints(job, monitor))?;
    record.report.input = Some(proposal.block());
    let recognised = record.stage("recognise", || {
        recognise::recognise(job, &proposal, &mut bodies, monitor)
    })?;
    record.report.candidates = recognised.candidates;
    record.report.design_space = recognised.faces;

    let remeshed = record.stage("remesh", || {
        inputs::remesh(&proposal, &bodies, options, options.remesh.voxel, monitor)
    })?;
    record.report.remesh = Some(measure::remesh_block(&remeshed));
    let edited = edits::edited(record, &remeshed, &bodies, options, monitor)?;
    let as_it_is = edited.is_none()
        && options.mould.repair == Repair::Off
        && !options.feed.active()
        && job.skeleton.is_none();
    let coarser = if as_it_is {
        record.stage("remesh", || {
            inputs::coarser(&proposal, &bodies, &remeshed, options, monitor)
        })?
    } else {
        None
    };
    Ok(Prepared {
        bodies,
        remeshed,
        coarser,
        edited,
        noisy: proposal.is_noise(),
    })
}

/// The proposal without undercuts when they are to be taken away; notches of the bodies that this filled are closed.
fn drawn_out(
    record: &mut Record,
    from: &Remeshed,
    bodies: &mut Bodies,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<Option<Remeshed>, PipelineError> {
    let repaired = casting::drawn_out(record, from, bodies, options, monitor)?;
    #[cfg(feature = "occt")]
    if let Some(repaired) = &repaired {
        record.stage("mould", || {
            notches::close(bodies, &repaired.field, options, monitor)
        })?;
    }
    Ok(repaired)
}

/// The plain layout with feeders, because a body that grows does it in many fits, of few quads the better; and for noise.
fn first_layout(options: &ReconstructOptions, noisy: bool) -> Layout {
    match options.skeleton.layout {
        Layout::Auto if noisy || options.feed.active() => Layout::Plain,
        layout => layout,
    }
}

/// All stages of [`reconstruct`] but the report.
fn rebuild(
    record: &mut Record,
    job: &ReconstructJob,
    monitor: &Monitor,
) -> Result<Rebuilt, PipelineError> {
    exchange::check(&job.options).map_err(|source| PipelineError {
        stage: "options",
        source,
    })?;
    let drawn = record.stage("read", || inputs::skeleton(job, monitor))?;
    let chosen;
    let job = if job.options.mould.repair == Repair::Best {
        chosen = repairs::best(record, job, monitor)?;
        &chosen
    } else {
        job
    };
    let options = &job.options;
    let Prepared {
        mut bodies,
        remeshed,
        coarser,
        edited,
        noisy,
    } = prepared(record, job, monitor)?;
    // Undercuts last: whatever the edits did, none are left.
    let from = edited.as_ref().unwrap_or(&remeshed);
    let repaired = drawn_out(record, from, &mut bodies, options, monitor)?;
    let (unedited, original) = match edited {
        None => (None, repaired.unwrap_or(remeshed)),
        Some(edited) => (Some(remeshed), repaired.unwrap_or(edited)),
    };
    let shown = unedited.as_ref().unwrap_or(&original);
    let placed;
    let options = if options.feed.feeders.is_empty() {
        options
    } else {
        placed = record.stage("feed", || feeding::placed(options, &original, monitor))?;
        &placed
    };
    let delivery = record.stage("write", || Delivery::open(&job.output, deliver::FILES))?;
    record.stage("write", || delivery.proposal(&shown.solid))?;

    let poles = record.stage("poles", || {
        medial::poles(&shown.solid, &options.poles, monitor)
    })?;
    record.stage("write", || delivery.poles(&poles, &shown.solid))?;
    let fed = match drawn {
        // The radii of a drawn skeleton are what its author wants: they are edited, not the proposal.
        Some(_) => None,
        None => feeding::edit(record, &original, &bodies, options, monitor)?,
    };
    let layout = first_layout(options, noisy);
    let base = coarser.as_ref().unwrap_or(&original);
    let usual_sizes = sizes::usual(options).filter(|_| drawn.is_none());
    let mut site = Site {
        record,
        remeshed: base,
        fine: coarser.as_ref().map(|_| &original),
        bodies: &mut bodies,
        drawn: drawn.as_ref(),
        delivery: &delivery,
        options,
        usual_sizes: usual_sizes.as_ref(),
        size_refused: false,
        monitor,
        must_grow: false,
        grown: None,
        layout,
        first_layout: layout,
        regular_refused: None,
        steady: steady::first(options, layout, drawn.as_ref()),
        steady_refused: None,
        wedges: false,
    };
    let made = match &fed {
        Some(grown) => site.build_grown(grown)?,
        None => site.build()?,
    };
    let grown_before = !std::ptr::eq(site.remeshed, base);
    let grown = site.grown.take();
    let before = fed.as_ref().filter(|_| grown_before).map(|f| &f.solid);
    let remeshed = grown.as_ref().or(before).unwrap_or(&original);
    let finished = Finished {
        job,
        options,
        original: &original,
        remeshed,
        bodies: &bodies,
        poles: &poles,
        made: &made,
        delivery: &delivery,
    };
    finished.write(record, monitor)?;
    finished.measure(record, monitor)?;
    let pictures = finished.draw(record, monitor)?;
    Ok(Rebuilt {
        delivery,
        pictures,
        mesh: made.part.mesh,
    })
}
