//! Supports and loads on the true surface.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Matrix3;

use super::{Fractions, STAGE, VerifyError};
use crate::Vec3;
use crate::case::{Case, LoadCaseTable, LoadPlace, Places, Support, forces_on};
use crate::fe::components;
use crate::mesh::{Bvh, TriMesh};
use crate::monitor::Monitor;
use crate::remesh::split_long_edges;
use crate::topopt::Problem;

/// Pieces of the surface a voxel edge.
const PIECES: f64 = 3.0;
/// Tolerances of selections are this share of those on voxels: the surface is known better than their corners, and pieces
/// of the faces beside a selected one must not be taken with it.
const SLACK: f64 = 0.1;
/// A selection that meets no surface looks for nodes with the tolerances of voxels so many times those of the design.
const WIDEST: f64 = 2.5;
/// Trilinear weights below this are rounding.
const ROUNDING: f64 = 1e-9;

/// Fixed degrees of freedom and forces of a model.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Conditions {
    /// Node and component.
    pub fixed: Vec<([usize; 3], usize)>,
    /// Nodes that springs hold, N/mm.
    pub springs: Springs,
    /// For every load case the forces on nodes, N.
    pub loads: Vec<Forces>,
}

/// Stiffness of springs at nodes, N/mm.
type Springs = Vec<([usize; 3], Matrix3<f64>)>;

/// Forces on nodes, N.
type Forces = Vec<([usize; 3], [f64; 3])>;

/// Nodes of a grid that touch material.
pub(super) struct ActiveNodes {
    /// In `[z][y][x]` order.
    pub nodes: Vec<[usize; 3]>,
    flags: Vec<bool>,
    counts: [usize; 3],
}

impl ActiveNodes {
    pub fn new(grid: &Fractions) -> Self {
        let counts = grid.dims.map(|n| n + 1);
        let [nx, ny, _] = grid.dims;
        let mut flags = vec![false; counts.iter().product()];
        for (v, _) in grid.values.iter().enumerate().filter(|(_, f)| **f > 0.0) {
            let at = [v % nx, v / nx % ny, v / (nx * ny)];
            for c in 0..8 {
                let [x, y, z] = [0, 1, 2].map(|d| at[d] + (c >> d & 1));
                flags[(z * counts[1] + y) * counts[0] + x] = true;
            }
        }
        let at = |i: usize| {
            [
                i % counts[0],
                i / counts[0] % counts[1],
                i / (counts[0] * counts[1]),
            ]
        };
        Self {
            nodes: (0..flags.len()).filter(|&i| flags[i]).map(at).collect(),
            flags,
            counts,
        }
    }

    pub fn contains(&self, [x, y, z]: [usize; 3]) -> bool {
        self.flags[(z * self.counts[1] + y) * self.counts[0] + x]
    }
}

/// The surface in small pieces: centres, and areas times outward normals.
pub(super) struct Pieces {
    mesh: TriMesh,
    centres: Vec<Vec3>,
    areas: Vec<Vec3>,
}

impl Pieces {
    /// Pieces no longer than a third of `h`.
    pub fn new(mesh: &TriMesh, h: f64) -> Self {
        let mesh = split_long_edges(mesh, h / PIECES);
        let corners = (0..mesh.triangles.len()).map(|t| mesh.corners(t));
        let centres = corners.clone().map(|[a, b, c]| (a + b + c) / 3.0).collect();
        let areas = corners
            .map(|[a, b, c]| (b - a).cross(&(c - a)) / 2.0)
            .collect();
        Self {
            mesh,
            centres,
            areas,
        }
    }

    /// Points on all pieces.
    #[cfg(test)]
    pub fn all(&self) -> Vec<LoadPlace> {
        self.of(&(0..self.centres.len()).collect::<Vec<_>>())
    }

    /// Points on some pieces, weighed by area: three a piece, exact for quadratic functions, as products of the weights of
    /// nodes are in a voxel's face.
    fn of(&self, chosen: &[usize]) -> Vec<LoadPlace> {
        let points = |&i: &usize| {
            let corners = self.mesh.corners(i);
            let area = self.areas[i] / 3.0;
            corners
                .map(|c| LoadPlace::on_surface(self.centres[i] + (c - self.centres[i]) / 2.0, area))
        };
        chosen.iter().flat_map(points).collect()
    }
}

/// Puts the supports and loads of a case on the surface of a part.
///
/// 1. The surface is cut into pieces no longer than a third of a voxel; selections hold pieces.
/// 2. A support holds the nodes within half a voxel of its pieces, on both sides, so that the held region ends at the
///    surface on average; and those inside of its selection. Springs are spread over the pieces as a load is.
/// 3. Material that no support holds is taken out of `grid` with a warning.
/// 4. A load acts on its pieces by area; the force on a point of a piece goes to the corners of its voxel by trilinear weights.
/// 5. Where a selection meets no surface, the nodes take its place with a warning.
///
/// # Errors
/// [`VerifyError::NotOnPart`], [`VerifyError::LooseLoad`] and those of selections.
pub(super) fn on_surface(
    case: &Case,
    folder: &Path,
    mesh: &TriMesh,
    grid: &mut Fractions,
    monitor: &Monitor,
) -> Result<Conditions, VerifyError> {
    let pieces = Pieces::new(mesh, grid.h);
    let corners = pieces.mesh.points.clone();
    let site = Site {
        case,
        folder,
        pieces: &pieces,
        corners: &Places::new(case, folder, corners, SLACK * grid.h, monitor)?,
        monitor,
    };
    let mut active = ActiveNodes::new(grid);
    let mut fixed = site.supports(grid, &active)?;
    let mut springs = site.springs(grid, &active)?;
    let held = fixed.iter().map(|(node, _)| *node);
    let held: Vec<[usize; 3]> = held.chain(springs.iter().map(|(node, _)| *node)).collect();
    if drop_loose(grid, &held, monitor) {
        active = ActiveNodes::new(grid);
        fixed.retain(|(node, _)| active.contains(*node));
        springs.retain(|(node, _)| active.contains(*node));
    }
    let loads = case
        .case
        .iter()
        .map(|table| site.loads(table, grid, &active));
    Ok(Conditions {
        loads: loads.collect::<Result<_, _>>()?,
        fixed,
        springs,
    })
}

/// What supports and loads are put on.
struct Site<'a> {
    case: &'a Case,
    folder: &'a Path,
    pieces: &'a Pieces,
    /// Selections on the corners of the pieces.
    corners: &'a Places<'a>,
    monitor: &'a Monitor,
}

impl Site<'_> {
    /// The pieces whose corners are all selected: those of a face beside a selected plane have one that is not.
    fn chosen(&self, name: &str) -> Result<Vec<usize>, VerifyError> {
        let corners = self.corners.select(name, self.monitor)?;
        let mut held = vec![false; self.pieces.mesh.points.len()];
        corners.into_iter().for_each(|c| held[c] = true);
        let triangles = self.pieces.mesh.triangles.iter().enumerate();
        let whole = triangles.filter(|(_, t)| t.iter().all(|&c| held[c as usize]));
        Ok(whole.map(|(i, _)| i).collect())
    }

    /// Fixed nodes and components, ascending.
    fn supports(
        &self,
        grid: &Fractions,
        active: &ActiveNodes,
    ) -> Result<Vec<([usize; 3], usize)>, VerifyError> {
        let places = node_places(grid, active);
        let within = Places::new(self.case, self.folder, places.clone(), 0.0, self.monitor)?;
        let mut fixed = Vec::new();
        let fixing = |s: &&Support| !s.fixed().is_empty();
        for support in self.case.support.iter().filter(fixing) {
            let mut held = within.select(&support.on, self.monitor)?;
            let chosen = self.chosen(&support.on)?;
            held.extend(near(self.pieces, &chosen, &places, grid.h / 2.0));
            if held.is_empty() {
                held = self.nodes_instead(&support.on, "support", &places, grid.h)?;
            }
            for axis in support.fixed() {
                fixed.extend(held.iter().map(|&i| (active.nodes[i], axis)));
            }
        }
        fixed.sort_unstable();
        fixed.dedup();
        Ok(fixed)
    }

    /// Nodes that springs hold, ascending in `[z][y][x]`.
    fn springs(&self, grid: &Fractions, active: &ActiveNodes) -> Result<Springs, VerifyError> {
        let mut sums: BTreeMap<[usize; 3], Matrix3<f64>> = BTreeMap::new();
        for support in &self.case.support {
            if support.stiffness(1.0).is_none() {
                continue;
            }
            let places = self.places(&support.on, "support", grid, active)?;
            let total: f64 = places.iter().map(|p| p.weight).sum();
            // Weights are areas on a surface, counts at nodes.
            let voxels = if places.iter().any(|p| p.area != Vec3::zeros()) {
                total / grid.h.powi(2)
            } else {
                total
            };
            let beneath = voxels * self.case.material.young * grid.h;
            let stiffness = support.stiffness(beneath).unwrap_or_default() / total;
            for place in places {
                for ([x, y, z], weight) in weights(grid, active, &place.place) {
                    *sums.entry([z, y, x]).or_default() += weight * place.weight * stiffness;
                }
            }
        }
        let nodes = sums.into_iter();
        Ok(nodes.map(|([z, y, x], k)| ([x, y, z], k)).collect())
    }

    /// What a load or springs on a selection act on: points of its pieces, nodes where it meets none.
    fn places(
        &self,
        name: &str,
        what: &'static str,
        grid: &Fractions,
        active: &ActiveNodes,
    ) -> Result<Vec<LoadPlace>, VerifyError> {
        let places = self.pieces.of(&self.chosen(name)?);
        if !places.is_empty() {
            return Ok(places);
        }
        let nodes = node_places(grid, active);
        let found = self.nodes_instead(name, what, &nodes, grid.h)?;
        let at_node = |&i: &usize| LoadPlace {
            place: nodes[i],
            weight: 1.0,
            area: Vec3::zeros(),
        };
        Ok(found.iter().map(at_node).collect())
    }

    /// Forces of one load case on nodes.
    fn loads(
        &self,
        table: &LoadCaseTable,
        grid: &Fractions,
        active: &ActiveNodes,
    ) -> Result<Forces, VerifyError> {
        let mut sums: BTreeMap<[usize; 3], Vec3> = BTreeMap::new();
        for load in &table.loads {
            let mut places = self.places(&load.on, "load", grid, active)?;
            let first = places[0].place;
            places.retain(|p| !weights(grid, active, &p.place).is_empty());
            if places.is_empty() {
                return Err(VerifyError::LooseLoad {
                    name: table.name.clone(),
                    place: first.into(),
                });
            }
            let forces = forces_on(&places, load)?;
            spread(grid, active, &places, &forces, &mut sums);
        }
        let forces = sums.into_iter();
        Ok(forces.map(|([z, y, x], f)| ([x, y, z], f.into())).collect())
    }

    /// The nodes that a selection holds with the tolerances of the design's voxels, or larger ones: for selections that meet no
    /// surface, such as an edge of the design space that the finished part has rounded. The tolerance is that of all grids.
    fn nodes_instead(
        &self,
        name: &str,
        what: &'static str,
        nodes: &[Vec3],
        h: f64,
    ) -> Result<Vec<usize>, VerifyError> {
        let designed = self.case.grid.h.max(h);
        for slack in [designed, WIDEST * designed] {
            let places = Places::new(self.case, self.folder, nodes.to_vec(), slack, self.monitor)?;
            let found = places.select(name, self.monitor)?;
            if !found.is_empty() {
                let text = format!(
                    "the {what} on {name:?} meets no surface: it acts on {} nodes, found with the tolerance of voxels of {slack:.2} mm",
                    found.len()
                );
                self.monitor.warn(STAGE, text);
                return Ok(found);
            }
        }
        Err(VerifyError::NotOnPart {
            what,
            name: name.to_owned(),
        })
    }
}

fn node_places(grid: &Fractions, active: &ActiveNodes) -> Vec<Vec3> {
    active.nodes.iter().map(|n| grid.node_place(*n)).collect()
}

/// Which places lie within `reach` of the chosen pieces.
fn near(pieces: &Pieces, chosen: &[usize], places: &[Vec3], reach: f64) -> Vec<usize> {
    let part = TriMesh {
        points: pieces.mesh.points.clone(),
        triangles: chosen.iter().map(|&i| pieces.mesh.triangles[i]).collect(),
        tags: Vec::new(),
    };
    let tree = Bvh::new(&part);
    let Some((low, high)) = tree.bounds() else {
        return Vec::new();
    };
    // Nodes at exactly half a voxel on both sides of a plane would both be held by rounding.
    let reach = reach * (1.0 + 1e-9);
    let around = |p: &Vec3| (0..3).all(|d| (low[d] - reach..=high[d] + reach).contains(&p[d]));
    (0..places.len())
        .filter(|&i| around(&places[i]) && tree.nearest(&places[i], reach).is_some())
        .collect()
}

/// The corners of the voxel around a point that touch material, with trilinear weights that sum to 1; empty when there are
/// none.
pub(super) fn weights(grid: &Fractions, active: &ActiveNodes, p: &Vec3) -> Vec<([usize; 3], f64)> {
    let cell = grid.cell_of(p);
    let r = (p - grid.origin) / grid.h;
    let mut out = Vec::with_capacity(8);
    for corner in 0..8 {
        let mut weight = 1.0;
        let node = [0, 1, 2].map(|d| cell[d] + (corner >> d & 1));
        for d in 0..3 {
            let t = (r[d] - cell[d] as f64).clamp(0.0, 1.0);
            weight *= if corner >> d & 1 == 1 { t } else { 1.0 - t };
        }
        if weight > ROUNDING && active.contains(node) {
            out.push((node, weight));
        }
    }
    let sum: f64 = out.iter().map(|(_, w)| w).sum();
    out.iter_mut().for_each(|(_, w)| *w /= sum);
    out
}

/// Adds the forces on places to those on nodes (keys: z, y, x).
pub(super) fn spread(
    grid: &Fractions,
    active: &ActiveNodes,
    places: &[LoadPlace],
    forces: &[Vec3],
    sums: &mut BTreeMap<[usize; 3], Vec3>,
) {
    for (p, force) in places.iter().zip(forces) {
        for ([x, y, z], weight) in weights(grid, active, &p.place) {
            *sums.entry([z, y, x]).or_default() += weight * force;
        }
    }
}

/// Voxels around a node.
pub(super) fn around(problem: &Problem, node: [usize; 3]) -> impl Iterator<Item = usize> + '_ {
    (0..8).filter_map(move |c| {
        let below = |d: usize| {
            let i = node[d].checked_sub(c >> d & 1)?;
            (i < problem.dims[d]).then_some(i)
        };
        Some(problem.index([below(0)?, below(1)?, below(2)?]))
    })
}

/// Empties pieces without any held node; tells whether there were any.
fn drop_loose(grid: &mut Fractions, held_nodes: &[[usize; 3]], monitor: &Monitor) -> bool {
    let solid: Vec<bool> = grid.values.iter().map(|&f| f > 0.0).collect();
    let (labels, pieces) = components(grid.dims, &solid);
    let problem = grid.problem();
    let mut held = vec![false; pieces.len()];
    for v in held_nodes.iter().flat_map(|node| around(&problem, *node)) {
        if let Some(held) = held.get_mut(labels[v] as usize) {
            *held = true;
        }
    }
    let mut volume = 0.0;
    for (value, &label) in grid.values.iter_mut().zip(&labels) {
        if held.get(label as usize) == Some(&false) {
            volume += *value * grid.h.powi(3);
            *value = 0.0;
        }
    }
    let loose = held.iter().filter(|h| !**h).count();
    // Smaller ones are corners of the surface that only touch an edge of a voxel.
    if volume > grid.h.powi(3) {
        let text = format!(
            "{loose} pieces of {volume:.3} mm3 together hang on no support and are left out"
        );
        monitor.warn(STAGE, text);
    }
    loose > 0
}
