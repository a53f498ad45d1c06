//! Non-design bodies that nobody named: from the proposal alone, and from the faces of a design space.

use super::bodies::Bodies;
use super::error::StageError;
use super::inputs::Proposal;
use super::{ReconstructJob, ReconstructOptions};
use crate::cad::primitives::Primitive;
#[cfg(feature = "occt")]
use crate::cad::{self, CadError, NonDesignBody};
use crate::mesh::TriMesh;
use crate::monitor::Monitor;
use crate::non_design::{self, Boss, Candidate, Flats, RecogniseMode, Recognised};
use crate::remesh::default_voxel;
use crate::report::{CandidateBlock, DesignFaceBlock};

pub(super) const STAGE: &str = "recognise";
/// Where recognised bodies come from.
#[cfg(feature = "occt")]
pub(super) const SOURCE: &str = "recognised in the proposal";
/// A hollow that turns by more than this is worth a word why it is no boss, radians.
const HALF_TURN: f64 = std::f64::consts::PI;

/// The tables of the report.
#[derive(Default)]
pub(super) struct Found {
    pub(super) candidates: Vec<CandidateBlock>,
    pub(super) faces: Vec<DesignFaceBlock>,
}

/// Recognises non-design bodies and adds those that are to be united to `bodies`.
///
/// 1. Nothing when `non_design.recognise` is off and there is no design space.
/// 2. Planes, cylinders and bosses of the proposal; with a crease angle the flat faces that become exactly plane.
/// 3. With a design space: its covered faces, its covered solids, and only the bosses on its bores, with its radii.
/// 4. `auto` without given bodies: the solids and bosses are united with the part.
pub(super) fn recognise(
    job: &ReconstructJob,
    proposal: &Proposal,
    bodies: &mut Bodies,
    monitor: &Monitor,
) -> Result<Found, StageError> {
    let options = &job.options;
    let mode = options.non_design.recognise;
    let creased = options.flats.crease_angle.is_some();
    if mode == RecogniseMode::Off && job.design_space.is_none() && !creased {
        return Ok(Found::default());
    }
    let Proposal::Mesh { mesh, .. } = proposal else {
        let given = !job.non_design.is_empty() || !job.bodies.is_empty();
        if mode == RecogniseMode::Auto && !given || job.design_space.is_some() || creased {
            monitor.warn(
                STAGE,
                "non-design bodies and flat faces are recognised in meshes only, not in densities",
            );
        }
        return Ok(Found::default());
    };
    let recognised = non_design::recognise(mesh, &options.non_design.recognition, monitor)?;
    let unite = mode == RecogniseMode::Auto && job.non_design.is_empty() && job.bodies.is_empty();
    let mut found = Found::default();
    let mut bosses = recognised.bosses.clone();
    bodies.flats = flat_faces(mesh, &recognised, &bodies.surface, options, monitor);
    for boss in &mut bosses {
        bodies.flats.end_on(boss);
    }
    if let Some(path) = &job.design_space {
        let space = design_space(path, mesh, options, monitor)?;
        bosses = space.bosses(&bosses);
        if unite {
            space.unite(path, bodies, options, monitor)?;
        }
        found.faces = space.rows;
    }
    let united = if unite {
        add(&bosses, bodies, options, monitor)?
    } else {
        Vec::new()
    };
    bodies.recognised = unite && !bodies.surface.triangles.is_empty();
    let listed = options.non_design.recognition.max_listed;
    found.candidates = table(&recognised, &united, unite, listed);
    Ok(found)
}

/// The flat faces that become exactly plane, those on the `given` bodies' planes exactly there; none where an edit moves the
/// surface.
fn flat_faces(
    mesh: &TriMesh,
    recognised: &Recognised,
    given: &TriMesh,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Flats {
    if options.flats.crease_angle.is_none() {
        return Flats::default();
    }
    if !options.edits.is_empty()
        || !options.feed.feeders.is_empty()
        || options.mould.draw.is_some() && options.mould.repairs()
    {
        monitor.warn(STAGE, "flat faces are not cut plane, because edits, feeders or a draw repair move the surface");
        return Flats::default();
    }
    let voxel = voxel(mesh, options);
    let mut flats = non_design::flats(mesh, &recognised.candidates, voxel, &options.flats);
    flats.adopt_planes(given);
    flats
}

fn voxel(mesh: &TriMesh, options: &ReconstructOptions) -> f64 {
    let given = options.remesh.voxel;
    given.unwrap_or_else(|| default_voxel(mesh, &options.remesh))
}

/// Makes the bosses solid; gives the bores of those that became bodies.
#[cfg(feature = "occt")]
fn add(
    bosses: &[Boss],
    bodies: &mut Bodies,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<Vec<usize>, StageError> {
    let mut united = Vec::new();
    for boss in bosses {
        let name = format!("boss {}", bodies.solids.len() + 1);
        match cad::from_boss(&name, SOURCE, boss, &options.non_design, monitor) {
            Ok(body) => {
                bodies.sleeves.push((bodies.solids.len(), boss.clone()));
                bodies.add(vec![body])?;
                united.push(boss.bore);
            }
            Err(CadError::Cancelled(cancelled)) => return Err(cancelled.into()),
            Err(error) => monitor.warn(STAGE, format!("{name} cannot be made solid: {error}")),
        }
    }
    Ok(united)
}

/// Without OpenCASCADE there are no solids.
#[cfg(not(feature = "occt"))]
fn add(
    _bosses: &[Boss],
    _bodies: &mut Bodies,
    _options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<Vec<usize>, StageError> {
    monitor.warn(
        STAGE,
        "this build has no OpenCASCADE: recognised bodies are listed, not united",
    );
    Ok(Vec::new())
}

/// A design space matched with the proposal.
#[cfg_attr(
    not(feature = "occt"),
    allow(dead_code, reason = "only OpenCASCADE reads STEP files")
)]
struct Matched {
    rows: Vec<DesignFaceBlock>,
    /// The covered bores.
    bores: Vec<(crate::Vec3, crate::Vec3, f64)>,
    tolerance: f64,
    /// Solids whose faces are all covered, when there are several.
    #[cfg(feature = "occt")]
    solids: Vec<usize>,
}

impl Matched {
    fn bosses(&self, all: &[Boss]) -> Vec<Boss> {
        non_design::sleeves(all, &self.bores, self.tolerance)
    }
}

#[cfg(feature = "occt")]
impl Matched {
    /// Adds the covered solids of a design space of several solids.
    fn unite(
        &self,
        path: &std::path::Path,
        bodies: &mut Bodies,
        options: &ReconstructOptions,
        monitor: &Monitor,
    ) -> Result<(), StageError> {
        if self.solids.is_empty() {
            return Ok(());
        }
        let all: Vec<NonDesignBody> = cad::read(path, &options.non_design, monitor)?;
        let keep = all.into_iter().enumerate();
        let kept = keep
            .filter(|(i, _)| self.solids.contains(i))
            .map(|(_, body)| body);
        bodies.add(kept.collect())
    }
}

#[cfg(not(feature = "occt"))]
impl Matched {
    fn unite(
        &self,
        _path: &std::path::Path,
        _bodies: &mut Bodies,
        _options: &ReconstructOptions,
        _monitor: &Monitor,
    ) -> Result<(), StageError> {
        Ok(())
    }
}

#[cfg(feature = "occt")]
fn design_space(
    path: &std::path::Path,
    mesh: &TriMesh,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<Matched, StageError> {
    if !matches!(
        crate::io::read_input(path, &options.read, monitor)?,
        crate::io::Input::Step(_)
    ) {
        return Err(StageError::DesignSpace {
            path: path.to_owned(),
        });
    }
    let matching = &options.non_design.design_space;
    let tolerance = matching.tolerance * voxel(mesh, options);
    let space = cad::read_design_space(path, 0.1 * tolerance)?;
    super::bodies::check_unit(&space.faces, mesh.bounds())?;
    let faces = non_design::coverage(&space.faces, mesh, tolerance, matching, monitor)?;
    let covered = |list: &Vec<u32>| list.iter().all(|&f| faces[f as usize].non_design);
    let solids: Vec<usize> = (0..space.solids.len())
        .filter(|&s| space.solids.len() > 1 && covered(&space.solids[s]))
        .collect();
    let solid_of = |face: usize| space.solids.iter().position(|s| s.contains(&(face as u32)));
    let rows = faces.iter().enumerate().map(|(f, face)| DesignFaceBlock {
        face: f + 1,
        solid: solid_of(f).map_or(0, |s| s + 1),
        kind: space.kinds.get(f).copied().unwrap_or_default().to_owned(),
        area: face.area,
        place: face.middle.into(),
        coverage: face.coverage,
        non_design: face.non_design,
    });
    let rows: Vec<DesignFaceBlock> = rows.collect();
    let bores = space
        .bores
        .into_iter()
        .filter(|b| !b.faces.is_empty() && b.faces.iter().all(|f| faces[*f as usize].non_design));
    Ok(Matched {
        rows,
        bores: bores.map(|b| (b.origin, b.direction, b.radius)).collect(),
        tolerance,
        solids,
    })
}

#[cfg(not(feature = "occt"))]
fn design_space(
    path: &std::path::Path,
    _mesh: &TriMesh,
    _options: &ReconstructOptions,
    _monitor: &Monitor,
) -> Result<Matched, StageError> {
    Err(StageError::NoKernel {
        path: path.to_owned(),
    })
}

/// Marks the table when the recognised bodies were left out in the end.
pub(super) fn left_out(candidates: &mut [CandidateBlock]) {
    for row in candidates.iter_mut().filter(|row| row.used) {
        row.used = false;
        row.reason = Some("not united with the part, see the warnings".to_owned());
    }
}

/// Bosses first, then the holes that are none, then the largest other surfaces.
fn table(found: &Recognised, united: &[usize], unite: bool, most: usize) -> Vec<CandidateBlock> {
    let mut rows = Vec::new();
    let mut done = vec![false; found.candidates.len()];
    for boss in &found.bosses {
        done[boss.bore] = true;
        let length = boss.extent[1] - boss.extent[0];
        let middle = boss.origin + boss.direction * ((boss.extent[0] + boss.extent[1]) / 2.0);
        let used = united.contains(&boss.bore);
        rows.push(CandidateBlock {
            kind: "boss".to_owned(),
            outer_radius: Some(boss.outer_radius),
            length,
            place: middle.into(),
            used,
            reason: (unite && !used).then(|| {
                "its bore is no covered face of the design space, or it is no valid solid"
                    .to_owned()
            }),
            ..row(&found.candidates[boss.bore])
        });
    }
    let holes = |(bore, _): &&(usize, String)| found.candidates[*bore].angle > HALF_TURN;
    for (bore, reason) in found.rejected.iter().filter(holes) {
        done[*bore] = true;
        rows.push(CandidateBlock {
            reason: Some(reason.clone()),
            ..row(&found.candidates[*bore])
        });
    }
    rows.truncate(most.max(found.bosses.len()));
    let others = (0..done.len()).filter(|&i| !done[i]);
    let room = most.saturating_sub(rows.len());
    rows.extend(others.take(room).map(|i| row(&found.candidates[i])));
    rows
}

fn row(candidate: &Candidate) -> CandidateBlock {
    let (kind, axis, radius) = match candidate.surface {
        Primitive::Plane { normal, .. } => ("plane", normal, None),
        Primitive::Cylinder {
            direction,
            radius,
            concave,
            ..
        } => (
            if concave { "hollow" } else { "wall" },
            direction,
            Some(radius),
        ),
    };
    let length = candidate.extent[1] - candidate.extent[0];
    CandidateBlock {
        kind: kind.to_owned(),
        radius,
        outer_radius: None,
        place: candidate.middle.into(),
        axis: axis.into(),
        length,
        area: candidate.area,
        coverage: match radius {
            Some(r) if length > 0.0 => candidate.area / (std::f64::consts::TAU * r * length),
            _ => 1.0,
        },
        angle: candidate.angle.to_degrees(),
        rms: candidate.rms,
        residual: candidate.residual,
        used: false,
        reason: None,
    }
}
