//! Volumes that the union must have, from ray integrals over triangulations: nothing of it goes through the kernel's booleans.

use grassfire_occt::{OcctError, Shape, Triangulation};
use rayon::prelude::*;

use super::non_design::NonDesignBody;
use super::patches;
use super::rays::{Columns, RayGrid, sweep};
use crate::Vec3;
use crate::monitor::Monitor;
use crate::spline::Brep;

/// Cells a patch near a non-design body.
const CELLS: usize = 40;
/// Angle of the facets that stand for a non-design body, radians: their volume is right to 7e-5.
const FACET: f64 = 0.02;

/// Ray integrals about one non-design body. Its region is boss and tools, without the regions of earlier bodies.
pub(crate) struct Probe {
    grid: RayGrid,
    organic: Columns,
    /// (body, boss, tools) of all bodies that the grid sees, this one among them.
    solids: Vec<(usize, Columns, Columns)>,
    body: usize,
    /// Region, mm3.
    pub(crate) region: f64,
    /// Organic material inside the region, mm3.
    pub(crate) organic_volume: f64,
    /// Organic material inside the bosses, mm3.
    pub(crate) overlap: f64,
    /// Material of body and bosses that the tools remove, mm3.
    pub(crate) removed: f64,
    /// What the part must have in the region, mm3.
    pub(crate) part_volume: f64,
}

/// Triangles of a copy: a triangulation left in a shape could change the boxes that booleans use.
fn facets(shape: &Shape, chord: f64, angle: f64) -> Result<Vec<[Vec3; 3]>, OcctError> {
    Ok(corners(
        &shape.translated([0.0; 3])?.tessellate(chord, angle)?,
    ))
}

/// The corners of each triangle.
pub(crate) fn corners(mesh: &Triangulation) -> Vec<[Vec3; 3]> {
    let corner = |v: u32| mesh.points[v as usize].into();
    mesh.triangles.iter().map(|t| t.map(corner)).collect()
}

fn bounds(triangles: &[[Vec3; 3]]) -> (Vec3, Vec3) {
    let start = (Vec3::repeat(f64::MAX), Vec3::repeat(f64::MIN));
    triangles
        .iter()
        .flatten()
        .fold(start, |(lo, hi), p| (lo.inf(p), hi.sup(p)))
}

/// Integrates about every body.
pub(crate) fn probes(
    brep: &Brep,
    bodies: &[NonDesignBody],
    tools: &[Option<Shape>],
    rays: u32,
    monitor: &Monitor,
) -> Result<Vec<Probe>, super::CadError> {
    let patches: Vec<_> = brep.faces.iter().flat_map(patches::face_beziers).collect();
    let boxes: Vec<_> = patches.iter().map(patches::bounds).collect();
    let mut meshes = Vec::with_capacity(bodies.len());
    for (body, tool) in bodies.iter().zip(tools) {
        let size = body.boss.bounds()?;
        let chord = (Vec3::from(size[1]) - Vec3::from(size[0])).norm() * 2e-4;
        let boss = facets(&body.boss, chord, FACET)?;
        let tool = tool
            .as_ref()
            .map_or(Ok(Vec::new()), |t| facets(t, chord, FACET))?;
        meshes.push((boss, tool));
    }
    monitor.step("cad", "independent volumes", 0.1)?;
    (0..bodies.len())
        .into_par_iter()
        .map(|i| {
            monitor.check()?;
            let axis = bodies[i].bores.first().map_or(Vec3::z(), |b| b.direction);
            Ok(probe(i, axis, &meshes, &patches, &boxes, rays))
        })
        .collect()
}

/// Triangles of a boss and of its tools.
type Pair = (Vec<[Vec3; 3]>, Vec<[Vec3; 3]>);

fn probe(
    body: usize,
    axis: Vec3,
    meshes: &[Pair],
    patches: &[patches::Bezier],
    boxes: &[(Vec3, Vec3)],
    rays: u32,
) -> Probe {
    let (boss, tool) = &meshes[body];
    let points: Vec<Vec3> = boss.iter().chain(tool).flatten().copied().collect();
    let grid = RayGrid::around(&points, axis, rays);
    let mut near = Vec::new();
    for (patch, (lo, hi)) in patches.iter().zip(boxes) {
        if grid.sees(*lo, *hi) {
            patches::triangles(patch, CELLS, &mut near);
        }
    }
    let organic = grid.columns(&near);
    let mut solids = Vec::new();
    for (j, (boss, tool)) in meshes.iter().enumerate() {
        let (lo, hi) = bounds(if tool.is_empty() { boss } else { tool });
        let (lo, hi) = (lo.inf(&bounds(boss).0), hi.sup(&bounds(boss).1));
        if j == body || grid.sees(lo, hi) && solids.len() < 60 {
            solids.push((j, grid.columns(boss), grid.columns(tool)));
        }
    }
    let mut probe = Probe {
        grid,
        organic,
        solids,
        body,
        region: 0.0,
        organic_volume: 0.0,
        overlap: 0.0,
        removed: 0.0,
        part_volume: 0.0,
    };
    probe.integrate();
    probe
}

/// Masks over the sets [organic, part, boss 0, tools 0, boss 1, ...].
struct Masks {
    bosses: u128,
    tools: u128,
    own: u128,
    earlier: u128,
}

impl Masks {
    fn in_region(&self, mask: u128) -> bool {
        mask & self.own != 0 && mask & self.earlier == 0
    }

    fn is_part(&self, mask: u128) -> bool {
        mask & (1 | self.bosses) != 0 && mask & self.tools == 0
    }
}

impl Probe {
    fn masks(&self) -> Masks {
        let mut out = Masks {
            bosses: 0,
            tools: 0,
            own: 0,
            earlier: 0,
        };
        for (k, (body, _, _)) in self.solids.iter().enumerate() {
            let (boss, tool) = (1u128 << (2 + 2 * k), 1u128 << (3 + 2 * k));
            out.bosses |= boss;
            out.tools |= tool;
            match body.cmp(&self.body) {
                std::cmp::Ordering::Equal => out.own = boss | tool,
                std::cmp::Ordering::Less => out.earlier |= boss | tool,
                std::cmp::Ordering::Greater => {}
            }
        }
        out
    }

    fn sets<'a>(&'a self, part: &'a Columns) -> Vec<&'a Columns> {
        let pairs = self.solids.iter().flat_map(|(_, boss, tool)| [boss, tool]);
        [&self.organic, part].into_iter().chain(pairs).collect()
    }

    fn integrate(&mut self) {
        let masks = self.masks();
        let none = Columns::empty(&self.grid);
        let mut sums = [0.0; 5];
        sweep(&self.grid, &self.sets(&none), |mask, volume| {
            if !masks.in_region(mask) {
                return;
            }
            let solid = mask & (1 | masks.bosses) != 0;
            let hits = [
                true,
                mask & 1 != 0,
                mask & 1 != 0 && mask & masks.bosses != 0,
                solid && mask & masks.tools != 0,
                masks.is_part(mask),
            ];
            hits.iter()
                .zip(&mut sums)
                .filter(|(hit, _)| **hit)
                .for_each(|(_, sum)| *sum += volume);
        });
        [
            self.region,
            self.organic_volume,
            self.overlap,
            self.removed,
            self.part_volume,
        ] = sums;
    }

    /// Compares a part with what it must be, ray by ray: (volume missing, volume too much), mm3.
    pub(crate) fn compare(&self, part: &[[Vec3; 3]]) -> (f64, f64) {
        let near = part.iter().filter(|t| {
            let (lo, hi) = bounds(std::slice::from_ref(*t));
            self.grid.sees(lo, hi)
        });
        let columns = self.grid.columns(near);
        let masks = self.masks();
        let (mut missing, mut extra) = (0.0, 0.0);
        sweep(&self.grid, &self.sets(&columns), |mask, volume| {
            if masks.in_region(mask) {
                match (masks.is_part(mask), mask & 2 != 0) {
                    (true, false) => missing += volume,
                    (false, true) => extra += volume,
                    _ => {}
                }
            }
        });
        (missing, extra)
    }
}
