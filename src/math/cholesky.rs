//! Cholesky factorisation and inverse in blocks, so that nearly all arithmetic is products of matrices that stay in the cache.

use nalgebra::{Cholesky, DMatrix, Dyn};

/// Columns of a block: a square one takes 18 KiB, which fits into the first-level cache.
const BLOCK: usize = 48;

/// The factorisation of a symmetric matrix, of which only the lower triangle is read; `None` unless it is positive definite.
pub fn factor(mut matrix: DMatrix<f64>) -> Option<Cholesky<f64, Dyn>> {
    let n = matrix.nrows();
    for first in (0..n).step_by(BLOCK) {
        let count = BLOCK.min(n - first);
        let (done, mut block) = matrix.columns_range_pair_mut(0..first, first..first + count);
        // Subtract what the finished columns contribute.
        if first > 0 {
            let left = done.rows(first, n - first);
            let top = done.rows(first, count).transpose();
            block
                .rows_mut(first, n - first)
                .gemm(-1.0, &left, &top, 1.0);
        }
        // Factor the block's own columns one by one.
        for j in 0..count {
            let (before, mut rest) = block.columns_range_pair_mut(0..j, j..j + 1);
            let mut rest = rest.rows_mut(first + j, n - first - j);
            let mut column = rest.column_mut(0);
            for (p, other) in before.column_iter().enumerate() {
                let factor = before[(first + j, p)];
                column.axpy(-factor, &other.rows(first + j, n - first - j), 1.0);
            }
            let pivot = column[0];
            if !(pivot > 0.0 && pivot.is_finite()) {
                return None;
            }
            column /= pivot.sqrt();
        }
    }
    Some(Cholesky::pack_dirty(matrix))
}

/// The inverse of a factored matrix, (L⁻¹)ᵀ L⁻¹.
pub fn inverse(factored: &Cholesky<f64, Dyn>) -> DMatrix<f64> {
    let lower = factored.l_dirty();
    let n = lower.nrows();
    let mut inverse_lower = DMatrix::<f64>::zeros(n, n);
    for first in (0..n).step_by(BLOCK) {
        let count = BLOCK.min(n - first);
        // Rows of L⁻¹ from those above them; columns to the right of the diagonal stay zero.
        let above = inverse_lower.view((0, 0), (first, first)).clone_owned();
        let mut rows = inverse_lower.view_mut((first, 0), (count, first + count));
        if first > 0 {
            let left = lower.view((first, 0), (count, first));
            rows.columns_mut(0, first).gemm(-1.0, &left, &above, 0.0);
        }
        rows.columns_mut(first, count).fill_with_identity();
        let diagonal = lower.view((first, first), (count, count));
        diagonal.solve_lower_triangular_unchecked_mut(&mut rows);
    }
    let mut inverse = DMatrix::zeros(n, n);
    for first in (0..n).step_by(BLOCK) {
        let count = BLOCK.min(n - first);
        // Rows above a block's first are zero in its columns.
        let right = inverse_lower.view((first, first), (n - first, count));
        let left = inverse_lower.view((first, 0), (n - first, first + count));
        let product = left.tr_mul(&right);
        inverse
            .view_mut((0, first), (first + count, count))
            .copy_from(&product);
    }
    inverse.fill_lower_triangle_with_upper_triangle();
    inverse
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Stream;

    fn definite(n: usize) -> DMatrix<f64> {
        let mut stream = Stream::new(n as u64, 0, 0, 0);
        let root = DMatrix::from_fn(n, n, |_, _| f64::from(stream.uniform()) - 0.5);
        &root * root.transpose() + DMatrix::identity(n, n) * 0.1
    }

    #[test]
    fn factors_and_inverses_agree_with_unblocked_ones() {
        for n in [1, 2, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK + 7] {
            let matrix = definite(n);
            // The upper triangle is not read.
            let mut lower = matrix.clone();
            lower.fill_upper_triangle(f64::NAN, 1);
            let factored = factor(lower).expect("positive definite");
            let reference = Cholesky::new(matrix.clone()).expect("positive definite");
            assert!((factored.l() - reference.l()).amax() < 1e-10, "{n}");
            let identity = inverse(&factored) * matrix;
            assert!((identity - DMatrix::identity(n, n)).amax() < 1e-9, "{n}");
        }
    }

    #[test]
    fn indefinite_matrices_are_refused_wherever_the_fault_lies() {
        let n = 2 * BLOCK + 5;
        for at in [0, BLOCK, n - 1] {
            let mut matrix = definite(n);
            matrix[(at, at)] = -1.0;
            assert!(factor(matrix).is_none(), "{at}");
        }
        assert!(factor(DMatrix::from_element(2, 2, f64::NAN)).is_none());
    }
}
