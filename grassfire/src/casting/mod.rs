//! Casting: does the part feed, does it solidify towards its feeders, does it leave the mould?

pub mod feed;
pub mod mould;
pub mod solidify;
