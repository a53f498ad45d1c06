//! Insertion order for incremental constructions: biased randomised rounds, each along a Hilbert curve.
//!
//! N. Amenta, S. Choi, G. Rote, "Incremental constructions con BRIO", SoCG 2003,
//! <https://doi.org/10.1145/777792.777824>; J. Skilling, "Programming the Hilbert curve", AIP
//! Conference Proceedings 707 (2004), <https://doi.org/10.1063/1.1751381>.

use rayon::prelude::*;

use super::predicates::Point;

const BITS: u32 = 20;

/// Indices of `points` in insertion order. Always the same for the same points.
///
/// 1. A point enters the last round with probability 3/4, the one before with 3/16, and so on.
/// 2. Rounds are sorted along a Hilbert curve over the box of all points.
pub(super) fn insertion_order(points: &[Point]) -> Vec<u32> {
    let (low, scale) = frame(points);
    let rounds = ((points.len() as f64 / 500.0).max(1.0).ln() / 4f64.ln()) as u64;
    let mut keys: Vec<(u64, u32)> = points
        .par_iter()
        .enumerate()
        .map(|(index, p)| {
            let cell = std::array::from_fn(|k| ((p[k] - low[k]) * scale) as u32);
            let round = rounds.min(7) - round_from_last(index as u64).min(rounds.min(7));
            ((round << (3 * BITS)) | hilbert(cell), index as u32)
        })
        .collect();
    keys.par_sort_unstable();
    keys.into_iter().map(|key| key.1).collect()
}

fn frame(points: &[Point]) -> (Point, f64) {
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for p in points {
        for k in 0..3 {
            low[k] = low[k].min(p[k]);
            high[k] = high[k].max(p[k]);
        }
    }
    let longest = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
    let cells = f64::from((1u32 << BITS) - 1);
    (low, if longest > 0.0 { cells / longest } else { 0.0 })
}

/// How many pairs of zero bits a hash of `index` starts with: 0 with probability 3/4.
fn round_from_last(index: u64) -> u64 {
    let mut x = index.wrapping_add(0x9E37_79B9_7F4A_7C15);
    x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    u64::from((x ^ (x >> 31)).trailing_zeros() / 2)
}

/// Position of a cell along the Hilbert curve of a 2^20 cube.
fn hilbert(mut x: [u32; 3]) -> u64 {
    let top = 1u32 << (BITS - 1);
    let mut q = top;
    while q > 1 {
        let low = q - 1;
        for i in 0..3 {
            if x[i] & q != 0 {
                x[0] ^= low;
            } else {
                let t = (x[0] ^ x[i]) & low;
                x[0] ^= t;
                x[i] ^= t;
            }
        }
        q >>= 1;
    }
    x[1] ^= x[0];
    x[2] ^= x[1];
    let mut t = 0;
    q = top;
    while q > 1 {
        if x[2] & q != 0 {
            t ^= q - 1;
        }
        q >>= 1;
    }
    x.iter_mut().for_each(|v| *v ^= t);
    (0..BITS).rev().fold(0, |h, bit| {
        x.iter().fold(h, |h, v| h << 1 | u64::from(v >> bit & 1))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn order_is_a_permutation() {
        let points: Vec<Point> = (0..3000)
            .map(|i| [f64::from(i % 17), f64::from(i % 13), f64::from(i % 7)])
            .collect();
        let mut order = insertion_order(&points);
        order.sort_unstable();
        assert!(order.iter().enumerate().all(|(i, &o)| i as u32 == o));
    }

    #[test]
    fn neighbours_on_the_curve_are_neighbours_in_space() {
        let mut cells: Vec<[u32; 3]> = Vec::new();
        for i in 0..512u32 {
            cells.push([i & 7, i >> 3 & 7, i >> 6]);
        }
        let unit = 1 << (BITS - 3);
        cells.sort_by_key(|c| hilbert(c.map(|v| v * unit)));
        for pair in cells.windows(2) {
            let step: u32 = (0..3).map(|k| pair[0][k].abs_diff(pair[1][k])).sum();
            assert_eq!(step, 1);
        }
    }
}
