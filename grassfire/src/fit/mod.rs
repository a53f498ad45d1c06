//! Fit: moves the control points so that the Catmull-Clark limit surface follows the proposal.
