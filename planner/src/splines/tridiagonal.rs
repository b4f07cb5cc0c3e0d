//! Diagonally dominant tridiagonal systems, plain and cyclic: factored once, solved for one axis after another.

/// A factored tridiagonal matrix; row i is `lower[i] x[i-1] + diagonal[i] x[i] + upper[i] x[i+1]`.
///
/// Elimination runs without pivoting (Thomas' algorithm), which is stable because every row is diagonally
/// dominant (Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., sec. 9.6).
#[derive(Clone, Debug)]
pub(super) struct Tridiagonal {
    lower: Vec<f64>,
    inverse_pivot: Vec<f64>,
    upper: Vec<f64>,
}

/// A cyclic tridiagonal matrix: a plain one and the equal corner entries that close the ring.
#[derive(Clone, Debug)]
pub(super) struct Cyclic {
    plain: Tridiagonal,
    /// Solution of the plain system for the column that the corners add.
    column: Vec<f64>,
    /// corner / gamma.
    ratio: f64,
    /// 1 + v . column.
    denominator: f64,
}

impl Tridiagonal {
    /// Factors the matrix; the three slices have one entry per row, `lower[0]` and the last of `upper` unused.
    pub(super) fn factor(lower: Vec<f64>, diagonal: &[f64], mut upper: Vec<f64>) -> Self {
        let mut inverse_pivot = Vec::with_capacity(diagonal.len());
        let mut carried = 0.0;
        for (i, &d) in diagonal.iter().enumerate() {
            let inverse = 1.0 / (d - if i == 0 { 0.0 } else { lower[i] * carried });
            inverse_pivot.push(inverse);
            upper[i] *= inverse;
            carried = upper[i];
        }
        Self { lower, inverse_pivot, upper }
    }

    /// Replaces the right-hand side by the solution.
    pub(super) fn solve(&self, b: &mut [f64]) {
        let mut before = 0.0;
        for (i, x) in b.iter_mut().enumerate() {
            let known = if i == 0 { 0.0 } else { self.lower[i] * before };
            *x = (*x - known) * self.inverse_pivot[i];
            before = *x;
        }
        for i in (1..b.len()).rev() {
            b[i - 1] -= self.upper[i - 1] * b[i];
        }
    }
}

impl Cyclic {
    /// Factors a ring of at least three rows with `corner` in both far corners.
    ///
    /// Sherman and Morrison: with gamma = -diagonal[0], the plain matrix stays diagonally dominant.
    pub(super) fn factor(lower: Vec<f64>, mut diagonal: Vec<f64>, upper: Vec<f64>, corner: f64) -> Self {
        let last = diagonal.len() - 1;
        let gamma = -diagonal[0];
        let ratio = corner / gamma;
        diagonal[0] -= gamma;
        diagonal[last] -= corner * ratio;
        let plain = Tridiagonal::factor(lower, &diagonal, upper);
        let mut column = vec![0.0; last + 1];
        column[0] = gamma;
        column[last] = corner;
        plain.solve(&mut column);
        let denominator = 1.0 + column[0] + ratio * column[last];
        Self { plain, column, ratio, denominator }
    }

    /// Replaces the right-hand side by the solution.
    pub(super) fn solve(&self, b: &mut [f64]) {
        self.plain.solve(b);
        let share = (b[0] + self.ratio * b[b.len() - 1]) / self.denominator;
        for (x, z) in b.iter_mut().zip(&self.column) {
            *x -= share * z;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn rows() -> impl Strategy<Value = Vec<(f64, f64, f64, f64)>> {
        let off = -1.0..1.0f64;
        prop::collection::vec((off.clone(), 0.01..3.0f64, off, -5.0..5.0f64), 3..40)
    }

    proptest! {
        #[test]
        fn solution_satisfies_every_row(rows in rows(), corner in -1.0..1.0f64) {
            let n = rows.len();
            let lower: Vec<f64> = rows.iter().map(|r| r.0).collect();
            let upper: Vec<f64> = rows.iter().map(|r| r.2).collect();
            let diagonal: Vec<f64> =
                rows.iter().map(|r| r.0.abs() + r.2.abs() + corner.abs() + r.1).collect();
            let b: Vec<f64> = rows.iter().map(|r| r.3).collect();
            let row = |x: &[f64], i: usize| {
                let left = if i > 0 { lower[i] * x[i - 1] } else { 0.0 };
                let right = if i + 1 < n { upper[i] * x[i + 1] } else { 0.0 };
                left + diagonal[i] * x[i] + right
            };

            let mut x = b.clone();
            Tridiagonal::factor(lower.clone(), &diagonal, upper.clone()).solve(&mut x);
            let size = x.iter().fold(1.0f64, |m, v| m.max(v.abs()));
            for (i, right) in b.iter().enumerate() {
                prop_assert!((row(&x, i) - right).abs() < 1e-12 * size);
            }

            let mut x = b.clone();
            Cyclic::factor(lower.clone(), diagonal.clone(), upper.clone(), corner).solve(&mut x);
            let size = x.iter().fold(1.0f64, |m, v| m.max(v.abs()));
            for (i, right) in b.iter().enumerate() {
                let far = if i == 0 { x[n - 1] } else if i == n - 1 { x[0] } else { 0.0 };
                prop_assert!((row(&x, i) + corner * far - right).abs() < 1e-11 * size);
            }
        }
    }
}
