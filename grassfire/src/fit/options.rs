//! Options of the fit.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::FitError;

/// Options of [`super::fit`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FitOptions {
    /// Starts with nets of different evenness, at most; the best is kept. There is a second one only if the first was sound
    /// but did not meet the goal, and the body has at most 2000 quads; a third one only if a place is still farther off than
    /// ten times the goal, and the body has at most 1333 quads.
    pub starts: u32,
    /// Gauss-Newton rounds against the iso-surface.
    pub rounds: u32,
    /// Weight of the fairness (bending) against the data once the fit has settled. It starts at 1
    /// and falls by 0.6 a round.
    pub fairness: f64,
    /// Samples of the iso-surface that pull the limit surface.
    pub iso_samples: usize,
    /// Largest move of a control point in a round, voxels.
    pub max_step: f64,
    /// Weight of tangential evenness of the net against the data. It spreads the control points over
    /// the surface and hardly moves the surface itself.
    pub evenness: f64,
    /// Patches whose smallest normalised Jacobian is below this count as folded; untangling aims at
    /// twice this.
    pub fold_limit: f64,
    /// Times that strips of quads are split where the mesh is too coarse for the proposal, at most; 0 keeps the quads.
    pub refinements: u32,
    /// Refined meshes have at most this many times the quads.
    pub most_quads: f64,
    /// Refinement ends when the rms distance is below this, 95 % below twice and everything below eight times this,
    /// voxels.
    pub goal: f64,
    /// Last rounds at the proposal's volume, for bodies that do not cut themselves.
    pub settle_rounds: u32,
    /// The proposal's volume, mm3. Default: that of f > 0, whose edges are blunt.
    pub volume: Option<f64>,
    /// Largest number of unfolding rounds; 0 switches untangling off.
    pub untangle_rounds: u32,
    /// Rounds that give back what untangling took, without new intersections.
    pub regrow_rounds: u32,
    /// Untangling may lower the volume by at most this fraction.
    pub max_volume_loss: f64,
    /// Untangling may raise the rms distance by at most this fraction.
    pub max_rms_growth: f64,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            starts: 2,
            rounds: 16,
            fairness: 0.02,
            iso_samples: 20_000,
            max_step: 4.0,
            evenness: 0.01,
            fold_limit: 0.05,
            refinements: 3,
            most_quads: 3.0,
            goal: 0.15,
            settle_rounds: 6,
            volume: None,
            untangle_rounds: 12,
            regrow_rounds: 10,
            max_volume_loss: 0.01,
            max_rms_growth: 0.5,
        }
    }
}

/// Refuses options out of range.
pub(super) fn check(options: &FitOptions) -> Result<(), FitError> {
    let inside = |name, value: f64, lo: f64, hi: f64, allowed| {
        if value.is_finite() && value >= lo && value <= hi {
            Ok(())
        } else {
            Err(FitError::BadOption {
                name,
                value,
                allowed,
            })
        }
    };
    inside("starts", f64::from(options.starts), 1.0, 3.0, "1 to 3")?;
    inside("rounds", f64::from(options.rounds), 0.0, 200.0, "0 to 200")?;
    inside(
        "regrow_rounds",
        f64::from(options.regrow_rounds),
        0.0,
        200.0,
        "0 to 200",
    )?;
    inside(
        "untangle_rounds",
        f64::from(options.untangle_rounds),
        0.0,
        200.0,
        "0 to 200",
    )?;
    inside(
        "refinements",
        f64::from(options.refinements),
        0.0,
        20.0,
        "0 to 20",
    )?;
    inside("most_quads", options.most_quads, 1.0, 100.0, "1 to 100")?;
    inside("goal", options.goal, 0.0, 100.0, "0 to 100 voxels")?;
    inside(
        "settle_rounds",
        f64::from(options.settle_rounds),
        0.0,
        200.0,
        "0 to 200",
    )?;
    let volume = options.volume.unwrap_or(1.0);
    inside("volume", volume, 1e-9, 1e18, "a positive volume")?;
    inside("evenness", options.evenness, 0.0, 100.0, "0 to 100")?;
    inside("fold_limit", options.fold_limit, 0.0, 0.4, "0 to 0.4")?;
    inside("fairness", options.fairness, 1e-6, 1e3, "1e-6 to 1000")?;
    inside(
        "iso_samples",
        options.iso_samples as f64,
        0.0,
        1e7,
        "at most 10 million",
    )?;
    inside(
        "max_step",
        options.max_step,
        1e-3,
        1e3,
        "0.001 to 1000 voxels",
    )?;
    inside(
        "max_volume_loss",
        options.max_volume_loss,
        0.0,
        1.0,
        "0 to 1",
    )?;
    inside(
        "max_rms_growth",
        options.max_rms_growth,
        0.0,
        100.0,
        "0 to 100",
    )
}
