//! Options of the CAD stage.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::non_design::{DomainOptions, RecogniseMode, RecogniseOptions};

/// Fillets by a word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FilletRule {
    /// None.
    Off,
    /// As large as the foundry's rule (`mould.rules.fillet`) says for the walls that meet.
    Rule,
}

/// Fillets where members meet non-design bodies.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum FilletRadius {
    /// By a word.
    Word(FilletRule),
    /// Of this radius, mm.
    Radius(f64),
}

/// How the B-rep is built, united and checked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CadOptions {
    /// Parts closer than this count as touching in booleans, mm. Never 0: that can silently lose volume.
    pub fuzzy: f64,
    /// The same for the second attempt, mm.
    pub fuzzy_retry: f64,
    /// How far the organic side is moved in the attempt before the last ones, mm.
    pub shift: f64,
    /// Largest accepted difference of the independent volume, as a share of the volume of the non-design bodies.
    pub volume_tolerance: f64,
    /// Largest accepted distance of non-design faces to the input CAD, mm.
    pub distance_tolerance: f64,
    /// A boolean that runs longer than this counts as failed, s.
    pub boolean_seconds: f64,
    /// When the union has edges shorter than this, voxels, the borders of the body's faces slide out of the way and it is
    /// made again; 0 leaves them.
    pub least_edge: f64,
    /// The body sinks this many voxels below walls of non-design bodies that it is nearly flush with, so that the two cross at
    /// no angles near zero; 0 leaves it.
    pub sink: f64,
    /// Rays across each non-design body in the independent volume check.
    pub rays: u32,
    /// Fillets at the inner edges between the fitted body and non-design bodies: a radius in mm, `rule` or `off`. Where the kernel
    /// finds none, smaller ones are tried.
    pub fillet: FilletRadius,
    /// A fillet that takes the kernel more processor time than this stays away, s; several together have as many times as much.
    pub fillet_seconds: f64,
}

impl Default for CadOptions {
    fn default() -> Self {
        Self {
            fuzzy: 1e-5,
            fuzzy_retry: 1e-4,
            shift: 0.03,
            volume_tolerance: 2e-3,
            distance_tolerance: 1e-3,
            boolean_seconds: 300.0,
            least_edge: 0.35,
            sink: 0.35,
            rays: 400,
            fillet: FilletRadius::Word(FilletRule::Off),
            fillet_seconds: 10.0,
        }
    }
}

/// How non-design bodies are read and rebuilt.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct NonDesignOptions {
    /// A mesh becomes planes, cylinders and cones when no vertex is farther from them than this, mm.
    pub mesh_tolerance: f64,
    /// Neighbouring triangles that differ by less belong to one smooth surface, degrees.
    pub sharp_angle: f64,
    /// Open bores are kept free beyond their ends by this many radii.
    pub bore_extension: f64,
    /// Non-design bodies are cut out of the proposal before the skeleton is made; members end in their walls.
    pub cut_out: bool,
    /// Where that is off or does not work, the fitted body ends this many voxels inside the walls of the bodies that were given, so that their union cuts
    /// cleanly; 0 lets it follow the proposal there too.
    pub clearance: f64,
    /// What is done with bodies that are recognised in the proposal.
    pub recognise: RecogniseMode,
    /// How they are recognised.
    pub recognition: RecogniseOptions,
    /// How the faces of a design space are matched.
    pub design_space: DomainOptions,
}

impl Default for NonDesignOptions {
    fn default() -> Self {
        Self {
            mesh_tolerance: 0.02,
            sharp_angle: 25.0,
            bore_extension: 1.0,
            cut_out: true,
            clearance: 1.0,
            recognise: RecogniseMode::default(),
            recognition: RecogniseOptions::default(),
            design_space: DomainOptions::default(),
        }
    }
}

/// Texts in the STEP and IGES files.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct StepOptions {
    /// Product name; empty: the name of the proposal's file.
    pub product: String,
    /// Author.
    pub author: String,
    /// Organization.
    pub organization: String,
    /// Description; empty: that grassfire made it.
    pub description: String,
    /// Time stamp of the header (ISO 8601); empty means now. Fix it to get equal files.
    pub time_stamp: String,
}

impl StepOptions {
    /// The product name, `part` when there is none.
    pub fn product(&self) -> &str {
        match self.product.trim() {
            "" => "part",
            name => name,
        }
    }
}
