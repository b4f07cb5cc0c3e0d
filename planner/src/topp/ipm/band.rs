//! Symmetric positive definite systems with two side bands, by L D L^T.

/// A pentadiagonal symmetric matrix; `band[i] = [m(i, i), m(i, i+1), m(i, i+2)]`.
#[derive(Clone, Debug, Default)]
pub(super) struct Band {
    /// The matrix.
    pub(super) band: Vec<[f64; 3]>,
    /// 1/D and the two sub-diagonals of L below column i.
    factor: Vec<[f64; 3]>,
}

impl Band {
    pub(super) fn reset(&mut self, n: usize) {
        self.band.clear();
        self.band.resize(n, [0.0; 3]);
    }

    /// Adds a symmetric 3 x 3 block, given as its upper triangle by rows, at `i`.
    pub(super) fn add(&mut self, i: usize, m: &[f64; 6]) {
        let [a, b, c] = [i, i + 1, i + 2];
        self.band[a][0] += m[0];
        self.band[a][1] += m[1];
        self.band[a][2] += m[2];
        self.band[b][0] += m[3];
        self.band[b][1] += m[4];
        self.band[c][0] += m[5];
    }

    /// Factorises rows and columns lo..hi. A pivot that rounding has made too small is lifted: the direction found
    /// is then shorter, never wrong in sign.
    pub(super) fn factorise(&mut self, lo: usize, hi: usize) {
        const LEAST_PIVOT: f64 = 1e-14;
        self.factor.clear();
        self.factor.resize(self.band.len(), [0.0; 3]);
        let mut one = [0.0; 2]; // what column i-1 takes from (i, i) and (i, i+1)
        let mut two = 0.0; // what column i-2 takes from (i, i)
        let mut held = 0.0; // what column i-1 takes from (i+1, i+1)
        for i in lo..hi {
            let [d, e, f] = self.band[i];
            let pivot = d - one[0] - two;
            let floor = LEAST_PIVOT * d;
            let inverse = 1.0 / if pivot > floor { pivot } else { floor.max(f64::MIN_POSITIVE) };
            let e = if i + 1 < hi { e - one[1] } else { 0.0 };
            let f = if i + 2 < hi { f } else { 0.0 };
            let (l1, l2) = (e * inverse, f * inverse);
            self.factor[i] = [inverse, l1, l2];
            two = std::mem::replace(&mut held, l2 * f);
            one = [l1 * e, l1 * f];
        }
    }

    /// Solves in place on rows lo..hi of `x`.
    pub(super) fn solve(&self, lo: usize, hi: usize, x: &mut [f64]) {
        for i in lo..hi {
            let [_, l1, l2] = self.factor[i];
            let v = x[i];
            if i + 1 < hi {
                x[i + 1] -= l1 * v;
            }
            if i + 2 < hi {
                x[i + 2] -= l2 * v;
            }
        }
        for i in (lo..hi).rev() {
            let [inverse, l1, l2] = self.factor[i];
            let mut v = x[i] * inverse;
            if i + 1 < hi {
                v -= l1 * x[i + 1];
            }
            if i + 2 < hi {
                v -= l2 * x[i + 2];
            }
            x[i] = v;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_what_it_multiplied() {
        let n = 9;
        let mut b = Band::default();
        b.reset(n);
        for i in 0..n - 2 {
            let k = i as f64;
            let a = [1.0 + k, -2.0 + 0.3 * k, 0.5 * k - 1.0];
            let m = [
                a[0] * a[0] + 1.0,
                a[0] * a[1],
                a[0] * a[2],
                a[1] * a[1] + 0.5,
                a[1] * a[2],
                a[2] * a[2] + 2.0,
            ];
            b.add(i, &m);
        }
        for (lo, hi) in [(0, n), (2, n - 2), (3, 4), (1, 3)] {
            let x: Vec<f64> = (0..n).map(|i| (i as f64 * 1.7).sin()).collect();
            let at = |i: usize, j: usize| b.band[i.min(j)].get(i.abs_diff(j)).copied().unwrap_or(0.0);
            let mut y = vec![0.0; n];
            (lo..hi).for_each(|i| y[i] = (lo..hi).map(|j| at(i, j) * x[j]).sum());
            b.factorise(lo, hi);
            b.solve(lo, hi, &mut y);
            for i in lo..hi {
                assert!((y[i] - x[i]).abs() < 1e-10, "{lo} {hi} {i}: {} {}", y[i], x[i]);
            }
        }
    }
}
