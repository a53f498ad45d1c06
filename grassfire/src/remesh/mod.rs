//! Voxel remesh: soup in, closed solid and signed distance field out, topological noise removed.

mod ball;
mod bosses;
mod bridges;
mod cases;
mod closing;
mod compose;
mod crossings;
mod cut_out;
mod density;
mod deviation;
mod digital;
mod drawn;
mod error;
mod extract;
pub(crate) mod films;
mod input;
mod intersect;
mod islands;
mod noise;
mod options;
mod patch;
mod residue;
mod resolution;
mod sample;
mod signed_distance;
mod smooth;
mod tunnels;
mod vanished;
mod wrap;

pub use bosses::Bosses;
pub use cut_out::{CutOutOptions, DesignPart, cut_out};
pub use drawn::{Draw, drawn_surface};
pub use error::RemeshError;
pub use options::{Capsule, RemeshOptions};
pub use resolution::{default_voxel, skeleton_voxel};
pub(crate) use sample::split_long_edges;
pub use wrap::{WrapOptions, wrap};

use serde::Serialize;

use crate::Vec3;
use crate::mesh::{Solid, TriMesh};
use crate::monitor::Monitor;
use crate::topology::Betti;
use crate::voxel::VoxelGrid;
use digital::VoxelSet;

const STAGE: &str = "remesh";

/// What kind of topological noise was removed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ChangeKind {
    /// A tunnel narrower than the limit was closed.
    TunnelClosed,
    /// An enclosed void smaller than the limit was filled.
    CavityFilled,
    /// A bridge thinner than the limit was cut.
    BridgeCut,
    /// A separate piece smaller than the limit was dropped.
    IslandDropped,
}

/// One named change of topology.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TopologyChange {
    /// What was done.
    pub kind: ChangeKind,
    /// Centre of the change, mm.
    pub place: Vec3,
    /// Width of the tunnel, void, bridge or piece, mm.
    pub size: f64,
}

/// A closed solid with its signed distance field.
#[derive(Debug, Clone)]
pub struct Remeshed {
    /// The cleaned proposal as a closed surface (surface nets / dual contouring of `field`), mm.
    pub solid: Solid,
    /// Signed distance, mm, positive inside, lightly smoothed, narrow band exact and clamped beyond. The voxel set
    /// `{field > 0}` under 6-connectivity (empty: 26) has the topology of `solid`; at least 3 empty voxels of margin.
    pub field: VoxelGrid<f32>,
    /// Genus (sum over shells) of the input where that is a closed manifold, else of the voxel solid before the clean-up.
    pub genus_before: i64,
    /// Genus after it.
    pub genus_after: i64,
    /// Every change, largest first.
    pub changes: Vec<TopologyChange>,
    /// Largest distance from the input surface (away from `changes`) to the new one, mm.
    pub distance_max: f64,
    /// Spacing of the grid that the input came from, mm, where that can be seen.
    pub source: Option<f64>,
    /// Smallest detail that means something, mm: the largest of the voxel, `source` and, where a voxel was asked for, the default one.
    pub grain: f64,
    /// Voxel that is used when none is asked for, mm.
    pub default_voxel: f64,
}

/// Remeshes a triangle soup with good orientation (repaired, but holes, duplicates, overlaps and cracks are allowed).
///
/// 1. Voxel edge: `options.voxel` or [`default_voxel`].
/// 2. Signed distance: exact near the surface, sign by the generalized winding number (> 1/2 is inside), propagated
///    beyond; a light Gaussian filter that keeps the volume.
/// 3. Topological noise narrower than `options.min_tunnel` is removed by named changes; nothing else changes topology.
///    A closed manifold that was not made on a lattice means what it shows: there only what sampling added is removed,
///    narrowest first, and the voxel is made finer where tunnels get lost.
/// 4. Dual contouring gives a closed manifold surface with exactly the topology of the voxel set.
///
/// Several bodies are kept. Sharp edges come out rounded by about a third of a voxel, walls thinner than two voxels are
/// at risk. Memory is about 20 bytes a voxel and is bounded by `options.max_voxels` before anything is allocated.
///
/// # Errors
/// See [`RemeshError`]: nothing enclosed, too many voxels, bad options, cancelled.
pub fn remesh(
    mesh: &TriMesh,
    options: &RemeshOptions,
    monitor: &Monitor,
) -> Result<Remeshed, RemeshError> {
    check(options)?;
    let mesh = usable(mesh)?;
    let source = resolution::source_lattice(&mesh);
    remesh_on(&mesh, source, options, monitor)
}

/// Remeshes the part of a density grid above `iso`.
///
/// 1. The surface `density = iso` is contoured on the density's own grid, with the outside of the grid empty, so that
///    full border voxels end at their outer faces. Values that are not finite count as empty and give a warning.
/// 2. The rest is as in [`remesh`], with the density's spacing as the source grid.
///
/// # Errors
/// As [`remesh`], and when the grid is inconsistent or has no material above `iso`.
pub fn remesh_density(
    density: &VoxelGrid<f32>,
    iso: f64,
    options: &RemeshOptions,
    monitor: &Monitor,
) -> Result<Remeshed, RemeshError> {
    check(options)?;
    let mesh = iso_surface(density, iso, options, monitor)?;
    remesh_on(&mesh, Some(density.spacing), options, monitor)
}

/// The closed surface `density = iso` of a density grid, as it is: no clean-up, no smoothing.
///
/// The outside of the grid is empty, so that full border voxels end at their outer faces; the surface is a manifold.
///
/// # Errors
/// As [`remesh_density`].
pub fn iso_surface(
    density: &VoxelGrid<f32>,
    iso: f64,
    options: &RemeshOptions,
    monitor: &Monitor,
) -> Result<TriMesh, RemeshError> {
    let mut padded = density::padded(density, iso, options, monitor)?;
    let mut set = VoxelSet::positive(padded.dims, &padded.values);
    compose::separate_opposite_empties(&mut padded, &mut set);
    usable(&extract::surface(&padded, &set, false).mesh)
}

fn check(options: &RemeshOptions) -> Result<(), RemeshError> {
    let bad = |name, value, wanted| {
        Err(RemeshError::BadOption {
            name,
            value,
            wanted,
        })
    };
    match options.voxel {
        Some(voxel) if !(voxel.is_finite() && voxel > 0.0) => {
            return bad("voxel", voxel, "a positive length");
        }
        _ => {}
    }
    if !(0.0..=1e3).contains(&options.min_tunnel) {
        return bad("min_tunnel", options.min_tunnel, "0 to 1000");
    }
    if !(0.0..=5.0).contains(&options.smoothing) {
        return bad("smoothing", options.smoothing, "0 to 5");
    }
    Ok(())
}

/// The triangles with valid indices and finite corners.
fn usable(mesh: &TriMesh) -> Result<TriMesh, RemeshError> {
    let sound = |v: &u32| {
        mesh.points
            .get(*v as usize)
            .is_some_and(|p| p.iter().all(|x| x.abs() < 1e30))
    };
    let triangles: Vec<[u32; 3]> = mesh
        .triangles
        .iter()
        .filter(|t| t.iter().all(sound))
        .copied()
        .collect();
    let points = mesh
        .points
        .iter()
        .map(|p| {
            if p.iter().all(|x| x.abs() < 1e30) {
                *p
            } else {
                Vec3::zeros()
            }
        })
        .collect();
    let mesh = TriMesh {
        points,
        triangles,
        tags: Vec::new(),
    };
    if mesh.triangles.is_empty() || mesh.area() <= 0.0 {
        Err(RemeshError::Empty)
    } else {
        Ok(mesh)
    }
}

fn remesh_on(
    mesh: &TriMesh,
    source: Option<f64>,
    options: &RemeshOptions,
    monitor: &Monitor,
) -> Result<Remeshed, RemeshError> {
    monitor.step(STAGE, "resolution", 0.0)?;
    let shells = input::shells(mesh);
    // A mesh made on a lattice has the noise of that lattice; any other one means what it shows.
    let trusted = shells.as_deref().filter(|_| source.is_none());
    let sample::Sampled {
        mut field,
        bvh,
        wanted,
    } = sample::sampled(mesh, trusted, options, monitor)?;
    let voxel = field.spacing;
    let natural = options
        .voxel
        .map_or(voxel, |_| default_voxel(mesh, options));
    let grain = voxel.max(source.unwrap_or(0.0)).max(natural);
    let width = options.min_tunnel * source.unwrap_or(voxel);
    let input_genus = shells.as_deref().map(input::genus);
    let (vanished, narrow) = vanished(mesh, &field, input_genus, monitor);
    let mut noise = noise::remove_noise(&mut field, width, wanted, &options.keep_open, monitor)?;
    let mut set = VoxelSet::positive(field.dims, &field.values);
    if !set.solid.contains(&true) {
        return Err(RemeshError::Vanished { voxel, width });
    }
    if !noise.changes.is_empty() {
        noise::refresh(&mut field, &set, &noise.touched, monitor)?;
    }
    monitor.step(STAGE, "surface", 0.85)?;
    let (solid, after) = closed_surface(&mut field, &mut set, monitor)?;
    monitor.step(STAGE, "distance", 0.95)?;
    let (islands, lost) =
        islands::lost_islands(mesh, &field, width.max(2.0 * voxel), &noise.changes);
    noise.changes.extend(islands);
    // What is left of a half-buried tunnel has been closed, and named, by the clean-up.
    let again = |c: &TopologyChange, d: &TopologyChange| {
        d.kind == c.kind && (d.place - c.place).norm() < 2.0 * voxel
    };
    let mut vanished = vanished;
    vanished.retain(|c| !noise.changes.iter().any(|d| again(c, d)));
    noise.changes.extend(vanished);
    let skip = |v: usize, t: u32| {
        noise.touched[v] || lost[t as usize] || narrow.get(t as usize) == Some(&true)
    };
    let distance_max = deviation::deviation(mesh, &bvh, &solid, &field, skip, options.samples);
    noise.changes.sort_by(|a, b| b.size.total_cmp(&a.size));
    Ok(Remeshed {
        solid,
        field,
        genus_before: input_genus.unwrap_or(noise.before.b1),
        genus_after: after.b1,
        changes: noise.changes,
        distance_max,
        source,
        grain,
        default_voxel: natural,
    })
}

/// The surface of a clean field, whose voxels are `set`, with the topology of both; warns of places that a finer voxel
/// would show better.
fn closed_surface(
    field: &mut VoxelGrid<f32>,
    set: &mut VoxelSet,
    monitor: &Monitor,
) -> Result<(Solid, Betti), RemeshError> {
    let voxel = field.spacing;
    let forced = compose::separate_opposite_empties(field, set);
    if forced > 0 {
        monitor.warn(STAGE, format!("{forced} places pinched to a point were closed or opened at random: voxel {voxel} mm is coarse for this part"));
    }
    let surface = extract::surface(field, set, true);
    if surface.intersecting > 0 {
        monitor.warn(
            STAGE,
            format!(
                "{} vertices of the new surface belong to intersecting triangles (0 wanted)",
                surface.intersecting
            ),
        );
    }
    let solid = Solid::try_from(surface.mesh)?;
    let after = set.betti();
    if solid.euler() != 2 * after.chi {
        return Err(RemeshError::Topology {
            surface: solid.euler(),
            voxels: after.chi,
        });
    }
    Ok((solid, after))
}

/// Tunnels of the input (of genus `input`) that `field` does not have, and a flag for each of their triangles; warns of
/// them, and says how many could not be placed.
fn vanished(
    mesh: &TriMesh,
    field: &VoxelGrid<f32>,
    input: Option<i64>,
    monitor: &Monitor,
) -> (Vec<TopologyChange>, Vec<bool>) {
    let have = VoxelSet::positive(field.dims, &field.values).betti().b1;
    let lost = input.unwrap_or(have) - have;
    if lost <= 0 {
        return Default::default();
    }
    let (changes, flags) = vanished::vanished_tunnels(mesh, field);
    let unnamed = lost - changes.len() as i64;
    let mut text = format!(
        "{lost} of {} tunnels of the input are too narrow for the voxel of {:.3} mm and vanished in sampling",
        input.unwrap_or(have),
        field.spacing
    );
    if unnamed > 0 {
        text += &format!("; {unnamed} of them could not be placed");
    }
    monitor.warn(STAGE, text);
    (changes, flags)
}

#[cfg(test)]
mod tests;
