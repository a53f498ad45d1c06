//! Sparse Cholesky factors of coarse matrices.

use faer::Side;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{SparseColMat, Triplet};

/// Added to the diagonal, relative: where most of a coarse element is fixed, its matrix is singular.
const SHIFT: f64 = 1e-9;

/// Factors the symmetric matrix with these entries on and below the diagonal, which may repeat. The symbolic factor of a matrix of
/// the same pattern is used again.
///
/// # Errors
/// What the factorization said.
pub(crate) fn cholesky(
    size: usize,
    mut triplets: Vec<Triplet<usize, usize, f64>>,
    symbolic: Option<SymbolicLlt<usize>>,
) -> Result<(SymbolicLlt<usize>, Llt<usize, f64>), String> {
    let mut diagonal = vec![0.0; size];
    for entry in triplets.iter().filter(|t| t.row == t.col) {
        diagonal[entry.row] += entry.val;
    }
    let largest = diagonal.iter().fold(0.0, |m: f64, &v| m.max(v));
    for (i, &d) in diagonal.iter().enumerate() {
        // A degree of freedom without stiffness stays where it is.
        let add = if d <= 1e-14 * largest {
            largest
        } else {
            SHIFT * d
        };
        triplets.push(Triplet::new(i, i, add));
    }
    let matrix = SparseColMat::<usize, f64>::try_new_from_triplets(size, size, &triplets)
        .map_err(|e| format!("{e:?}"))?;
    let symbolic = match symbolic {
        Some(symbolic) => symbolic,
        None => {
            SymbolicLlt::try_new(matrix.symbolic(), Side::Lower).map_err(|e| format!("{e:?}"))?
        }
    };
    let factor = Llt::try_new_with_symbolic(symbolic.clone(), matrix.as_ref(), Side::Lower)
        .map_err(|e| format!("{e:?}"))?;
    Ok((symbolic, factor))
}
