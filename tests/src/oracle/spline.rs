//! B-splines by the Cox-de Boor recursion (Piegl & Tiller 1997, eqs. 2.5 and 2.7), written for plainness.

use super::real::Real;

/// The basis functions of clamped B-splines.
#[derive(Clone, Debug)]
pub struct Basis<T> {
    degree: usize,
    knots: Vec<T>,
}

impl<T: Real> Basis<T> {
    /// With end knots repeated `degree` more times.
    pub fn clamped(degree: usize, breaks: &[T]) -> Self {
        let (first, last) = (breaks[0], breaks[breaks.len() - 1]);
        let mut knots = vec![first; degree];
        knots.extend_from_slice(breaks);
        knots.extend(vec![last; degree]);
        Self { degree, knots }
    }

    /// Basis function `i` of degree `p`, or a derivative of it, by the polynomial of break interval `interval`.
    fn basis(&self, i: usize, p: usize, derivative: usize, interval: usize, u: T) -> T {
        let (t, zero) = (&self.knots, T::from(0.0));
        let over = |num: T, den: T| if den.near() == 0.0 { zero } else { num / den };
        // Functions that vanish on the interval need no descent.
        if i + p < interval + self.degree || i > interval + self.degree {
            return zero;
        }
        if p == 0 {
            return T::from(if derivative == 0 { 1.0 } else { 0.0 });
        }
        let (rise, fall) = (t[i + p] - t[i], t[i + p + 1] - t[i + 1]);
        if derivative > 0 {
            let left = over(self.basis(i, p - 1, derivative - 1, interval, u), rise);
            let right = over(self.basis(i + 1, p - 1, derivative - 1, interval, u), fall);
            return T::from(p as f64) * (left - right);
        }
        over(u - t[i], rise) * self.basis(i, p - 1, 0, interval, u)
            + over(t[i + p + 1] - u, fall) * self.basis(i + 1, p - 1, 0, interval, u)
    }

    /// Weights of control points `interval..=interval + degree` in the value or a derivative at `u`, by the
    /// polynomial of break interval `interval`.
    pub fn weights(&self, interval: usize, u: T, derivative: usize) -> Vec<T> {
        let functions = interval..=interval + self.degree;
        functions.map(|i| self.basis(i, self.degree, derivative, interval, u)).collect()
    }
}

/// Sum of control points by weights, from control point `first` on.
pub fn combine<T: Real>(controls: &[T], first: usize, weights: &[T]) -> T {
    let terms = controls[first..first + weights.len()].iter().zip(weights);
    terms.fold(T::from(0.0), |sum, (&c, &w)| sum + c * w)
}
