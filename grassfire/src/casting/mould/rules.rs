//! The foundry's sheet: limits by alloy and process, each with its source.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Alloys whose rules differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Alloy {
    /// Aluminium casting alloys.
    Aluminium,
    /// Grey and ductile iron.
    Iron,
    /// Steel.
    #[default]
    Steel,
}

/// Processes whose rules differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Process {
    /// Sand moulds.
    #[default]
    Sand,
    /// Gravity dies.
    GravityDie,
}

/// Limits; those that are none come from the table for alloy and process.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Rules {
    /// Alloy.
    pub alloy: Alloy,
    /// Process.
    pub process: Process,
    /// Least wall, mm.
    pub min_wall: Option<f64>,
    /// Least draft, degrees.
    pub min_draft: Option<f64>,
    /// Largest range of the parting line across its plane, mm.
    pub parting_flatness: Option<f64>,
    /// Most separate undercuts (each is a core or a slide).
    pub undercuts: Option<f64>,
    /// Largest ratio of thick to thin walls.
    pub wall_ratio: Option<f64>,
    /// Largest change of a wall's thickness over the way along it.
    pub transition: Option<f64>,
    /// Least fillet of an inner edge, as a share of the sum of the two walls.
    pub fillet: Option<f64>,
    /// Narrowest gap or hole that sand or a core makes, mm.
    pub min_hole: Option<f64>,
    /// Largest inscribed ball in a junction over the thickest wall that meets there.
    pub junction: Option<f64>,
}

/// A limit and where it comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limit {
    /// The limit.
    pub value: f64,
    /// Its source.
    pub source: &'static str,
}

const GIVEN: &str = "given by the user";

impl Rules {
    fn or(given: Option<f64>, value: f64, source: &'static str) -> Limit {
        match given {
            Some(value) => Limit {
                value,
                source: GIVEN,
            },
            None => Limit { value, source },
        }
    }

    /// Least wall, mm.
    pub fn wall(&self) -> Limit {
        let (value, source) = match (self.process, self.alloy) {
            (Process::GravityDie, _) => (3.0, "gravity die 3 to 8 mm (neway precision)"),
            (_, Alloy::Aluminium) => (
                3.0,
                "aluminium in sand from 3 mm, 3 to 5 typical (rotocastmold)",
            ),
            (_, Alloy::Iron) => (4.0, "small iron castings in sand 4 mm (foundry practice)"),
            (_, Alloy::Steel) => (6.0, "steel in sand 6 mm (foundry practice)"),
        };
        Self::or(self.min_wall, value, source)
    }

    /// Least draft, degrees.
    pub fn draft(&self) -> Limit {
        let (value, source) = match self.process {
            Process::Sand => (
                1.0,
                "1 degree is common (Steel Founders' Society of America)",
            ),
            Process::GravityDie => (2.0, "2 to 4 degrees (neway precision)"),
        };
        Self::or(self.min_draft, value, source)
    }

    /// Largest range of the parting line, mm.
    pub fn flatness(&self) -> Limit {
        Self::or(
            self.parting_flatness,
            0.5,
            "a flat parting at the widest section is cheapest (neway precision)",
        )
    }

    /// Most undercuts.
    pub fn cores(&self) -> Limit {
        Self::or(
            self.undercuts,
            0.0,
            "each undercut needs a core or a loose piece",
        )
    }

    /// Largest ratio of walls.
    pub fn ratio(&self) -> Limit {
        Self::or(
            self.wall_ratio,
            2.0,
            "walls within 2 to 1 (foundry practice)",
        )
    }

    /// Largest change of thickness over the way.
    pub fn step(&self) -> Limit {
        Self::or(
            self.transition,
            0.5,
            "each side of a wall 1 in 4 (foundry practice)",
        )
    }

    /// Least fillet over the sum of the two walls.
    pub fn rounding(&self) -> Limit {
        Self::or(
            self.fillet,
            0.2,
            "a fifth to a third of the sum of both walls (dz-machine)",
        )
    }

    /// Narrowest gap or hole, mm.
    pub fn hole(&self) -> Limit {
        let value = match self.process {
            Process::Sand => 5.0,
            Process::GravityDie => 3.0,
        };
        Self::or(self.min_hole, value, "3 to 5 mm (neway precision)")
    }

    /// Largest ratio of an inscribed ball.
    pub fn ball(&self) -> Limit {
        Self::or(
            self.junction,
            1.5,
            "equal walls with the least fillets: T 1.45, X 1.75; T and L are preferred to V, Y and X (AFS)",
        )
    }
}
