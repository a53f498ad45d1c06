//! The element matrix of a cube in even and odd parts: 24 x 24 numbers become eight blocks of 3 x 3.
//!
//! A cube of an isotropic material is its own mirror image about each of its three middle planes. Fields that are even or
//! odd about each of them therefore do not mix: of the 576 products of an element 72 are left, between sums and differences
//! of its corners (the Walsh-Hadamard transform of each component).

/// The blocks of an element matrix: `[parity about x][parity about y + 2 parity about z][row][column]`, row and column a
/// component.
///
/// A mirror turns the component along its normal round. So where the field has parity p, component c is the transform of
/// order `p ^ (1 << c)`: bit d of the order is 1 for the difference of the two sides along d (lower minus upper).
pub(super) type Blocks<T> = [[[[T; 3]; 3]; 4]; 2];

/// Blocks of an element matrix with rows and columns `3 * corner + component`; the forces are the transforms of the
/// blocks' results, without a factor.
pub(super) fn blocks(k: &[[f64; 24]; 24]) -> Blocks<f64> {
    let sign =
        |order: usize, corner: usize| f64::from(1 - 2 * ((order & corner).count_ones() as i8 & 1));
    let entry = |parity: usize, r: usize, c: usize| {
        let (left, right) = (parity ^ (1 << r), parity ^ (1 << c));
        let pairs = (0..8).flat_map(|a| (0..8).map(move |b| (a, b)));
        pairs
            .map(|(a, b)| sign(left, a) * k[3 * a + r][3 * b + c] * sign(right, b))
            .sum::<f64>()
            / 64.0
    };
    std::array::from_fn(|x| {
        std::array::from_fn(|yz| {
            std::array::from_fn(|r| std::array::from_fn(|c| entry(x | yz << 1, r, c)))
        })
    })
}

#[cfg(test)]
mod tests {
    use super::super::element;
    use super::*;

    #[test]
    fn blocks_make_the_forces_of_the_whole_matrix() {
        let k = element::stiffness(0.27);
        let blocks = blocks(&k);
        let u: [f64; 24] = std::array::from_fn(|i| ((7 * i * i + 3 * i) % 31) as f64 / 31.0);
        let sign = |order: usize, corner: usize| {
            if (order & corner).count_ones() % 2 == 1 {
                -1.0
            } else {
                1.0
            }
        };
        let mut f = [0.0; 24];
        for parity in 0..8 {
            for r in 0..3 {
                let force: f64 = (0..3)
                    .map(|c| {
                        let order = parity ^ (1 << c);
                        let sum: f64 = (0..8).map(|a| sign(order, a) * u[3 * a + c]).sum();
                        blocks[parity & 1][parity >> 1][r][c] * sum
                    })
                    .sum();
                for a in 0..8 {
                    f[3 * a + r] += sign(parity ^ (1 << r), a) * force;
                }
            }
        }
        for (i, f) in f.iter().enumerate() {
            let whole: f64 = (0..24).map(|j| k[i][j] * u[j]).sum();
            assert!((f - whole).abs() < 1e-15, "{i}: {f} {whole}");
        }
    }
}
