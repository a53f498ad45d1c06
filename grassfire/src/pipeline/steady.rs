//! Limits under which the skeleton hardly changes with the voxel.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::ReconstructOptions;
use crate::fit::FitOptions;
use crate::skeleton::{Layout, Skeleton};

/// Limits that decide what is a sheet, a member, a node or a remnant of one; each stands for the option of its name in `medial` or
/// `skeleton`.
///
/// The default ones lie in gaps of what was measured on real parts, so that the same part at a finer voxel gives the same
/// sheets, seams and beams, and fewer of them: flaps at seams, islands of sheet on members and crescents beside non-design bodies
/// go. Some bodies need what goes: therefore they are tried first, once, with the regular layout, and the usual limits after.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SteadyLimits {
    /// `medial.sheet_ratio`: least erosion thickness of a sheet as a multiple of its radius.
    pub sheet_ratio: f64,
    /// `medial.island_ratio`: sheets smaller than the square of this many radii become curves.
    pub island_ratio: f64,
    /// `medial.neck_length`: curves between sheets shorter than this many radii are necks.
    pub neck_length: f64,
    /// `skeleton.slight_spur`: dangling beams with little material that stick out by less than this many radii go.
    pub slight_spur: f64,
    /// `skeleton.node_distance`: nodes nearer than this many radii are one.
    pub node_distance: f64,
}

impl Default for SteadyLimits {
    fn default() -> Self {
        Self {
            sheet_ratio: 1.4,
            island_ratio: 6.0,
            neck_length: 5.0,
            slight_spur: 6.0,
            node_distance: 3.0,
        }
    }
}

/// Starts of the fit with steady limits, unless the user chose how many: their bodies have fewer quads to follow grooves with, and
/// one place that stays too far off costs the whole body.
const STARTS: u32 = 3;

impl SteadyLimits {
    fn of(options: &ReconstructOptions) -> Self {
        let (medial, skeleton) = (&options.medial, &options.skeleton);
        Self {
            sheet_ratio: medial.sheet_ratio,
            island_ratio: medial.island_ratio,
            neck_length: medial.neck_length,
            slight_spur: skeleton.slight_spur,
            node_distance: skeleton.node_distance,
        }
    }
}

/// The options with the steady limits where these are tried first: they come with the regular layout, and a skeleton `drawn`
/// elsewhere has no limits.
pub(super) fn first(
    options: &ReconstructOptions,
    layout: Layout,
    drawn: Option<&Skeleton>,
) -> Option<ReconstructOptions> {
    steady(options).filter(|_| layout == Layout::Auto && drawn.is_none())
}

/// The options with the steady limits; none where they are off or the user chose limits of his own. None, too, where a repair for a
/// mould makes walls lean: their bodies have fewer quads to do that with.
fn steady(options: &ReconstructOptions) -> Option<ReconstructOptions> {
    let limits = options.retry.steady?;
    options.retry.quad_sizes.first()?;
    if options.mould.leans().is_some() {
        return None;
    }
    if SteadyLimits::of(options) != SteadyLimits::of(&ReconstructOptions::default()) {
        return None;
    }
    let mut steady = options.clone();
    steady.medial.sheet_ratio = limits.sheet_ratio;
    steady.medial.island_ratio = limits.island_ratio;
    steady.medial.neck_length = limits.neck_length;
    steady.skeleton.slight_spur = limits.slight_spur;
    steady.skeleton.node_distance = limits.node_distance;
    if options.fit.starts == FitOptions::default().starts {
        steady.fit.starts = STARTS;
    }
    Some(steady)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::casting::mould::Repair;

    #[test]
    fn limits_that_the_user_chose_are_used_alone() {
        let mut options = ReconstructOptions::default();
        let first = steady(&options).expect("on by default");
        assert_eq!(SteadyLimits::of(&first), SteadyLimits::default());
        assert_eq!(first.fit.starts, STARTS);
        options.medial.sheet_ratio = 1.0;
        assert!(steady(&options).is_none());
        options = ReconstructOptions::default();
        options.retry.steady = None;
        assert!(steady(&options).is_none());
    }

    /// The body of steady limits of the repaired simjeb_055 was taken, leaned badly, and left 22 lines with two intervals instead of 7.
    #[test]
    fn bodies_whose_walls_must_lean_take_the_usual_limits() {
        let mut options = ReconstructOptions::default();
        options.mould.draw = Some([0.0, 0.0, 1.0]);
        assert!(steady(&options).is_some(), "nothing is repaired");
        options.mould.repair = Repair::Fill;
        assert!(steady(&options).is_none());
    }
}
