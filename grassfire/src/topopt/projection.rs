//! Projection toward 0 and 1 that keeps the volume.
//!
//! F. Wang, B. S. Lazarov, O. Sigmund: On projection methods, convergence and robust formulations in topology
//! optimization, 2011, doi:10.1007/s00158-010-0602-y.

/// `H = (tanh(b eta) + tanh(b (x - eta))) / (tanh(b eta) + tanh(b (1 - eta)))`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Projection {
    /// Sharpness.
    pub beta: f64,
    /// Where 0.5 lies, about.
    pub eta: f64,
}

impl Projection {
    /// The largest threshold after a shift.
    pub const LAST: f64 = 0.95;

    /// With a threshold that is larger by `erosion`: everything becomes thinner by about the same.
    pub fn shifted(self, erosion: f64) -> Self {
        if erosion == 0.0 {
            return self;
        }
        Self {
            eta: (self.eta + erosion).min(Self::LAST),
            ..self
        }
    }

    /// The threshold that keeps the sum of `x`, by bisection.
    pub fn keeping_volume(beta: f64, x: &[f64]) -> Self {
        let goal: f64 = x.iter().sum();
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..50 {
            let eta = 0.5 * (low + high);
            let p = Self { beta, eta };
            if x.iter().map(|&v| p.value(v)).sum::<f64>() > goal {
                low = eta;
            } else {
                high = eta;
            }
        }
        Self {
            beta,
            eta: 0.5 * (low + high),
        }
    }

    fn range(&self) -> f64 {
        (self.beta * self.eta).tanh() + (self.beta * (1.0 - self.eta)).tanh()
    }

    pub fn value(&self, x: f64) -> f64 {
        ((self.beta * self.eta).tanh() + (self.beta * (x - self.eta)).tanh()) / self.range()
    }

    /// Derivative by x.
    pub fn slope(&self, x: f64) -> f64 {
        let t = (self.beta * (x - self.eta)).tanh();
        self.beta * (1.0 - t * t) / self.range()
    }

    /// Derivative by eta.
    pub fn by_eta(&self, x: f64) -> f64 {
        let slope = |v: f64| {
            let t = (self.beta * v).tanh();
            self.beta * (1.0 - t * t)
        };
        let top = (self.beta * self.eta).tanh() + (self.beta * (x - self.eta)).tanh();
        let range = self.range();
        let of_top = slope(self.eta) - slope(x - self.eta);
        let of_range = slope(self.eta) - slope(1.0 - self.eta);
        (of_top * range - top * of_range) / (range * range)
    }
}
