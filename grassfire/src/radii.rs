//! Radii: medial radii mapped onto the skeleton and smoothed.
