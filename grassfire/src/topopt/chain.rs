//! From the variables to the densities, and back for gradients.

use super::options::OptimizeOptions;
use super::problem::{FROZEN, OUTSIDE};
use super::projection::Projection;
use super::symmetry::Symmetry;
use super::{Filter, Hull, Problem, TopoptError};

/// Filter, hull, projection.
#[derive(Debug, Clone)]
pub struct Chain<'a> {
    problem: &'a Problem,
    filter: Filter,
    /// Demoulding.
    pub hull: Option<Hull>,
    pub(super) symmetry: Symmetry,
    /// Shift of the threshold for the eroded densities; 0 without.
    erosion: f64,
}

/// The fields of one evaluation, one value a design voxel: spaces fill but a part of their grid.
#[derive(Debug, Clone, Default)]
pub struct Fields {
    /// Filtered; kept with a hull only.
    filtered: Vec<f64>,
    /// After the hull.
    hulled: Vec<f64>,
    projection: Option<Projection>,
}

impl<'a> Chain<'a> {
    /// Checks the planes and prepares the filter.
    ///
    /// # Errors
    /// [`TopoptError::Plane`], [`TopoptError::DrawDirection`], [`TopoptError::FrozenUndercut`].
    pub fn new(problem: &'a Problem, options: &OptimizeOptions) -> Result<Self, TopoptError> {
        let radius = options.radius(problem.h);
        let filter = Filter::new(options.filter, problem, radius, options.boundary);
        let symmetry = Symmetry::new(problem, &options.symmetry)?;
        let chain = Self {
            problem,
            filter,
            hull: Hull::of(problem, options)?,
            symmetry,
            erosion: options.robust,
        };
        chain.check_frozen()?;
        Ok(chain)
    }

    /// Refuses frozen voxels whose shadow holds empty ones that no core makes.
    fn check_frozen(&self) -> Result<(), TopoptError> {
        let Some(hull) = &self.hull else {
            return Ok(());
        };
        let labels = &self.problem.labels;
        let frozen: Vec<f64> = labels
            .iter()
            .map(|&l| f64::from(u8::from(l == FROZEN)))
            .collect();
        let shadow = hull.hard(&frozen);
        let bad: Vec<usize> = (0..labels.len())
            .filter(|&v| labels[v] == OUTSIDE && shadow[v] > 0.5)
            .collect();
        if bad.is_empty() {
            return Ok(());
        }
        let name = |&v: &usize| {
            let (at, c) = (self.problem.at(v), self.problem.centre(v));
            format!("{at:?} at ({:.2}, {:.2}, {:.2})", c.x, c.y, c.z)
        };
        let places: Vec<String> = bad.iter().take(3).map(name).collect();
        Err(TopoptError::FrozenUndercut {
            count: bad.len(),
            places: places.join(", "),
        })
    }

    /// Filters the variables `x`, one a design voxel; without `beta` nothing will be projected.
    pub fn forward(&self, x: &[f64], beta: Option<f64>, fields: &mut Fields) {
        let filtered = self.filter.forward(self.problem, x);
        match &self.hull {
            Some(hull) => {
                let hulled = hull.smooth(&self.problem.on_grid(&filtered, 1.0));
                fields.hulled.clone_from(&self.problem.at_design(&hulled));
                fields.filtered.clone_from(&filtered);
            }
            None => fields.hulled.clone_from(&filtered),
        }
        fields.projection = beta.map(|beta| Projection::keeping_volume(beta, &fields.hulled));
    }

    /// The densities.
    pub fn densities(&self, fields: &Fields) -> Vec<f64> {
        self.projected(fields, fields.projection)
    }

    /// The densities of the thinner structure whose stiffness counts with the robust formulation.
    pub fn eroded(&self, fields: &Fields) -> Option<Vec<f64>> {
        let projection = fields.projection.filter(|_| self.erosion > 0.0)?;
        Some(self.projected(fields, Some(projection.shifted(self.erosion))))
    }

    /// Threshold of the projection; none where nothing was projected.
    pub fn threshold(&self, fields: &Fields) -> Option<f64> {
        fields.projection.map(|p| p.eta)
    }

    /// The field before the projection.
    pub fn unprojected(&self, fields: &Fields) -> Vec<f64> {
        let mut out = fields.hulled.clone();
        self.symmetry.copy(&mut out);
        out
    }

    fn projected(&self, fields: &Fields, projection: Option<Projection>) -> Vec<f64> {
        let value = |&m: &f64| projection.map_or(m, |p| p.value(m)).clamp(0.0, 1.0);
        let mut rho: Vec<f64> = fields.hulled.iter().map(value).collect();
        self.symmetry.copy(&mut rho);
        rho
    }

    /// Gradient by the variables of a function with gradient `g` by the densities whose stiffness counts. The threshold of
    /// the projection follows the variables, which is part of the derivative.
    pub fn gradient(&self, fields: &Fields, mut g: Vec<f64>) -> Vec<f64> {
        if let Some(p) = fields.projection {
            let stiff = p.shifted(self.erosion);
            // At the end of its range the shifted threshold stands still.
            let still = self.erosion > 0.0 && stiff.eta >= Projection::LAST;
            let follows = if still { 0.0 } else { 1.0 };
            let (mut top, mut bottom) = (0.0, 0.0);
            for (g, &m) in g.iter().zip(&fields.hulled) {
                top += g * follows * stiff.by_eta(m);
                bottom += p.by_eta(m);
            }
            let factor = if bottom == 0.0 { 0.0 } else { top / bottom };
            for (g, &m) in g.iter_mut().zip(&fields.hulled) {
                *g = *g * stiff.slope(m) + factor * (1.0 - p.slope(m));
            }
        }
        self.to_variables(fields, g)
    }

    /// Gradient of the volume (in voxels) by the variables; the projection does not change it.
    pub fn volume_gradient(&self, fields: &Fields) -> Vec<f64> {
        self.to_variables(fields, vec![1.0; fields.hulled.len()])
    }

    fn to_variables(&self, fields: &Fields, of_hulled: Vec<f64>) -> Vec<f64> {
        let problem = self.problem;
        let of_filtered = match &self.hull {
            Some(hull) => {
                let filtered = problem.on_grid(&fields.filtered, 1.0);
                let of_hulled = problem.on_grid(&of_hulled, 0.0);
                problem.at_design(&hull.transpose(&filtered, &of_hulled))
            }
            None => of_hulled,
        };
        let mut g = self.filter.transpose(problem, of_filtered);
        self.symmetry.average(&mut g);
        g
    }
}
