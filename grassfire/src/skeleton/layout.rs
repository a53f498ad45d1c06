//! How the quads of a skeleton are laid out: how long is searched, and for what.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The ways to lay out the quads of a skeleton.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Layout {
    /// The regular one where its body follows the proposal closely, else the plain one. Where no body is made of the skeleton
    /// (edits, feeding) and with feeders the plain one.
    #[default]
    Auto,
    /// Quads of the wanted size with few irregular vertices of the body.
    Plain,
    /// Searched four times as long, with dearer irregular vertices inside sheets, and then every row of quads split:
    /// twice as many quads, nearly all vertices inside sheets with four of them.
    Regular,
}

/// What irregular vertices of a layout cost, and how long is searched.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Effort {
    /// Cost of an irregular vertex inside a sheet, beside that of its body vertices.
    pub inner: f64,
    /// Proposals a quad and search.
    pub proposals: usize,
    /// Proposals a search, at most.
    pub most_proposals: usize,
}

impl Layout {
    pub(crate) fn effort(self) -> Effort {
        match self {
            Self::Auto | Self::Plain => Effort {
                inner: 0.0,
                proposals: 300,
                most_proposals: 200_000,
            },
            Self::Regular => Effort {
                inner: 3.0,
                proposals: 1200,
                most_proposals: 800_000,
            },
        }
    }

    /// How many times as short the quads are in the end.
    pub(crate) fn split(self) -> f64 {
        match self {
            Self::Auto | Self::Plain => 1.0,
            Self::Regular => 1.43,
        }
    }

    /// As in `report.json`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Plain => "plain",
            Self::Regular => "regular",
        }
    }
}
