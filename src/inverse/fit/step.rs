//! One bounded Gauss–Newton step of one channel, with dense matrices.

use nalgebra::{Cholesky, DMatrix, DVector};

/// One channel's linearised problem with bounds.
pub struct Step<'a> {
    /// Symmetric and positive definite; only the lower triangle is read.
    pub hessian: &'a DMatrix<f64>,
    /// Minus the gradient.
    pub descent: &'a DVector<f64>,
    /// Added to the diagonal of `hessian`.
    pub damping: DVector<f64>,
    /// Lower bounds of x + d.
    pub lower: &'a [f64],
    /// Upper bounds of x + d.
    pub upper: &'a [f64],
}

impl Step<'_> {
    /// Minimises ½ dᵀ(H + D) d − gᵀ d with x + d within the bounds, by an active set; `None` if H + D is indefinite.
    pub fn solve(&self, x: &[f64]) -> Option<DVector<f64>> {
        let n = x.len();
        let mut fixed: Vec<Option<f64>> = vec![None; n];
        let mut step = DVector::zeros(n);
        for _ in 0..2 * n + 2 {
            // Solve for the free parameters, with the others at their bounds.
            let free: Vec<usize> = (0..n).filter(|&i| fixed[i].is_none()).collect();
            for i in 0..n {
                step[i] = fixed[i].map_or(0.0, |bound| bound - x[i]);
            }
            if !free.is_empty() {
                let mut matrix = DMatrix::zeros(free.len(), free.len());
                let mut right = DVector::zeros(free.len());
                for (a, &i) in free.iter().enumerate() {
                    right[a] = self.descent[i];
                    for j in 0..n {
                        if fixed[j].is_some() {
                            right[a] -= self.entry(i, j) * step[j];
                        }
                    }
                    for (b, &j) in free.iter().enumerate() {
                        matrix[(a, b)] = self.entry(i, j);
                    }
                }
                let solution = Cholesky::new(matrix)?.solve(&right);
                for (a, &i) in free.iter().enumerate() {
                    step[i] = solution[a];
                }
            }

            // Hold parameters that left their bounds. If there are none, free the one with the largest inward gradient.
            let mut violated = false;
            for &i in &free {
                let target = x[i] + step[i];
                if target < self.lower[i] || target > self.upper[i] {
                    fixed[i] = Some(target.clamp(self.lower[i], self.upper[i]));
                    violated = true;
                }
            }
            if violated {
                continue;
            }
            let release = (0..n)
                .filter_map(|i| {
                    let bound = fixed[i]?;
                    let slope =
                        self.descent[i] - (0..n).map(|j| self.entry(i, j) * step[j]).sum::<f64>();
                    let inwards = if bound <= self.lower[i] {
                        slope
                    } else {
                        -slope
                    };
                    let scale = (self.entry(i, i)).sqrt();
                    (inwards > 1e-9 * scale).then(|| (i, inwards / scale))
                })
                .max_by(|a, b| a.1.total_cmp(&b.1));
            match release {
                Some((i, _)) => fixed[i] = None,
                None => break,
            }
        }
        Some(step)
    }

    fn entry(&self, i: usize, j: usize) -> f64 {
        let h = if i >= j {
            self.hessian[(i, j)]
        } else {
            self.hessian[(j, i)]
        };
        if i == j { h + self.damping[i] } else { h }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Solves the same problem by projected coordinate descent.
    fn by_projected_gradient(step: &Step, x: &[f64]) -> Vec<f64> {
        let mut d = vec![0.0; x.len()];
        for _ in 0..200_000 {
            for i in 0..x.len() {
                let slope =
                    step.descent[i] - (0..x.len()).map(|j| step.entry(i, j) * d[j]).sum::<f64>();
                d[i] = (x[i] + d[i] + 0.05 * slope).clamp(step.lower[i], step.upper[i]) - x[i];
            }
        }
        d
    }

    #[test]
    fn the_active_set_agrees_with_projected_gradients() {
        let hessian = DMatrix::from_row_slice(
            4,
            4,
            &[
                4.0, 1.0, 0.5, 0.0, 1.0, 3.0, 0.9, 0.2, 0.5, 0.9, 2.0, -0.7, 0.0, 0.2, -0.7, 1.5,
            ],
        );
        for descent in [
            [1.0, -2.0, 3.0, 0.5],
            [-5.0, 4.0, -1.0, 2.0],
            [9.0, 9.0, -9.0, -9.0],
            [0.1, 0.0, 0.0, -0.1],
        ] {
            let step = Step {
                hessian: &hessian,
                descent: &DVector::from_row_slice(&descent),
                damping: DVector::zeros(4),
                lower: &[0.0; 4],
                upper: &[1.0, 1.0, 1.0, f64::INFINITY],
            };
            let x = [0.5, 0.1, 0.9, 0.3];
            let d = step.solve(&x).expect("the matrix is definite");
            for (got, want) in d.iter().zip(by_projected_gradient(&step, &x)) {
                assert!((got - want).abs() < 1e-6, "{d} {want}");
            }
        }
    }

    #[test]
    fn an_indefinite_matrix_is_refused() {
        let step = Step {
            hessian: &DMatrix::from_row_slice(2, 2, &[1.0, 2.0, 2.0, 1.0]),
            descent: &DVector::from_row_slice(&[1.0, 1.0]),
            damping: DVector::zeros(2),
            lower: &[0.0; 2],
            upper: &[1.0; 2],
        };
        assert!(step.solve(&[0.5, 0.5]).is_none());
    }
}
