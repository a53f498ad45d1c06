//! The report: `report.json` for programs, `report.html` for people, and the pictures in it.
//!
//! Lengths in mm, areas mm2, volumes mm3, angles degrees, times seconds, memory MB. A block is present when its stage
//! ran. Numbers are finite: what could not be measured is left out.

mod blocks;
mod casting;
mod checks;
mod editing;
mod format;
mod html;
pub mod papers;
mod recognised;
pub mod render;
mod repairs;
mod results;
mod shape;
mod verification;

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

pub use blocks::{
    BoreBlock, CandidateBlock, DesignFaceBlock, DistanceBlock, FileEntry, FlatBlock, InputBlock,
    InputFile, NonDesignBlock, OptimizeBlock, RefusedFile, RemeshBlock, RepairEntry, Report,
    SolidBlock, StageEntry, TopologyChangeEntry, VolumeBlock,
};
pub use casting::{
    FeedBlock, FeederBlock, FilletBlock, FindingBlock, HotSpotBlock, InfeasibleBlock, MouldBlock,
    SolidifyBlock, UndercutBlock,
};
pub use checks::{Check, Limits, judge};
pub use editing::EditBlock;
pub use html::to_html;
pub use repairs::{RepairsBlock, RoomBlock, VariantBlock};
pub use shape::{BodyBlock, SkeletonBlock, TopologyBlock};
pub use verification::{LoadCaseBlock, ProposalBlock, TetrahedraBlock, VerifyBlock};

use crate::io::{IoError, atomic_write};
use render::PictureSize;

/// Settings of the report.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ReportOptions {
    /// Draw pictures into report.html.
    pub pictures: bool,
    /// Width of the pictures, pixels; they are three quarters as high.
    pub picture_width: u32,
    /// What the result must keep to.
    pub limits: Limits,
}

impl Default for ReportOptions {
    fn default() -> Self {
        Self {
            pictures: true,
            picture_width: 1000,
            limits: Limits::default(),
        }
    }
}

impl ReportOptions {
    /// Size of all pictures.
    pub fn picture_size(&self) -> PictureSize {
        let width = self.picture_width.clamp(64, render::MAX_SIZE);
        PictureSize {
            width,
            height: width * 3 / 4,
        }
    }
}

/// A picture of `report.html`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// Short heading.
    pub title: String,
    /// What it shows.
    pub caption: String,
    /// Bytes of a PNG file.
    pub png: Vec<u8>,
}

/// Why a report could not be written.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The file system refused.
    #[error(transparent)]
    Write(#[from] IoError),
    /// The report could not be turned into JSON.
    #[error("cannot write the report as JSON")]
    Json(#[from] serde_json::Error),
    /// A picture failed.
    #[error("cannot draw a picture")]
    Render(#[from] render::RenderError),
}

impl ReportError {
    /// What the user can do about it.
    pub fn hint(&self) -> Option<String> {
        match self {
            Self::Write(_) => Some("choose a folder that you may write to with -o DIR".to_owned()),
            Self::Render(_) => {
                Some("set report.pictures=false or another report.picture_width".to_owned())
            }
            Self::Json(_) => None,
        }
    }
}

/// The report as JSON. Numbers that are not finite are left out together with their key.
///
/// # Errors
/// [`ReportError::Json`] when a key is not a string, which no block of [`Report`] does.
pub fn to_json(report: &Report) -> Result<String, ReportError> {
    let mut value = serde_json::to_value(report)?;
    drop_null(&mut value);
    let mut text = serde_json::to_string_pretty(&value)?;
    text.push('\n');
    Ok(text)
}

/// Writes `report.json`.
///
/// # Errors
/// [`ReportError::Write`] when the file cannot be written.
pub fn write_json(path: &Path, report: &Report) -> Result<(), ReportError> {
    write(path, to_json(report)?)
}

/// Writes `report.html`: one self-contained file with the pictures inside.
///
/// # Errors
/// [`ReportError::Write`] when the file cannot be written.
pub fn write_html(path: &Path, report: &Report, pictures: &[Picture]) -> Result<(), ReportError> {
    write(path, to_html(report, pictures))
}

fn write(path: &Path, text: String) -> Result<(), ReportError> {
    Ok(atomic_write(path, |file| file.write_all(text.as_bytes()))?)
}

/// serde_json writes NaN and infinity as null: a list with one of them is not usable, so its key goes too.
fn drop_null(value: &mut Value) {
    let broken = |v: &Value| {
        v.is_null()
            || v.as_array()
                .is_some_and(|list| list.iter().any(Value::is_null))
    };
    match value {
        Value::Object(map) => {
            map.retain(|_, v| !broken(v));
            map.values_mut().for_each(drop_null);
        }
        Value::Array(list) => list.iter_mut().for_each(drop_null),
        _ => {}
    }
}

#[cfg(test)]
mod tests;
