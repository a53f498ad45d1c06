//! Why a project file was refused.

use crate::cad::CadError;
use crate::io::IoError;
use crate::monitor::Cancelled;
use crate::topopt::TopoptError;

/// Why a project file was refused.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum CaseError {
    #[error("{file}: line {line}: {what}")]
    Syntax {
        file: String,
        line: usize,
        what: String,
        nearest: Option<String>,
    },
    #[error("{key} is {value}; {wanted} is wanted")]
    Value {
        key: String,
        value: String,
        wanted: String,
    },
    #[error("{key} asks for {name:?}, which is not there")]
    Name {
        key: String,
        name: String,
        known: Vec<String>,
    },
    #[error("there is no support: the part would fly away")]
    NoSupport,
    #[error("{key}: the file {path} is missing or cannot be read")]
    MissingFile {
        key: String,
        path: String,
        // Boxed: it is far larger than the others.
        source: Box<IoError>,
    },
    #[error("{key}: {path} holds no closed surface: {what}")]
    NotSolid {
        key: String,
        path: String,
        what: String,
    },
    #[error("{key}: {path} is a STEP file and this build has no OpenCASCADE")]
    NoKernel { key: String, path: String },
    #[error("{key}: {path} has no face like {wanted}, but {there}")]
    NoFace {
        key: String,
        path: String,
        wanted: String,
        there: String,
    },
    #[error("the selection {name:?} holds no node of the grid")]
    EmptySelection { name: String },
    #[error(
        "the {what} on {name:?} acts on nothing: none of its {nodes} nodes near {place:?} mm touches material"
    )]
    OnVoid {
        what: &'static str,
        name: String,
        nodes: usize,
        place: [f64; 3],
    },
    #[error("the moment on {name:?} cannot be spread over its {nodes} nodes: they lie on a line")]
    Moment { name: String, nodes: usize },
    #[error(
        "the pressure or bearing force on {name:?} finds no surface that faces it among its {points} points"
    )]
    NoSurface { name: String, points: usize },
    #[error("the supports leave the part free: {}", modes.join(", "))]
    Mechanism { modes: Vec<&'static str> },
    #[error(
        "the load {name:?} acts on a piece of {voxels} voxels near {place:?} mm that no support holds"
    )]
    LooseLoad {
        name: String,
        voxels: usize,
        place: [f64; 3],
    },
    #[error(
        "the non-design body {name:?} lies outside the design space: none of its {voxels} voxels touches it"
    )]
    BodyOutside { name: String, voxels: usize },
    #[error("the non-design body {name:?} holds no centre of a voxel of {h} mm")]
    BodyTooSmall { name: String, h: f64 },
    #[error(transparent)]
    Problem(#[from] TopoptError),
    #[error(transparent)]
    Io(#[from] IoError),
    #[error(transparent)]
    Cad(#[from] CadError),
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl CaseError {
    /// What the user can do about it.
    pub fn hint(&self) -> Option<String> {
        match self {
            Self::Syntax { nearest, .. } => Some(match nearest {
                Some(key) => format!("did you mean {key}?"),
                None => "`grassfire schema case` lists all keys".into(),
            }),
            Self::Value { .. } => None,
            Self::Name { name, known, .. } => match nearest(name, known) {
                Some(known) => Some(format!("did you mean {known:?}?")),
                None => Some(format!("known are: {}", known.join(", "))),
            },
            Self::NoSupport => Some("add a [[support]] with on = \"...\" and fix = \"xyz\"".into()),
            Self::MissingFile { .. } => {
                Some("paths are relative to the folder of the project file".into())
            }
            Self::NotSolid { .. } => Some("export a closed mesh or STEP solid from CAD".into()),
            Self::NoKernel { .. } => Some("build with the default feature occt, or give STL".into()),
            Self::NoFace { path, .. } => Some(format!("`grassfire faces {path}` lists them")),
            Self::EmptySelection { .. } => {
                Some("`grassfire check` lists what every selection holds; look at its place, tolerance and units".into())
            }
            Self::OnVoid { .. } => Some("move it onto the design space or a non-design body".into()),
            Self::Moment { .. } => Some("select a face instead of an edge".into()),
            Self::NoSurface { .. } => Some(
                "select the whole surface that is pressed, such as a bore by its cylinder; a bearing force acts across the bore".into(),
            ),
            Self::Mechanism { .. } => Some("fix more directions, or at more places".into()),
            Self::LooseLoad { .. } => Some("join the pieces of the design space, or use a finer grid.h".into()),
            Self::BodyOutside { .. } => Some("check its place and unit".into()),
            Self::BodyTooSmall { .. } => Some("use a finer grid.h".into()),
            Self::Problem(e) => e.hint(),
            Self::Io(e) => e.hint(),
            Self::Cad(e) => e.hint(),
            Self::Cancelled(_) => None,
        }
    }
}

/// Turns a message of the TOML reader into ours, with the nearest known key.
pub(super) fn syntax(file: &str, text: &str, error: &toml::de::Error) -> CaseError {
    let message = error.message();
    let at = error.span().map_or(0, |span| span.start.min(text.len()));
    let quoted: Vec<String> = message
        .split('`')
        .skip(1)
        .step_by(2)
        .map(str::to_owned)
        .collect();
    let nearest = match quoted.split_first() {
        Some((unknown, known)) if message.starts_with("unknown") => nearest(unknown, known),
        _ => None,
    };
    CaseError::Syntax {
        file: file.to_owned(),
        line: text.as_bytes()[..at]
            .iter()
            .filter(|&&b| b == b'\n')
            .count()
            + 1,
        what: message.split_whitespace().collect::<Vec<_>>().join(" "),
        nearest,
    }
}

/// The known name nearest to one that is not known, when it is near.
fn nearest(name: &str, known: &[String]) -> Option<String> {
    let distance = |k: &String| strsim::damerau_levenshtein(k, name);
    known
        .iter()
        .min_by_key(|k| distance(k))
        .filter(|k| distance(k) <= 2 + k.len() / 3)
        .cloned()
}
