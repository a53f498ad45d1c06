//! Quads of the default size, for where those of a size that the user chose give no sound body.

use super::ReconstructOptions;
use super::construct::Site;
use super::steady;
use crate::skeleton::SkeletonOptions;

/// The options with quads of the default size; none where they have it.
pub(super) fn usual(options: &ReconstructOptions) -> Option<ReconstructOptions> {
    let (asked, usual) = (&options.skeleton, SkeletonOptions::default());
    let skeleton = SkeletonOptions {
        quad_size: usual.quad_size,
        size_factor: usual.size_factor,
        size_least: usual.size_least,
        size_most: usual.size_most,
        ..asked.clone()
    };
    (skeleton != *asked).then(|| ReconstructOptions {
        skeleton,
        ..options.clone()
    })
}

impl Site<'_> {
    /// From here on quads have the default size, if the user chose another one: it gave no good body. Of the warnings only those `told`
    /// before stay.
    pub(super) fn takes_usual_sizes(&mut self, told: usize) -> bool {
        let Some(options) = self.usual_sizes.take() else {
            return false;
        };
        self.monitor.keep_warnings(told);
        let text = "quads of the size asked for give no sound body: the part was made with quads of the default size";
        self.monitor.warn("skeleton", text);
        (self.options, self.size_refused) = (options, true);
        (self.layout, self.regular_refused) = (self.first_layout, None);
        self.steady = steady::first(options, self.layout, self.drawn);
        self.steady_refused = None;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// simjeb_623 with quads half or twice as large ended as a body that cuts itself.
    #[test]
    fn quads_of_the_default_size_stand_in_for_chosen_ones_only() {
        let mut options = ReconstructOptions::default();
        options.skeleton.searches = 7;
        assert!(usual(&options).is_none());
        options.skeleton.size_factor *= 2.0;
        options.skeleton.quad_size = Some(9.0);
        let usual = usual(&options).expect("another size");
        assert_eq!(usual.skeleton.searches, 7);
        options.skeleton = SkeletonOptions {
            searches: 7,
            ..SkeletonOptions::default()
        };
        assert_eq!(usual, options);
    }
}
