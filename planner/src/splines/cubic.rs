//! C2 cubic splines through given values: de Boor, A Practical Guide to Splines, ch. IV.
//!
//! The unknowns are the second derivatives M_i at the knots ("moments"). With lengths h_i and chord slopes
//! d_i = (y_{i+1} - y_i)/h_i, continuity of the first derivative at each inner knot reads
//!
//! ```text
//! h_{i-1} M_{i-1} + 2 (h_{i-1} + h_i) M_i + h_i M_{i+1} = 6 (d_i - d_{i-1})
//! ```
//!
//! and the end condition closes the system. All rows are diagonally dominant, also after the end condition
//! has been eliminated, so it is solved in O(N) without pivoting. The matrix depends on the knots alone:
//! [`CubicSystem`] factors it once for all axes.

use std::str::FromStr;

use thiserror::Error;

use super::tridiagonal::{Cyclic, Tridiagonal};

/// What closes the system at the two ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ends {
    /// The third derivative is continuous at the first and last inner knot: reproduces cubics.
    NotAKnot,
    /// The first derivative is given at both ends.
    Clamped,
    /// The second derivative is zero at both ends.
    Natural,
    /// A closed curve: the last value is the first, and both derivatives agree there.
    Periodic,
}

/// Not the name of an end condition.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("expected not-a-knot, clamped, natural or periodic")]
pub struct UnknownEnds;

/// There is no such spline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum SplineError {
    /// Too few knots.
    #[error("{found} values, at least {least} needed")]
    TooFew {
        /// Values handed in.
        found: usize,
        /// Fewest for this end condition.
        least: usize,
    },
    /// A length between two knots is not a positive number.
    #[error("knot {index} does not rise above the one before it")]
    NotRising {
        /// Index of the later knot.
        index: usize,
    },
    /// Not one value per knot.
    #[error("{found} values for {expected} knots")]
    Count {
        /// Values handed in.
        found: usize,
        /// Knots.
        expected: usize,
    },
    /// A value is NaN or infinite, or so large that the spline leaves the range of f64.
    #[error("values are not finite or too large")]
    NotFinite,
}

impl FromStr for Ends {
    type Err = UnknownEnds;

    fn from_str(name: &str) -> Result<Self, UnknownEnds> {
        match name {
            "not-a-knot" => Ok(Self::NotAKnot),
            "clamped" => Ok(Self::Clamped),
            "natural" => Ok(Self::Natural),
            "periodic" => Ok(Self::Periodic),
            _ => Err(UnknownEnds),
        }
    }
}

impl Ends {
    /// Fewest values that this end condition can work with.
    pub fn least_values(self) -> usize {
        match self {
            Self::Periodic => 3,
            Self::NotAKnot | Self::Clamped | Self::Natural => 2,
        }
    }
}

/// The factored system for one set of knots and one end condition.
#[derive(Clone, Debug)]
pub struct CubicSystem {
    lengths: Vec<f64>,
    ends: Ends,
    matrix: Matrix,
}

#[derive(Clone, Debug)]
enum Matrix {
    /// Two values, or three with not-a-knot ends: nothing to solve.
    None,
    Plain(Tridiagonal),
    Ring(Cyclic),
}

/// A cubic spline of one axis.
#[derive(Clone, Debug)]
pub struct Cubic<'a> {
    lengths: &'a [f64],
    values: &'a [f64],
    moments: Vec<f64>,
}

/// Value and first two derivatives at one place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jet {
    /// Value.
    pub value: f64,
    /// First derivative.
    pub slope: f64,
    /// Second derivative.
    pub second: f64,
}

impl CubicSystem {
    /// Factors the system for knots `lengths` apart.
    ///
    /// # Errors
    /// If a length is not a positive number, or if there are too few.
    pub fn new(lengths: Vec<f64>, ends: Ends) -> Result<Self, SplineError> {
        let (found, least) = (lengths.len() + 1, ends.least_values());
        if found < least {
            return Err(SplineError::TooFew { found, least });
        }
        if let Some(i) = lengths.iter().position(|h| !(*h > 0.0 && h.is_finite())) {
            return Err(SplineError::NotRising { index: i + 1 });
        }
        let matrix = match ends {
            Ends::NotAKnot | Ends::Natural => inner(&lengths, ends),
            Ends::Clamped => clamped(&lengths),
            Ends::Periodic => ring(&lengths),
        };
        Ok(Self { lengths, ends, matrix })
    }

    /// The spline through `values`, one per knot; `end_slopes` count for clamped ends only.
    ///
    /// With periodic ends the last value is taken to be the first.
    ///
    /// # Errors
    /// If there is not one value per knot or if anything is not finite.
    pub fn interpolate<'a>(
        &'a self,
        values: &'a [f64],
        end_slopes: [f64; 2],
    ) -> Result<Cubic<'a>, SplineError> {
        let (h, n) = (&self.lengths, self.lengths.len());
        if values.len() != n + 1 {
            return Err(SplineError::Count { found: values.len(), expected: n + 1 });
        }
        let chord = |i: usize| (values[i + 1] - values[i]) / h[i];
        let kink = |i: usize| 6.0 * (chord(i) - chord(i - 1));
        let mut moments = vec![0.0; n + 1];
        for (i, m) in moments.iter_mut().enumerate().take(n).skip(1) {
            *m = kink(i);
        }
        match (&self.matrix, self.ends) {
            (Matrix::Plain(matrix), Ends::Clamped) => {
                moments[0] = 6.0 * (chord(0) - end_slopes[0]);
                moments[n] = 6.0 * (end_slopes[1] - chord(n - 1));
                matrix.solve(&mut moments);
            }
            (Matrix::Plain(matrix), Ends::NotAKnot) => {
                moments[1] *= h[1] / (h[0] + h[1]);
                moments[n - 1] *= h[n - 2] / (h[n - 2] + h[n - 1]);
                matrix.solve(&mut moments[1..n]);
                let beyond = |near: f64, next: f64, ratio: f64| near + ratio * (near - next);
                moments[0] = beyond(moments[1], moments[2], h[0] / h[1]);
                moments[n] = beyond(moments[n - 1], moments[n - 2], h[n - 1] / h[n - 2]);
            }
            (Matrix::Plain(matrix), Ends::Natural) => matrix.solve(&mut moments[1..n]),
            (Matrix::Plain(matrix), Ends::Periodic) => {
                moments[0] = 6.0 * (chord(0) - chord(n - 1));
                matrix.solve(&mut moments[..n]);
                moments[n] = moments[0];
            }
            (Matrix::Ring(matrix), _) => {
                moments[0] = 6.0 * (chord(0) - chord(n - 1));
                matrix.solve(&mut moments[..n]);
                moments[n] = moments[0];
            }
            // A straight line; through three values with not-a-knot ends, a parabola.
            (Matrix::None, _) => {
                if n == 2 {
                    moments.fill(2.0 * (chord(1) - chord(0)) / (h[0] + h[1]));
                }
            }
        }
        let finite = moments.iter().chain(values).all(|m| m.is_finite());
        if finite { Ok(Cubic { lengths: h, values, moments }) } else { Err(SplineError::NotFinite) }
    }
}

/// The rows of the inner knots 1..n; at not-a-knot ends M_0 = M_1 + (h_0/h_1) (M_1 - M_2) is eliminated and the
/// row divided by (h_0 + h_1)/h_1, which leaves (h_0 + 2 h_1) M_1 + (h_1 - h_0) M_2.
fn inner(h: &[f64], ends: Ends) -> Matrix {
    let n = h.len();
    let fewest = if ends == Ends::NotAKnot { 3 } else { 2 };
    if n < fewest {
        return Matrix::None;
    }
    let mut lower = h[..n - 1].to_vec();
    let mut upper = h[1..].to_vec();
    let mut diagonal: Vec<f64> = h.windows(2).map(|w| 2.0 * (w[0] + w[1])).collect();
    if ends == Ends::NotAKnot {
        (diagonal[0], upper[0]) = (h[0] + 2.0 * h[1], h[1] - h[0]);
        (diagonal[n - 2], lower[n - 2]) = (h[n - 1] + 2.0 * h[n - 2], h[n - 2] - h[n - 1]);
    }
    Matrix::Plain(Tridiagonal::factor(lower, &diagonal, upper))
}

/// The rows of all knots 0..=n.
fn clamped(h: &[f64]) -> Matrix {
    let n = h.len();
    let at = |i: usize| h.get(i).copied().unwrap_or(0.0);
    let before = |i: usize| if i == 0 { 0.0 } else { at(i - 1) };
    let lower = (0..=n).map(before).collect();
    let upper = (0..=n).map(at).collect();
    let diagonal: Vec<f64> = (0..=n).map(|i| 2.0 * (before(i) + at(i))).collect();
    Matrix::Plain(Tridiagonal::factor(lower, &diagonal, upper))
}

/// The rows of the knots 0..n, knot n being knot 0.
fn ring(h: &[f64]) -> Matrix {
    let n = h.len();
    let before = |i: usize| h[(i + n - 1) % n];
    let diagonal: Vec<f64> = (0..n).map(|i| 2.0 * (before(i) + h[i])).collect();
    if n == 2 {
        // Both neighbours of a knot are the same other knot.
        let both = vec![h[0] + h[1]; 2];
        return Matrix::Plain(Tridiagonal::factor(both.clone(), &diagonal, both));
    }
    let lower = (0..n).map(before).collect();
    Matrix::Ring(Cyclic::factor(lower, diagonal, h.to_vec(), h[n - 1]))
}

impl Cubic<'_> {
    /// Value and derivatives at `x` into interval `i` (0-based), x in [0, length].
    pub fn jet(&self, i: usize, x: f64) -> Jet {
        let (h, y0, y1) = (self.lengths[i], self.values[i], self.values[i + 1]);
        let (m0, m1) = (self.moments[i], self.moments[i + 1]);
        let slope = (y1 - y0) / h - h * (2.0 * m0 + m1) / 6.0;
        let third = (m1 - m0) / h;
        Jet {
            value: y0 + x * (slope + x * (0.5 * m0 + x * third / 6.0)),
            slope: slope + x * (m0 + x * 0.5 * third),
            second: m0 + x * third,
        }
    }

    /// Value and derivatives at knot `i`; the value is the given one, exactly.
    pub fn at_knot(&self, i: usize) -> Jet {
        if i < self.lengths.len() {
            return self.jet(i, 0.0);
        }
        let h = self.lengths[i - 1];
        let (m0, m1) = (self.moments[i - 1], self.moments[i]);
        let slope = (self.values[i] - self.values[i - 1]) / h + h * (m0 + 2.0 * m1) / 6.0;
        Jet { value: self.values[i], slope, second: m1 }
    }
}

#[cfg(test)]
mod tests;
