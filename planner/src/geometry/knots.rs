//! Knot sequences on the integer grid: where they begin, how they are split, how they are graded.

use super::contour::Contour;

/// Neighbouring spans differ in length by this factor at most (2, and room for odd grid lengths).
const GRADING: f64 = 2.2;

/// The two spans at a corner differ by this factor at most; halving the longer one never overshoots it.
const SYMMETRY: f64 = 1.6;

/// Length of the first pair of spans at a corner, in tol / sin(theta/2). The quasi-interpolant puts its control
/// point h/3 sin(theta/2) outside the vertex and swings wide: the longest that stays within the tolerance.
const CORNER_REACH: f64 = 16.0;

/// Knots of a spline in the making [grid steps].
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Knots {
    /// Length of a grid step in u.
    pub step: f64,
    /// The knots, strictly rising from 0.
    pub at: Vec<u64>,
    /// Which of them sit on the vertex of a corner.
    pub corner: Vec<bool>,
}

impl Knots {
    /// The coarsest knots worth trying: spans of `longest` or less except inside long lines, and a symmetric
    /// pair of spans at every corner. The contour's length is a whole number of steps.
    pub(super) fn coarse(contour: &Contour, step: f64, longest: f64) -> Self {
        let total = contour.length();
        let mut corners: Vec<(f64, f64)> = (1..contour.primitives.len())
            .filter_map(|k| contour.corner(k).map(|reach| (contour.start_of(k), CORNER_REACH * reach)))
            .collect();
        for i in 0..corners.len() {
            let before = if i == 0 { 0.0 } else { corners[i - 1].0 };
            let after = corners.get(i + 1).map_or(total, |c| c.0);
            let room = 0.3 * (corners[i].0 - before).min(after - corners[i].0);
            corners[i].1 = corners[i].1.min(room).min(longest);
        }
        let mut knots = Self { step, at: vec![0], corner: vec![false] };
        let (mut left, mut hint) = (0.0, 0);
        for (u, reach) in corners {
            hint = knots.fill(contour, hint, left, u - reach, longest);
            knots.push(u, true);
            knots.push(u + reach, false);
            left = u + reach;
        }
        let end = (total / step).round() as u64;
        while knots.at.len() > 1 && knots.at.last().is_some_and(|&k| k >= end) {
            knots.at.pop();
            knots.corner.pop();
        }
        knots.fill(contour, hint, left, total, longest);
        knots
    }

    /// Appends the grid point nearest to `u` unless it is taken.
    fn push(&mut self, u: f64, corner: bool) {
        let at = (u / self.step).round() as u64;
        if self.at.last().is_none_or(|&last| at > last) {
            self.at.push(at);
            self.corner.push(corner);
        }
    }

    /// Appends the knots of (left, right]; returns where it got to in the contour.
    fn fill(&mut self, contour: &Contour, hint: usize, left: f64, right: f64, longest: f64) -> usize {
        let mut from = left;
        let mut k = contour.seek(hint, left);
        let first = k;
        while k < contour.primitives.len() && contour.start_of(k) < right {
            let (a, b) = (contour.start_of(k).max(left), contour.ends[k].min(right));
            if contour.primitives[k].round.is_none() && b - a > 6.0 * longest {
                let start = if a == left { a } else { a + longest };
                let end = if b == right { b } else { b - longest };
                self.equal(from, start, longest);
                self.push(end, false);
                from = end;
            }
            k += 1;
        }
        self.equal(from, right, longest);
        first
    }

    /// Appends equal spans up to and with `right`.
    fn equal(&mut self, left: f64, right: f64, longest: f64) {
        let parts = ((right - left) / longest).ceil().max(1.0) as u64;
        for i in 1..=parts {
            self.push(left + (right - left) * (i as f64 / parts as f64), false);
        }
    }

    /// Number of spans.
    pub(super) fn spans(&self) -> usize {
        self.at.len() - 1
    }

    /// Length of span `i` [grid steps].
    pub(super) fn length(&self, i: usize) -> u64 {
        self.at[i + 1] - self.at[i]
    }

    /// A grid `factor` times finer with the same knots.
    pub(super) fn refine(&mut self, factor: u32) {
        self.step /= f64::from(factor);
        for k in &mut self.at {
            *k *= u64::from(factor);
        }
    }

    /// Adds to `split` what has to be halved too so that neighbours stay within the grading.
    ///
    /// One sweep each way suffices for a sequence that was graded before; otherwise the next pass goes on.
    pub(super) fn grade(&self, split: &mut [bool]) {
        let size = |split: &[bool], i: usize| self.length(i) as f64 * if split[i] { 0.5 } else { 1.0 };
        let ratio = |i: usize| if self.corner[i] { SYMMETRY } else { GRADING };
        for i in 1..split.len() {
            if size(split, i) > ratio(i) * size(split, i - 1) && self.length(i) > 1 {
                split[i] = true;
            }
        }
        for i in (1..split.len()).rev() {
            if size(split, i - 1) > ratio(i) * size(split, i) && self.length(i - 1) > 1 {
                split[i - 1] = true;
            }
        }
    }

    /// Halves the marked spans. Returns for each new knot the index it had, or `None`.
    pub(super) fn halve(&mut self, split: &[bool]) -> Vec<Option<usize>> {
        let grown = self.at.len() + split.iter().filter(|&&s| s).count();
        let (mut at, mut corner) = (Vec::with_capacity(grown), Vec::with_capacity(grown));
        let mut origin = Vec::with_capacity(grown);
        for i in 0..self.at.len() {
            at.push(self.at[i]);
            corner.push(self.corner[i]);
            origin.push(Some(i));
            if split.get(i).copied().unwrap_or(false) {
                at.push(self.at[i] + self.length(i) / 2);
                corner.push(false);
                origin.push(None);
            }
        }
        (self.at, self.corner) = (at, corner);
        origin
    }

    /// Knot `i` of the break sequence, ends repeated.
    pub(super) fn clamped(&self, i: isize) -> u64 {
        self.at[i.clamp(0, self.at.len() as isize - 1) as usize]
    }

    /// The three knots that define control point `i`, in u.
    pub(super) fn support(&self, i: usize) -> [f64; 3] {
        let i = i as isize;
        [i - 2, i - 1, i].map(|k| self.clamped(k) as f64 * self.step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grading_ends_with_neighbours_in_proportion() {
        let at = vec![0, 4096, 4100, 9000, 9001, 20_000];
        let corner = vec![false, false, true, false, false, false];
        let mut knots = Knots { step: 1.0, at, corner };
        loop {
            let mut split = vec![false; knots.spans()];
            knots.grade(&mut split);
            if !split.contains(&true) {
                break;
            }
            knots.halve(&split);
        }
        for i in 1..knots.spans() {
            let (a, b) = (knots.length(i - 1) as f64, knots.length(i) as f64);
            let limit = if knots.corner[i] { SYMMETRY } else { GRADING };
            assert!(a.max(b) <= limit * a.min(b), "{a} beside {b}");
        }
        assert!(knots.at.contains(&4100) && knots.at.contains(&9001));
    }

    #[test]
    fn halving_reports_where_each_knot_comes_from() {
        let mut knots = Knots { step: 1.0, at: vec![0, 10, 30], corner: vec![false, true, false] };
        assert_eq!(knots.halve(&[false, true]), [Some(0), Some(1), None, Some(2)]);
        assert_eq!((knots.at, knots.corner), (vec![0, 10, 20, 30], vec![false, true, false, false]));
    }
}
