//! Solidification of a casting in sand: when everything freezes, and what stays cut off from the feeders.

mod cells;
mod checks;
mod chvorinov;
mod error;
mod feeders;
mod grid;
mod hot_spots;
mod march;
mod materials;
mod sweep;
#[cfg(test)]
mod tests;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use error::SolidifyError;
pub use grid::Cell;
pub use hot_spots::HotSpot;
pub use materials::{Metal, MetalName, Sand, SandName, Table, lookup};

use crate::Vec3;
use crate::mesh::{Bvh, TriMesh, Winding};
use crate::monitor::Monitor;
use crate::remesh::{RemeshOptions, remesh};
use crate::voxel::VoxelGrid;
use checks::{check, materials};
use chvorinov::{padding, plate_time, thermal_modulus};
use feeders::{add_feeders, in_feeder, up};
use grid::{Grid, Laws};
use march::History;

/// Name of this stage in progress and warnings.
pub(crate) const STAGE: &str = "solidify";

/// Options of [`solidify`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SolidifyOptions {
    /// Metal by name.
    pub material: MetalName,
    /// Mould by name.
    pub sand: SandName,
    /// A metal of your own in place of `material`.
    pub metal: Option<Metal>,
    /// A sand of your own in place of `sand`.
    pub mould: Option<Sand>,
    /// Edge of a cell, mm; without it a quarter of a thin wall and at most a 110th of the part's longest side, as far as four
    /// million cells go.
    pub cell: Option<f64>,
    /// Sand around the part, mm; without it as thick as heat gets while the part freezes.
    pub padding: Option<f64>,
    /// Steps until a plate as thick as the thickest section would be solid.
    pub steps: usize,
    /// Most cells of the grid.
    pub max_cells: usize,
    /// Where feeders stand, mm.
    pub feeders: Vec<[f64; 3]>,
    /// Diameter and height of a feeder, mm; 0 takes 1.2 times the modulus of the section under it.
    pub feeder_diameter: f64,
    /// Direction in which feeders stand.
    pub up: [f64; 3],
    /// A hot spot counts when it freezes later than its surroundings by more than this share of its time.
    pub persistence: f64,
}

impl Default for SolidifyOptions {
    fn default() -> Self {
        Self {
            material: MetalName::default(),
            sand: SandName::default(),
            metal: None,
            mould: None,
            cell: None,
            padding: None,
            steps: 150,
            max_cells: 12_000_000,
            feeders: Vec::new(),
            feeder_diameter: 0.0,
            up: [0.0, 0.0, 1.0],
            persistence: 0.03,
        }
    }
}

/// How a casting freezes.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Solidification {
    /// Metal and sand.
    pub metal: String,
    /// Name of the sand.
    pub sand: String,
    /// Sources of both tables.
    pub sources: Vec<String>,
    /// Cells of the whole grid.
    pub cells: usize,
    /// Edge of an even cell, mm.
    pub cell: f64,
    /// Time steps.
    pub steps: usize,
    /// When the casting is solid, s (feeders left out).
    pub freeze_time: f64,
    /// Change of the heat in all over the heat of the metal.
    pub energy_drift: f64,
    /// When each cell was solid, s; 0 in sand, on the even cells only.
    pub time: VoxelGrid<f32>,
    /// When feeding through it ended, s; likewise.
    pub feeding: VoxelGrid<f32>,
    /// Niyama's criterion, (K s)^0.5 / mm; likewise.
    pub niyama: VoxelGrid<f32>,
    /// What each of these cells holds.
    pub content: Vec<Cell>,
    /// Latest first; places in mm beside.
    pub hot_spots: Vec<HotSpot>,
    /// Middle of each of these, mm.
    pub places: Vec<Vec3>,
    /// Volume open at the saddles of hot spots that no feeder reaches, mm3.
    pub isolated_volume: f64,
    /// Shrinkage of that, mm3.
    pub shrinkage_volume: f64,
    /// Share of the casting that stays connected to a feeder until it freezes.
    pub directional: f64,
    /// Share of the casting below the metal's limit of Niyama's criterion.
    pub low_niyama: f64,
    /// Volume over area of the casting, mm.
    pub modulus: f64,
    /// Modulus of a plate that freezes as late as the casting, mm.
    pub thermal_modulus: f64,
    /// Feeders as they stand: foot, diameter, mm.
    pub feeders: Vec<(Vec3, f64)>,
}

/// Computes how the casting `mesh` freezes in sand.
///
/// 1. The casting and its feeders (cylinders on necks) become signed distances on a grid of even cells ([`remesh`]);
///    sand cells outside grow by 1.3 until heat does not get further.
/// 2. Enthalpy method: `d(H)/dt = div(k grad T)` with `H(T)` from tables, in implicit sweeps along x, y and z that conserve
///    the sum of H. Between metal and mould there is an interface resistance, corrected for the steps of the cells.
/// 3. Noted for every cell: when feeding through it ends, when it is solid, Niyama's criterion.
/// 4. Hot spots by the merge tree of the times at which feeding ends.
///
/// What it does not do: filling, gas, graphite expansion, stress. Lengths in mm, times in s. Memory about 60 bytes a cell.
/// The result does not depend on the number of threads.
///
/// Niyama et al. (1982), A method of shrinkage prediction and its application to steel casting practice.
///
/// # Errors
/// [`SolidifyError`].
pub fn solidify(
    mesh: &TriMesh,
    options: &SolidifyOptions,
    monitor: &Monitor,
) -> Result<Solidification, SolidifyError> {
    let (metal, sand) = materials(options)?;
    check(options)?;
    monitor.step(STAGE, "grid", 0.0)?;
    let laws = Laws::new(&metal, &sand);
    let Ground {
        field,
        grid,
        feeders,
        expected,
    } = ground(mesh, &metal, &sand, options, monitor)?;
    let history = march::march(
        &grid,
        &laws,
        &metal,
        &sand,
        expected,
        options.steps,
        monitor,
    )?;
    monitor.step(STAGE, "hot spots", 0.95)?;
    let mut out = evaluate(&grid, &field, &history, &metal, options);
    out.feeders = feeders;
    out.sources = vec![metal.source.clone(), sand.source.clone()];
    out.sand.clone_from(&sand.name);
    out.modulus = mesh.volume().abs() / mesh.area().max(1e-300);
    out.thermal_modulus = thermal_modulus(&metal, &sand, out.freeze_time);
    Ok(out)
}

/// What is frozen.
struct Ground {
    /// Signed distances of part and feeders on the even cells.
    field: VoxelGrid<f32>,
    /// The same with the sand.
    grid: Grid,
    /// Feet and diameters, mm.
    feeders: Vec<(Vec3, f64)>,
    /// When a plate as thick as the thickest section would be solid, s.
    expected: f64,
}

/// As often a grid is laid: the sand's layers do not get fewer as fast as the cells get coarser.
const ROUNDS: usize = 5;

/// Lays the grid, with coarser cells where it would take more than its budget and the cell was not given.
fn ground(
    mesh: &TriMesh,
    metal: &Metal,
    sand: &Sand,
    options: &SolidifyOptions,
    monitor: &Monitor,
) -> Result<Ground, SolidifyError> {
    let limit = options.max_cells;
    let budget = limit.min(cells::BUDGET);
    let given = options.cell;
    let mut cell = given.unwrap_or_else(|| cells::default_cell(mesh, budget));
    let part = Bvh::new(mesh);
    let winding = Winding::new(&part);
    let mut rounds = 0;
    loop {
        rounds += 1;
        let mut field = distances(mesh, cell, limit, monitor)?;
        let thick = deepest_wall(&field);
        let feeders = add_feeders(&mut field, mesh, thick, options)?;
        let widest = feeders.iter().fold(thick, |m, f| m.max(f.1 / 6.0));
        let expected = plate_time(metal, sand, widest);
        let least = padding(sand, 0.05 * expected);
        let padding = options.padding.unwrap_or(padding(sand, expected));
        if padding < least {
            return Err(SolidifyError::Mould { padding, least });
        }
        let inside = |p: &Vec3| feeders.iter().any(|f| in_feeder(p, f, &up(options)));
        let grid = Grid::new(&field, padding, |p| inside(p) && winding.at(p) < 0.5);
        let cells = grid.cells.len();
        if given.is_none() && cells > budget && rounds < ROUNDS {
            cell = cells::coarser(cell, cells as f64, budget);
        } else if cells > limit {
            return Err(SolidifyError::TooMany { cell, cells, limit });
        } else {
            return Ok(Ground {
                field,
                grid,
                feeders,
                expected,
            });
        }
    }
}

/// Signed distances of the part on its cells, at most `limit`.
fn distances(
    mesh: &TriMesh,
    cell: f64,
    limit: usize,
    monitor: &Monitor,
) -> Result<VoxelGrid<f32>, SolidifyError> {
    let remeshed = remesh(
        mesh,
        &RemeshOptions {
            voxel: Some(cell),
            min_tunnel: 0.0,
            max_voxels: limit,
            ..RemeshOptions::default()
        },
        monitor,
    );
    let source = match remeshed {
        Ok(remeshed) => return Ok(remeshed.field),
        Err(crate::remesh::RemeshError::Cancelled(cancelled)) => return Err(cancelled.into()),
        Err(source) => source,
    };
    Err(SolidifyError::Grid { cell, source })
}

/// Largest radius of a ball inside, mm: the field is cut off beyond a few cells, so balls are grown cell by cell.
fn deepest_wall(field: &VoxelGrid<f32>) -> f64 {
    let [nx, ny, nz] = field.dims;
    let mut open: Vec<bool> = field.values.iter().map(|f| *f > 0.0).collect();
    let mut layers = 0;
    let mut next = open.clone();
    loop {
        let mut left = false;
        for k in 1..nz.saturating_sub(1) {
            for j in 1..ny.saturating_sub(1) {
                for i in 1..nx.saturating_sub(1) {
                    let v = field.index(i, j, k);
                    let around = [v - 1, v + 1, v - nx, v + nx, v - nx * ny, v + nx * ny];
                    next[v] = open[v] && around.iter().all(|&w| open[w]);
                    left |= next[v];
                }
            }
        }
        layers += 1;
        if !left || layers > 10_000 {
            break;
        }
        std::mem::swap(&mut open, &mut next);
    }
    layers as f64 * field.spacing
}

fn evaluate(
    grid: &Grid,
    field: &VoxelGrid<f32>,
    history: &History,
    metal: &Metal,
    options: &SolidifyOptions,
) -> Solidification {
    let blank = || VoxelGrid::filled(field.origin, field.spacing, field.dims, 0.0_f32);
    let (mut time, mut feeding, mut niyama) = (blank(), blank(), blank());
    let mut content = vec![Cell::Sand; field.values.len()];
    let (mut freeze_time, mut casting, mut low) = (0.0_f64, 0.0, 0.0);
    for (n, &c) in history.cells.iter().enumerate() {
        let c = c as usize;
        let at = grid.ijk(c);
        let v = field.index(
            at[0] - grid.before[0],
            at[1] - grid.before[1],
            at[2] - grid.before[2],
        );
        time.values[v] = history.solid[n] as f32;
        feeding.values[v] = history.critical[n] as f32;
        niyama.values[v] = history.niyama[n] as f32;
        content[v] = grid.cells[c];
        if grid.cells[c] == Cell::Casting {
            freeze_time = freeze_time.max(history.solid[n]);
            casting += 1.0;
            low += f64::from(u8::from(history.niyama[n] < metal.niyama));
        }
    }
    let tolerance = |t: f64| options.persistence * t;
    let found = hot_spots::hot_spots(grid, &history.cells, &history.critical, tolerance);
    let spots = found.spots.into_iter().map(|spot| HotSpot {
        volume: spot.volume * 1e9,
        ..spot
    });
    let hot_spots: Vec<HotSpot> = spots.collect();
    let place = |spot: &HotSpot| {
        let at = grid.ijk(spot.cell as usize);
        field.centre(
            at[0] - grid.before[0],
            at[1] - grid.before[1],
            at[2] - grid.before[2],
        )
    };
    let isolated_volume = hot_spots
        .iter()
        .filter(|s| !s.fed)
        .map(|s| s.volume)
        .sum::<f64>();
    Solidification {
        metal: metal.name.clone(),
        cells: grid.cells.len(),
        cell: field.spacing,
        steps: history.steps,
        freeze_time,
        energy_drift: history.drift,
        places: hot_spots.iter().map(place).collect(),
        shrinkage_volume: metal.shrinkage * isolated_volume,
        isolated_volume,
        hot_spots,
        directional: found.directional,
        low_niyama: if casting > 0.0 { low / casting } else { 0.0 },
        time,
        feeding,
        niyama,
        content,
        ..Solidification::default()
    }
}
