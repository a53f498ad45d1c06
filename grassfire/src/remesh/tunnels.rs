//! Narrow tunnels: found, named, closed.

use super::digital::VoxelSet;
use super::noise::CleanUp;
use super::patch::{Patch, Side};
use super::residue::{flip_all, flip_gaining, residue, sort_by_width};
use super::{ChangeKind, RemeshError};
use crate::monitor::Monitor;

/// Widths looked at between 0 and the limit at most, and their least distance in voxels.
const LEVELS: f64 = 16.0;
const LEVEL: f64 = 1.0;
/// Cavities up to this many voxels are looked at when a plug closes one off.
const CAVITY: usize = 1 << 20;

/// Closes tunnels narrower than the limit, at most `most`.
///
/// 1. The solid grown by half a width is peeled back to the solid, farthest voxels first and only by simple points, so
///    what is left over carries exactly the topology that growing has changed: a membrane across the narrowest place of
///    every tunnel that closed, an arc across every gap. The solid gets the membranes that lower its first Betti number.
/// 2. That is done for growing widths up to the limit, so that tunnels close in the order of their widths. All at once a
///    pinhole beside a slit leaves one piece that closes a tunnel and opens another, and neither would be seen.
/// 3. Membranes that close off a cavity are taken away again; the others become plates.
pub(super) fn close_tunnels(
    work: &mut CleanUp,
    mut most: i64,
    monitor: &Monitor,
) -> Result<(), RemeshError> {
    let step = (LEVEL * work.grid.spacing).max(work.width / LEVELS);
    let levels = (work.width / step).ceil().max(1.0) as usize;
    let six = work.set.neighbours_6();
    let mut plugs = Vec::new();
    for level in 1..=levels {
        if most <= 0 {
            break;
        }
        let width = (level as f64 * step).min(work.width);
        let mut found = residue(work, Side::Solid, width / 2.0, monitor)?;
        sort_by_width(work.grid, &mut found);
        for voxels in found {
            let set = &mut work.set;
            let touches = |v: &u32| six.iter().any(|s| set.solid[(*v as isize + s) as usize]);
            // A piece on its own raises the Euler number too, but closes nothing.
            if !voxels.iter().any(touches) {
                continue;
            }
            let gain = flip_gaining(set, Side::Solid, &voxels, most);
            if gain > 0 {
                most -= gain;
                plugs.push(Patch::new(work.grid, voxels));
            }
        }
    }
    open_new_cavities(&mut work.set, &mut plugs);
    work.commit(ChangeKind::TunnelClosed, Side::Solid, &mut plugs);
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
