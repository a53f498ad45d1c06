//! `grassfire`: the command line.
fn main() {}
