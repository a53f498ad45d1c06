//! The limit surface as a linear function of the control points, in voxel units of the field.

use faer::sparse::{SparseColMat, Triplet};
use faer::{Mat, Side, prelude::Solve};

use super::FitError;
use crate::Vec3;
use crate::mesh::TriMesh;
use crate::spline::ControlMesh;
use crate::spline::catmull_clark::{QuadTopology, Stencils, limit_operator, triangles_of};
use crate::thicken::ThickenedBody;
use crate::voxel::VoxelGrid;

/// Splits before sampling: 16 samples a quad.
pub(super) const LEVELS: u32 = 2;

/// Operators that depend on the connectivity only.
pub(super) struct Surface {
    pub coarse: QuadTopology,
    /// Connectivity of the samples.
    pub fine: QuadTopology,
    /// Control points to samples on the limit surface.
    pub samples: Stencils,
    pub laplacian: Stencils,
    /// The Laplacian of the Laplacian.
    pub bending: Stencils,
    pub triangles: Vec<[u32; 3]>,
    /// Control quad of each triangle.
    pub owner: Vec<u32>,
    /// Samples and triangles after one more split, for the volume.
    finer: (Stencils, Vec<[u32; 3]>),
    origin: Vec3,
    spacing: f64,
}

impl Surface {
    pub fn new(body: &ThickenedBody, field: &VoxelGrid<f32>) -> Result<Self, FitError> {
        let n = body.mesh.points.len();
        let coarse = QuadTopology::new(n, &body.mesh.quads)?;
        let (samples, fine) = limit_operator(n, &body.mesh.quads, LEVELS)?;
        let laplacian = coarse.laplacian();
        let bending = laplacian.after(&laplacian);
        let (triangles, owner) = triangles_of(&fine.quads, LEVELS);
        let (finest, topology) = limit_operator(n, &body.mesh.quads, LEVELS + 1)?;
        let finer = (finest, triangles_of(&topology.quads, LEVELS + 1).0);
        let (origin, spacing) = (field.origin, field.spacing);
        Ok(Self {
            coarse,
            fine,
            samples,
            laplacian,
            bending,
            triangles,
            owner,
            finer,
            origin,
            spacing,
        })
    }

    /// Control points whose limit surface follows the points T, damped towards them: least
    /// squares |L X - T|^2 + 1e-2 |Lap (X - T)|^2 + 1e-6 |X|^2, L the limit positions.
    pub fn damped_start(&self, targets: &[Vec3]) -> Result<Vec<Vec3>, FitError> {
        const DAMPING: f64 = 1e-2;
        const TINY: f64 = 1e-6;
        let n = self.coarse.point_count;
        let limit = self.coarse.limit_positions();
        let bent = self.laplacian.apply(targets);
        let mut triplets: Vec<Triplet<usize, usize, f64>> =
            (0..n).map(|i| Triplet::new(i, i, TINY)).collect();
        let mut right = Mat::<f64>::zeros(n, 3);
        for (operator, weight, wanted) in [
            (&limit, 1.0, targets),
            (&self.laplacian, DAMPING, &bent[..]),
        ] {
            for (r, target) in wanted.iter().enumerate() {
                let (points, weights) = operator.row(r);
                for (i, (&p, &wp)) in points.iter().zip(weights).enumerate() {
                    for (&q, &wq) in points[i..].iter().zip(&weights[i..]) {
                        triplets.push(Triplet::new(q as usize, p as usize, weight * wp * wq));
                    }
                    for a in 0..3 {
                        right[(p as usize, a)] += weight * wp * target[a];
                    }
                }
            }
        }
        let solver = |reason: String| FitError::Solver { round: 0, reason };
        let matrix = SparseColMat::try_new_from_triplets(n, n, &triplets)
            .map_err(|e| solver(format!("{e:?}")))?;
        let llt = matrix
            .sp_cholesky(Side::Lower)
            .map_err(|e| solver(format!("{e:?}")))?;
        llt.solve_in_place(&mut right);
        Ok((0..n)
            .map(|i| Vec3::new(right[(i, 0)], right[(i, 1)], right[(i, 2)]))
            .collect())
    }

    /// Area-weighted unit normals of the samples and the area that each stands for.
    pub fn normals_and_areas(&self, at: &[Vec3]) -> (Vec<Vec3>, Vec<f64>) {
        let mut normals = vec![Vec3::zeros(); at.len()];
        let mut areas = vec![0.0; at.len()];
        for quad in &self.fine.quads {
            let [a, b, c, d] = quad.map(|v| at[v as usize]);
            let normal = (c - a).cross(&(d - b)) / 2.0;
            let area = normal.norm() / 4.0;
            for v in quad {
                normals[*v as usize] += normal;
                areas[*v as usize] += area;
            }
        }
        let unit = |n: Vec3| n.try_normalize(1e-12).unwrap_or_else(Vec3::zeros);
        (normals.into_iter().map(unit).collect(), areas)
    }

    /// Triangles of the limit surface over the given samples.
    pub fn triangle_mesh(&self, samples: Vec<Vec3>) -> TriMesh {
        TriMesh {
            points: samples,
            triangles: self.triangles.clone(),
            tags: Vec::new(),
        }
    }

    /// Volume inside the limit surface, mm3: triangles after two and three splits, extrapolated (the
    /// error of inscribed triangles falls by four with every split).
    pub fn volume(&self, points: &[Vec3]) -> f64 {
        let coarse = self.triangle_mesh(self.samples.apply(points)).volume();
        let (triangles, points) = (self.finer.1.clone(), self.finer.0.apply(points));
        let fine = TriMesh {
            points,
            triangles,
            tags: Vec::new(),
        }
        .volume();
        (fine + (fine - coarse) / 3.0) * self.spacing.powi(3)
    }

    /// How the volume changes with the control points, voxels: three numbers a point.
    pub fn volume_gradient(&self, normals: &[Vec3], areas: &[f64]) -> Vec<f64> {
        let mut gradient = vec![0.0; 3 * self.coarse.point_count];
        for (j, (normal, area)) in normals.iter().zip(areas).enumerate() {
            let (points, weights) = self.samples.row(j);
            for (&p, &w) in points.iter().zip(weights) {
                for a in 0..3 {
                    gradient[3 * p as usize + a] += w * area * normal[a];
                }
            }
        }
        gradient
    }

    /// A position in mm.
    pub fn to_mm(&self, p: &Vec3) -> Vec3 {
        self.origin + self.spacing * p
    }

    /// The control mesh in mm.
    pub fn control_mesh(&self, points: &[Vec3]) -> ControlMesh {
        ControlMesh {
            points: points.iter().map(|p| self.to_mm(p)).collect(),
            quads: self.coarse.quads.clone(),
        }
    }
}
