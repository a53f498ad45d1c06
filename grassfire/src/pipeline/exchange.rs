//! The part's files: STEP always, others as asked for. One that cannot be made right is left out and told, not fatal.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

#[cfg(feature = "occt")]
use super::bodies::Bodies;
use super::deliver::Delivery;
use super::error::StageError;
use super::union::Part;
use super::{ReconstructJob, ReconstructOptions};
#[cfg(feature = "occt")]
use crate::cad::{self, FeederBody};
use crate::cad::{FilletRadius, StepOptions};
use crate::io::{self, ThreeMfObject, ThreeMfTexts};
use crate::mesh::{Solid, TriMesh};
use crate::monitor::Monitor;
use crate::report::{FeederBlock, RefusedFile};

/// A file of the finished part.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Format {
    /// `part.step`, which is always written.
    Step,
    /// `part.brep`: OpenCASCADE's own.
    Brep,
    /// `part.igs`: IGES 5.3.
    Iges,
    /// `part.3mf`: triangles with names.
    #[serde(rename = "3mf")]
    ThreeMf,
    /// `casting.step`: the part with its feeders and their necks as bodies of an assembly.
    Casting,
    /// `pieces/`: the fitted body and each non-design body as STEP, from which `tools/freecad_tree.py` makes a FreeCAD file.
    Pieces,
}

impl Format {
    /// Name as in the options.
    pub fn name(self) -> &'static str {
        match self {
            Self::Step => "step",
            Self::Brep => "brep",
            Self::Iges => "iges",
            Self::ThreeMf => "3mf",
            Self::Casting => "casting",
            Self::Pieces => "pieces",
        }
    }

    /// This build can write it. Without OpenCASCADE only triangles can be written; STEP, which nobody has to ask for, is
    /// then left out.
    pub fn available(self) -> bool {
        cfg!(feature = "occt") || matches!(self, Self::Step | Self::ThreeMf)
    }
}

/// Which files are written of the part.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FileOptions {
    /// Files besides part.step and part.stl: `brep`, `iges`, `3mf`, `casting`, `pieces`.
    pub formats: Vec<Format>,
    /// Largest distance of the triangles in part.stl and part.3mf from the solid, mm. Default a twentieth of a voxel.
    /// Without OpenCASCADE they are those of the limit surface, see `tessellate.chord`.
    pub chord: Option<f64>,
}

/// A smaller chord (mm) makes millions of triangles on parts of any size and nothing better.
pub(super) const MIN_CHORD: f64 = 1e-3;

/// Refuses what this build cannot write, and chords and radii that are no length, before anything is read.
///
/// # Errors
/// [`StageError::Format`], [`StageError::NoFeeders`], [`StageError::CreaseAngle`], [`StageError::FilletRadius`], [`StageError::Chord`].
pub(super) fn check(options: &ReconstructOptions) -> Result<(), StageError> {
    let files = &options.files;
    if let Some(format) = files.formats.iter().find(|format| !format.available()) {
        return Err(StageError::Format {
            format: format.name(),
        });
    }
    if files.formats.contains(&Format::Casting) && options.feed.feeders.is_empty() {
        return Err(StageError::NoFeeders);
    }
    if let Some(angle) = options.flats.crease_angle
        && !(angle > 0.0 && angle < 180.0)
    {
        return Err(StageError::CreaseAngle { angle });
    }
    if let FilletRadius::Radius(radius) = options.cad.fillet
        && !(radius.is_finite() && radius > 0.0)
    {
        return Err(StageError::FilletRadius { radius });
    }
    match files.chord {
        Some(chord) if !(chord.is_finite() && chord >= MIN_CHORD) => {
            Err(StageError::Chord { chord })
        }
        _ => Ok(()),
    }
}

/// The triangles of a part of one solid, with its name.
fn named(triangles: &TriMesh, texts: &StepOptions) -> (String, TriMesh) {
    let mesh = TriMesh {
        tags: Vec::new(),
        ..triangles.clone()
    };
    (texts.product().to_owned(), mesh)
}

/// What the files of a run are made from.
pub(super) struct Files<'a> {
    pub(super) job: &'a ReconstructJob,
    pub(super) part: &'a Part,
    #[cfg(feature = "occt")]
    pub(super) bodies: &'a Bodies,
    #[cfg(feature = "occt")]
    pub(super) voxel: f64,
    /// What each feeder needs.
    #[cfg_attr(
        not(feature = "occt"),
        allow(dead_code, reason = "only the kernel writes them")
    )]
    pub(super) feeders: &'a [FeederBlock],
    pub(super) delivery: &'a Delivery,
}

impl Files<'_> {
    /// Writes `part.step`, `part.stl` and what was asked for; gives what could not be written.
    ///
    /// # Errors
    /// When part.step or part.stl cannot be written.
    pub(super) fn write(&self, monitor: &Monitor) -> Result<Vec<RefusedFile>, StageError> {
        let texts = self.texts();
        #[cfg(feature = "occt")]
        cad::write_step(&self.part.solid, &self.delivery.path("part.step"), &texts)?;
        let mut refused = Vec::new();
        let finer = self.finer().unwrap_or_else(|error| {
            let reason = format!("it has the usual triangles, not those of files.chord: {error}");
            monitor.warn("write", format!("part.stl: {reason}"));
            refused.push(RefusedFile {
                path: "part.stl".to_owned(),
                reason,
            });
            None
        });
        let triangles = finer.as_ref().unwrap_or(&self.part.mesh);
        self.delivery.stl("part.stl", triangles)?;
        let mut formats = self.job.options.files.formats.clone();
        formats.sort_unstable();
        formats.dedup();
        for format in formats {
            monitor.check()?;
            let (name, result) = self.one(format, triangles, &texts);
            if let Err(error) = result {
                let reason = error.to_string();
                monitor.warn("write", format!("{name} is left out: {reason}"));
                refused.push(RefusedFile {
                    path: name.to_owned(),
                    reason,
                });
            }
        }
        Ok(refused)
    }

    /// The product is called as the proposal's file.
    fn texts(&self) -> StepOptions {
        let mut texts = self.job.options.step.clone();
        if texts.product.trim().is_empty() {
            let stem = self.job.part.file_stem();
            texts.product = stem.map_or_else(String::new, |s| s.to_string_lossy().into_owned());
        }
        texts
    }

    fn one(
        &self,
        format: Format,
        triangles: &TriMesh,
        texts: &StepOptions,
    ) -> (&'static str, Result<(), StageError>) {
        match format {
            Format::Step => ("part.step", Ok(())),
            Format::ThreeMf => ("part.3mf", self.three_mf(triangles, texts)),
            #[cfg(feature = "occt")]
            Format::Brep => ("part.brep", self.brep()),
            #[cfg(feature = "occt")]
            Format::Iges => ("part.igs", self.iges(texts)),
            #[cfg(feature = "occt")]
            Format::Casting => ("casting.step", self.casting(texts)),
            #[cfg(feature = "occt")]
            Format::Pieces => ("pieces", self.pieces(texts)),
            #[cfg(not(feature = "occt"))]
            Format::Brep | Format::Iges | Format::Casting | Format::Pieces => (
                format.name(),
                Err(StageError::Format {
                    format: format.name(),
                }),
            ),
        }
    }

    /// Only what is closed is written: slicers guess the inside of anything else.
    fn three_mf(&self, triangles: &TriMesh, texts: &StepOptions) -> Result<(), StageError> {
        let mut objects = Vec::new();
        for (name, mesh) in self.solids(triangles, texts)? {
            let solid = Solid::try_from(mesh).map_err(|source| StageError::Open {
                name: name.clone(),
                source,
            })?;
            objects.push(ThreeMfObject { name, solid });
        }
        let texts = ThreeMfTexts {
            title: texts.product().to_owned(),
            designer: texts.author.clone(),
            description: texts.description.clone(),
        };
        Ok(io::write_3mf(
            &self.delivery.path("part.3mf"),
            &objects,
            &texts,
        )?)
    }
}

#[cfg(feature = "occt")]
impl Files<'_> {
    /// Triangles with the chord that was asked for.
    fn finer(&self) -> Result<Option<TriMesh>, StageError> {
        let asked = self.job.options.files.chord;
        let mesh = asked.map(|chord| cad::tessellate(&self.part.solid, chord));
        Ok(mesh.transpose()?)
    }

    fn solids(
        &self,
        triangles: &TriMesh,
        texts: &StepOptions,
    ) -> Result<Vec<(String, TriMesh)>, StageError> {
        if self.part.solid.bodies == 1 {
            return Ok(vec![named(triangles, texts)]);
        }
        let usual = super::union::CHORD * self.voxel;
        let chord = self.job.options.files.chord.unwrap_or(usual);
        Ok(cad::tessellate_solids(&self.part.solid, chord, texts)?)
    }

    fn brep(&self) -> Result<(), StageError> {
        let path = self.delivery.path("part.brep");
        Ok(cad::write_brep(&self.part.solid, &path)?)
    }

    fn iges(&self, texts: &StepOptions) -> Result<(), StageError> {
        let path = self.delivery.path("part.igs");
        Ok(cad::write_iges(&self.part.solid, &path, texts)?)
    }

    /// The part and the feeders that the feeding edit asks for.
    fn casting(&self, texts: &StepOptions) -> Result<(), StageError> {
        let body = |zone: &FeederBlock| FeederBody {
            foot: zone.place,
            diameter: zone.diameter,
            neck: zone.neck,
        };
        let feeders: Vec<FeederBody> = self.feeders.iter().map(body).collect();
        let path = self.delivery.path("casting.step");
        let up = self.job.options.solidify.up;
        Ok(cad::write_casting(
            &self.part.solid,
            &feeders,
            up,
            &path,
            texts,
        )?)
    }

    fn pieces(&self, texts: &StepOptions) -> Result<(), StageError> {
        let folder = self.delivery.path("pieces");
        let bodies = &self.bodies.solids;
        Ok(cad::write_pieces(&self.part.solid, bodies, &folder, texts)?)
    }
}

#[cfg(not(feature = "occt"))]
impl Files<'_> {
    fn finer(&self) -> Result<Option<TriMesh>, StageError> {
        Ok(None)
    }

    fn solids(
        &self,
        triangles: &TriMesh,
        texts: &StepOptions,
    ) -> Result<Vec<(String, TriMesh)>, StageError> {
        Ok(vec![named(triangles, texts)])
    }
}
