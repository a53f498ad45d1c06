//! The project file `case.toml`: geometry, material, supports, loads, and the options of all stages.
//!
//! Units are mm, N, MPa, t, s. Paths are relative to the folder of the file.

mod build;
mod error;
mod faces;
mod grid;
mod loads;
mod materials;
mod places;
mod select;
mod shape;
mod supports;

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use build::{Built, SelectionInfo, build};
pub(crate) use build::{conditions_on, in_bodies};
pub use error::CaseError;
pub use faces::{FaceLike, StepFace, step_faces};
pub(crate) use grid::place as place_grid;
pub(crate) use loads::{LoadPlace, forces_on};
pub use materials::LIBRARY;
pub(crate) use places::Places;
pub use select::Selector;
pub use shape::Shape;
pub use supports::{Spring, Support};

use crate::Vec3;
use crate::fe::SolverOptions;
use crate::pipeline::ReconstructOptions;
use crate::topopt::OptimizeOptions;
use crate::verify::VerifyOptions;

/// The units of every case.
pub const UNITS: &str = "mm-N-MPa";

/// A project file.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Case {
    /// What it is.
    pub title: String,
    /// Must be `mm-N-MPa`: said so that nobody guesses.
    pub units: String,
    /// Threads; 0 takes all cores.
    pub threads: usize,
    /// Voxels.
    pub grid: GridOptions,
    /// The one material.
    pub material: Material,
    /// Where material may be.
    pub design: DesignSpace,
    /// Bodies that are in the part as they are.
    pub non_design: Vec<Body>,
    /// Places that stay empty.
    pub keep_out: Vec<KeepOut>,
    /// Named places for supports and loads.
    pub select: BTreeMap<String, Selector>,
    /// Supports.
    pub support: Vec<Support>,
    /// Load cases.
    pub case: Vec<LoadCaseTable>,
    /// Topology optimization.
    pub optimize: OptimizeOptions,
    /// Finite element solver.
    pub solver: SolverOptions,
    /// Proof of stiffness of the finished solid.
    pub verify: VerifyOptions,
    /// Reconstruction; the options of `grassfire reconstruct`.
    pub reconstruct: ReconstructOptions,
}

/// The voxel grid.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GridOptions {
    /// Edge of a voxel, mm.
    pub h: f64,
    /// A point that is to be a corner of voxels, mm. Default: the lower corner of the space, and on the planes of symmetry
    /// and of parting.
    pub origin: Option<[f64; 3]>,
}

/// An isotropic, linear elastic material: its values, or the name of one in a library (`grassfire materials`).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Material {
    /// Name.
    pub name: String,
    /// A library of your own, relative to the project file; without: that of the program.
    pub library: Option<String>,
    /// Young's modulus, MPa.
    pub young: f64,
    /// Poisson's ratio.
    pub nu: f64,
    /// Density, t/mm3.
    pub density: Option<f64>,
    /// Yield strength, MPa.
    pub yield_strength: Option<f64>,
    /// Where the values come from.
    pub source: String,
}

/// Where material may be: the union of `space` without `cut`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DesignSpace {
    /// Shapes that are united.
    pub space: Vec<Shape>,
    /// Shapes that are taken away.
    pub cut: Vec<Shape>,
}

/// A non-design body: the union of `shapes` without `cut`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Body {
    /// Name; a selection `body` asks for it.
    pub name: String,
    /// Shapes that are united.
    pub shapes: Vec<Shape>,
    /// Shapes that are taken away.
    pub cut: Vec<Shape>,
}

/// A place that stays empty.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct KeepOut {
    /// Name.
    pub name: String,
    /// Shapes that are united.
    pub shapes: Vec<Shape>,
    /// A core makes it: it may be undercut.
    pub core: bool,
}

/// A load case.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LoadCaseTable {
    /// Name.
    pub name: String,
    /// Weight in the objective.
    pub weight: f64,
    /// Loads that act together.
    pub loads: Vec<Load>,
    /// Acceleration that pulls on all of the part, mm/s2, such as `[0, 0, -9810]` for gravity along -z; a part that is itself
    /// accelerated by a feels -a. The mass follows the design.
    pub gravity: Option<[f64; 3]>,
}

impl Default for LoadCaseTable {
    fn default() -> Self {
        Self {
            name: String::new(),
            weight: 1.0,
            loads: Vec::new(),
            gravity: None,
        }
    }
}

impl LoadCaseTable {
    /// Force on a volume of full material, N/mm3.
    pub fn body_force(&self, material: &Material) -> Vec3 {
        let density = material.density.unwrap_or_default();
        density * Vec3::from(self.gravity.unwrap_or_default())
    }
}

/// A load on a selection; its kinds add up.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Load {
    /// Selection.
    pub on: String,
    /// Total force, N; spread evenly.
    pub force: Option<[f64; 3]>,
    /// Moment about the centre of the selection, N mm.
    pub moment: Option<[f64; 3]>,
    /// The point that `force` acts in, mm, joined to the selection as by a lever that stiffens nothing. Default: the middle of the
    /// selection.
    pub at: Option<[f64; 3]>,
    /// Pressure on the surface, MPa. In the optimization it stays on the faces of the design space and the bodies.
    pub pressure: Option<f64>,
    /// Total force, N, that a pin presses with on the wall of a bore: with the cosine, on the half that faces it.
    pub bearing: Option<[f64; 3]>,
}

impl Case {
    /// Reads a project file.
    ///
    /// # Errors
    /// [`CaseError::Io`], [`CaseError::Syntax`] with the nearest key where one is unknown, [`CaseError::Value`].
    pub fn read(path: &Path) -> Result<Self, CaseError> {
        let bytes = crate::io::read_file(path, 1 << 24)?;
        let text = String::from_utf8_lossy(&bytes);
        let folder = path.parent().unwrap_or(Path::new(""));
        Self::parse(&path.display().to_string(), &text, folder)
    }

    /// [`Case::read`] on a text; `name` stands in messages, and paths begin in `folder`.
    ///
    /// # Errors
    /// As [`Case::read`].
    pub fn parse(name: &str, text: &str, folder: &Path) -> Result<Self, CaseError> {
        let mut case: Self = toml::from_str(text).map_err(|e| error::syntax(name, text, &e))?;
        materials::complete(&mut case.material, folder)?;
        case.check()?;
        Ok(case)
    }

    /// Refuses values that mean nothing: units, moduli, numbers that are not finite, names that do not exist.
    ///
    /// # Errors
    /// [`CaseError::Value`], [`CaseError::Name`].
    pub fn check(&self) -> Result<(), CaseError> {
        if self.units != UNITS {
            return Err(value(
                "units",
                format!("{:?}", self.units),
                format!("{UNITS:?}"),
            ));
        }
        let positive = |key: &str, v: f64| {
            let good = v.is_finite() && v > 0.0;
            if good {
                Ok(())
            } else {
                Err(value(key, v, "a positive number"))
            }
        };
        positive("grid.h", self.grid.h)?;
        positive("material.young", self.material.young)?;
        if self.material.young > HARDEST {
            let wanted =
                format!("MPa, at most {HARDEST:e} (diamond has 1.2e6); this looks like Pa");
            return Err(value("material.young", self.material.young, wanted));
        }
        if !(-0.9..=0.49).contains(&self.material.nu) {
            return Err(value("material.nu", self.material.nu, "-0.9 to 0.49"));
        }
        if let Some(density) = self.material.density
            && !(density > 0.0 && density <= HEAVIEST)
        {
            let wanted = format!(
                "t/mm3, above 0 and at most {HEAVIEST:e} (osmium has 2.3e-8): 1e-9 times that in g/cm3"
            );
            return Err(value("material.density", density, wanted));
        }
        if self.case.is_empty() {
            return Err(value("case", "empty", "at least one load case"));
        }
        for (i, case) in self.case.iter().enumerate() {
            self.check_case(i, case)?;
        }
        if self.support.is_empty() {
            return Err(CaseError::NoSupport);
        }
        for (i, support) in self.support.iter().enumerate() {
            self.find(&support.on, &format!("support[{i}].on"))?;
            support.check(&format!("support[{i}]"))?;
        }
        self.check_shapes()
    }

    fn check_case(&self, i: usize, case: &LoadCaseTable) -> Result<(), CaseError> {
        if !(case.weight.is_finite() && case.weight >= 0.0) {
            return Err(value(
                &format!("case[{i}].weight"),
                case.weight,
                "0 or more",
            ));
        }
        let gravity = format!("case[{i}].gravity");
        finite(&gravity, case.gravity.iter().flatten())?;
        if case.gravity.is_some() && self.material.density.is_none() {
            let wanted = "given, t/mm3, because case has gravity; steel has 7.85e-9";
            return Err(value("material.density", "missing", wanted));
        }
        if case.loads.is_empty() && case.gravity.unwrap_or_default() == [0.0; 3] {
            return Err(value(
                &format!("case[{i}].loads"),
                "empty",
                "at least one load, or gravity",
            ));
        }
        for (j, load) in case.loads.iter().enumerate() {
            let key = |what: &str| format!("case[{i}].loads[{j}].{what}");
            self.find(&load.on, &key("on"))?;
            for (what, vector) in [
                ("force", load.force),
                ("moment", load.moment),
                ("bearing", load.bearing),
            ] {
                finite(&key(what), vector.iter().flatten())?;
            }
            let none = |v: Option<[f64; 3]>| v.is_none_or(|v| v == [0.0; 3]);
            finite(&key("pressure"), &load.pressure)?;
            finite(&key("at"), load.at.iter().flatten())?;
            if load.at.is_some() && load.force.is_none() {
                return Err(value(&key("at"), "given", "a force that acts there"));
            }
            let vectors = [load.force, load.moment, load.bearing];
            if vectors.into_iter().all(none) && load.pressure.is_none_or(|p| p == 0.0) {
                let wanted = "a force, a moment, a pressure or a bearing force";
                return Err(value(&key("force"), "0", wanted));
            }
        }
        Ok(())
    }

    fn check_shapes(&self) -> Result<(), CaseError> {
        if self.design.space.is_empty() {
            return Err(value("design.space", "empty", "at least one shape"));
        }
        let of = |key: String, shapes: &[Shape]| -> Result<(), CaseError> {
            for (i, shape) in shapes.iter().enumerate() {
                shape.check(&format!("{key}[{i}]"))?;
            }
            Ok(())
        };
        of("design.space".into(), &self.design.space)?;
        of("design.cut".into(), &self.design.cut)?;
        for (i, body) in self.non_design.iter().enumerate() {
            of(format!("non_design[{i}].shapes"), &body.shapes)?;
            of(format!("non_design[{i}].cut"), &body.cut)?;
        }
        for (i, keep) in self.keep_out.iter().enumerate() {
            of(format!("keep_out[{i}].shapes"), &keep.shapes)?;
        }
        for (name, selector) in &self.select {
            selector.check(name, self)?;
        }
        finite("grid.origin", self.grid.origin.iter().flatten())
    }

    /// The selection with a name.
    fn find(&self, name: &str, key: &str) -> Result<&Selector, CaseError> {
        self.select.get(name).ok_or_else(|| CaseError::Name {
            key: key.to_owned(),
            name: name.to_owned(),
            known: self.select.keys().cloned().collect(),
        })
    }
}

/// No material is stiffer, MPa.
const HARDEST: f64 = 2e6;
/// No material is heavier, t/mm3.
const HEAVIEST: f64 = 3e-8;

/// A value that means nothing.
fn value(key: &str, value: impl ToString, wanted: impl Into<String>) -> CaseError {
    CaseError::Value {
        key: key.to_owned(),
        value: value.to_string(),
        wanted: wanted.into(),
    }
}

/// Refuses NaN and infinity.
fn finite<'a>(key: &str, values: impl IntoIterator<Item = &'a f64>) -> Result<(), CaseError> {
    match values.into_iter().find(|v| !v.is_finite()) {
        Some(bad) => Err(value(key, bad, "finite numbers")),
        None => Ok(()),
    }
}
