//! Options of the optimizer.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::TopoptError;

/// What is made small.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Objective {
    /// The weighted sum of the compliances.
    #[default]
    Weighted,
    /// The worst weighted compliance (p-norm).
    Worst,
}

/// How densities are blurred.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FilterKind {
    /// Weights that fall linearly to zero at the radius.
    #[default]
    Cone,
    /// The Helmholtz equation; for large radii.
    Helmholtz,
}

/// What the cone filter sees beyond the design space.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Boundary {
    /// Nothing: the weights inside are scaled up to one.
    #[default]
    Renormalise,
    /// The mirrored densities at the borders of the grid.
    Reflect,
}

/// How the variables are updated.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum UpdateKind {
    /// The method of moving asymptotes.
    #[default]
    Mma,
    /// Optimality criteria: faster, for plain compliance without draw.
    Oc,
}

/// Where the two halves of a mould meet.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Parting {
    /// A mould from one side: it leaves along the direction.
    OneSided,
    /// Two halves that meet in the plane `at`.
    #[default]
    Plane,
    /// Two halves whose parting surface is found.
    Free,
}

/// Demoulding.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DrawOptions {
    /// Direction in which the (upper) mould leaves; along x, y or z.
    pub dir: [f64; 3],
    /// Kind of mould.
    #[serde(default)]
    pub parting: Parting,
    /// Coordinate of the parting plane along the axis, mm.
    #[serde(default)]
    pub at: f64,
}

/// A plane through two axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs, reason = "the two axes in the plane")]
pub enum Plane {
    Xy,
    Xz,
    Yz,
}

/// A plane of symmetry of the design; loads need not be symmetric.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SymmetryPlane {
    /// Axes in the plane.
    pub plane: Plane,
    /// Coordinate along the third axis, mm.
    #[serde(default)]
    pub at: f64,
}

impl SymmetryPlane {
    /// The axis across the plane.
    pub fn axis(&self) -> usize {
        match self.plane {
            Plane::Yz => 0,
            Plane::Xz => 1,
            Plane::Xy => 2,
        }
    }
}

/// Options of [`super::optimize`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct OptimizeOptions {
    /// Bound on the volume, as a share of the design space with its non-design bodies.
    pub volume_fraction: f64,
    /// Iterations at most.
    pub max_iterations: usize,
    /// What is made small.
    pub objective: Objective,
    /// Kind of density filter.
    pub filter: FilterKind,
    /// Filter radius, mm. Default 3 voxels.
    pub filter_radius: Option<f64>,
    /// Borders of the cone filter.
    pub boundary: Boundary,
    /// Update of the variables.
    pub update: UpdateKind,
    /// Largest change of a variable in one iteration. Default 0.2, with draw 0.1.
    pub move_limit: Option<f64>,
    /// Penalty exponent at the end.
    pub penalty: f64,
    /// Penalty exponent at the start.
    pub penalty_start: f64,
    /// Step of the exponent, and iterations between two steps.
    pub penalty_step: f64,
    /// See `penalty_step`.
    pub penalty_every: usize,
    /// Sharpness of the projection at the end; 0 switches the projection off.
    pub beta: f64,
    /// Robust formulation: the threshold of the projection is larger by this for the densities whose stiffness counts, so
    /// that members hold when they are eroded, and hinges and walls of one voxel do not pay. 0 switches it off; 0.03
    /// makes walls of a few voxels hold together, 0.2 with a filter radius R keeps members thicker than about R.
    pub robust: f64,
    /// Iteration at which the sharpness begins to double.
    pub beta_start: usize,
    /// Iterations between two doublings.
    pub beta_every: usize,
    /// Modulus of empty voxels over that of full ones.
    pub e_min: f64,
    /// Planes of symmetry of the design.
    pub symmetry: Vec<SymmetryPlane>,
    /// Demoulding.
    pub draw: Option<DrawOptions>,
    /// The run ends when the mean change of density and the relative change of compliance stay below these five times.
    pub stop_change: f64,
    /// See `stop_change`.
    pub stop_compliance: f64,
    /// Iterations between two saved states; 0 saves none.
    pub save_every: usize,
}

impl Default for OptimizeOptions {
    fn default() -> Self {
        Self {
            volume_fraction: 0.3,
            max_iterations: 150,
            objective: Objective::default(),
            filter: FilterKind::default(),
            filter_radius: None,
            boundary: Boundary::default(),
            update: UpdateKind::default(),
            move_limit: None,
            penalty: 3.0,
            penalty_start: 1.0,
            penalty_step: 0.25,
            penalty_every: 5,
            beta: 32.0,
            robust: 0.0,
            beta_start: 45,
            beta_every: 15,
            e_min: 1e-6,
            symmetry: Vec::new(),
            draw: None,
            stop_change: 1e-3,
            stop_compliance: 1e-4,
            save_every: 0,
        }
    }
}

impl OptimizeOptions {
    /// Penalty exponent of iteration `i`, from 0.
    pub fn penalty_at(&self, i: usize) -> f64 {
        let steps = (i / self.penalty_every.max(1)) as f64;
        (self.penalty_start + self.penalty_step * steps).min(self.penalty)
    }

    /// Sharpness of the projection of iteration `i`, from 0.
    fn beta_at(&self, i: usize) -> f64 {
        let doublings = match i.checked_sub(self.beta_start) {
            None => 0,
            Some(late) => late / self.beta_every.max(1) + 1,
        };
        2f64.powi(doublings.min(60) as i32).min(self.beta)
    }

    /// Sharpness of the projection of iteration `i`; none where nothing is projected.
    pub fn projects_at(&self, i: usize) -> Option<f64> {
        (self.beta > 0.0).then(|| self.beta_at(i))
    }

    /// Whether penalty and sharpness have reached their ends.
    pub fn is_final(&self, i: usize) -> bool {
        self.penalty_at(i) >= self.penalty && self.beta_at(i) >= self.beta
    }

    /// Radius of the filter in voxels.
    pub fn radius(&self, h: f64) -> f64 {
        self.filter_radius.unwrap_or(3.0 * h) / h
    }

    /// Largest change of a variable.
    pub fn limit(&self) -> f64 {
        let default = if self.draw.is_some() { 0.1 } else { 0.2 };
        self.move_limit.unwrap_or(default)
    }

    /// Refuses values out of range.
    ///
    /// # Errors
    /// [`TopoptError::Option`].
    pub fn check(&self, h: f64) -> Result<(), TopoptError> {
        let ranges: [(&'static str, f64, f64, f64, &'static str); 10] = [
            (
                "volume_fraction",
                self.volume_fraction,
                1e-6,
                1.0,
                "a number above 0 and at most 1",
            ),
            (
                "max_iterations",
                self.max_iterations as f64,
                1.0,
                1e6,
                "1 or more",
            ),
            (
                "filter_radius",
                self.filter_radius.unwrap_or(3.0 * h) / h,
                0.0,
                64.0,
                "at most 64 voxels",
            ),
            ("move_limit", self.limit(), 1e-3, 1.0, "0.001 to 1"),
            ("penalty", self.penalty, 1.0, 10.0, "1 to 10"),
            ("penalty_start", self.penalty_start, 1.0, 10.0, "1 to 10"),
            ("penalty_step", self.penalty_step, 0.0, 10.0, "0 to 10"),
            ("beta", self.beta, 0.0, 512.0, "0 to 512"),
            ("robust", self.robust, 0.0, 0.45, "0 to 0.45"),
            ("e_min", self.e_min, 1e-12, 0.1, "1e-12 to 0.1"),
        ];
        for (name, value, low, high, wanted) in ranges {
            if !(low..=high).contains(&value) {
                return Err(TopoptError::Option {
                    name,
                    value,
                    wanted,
                });
            }
        }
        if self.robust > 0.0 && self.beta == 0.0 {
            return Err(TopoptError::Option {
                name: "robust",
                value: self.robust,
                wanted: "0 where nothing is projected (beta = 0)",
            });
        }
        Ok(())
    }
}
