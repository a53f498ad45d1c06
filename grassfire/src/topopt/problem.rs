//! What is optimized: voxels with labels, supports and load cases.

use nalgebra::Matrix3;

use crate::Vec3;
use crate::fe::VoxelModel;

/// Not part of the space.
pub const OUTSIDE: u8 = 0;
/// May be full or empty.
pub const DESIGN: u8 = 1;
/// Stays full.
pub const FROZEN: u8 = 2;
/// Not part of the space, and made by a core: it may lie in the shadow of material.
pub const CORE: u8 = 3;

/// One load case.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LoadCase {
    /// Name.
    pub name: String,
    /// Weight in the objective.
    pub weight: f64,
    /// Forces on nodes, N.
    pub forces: Vec<([usize; 3], [f64; 3])>,
    /// Force on a volume of full material, N/mm3.
    pub body_force: [f64; 3],
}

/// A voxel problem.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Problem {
    /// Lower corner of voxel (0, 0, 0), mm.
    pub origin: Vec3,
    /// Edge of a voxel, mm.
    pub h: f64,
    /// Voxels along x, y, z.
    pub dims: [usize; 3],
    /// One label a voxel, `[z][y][x]`.
    pub labels: Vec<u8>,
    /// Young's modulus, MPa.
    pub young: f64,
    /// Poisson's ratio.
    pub nu: f64,
    /// Fixed degrees of freedom: node and component.
    pub fixed: Vec<([usize; 3], usize)>,
    /// Springs between nodes and the ground, N/mm.
    pub springs: Vec<([usize; 3], Matrix3<f64>)>,
    /// Load cases.
    pub cases: Vec<LoadCase>,
}

impl Problem {
    /// Voxels that are design or frozen.
    pub fn is_active(&self, voxel: usize) -> bool {
        matches!(self.labels[voxel], DESIGN | FROZEN)
    }

    /// The voxels that may be full or empty, ascending.
    pub fn design(&self) -> impl Iterator<Item = usize> + '_ {
        let labels = self.labels.iter().enumerate();
        labels.filter(|(_, l)| **l == DESIGN).map(|(v, _)| v)
    }

    /// Values of the design voxels on the whole grid: `frozen` in frozen voxels, 0 outside.
    pub fn on_grid(&self, design: &[f64], frozen: f64) -> Vec<f64> {
        let mut design = design.iter();
        let value = |&label: &u8| match label {
            DESIGN => design.next().copied().unwrap_or_default(),
            FROZEN => frozen,
            _ => 0.0,
        };
        self.labels.iter().map(value).collect()
    }

    /// The values of a field of the whole grid in design voxels.
    pub fn at_design(&self, field: &[f64]) -> Vec<f64> {
        self.design().map(|v| field[v]).collect()
    }

    /// Number of voxels with a label.
    pub fn count(&self, label: u8) -> usize {
        self.labels.iter().filter(|&&l| l == label).count()
    }

    /// (x, y, z) of a voxel.
    pub fn at(&self, voxel: usize) -> [usize; 3] {
        let [nx, ny, _] = self.dims;
        [voxel % nx, voxel / nx % ny, voxel / (nx * ny)]
    }

    /// Index of a voxel.
    pub fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.dims[1] + y) * self.dims[0] + x
    }

    /// Centre of a voxel, mm.
    pub fn centre(&self, voxel: usize) -> Vec3 {
        let [x, y, z] = self.at(voxel);
        self.origin + self.h * Vec3::new(x as f64 + 0.5, y as f64 + 0.5, z as f64 + 0.5)
    }

    /// The same labels with every voxel cut into `split` along each axis; without supports and loads.
    pub fn cut(&self, split: usize) -> Self {
        let dims = self.dims.map(|n| n * split);
        let mut out = Self {
            h: self.h / split as f64,
            dims,
            labels: Vec::new(),
            fixed: Vec::new(),
            springs: Vec::new(),
            cases: Vec::new(),
            ..*self
        };
        let label = |v: usize| self.labels[self.index(out.at(v).map(|i| i / split))];
        out.labels = (0..dims.iter().product()).map(label).collect();
        out
    }

    /// (x, y, z) of a node, counted in the order `[z][y][x]`.
    pub fn at_node(&self, node: usize) -> [usize; 3] {
        let [nx, ny, _] = self.dims.map(|n| n + 1);
        [node % nx, node / nx % ny, node / (nx * ny)]
    }

    /// Position of a node, mm.
    pub fn node(&self, [x, y, z]: [usize; 3]) -> Vec3 {
        self.origin + self.h * Vec3::new(x as f64, y as f64, z as f64)
    }

    /// Whether the mass of the design is a load.
    pub fn has_body_force(&self) -> bool {
        self.cases.iter().any(|case| case.body_force != [0.0; 3])
    }

    /// The model of the solver.
    pub fn model(&self) -> VoxelModel {
        VoxelModel {
            dims: self.dims,
            h: self.h,
            nu: self.nu,
            fixed: self.fixed.clone(),
            springs: self.springs.clone(),
            loads: self.cases.iter().map(|case| case.forces.clone()).collect(),
            body_forces: self.cases.iter().map(|case| case.body_force).collect(),
        }
    }
}
