//! Chvorinov's rule: how long plates take, and how far heat gets meanwhile.

use std::f64::consts::PI;

use super::{Metal, Sand, lookup};

/// Sand reaches this many diffusion lengths.
const LENGTHS: f64 = 3.0;

/// Thickness of sand that heat gets through in `time` s, mm.
pub(super) fn padding(sand: &Sand, time: f64) -> f64 {
    LENGTHS * (diffusivity(sand) * time).sqrt() * 1e3
}

fn diffusivity(sand: &Sand) -> f64 {
    let warm = 500.0;
    lookup(&sand.conductivity, warm) / (sand.density * lookup(&sand.heat_capacity, warm))
}

/// Constants of Chvorinov's rule `t = c M^2 + b M` for plates, s/m2 and s/m.
fn chvorinov(metal: &Metal, sand: &Sand) -> [f64; 2] {
    let middle = (metal.solidus + metal.liquidus) / 2.0;
    let superheat = lookup(&metal.heat_capacity, metal.liquidus) * (metal.pour - middle);
    let heat = metal.density * (1e3 * metal.latent_heat + superheat);
    let mean = (middle + sand.temperature) / 2.0;
    let rise = middle - sand.temperature;
    let beta = sand.density * lookup(&sand.heat_capacity, mean) * rise / heat;
    let c = PI / (4.0 * diffusivity(sand) * beta * beta);
    let b = heat / (lookup(&metal.interface, middle) * rise);
    [c, b]
}

/// When a plate of half thickness `modulus` mm is solid, s.
pub(super) fn plate_time(metal: &Metal, sand: &Sand, modulus: f64) -> f64 {
    let [c, b] = chvorinov(metal, sand);
    let m = modulus * 1e-3;
    c * m * m + b * m
}

/// Half thickness of a plate that is solid after `time` s, mm.
pub(super) fn thermal_modulus(metal: &Metal, sand: &Sand, time: f64) -> f64 {
    let [c, b] = chvorinov(metal, sand);
    ((b * b + 4.0 * c * time).sqrt() - b) / (2.0 * c) * 1e3
}
