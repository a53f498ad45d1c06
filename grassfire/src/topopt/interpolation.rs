//! From densities to moduli.

use rayon::prelude::*;

use super::Problem;

/// Share of the modulus that follows the density itself where mass is a load.
const LINEAR: f64 = 1.0 / 16.0;

/// `E(rho) = E (e_min + (1 - e_min) (w rho + (1 - w) rho^p))`.
///
/// Without body forces w is 0: M. P. Bendsoe, O. Sigmund, 1999, doi:10.1007/s004190050248. With them w is 1/16, because thin
/// material would weigh far more than it carries: rho over rho^p has no bound. M. Bruyneel, P. Duysinx, 2005,
/// doi:10.1007/s00158-004-0484-y; the polynomial is that of J. Zhu, W. Zhang, P. Beckers, 2009, doi:10.1002/nme.2499.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Interpolation {
    /// Modulus of full material, MPa.
    young: f64,
    /// Share of it that empty voxels have.
    e_min: f64,
    /// Exponent p.
    penalty: f64,
    /// w.
    linear: f64,
}

impl Interpolation {
    pub fn new(problem: &Problem, e_min: f64, penalty: f64) -> Self {
        Self {
            young: problem.young,
            e_min,
            penalty,
            linear: if problem.has_body_force() {
                LINEAR
            } else {
                0.0
            },
        }
    }

    /// The moduli of densities, MPa.
    pub fn moduli(&self, rho: &[f64]) -> Vec<f64> {
        let value = |rho: &f64| {
            let shape = self.linear * rho + (1.0 - self.linear) * rho.powf(self.penalty);
            self.young * (self.e_min + shape * (1.0 - self.e_min))
        };
        rho.par_iter().map(value).collect()
    }

    /// Derivative of the compliance by a density, but for body forces: minus that of the modulus, times `energy` for modulus 1.
    pub fn gradient(&self, energy: f64, rho: f64) -> f64 {
        let slope = -self.penalty * (1.0 - self.e_min) * self.young;
        let powers = rho.powf(self.penalty - 1.0);
        energy * slope * (self.linear / self.penalty + (1.0 - self.linear) * powers)
    }
}
