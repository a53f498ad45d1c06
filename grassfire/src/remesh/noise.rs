//! Topological noise: small islands, cavities, tunnels and bridges, found, named and removed.

use std::collections::{HashSet, VecDeque};

use super::digital::{VoxelSet, delta_chi, is_simple};
use super::input::Wanted;
use super::options::Capsule;
use super::patch::{Patch, Side, insert};
use super::{ChangeKind, RemeshError, STAGE, TopologyChange, signed_distance};
use crate::Vec3;
use crate::monitor::Monitor;
use crate::topology::Betti;
use crate::voxel::VoxelGrid;

/// Clean-up rounds at most; closing one tunnel can make a cavity small enough to be filled in the next round.
const ROUNDS: usize = 4;
/// Steps of the distance used to order voxels, per voxel. Coarse, so that along a tunnel of constant width the peel
/// runs in from both mouths and the membrane ends up in the middle.
const STEPS: f32 = 2.0;
/// Cavities up to this many voxels are looked at when a plug closes one off.
const CAVITY: usize = 1 << 20;

/// What the clean-up did.
pub(super) struct Outcome {
    pub(super) before: Betti,
    pub(super) changes: Vec<TopologyChange>,
    /// Voxels near a change, whose distance is no longer exact.
    pub(super) touched: Vec<bool>,
}

/// Removes islands, cavities, tunnels and short bridges narrower than `width` (mm) from the solid `{field > 0}`.
///
/// 1. Islands (6-components) and cavities (26-components of the empty side) whose box is no longer than `width` go.
/// 2. Tunnels: the solid grown by `width / 2` is peeled back to the solid, farthest voxels first and only by simple
///    points, so what is left over carries exactly the topology that growing has changed: a membrane across the
///    narrowest place of every closed tunnel, an arc across every gap. Membranes that lower the first Betti number and
///    enclose nothing are inserted as plates as thick as the wall around them; nothing else is.
/// 3. Bridges: the same on the empty side. A cut is made only through what is thinner than `width / 2`, joins two places
///    at least twice as thick that lie no more than `width` apart, and whose loss leaves the solid in one piece:
///    members, waists and webs are never cut.
/// 4. Repeat until nothing changes.
///
/// With `wanted`, only surplus tunnels and cavities are removed, narrowest first.
/// Voxels inside the capsules of `keep_open` are never filled or cut.
pub(super) fn remove_noise(
    grid: &mut VoxelGrid<f32>,
    width: f64,
    wanted: Option<Wanted>,
    keep_open: &[Capsule],
    monitor: &Monitor,
) -> Result<Outcome, RemeshError> {
    let mut set = VoxelSet::positive(grid.dims, &grid.values);
    let mut out = Outcome {
        before: set.betti(),
        changes: Vec::new(),
        touched: vec![false; grid.values.len()],
    };
    if width <= 0.0 {
        return Ok(out);
    }
    let kept = kept_voxels(grid, keep_open);
    for round in 0..ROUNDS {
        monitor.step(STAGE, "topological noise", 0.6 + 0.05 * round as f64)?;
        let count = out.changes.len();
        drop_small(grid, &mut set, width, wanted, &kept, &mut out);
        if out.changes.len() > count {
            // Else the ghosts of the islands would be taken for gaps.
            refresh(grid, &set, &out.touched, monitor)?;
        }
        let surplus = |set: &VoxelSet| match wanted {
            Some(wanted) => set.betti().b1 - wanted.tunnels,
            None => i64::MAX,
        };
        let most = surplus(&set);
        close_tunnels(grid, &mut set, width, most, &kept, &mut out, monitor)?;
        let most = surplus(&set);
        cut_bridges(grid, &mut set, width, most, &kept, &mut out, monitor)?;
        if out.changes.len() == count {
            break;
        }
    }
    Ok(out)
}

/// Distances around changes: values next to the surface and the untouched band are kept, the rest is swept anew.
pub(super) fn refresh(
    field: &mut VoxelGrid<f32>,
    set: &VoxelSet,
    touched: &[bool],
    monitor: &Monitor,
) -> Result<(), RemeshError> {
    let band = ((signed_distance::BAND - 0.5) * field.spacing) as f32;
    let steps = set.neighbours_26();
    let at_surface = |v: usize| {
        !set.on_border(v as u32)
            && steps
                .iter()
                .any(|s| set.solid[(v as isize + s) as usize] != set.solid[v])
    };
    let known: Vec<bool> = (0..touched.len())
        .map(|v| {
            if touched[v] {
                at_surface(v)
            } else {
                field.values[v].abs() <= band
            }
        })
        .collect();
    signed_distance::sweep(field, &known, monitor)
}

/// One flag a voxel: inside a capsule; empty when there are none.
fn kept_voxels(grid: &VoxelGrid<f32>, capsules: &[Capsule]) -> Vec<bool> {
    if capsules.is_empty() {
        return Vec::new();
    }
    let mut kept = vec![false; grid.values.len()];
    for capsule in capsules {
        let reach = Vec3::repeat(capsule.radius);
        let lo = grid.to_grid(&(capsule.a.inf(&capsule.b) - reach));
        let hi = grid.to_grid(&(capsule.a.sup(&capsule.b) + reach));
        let range = |a: usize| {
            let last = grid.dims[a] as f64;
            lo[a].floor().clamp(0.0, last) as usize..(hi[a].ceil() + 1.0).clamp(0.0, last) as usize
        };
        for k in range(2) {
            for j in range(1) {
                for i in range(0) {
                    if capsule.contains(&grid.centre(i, j, k)) {
                        kept[grid.index(i, j, k)] = true;
                    }
                }
            }
        }
    }
    kept
}

fn is_kept(kept: &[bool], v: u32) -> bool {
    kept.get(v as usize).copied().unwrap_or(false)
}

fn drop_small(
    grid: &mut VoxelGrid<f32>,
    set: &mut VoxelSet,
    width: f64,
    wanted: Option<Wanted>,
    kept: &[bool],
    out: &mut Outcome,
) {
    let h = grid.spacing;
    let limit = (width / h).max(1.0);
    for (solid, kind) in [
        (true, ChangeKind::IslandDropped),
        (false, ChangeKind::CavityFilled),
    ] {
        let mut all = set.components(solid, (limit.powi(3)).min(1e7) as usize + 1);
        let mut most = usize::MAX;
        if let Some(wanted) = wanted.filter(|_| !solid) {
            most = (all.len() - 1).saturating_sub(wanted.cavities.max(0) as usize);
            all.sort_by_key(|c| c.size);
        }
        for component in all {
            let small = component.extent() as f64 <= limit && !component.voxels.is_empty();
            // The first empty component is the outside; it holds the border voxels.
            let outside = component.voxels.iter().any(|&v| set.on_border(v));
            let held = component.voxels.iter().any(|&v| is_kept(kept, v));
            if !small || outside || held || most == 0 {
                continue;
            }
            most -= 1;
            let mut sum = Vec3::zeros();
            for &v in &component.voxels {
                let [i, j, k] = set.ijk(v);
                sum += grid.centre(i, j, k);
                set.solid[v as usize] = !solid;
                grid.values[v as usize] = if solid {
                    -0.5 * h as f32
                } else {
                    0.5 * h as f32
                };
                touch(grid, v, 4, &mut out.touched);
            }
            let place = sum / component.voxels.len() as f64;
            out.changes.push(TopologyChange {
                kind,
                place,
                size: component.extent() as f64 * h,
            });
        }
    }
}

/// Marks the voxels around `v`.
fn touch(grid: &VoxelGrid<f32>, v: u32, reach: usize, touched: &mut [bool]) {
    let at = grid.ijk(v as usize);
    let range = |a: usize| at[a].saturating_sub(reach)..(at[a] + reach + 1).min(grid.dims[a]);
    for k in range(2) {
        for j in range(1) {
            let row = grid.index(0, j, k);
            touched[row + range(0).start..row + range(0).end].fill(true);
        }
    }
}

fn close_tunnels(
    grid: &mut VoxelGrid<f32>,
    set: &mut VoxelSet,
    width: f64,
    mut most: i64,
    kept: &[bool],
    out: &mut Outcome,
    monitor: &Monitor,
) -> Result<(), RemeshError> {
    if most <= 0 {
        return Ok(());
    }
    let mut plugs = Vec::new();
    let six = set.neighbours_6();
    let mut found = residue(grid, set, Side::Solid, width / 2.0, kept, monitor)?;
    if most < i64::MAX {
        found.sort_by(|a, b| thickness(grid, a).total_cmp(&thickness(grid, b)));
    }
    for voxels in found {
        // A piece on its own raises the Euler number too, but closes nothing.
        if !voxels
            .iter()
            .any(|&v| six.iter().any(|s| set.solid[(v as isize + s) as usize]))
        {
            continue;
        }
        let gain = flip_all(set, &voxels, true);
        if (1..=most).contains(&gain) {
            most -= gain;
            plugs.push(Patch::new(grid, voxels));
        } else {
            flip_all(set, &voxels, false);
        }
    }
    open_new_cavities(set, &mut plugs);
    for plug in &plugs {
        out.changes.push(TopologyChange {
            kind: ChangeKind::TunnelClosed,
            place: plug.place,
            size: plug.width,
        });
    }
    insert(
        grid,
        set,
        Side::Solid,
        &mut plugs,
        width,
        kept,
        &mut out.touched,
    );
    Ok(())
}

/// A plug on a bottle's neck lowers no Betti number but makes a cavity: takes the widest plug off every cavity that
/// plugs close.
fn open_new_cavities(set: &mut VoxelSet, plugs: &mut Vec<Patch>) {
    let steps = set.neighbours_26();
    for _ in 0..8 {
        if plugs.is_empty() {
            return;
        }
        let mut off = Vec::new();
        for mut cavity in set.components(false, CAVITY).into_iter().skip(1) {
            cavity.voxels.sort_unstable();
            let within = |v: u32, s: &isize| {
                cavity
                    .voxels
                    .binary_search(&((v as isize + s) as u32))
                    .is_ok()
            };
            let touches = |plug: &Patch| {
                plug.voxels
                    .iter()
                    .any(|&v| steps.iter().any(|s| within(v, s)))
            };
            let widest = (0..plugs.len())
                .filter(|&p| touches(&plugs[p]))
                .max_by(|&a, &b| plugs[a].width.total_cmp(&plugs[b].width).then(b.cmp(&a)));
            off.extend(widest);
        }
        off.sort_unstable();
        off.dedup();
        if off.is_empty() {
            return;
        }
        for p in off.into_iter().rev() {
            let plug = plugs.remove(p);
            flip_all(set, &plug.voxels, false);
        }
    }
}

fn cut_bridges(
    grid: &mut VoxelGrid<f32>,
    set: &mut VoxelSet,
    width: f64,
    mut most: i64,
    kept: &[bool],
    out: &mut Outcome,
    monitor: &Monitor,
) -> Result<(), RemeshError> {
    if most <= 0 {
        return Ok(());
    }
    let mut cuts = Vec::new();
    let mut found = residue(grid, set, Side::Empty, width / 2.0, kept, monitor)?;
    if most < i64::MAX {
        found.sort_by(|a, b| thickness(grid, a).total_cmp(&thickness(grid, b)));
    }
    for voxels in found {
        let Some(length) = bridge_length(grid, set, &voxels, width) else {
            continue;
        };
        let pieces = set.components(true, 0).len();
        let gain = flip_all(set, &voxels, false);
        let fits = length <= width && (1..=most).contains(&gain);
        if fits && set.components(true, 0).len() == pieces {
            most -= gain;
            cuts.push(Patch {
                reach: (length / 2.0).max(grid.spacing),
                ..Patch::new(grid, voxels)
            });
        } else {
            flip_all(set, &voxels, true);
        }
    }
    for cut in &cuts {
        out.changes.push(TopologyChange {
            kind: ChangeKind::BridgeCut,
            place: cut.place,
            size: cut.width,
        });
    }
    insert(
        grid,
        set,
        Side::Empty,
        &mut cuts,
        width,
        kept,
        &mut out.touched,
    );
    Ok(())
}

/// Width of the gap or member that a membrane spans, mm.
fn thickness(grid: &VoxelGrid<f32>, voxels: &[u32]) -> f32 {
    let depth = |v: &u32| grid.values[*v as usize].abs();
    2.0 * voxels.iter().map(depth).fold(0.0, f32::max)
}

/// Makes all `voxels` solid or empty and returns the change of the Euler number.
fn flip_all(set: &mut VoxelSet, voxels: &[u32], solid: bool) -> i64 {
    let mut sum = 0;
    for &v in voxels {
        let delta = delta_chi(set.mask(v));
        sum += if solid { delta } else { -delta };
        set.solid[v as usize] = solid;
    }
    sum
}

/// What growing `side` by `radius` (mm) changes in its topology: the voxels left over, as connected pieces, when the
/// grown set is peeled back, farthest first, by simple points only.
fn residue(
    grid: &VoxelGrid<f32>,
    set: &VoxelSet,
    side: Side,
    radius: f64,
    kept: &[bool],
    monitor: &Monitor,
) -> Result<Vec<Vec<u32>>, RemeshError> {
    let growing = side == Side::Solid;
    let h = grid.spacing as f32;
    let radius = radius as f32;
    let in_shell = |v: usize| {
        let depth = grid.values[v].abs();
        set.solid[v] != growing
            && depth < radius
            && !is_kept(kept, v as u32)
            && !set.on_border(v as u32)
    };
    // `shell`: voxels of the grown set that are not peeled yet and not in the set itself.
    let mut shell: Vec<bool> = (0..set.solid.len()).map(in_shell).collect();
    let mut grown = set.clone();
    for (v, _) in shell.iter().enumerate().filter(|(_, s)| **s) {
        grown.solid[v] = growing;
    }
    let steps = set.neighbours_26();
    let bucket = |v: u32| (grid.values[v as usize].abs() / h * STEPS) as usize;
    let mut queue = Queue::new((radius / h * STEPS) as usize + 1, set.solid.len());
    for v in 0..shell.len() as u32 {
        if shell[v as usize]
            && steps
                .iter()
                .any(|s| grown.solid[(v as isize + s) as usize] != growing)
        {
            queue.push(v, bucket(v));
        }
    }
    let mut count = 0u32;
    while let Some(v) = queue.pop() {
        count = count.wrapping_add(1);
        if count.is_multiple_of(1 << 16) {
            monitor.check()?;
        }
        if !shell[v as usize] || !is_simple(grown.mask(v)) {
            continue;
        }
        shell[v as usize] = false;
        grown.solid[v as usize] = !growing;
        for s in &steps {
            let n = (v as isize + s) as u32;
            if shell[n as usize] {
                queue.push(n, bucket(n));
            }
        }
    }
    Ok(pieces(set, &mut shell, growing))
}

/// Connected pieces of the flagged voxels, which are cleared; solid pieces by faces, empty ones by corners.
fn pieces(set: &VoxelSet, flags: &mut [bool], solid: bool) -> Vec<Vec<u32>> {
    let (six, all) = (set.neighbours_6(), set.neighbours_26());
    let steps: &[isize] = if solid { &six } else { &all };
    let mut out = Vec::new();
    for start in 0..flags.len() {
        if !flags[start] {
            continue;
        }
        flags[start] = false;
        let mut piece = vec![start as u32];
        let mut at = 0;
        while at < piece.len() {
            let v = piece[at];
            at += 1;
            for s in steps {
                let n = (v as isize + s) as usize;
                if flags[n] {
                    flags[n] = false;
                    piece.push(n as u32);
                }
            }
        }
        piece.sort_unstable();
        out.push(piece);
    }
    out
}

/// First in, first out within a bucket; the highest bucket first. Each voxel is in it at most once.
struct Queue {
    buckets: Vec<VecDeque<u32>>,
    queued: Vec<bool>,
    top: usize,
}

impl Queue {
    fn new(buckets: usize, voxels: usize) -> Self {
        Self {
            buckets: vec![VecDeque::new(); buckets + 1],
            queued: vec![false; voxels],
            top: 0,
        }
    }

    fn push(&mut self, v: u32, bucket: usize) {
        if !std::mem::replace(&mut self.queued[v as usize], true) {
            let bucket = bucket.min(self.buckets.len() - 1);
            self.buckets[bucket].push_back(v);
            self.top = self.top.max(bucket);
        }
    }

    fn pop(&mut self) -> Option<u32> {
        loop {
            if let Some(v) = self.buckets[self.top].pop_front() {
                self.queued[v as usize] = false;
                return Some(v);
            }
            self.top = self.top.checked_sub(1)?;
        }
    }
}

/// Length (mm) of the thin part that the cut `voxels` goes through, between the two places at least twice as thick as
/// the cut is; `None` when there are no such places nearby or the cut is thicker than `width / 2` or longer across than
/// `width`: then it is a waist, a web or a member, not noise.
fn bridge_length(grid: &VoxelGrid<f32>, set: &VoxelSet, voxels: &[u32], width: f64) -> Option<f64> {
    let cut = Patch::new(grid, voxels.to_vec());
    let at = |v: u32| {
        let [i, j, k] = set.ijk(v);
        grid.centre(i, j, k)
    };
    if cut.width > width / 2.0
        || voxels
            .iter()
            .any(|&v| (at(v) - cut.place).norm() > width / 2.0)
    {
        return None;
    }
    let six = set.neighbours_6();
    let mut seen: HashSet<u32> = voxels.iter().copied().collect();
    let mut lengths = Vec::new();
    for &seed in voxels {
        for s in &six {
            let start = (seed as isize + s) as u32;
            if !set.solid[start as usize] || !seen.insert(start) {
                continue;
            }
            // One side of the cut, within reach.
            let mut side = vec![start];
            let mut next = 0;
            let mut nearest = f64::INFINITY;
            while let Some(&v) = side.get(next) {
                next += 1;
                let depth = f64::from(grid.values[v as usize]);
                if depth >= cut.width {
                    nearest = nearest.min(((at(v) - cut.place).norm() - depth).max(0.0));
                }
                for s in &six {
                    let n = (v as isize + s) as u32;
                    if set.solid[n as usize]
                        && (at(n) - cut.place).norm() <= 2.0 * width
                        && seen.insert(n)
                    {
                        side.push(n);
                    }
                }
            }
            lengths.push(nearest);
        }
    }
    lengths.sort_by(f64::total_cmp);
    (lengths.len() >= 2 && lengths[1].is_finite()).then(|| lengths[0] + lengths[1])
}
