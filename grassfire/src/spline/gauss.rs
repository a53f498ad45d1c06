//! Gauss-Legendre quadrature on the unit interval.

use std::sync::LazyLock;

/// Points of the rule; exact for polynomials of degree 15.
pub(super) const POINTS: usize = 8;

/// Abscissae and weights on 0..=1, found by Newton's method on the Legendre polynomial.
pub(super) static RULE: LazyLock<[(f64, f64); POINTS]> = LazyLock::new(|| {
    std::array::from_fn(|k| {
        let n = POINTS as f64;
        let mut x = -(std::f64::consts::PI * (k as f64 + 0.75) / (n + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..20 {
            let (mut before, mut value) = (1.0, x);
            for m in 2..=POINTS {
                let m = m as f64;
                (before, value) = (
                    value,
                    ((2.0 * m - 1.0) * x * value - (m - 1.0) * before) / m,
                );
            }
            slope = n * (before - x * value) / (1.0 - x * x);
            x -= value / slope;
        }
        ((x + 1.0) / 2.0, 1.0 / ((1.0 - x * x) * slope * slope))
    })
});

#[cfg(test)]
mod tests {
    use super::RULE;

    #[test]
    fn integrates_degree_15_exactly() {
        for degree in 0..16 {
            let sum: f64 = RULE.iter().map(|(x, w)| w * x.powi(degree)).sum();
            assert!(
                (sum - 1.0 / (f64::from(degree) + 1.0)).abs() < 1e-15,
                "degree {degree}: {sum}"
            );
        }
    }
}
