//! Springs between nodes and the ground.

use nalgebra::Matrix3;

use super::galerkin::corner;
use super::grid::NodeGrid;
use super::matrix_free::Float;

/// A node that springs hold.
pub(super) struct SpringNode {
    pub at: [usize; 3],
    /// Its places in a node field.
    pub places: [usize; 3],
    /// N/mm; without the fixed components.
    pub stiffness: Matrix3<f64>,
}

/// The nodes that springs hold; of `springs` those of one node add up. `fixed`: places, ascending.
pub(super) fn spring_nodes(
    grid: &NodeGrid,
    fixed: &[usize],
    springs: &[([usize; 3], Matrix3<f64>)],
) -> Vec<SpringNode> {
    let mut sorted: Vec<_> = springs.iter().collect();
    sorted.sort_by_key(|(at, _)| [at[2], at[1], at[0]]);
    let mut out = Vec::new();
    for same in sorted.chunk_by(|a, b| a.0 == b.0) {
        let at = same[0].0;
        let [Some(x), Some(y), Some(z)] = [0, 1, 2].map(|c| grid.node(at, c)) else {
            continue;
        };
        let places = [x, y, z];
        let mut stiffness: Matrix3<f64> = same.iter().map(|(_, s)| s).sum();
        for c in (0..3).filter(|&c| fixed.binary_search(&places[c]).is_ok()) {
            stiffness.row_mut(c).fill(0.0);
            stiffness.column_mut(c).fill(0.0);
        }
        out.push(SpringNode {
            at,
            places,
            stiffness,
        });
    }
    out
}

/// Adds the forces that springs take at displacements `u` to `y`.
pub(super) fn add_forces<T: Float, U: Copy + Into<T>>(
    springs: &[SpringNode],
    u: &[U],
    y: &mut [T],
) {
    for spring in springs {
        for (row, &to) in spring.places.iter().enumerate() {
            let parts = spring.places.iter().enumerate();
            let force: f64 = parts
                .map(|(c, &at)| spring.stiffness[(row, c)] * u[at].into().into())
                .sum();
            y[to] = T::of(y[to].into() + force);
        }
    }
}

/// Springs on a grid `2^level` times as coarse with `n` elements: every one as the matrix of the element that it lies in.
pub(super) fn on_coarse<'a>(
    springs: &'a [SpringNode],
    level: usize,
    n: [usize; 3],
) -> impl Iterator<Item = ([usize; 3], [[f64; 24]; 24])> + 'a {
    let side = 1usize << level;
    springs.iter().map(move |spring| {
        let element: [usize; 3] = std::array::from_fn(|d| (spring.at[d] / side).min(n[d] - 1));
        let t: [f64; 3] =
            std::array::from_fn(|d| (spring.at[d] - element[d] * side) as f64 / side as f64);
        let weight = |a: usize| -> f64 {
            let at = corner([0; 3], a);
            (0..3)
                .map(|d| if at[d] == 1 { t[d] } else { 1.0 - t[d] })
                .product()
        };
        let matrix = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                weight(i / 3) * weight(j / 3) * spring.stiffness[(i % 3, j % 3)]
            })
        });
        (element, matrix)
    })
}
