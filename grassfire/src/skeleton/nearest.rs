//! k nearest points by a uniform bucket grid: exact, deterministic (ties go to the lower index).

use crate::Vec3;

/// Points sorted into equal cells.
#[derive(Debug)]
pub(crate) struct PointGrid {
    points: Vec<Vec3>,
    low: Vec3,
    cell: f64,
    dims: [i64; 3],
    start: Vec<u32>,
    order: Vec<u32>,
}

impl PointGrid {
    /// About two points a cell along a surface; never more cells than four times the points.
    pub fn new(points: Vec<Vec3>) -> Self {
        let first = points.first().copied().unwrap_or_default();
        let (low, high) = points
            .iter()
            .fold((first, first), |(l, h), p| (l.inf(p), h.sup(p)));
        let size = high - low;
        let limit = (4 * points.len()).max(8) as f64;
        let mut cell = (size.max() / (points.len().max(1) as f64).sqrt()).max(1e-9);
        let count = |cell: f64| {
            size.iter()
                .map(|s| (s / cell).floor() + 1.0)
                .product::<f64>()
        };
        while count(cell) > limit {
            cell *= 1.2;
        }
        let dims = [0, 1, 2].map(|k| (size[k] / cell).floor() as i64 + 1);
        let mut grid = Self {
            points,
            low,
            cell,
            dims,
            start: Vec::new(),
            order: Vec::new(),
        };
        let cells = (dims[0] * dims[1] * dims[2]) as usize;
        let mut keys: Vec<(u32, u32)> = (0..grid.points.len() as u32)
            .map(|i| (grid.index(grid.place(&grid.points[i as usize])) as u32, i))
            .collect();
        keys.sort_unstable();
        let mut start = vec![0u32; cells + 1];
        for (k, _) in &keys {
            start[*k as usize + 1] += 1;
        }
        for i in 0..cells {
            start[i + 1] += start[i];
        }
        grid.order = keys.into_iter().map(|(_, i)| i).collect();
        grid.start = start;
        grid
    }

    /// The stored points.
    pub fn points(&self) -> &[Vec3] {
        &self.points
    }

    fn place(&self, p: &Vec3) -> [i64; 3] {
        [0, 1, 2]
            .map(|k| (((p[k] - self.low[k]) / self.cell).floor() as i64).clamp(0, self.dims[k] - 1))
    }

    fn index(&self, c: [i64; 3]) -> usize {
        ((c[2] * self.dims[1] + c[1]) * self.dims[0] + c[0]) as usize
    }

    /// Index of the nearest point that passes `keep`.
    pub fn nearest(&self, p: &Vec3, keep: impl Fn(u32) -> bool) -> Option<u32> {
        self.k_nearest(p, 1, keep).first().map(|x| x.1)
    }

    /// Up to `k` nearest points that pass `keep`: (squared distance, index), nearest first.
    pub fn k_nearest(&self, p: &Vec3, k: usize, keep: impl Fn(u32) -> bool) -> Vec<(f64, u32)> {
        let mut best: Vec<(f64, u32)> = Vec::with_capacity(k + 1);
        if self.points.is_empty() || k == 0 {
            return best;
        }
        let centre = self.place(p);
        let reach = self.dims.iter().copied().max().unwrap_or(1);
        for ring in 0..=reach {
            if best.len() == k {
                // Every point not yet seen lies beyond the rings already searched; a query point
                // outside the box is clamped, which only makes the true distance larger.
                let seen = (ring - 1) as f64 * self.cell;
                if ring > 0 && best[k - 1].0 <= seen * seen {
                    break;
                }
            }
            self.search_ring(p, centre, ring, k, &keep, &mut best);
        }
        best
    }

    fn search_ring(
        &self,
        p: &Vec3,
        centre: [i64; 3],
        ring: i64,
        k: usize,
        keep: &impl Fn(u32) -> bool,
        best: &mut Vec<(f64, u32)>,
    ) {
        let range = |a: usize| (centre[a] - ring).max(0)..=(centre[a] + ring).min(self.dims[a] - 1);
        for z in range(2) {
            for y in range(1) {
                let on_shell = (z - centre[2]).abs() == ring || (y - centre[1]).abs() == ring;
                let step = if on_shell || ring == 0 { 1 } else { 2 * ring };
                let mut x = centre[0] - ring;
                while x <= centre[0] + ring {
                    if (0..self.dims[0]).contains(&x) {
                        self.search_cell(p, self.index([x, y, z]), k, keep, best);
                    }
                    x += step;
                }
            }
        }
    }

    fn search_cell(
        &self,
        p: &Vec3,
        cell: usize,
        k: usize,
        keep: &impl Fn(u32) -> bool,
        best: &mut Vec<(f64, u32)>,
    ) {
        for &i in &self.order[self.start[cell] as usize..self.start[cell + 1] as usize] {
            let found = ((self.points[i as usize] - p).norm_squared(), i);
            let closer = |a: &(f64, u32), b: &(f64, u32)| a.0 < b.0 || (a.0 == b.0 && a.1 < b.1);
            if best.len() == k && !closer(&found, &best[k - 1]) || !keep(i) {
                continue;
            }
            let at = best.partition_point(|b| closer(b, &found));
            best.insert(at, found);
            best.truncate(k);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_brute_force() {
        let mut state = 7u64;
        let mut random = || {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 33) as f64 / (1u64 << 31) as f64
        };
        let points: Vec<Vec3> = (0..500)
            .map(|_| Vec3::new(random() * 9.0, random() * 3.0, random() * 0.2))
            .collect();
        let grid = PointGrid::new(points.clone());
        for _ in 0..100 {
            let p = Vec3::new(
                random() * 14.0 - 2.0,
                random() * 5.0 - 1.0,
                random() * 2.0 - 1.0,
            );
            let mut all: Vec<(f64, u32)> = (0..500)
                .map(|i| ((points[i] - p).norm_squared(), i as u32))
                .collect();
            all.retain(|x| x.1 % 3 != 0);
            all.sort_by(|a, b| a.0.total_cmp(&b.0));
            all.truncate(8);
            assert_eq!(grid.k_nearest(&p, 8, |i| i % 3 != 0), all);
        }
    }

    #[test]
    fn empty_and_coincident() {
        assert!(
            PointGrid::new(Vec::new())
                .nearest(&Vec3::zeros(), |_| true)
                .is_none()
        );
        let grid = PointGrid::new(vec![Vec3::zeros(); 10]);
        assert_eq!(grid.nearest(&Vec3::new(5.0, 0.0, 0.0), |_| true), Some(0));
        assert_eq!(grid.k_nearest(&Vec3::zeros(), 3, |_| true).len(), 3);
    }
}
