//! One Gauss-Newton round, and distances between the limit surface and the iso-surface.

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::data::{Nearby, Samples, nearest_samples};
use super::equations::{Equations, solve};
use super::surface::Surface;
use super::targets::{IsoSamples, PointGrid, flow_to_surface, value_and_gradient};
use super::{Distances, FitError, FitOptions, FitRound};
use crate::Vec3;
use crate::voxel::VoxelGrid;

/// The system with the local weights that untangling changes.
pub(super) struct Solver<'a> {
    pub surface: Surface,
    pub field: &'a VoxelGrid<f32>,
    pub iso: &'a IsoSamples,
    pub options: FitOptions,
    pub equations: Equations,
    /// Factor on the fairness of each control point.
    pub fairness: Vec<f64>,
    /// Factor on the data of each sample.
    pub trust: Vec<f64>,
    /// The fairness that late rounds settle at.
    pub least_fairness: f64,
    /// Volume that every round aims at, mm3.
    pub volume: Option<f64>,
    /// What the samples around each control point showed in this round.
    pub nearby: Vec<Nearby>,
}

/// Weights of one round.
pub(super) struct Schedule {
    /// Distance from which on a sample counts less, voxels.
    pub cap: f64,
    fairness: f64,
    pub tangential: f64,
    /// Samples that look across the way to the proposal pull, too.
    pub sunk: bool,
}

/// The first round in which samples that look across the way to the proposal pull. Before that most of them are only
/// where the thickened body was too crude, and would drag the net to the wrong side.
const SUNK_FROM: u32 = 8;
/// Fairness around such samples is at least this: a slit that closes over must smooth out on the whole.
const SUNK_FAIRNESS: f64 = 0.3;
/// A flow to the surface that is longer than this may not be the shortest, voxels.
const LONG: f64 = 0.8;
/// Steps of a point of the surface towards the foot of another.
const SLIDES: u32 = 4;
/// Evenness around samples that are far off is at least this: nets that are crowded there cannot move.
const FAR_EVENNESS: f64 = 0.1;

impl<'a> Solver<'a> {
    pub fn new(
        surface: Surface,
        field: &'a VoxelGrid<f32>,
        iso: &'a IsoSamples,
        options: &FitOptions,
    ) -> Result<Self, FitError> {
        let equations = Equations::new(&[&surface.samples, &surface.bending])
            .map_err(|reason| FitError::Solver { round: 0, reason })?;
        Ok(Self {
            fairness: vec![1.0; surface.coarse.point_count],
            trust: vec![1.0; surface.samples.rows()],
            least_fairness: options.fairness,
            volume: None,
            nearby: vec![Nearby::default(); surface.coarse.point_count],
            surface,
            field,
            iso,
            options: *options,
            equations,
        })
    }

    /// Round `round`: weights harden with its number. Moves `points`.
    pub fn round(&mut self, points: &mut [Vec3], round: u32) -> Result<FitRound, FitError> {
        let decay = i32::try_from(round).unwrap_or(i32::MAX);
        let schedule = Schedule {
            cap: (8.0 * 0.7f64.powi(decay)).max(2.0),
            fairness: 0.6f64.powi(decay).max(self.least_fairness),
            tangential: if round > 3 { 0.03 } else { 0.1 },
            sunk: round >= SUNK_FROM,
        };
        let at = self.surface.samples.apply(points);
        let (normals, areas) = self.surface.normals_and_areas(&at);
        let area: f64 = areas.iter().sum();
        let mean_area = area / points.len().max(1) as f64;
        self.equations.clear();
        let samples = Samples {
            at: &at,
            normals: &normals,
            areas: &areas,
        };
        let distance = self.add_data(samples, &schedule);
        self.add_fairness(points, mean_area, schedule.fairness);
        self.add_evenness(&normals, mean_area);
        let solution = self
            .solution(&normals, &areas)
            .map_err(|reason| FitError::Solver { round, reason })?;
        let mut total = 0.0;
        for (p, wanted) in points.iter_mut().zip(&solution) {
            let step = wanted - *p;
            let length = step.norm();
            *p += step * (self.options.max_step / length.max(1e-9)).min(1.0);
            total += length;
        }
        let mm = self.field.spacing;
        Ok(FitRound {
            mean_distance: mm * distance / area.max(1e-300),
            step: mm * total / points.len().max(1) as f64,
        })
    }

    /// The solution of the equations; with a wanted volume the one that costs least among those that have it to first
    /// order (one Lagrange multiplier).
    pub(super) fn solution(&self, normals: &[Vec3], areas: &[f64]) -> Result<Vec<Vec3>, String> {
        let factor = self.equations.factor()?;
        let mut points = self.equations.solve(&factor)?;
        let Some(wanted) = self.volume else {
            return Ok(points);
        };
        let gradient = self.surface.volume_gradient(normals, areas);
        let along = solve(&factor, &gradient)?;
        let slope: f64 = gradient
            .chunks_exact(3)
            .zip(&along)
            .map(|(g, d)| g[0] * d.x + g[1] * d.y + g[2] * d.z)
            .sum();
        let missing = (wanted - self.surface.volume(&points)) / self.field.spacing.powi(3);
        if slope > 0.0 {
            let multiplier = missing / slope;
            let pairs = points.iter_mut().zip(&along);
            pairs.for_each(|(p, d)| *p += multiplier * d);
        }
        Ok(points)
    }

    fn add_fairness(&mut self, points: &[Vec3], mean_area: f64, fairness: f64) {
        let identity = Matrix3::identity();
        for r in 0..points.len() {
            let least = if self.nearby[r].sunk {
                SUNK_FAIRNESS
            } else {
                0.0
            };
            let weight = mean_area * least.max(fairness * self.fairness[r]);
            let (indices, weights) = self.surface.bending.row(r);
            self.equations
                .add(indices, weights, &(weight * identity), &Vec3::zeros());
            let (indices, weights) = self.surface.laplacian.row(r);
            self.equations.add(
                indices,
                weights,
                &(0.02 * fairness * mean_area * identity),
                &Vec3::zeros(),
            );
        }
        for (p, place) in points.iter().enumerate() {
            self.equations.pin(p as u32, 1e-3 * mean_area, place);
        }
    }

    /// Tangential part of the Laplacian; the first samples are those of the control points.
    fn add_evenness(&mut self, normals: &[Vec3], mean_area: f64) {
        let control = normals.iter().zip(&self.fairness);
        for (r, (normal, fairness)) in control.enumerate().take(self.surface.coarse.point_count) {
            // Local fairness asks for a calmer net, too.
            let least = if self.nearby[r].far {
                FAR_EVENNESS
            } else {
                0.0
            };
            let weight = least.max(self.options.evenness) * mean_area * fairness.min(20.0);
            let block = weight * (Matrix3::identity() - normal * normal.transpose());
            let (indices, weights) = self.surface.laplacian.row(r);
            self.equations.add(indices, weights, &block, &Vec3::zeros());
        }
    }

    /// Patches below this normalised Jacobian fold.
    pub fn fold_limit(&self) -> f64 {
        self.options.fold_limit
    }

    /// Distances of the limit surface to f = 0, by flow along the gradient. In a narrow groove that may lead far along its
    /// floor: a distance that rounds should lower, if not the shortest one.
    pub fn body_to_iso(&self, points: &[Vec3]) -> Distances {
        self.distances_of(points, |p| self.flow(p))
    }

    /// The largest of them, mm, where a long flow counts no more than the way to the surface near the nearest sample of f = 0.
    pub fn farthest_from_iso(&self, points: &[Vec3]) -> f64 {
        let iso = &self.iso.points;
        let grid = PointGrid::new(iso, 1.5);
        let shortest = |p: &Vec3| {
            let flown = self.flow(p);
            let nearest = (flown > LONG).then(|| grid.nearest(iso, p)).flatten();
            nearest.map_or(flown, |(q, _)| self.slid(p, iso[q as usize]).min(flown))
        };
        self.distances_of(points, shortest).max
    }

    /// Distance of `p` to the surface f = 0 near its point `q`, which slides towards the foot of `p`, voxels.
    fn slid(&self, p: &Vec3, mut q: Vec3) -> f64 {
        let mut least = (p - q).norm();
        for _ in 0..SLIDES {
            let (_, gradient) = value_and_gradient(self.field, &q);
            let Some(normal) = gradient.try_normalize(1e-9) else {
                break;
            };
            let way = p - q;
            q = flow_to_surface(self.field, &(q + way - normal * way.dot(&normal)), 6).0;
            least = least.min((p - q).norm());
        }
        least
    }

    /// Length of the way of `p` to f = 0 along the gradient, voxels.
    fn flow(&self, p: &Vec3) -> f64 {
        (flow_to_surface(self.field, p, 12).0 - p).norm()
    }

    fn distances_of(
        &self,
        points: &[Vec3],
        distance: impl Fn(&Vec3) -> f64 + Sync + Send,
    ) -> Distances {
        let at = self.surface.samples.apply(points);
        let (_, areas) = self.surface.normals_and_areas(&at);
        let distances: Vec<f64> = at.par_iter().with_min_len(512).map(distance).collect();
        self.summary(distances.into_iter().zip(areas).collect())
    }

    /// Signed distances of the samples to f = 0, voxels, positive where the body is too thin, and their areas. A sample
    /// that is the nearest one to a farther place of the iso-surface has the distance to that place.
    pub fn signed_distances(&self, points: &[Vec3]) -> (Vec<f64>, Vec<f64>) {
        let at = self.surface.samples.apply(points);
        let (normals, areas) = self.surface.normals_and_areas(&at);
        let mut signed: Vec<f64> = at
            .par_iter()
            .zip(&normals)
            .with_min_len(512)
            .map(|(p, normal)| {
                let way = flow_to_surface(self.field, p, 12).0 - p;
                way.norm().copysign(way.dot(normal))
            })
            .collect();
        let nearest = nearest_samples(&at, &self.iso.points);
        for (p, found) in self.iso.points.iter().zip(&nearest) {
            let Some((j, _)) = *found else { continue };
            let j = j as usize;
            // Across the surface: samples are up to half a quarter of a quad apart.
            let d = (p - at[j]).dot(&normals[j]);
            if d.abs() > signed[j].abs() {
                signed[j] = d;
            }
        }
        (signed, areas)
    }

    /// Distances of the iso-surface samples to the limit surface.
    pub fn iso_to_body(&self, points: &[Vec3]) -> Distances {
        let at = self.surface.samples.apply(points);
        let grid = PointGrid::new(&at, 1.5);
        let fine = &self.surface.fine;
        let distance = |p: &Vec3| {
            let Some((j, d)) = grid.nearest(&at, p) else {
                return 0.0;
            };
            fine.ring(j)
                .flat_map(|h| {
                    let [a, b, c, d] = fine.quads[(h / 4) as usize].map(|v| at[v as usize]);
                    [[a, b, c], [a, c, d]]
                })
                .map(|t| distance_to_triangle(p, &t))
                .fold(d, f64::min)
        };
        let distances: Vec<f64> = self
            .iso
            .points
            .par_iter()
            .with_min_len(512)
            .map(distance)
            .collect();
        self.summary(distances.into_iter().map(|d| (d, 1.0)).collect())
    }

    /// Weighted summary of (distance in voxels, weight), in mm.
    fn summary(&self, mut list: Vec<(f64, f64)>) -> Distances {
        list.sort_by(|a, b| a.0.total_cmp(&b.0));
        let total: f64 = list.iter().map(|x| x.1).sum();
        let square: f64 = list.iter().map(|x| x.1 * x.0 * x.0).sum();
        let mut below = 0.0;
        let p95 = list.iter().find(|x| {
            below += x.1;
            below >= 0.95 * total
        });
        let mm = self.field.spacing;
        Distances {
            rms: mm * (square / total.max(1e-300)).sqrt(),
            p95: mm * p95.map_or(0.0, |x| x.0),
            max: mm * list.last().map_or(0.0, |x| x.0),
        }
    }
}

/// Distance of a point to a triangle (C. Ericson, Real-Time Collision Detection, 2005, section 5.1.5).
fn distance_to_triangle(p: &Vec3, [a, b, c]: &[Vec3; 3]) -> f64 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    let (bp, cp) = (p - b, p - c);
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    let (va, vb, vc) = (d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2);
    let nearest = if d1 <= 0.0 && d2 <= 0.0 {
        *a
    } else if d3 >= 0.0 && d4 <= d3 {
        *b
    } else if d6 >= 0.0 && d5 <= d6 {
        *c
    } else if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        a + ab * (d1 / (d1 - d3))
    } else if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        a + ac * (d2 / (d2 - d6))
    } else if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)))
    } else {
        let sum = va + vb + vc;
        a + ab * (vb / sum) + ac * (vc / sum)
    };
    (nearest - p).norm()
}
