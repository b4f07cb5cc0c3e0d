//! B-splines by the Cox-de Boor recursion (Piegl & Tiller 1997, eqs. 2.5 and 2.7), written for plainness.

use super::real::Real;

/// A clamped B-spline.
#[derive(Clone, Debug)]
pub struct BSpline<T> {
    degree: usize,
    knots: Vec<T>,
    controls: Vec<T>,
}

impl<T: Real> BSpline<T> {
    /// With end knots repeated `degree` more times.
    pub fn clamped(degree: usize, breaks: &[T], controls: Vec<T>) -> Self {
        let (first, last) = (breaks[0], breaks[breaks.len() - 1]);
        let mut knots = vec![first; degree];
        knots.extend_from_slice(breaks);
        knots.extend(vec![last; degree]);
        assert_eq!(controls.len() + degree + 1, knots.len());
        Self { degree, knots, controls }
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

    /// Value or derivative at `u`, by the polynomial of break interval `interval`.
    pub fn at(&self, interval: usize, u: T, derivative: usize) -> T {
        (interval..=interval + self.degree)
            .map(|i| self.controls[i] * self.basis(i, self.degree, derivative, interval, u))
            .fold(T::from(0.0), |sum, term| sum + term)
    }
}
