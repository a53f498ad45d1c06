//! The smoothed fine complex as a reference: coarse vertices are put back onto its rims, seams, beams and sheets.

use super::arcs::{ArcKind, Arcs};
use super::complex::{Class, Complex};
use super::nearest::PointGrid;
use crate::Vec3;

/// How many fine points carry the plane that a sheet vertex is put on.
const PLANE_POINTS: usize = 8;

#[derive(Debug)]
struct Samples {
    grid: PointGrid,
    radii: Vec<f64>,
    /// Fine sheet of each sample; empty on arcs.
    sheets: Vec<u32>,
}

/// Dense samples of the fine complex by kind.
#[derive(Debug)]
pub(crate) struct Reference {
    sheet: Samples,
    /// Rim, seam, beam.
    arcs: [Samples; 3],
}

impl Reference {
    /// Samples `c` (sheets labelled, arcs traced); arcs every `step`.
    pub fn new(c: &Complex, arcs: &Arcs, step: f64) -> Self {
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
        };
        let arc = |kind| sample_arcs(c, arcs, kind, step);
        Self {
            sheet,
            arcs: [arc(ArcKind::Rim), arc(ArcKind::Seam), arc(ArcKind::Beam)],
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

    /// Puts a point onto the nearest rim, seam or beam.
    pub fn on_arc(&self, x: &Vec3, class: Class) -> Option<(Vec3, f64)> {
        let samples = match class {
            Class::Rim => &self.arcs[0],
            Class::Seam => &self.arcs[1],
            Class::Beam => &self.arcs[2],
            Class::Interior | Class::Corner => return None,
        };
        let i = samples.grid.nearest(x, |_| true)?;
        Some((samples.grid.points()[i as usize], samples.radii[i as usize]))
    }

    /// Puts vertex `v` of `c` back onto its stratum; corners stay.
    pub fn project(&self, c: &mut Complex, v: u32) {
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
            self.on_arc(&x, class)
        };
        if let Some((x, r)) = found {
            c.points[v as usize] = x;
            c.radii[v as usize] = r;
        }
    }
}

fn sample_arcs(c: &Complex, arcs: &Arcs, kind: ArcKind, step: f64) -> Samples {
    let (mut points, mut radii) = (Vec::new(), Vec::new());
    for arc in arcs.arcs.iter().filter(|a| a.kind == kind) {
        for pair in arc.vertices.windows(2) {
            let [a, b] = [pair[0] as usize, pair[1] as usize];
            let n = ((c.length(pair[0], pair[1]) / step) as usize).clamp(1, 1000);
            for i in 0..=n {
                let t = i as f64 / n as f64;
                points.push(c.points[a] + (c.points[b] - c.points[a]) * t);
                radii.push(c.radii[a] + (c.radii[b] - c.radii[a]) * t);
            }
        }
    }
    Samples {
        grid: PointGrid::new(points),
        radii,
        sheets: Vec::new(),
    }
}
