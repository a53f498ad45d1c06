//! Exact orientation and in-sphere tests for points with float or small integer coordinates.
//!
//! J. R. Shewchuk, "Adaptive precision floating-point arithmetic and fast robust geometric
//! predicates", Discrete & Computational Geometry 18 (1997), <https://doi.org/10.1007/PL00009321>.

/// A point as the triangulation stores it.
pub(super) type Point = [f64; 3];

/// Signs of the two determinants; only the sign of a result is meaningful.
pub(super) trait Kernel: Copy {
    /// Positive when `a`, `b`, `c` turn counter-clockwise seen from the side that `d` is not on.
    fn orient(self, a: &Point, b: &Point, c: &Point, d: &Point) -> f64;
    /// Positive when `e` lies inside the sphere through `a`, `b`, `c`, `d` and `orient` of these is positive.
    fn insphere(self, a: &Point, b: &Point, c: &Point, d: &Point, e: &Point) -> f64;
}

/// Any finite coordinates: filtered, then exact by expansions.
#[derive(Clone, Copy)]
pub(super) struct FloatKernel;

/// Integer coordinates whose differences stay within [`SmallLatticeKernel::REACH`]: plain f64 is exact.
#[derive(Clone, Copy)]
pub(super) struct SmallLatticeKernel;

/// Integer coordinates whose differences stay within [`LatticeKernel::REACH`]: f64 where exact, else i128.
#[derive(Clone, Copy)]
pub(super) struct LatticeKernel;

impl SmallLatticeKernel {
    /// The in-sphere determinant is at most 72 m^5 for differences of m: below 2^53 up to 660.
    pub(super) const REACH: f64 = 600.0;
}

impl LatticeKernel {
    /// The orientation determinant is at most 6 m^3 for differences of m: below 2^53 up to 114 000.
    pub(super) const REACH: f64 = 100_000.0;
}

#[inline(always)]
fn minus(a: &Point, b: &Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn orient_determinant(a: &Point, b: &Point, c: &Point) -> f64 {
    a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
}

#[inline(always)]
fn insphere_determinant(a: &Point, b: &Point, c: &Point, d: &Point) -> f64 {
    let minor = |p: &Point, q: &Point| p[0] * q[1] - q[0] * p[1];
    let (ab, bc, cd, da, ac, bd) = (
        minor(a, b),
        minor(b, c),
        minor(c, d),
        minor(d, a),
        minor(a, c),
        minor(b, d),
    );
    let abc = a[2] * bc - b[2] * ac + c[2] * ab;
    let bcd = b[2] * cd - c[2] * bd + d[2] * bc;
    let cda = c[2] * da + d[2] * ac + a[2] * cd;
    let dab = d[2] * ab + a[2] * bd + b[2] * da;
    let lift = |p: &Point| p[0] * p[0] + p[1] * p[1] + p[2] * p[2];
    (lift(d) * abc - lift(c) * dab) + (lift(b) * cda - lift(a) * bcd)
}

#[inline(always)]
fn coordinate(p: &Point) -> robust::Coord3D<f64> {
    robust::Coord3D {
        x: p[0],
        y: p[1],
        z: p[2],
    }
}

impl Kernel for FloatKernel {
    #[inline(always)]
    fn orient(self, a: &Point, b: &Point, c: &Point, d: &Point) -> f64 {
        let (u, v, w) = (minus(a, d), minus(b, d), minus(c, d));
        let determinant = orient_determinant(&u, &v, &w);
        let reach = |k: usize| u[k].abs().max(v[k].abs()).max(w[k].abs());
        let error = 5.2e-15 * reach(0) * reach(1) * reach(2);
        if determinant > error || determinant < -error {
            return determinant;
        }
        robust::orient3d(coordinate(a), coordinate(b), coordinate(c), coordinate(d))
    }

    #[inline(always)]
    fn insphere(self, a: &Point, b: &Point, c: &Point, d: &Point, e: &Point) -> f64 {
        let (s, t, u, v) = (minus(a, e), minus(b, e), minus(c, e), minus(d, e));
        let determinant = insphere_determinant(&s, &t, &u, &v);
        let reach = |k: usize| s[k].abs().max(t[k].abs()).max(u[k].abs().max(v[k].abs()));
        let (x, y, z) = (reach(0), reach(1), reach(2));
        let longest = x.max(y).max(z);
        let error = 1.3e-13 * x * y * z * (longest * longest);
        if determinant > error || determinant < -error {
            return determinant;
        }
        robust::insphere(
            coordinate(a),
            coordinate(b),
            coordinate(c),
            coordinate(d),
            coordinate(e),
        )
    }
}

impl Kernel for SmallLatticeKernel {
    #[inline(always)]
    fn orient(self, a: &Point, b: &Point, c: &Point, d: &Point) -> f64 {
        orient_determinant(&minus(a, d), &minus(b, d), &minus(c, d))
    }

    #[inline(always)]
    fn insphere(self, a: &Point, b: &Point, c: &Point, d: &Point, e: &Point) -> f64 {
        insphere_determinant(&minus(a, e), &minus(b, e), &minus(c, e), &minus(d, e))
    }
}

impl Kernel for LatticeKernel {
    #[inline(always)]
    fn orient(self, a: &Point, b: &Point, c: &Point, d: &Point) -> f64 {
        SmallLatticeKernel.orient(a, b, c, d)
    }

    #[inline(always)]
    fn insphere(self, a: &Point, b: &Point, c: &Point, d: &Point, e: &Point) -> f64 {
        let rows = [minus(a, e), minus(b, e), minus(c, e), minus(d, e)];
        let longest = rows.iter().flatten().fold(0.0_f64, |m, x| m.max(x.abs()));
        if longest <= SmallLatticeKernel::REACH {
            return insphere_determinant(&rows[0], &rows[1], &rows[2], &rows[3]);
        }
        insphere_integer(&rows)
    }
}

/// The in-sphere determinant in integers; only its sign is returned.
#[cold]
fn insphere_integer(rows: &[Point; 4]) -> f64 {
    let [a, b, c, d] = rows.map(|p| p.map(|x| x as i128));
    let minor = |p: &[i128; 3], q: &[i128; 3]| p[0] * q[1] - q[0] * p[1];
    let (ab, bc, cd, da, ac, bd) = (
        minor(&a, &b),
        minor(&b, &c),
        minor(&c, &d),
        minor(&d, &a),
        minor(&a, &c),
        minor(&b, &d),
    );
    let abc = a[2] * bc - b[2] * ac + c[2] * ab;
    let bcd = b[2] * cd - c[2] * bd + d[2] * bc;
    let cda = c[2] * da + d[2] * ac + a[2] * cd;
    let dab = d[2] * ab + a[2] * bd + b[2] * da;
    let lift = |p: &[i128; 3]| p[0] * p[0] + p[1] * p[1] + p[2] * p[2];
    let determinant = lift(&d) * abc - lift(&c) * dab + lift(&b) * cda - lift(&a) * bcd;
    determinant.signum() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    const CUBE: [Point; 4] = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
    ];

    #[test]
    fn kernels_agree_on_the_unit_corner() {
        // a, b swapped so that the orientation is positive in this sign convention.
        let [b, a, c, d] = CUBE;
        assert!(FloatKernel.orient(&a, &b, &c, &d) > 0.0);
        for (e, sign) in [
            ([1.0, 1.0, 1.0], 0.0),
            ([2.0, 1.0, 1.0], -1.0),
            ([0.25, 0.25, 0.25], 1.0),
        ] {
            for value in [
                FloatKernel.insphere(&a, &b, &c, &d, &e),
                SmallLatticeKernel.insphere(&a, &b, &c, &d, &e),
                LatticeKernel.insphere(&a, &b, &c, &d, &e),
            ] {
                assert_eq!(if value == 0.0 { 0.0 } else { value.signum() }, sign);
            }
        }
    }

    #[test]
    fn far_lattice_points_are_exact() {
        let s = 90_000.0;
        let [b, a, c, d] = CUBE.map(|p| p.map(|x| x * s));
        assert_eq!(LatticeKernel.insphere(&a, &b, &c, &d, &[s, s, s]), 0.0);
        assert_eq!(
            LatticeKernel.insphere(&a, &b, &c, &d, &[s, s, s - 1.0]),
            1.0
        );
        assert_eq!(
            LatticeKernel.insphere(&a, &b, &c, &d, &[s, s, s + 1.0]),
            -1.0
        );
    }
}
