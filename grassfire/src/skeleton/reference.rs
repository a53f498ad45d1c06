//! The smoothed fine complex as a reference: coarse vertices are put back onto its rims, seams, beams and sheets.

use super::arcs::{ArcKind, Arcs};
use super::complex::{Class, Complex};
use super::nearest::PointGrid;
use crate::Vec3;

/// How many fine points carry the plane that a sheet vertex is put on.
const PLANE_POINTS: usize = 8;
/// A vertex moves along its arc by at most this many times the straight way.
const DETOUR: f64 = 3.0;
/// Samples looked at around a point: more than arcs meet at a corner.
const SAMPLES_AT_POINT: usize = 12;

#[derive(Debug)]
struct Samples {
    grid: PointGrid,
    radii: Vec<f64>,
    /// Fine sheet of each sample; empty on arcs.
    sheets: Vec<u32>,
    /// Arc of each sample, and how far along it, mm; empty on sheets.
    along: Vec<(u32, f64)>,
    /// Lengths of closed arcs, infinite for open ones.
    periods: Vec<f64>,
}

impl Samples {
    /// Samples at the point: those of several arcs at a corner, none beside the arcs.
    fn places(&self, p: &Vec3, tolerance: f64) -> Vec<u32> {
        let near = self.grid.k_nearest(p, SAMPLES_AT_POINT, |_| true);
        near.into_iter()
            .filter(|&(d2, _)| d2 <= tolerance * tolerance)
            .map(|(_, i)| i)
            .collect()
    }

    /// Way along the arc from sample to sample, infinite between arcs.
    fn way(&self, i: u32, j: u32) -> f64 {
        let ((p, s), (q, t)) = (self.along[i as usize], self.along[j as usize]);
        if p != q {
            return f64::INFINITY;
        }
        let d = (s - t).abs();
        d.min(self.periods[p as usize] - d)
    }
}

/// Dense samples of the fine complex by kind.
#[derive(Debug)]
pub(crate) struct Reference {
    sheet: Samples,
    /// Rim, seam, beam.
    arcs: [Samples; 3],
    /// Distance of the samples on arcs, mm.
    step: f64,
    own_arcs: bool,
}

impl Reference {
    /// Samples `c` (sheets labelled, arcs traced); arcs every `step`. `own_arcs`: vertices on arcs keep to their own.
    pub fn new(c: &Complex, arcs: &Arcs, step: f64, own_arcs: bool) -> Self {
        let (mut points, mut radii, mut sheets) = (Vec::new(), Vec::new(), Vec::new());
        let mut seen = vec![false; c.points.len()];
        for t in c.alive() {
            let (corners, sheet) = (c.tri(t), c.sheet[t as usize]);
            points.push(corners.iter().map(|&v| c.points[v as usize]).sum::<Vec3>() / 3.0);
            radii.push(corners.iter().map(|&v| c.radii[v as usize]).sum::<f64>() / 3.0);
            sheets.push(sheet);
            for v in corners {
                if !std::mem::replace(&mut seen[v as usize], true) {
                    points.push(c.points[v as usize]);
                    radii.push(c.radii[v as usize]);
                    sheets.push(sheet);
                }
            }
        }
        let sheet = Samples {
            grid: PointGrid::new(points),
            radii,
            sheets,
            along: Vec::new(),
            periods: Vec::new(),
        };
        let arc = |kind| sample_arcs(c, arcs, kind, step);
        Self {
            sheet,
            arcs: [arc(ArcKind::Rim), arc(ArcKind::Seam), arc(ArcKind::Beam)],
            step,
            own_arcs,
        }
    }

    /// Puts an interior point onto the sheets for which `on_sheet` holds; returns position and radius.
    pub fn on_sheet(&self, x: &Vec3, on_sheet: impl Fn(u32) -> bool) -> Option<(Vec3, f64)> {
        let near = self
            .sheet
            .grid
            .k_nearest(x, PLANE_POINTS, |i| on_sheet(self.sheet.sheets[i as usize]));
        if near.len() < 3 {
            return None;
        }
        let n = near.len() as f64;
        let at = |i: u32| self.sheet.grid.points()[i as usize];
        let mean = near.iter().map(|&(_, i)| at(i)).sum::<Vec3>() / n;
        let radius = near
            .iter()
            .map(|&(_, i)| self.sheet.radii[i as usize])
            .sum::<f64>()
            / n;
        let mut spread = nalgebra::Matrix3::zeros();
        for &(_, i) in &near {
            let d = at(i) - mean;
            spread += d * d.transpose();
        }
        let eigen = nalgebra::SymmetricEigen::new(spread);
        let normal: Vec3 = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into();
        Some((x - normal * normal.dot(&(x - mean)), radius))
    }

    /// Puts a point onto the rim, seam or beam that it came along: `from` holds where a vertex was, or the two ends of the side
    /// that it divides. The nearest arc is another one where a sheet is narrow, above all at its tips. Without such places, or
    /// when they lie on no arc, or on none together, or vertices need not keep to their own, the nearest one is taken.
    pub fn on_arc(&self, x: &Vec3, class: Class, from: &[Vec3]) -> Option<(Vec3, f64)> {
        let samples = match class {
            Class::Rim => &self.arcs[0],
            Class::Seam => &self.arcs[1],
            Class::Beam => &self.arcs[2],
            Class::Interior | Class::Corner => return None,
        };
        let anchors: Vec<(Vec<u32>, f64)> = from
            .iter()
            .filter(|_| self.own_arcs)
            .map(|p| {
                let reach = DETOUR * (x - p).norm() + self.step;
                (samples.places(p, 0.5 * self.step), reach)
            })
            .filter(|(places, _)| !places.is_empty())
            .collect();
        let reached = |i: u32| {
            anchors
                .iter()
                .all(|(places, reach)| places.iter().any(|&j| samples.way(i, j) <= *reach))
        };
        let nearest = samples.grid.nearest(x, reached);
        let i = nearest.or_else(|| samples.grid.nearest(x, |_| true))?;
        Some((samples.grid.points()[i as usize], samples.radii[i as usize]))
    }

    /// Puts vertex `v` of `c` back onto its stratum; corners stay. `from`: see [`Self::on_arc`].
    pub fn project(&self, c: &mut Complex, v: u32, from: &[Vec3]) {
        let x = c.points[v as usize];
        let class = c.class(v);
        let found = if class == Class::Interior {
            let mut tags: Vec<u32> = c.vertex_triangles[v as usize]
                .iter()
                .map(|&t| c.sheet[t as usize])
                .collect();
            tags.sort_unstable();
            self.on_sheet(&x, |s| tags.binary_search(&s).is_ok())
        } else {
            self.on_arc(&x, class, from)
        };
        if let Some((x, r)) = found {
            c.points[v as usize] = x;
            c.radii[v as usize] = r;
        }
    }
}

fn sample_arcs(c: &Complex, arcs: &Arcs, kind: ArcKind, step: f64) -> Samples {
    let (mut points, mut radii) = (Vec::new(), Vec::new());
    let (mut along, mut periods) = (Vec::new(), Vec::new());
    for arc in arcs.arcs.iter().filter(|a| a.kind == kind) {
        let mut length = 0.0;
        for pair in arc.vertices.windows(2) {
            let [a, b] = [pair[0] as usize, pair[1] as usize];
            let n = ((c.length(pair[0], pair[1]) / step) as usize).clamp(1, 1000);
            for i in 0..=n {
                let t = i as f64 / n as f64;
                points.push(c.points[a] + (c.points[b] - c.points[a]) * t);
                radii.push(c.radii[a] + (c.radii[b] - c.radii[a]) * t);
                along.push((
                    periods.len() as u32,
                    length + t * c.length(pair[0], pair[1]),
                ));
            }
            length += c.length(pair[0], pair[1]);
        }
        let closed = arc.vertices.first() == arc.vertices.last();
        periods.push(if closed { length } else { f64::INFINITY });
    }
    Samples {
        grid: PointGrid::new(points),
        radii,
        sheets: Vec::new(),
        along,
        periods,
    }
}

#[cfg(test)]
mod tests {
    use super::super::arcs;
    use super::*;

    /// A strip of 10 x 1 in cells of a quarter; its rim is one closed arc.
    fn strip() -> Reference {
        let (nx, ny) = (40, 4);
        let at = |i: u32| 0.25 * f64::from(i);
        let points: Vec<Vec3> = (0..(nx + 1) * (ny + 1))
            .map(|v| Vec3::new(at(v % (nx + 1)), at(v / (nx + 1)), 0.0))
            .collect();
        let triangles: Vec<[u32; 3]> = (0..nx * ny)
            .map(|k| k / nx * (nx + 1) + k % nx)
            .flat_map(|v| [[v, v + 1, v + nx + 2], [v, v + nx + 2, v + nx + 1]])
            .collect();
        let radii = vec![1.0; points.len()];
        let c = Complex::new(points, radii, &triangles, &[]);
        Reference::new(&c, &arcs::trace(&c), 0.05, true)
    }

    #[test]
    fn vertices_of_a_narrow_strip_stay_on_their_own_rim() {
        // At the rounded tip of a strip all vertices of one rim went over to the other.
        let reference = strip();
        let target = Vec3::new(5.0, 0.45, 0.0);
        let on = |from: &[Vec3]| {
            reference
                .on_arc(&target, Class::Rim, from)
                .expect("a rim")
                .0
        };
        assert!((on(&[]) - Vec3::new(5.0, 0.0, 0.0)).norm() < 1e-9);
        assert!((on(&[Vec3::new(5.0, 1.0, 0.0)]) - Vec3::new(5.0, 1.0, 0.0)).norm() < 1e-9);
        // The middle of a side of the upper rim.
        let ends = [4.5, 5.5].map(|x| Vec3::new(x, 1.0, 0.0));
        assert!((on(&ends) - Vec3::new(5.0, 1.0, 0.0)).norm() < 1e-9);
    }

    #[test]
    fn vertices_pass_the_place_where_a_closed_rim_begins() {
        let reference = strip();
        for x in 0..=40 {
            let from = Vec3::new(0.25 * f64::from(x), 0.0, 0.0);
            for step in [-0.25, 0.25] {
                let target = from + Vec3::new(step, 0.0, 0.0);
                let (y, _) = reference
                    .on_arc(&target, Class::Rim, &[from])
                    .expect("a rim");
                let inside = Vec3::new(target.x.clamp(0.0, 10.0), 0.0, 0.0);
                assert!((y - inside).norm() < 1e-9, "{from} to {y}");
            }
        }
    }

    #[test]
    fn places_on_no_rim_bind_nothing() {
        let reference = strip();
        let target = Vec3::new(5.0, 0.9, 0.0);
        let (y, _) = reference
            .on_arc(&target, Class::Rim, &[Vec3::new(5.0, 0.5, 0.0)])
            .expect("a rim");
        assert!((y - Vec3::new(5.0, 1.0, 0.0)).norm() < 1e-9);
    }
}
