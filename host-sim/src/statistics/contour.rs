//! Distance of the load from the path: the part of the following error that is seen on the workpiece.

use std::collections::VecDeque;

/// How many set-points back the nearest point is looked for; a lag longer than this is reported too large.
const MEMORY_TICKS: usize = 256;

/// Measures, tick by tick, how far the load is from the polyline of the set-points.
///
/// The nearest point only moves forwards along the polyline; beyond the newest set-point the last piece is continued
/// straight, as the load may lead. Between set-points the path is taken as straight: at an acceleration a across it
/// this is wrong by a tick^2/8 (1.2 um at 10 m/s^2 and 1 ms). Where the path comes back to itself within the lag,
/// the later passage counts.
#[derive(Clone, Debug, Default)]
pub struct ContourError {
    /// The set-points that may still be nearest, oldest first; consecutive ones differ.
    path: VecDeque<Vec<f64>>,
}

impl ContourError {
    /// Takes in the set-point and the load position of one tick and returns their distance across the path, in
    /// the unit of both.
    pub fn add(&mut self, setpoint: &[f64], actual: &[f64]) -> f64 {
        if self.path.back().is_none_or(|last| last != setpoint) {
            if self.path.len() == MEMORY_TICKS {
                self.path.pop_front();
            }
            self.path.push_back(setpoint.to_vec());
        }
        let (mut nearest, mut best) = (0, self.piece_distance(0, actual));
        for index in 1..self.path.len().saturating_sub(1) {
            let distance = self.piece_distance(index, actual);
            if distance <= best {
                (nearest, best) = (index, distance);
            }
        }
        self.path.drain(..nearest);
        best.sqrt()
    }

    /// Squared distance of `point` from piece `index`; from the set-point itself while there is only one.
    fn piece_distance(&self, index: usize, point: &[f64]) -> f64 {
        let start = &self.path[index];
        let Some(end) = self.path.get(index + 1) else {
            return start.iter().zip(point).map(|(s, p)| (p - s) * (p - s)).sum();
        };
        let (mut along, mut length) = (0.0, 0.0);
        for ((s, e), p) in start.iter().zip(end).zip(point) {
            along += (p - s) * (e - s);
            length += (e - s) * (e - s);
        }
        let newest = index + 2 == self.path.len();
        let fraction = if newest { (along / length).max(0.0) } else { (along / length).clamp(0.0, 1.0) };
        start
            .iter()
            .zip(end)
            .zip(point)
            .map(|((s, e), p)| {
                let off = p - s - fraction * (e - s);
                off * off
            })
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pure_lag_on_a_line_is_no_contour_error() {
        let mut contour = ContourError::default();
        for k in 0..500 {
            let s = f64::from(k) * 0.1;
            let lag = s - 2.0f64.min(s);
            let e = contour.add(&[s, 2.0 * s], &[lag, 2.0 * lag]);
            assert!(e < 1e-12, "{e}");
        }
    }

    #[test]
    fn an_offset_across_the_path_is_measured_whatever_the_lag() {
        for lag in [0.0, 1.5, -0.05] {
            let mut contour = ContourError::default();
            let mut last = 0.0;
            for k in 0..500 {
                let s = f64::from(k) * 0.1;
                last = contour.add(&[s, 0.0], &[s - lag, 0.02]);
            }
            assert!((last - 0.02).abs() < 1e-9, "lag {lag}: {last}");
        }
    }

    #[test]
    fn on_a_circle_a_smaller_radius_is_the_error_and_a_lag_is_not() {
        let (mut contour, mut worst) = (ContourError::default(), 0.0f64);
        for k in 0..5000 {
            let a = f64::from(k) * 0.01;
            let b = a - 0.3;
            let e = contour.add(&[10.0 * a.cos(), 10.0 * a.sin()], &[9.97 * b.cos(), 9.97 * b.sin()]);
            if k > 100 {
                worst = worst.max((e - 0.03).abs());
            }
        }
        // The sagitta of a piece: 10 * 0.01^2 / 8.
        assert!(worst < 1.3e-4, "{worst}");
    }

    #[test]
    fn a_load_that_cuts_a_corner_is_measured_from_both_legs() {
        // The path goes along x to (10, 0), then along y; the load takes the diagonal from (7, 0) to (10, 3).
        let (mut contour, mut worst) = (ContourError::default(), 0.0f64);
        let at = |s: f64| if s < 10.0 { [s, 0.0] } else { [10.0, s - 10.0] };
        for k in 0..300 {
            let s = f64::from(k) * 0.05;
            let t = ((s - 8.0) / 6.0).clamp(0.0, 1.0);
            let load = if s < 8.0 { at((s - 1.0).max(0.0)) } else { [7.0 + 3.0 * t, 3.0 * t] };
            worst = worst.max(contour.add(&at(s), &load));
        }
        assert!((worst - 1.5).abs() < 0.03, "{worst}");
    }

    #[test]
    fn standing_still_keeps_the_error_and_reversing_follows() {
        let mut contour = ContourError::default();
        for k in 0..100 {
            contour.add(&[f64::from(k)], &[f64::from(k)]);
        }
        for _ in 0..1000 {
            assert_eq!(contour.add(&[99.0], &[99.0]), 0.0);
        }
        for k in 0..50 {
            let s = 99.0 - f64::from(k);
            assert!(contour.add(&[s], &[s + 0.5]) < 1e-12 + 0.5);
        }
    }
}
