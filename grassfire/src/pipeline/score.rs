//! How good a fitted body is, and which quad size is tried next.

use super::shape::flipped;
use crate::fit::Fitted;
use crate::report::Limits;

/// Takes the next size out of those left; after a body that cuts itself coarser quads come first: they cost less time,
/// and give fewer faces.
pub(super) fn next_size(left: &mut Vec<f64>, best: Best, design_part: bool) -> Option<f64> {
    left.retain(|&size| worth_trying(size, best, design_part));
    let coarser = left.iter().position(|&size| size > 1.0);
    let first = coarser.filter(|_| best == Best::Unsound).unwrap_or(0);
    (first < left.len()).then(|| left.remove(first))
}

/// The best body so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Best {
    /// There is none.
    None,
    /// It cuts itself, folds over or is torn.
    Unsound,
    /// It misses a limit.
    Far,
    /// It is within all limits, but not close.
    Rough,
}

/// Whether a body with quads of `size` may be better than the best so far.
///
/// Coarser quads may get rid of crossings, but never of distance; much finer ones neither, since the fit splits quads that
/// are too coarse; they may bring a body closer that is near already. Of a design part that cuts itself in two tries the whole proposal is the better next try.
fn worth_trying(size: f64, best: Best, design_part: bool) -> bool {
    match best {
        Best::None => true,
        Best::Unsound => size >= FINE && !(design_part && size > 1.0),
        Best::Far => (FINE..=1.0).contains(&size),
        Best::Rough => size <= 1.0,
    }
}

/// A design part that cuts itself at more places than this gets no other try: the whole proposal is the better one.
pub(super) const MANY: usize = 3;

/// Quads below this multiple of the usual size are much finer.
pub(super) const FINE: f64 = 0.75;

/// A regular layout whose body is within this of the proposal everywhere is taken without making another one, voxels.
const NEAR: f64 = 1.5;

/// A body is farther off than this, voxels, for another reason than a wedge that was cut off: those end in steps of 1.7.
const STEP: f64 = 2.5;

/// Distances of two fits that differ by less are the same.
pub(super) const SAME: f64 = 1.1;

/// How good a fitted body is.
pub(super) struct Score {
    /// Places where it cuts itself.
    pub(super) crossings: usize,
    /// Patches whose normal flips over.
    folds: usize,
    /// Distance and volume over their limits, the largest ratio; above 1 a limit is exceeded.
    excess: f64,
    /// Root mean square distance, or half of what 95 % are within when that is more, voxels.
    pub(super) rough: f64,
    /// Largest distance along the field's gradient, voxels.
    farthest: f64,
    /// Largest shortest distance, voxels.
    shortest: f64,
}

/// The fit measures on its own samples; the final figures may be a little worse.
const MARGIN: f64 = 0.95;
/// Bodies that are farther off somewhere have a slit that the proposal has not, or lack a member, voxels.
const TORN: f64 = 3.0;
/// Bodies that miss a limit by more than this factor and cut themselves are given up.
const HOPELESS: f64 = 3.0;
/// Sound bodies that miss a limit by up to this factor are kept: they can be edited, wrapped ones cannot.
const USABLE: f64 = 1.5;

impl Score {
    pub(super) fn of(fitted: &Fitted, voxel: f64, limits: &Limits) -> Self {
        let both = [&fitted.body_to_iso, &fitted.iso_to_body];
        let rms = both.iter().map(|d| d.rms).fold(0.0, f64::max) / voxel;
        let p95 = both.iter().map(|d| d.p95).fold(0.0, f64::max) / voxel;
        let distance = (rms / limits.distance_rms).max(p95 / limits.distance_p95);
        let volume = (fitted.volume / fitted.iso_volume - 1.0).abs() / limits.volume;
        Self {
            crossings: fitted.self_intersections.len(),
            folds: flipped(fitted),
            excess: distance.max(volume) / MARGIN,
            rough: rms.max(p95 / 2.0),
            farthest: both.iter().map(|d| d.max).fold(0.0, f64::max) / voxel,
            shortest: fitted.farthest / voxel,
        }
    }

    /// Close on the whole, if at all, but not at some place.
    pub(super) fn torn(&self) -> bool {
        self.farthest > TORN
    }

    pub(super) fn sound(&self) -> bool {
        self.crossings + self.folds == 0
    }

    pub(super) fn good(&self) -> bool {
        self.sound() && self.excess <= 1.0 && !self.torn()
    }

    /// Sound, and not so far off that a body without a skeleton would serve better.
    pub(super) fn usable(&self) -> bool {
        self.sound() && self.excess <= USABLE
    }

    /// Good, and close to the proposal: within `close` on the whole, and nowhere far.
    pub(super) fn close(&self, close: f64) -> bool {
        self.good() && self.rough <= close && self.farthest <= NEAR
    }

    /// Good and close on the whole, if not at some place; not farther there than where a wedge was cut off.
    pub(super) fn close_on_the_whole(&self, close: f64) -> bool {
        self.good() && self.rough <= close && self.farthest <= STEP
    }

    /// Close, the floors of narrow grooves measured to what is nearest, and `slack` times as far let pass there; the fit's own
    /// measure there is pessimistic.
    pub(super) fn near(&self, close: f64, slack: f64) -> bool {
        self.good() && self.rough <= close && self.shortest <= slack * NEAR
    }

    /// How far the body is from the proposal, in words.
    pub(super) fn distances(&self) -> String {
        let (rough, farthest) = (self.rough, self.farthest);
        format!(
            "the body is {rough:.2} voxels (rms) and at most {farthest:.1} voxels from the proposal"
        )
    }

    /// Why a body of a regular layout is not taken instead of another one: it is not good, or more than `close` or somewhere
    /// far from the proposal, and farther than the other.
    pub(super) fn refused_for(&self, other: &Self, close: f64) -> Option<String> {
        if !self.good() {
            return Some(self.to_string());
        }
        let farther = |mine: f64, other: f64, limit: f64| mine > SAME * other.max(limit);
        let refused = other.good()
            && (farther(self.rough, other.rough, close)
                || farther(self.farthest, other.farthest, NEAR));
        refused.then(|| {
            let (distances, rough, farthest) = (self.distances(), other.rough, other.farthest);
            format!("{distances}, that of the other one {rough:.2} and {farthest:.1}")
        })
    }

    /// So far off that other quad sizes do not help: the part is not made of sheets and members.
    pub(super) fn hopeless(&self) -> bool {
        self.crossings > 0 && self.excess > HOPELESS
    }

    /// Orders tries: soundness first, then closeness, everywhere and on the whole.
    pub(super) fn worse(&self) -> (usize, usize, f64) {
        let far = if self.torn() {
            self.farthest / TORN
        } else {
            0.0
        };
        (self.crossings, self.folds, self.excess.max(far))
    }
}

impl std::fmt::Display for Score {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.crossings {
            0 if self.folds > 0 => write!(f, "{} faces of the body fold over", self.folds),
            0 if self.torn() => write!(
                f,
                "the body is {:.1} voxels from the proposal at one place",
                self.farthest
            ),
            0 => write!(
                f,
                "the body misses the proposal by {:.2} times the limits for distance and volume",
                self.excess
            ),
            places => write!(f, "the body cuts itself at {places} places"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_body_with_a_slit_of_four_voxels_was_taken_as_good() {
        let score = |farthest: f64| Score {
            crossings: 0,
            folds: 0,
            excess: 0.5,
            rough: 0.2,
            farthest,
            shortest: farthest,
        };
        let (torn, close) = (score(4.0), score(1.0));
        assert!(close.good() && !torn.good() && torn.sound());
        assert!(close.worse() < torn.worse());
    }

    #[test]
    fn a_regular_layout_never_makes_a_part_farther_from_the_proposal() {
        let score = |rough: f64, farthest: f64, crossings: usize| Score {
            crossings,
            folds: 0,
            excess: 0.5,
            rough,
            farthest,
            shortest: farthest,
        };
        let refused = |regular: &Score, plain: &Score| regular.refused_for(plain, 0.22).is_some();
        // Close: taken without another try, and whatever that gave.
        let close = score(0.15, 1.4, 0);
        assert!(close.close(0.22) && !refused(&close, &score(0.1, 0.8, 0)));
        // Far somewhere: only if the plain one is, too.
        let far = score(0.15, 2.2, 0);
        assert!(!far.close(0.22) && refused(&far, &score(0.15, 1.7, 0)));
        assert!(!refused(&far, &score(0.15, 2.3, 0)) && !refused(&far, &score(0.15, 1.0, 1)));
        let rough = score(0.3, 1.0, 0);
        assert!(!rough.close(0.22) && refused(&rough, &score(0.25, 1.0, 0)));
        assert!(!refused(&rough, &score(0.35, 1.0, 0)));
        // Unsound or torn: never.
        assert!(refused(&score(0.1, 0.5, 1), &score(0.9, 9.0, 5)));
        assert!(refused(&score(0.1, 3.5, 0), &score(0.1, 4.0, 0)));
    }

    #[test]
    fn a_body_that_cut_itself_was_tried_with_finer_quads_before_coarser_ones() {
        let mut left = vec![1.0, 0.8, 1.3, 0.6];
        assert_eq!(next_size(&mut left, Best::None, false), Some(1.0));
        assert_eq!(next_size(&mut left, Best::Unsound, false), Some(1.3));
        assert_eq!(next_size(&mut left, Best::Far, false), Some(0.8));
        assert_eq!(next_size(&mut left, Best::Far, false), None);
        let both = || vec![0.8, 1.3];
        assert_eq!(next_size(&mut both(), Best::Far, false), Some(0.8));
        assert_eq!(next_size(&mut both(), Best::Unsound, false), Some(1.3));
        assert_eq!(next_size(&mut both(), Best::Unsound, true), Some(0.8));
    }

    #[test]
    fn slightly_finer_quads_are_for_distance_and_coarser_ones_for_crossings() {
        let worth = worth_trying;
        assert!(worth(1.0, Best::None, false) && worth(0.6, Best::None, true));
        assert!(worth(0.8, Best::Far, true) && !worth(1.3, Best::Far, false));
        assert!(!worth(0.6, Best::Far, true));
        assert!(worth(1.3, Best::Unsound, false) && !worth(0.6, Best::Unsound, false));
        assert!(worth(0.8, Best::Unsound, true) && !worth(1.3, Best::Unsound, true));
    }

    #[test]
    fn a_body_within_the_limits_but_not_close_was_taken_without_trying_finer_quads() {
        let mut left = vec![0.8, 1.3, 0.65];
        assert_eq!(next_size(&mut left, Best::Rough, true), Some(0.8));
        assert_eq!(next_size(&mut left, Best::Rough, true), Some(0.65));
        assert_eq!(next_size(&mut left, Best::Rough, true), None);
    }
}
