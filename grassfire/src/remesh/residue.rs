//! What growing or shrinking a voxel solid changes in its topology.

use std::collections::VecDeque;

use super::RemeshError;
use super::digital::{VoxelSet, delta_chi, is_simple};
use super::noise::CleanUp;
use super::patch::Side;
use crate::monitor::Monitor;
use crate::voxel::VoxelGrid;

/// Steps of the distance used to order voxels, per voxel. Coarse, so that along a tunnel of constant width the peel
/// runs in from both mouths and the membrane ends up in the middle.
const STEPS: f32 = 2.0;

/// Gives `side` the voxels of a membrane when that raises the Euler number of the solid by 1 to `most`, and returns by
/// how much; else 0 and nothing is changed.
pub(super) fn flip_gaining(set: &mut VoxelSet, side: Side, voxels: &[u32], most: i64) -> i64 {
    let solid = side == Side::Solid;
    let gain = flip_all(set, voxels, solid);
    if (1..=most).contains(&gain) {
        return gain;
    }
    flip_all(set, voxels, !solid);
    0
}

/// Makes all `voxels` solid or empty and returns the change of the Euler number.
pub(super) fn flip_all(set: &mut VoxelSet, voxels: &[u32], solid: bool) -> i64 {
    let mut sum = 0;
    for &v in voxels {
        let delta = delta_chi(set.mask(v));
        sum += if solid { delta } else { -delta };
        set.solid[v as usize] = solid;
    }
    sum
}

/// Puts the membranes across the narrowest gaps or members first.
pub(super) fn sort_by_width(grid: &VoxelGrid<f32>, membranes: &mut [Vec<u32>]) {
    let depth = |v: &u32| grid.values[*v as usize].abs();
    membranes.sort_by_cached_key(|voxels| {
        let deepest = voxels.iter().map(depth).fold(0.0, f32::max);
        // Bits of positive floats are ordered as the floats are.
        deepest.to_bits()
    });
}

/// What growing `side` by `radius` (mm) changes in its topology: the voxels left over, as connected pieces, when the
/// grown set is peeled back, farthest first, by simple points only.
pub(super) fn residue(
    work: &CleanUp,
    side: Side,
    radius: f64,
    monitor: &Monitor,
) -> Result<Vec<Vec<u32>>, RemeshError> {
    let (grid, set) = (&*work.grid, &work.set);
    let growing = side == Side::Solid;
    let h = grid.spacing as f32;
    let radius = radius as f32;
    let in_shell = |v: usize| {
        let depth = grid.values[v].abs();
        set.solid[v] != growing
            && depth < radius
            && !work.is_kept(v as u32)
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
