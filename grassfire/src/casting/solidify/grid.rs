//! The grid: even cells around the casting, growing ones in the sand outside.

use super::materials::{Curve, Enthalpy, Metal, Sand, lookup};
use crate::Vec3;
use crate::voxel::VoxelGrid;

/// Each cell of the outer sand is this many times wider than the one before.
const GRADE: f64 = 1.3;

/// What a cell holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(u8)]
pub enum Cell {
    /// Mould.
    #[default]
    Sand,
    /// The part.
    Casting,
    /// A feeder or its neck: metal that is cut off.
    Feeder,
}

impl Cell {
    /// Casting or feeder.
    pub fn is_metal(self) -> bool {
        self != Self::Sand
    }
}

/// A tensor grid with what its cells hold; x runs fastest. Lengths in metres.
#[derive(Debug, Clone)]
pub(super) struct Grid {
    pub dims: [usize; 3],
    /// Widths of the cells along each axis.
    pub widths: [Vec<f64>; 3],
    pub cells: Vec<Cell>,
    /// Absolute components of the unit normal, 255 for 1; what lies far from a surface has no meaning.
    pub normals: Vec<[u8; 3]>,
    /// Cells of the outer sand before the even ones, by axis.
    pub before: [usize; 3],
}

/// Widths of growing cells that reach `padding` beyond the even ones.
fn graded(cell: f64, padding: f64) -> Vec<f64> {
    let mut widths = Vec::new();
    let (mut width, mut sum) = (cell, 0.0);
    while sum < padding {
        width *= GRADE;
        sum += width;
        widths.push(width);
    }
    widths
}

impl Grid {
    /// A grid around signed distances (mm, positive in metal) with `padding` mm of sand on every side.
    ///
    /// `feeder` tells whether a metal cell belongs to a feeder.
    pub fn new(
        field: &VoxelGrid<f32>,
        padding: f64,
        feeder: impl Fn(&Vec3) -> bool + Sync,
    ) -> Self {
        let cell = field.spacing * 1e-3;
        let outer = graded(cell, padding * 1e-3);
        let before = outer.len();
        let widths = field.dims.map(|n| {
            let mut widths: Vec<f64> = outer.iter().rev().copied().collect();
            widths.resize(before + n, cell);
            widths.extend(&outer);
            widths
        });
        let dims = field.dims.map(|n| n + 2 * before);
        let total = dims[0] * dims[1] * dims[2];
        let mut grid = Self {
            dims,
            widths,
            cells: vec![Cell::Sand; total],
            normals: vec![[255; 3]; total],
            before: [before; 3],
        };
        for (v, &f) in field.values.iter().enumerate() {
            let [i, j, k] = field.ijk(v);
            let at = grid.index(i + before, j + before, k + before);
            if f > 0.0 {
                grid.cells[at] = if feeder(&field.centre(i, j, k)) {
                    Cell::Feeder
                } else {
                    Cell::Casting
                };
            }
            if f64::from(f.abs()) < 2.0 * field.spacing {
                grid.normals[at] = normal_code(&gradient(field, [i, j, k]));
            }
        }
        grid
    }

    #[inline]
    pub fn index(&self, i: usize, j: usize, k: usize) -> usize {
        (k * self.dims[1] + j) * self.dims[0] + i
    }

    /// (i, j, k) of a cell.
    #[inline]
    pub fn ijk(&self, index: usize) -> [usize; 3] {
        let i = index % self.dims[0];
        let j = index / self.dims[0] % self.dims[1];
        [i, j, index / (self.dims[0] * self.dims[1])]
    }

    /// m3.
    pub fn volume(&self, index: usize) -> f64 {
        let at = self.ijk(index);
        (0..3).map(|a| self.widths[a][at[a]]).product()
    }
}

/// Central differences over two cells each way, which calms the steps of a voxel field.
fn gradient(field: &VoxelGrid<f32>, at: [usize; 3]) -> Vec3 {
    let mut out = Vec3::zeros();
    for a in 0..3 {
        for reach in [1, 2] {
            let (mut low, mut high) = (at, at);
            low[a] = at[a].saturating_sub(reach);
            high[a] = (at[a] + reach).min(field.dims[a] - 1);
            let span = (high[a] - low[a]).max(1) as f64;
            let value = |p: [usize; 3]| f64::from(field.values[field.index(p[0], p[1], p[2])]);
            out[a] += (value(high) - value(low)) / span;
        }
    }
    out
}

fn normal_code(gradient: &Vec3) -> [u8; 3] {
    let unit = gradient.try_normalize(1e-12).unwrap_or_else(Vec3::x);
    [0, 1, 2].map(|a| (unit[a].abs() * 255.0).round() as u8)
}

/// Laws of metal and sand for quick look-up.
#[derive(Debug, Clone)]
pub(super) struct Laws {
    pub metal: Enthalpy,
    pub sand: Enthalpy,
    pub metal_conductivity: Curve,
    pub sand_conductivity: Curve,
    pub interface: Curve,
    /// Fraction solid.
    pub solid: Curve,
}

/// Temperatures beyond pouring and sand that tables cover, K.
const SPAN: f64 = 60.0;
const STEPS: usize = 4000;

impl Laws {
    pub fn new(metal: &Metal, sand: &Sand) -> Self {
        let low = sand.temperature.min(0.0) - SPAN;
        let high = metal.pour + SPAN;
        let straight = vec![[metal.solidus, 1.0], [metal.liquidus, 0.0]];
        let solid = if metal.solid_fraction.is_empty() {
            &straight
        } else {
            &metal.solid_fraction
        };
        let breaks: Vec<f64> = solid.iter().map(|pair| pair[0]).collect();
        let curve = |table: &[[f64; 2]]| Curve::new(low, high, STEPS, |t| lookup(table, t));
        Self {
            metal: Enthalpy::new(
                metal.density,
                &metal.heat_capacity,
                metal.density * 1e3 * metal.latent_heat,
                |t| 1.0 - lookup(solid, t),
                &breaks,
                [low, high],
            ),
            sand: Enthalpy::new(
                sand.density,
                &sand.heat_capacity,
                0.0,
                |_| 0.0,
                &[],
                [low, high],
            ),
            metal_conductivity: curve(&metal.conductivity),
            sand_conductivity: curve(&sand.conductivity),
            interface: curve(&metal.interface),
            solid: curve(solid),
        }
    }

    #[inline]
    pub fn enthalpy(&self, cell: Cell) -> &Enthalpy {
        if cell.is_metal() {
            &self.metal
        } else {
            &self.sand
        }
    }

    #[inline]
    pub fn conductivity(&self, cell: Cell, t: f64) -> f64 {
        if cell.is_metal() {
            self.metal_conductivity.at(t)
        } else {
            self.sand_conductivity.at(t)
        }
    }
}
