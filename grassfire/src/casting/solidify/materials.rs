//! Metals and mould sands: temperature-dependent tables, each with its source.
//!
//! Temperatures in degrees Celsius, conductivity W/(m K), heat capacity J/(kg K), density kg/m3, latent heat kJ/kg,
//! interface W/(m2 K). Tables are pairs of temperature and value, straight between, constant beyond.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Pairs of temperature and value, ascending.
pub type Table = Vec<[f64; 2]>;

/// What is poured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Metal {
    /// Name in the report.
    pub name: String,
    /// Last liquid freezes.
    pub solidus: f64,
    /// First solid forms.
    pub liquidus: f64,
    /// Temperature in the filled mould.
    pub pour: f64,
    /// Mean of solid and liquid: the volume is fixed.
    pub density: f64,
    /// Over temperature.
    pub conductivity: Table,
    /// Over temperature, without latent heat.
    pub heat_capacity: Table,
    /// All of it between liquidus and solidus.
    pub latent_heat: f64,
    /// Fraction solid over temperature, from 1 at the solidus to 0 at the liquidus; empty for a straight line.
    #[serde(default)]
    pub solid_fraction: Table,
    /// Fraction solid at which feeding ends.
    pub feeding_ends: f64,
    /// Heat transfer to the mould over the metal's temperature.
    pub interface: Table,
    /// Below this value of Niyama's criterion G / sqrt(R) shrinkage porosity is likely, (K s)^0.5 / mm.
    pub niyama: f64,
    /// Shrinkage from liquid to solid over the volume.
    pub shrinkage: f64,
    /// Where the numbers come from.
    pub source: String,
}

/// What it is poured into.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sand {
    /// Name in the report.
    pub name: String,
    /// Bulk density.
    pub density: f64,
    /// Over temperature.
    pub conductivity: Table,
    /// Over temperature.
    pub heat_capacity: Table,
    /// Before pouring.
    pub temperature: f64,
    /// Where the numbers come from.
    pub source: String,
}

/// Metals that are known by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MetalName {
    /// Aluminium casting alloy A356 (AlSi7Mg).
    A356,
    /// Ductile cast iron.
    Ductile,
    /// Unalloyed cast steel WCB.
    #[default]
    Wcb,
}

/// Sands that are known by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SandName {
    /// Dry silica sand.
    #[default]
    Silica,
    /// Furan-bonded silica sand.
    Resin,
}

const WARRINER: &str =
    "tables of the Casting Geometric Toolsuite (W. Warriner, MIT licence), read as facts";

impl MetalName {
    /// Its tables.
    pub fn metal(self) -> Metal {
        match self {
            Self::A356 => a356(),
            Self::Ductile => ductile(),
            Self::Wcb => wcb(),
        }
    }
}

fn a356() -> Metal {
    Metal {
        name: "A356".into(),
        solidus: 557.0,
        liquidus: 615.0,
        pour: 700.0,
        density: 2496.0,
        conductivity: vec![
            [25.0, 160.0],
            [557.0, 170.0],
            [586.0, 106.0],
            [615.0, 83.0],
            [700.0, 87.0],
        ],
        heat_capacity: vec![[25.0, 900.0], [557.0, 1110.0], [615.0, 1141.0]],
        latent_heat: 433.0,
        // Dendrites first, then the eutectic plateau.
        solid_fraction: vec![
            [557.0, 1.0],
            [570.0, 0.87],
            [575.0, 0.49],
            [600.0, 0.2],
            [615.0, 0.0],
        ],
        feeding_ends: 0.25,
        interface: vec![[450.0, 400.0], [650.0, 800.0]],
        niyama: 0.3,
        shrinkage: 0.06,
        source: format!("{WARRINER}; latent heat by integration of its heat capacity"),
    }
}

fn ductile() -> Metal {
    Metal {
        name: "ductile iron".into(),
        solidus: 1130.0,
        liquidus: 1170.0,
        pour: 1350.0,
        density: 7000.0,
        conductivity: vec![[25.0, 36.0], [1130.0, 30.0]],
        heat_capacity: vec![[25.0, 500.0], [600.0, 680.0], [1130.0, 750.0], [1350.0, 830.0]],
        latent_heat: 230.0,
        solid_fraction: Vec::new(),
        feeding_ends: 0.5,
        interface: vec![[1000.0, 104.0], [1200.0, 380.0], [1600.0, 940.0]],
        niyama: 0.775,
        shrinkage: 0.02,
        source: "foundry handbooks (approximate; graphite expansion is not modelled); conductivity of the solid: material-properties.org; interface as for steel".into(),
    }
}

fn wcb() -> Metal {
    Metal {
        name: "steel WCB".into(),
        solidus: 1480.0,
        liquidus: 1525.0,
        pour: 1580.0,
        density: 7168.0,
        conductivity: vec![
            [25.0, 50.0],
            [800.0, 27.0],
            [1000.0, 28.0],
            [1480.0, 35.0],
            [1525.0, 34.0],
        ],
        heat_capacity: vec![
            [25.0, 460.0],
            [600.0, 740.0],
            [900.0, 640.0],
            [1480.0, 698.0],
            [1525.0, 822.0],
        ],
        // The table gives 185 when sensible heat is taken off its heat capacity; the heat of fusion of iron, of which the
        // alloy has 98 %, is well known and 247.
        latent_heat: 247.0,
        solid_fraction: Vec::new(),
        feeding_ends: 0.5,
        interface: vec![[1000.0, 104.0], [1200.0, 380.0], [1600.0, 940.0]],
        niyama: 0.775,
        shrinkage: 0.03,
        source: format!(
            "{WARRINER}; latent heat: 13.81 kJ/mol of iron (CRC Handbook of Chemistry and Physics; NIST Chemistry WebBook)"
        ),
    }
}

impl SandName {
    /// Its tables.
    pub fn sand(self) -> Sand {
        match self {
            Self::Silica => Sand {
                name: "silica sand".into(),
                density: 1520.0,
                conductivity: vec![[25.0, 0.733], [400.0, 0.586], [800.0, 0.64], [1000.0, 0.70]],
                heat_capacity: vec![[1.0, 676.0], [227.0, 991.0], [427.0, 1167.0], [574.0, 1160.0], [1327.0, 1195.0]],
                temperature: 25.0,
                source: WARRINER.into(),
            },
            Self::Resin => Sand {
                name: "furan resin sand".into(),
                density: 1550.0,
                conductivity: vec![[25.0, 0.644], [1000.0, 0.40]],
                heat_capacity: vec![[25.0, 906.0], [1000.0, 1150.0]],
                temperature: 25.0,
                source: "fitted to measured temperatures of plates of ZL101 (zhycasting.com), measured up to 700 degrees; carried on in a straight line to 1000".into(),
            },
        }
    }
}

/// Value of a table at `x`.
pub fn lookup(table: &[[f64; 2]], x: f64) -> f64 {
    let after = table.partition_point(|pair| pair[0] <= x);
    match (
        after.checked_sub(1).and_then(|i| table.get(i)),
        table.get(after),
    ) {
        (Some(a), Some(b)) => a[1] + (b[1] - a[1]) * (x - a[0]) / (b[0] - a[0]),
        (Some(a), None) => a[1],
        (None, Some(b)) => b[1],
        (None, None) => 0.0,
    }
}

/// A table on even steps, for quick look-up.
#[derive(Debug, Clone)]
pub(super) struct Curve {
    first: f64,
    per_step: f64,
    values: Vec<f64>,
}

impl Curve {
    /// `steps` + 1 values of `f` from `first` to `last`.
    pub fn new(first: f64, last: f64, steps: usize, f: impl Fn(f64) -> f64) -> Self {
        let step = (last - first) / steps as f64;
        Self {
            first,
            per_step: 1.0 / step,
            values: (0..=steps).map(|i| f(first + i as f64 * step)).collect(),
        }
    }

    #[inline]
    pub fn at(&self, x: f64) -> f64 {
        let t = ((x - self.first) * self.per_step).clamp(0.0, (self.values.len() - 1) as f64);
        let i = (t as usize).min(self.values.len() - 2);
        self.values[i] + (t - i as f64) * (self.values[i + 1] - self.values[i])
    }
}

/// Enthalpy of a volume over temperature, both ways exactly inverse to each other (piecewise straight).
#[derive(Debug, Clone)]
pub(super) struct Enthalpy {
    /// Temperatures of the knots.
    knots: Vec<f64>,
    /// Enthalpies there, J/m3.
    values: Vec<f64>,
    /// First knot of every even step of enthalpy.
    bins: Vec<u32>,
    per_bin: f64,
}

const BINS: usize = 4096;
/// Knots are at most this far apart, K.
const KNOT: f64 = 10.0;

impl Enthalpy {
    /// Sensible heat of `density` x `capacity` plus `latent` (J/m3) times the liquid fraction, from `low` to `high`.
    pub fn new(
        density: f64,
        capacity: &[[f64; 2]],
        latent: f64,
        liquid: impl Fn(f64) -> f64,
        breaks: &[f64],
        range: [f64; 2],
    ) -> Self {
        let mut knots: Vec<f64> = breaks.to_vec();
        knots.extend(capacity.iter().map(|pair| pair[0]));
        let count = ((range[1] - range[0]) / KNOT).ceil() as usize;
        knots.extend(
            (0..=count).map(|i| range[0] + (range[1] - range[0]) * i as f64 / count as f64),
        );
        knots.retain(|t| (range[0]..=range[1]).contains(t));
        knots.sort_by(f64::total_cmp);
        knots.dedup_by(|a, b| (*a - *b).abs() < 1e-6);
        let mut values = Vec::with_capacity(knots.len());
        let mut sensible = 0.0;
        for (i, &t) in knots.iter().enumerate() {
            if i > 0 {
                let before = knots[i - 1];
                // Exact for a capacity that is straight between the knots.
                let mean = (lookup(capacity, t) + lookup(capacity, before)) / 2.0;
                sensible += density * mean * (t - before);
            }
            values.push(sensible + latent * liquid(t));
        }
        let last = values.len() - 1;
        let per_bin = BINS as f64 / (values[last] - values[0]);
        let bins = (0..BINS).map(|b| {
            let h = values[0] + b as f64 / per_bin;
            let after = values.partition_point(|v| *v <= h);
            (after.max(1) - 1).min(last - 1) as u32
        });
        let bins = bins.collect();
        Self {
            knots,
            values,
            bins,
            per_bin,
        }
    }

    /// Temperature of an enthalpy; straight on beyond the ends.
    #[inline]
    pub fn temperature(&self, h: f64) -> f64 {
        let bin = ((h - self.values[0]) * self.per_bin).clamp(0.0, (BINS - 1) as f64);
        let mut i = self.bins[bin as usize] as usize;
        let last = self.values.len() - 2;
        while i < last && self.values[i + 1] <= h {
            i += 1;
        }
        self.knots[i] + (h - self.values[i]) / self.slope(i)
    }

    /// Enthalpy of a temperature.
    pub fn of(&self, t: f64) -> f64 {
        let i = self.segment(t);
        self.values[i] + (t - self.knots[i]) * self.slope(i)
    }

    /// dH/dT at an enthalpy.
    #[inline]
    pub fn capacity(&self, h: f64) -> f64 {
        let bin = ((h - self.values[0]) * self.per_bin).clamp(0.0, (BINS - 1) as f64);
        let mut i = self.bins[bin as usize] as usize;
        let last = self.values.len() - 2;
        while i < last && self.values[i + 1] <= h {
            i += 1;
        }
        self.slope(i)
    }

    #[inline]
    fn slope(&self, i: usize) -> f64 {
        (self.values[i + 1] - self.values[i]) / (self.knots[i + 1] - self.knots[i])
    }

    fn segment(&self, t: f64) -> usize {
        let after = self.knots.partition_point(|k| *k <= t);
        (after.max(1) - 1).min(self.knots.len() - 2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn enthalpy_and_temperature_are_inverse() {
        for name in [MetalName::A356, MetalName::Ductile, MetalName::Wcb] {
            let metal = name.metal();
            let liquid =
                |t: f64| ((t - metal.solidus) / (metal.liquidus - metal.solidus)).clamp(0.0, 1.0);
            let breaks = [metal.solidus, metal.liquidus];
            let curve = Enthalpy::new(
                metal.density,
                &metal.heat_capacity,
                metal.density * 1e3 * metal.latent_heat,
                liquid,
                &breaks,
                [0.0, metal.pour + 50.0],
            );
            for i in 0..2000 {
                let t = f64::from(i) / 2000.0 * (metal.pour + 40.0);
                let back = curve.temperature(curve.of(t));
                assert!(
                    (back - t).abs() < 1e-7,
                    "{}: {t} came back as {back}",
                    metal.name
                );
            }
            let whole = curve.of(metal.liquidus) - curve.of(metal.solidus);
            assert!(whole > metal.density * 1e3 * metal.latent_heat);
        }
    }

    #[test]
    fn tables_are_sound() {
        for name in [MetalName::A356, MetalName::Ductile, MetalName::Wcb] {
            let metal = name.metal();
            assert!(metal.solidus < metal.liquidus && metal.liquidus < metal.pour);
            for table in [&metal.conductivity, &metal.heat_capacity, &metal.interface] {
                assert!(table.windows(2).all(|w| w[0][0] < w[1][0]));
            }
            assert!(!metal.source.is_empty());
        }
        assert_eq!(lookup(&[[0.0, 1.0], [10.0, 3.0]], 5.0), 2.0);
        assert_eq!(lookup(&[[0.0, 1.0], [10.0, 3.0]], 50.0), 3.0);
    }
}
