//! Hot spots: places that freeze last and are cut off from every feeder.

use super::grid::{Cell, Grid};

/// A last-freezing place.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct HotSpot {
    /// Cell that freezes last.
    pub cell: u32,
    /// When feeding through it ends, s.
    pub time: f64,
    /// How much later than the last way out of it, s.
    pub persistence: f64,
    /// Metal that is still open when the last way out closes, m3.
    pub volume: f64,
    /// It belongs to a feeder.
    pub fed: bool,
}

/// All hot spots and the share of the casting that feeders reach.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct HotSpots {
    pub spots: Vec<HotSpot>,
    pub directional: f64,
}

/// A connected set of cells that are still open at some time.
#[derive(Debug, Clone, Copy)]
struct Pool {
    peak: u32,
    time: f64,
    volume: f64,
    feeder: bool,
    /// Time and volume when it last took in another hot spot.
    last: Option<(f64, f64)>,
}

/// A pool without a saddle is measured when this share of its time has passed.
const WITHOUT_SADDLE: f64 = 0.95;

struct Pools {
    parent: Vec<u32>,
    pools: Vec<Pool>,
}

impl Pools {
    fn root(&mut self, mut v: u32) -> u32 {
        while self.parent[v as usize] != v {
            let up = self.parent[v as usize];
            self.parent[v as usize] = self.parent[up as usize];
            v = self.parent[v as usize];
        }
        v
    }
}

/// The merge tree of the times at which feeding ends.
///
/// 1. Cells open from the latest time to the earliest; connected open cells (six neighbours) are one pool.
/// 2. When two pools meet, the one whose last cell is earlier ends there: unless it holds a feeder it is a hot spot that was
///    cut off from the other at this time, with the volume that it had (a pool with a feeder never ends in one without).
///    It counts when its last cell froze later than the saddle by `tolerance(time)`.
/// 3. What is left in the end without a feeder is a hot spot, too; its volume is that at its last saddle.
/// 4. A cell is reached when it is connected to a feeder by cells that stay open at least as long, up to the tolerance.
///
/// `times` has one entry for every entry of `cells`. O(n log n).
pub(super) fn hot_spots(
    grid: &Grid,
    cells: &[u32],
    times: &[f64],
    tolerance: impl Fn(f64) -> f64,
) -> HotSpots {
    let mut order: Vec<u32> = (0..cells.len() as u32).collect();
    let time = |v: u32| times[v as usize];
    order.sort_by(|&a, &b| time(b).total_cmp(&time(a)).then(a.cmp(&b)));
    let mut number = vec![u32::MAX; grid.cells.len()];
    for (v, &c) in cells.iter().enumerate() {
        number[c as usize] = v as u32;
    }
    let mut pools = Pools {
        parent: vec![u32::MAX; cells.len()],
        pools: Vec::with_capacity(cells.len()),
    };
    pools
        .pools
        .extend(cells.iter().enumerate().map(|(v, &c)| Pool {
            peak: v as u32,
            time: times[v],
            volume: grid.volume(c as usize),
            feeder: grid.cells[c as usize] == Cell::Feeder,
            last: None,
        }));
    let mut out = HotSpots::default();
    let mut reached = 0.0;
    let mut casting = 0.0;
    let mut waiting = 0;
    let metal = |v: u32| grid.cells[cells[v as usize] as usize] == Cell::Casting;
    for (opened, &v) in order.iter().enumerate() {
        pools.parent[v as usize] = v;
        for w in neighbours(grid, cells[v as usize], &number) {
            if pools.parent[w as usize] != u32::MAX {
                meet(&mut pools, v, w, time(v), &tolerance, cells, &mut out.spots);
            }
        }
        // Cells are asked once everything within their tolerance is open.
        let next = order
            .get(opened + 1)
            .map_or(f64::NEG_INFINITY, |&n| time(n));
        while waiting <= opened && time(order[waiting]) - tolerance(time(order[waiting])) > next {
            count(
                &mut pools,
                order[waiting],
                cells,
                grid,
                &metal,
                &mut reached,
                &mut casting,
            );
            waiting += 1;
        }
    }
    for &v in &order[waiting..] {
        count(
            &mut pools,
            v,
            cells,
            grid,
            &metal,
            &mut reached,
            &mut casting,
        );
    }
    for v in 0..cells.len() as u32 {
        if pools.root(v) == v {
            out.spots.push(last_spot(&pools, v, cells, times, grid));
        }
    }
    out.spots
        .sort_by(|a, b| b.time.total_cmp(&a.time).then(a.cell.cmp(&b.cell)));
    out.directional = if casting > 0.0 {
        reached / casting
    } else {
        0.0
    };
    out
}

fn count(
    pools: &mut Pools,
    v: u32,
    cells: &[u32],
    grid: &Grid,
    metal: &impl Fn(u32) -> bool,
    reached: &mut f64,
    casting: &mut f64,
) {
    if metal(v) {
        let volume = grid.volume(cells[v as usize] as usize);
        *casting += volume;
        let root = pools.root(v);
        if pools.pools[root as usize].feeder {
            *reached += volume;
        }
    }
}

/// Joins the pools of `v` and `w` at the time `now`.
fn meet(
    pools: &mut Pools,
    v: u32,
    w: u32,
    now: f64,
    tolerance: &impl Fn(f64) -> f64,
    cells: &[u32],
    spots: &mut Vec<HotSpot>,
) {
    let (a, b) = (pools.root(v), pools.root(w));
    if a == b {
        return;
    }
    let (pa, pb) = (pools.pools[a as usize], pools.pools[b as usize]);
    // With a feeder first, then the later, then the lower number.
    let rank = |p: &Pool| (p.feeder, p.time);
    let first = rank(&pa)
        .0
        .cmp(&rank(&pb).0)
        .then(rank(&pa).1.total_cmp(&rank(&pb).1));
    let (keep, end) = if first.then(pb.peak.cmp(&pa.peak)).is_gt() {
        (a, b)
    } else {
        (b, a)
    };
    let (kept, ended) = (pools.pools[keep as usize], pools.pools[end as usize]);
    let persistence = ended.time - now;
    let counts = persistence > tolerance(ended.time);
    if counts && !ended.feeder {
        spots.push(HotSpot {
            cell: cells[ended.peak as usize],
            time: ended.time,
            persistence,
            volume: ended.volume,
            fed: false,
        });
    }
    let joined = &mut pools.pools[keep as usize];
    joined.last = if counts {
        Some((now, kept.volume))
    } else {
        kept.last
    };
    joined.volume += ended.volume;
    pools.parent[end as usize] = keep;
}

/// A pool that met no other.
fn last_spot(pools: &Pools, root: u32, cells: &[u32], times: &[f64], grid: &Grid) -> HotSpot {
    let pool = pools.pools[root as usize];
    let late = WITHOUT_SADDLE * pool.time;
    let (since, volume) = pool.last.unwrap_or_else(|| {
        let open = times.iter().zip(cells).filter(|(t, _)| **t >= late);
        (late, open.map(|(_, &c)| grid.volume(c as usize)).sum())
    });
    HotSpot {
        cell: cells[pool.peak as usize],
        time: pool.time,
        persistence: pool.time - since,
        volume,
        fed: pool.feeder,
    }
}

/// Numbers of the metal cells that share a face with a cell.
fn neighbours(grid: &Grid, c: u32, number: &[u32]) -> impl Iterator<Item = u32> {
    let c = c as usize;
    let at = grid.ijk(c);
    let stride = [1, grid.dims[0], grid.dims[0] * grid.dims[1]];
    let mut found = [u32::MAX; 6];
    for a in 0..3 {
        if at[a] > 0 {
            found[2 * a] = number[c - stride[a]];
        }
        if at[a] + 1 < grid.dims[a] {
            found[2 * a + 1] = number[c + stride[a]];
        }
    }
    found.into_iter().filter(|n| *n != u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;
    use crate::voxel::VoxelGrid;

    /// A row of cells with these times; `feeder` is one of them.
    fn row(times: &[f64], feeder: Option<usize>) -> HotSpots {
        let field = VoxelGrid::filled(Vec3::zeros(), 1000.0, [times.len(), 1, 1], 1.0_f32);
        let mark = |p: &Vec3| feeder.is_some_and(|f| (p.x / 1000.0 - f as f64).abs() < 0.5);
        let grid = Grid::new(&field, 0.0, mark);
        let cells: Vec<u32> = (0..times.len() as u32).collect();
        hot_spots(&grid, &cells, times, |_| 0.5)
    }

    #[test]
    fn a_row_that_freezes_towards_its_feeder_has_no_isolated_spot() {
        let found = row(&[1.0, 2.0, 3.0, 4.0, 9.0], Some(4));
        assert!(found.spots.iter().all(|s| s.fed));
        assert!((found.directional - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_hump_before_a_neck_is_isolated() {
        let found = row(&[2.0, 6.0, 5.0, 3.0, 4.0, 9.0], Some(5));
        let isolated: Vec<&HotSpot> = found.spots.iter().filter(|s| !s.fed).collect();
        assert_eq!(isolated.len(), 1);
        // The neck itself counts with the pool that it closes.
        assert_eq!(
            (
                isolated[0].cell,
                isolated[0].persistence,
                isolated[0].volume
            ),
            (1, 3.0, 3.0)
        );
        // Reached: the cells at 2, 3 and 4; not those at 6 and 5.
        assert!((found.directional - 0.6).abs() < 1e-12);
    }

    #[test]
    fn small_humps_do_not_count_and_without_feeders_nothing_is_fed() {
        let found = row(&[2.0, 6.0, 5.8, 6.1, 3.0], None);
        assert_eq!(found.spots.len(), 1);
        assert_eq!((found.spots[0].cell, found.spots[0].fed), (3, false));
        assert_eq!(found.directional, 0.0);
    }
}
