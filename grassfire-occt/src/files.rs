//! Shapes from files and into files: STEP, OpenCASCADE's own format, IGES.

use std::path::Path;

use super::ffi::bridge;
use super::types::{self, StepContents, StepTexts};
use super::{OcctError, Result, Shape, lock, step_text};

impl Shape {
    /// Reads a STEP file; units become mm. Cut off files and dangling references are refused before the kernel sees them.
    pub fn read_step(path: &Path) -> Result<Self> {
        let text = checked_step(path)?;
        Self::make(|| bridge::read_step(text))
    }

    /// Writes STEP AP242 in mm with product structure, names and colours. Equal shapes and texts give equal files but for
    /// the time stamp.
    pub fn write_step(&self, path: &Path, texts: &StepTexts) -> Result<()> {
        let names = texts.bridge(self.max_tolerance()?, step_text::line);
        let name = path_text(path)?;
        {
            let _guard = lock();
            bridge::write_step(&self.0, name, &names)?;
        }
        let failed = |e: std::io::Error| OcctError(e.to_string());
        let text = std::fs::read(path).map_err(failed)?;
        if text.is_ascii() {
            return Ok(());
        }
        let text = String::from_utf8_lossy(&text);
        std::fs::write(path, step_text::encode(&text)).map_err(failed)
    }

    /// Writes OpenCASCADE's own format, without names.
    pub fn write_brep(&self, path: &Path) -> Result<()> {
        let path = path_text(path)?;
        let _guard = lock();
        Ok(bridge::write_brep(&self.0, path)?)
    }

    /// Reads OpenCASCADE's own format.
    pub fn read_brep(path: &Path) -> Result<Self> {
        let path = path_text(path)?;
        Self::make(|| bridge::read_brep(path))
    }

    /// Writes IGES 5.3 in mm: manifold solids, without names of faces.
    pub fn write_iges(&self, path: &Path, texts: &StepTexts) -> Result<()> {
        let names = texts.bridge(self.max_tolerance()?, step_text::ascii);
        let path = path_text(path)?;
        let _guard = lock();
        Ok(bridge::write_iges(&self.0, path, &names)?)
    }

    /// Reads an IGES file; units become mm.
    pub fn read_iges(path: &Path) -> Result<Self> {
        let path = path_text(path)?;
        Self::make(|| bridge::read_iges(path))
    }
}

/// Names and colours of the products, solids and faces of a STEP file.
pub fn step_contents(path: &Path) -> Result<StepContents> {
    let text = checked_step(path)?;
    let _guard = lock();
    Ok(types::contents(bridge::step_contents(text)?))
}

/// The path of a STEP file. Cut off files and dangling references are found here, before the kernel sees them.
fn checked_step(path: &Path) -> Result<&str> {
    let text = path_text(path)?;
    let bytes = std::fs::read(path).map_err(|e| OcctError(e.to_string()))?;
    step_text::check(&bytes).map_err(OcctError)?;
    Ok(text)
}

fn path_text(path: &Path) -> Result<&str> {
    path.to_str()
        .ok_or_else(|| OcctError(format!("the path {} is not valid Unicode", path.display())))
}
