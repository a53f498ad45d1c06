//! The result folder: every file is written whole or not at all, and never mixes two runs.

use std::path::{Path, PathBuf};

use serde_json::json;

use super::StageError;
use crate::casting::solidify::Solidification;
use crate::io::{self, IoError};
use crate::medial::{MedialMesh, Poles};
use crate::mesh::{Solid, TriMesh};
use crate::report::{self, FileEntry, Picture, Report};
use crate::skeleton::Skeleton;
use crate::spline::ControlMesh;

/// All files that a reconstruction may write, and what they hold.
pub(super) const FILES: &[(&str, &str)] = &[
    ("part.step", "the solid, STEP AP242"),
    ("part.stl", "the solid, triangles"),
    ("part.3mf", "the solid, triangles with unit and names"),
    ("part.brep", "the solid, OpenCASCADE's own format"),
    ("part.igs", "the solid, IGES"),
    ("casting.step", "the solid with its feeders, STEP AP242"),
    ("body.obj", "closed quad control mesh of the body"),
    ("body.stl", "limit surface of the body, triangles"),
    ("skeleton.ply", "quad skeleton with radii, editable"),
    ("medial.ma", "medial axis"),
    ("poles.ply", "pole skeleton with radii"),
    ("thickness.ply", "proposal with wall thickness"),
    ("proposal.stl", "remeshed proposal"),
    (
        "edited.stl",
        "remeshed proposal after the edits and the feeding edit",
    ),
    (
        "design_part.stl",
        "remeshed proposal without its non-design bodies",
    ),
    ("report.html", "report to read"),
    ("report.json", "report for programs"),
    ("manifest.json", "inputs, versions, times"),
];

/// Folder of the pieces that the part was united from.
const PIECES: &str = "pieces";

/// The open result folder.
pub(super) struct Delivery {
    folder: PathBuf,
    /// Names that a run of this kind may write, and what they hold.
    files: Vec<(&'static str, &'static str)>,
}

impl Delivery {
    /// Makes the folder and takes away what an earlier run left in it.
    pub(super) fn open(
        folder: &Path,
        files: &[(&'static str, &'static str)],
    ) -> Result<Self, IoError> {
        let fail = |path: &Path, source| IoError::Write {
            file: path.display().to_string(),
            source,
        };
        std::fs::create_dir_all(folder).map_err(|e| fail(folder, e))?;
        let delivery = Self::over(folder, files);
        for (name, _) in files {
            delivery.remove(name)?;
        }
        if delivery.has_pieces() {
            for piece in delivery.pieces() {
                delivery.remove(&piece)?;
            }
            // Something else may lie in it: then it stays.
            let _ = std::fs::remove_dir(folder.join(PIECES));
        }
        Ok(delivery)
    }

    /// A folder with what is in it.
    pub(super) fn over(folder: &Path, files: &[(&'static str, &'static str)]) -> Self {
        Self {
            folder: folder.to_owned(),
            files: files.to_vec(),
        }
    }

    fn has_pieces(&self) -> bool {
        self.files.iter().any(|(name, _)| *name == "part.step")
    }

    /// The files of the pieces that are there: `organic.step` and `body-*.step`.
    fn pieces(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.folder.join(PIECES));
        let Some(entries) = entries.ok().filter(|_| self.has_pieces()) else {
            return Vec::new();
        };
        let ours = |name: &String| {
            name == "organic.step" || name.starts_with("body-") && name.ends_with(".step")
        };
        let names = entries.filter_map(|e| e.ok()?.file_name().into_string().ok());
        let mut out: Vec<String> = names
            .filter(ours)
            .map(|name| format!("{PIECES}/{name}"))
            .collect();
        out.sort_unstable();
        out
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Takes away a file that an attempt left which was given up.
    pub(super) fn remove(&self, name: &str) -> Result<(), IoError> {
        let path = self.path(name);
        if !path.exists() {
            return Ok(());
        }
        std::fs::remove_file(&path).map_err(|source| IoError::Write {
            file: path.display().to_string(),
            source,
        })
    }

    pub(super) fn proposal(&self, solid: &Solid) -> Result<(), IoError> {
        io::write_stl(&self.path("proposal.stl"), solid.mesh())
    }

    pub(super) fn poles(&self, poles: &Poles, solid: &Solid) -> Result<(), IoError> {
        let skeleton = TriMesh {
            points: poles.points.clone(),
            triangles: poles.triangles.clone(),
            tags: Vec::new(),
        };
        io::write_ply(
            &self.path("poles.ply"),
            &skeleton,
            Some(("radius", &poles.radii)),
        )?;
        io::write_ply(
            &self.path("thickness.ply"),
            solid.mesh(),
            Some(("thickness", &poles.thickness)),
        )
    }

    pub(super) fn medial(&self, mesh: &MedialMesh) -> Result<(), IoError> {
        io::write_medial(&self.path("medial.ma"), mesh)
    }

    pub(super) fn skeleton(&self, skeleton: &Skeleton) -> Result<(), IoError> {
        io::write_skeleton(&self.path("skeleton.ply"), skeleton)
    }

    pub(super) fn solidification(&self, frozen: &Solidification) -> Result<(), IoError> {
        let fields = [
            ("solid_time", &frozen.time),
            ("feeding_time", &frozen.feeding),
            ("niyama", &frozen.niyama),
        ];
        io::write_vti(&self.path("solidification.vti"), &fields)
    }

    pub(super) fn body(&self, mesh: &ControlMesh) -> Result<(), IoError> {
        io::write_control_mesh(&self.path("body.obj"), mesh)
    }

    pub(super) fn stl(&self, name: &str, mesh: &TriMesh) -> Result<(), IoError> {
        io::write_stl(&self.path(name), mesh)
    }

    /// Report and manifest; the list of files is made from what lies in the folder.
    pub(super) fn report(
        &self,
        report: &mut Report,
        pictures: &[Picture],
    ) -> Result<(), StageError> {
        let entry = |(name, text): (&str, &str)| {
            let bytes = std::fs::metadata(self.path(name)).ok()?.len();
            Some(FileEntry {
                path: name.to_owned(),
                text: text.to_owned(),
                bytes,
            })
        };
        let pieces = self.pieces();
        let pieces = pieces.iter().map(|name| {
            let organic = name.ends_with("organic.step");
            let body = report
                .non_design
                .iter()
                .find(|b| b.piece.as_deref() == Some(name));
            let text = match body {
                _ if organic => "piece of the solid: the fitted body".to_owned(),
                Some(body) => format!("piece of the solid: {}, bores filled", body.name),
                None => "piece of the solid".to_owned(),
            };
            (name.as_str(), text)
        });
        let pieces: Vec<(&str, String)> = pieces.collect();
        let pieces = pieces.iter().map(|(name, text)| (*name, text.as_str()));
        report.files = self
            .files
            .iter()
            .copied()
            .chain(pieces)
            .filter_map(entry)
            .collect();
        report::write_html(&self.path("report.html"), report, pictures)?;
        report::write_json(&self.path("report.json"), report)?;
        Ok(self.manifest(report)?)
    }

    fn manifest(&self, report: &Report) -> Result<(), IoError> {
        let manifest = json!({
            "version": report.version,
            "command": report.command,
            "inputs": report.inputs,
            "files": report.files,
            "stages": report.stages,
            "warnings": report.warnings,
            "papers": report.papers,
        });
        let text = format!("{manifest:#}\n");
        io::atomic_write(&self.path("manifest.json"), |out| {
            out.write_all(text.as_bytes())
        })
    }
}
