//! The design part: the proposal without its non-design bodies, members running on into their walls.

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::ball::Ball;
use super::bosses::Bosses;
use super::digital::VoxelSet;
use super::{RemeshError, Remeshed, STAGE, closed_surface, noise};
use crate::Vec3;
use crate::fit::volume;
use crate::mesh::{Bvh, Winding};
use crate::monitor::Monitor;
use crate::topology::Betti;
use crate::voxel::VoxelGrid;

/// Options of [`cut_out`], all lengths in voxels of the remesh or, where they are larger, of the grid that the proposal came from and
/// those that it has by default: a finer voxel gives the same design part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CutOutOptions {
    /// Skin around a body that goes with it: the proposal's copy of its walls is never exact.
    pub skin: f64,
    /// Half of the least thickness that stays next to a body: thinner shells and burrs go.
    pub least_half_thickness: f64,
    /// The same for material within `wedge_reach` of what is thick enough: so wedges that run out beside a body keep their tips. None
    /// cuts them off where they are too thin. Voxels tell thicknesses to about one of them.
    pub wedge: Option<f64>,
    /// How far such tips reach.
    pub wedge_reach: f64,
    /// Members run on this far into a body.
    pub run_on: f64,
    /// There they stay this far below faces of the body that lie open, so that the union cuts cleanly.
    pub clearance: f64,
    /// Gaps between material and a body that no ball of this radius fits into are filled.
    pub slot: f64,
    /// Separate pieces of less than a cube of this edge are crumbs of the bodies' walls and go.
    pub island: f64,
    /// Tunnels and bridges of the design part narrower than this come from the cutting and go.
    pub noise: f64,
}

impl Default for CutOutOptions {
    fn default() -> Self {
        Self {
            skin: 0.5,
            least_half_thickness: 0.6,
            wedge: None,
            wedge_reach: 6.0,
            run_on: 1.5,
            clearance: 1.0,
            slot: 1.25,
            island: 4.0,
            noise: 2.0,
        }
    }
}

/// The proposal without its non-design bodies.
#[derive(Debug, Clone)]
pub struct DesignPart {
    /// What is left, as a closed surface, field and list of changes; distances and genus before are those of the proposal.
    pub part: Remeshed,
    /// Topology of design part and bodies together, bores open.
    pub united: Betti,
    /// Topology of proposal and bodies together, bores open: what the union must have.
    pub wanted: Betti,
    /// What proposal and bodies together have more than design part and bodies together, mm3: slices beside the bodies that were
    /// too thin to stay.
    pub lost: f64,
}

/// The options in mm, and how far around the bodies distances are needed.
struct Lengths {
    skin: f64,
    least_half_thickness: f64,
    wedge: Option<f64>,
    wedge_reach: f64,
    run_on: f64,
    clearance: f64,
    slot: f64,
    island: f64,
    noise: f64,
    reach: f64,
}

impl Lengths {
    fn new(options: &CutOutOptions, proposal: &Remeshed) -> Self {
        let voxel = proposal.field.spacing;
        let unit = proposal.grain;
        let skin = options.skin * unit;
        let least_half_thickness = options.least_half_thickness * unit;
        Self {
            skin,
            least_half_thickness,
            wedge: options.wedge.map(|wedge| wedge * unit),
            wedge_reach: options.wedge_reach * unit,
            run_on: options.run_on * unit,
            clearance: options.clearance * voxel,
            slot: options.slot * voxel,
            island: options.island * unit,
            noise: options.noise * unit,
            reach: skin + 2.0 * least_half_thickness + 4.0 * voxel,
        }
    }
}

/// Balls larger than this, voxels, take minutes.
const MOST: f64 = 20.0;

fn check(options: &CutOutOptions) -> Result<(), RemeshError> {
    let lengths = [
        ("skin", options.skin),
        ("least_half_thickness", options.least_half_thickness),
        ("wedge", options.wedge.unwrap_or(0.0)),
        ("wedge_reach", options.wedge_reach),
        ("run_on", options.run_on),
        ("clearance", options.clearance),
        ("slot", options.slot),
        ("island", options.island),
        ("noise", options.noise),
    ];
    let bad = |(_, value): &&(_, f64)| !(0.0..=MOST).contains(value);
    match lengths.iter().find(bad) {
        Some(&(name, value)) => Err(RemeshError::BadCutOut {
            name,
            value,
            most: MOST,
        }),
        None => Ok(()),
    }
}

/// Balls about voxel centres do not quite cover what they should: so much is forgiven, voxels.
const FORGIVEN: f64 = 0.4;
/// Empty voxels around everything.
const MARGIN: usize = 3;

/// Cuts non-design bodies out of a remeshed proposal; `None` without bodies or when nothing is left.
///
/// 1. The bodies with a skin, and the free lengths of their bores, are taken away from the solid.
/// 2. What is thinner than twice `least_half_thickness` next to them goes too: shells left of their walls, burrs; with `wedge` not the
///    tips of wedges.
/// 3. Where material meets a body it runs on `run_on` deep into its wall, but stays `clearance` below the proposal's own
///    surface, so that it ends inside and the union's edges are transversal.
/// 4. Topological noise that the cutting made is removed; the surface is extracted anew.
///
/// The Euler numbers of `united` and `wanted` tell whether the union still has the proposal's topology. Deterministic for
/// every number of threads.
///
/// # Errors
/// [`RemeshError::BadCutOut`], [`RemeshError::Surface`], [`RemeshError::Topology`], cancelled.
pub fn cut_out(
    proposal: &Remeshed,
    bosses: &Bosses,
    options: &CutOutOptions,
    monitor: &Monitor,
) -> Result<Option<DesignPart>, RemeshError> {
    check(options)?;
    let Some((lo, hi)) = bosses.surface.bounds() else {
        return Ok(None);
    };
    monitor.step(STAGE, "cutting out non-design bodies", 0.0)?;
    let whole = padded(&proposal.field, &lo, &hi);
    let lengths = Lengths::new(options, proposal);
    let near = Near::new(&whole, bosses, &lengths);
    let cut = near.cut(&whole, &lengths);
    let opened = near.opened(&cut, &lengths);
    let mut joined = near.joined(&whole, &opened, &lengths);
    near.refresh(&mut joined, None, monitor)?;
    let mut closed = near.closed(&whole, &joined, &lengths);
    drop_crumbs(&mut closed, lengths.island);
    let left = near.refresh(&mut closed, None, monitor)?;
    if !left.solid.contains(&true) {
        return Ok(None);
    }
    let together = |field: &VoxelGrid<f32>| {
        let united = near.together(field, lengths.skin);
        VoxelSet::positive(united.dims, &united.values).betti()
    };
    let filled = |field: &VoxelGrid<f32>| volume(&near.together(field, 0.0));
    let wanted = together(&whole);
    let wanted_volume = filled(&whole);
    let mut best = None;
    // Cleaning may close a tunnel that is needed: then less of it.
    for share in [1.0, 0.5, 0.25, 0.0] {
        let noise = share * lengths.noise;
        let part = solid_of(closed.clone(), &near, noise, proposal, monitor)?;
        let Some(part) = part else { continue };
        let united = together(&part.field);
        let found = united == wanted;
        if found || best.is_none() {
            best = Some(DesignPart {
                lost: wanted_volume - filled(&part.field),
                part,
                united,
                wanted,
            });
        }
        if found {
            break;
        }
    }
    Ok(best)
}

/// Voxels near the bodies with their depth in them.
struct Near {
    /// Index of each voxel, ascending.
    voxels: Vec<u32>,
    /// Depth in the bodies, mm, negative outside.
    solid: Vec<f64>,
    /// Depth in the free lengths of their bores.
    free: Vec<f64>,
}

impl Near {
    fn new(grid: &VoxelGrid<f32>, bosses: &Bosses, lengths: &Lengths) -> Self {
        let reach = lengths.reach;
        let boxes = bosses.boxes();
        let bvh = Bvh::new(&bosses.surface);
        let winding = Winding::new(&bvh);
        let depth_at = |v: usize| {
            let [i, j, k] = grid.ijk(v);
            let p = grid.centre(i, j, k);
            let close = |(lo, hi): &(Vec3, Vec3)| {
                (0..3).all(|a| lo[a] - reach <= p[a] && p[a] <= hi[a] + reach)
            };
            if !boxes.iter().any(close) {
                return None;
            }
            let distance = bvh.nearest(&p, reach).map_or(reach, |n| n.distance);
            let inside = winding.at(&p) > 0.5;
            let free = bosses.free.iter().map(|bore| bore.depth_in_cylinder(&p));
            let free = free.fold(-reach, f64::max);
            let solid = if inside { distance } else { -distance };
            (solid.max(free) > -reach).then_some((v as u32, solid, free))
        };
        let found: Vec<(u32, f64, f64)> = (0..grid.values.len())
            .into_par_iter()
            .filter_map(depth_at)
            .collect();
        Self {
            voxels: found.iter().map(|f| f.0).collect(),
            solid: found.iter().map(|f| f.1).collect(),
            free: found.iter().map(|f| f.2).collect(),
        }
    }

    /// Depth in a body or in the free length of a bore.
    fn depth(&self, n: usize) -> f64 {
        self.solid[n].max(self.free[n])
    }

    /// The field with the values of the near voxels replaced.
    fn replaced(
        &self,
        field: &VoxelGrid<f32>,
        value: impl Fn(usize, usize) -> f64 + Sync,
    ) -> VoxelGrid<f32> {
        let new: Vec<f32> = (0..self.voxels.len())
            .into_par_iter()
            .map(|n| value(n, self.voxels[n] as usize) as f32)
            .collect();
        let mut out = field.clone();
        for (&v, value) in self.voxels.iter().zip(new) {
            out.values[v as usize] = value;
        }
        out
    }

    fn cut(&self, whole: &VoxelGrid<f32>, lengths: &Lengths) -> VoxelGrid<f32> {
        self.replaced(whole, |n, v| {
            f64::from(whole.values[v]).min(-self.depth(n) - lengths.skin)
        })
    }

    /// What is left of the thin material beside the bodies.
    fn opened(&self, cut: &VoxelGrid<f32>, lengths: &Lengths) -> VoxelGrid<f32> {
        let thick = self.opened_by(cut, lengths.least_half_thickness, lengths);
        let Some(wedge) = lengths.wedge else {
            return thick;
        };
        let thin = self.opened_by(cut, wedge, lengths);
        let reach = lengths.wedge_reach;
        let ball = Ball::new(cut, reach / cut.spacing + 1.5);
        self.replaced(&thick, |_, v| {
            let value = f64::from(thick.values[v]);
            let room = f64::from(thin.values[v]);
            if room <= value {
                return value;
            }
            value.max(room.min(ball.covered(&thick, 1.0, v, 0.0) + reach))
        })
    }

    /// Opening by balls of at least `radius` mm, within the near voxels.
    fn opened_by(&self, cut: &VoxelGrid<f32>, radius: f64, lengths: &Lengths) -> VoxelGrid<f32> {
        let h = cut.spacing;
        let ball = Ball::new(cut, radius / h + 2.0);
        // Farther out nothing was cut, and not all the neighbours that the balls need are known.
        let last = lengths.skin + 2.0 * lengths.least_half_thickness;
        self.replaced(cut, |n, v| {
            let value = f64::from(cut.values[v]);
            if value <= 0.0 || value >= radius || self.depth(n) < -last {
                return value;
            }
            value.min(ball.covered(cut, 1.0, v, radius) + FORGIVEN * h)
        })
    }

    /// Lets the material run on into the bodies that it meets.
    fn joined(
        &self,
        whole: &VoxelGrid<f32>,
        opened: &VoxelGrid<f32>,
        lengths: &Lengths,
    ) -> VoxelGrid<f32> {
        let h = opened.spacing;
        let reach = lengths.skin + lengths.run_on;
        let ball = Ball::new(opened, reach / h + 1.5);
        self.replaced(opened, |n, v| {
            let value = f64::from(opened.values[v]);
            if self.depth(n) < -lengths.skin - h || value > reach {
                return value;
            }
            let below = f64::from(whole.values[v]) - lengths.clearance;
            let room = below.min(-self.free[n]);
            if room <= value {
                return value;
            }
            let run_on = ball.covered(opened, 1.0, v, 0.0) + reach;
            value.max(run_on.min(room))
        })
    }

    /// Fills gaps in and at the bodies that no ball of the slot's radius fits into.
    fn closed(
        &self,
        whole: &VoxelGrid<f32>,
        joined: &VoxelGrid<f32>,
        lengths: &Lengths,
    ) -> VoxelGrid<f32> {
        let h = joined.spacing;
        let ball = Ball::new(joined, lengths.slot / h + 2.0);
        self.replaced(joined, |n, v| {
            let value = f64::from(joined.values[v]);
            if value >= 0.0 || -value >= lengths.slot || self.depth(n) < -lengths.skin - h {
                return value;
            }
            let empty = ball.covered(joined, -1.0, v, lengths.slot) + FORGIVEN * h;
            let room = f64::from(whole.values[v]).min(-self.free[n]);
            value.max((-empty).min(room))
        })
    }

    /// Distances of the near voxels, and of those that are touched besides, from the surface near them.
    fn refresh(
        &self,
        field: &mut VoxelGrid<f32>,
        besides: Option<&[bool]>,
        monitor: &Monitor,
    ) -> Result<VoxelSet, RemeshError> {
        let mut touched = besides.map_or_else(|| vec![false; field.values.len()], <[bool]>::to_vec);
        for &v in &self.voxels {
            touched[v as usize] = true;
        }
        let set = VoxelSet::positive(field.dims, &field.values);
        if set.solid.contains(&true) {
            noise::refresh(field, &set, &touched, monitor)?;
        }
        Ok(set)
    }

    /// A field and the bodies with a skin together, without the free lengths of the bores.
    fn together(&self, field: &VoxelGrid<f32>, skin: f64) -> VoxelGrid<f32> {
        self.replaced(field, |n, v| {
            let body = self.solid[n] + skin;
            f64::from(field.values[v]).max(body).min(-self.free[n])
        })
    }
}

/// The field with room for the bodies and a margin around them.
fn padded(field: &VoxelGrid<f32>, lo: &Vec3, hi: &Vec3) -> VoxelGrid<f32> {
    let (lo, hi) = (field.to_grid(lo), field.to_grid(hi));
    let margin = MARGIN as f64;
    let before: Vec<usize> = (0..3)
        .map(|a| (margin - lo[a]).ceil().max(0.0) as usize)
        .collect();
    let after: Vec<usize> = (0..3)
        .map(|a| {
            (hi[a] + margin - (field.dims[a] as f64 - 1.0))
                .ceil()
                .max(0.0) as usize
        })
        .collect();
    if before.iter().chain(&after).all(|n| *n == 0) {
        return field.clone();
    }
    let dims = [0, 1, 2].map(|a| field.dims[a] + before[a] + after[a]);
    let by = Vec3::new(before[0] as f64, before[1] as f64, before[2] as f64);
    let outside = field.values.iter().copied().fold(0.0, f32::min);
    let origin = field.origin - by * field.spacing;
    let mut out = VoxelGrid::filled(origin, field.spacing, dims, outside);
    for k in 0..field.dims[2] {
        for j in 0..field.dims[1] {
            let from = field.index(0, j, k);
            let to = out.index(before[0], j + before[1], k + before[2]);
            out.values[to..to + field.dims[0]]
                .copy_from_slice(&field.values[from..from + field.dims[0]]);
        }
    }
    out
}

/// Takes away the crumbs: all but the largest of the pieces that are smaller than a cube of edge `edge` mm.
fn drop_crumbs(field: &mut VoxelGrid<f32>, edge: f64) {
    let most = (edge / field.spacing).powi(3).min(1e7) as usize;
    let set = VoxelSet::positive(field.dims, &field.values);
    let pieces = set.components(true, most);
    let largest = pieces.iter().map(|p| p.size).max().unwrap_or(0);
    for piece in pieces.iter().filter(|p| p.size < largest) {
        for &v in &piece.voxels {
            field.values[v as usize] = -0.5 * field.spacing as f32;
        }
    }
}

/// Cleans the field and extracts its surface; `None` when nothing is left.
fn solid_of(
    mut field: VoxelGrid<f32>,
    near: &Near,
    noise: f64,
    proposal: &Remeshed,
    monitor: &Monitor,
) -> Result<Option<Remeshed>, RemeshError> {
    let cleaned = noise::remove_noise(&mut field, noise, None, &[], monitor)?;
    let mut set = near.refresh(&mut field, Some(&cleaned.touched), monitor)?;
    if !set.solid.contains(&true) {
        return Ok(None);
    }
    let (solid, after) = closed_surface(&mut field, &mut set, monitor)?;
    Ok(Some(Remeshed {
        solid,
        field,
        genus_before: proposal.genus_after,
        genus_after: after.b1,
        changes: cleaned.changes,
        distance_max: proposal.distance_max,
        source: proposal.source,
        grain: proposal.grain,
        default_voxel: proposal.default_voxel,
    }))
}

#[cfg(test)]
#[path = "cut_out_tests.rs"]
mod tests;
