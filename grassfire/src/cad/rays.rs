//! Volumes of set expressions of closed meshes by parallel rays: slow to converge, but blind to nothing that booleans are
//! blind to. This is the independent check of every boolean.

use crate::Vec3;
use robust::{Coord, orient2d};

/// A square grid of parallel rays.
pub(crate) struct RayGrid {
    axes: [Vec3; 3],
    low: [f64; 2],
    step: f64,
    count: [usize; 2],
}

impl RayGrid {
    /// About `across` rays over the longer side of the points' shadow.
    ///
    /// The direction is a fixed one oblique to `axis`, so that neither walls nor ends of a cylinder are parallel to the rays.
    pub(crate) fn around(points: &[Vec3], axis: Vec3, across: u32) -> Self {
        let side = if axis.x.abs() < 0.8 {
            Vec3::x()
        } else {
            Vec3::y()
        };
        let first = axis.cross(&side).normalize();
        let second = axis.cross(&first);
        let along = (axis + first * 0.61 + second * 0.37).normalize();
        let x = along.cross(&side).normalize();
        let axes = [x, along.cross(&x), along];
        let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
        for p in points {
            for k in 0..2 {
                low[k] = low[k].min(p.dot(&axes[k]));
                high[k] = high[k].max(p.dot(&axes[k]));
            }
        }
        let size = (high[0] - low[0]).max(high[1] - low[1]).max(1e-9);
        let step = size / f64::from(across.max(2));
        let count = [0, 1].map(|k| ((high[k] - low[k]) / step).ceil().max(1.0) as usize);
        // Irrational offset: no ray meets a vertex of a regular shape.
        let low = [low[0] + step * 0.381_966, low[1] + step * 0.618_034];
        Self {
            axes,
            low,
            step,
            count,
        }
    }

    /// Area that one ray stands for, mm2.
    pub(crate) fn cell(&self) -> f64 {
        self.step * self.step
    }

    pub(crate) fn rays(&self) -> usize {
        self.count[0] * self.count[1]
    }

    /// Whether the shadow of the box around `low`..`high` can meet the grid.
    pub(crate) fn sees(&self, low: Vec3, high: Vec3) -> bool {
        let (middle, half) = ((low + high) / 2.0, (high - low) / 2.0);
        (0..2).all(|k| {
            let at = middle.dot(&self.axes[k]);
            let reach = half.dot(&self.axes[k].abs());
            at + reach >= self.low[k]
                && at - reach <= self.low[k] + self.step * self.count[k] as f64
        })
    }

    /// The part of each ray inside the closed surface made of `triangles`.
    pub(crate) fn columns<'a>(
        &self,
        triangles: impl IntoIterator<Item = &'a [Vec3; 3]>,
    ) -> Columns {
        let mut hits: Vec<(u32, i32, f64)> = Vec::new();
        for t in triangles {
            self.scan(t, &mut hits);
        }
        hits.sort_by(|a, b| a.0.cmp(&b.0).then(a.2.total_cmp(&b.2)));
        let mut out = Columns {
            start: Vec::with_capacity(self.rays() + 1),
            spans: Vec::new(),
            broken: Vec::new(),
        };
        let mut at = 0;
        for ray in 0..self.rays() as u32 {
            out.start.push(out.spans.len());
            let (mut depth, mut from) = (0, 0.0);
            while let Some(&(_, turn, z)) = hits.get(at).filter(|h| h.0 == ray) {
                if depth == 0 && turn > 0 {
                    from = z;
                } else if depth == 1 && turn < 0 {
                    out.spans.push([from, z]);
                }
                depth += turn;
                at += 1;
            }
            if depth != 0 {
                out.broken.push(ray);
            }
        }
        out.start.push(out.spans.len());
        out
    }

    fn scan(&self, t: &[Vec3; 3], hits: &mut Vec<(u32, i32, f64)>) {
        let p = t.map(|q| self.axes.map(|a| q.dot(&a)));
        let range = |k: usize| {
            let lo = p.iter().map(|q| q[k]).fold(f64::MAX, f64::min);
            let hi = p.iter().map(|q| q[k]).fold(f64::MIN, f64::max);
            let first = ((lo - self.low[k]) / self.step).ceil().max(0.0) as usize;
            let end = ((hi - self.low[k]) / self.step).floor() + 1.0;
            first..(end.max(0.0) as usize).min(self.count[k])
        };
        let flat = p.map(|q| Coord { x: q[0], y: q[1] });
        let area = orient2d(flat[0], flat[1], flat[2]);
        if area == 0.0 {
            return;
        }
        for i in range(0) {
            for j in range(1) {
                let ray = Coord {
                    x: self.low[0] + self.step * i as f64,
                    y: self.low[1] + self.step * j as f64,
                };
                let side = [0, 1, 2].map(|k| orient2d(flat[(k + 1) % 3], flat[(k + 2) % 3], ray));
                if (0..3).all(|k| inside(side[k], area, flat[(k + 1) % 3], flat[(k + 2) % 3])) {
                    let z = (side[0] * p[0][2] + side[1] * p[1][2] + side[2] * p[2][2])
                        / (side[0] + side[1] + side[2]);
                    // A surface seen from its outer side by the ray's far end is left there.
                    hits.push((
                        (i * self.count[1] + j) as u32,
                        if area > 0.0 { -1 } else { 1 },
                        z,
                    ));
                }
            }
        }
    }
}

/// Exact side test; a ray exactly on an edge belongs to one of its two triangles.
fn inside(side: f64, area: f64, from: Coord<f64>, to: Coord<f64>) -> bool {
    if side == 0.0 {
        return ((from.x, from.y) < (to.x, to.y)) == (area > 0.0);
    }
    (side > 0.0) == (area > 0.0)
}

/// Inside parts of all rays of a grid.
pub(crate) struct Columns {
    start: Vec<usize>,
    spans: Vec<[f64; 2]>,
    broken: Vec<u32>,
}

impl Columns {
    /// Nothing inside.
    pub(crate) fn empty(grid: &RayGrid) -> Self {
        Self {
            start: vec![0; grid.rays() + 1],
            spans: Vec::new(),
            broken: Vec::new(),
        }
    }

    fn ray(&self, ray: usize) -> &[[f64; 2]] {
        &self.spans[self.start[ray]..self.start[ray + 1]]
    }
}

/// Calls `piece(mask, volume)` for every stretch of every ray; bit k of the mask tells that it lies inside `sets[k]`.
///
/// Rays that met a surface that is not closed are left out. At most 128 sets.
pub(crate) fn sweep(grid: &RayGrid, sets: &[&Columns], mut piece: impl FnMut(u128, f64)) {
    let mut broken: Vec<u32> = sets.iter().flat_map(|s| s.broken.iter().copied()).collect();
    broken.sort_unstable();
    let mut events: Vec<(f64, usize)> = Vec::new();
    for ray in 0..grid.rays() {
        if broken.binary_search(&(ray as u32)).is_ok() {
            continue;
        }
        events.clear();
        for (k, set) in sets.iter().enumerate() {
            events.extend(set.ray(ray).iter().flatten().map(|&z| (z, k)));
        }
        events.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut mask = 0u128;
        for pair in 0..events.len() {
            let (z, k) = events[pair];
            mask ^= 1 << k;
            if let Some(next) = events.get(pair + 1).filter(|_| mask != 0) {
                piece(mask, (next.0 - z) * grid.cell());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::cuboid;

    fn cube(low: f64, high: f64) -> Vec<[Vec3; 3]> {
        let mesh = cuboid(Vec3::repeat(low), Vec3::repeat(high));
        (0..12).map(|t| mesh.corners(t)).collect()
    }

    #[test]
    fn overlapping_cubes() {
        let (a, b) = (cube(0.0, 2.0), cube(1.0, 3.0));
        let points: Vec<Vec3> = a.iter().chain(&b).flatten().copied().collect();
        let grid = RayGrid::around(&points, Vec3::z(), 300);
        let columns = [grid.columns(&a), grid.columns(&b)];
        let mut volumes = [0.0; 4];
        sweep(&grid, &[&columns[0], &columns[1]], |mask, v| {
            volumes[mask as usize] += v
        });
        assert!(columns.iter().all(|c| c.broken.is_empty()));
        for (got, wanted) in volumes[1..].iter().zip([7.0, 7.0, 1.0]) {
            assert!(
                (got - wanted).abs() < 2e-3 * wanted,
                "{got} instead of {wanted}"
            );
        }
    }
}
