//! Looks whether options and material tables can be used.

use super::{Metal, Sand, SolidifyError, SolidifyOptions, Table};
use crate::Vec3;

pub(super) fn materials(options: &SolidifyOptions) -> Result<(Metal, Sand), SolidifyError> {
    let metal = options
        .metal
        .clone()
        .unwrap_or_else(|| options.material.metal());
    let sand = options.mould.clone().unwrap_or_else(|| options.sand.sand());
    let bad = |material: &str, what: String| SolidifyError::Material {
        material: material.to_owned(),
        what,
    };
    let table = |material: &str, name: &str, table: &Table| {
        let ascending = table.windows(2).all(|w| w[0][0] < w[1][0]);
        let positive = table
            .iter()
            .all(|p| p[0].is_finite() && p[1].is_finite() && p[1] > 0.0);
        if table.is_empty() || !ascending || !positive {
            let what =
                format!("the table {name} must have positive values at ascending temperatures");
            return Err(bad(material, what));
        }
        Ok(())
    };
    let numbers = [
        metal.solidus,
        metal.liquidus,
        metal.pour,
        metal.density,
        metal.latent_heat,
    ];
    if !numbers.iter().all(|x| x.is_finite())
        || metal.liquidus - metal.solidus < 0.1
        || metal.pour <= metal.liquidus
        || metal.density <= 0.0
        || metal.latent_heat <= 0.0
    {
        let what = "solidus, liquidus and pouring temperature must ascend (0.1 K apart), density and latent heat be positive";
        return Err(bad(&metal.name, what.into()));
    }
    table(&metal.name, "conductivity", &metal.conductivity)?;
    table(&metal.name, "heat_capacity", &metal.heat_capacity)?;
    table(&metal.name, "interface", &metal.interface)?;
    table(&sand.name, "conductivity", &sand.conductivity)?;
    table(&sand.name, "heat_capacity", &sand.heat_capacity)?;
    let fraction = &metal.solid_fraction;
    let falls = fraction
        .windows(2)
        .all(|w| w[0][0] < w[1][0] && w[0][1] >= w[1][1]);
    let ends = match (fraction.first(), fraction.last()) {
        (Some(a), Some(b)) => *a == [metal.solidus, 1.0] && *b == [metal.liquidus, 0.0],
        _ => true,
    };
    if !falls || !ends {
        let what = "solid_fraction must fall from 1 at the solidus to 0 at the liquidus";
        return Err(bad(&metal.name, what.into()));
    }
    if !(0.0..1.0).contains(&metal.feeding_ends) {
        return Err(bad(&metal.name, "feeding_ends must be 0 to 1".into()));
    }
    if !(sand.temperature.is_finite() && sand.temperature < metal.solidus && sand.density > 0.0) {
        let what = "the mould must be colder than the solidus and have a density";
        return Err(bad(&sand.name, what.into()));
    }
    Ok((metal, sand))
}

pub(super) fn check(options: &SolidifyOptions) -> Result<(), SolidifyError> {
    let range = |name, value: f64, lo: f64, hi: f64, allowed| {
        if value.is_finite() && value >= lo && value <= hi {
            Ok(())
        } else {
            Err(SolidifyError::Option {
                name,
                value,
                allowed,
            })
        }
    };
    range(
        "cell",
        options.cell.unwrap_or(1.0),
        1e-3,
        1e4,
        "0.001 to 10000",
    )?;
    range(
        "padding",
        options.padding.unwrap_or(1.0),
        0.0,
        1e5,
        "0 to 100000",
    )?;
    range("steps", options.steps as f64, 10.0, 1e5, "10 to 100000")?;
    range("persistence", options.persistence, 0.0, 1.0, "0 to 1")?;
    range(
        "feeder_diameter",
        options.feeder_diameter,
        0.0,
        1e5,
        "0 to 100000",
    )?;
    range(
        "up",
        Vec3::from(options.up).norm(),
        1e-9,
        1e9,
        "a vector that is not zero",
    )?;
    for x in options.feeders.iter().flatten() {
        range("feeders", *x, -1e9, 1e9, "places in mm")?;
    }
    Ok(())
}
