//! Voxel remesh: soup in, closed solid and signed distance field out, topological noise removed.

mod bridges;
mod closing;
mod compose;
mod crossings;
mod deviation;
mod digital;
mod error;
mod extract;
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

pub use error::RemeshError;
pub use options::{Capsule, RemeshOptions};
pub use resolution::default_voxel;
pub use wrap::{WrapOptions, wrap};

use serde::Serialize;

use crate::Vec3;
use crate::mesh::{Solid, TriMesh};
use crate::monitor::Monitor;
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
    let mut padded = padded(density, iso, options, monitor)?;
    let mut set = VoxelSet::positive(padded.dims, &padded.values);
    compose::separate_opposite_empties(&mut padded, &mut set);
    let mesh = usable(&extract::surface(&padded, &set, false).mesh)?;
    remesh_on(&mesh, Some(density.spacing), options, monitor)
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

fn padded(
    density: &VoxelGrid<f32>,
    iso: f64,
    options: &RemeshOptions,
    monitor: &Monitor,
) -> Result<VoxelGrid<f32>, RemeshError> {
    let (dims, spacing) = (density.dims, density.spacing);
    let wanted = dims.iter().map(|&n| n as f64 + 4.0).product::<f64>();
    let fits = dims.iter().try_fold(1usize, |n, &d| n.checked_mul(d)) == Some(density.values.len());
    if !fits || dims.iter().any(|&n| n < 2) || !(spacing.is_finite() && spacing > 0.0) {
        return Err(RemeshError::BadGrid {
            dims,
            values: density.values.len(),
            spacing,
        });
    }
    if wanted > options.max_voxels as f64 {
        let finest = spacing * (wanted / options.max_voxels.max(1) as f64).cbrt();
        return Err(RemeshError::TooManyVoxels {
            voxel: spacing,
            wanted,
            limit: options.max_voxels,
            finest,
        });
    }
    let finite = density.values.iter().filter(|v| v.is_finite());
    let highest = finite
        .clone()
        .fold(f64::NEG_INFINITY, |m, &v| m.max(f64::from(v)));
    if iso.is_nan() || highest <= iso {
        return Err(RemeshError::NoMaterial { highest, iso });
    }
    let broken = density.values.len() - finite.count();
    if broken > 0 {
        monitor.warn(
            STAGE,
            format!("{broken} density values are not finite and count as empty"),
        );
    }
    // A full voxel at the border ends at its outer face: half-way to an outside as far below the threshold as full is above.
    let outside = (-(1.0 - iso).abs().max(1e-3) * spacing) as f32;
    let origin = density.origin - Vec3::repeat(2.0 * spacing);
    let mut out = VoxelGrid::filled(origin, spacing, dims.map(|n| n + 4), outside);
    for (v, &value) in density.values.iter().enumerate() {
        let [i, j, k] = density.ijk(v);
        let at = out.index(i + 2, j + 2, k + 2);
        if value.is_finite() {
            out.values[at] = ((f64::from(value).clamp(-1.0, 2.0) - iso) * spacing) as f32;
        }
    }
    Ok(out)
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
    let forced = compose::separate_opposite_empties(&mut field, &mut set);
    if forced > 0 {
        monitor.warn(STAGE, format!("{forced} places pinched to a point were closed or opened at random: voxel {voxel} mm is coarse for this part"));
    }
    monitor.step(STAGE, "surface", 0.85)?;
    let surface = extract::surface(&field, &set, true);
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
    })
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
mod tests {
    use super::*;

    /// A cube about the origin.
    pub(super) fn cube(side: f64) -> TriMesh {
        let points = (0..8)
            .map(|c| {
                Vec3::new(f64::from(c & 1), f64::from(c >> 1 & 1), f64::from(c >> 2))
                    .add_scalar(-0.5)
                    * side
            })
            .collect();
        let quads = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        let triangles = quads
            .iter()
            .flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]])
            .collect();
        TriMesh {
            points,
            triangles,
            tags: vec![],
        }
    }

    fn remesh_at(mesh: &TriMesh, voxel: f64) -> Result<Remeshed, RemeshError> {
        remesh(
            mesh,
            &RemeshOptions {
                voxel: Some(voxel),
                ..RemeshOptions::default()
            },
            &Monitor::default(),
        )
    }

    #[test]
    fn a_cube_keeps_volume_and_place() {
        let out = remesh_at(&cube(10.0), 0.37).expect("a cube");
        assert!(
            (out.solid.volume() - 1000.0).abs() < 10.0,
            "{}",
            out.solid.volume()
        );
        assert!(out.distance_max < 0.37, "{}", out.distance_max);
        assert_eq!(
            (out.genus_before, out.genus_after, out.changes.len()),
            (0, 0, 0)
        );
    }

    #[test]
    fn what_is_no_solid_is_refused() {
        let mut inverted = cube(10.0);
        inverted.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        let error = remesh_at(&inverted, 0.5).expect_err("inside out");
        assert!(error.hint().is_some_and(|h| h.contains("flip")), "{error}");
        let mut sheet = cube(10.0);
        sheet.triangles.truncate(2);
        assert!(matches!(
            remesh_at(&sheet, 0.5),
            Err(RemeshError::NotSolid { .. })
        ));
        assert_eq!(
            remesh_at(&TriMesh::default(), 0.5).err(),
            Some(RemeshError::Empty)
        );
        assert!(matches!(
            remesh_at(&cube(10.0), 1e-9),
            Err(RemeshError::TooManyVoxels { .. })
        ));
        assert!(matches!(
            remesh_at(&cube(10.0), f64::NAN),
            Err(RemeshError::BadOption { .. })
        ));
        let monitor = Monitor::default();
        monitor.cancel();
        assert!(matches!(
            remesh(&cube(1.0), &RemeshOptions::default(), &monitor),
            Err(RemeshError::Cancelled(_))
        ));
    }

    /// A plate 20 x 20 x 3 with square holes, as density on a unit grid.
    fn plate(holes: &[(usize, usize, usize)]) -> VoxelGrid<f32> {
        let mut grid = VoxelGrid::filled(Vec3::zeros(), 1.0, [24, 24, 7], 0f32);
        for k in 2..5 {
            for j in 2..22 {
                for i in 2..22 {
                    let open = holes
                        .iter()
                        .any(|&(x, y, n)| (x..x + n).contains(&i) && (y..y + n).contains(&j));
                    let v = grid.index(i, j, k);
                    grid.values[v] = if open { 0.0 } else { 1.0 };
                }
            }
        }
        grid
    }

    #[test]
    fn pinholes_close_and_windows_stay() {
        let density = plate(&[(5, 5, 1), (12, 5, 2), (6, 12, 6)]);
        let out = remesh_density(
            &density,
            0.5,
            &RemeshOptions::default(),
            &Monitor::default(),
        )
        .expect("a plate");
        assert_eq!((out.genus_before, out.genus_after), (3, 1));
        assert_eq!(out.changes.len(), 2);
        assert!(
            out.changes
                .iter()
                .all(|c| c.kind == ChangeKind::TunnelClosed && c.size < 3.0)
        );
        let first = &out.changes[0];
        assert!(
            (first.place - Vec3::new(12.5, 5.5, 3.0)).norm() < 0.7,
            "{first:?}"
        );
        // The plug is as thick as the plate: no dent deeper than half a voxel of the source.
        let depth = out.field.sample(&Vec3::new(12.5, 5.5, 3.0));
        assert!(depth > 0.6, "{depth}");
        let off = RemeshOptions {
            min_tunnel: 0.0,
            ..RemeshOptions::default()
        };
        let out = remesh_density(&density, 0.5, &off, &Monitor::default()).expect("a plate");
        assert_eq!((out.genus_after, out.changes.len()), (3, 0));
    }

    #[test]
    fn a_kept_bore_stays() {
        let density = plate(&[(5, 5, 2), (14, 14, 2)]);
        let bore = Capsule {
            a: Vec3::new(5.5, 5.5, 0.0),
            b: Vec3::new(5.5, 5.5, 6.0),
            radius: 2.0,
        };
        let options = RemeshOptions {
            keep_open: vec![bore],
            ..RemeshOptions::default()
        };
        let out = remesh_density(&density, 0.5, &options, &Monitor::default()).expect("a plate");
        assert_eq!((out.genus_before, out.genus_after), (2, 1));
    }

    #[test]
    fn islands_cavities_and_short_bridges_go_and_struts_stay() {
        // Two blocks joined by a thick bar; beside it a thin short bridge.
        let mut grid = VoxelGrid::filled(Vec3::zeros(), 1.0, [30, 30, 16], 0f32);
        let mut fill = |x: std::ops::Range<usize>,
                        y: std::ops::Range<usize>,
                        z: std::ops::Range<usize>,
                        value: f32| {
            for k in z {
                for j in y.clone() {
                    for i in x.clone() {
                        let v = grid.index(i, j, k);
                        grid.values[v] = value;
                    }
                }
            }
        };
        fill(2..13, 2..28, 2..14, 1.0);
        fill(17..28, 2..28, 2..14, 1.0);
        fill(13..17, 2..10, 2..14, 1.0);
        fill(13..17, 24..25, 7..8, 1.0);
        fill(6..8, 15..17, 6..8, 0.0);
        fill(14..16, 27..29, 14..15, 1.0);
        let out = remesh_density(&grid, 0.5, &RemeshOptions::default(), &Monitor::default())
            .expect("blocks");
        let mut kinds: Vec<String> = out
            .changes
            .iter()
            .map(|c| format!("{:?}", c.kind))
            .collect();
        kinds.sort();
        assert_eq!(
            (out.genus_before, out.genus_after),
            (1, 1),
            "{kinds:?}: a bridge longer than the limit stays"
        );
        assert_eq!(kinds, ["CavityFilled", "IslandDropped"]);
    }

    #[test]
    fn densities_that_cannot_work_are_refused() {
        let run = |grid: &VoxelGrid<f32>| {
            remesh_density(grid, 0.5, &RemeshOptions::default(), &Monitor::default())
        };
        let mut grid = VoxelGrid::filled(Vec3::zeros(), 1.0, [8; 3], 0f32);
        assert!(matches!(run(&grid), Err(RemeshError::NoMaterial { .. })));
        grid.values.fill(f32::NAN);
        assert!(matches!(run(&grid), Err(RemeshError::NoMaterial { .. })));
        grid.values.pop();
        assert!(matches!(run(&grid), Err(RemeshError::BadGrid { .. })));
        // A checkerboard is nothing but islands.
        let mut grid = VoxelGrid::filled(Vec3::zeros(), 1.0, [12; 3], 0f32);
        for v in 0..grid.values.len() {
            grid.values[v] = (grid.ijk(v).iter().sum::<usize>() % 2) as f32;
        }
        assert!(matches!(run(&grid), Err(RemeshError::Vanished { .. })));
    }

    #[test]
    fn threads_do_not_change_a_bit() {
        let density = plate(&[(5, 5, 1), (6, 12, 6)]);
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .expect("a pool");
            pool.install(|| {
                remesh_density(
                    &density,
                    0.5,
                    &RemeshOptions::default(),
                    &Monitor::default(),
                )
            })
            .expect("a plate")
        };
        let (one, two) = (run(1), run(2));
        assert_eq!(one.field, two.field);
        assert_eq!(one.solid, two.solid);
        assert_eq!(one.changes, two.changes);
        assert_eq!(one.distance_max, two.distance_max);
    }
}
