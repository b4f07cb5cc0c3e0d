//! Polynomials in Bernstein form on [0, 1], and the search for a proven bound on their largest value.
//!
//! The coefficients of a polynomial enclose its range, and the first and last are its values at the ends
//! (Farouki 2012, "The Bernstein polynomial basis: a centennial retrospective", sections 3.2 and 4.2). Halving
//! the interval divides the distance between the two by about four.

use crate::tolerances::{CERTIFICATE_RATIO, CERTIFICATE_TIGHTNESS};

/// Bound on the relative rounding error of every coefficient, against its magnitude: the same formula with the
/// absolute value of every term.
///
/// A sum of products that meets k roundings on its way errs by at most gamma_k = k u / (1 - k u) times its
/// magnitude, u = 2^-53 (Higham 2002, section 3.1). The inputs are integers below 2^53 and single products, hence
/// exact or one rounding away. The longest way is the squared speed of a rest span (degree 16): 20 roundings to
/// the velocities, 12 for the square and its sum, 2 x 3 x 16 to cut it at a cap, 16 at each of 12 halvings: 320.
/// `a + w (b - a)` forms differences of up to twice the magnitude, hence the factor of three between 320 and this.
pub(super) const ROUNDING: f64 = 1024.0 * 0.5 * f64::EPSILON;

/// Most times an interval is halved.
const DEPTH: u8 = 12;

/// `a + w (b - a)`.
pub(super) fn mix(a: f64, b: f64, w: f64) -> f64 {
    a + w * (b - a)
}

/// Both parts of a polynomial cut at `w`, each on [0, 1] again (de Casteljau).
pub(super) fn split<const N: usize>(c: &[f64; N], w: f64) -> ([f64; N], [f64; N]) {
    let mut right = *c;
    let mut left = [0.0; N];
    for (k, l) in left.iter_mut().enumerate() {
        *l = right[0];
        for i in 0..N - 1 - k {
            right[i] = mix(right[i], right[i + 1], w);
        }
    }
    (left, right)
}

/// The part between `from` and `to`, 0 <= from < to <= 1.
pub(super) fn clip<const N: usize>(c: &[f64; N], from: f64, to: f64) -> [f64; N] {
    let head = if to < 1.0 { split(c, to).0 } else { *c };
    if from > 0.0 { split(&head, from / to).1 } else { head }
}

/// Square of a quadratic.
pub(super) fn square(p: &[f64; 3]) -> [f64; 5] {
    let [a, b, c] = *p;
    [a * a, a * b, (a * c + 2.0 * b * b) * (1.0 / 3.0), b * c, c * c]
}

/// Quartic times quadratic.
pub(super) fn times_quadratic(s: &[f64; 5], q: &[f64; 3]) -> [f64; 7] {
    [
        s[0] * q[0],
        (s[0] * q[1] + 2.0 * s[1] * q[0]) * (1.0 / 3.0),
        (s[0] * q[2] + 8.0 * s[1] * q[1] + 6.0 * s[2] * q[0]) * (1.0 / 15.0),
        (s[1] * q[2] + 3.0 * s[2] * q[1] + s[3] * q[0]) * (1.0 / 5.0),
        (6.0 * s[2] * q[2] + 8.0 * s[3] * q[1] + s[4] * q[0]) * (1.0 / 15.0),
        (2.0 * s[3] * q[2] + s[4] * q[1]) * (1.0 / 3.0),
        s[4] * q[2],
    ]
}

/// Quadratic times line.
pub(super) fn times_line(p: &[f64; 3], l: &[f64; 2]) -> [f64; 4] {
    let third = 1.0 / 3.0;
    [
        p[0] * l[0],
        (2.0 * p[1] * l[0] + p[0] * l[1]) * third,
        (p[2] * l[0] + 2.0 * p[1] * l[1]) * third,
        p[2] * l[1],
    ]
}

/// Line times line.
pub(super) fn line_times_line(a: &[f64; 2], b: &[f64; 2]) -> [f64; 3] {
    [a[0] * b[0], 0.5 * (a[0] * b[1] + a[1] * b[0]), a[1] * b[1]]
}

/// Binomial coefficient n over k, exact for the small n used here.
fn binomial(n: usize, k: usize) -> f64 {
    if k > n {
        return 0.0;
    }
    (0..k).fold(1.0, |c, i| c * (n - i) as f64 / (i + 1) as f64)
}

/// `sum a_m tau^(lead + 3 m)` in Bernstein form of degree N - 1 (Farouki 2012, eq. 26).
pub(super) fn from_cubes<const N: usize>(powers: &[f64], lead: usize) -> [f64; N] {
    let mut c = [0.0; N];
    for (m, a) in powers.iter().enumerate() {
        let e = lead + 3 * m;
        let scale = a / binomial(N - 1, e);
        for (k, out) in c.iter_mut().enumerate().skip(e) {
            *out += scale * binomial(k, e);
        }
    }
    c
}

/// Square of a polynomial of degree 8.
pub(super) fn square_of_octic(p: &[f64; 9]) -> [f64; 17] {
    const EIGHT: [f64; 9] = [1.0, 8.0, 28.0, 56.0, 70.0, 56.0, 28.0, 8.0, 1.0];
    const SIXTEEN: [f64; 9] = [1.0, 16.0, 120.0, 560.0, 1820.0, 4368.0, 8008.0, 11440.0, 12870.0];
    let scaled: [f64; 9] = std::array::from_fn(|i| p[i] * EIGHT[i]);
    let mut c = [0.0; 17];
    for (i, a) in scaled.iter().enumerate() {
        for (j, b) in scaled.iter().enumerate() {
            c[i + j] += a * b;
        }
    }
    for (k, out) in c.iter_mut().enumerate() {
        *out /= SIXTEEN[k.min(16 - k)];
    }
    c
}

/// What a polynomial stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    /// Signed value / limit.
    Signed,
    /// (value / limit)^2.
    Squared,
}

/// Where a polynomial lives.
#[derive(Clone, Copy, Debug)]
pub(super) struct Locus {
    /// Axis, or the mask of a cap's axes.
    pub(super) axis: u16,
    /// Span of the table.
    pub(super) span: usize,
    /// Start of the interval, as a share of the span.
    pub(super) from: f64,
    /// Its end.
    pub(super) to: f64,
}

/// The largest ratio met so far: proven bound, and a value that is surely attained.
#[derive(Clone, Copy, Debug)]
pub(super) struct Peak {
    pub(super) bound: f64,
    pub(super) attained: f64,
    pub(super) at: Option<Locus>,
}

impl Peak {
    pub(super) const NONE: Self = Self { bound: 0.0, attained: 0.0, at: None };

    /// The larger of two peaks; the first on a tie.
    pub(super) fn merge(self, other: Self) -> Self {
        let attained = self.attained.max(other.attained);
        let larger = if other.bound > self.bound { other } else { self };
        Self { attained, ..larger }
    }

    /// Takes a ratio that has no bound.
    pub(super) fn unbounded(&mut self, at: Locus) {
        if self.bound < f64::INFINITY {
            *self = Self { bound: f64::INFINITY, attained: self.attained, at: Some(at) };
        }
    }

    /// Whether a bound leaves something to be proven: that the limit holds, or how near the peak comes to it.
    fn is_open(&self, bound: f64) -> bool {
        let limit = 1.0 + 0.5 * CERTIFICATE_RATIO;
        bound > self.attained * (1.0 + CERTIFICATE_TIGHTNESS) || (bound > limit && self.attained <= limit)
    }

    /// Bounds a polynomial whose coefficients are known to within `slack`.
    pub(super) fn climb<const N: usize>(&mut self, form: Form, c: &[f64; N], slack: f64, at: Locus) {
        if c.iter().all(|x| x.is_finite()) && slack.is_finite() {
            self.halve(form, c, slack + f64::MIN_POSITIVE, at, 0);
        } else {
            self.unbounded(at);
        }
    }

    fn halve<const N: usize>(&mut self, form: Form, c: &[f64; N], slack: f64, at: Locus, depth: u8) {
        let size = |x: f64| if form == Form::Signed { x.abs() } else { x };
        let ends = size(c[0]).max(size(c[N - 1]));
        let hull = c.iter().fold(ends, |m, &x| m.max(size(x)));
        let ratio = |x: f64| if form == Form::Signed { x } else { x.max(0.0).sqrt() };
        self.attained = self.attained.max(ratio(ends - slack) * (1.0 - f64::EPSILON));
        let bound = ratio(hull + slack) * (1.0 + f64::EPSILON);
        if bound <= self.bound {
            return;
        }
        if depth < DEPTH && hull - ends > 4.0 * slack && self.is_open(bound) {
            let (left, right) = split(c, 0.5);
            let middle = 0.5 * (at.from + at.to);
            self.halve(form, &left, slack, Locus { to: middle, ..at }, depth + 1);
            self.halve(form, &right, slack, Locus { from: middle, ..at }, depth + 1);
        } else {
            self.bound = bound;
            self.at = Some(at);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value<const N: usize>(c: &[f64; N], x: f64) -> f64 {
        split(c, x).0[N - 1]
    }

    const P: [f64; 3] = [0.3, -1.4, 2.0];
    const Q: [f64; 3] = [1.5, 0.2, 0.9];
    const L: [f64; 2] = [-0.7, 1.1];
    const AT: Locus = Locus { axis: 0, span: 0, from: 0.0, to: 1.0 };

    #[test]
    fn products_take_the_product_of_the_values() {
        let speed = times_quadratic(&square(&P), &Q);
        let cubic = times_line(&P, &L);
        let lines = line_times_line(&L, &[0.4, 0.1]);
        for x in [0.0, 0.21, 0.5, 0.83, 1.0] {
            let (p, q, l) = (value(&P, x), value(&Q, x), value(&L, x));
            assert!((value(&speed, x) - p * p * q).abs() < 1e-14);
            assert!((value(&cubic, x) - p * l).abs() < 1e-14);
            assert!((value(&lines, x) - l * value(&[0.4, 0.1], x)).abs() < 1e-14);
        }
    }

    #[test]
    fn cubes_and_squares_agree_with_powers() {
        let c: [f64; 9] = from_cubes(&[0.5, -1.0, 2.0], 2);
        let s = square_of_octic(&c);
        for x in [0.0f64, 0.3, 0.77, 1.0] {
            let direct = 0.5 * x.powi(2) - x.powi(5) + 2.0 * x.powi(8);
            assert!((value(&c, x) - direct).abs() < 1e-14);
            assert!((value(&s, x) - direct * direct).abs() < 1e-14);
        }
    }

    #[test]
    fn a_clipped_part_is_the_same_polynomial() {
        let c = clip(&P, 0.2, 0.7);
        for x in [0.0, 0.4, 1.0] {
            assert!((value(&c, x) - value(&P, 0.2 + 0.5 * x)).abs() < 1e-15);
        }
    }

    #[test]
    fn the_bound_closes_in_on_an_inner_maximum() {
        // 4 x (1 - x) has coefficients 0, 2, 0 and the maximum 1.
        let mut peak = Peak::NONE;
        peak.climb(Form::Signed, &[0.0, 2.0, 0.0], 0.0, AT);
        assert!(peak.bound >= 1.0 && peak.bound <= 1.0 + CERTIFICATE_RATIO);
        assert!(peak.attained <= 1.0 && peak.attained > 0.999);
        let at = peak.at.unwrap();
        assert!(at.from <= 0.5 && at.to >= 0.5);
    }

    #[test]
    fn slack_and_bad_numbers_only_raise_the_bound() {
        let mut peak = Peak::NONE;
        peak.climb(Form::Signed, &[-0.5, -0.5], 0.25, AT);
        assert!(peak.bound >= 0.75 && peak.attained <= 0.25);
        peak.climb(Form::Squared, &[f64::NAN, 0.0, 0.0], 0.0, AT);
        assert_eq!(peak.bound, f64::INFINITY);
    }
}
