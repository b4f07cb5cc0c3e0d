//! A path at stations equally far apart: what every planner here is given.

use planner::geometry::grid_path::GridPath;

/// Derivatives at stations; every inner list holds one number per axis, station after station.
pub struct Sampled {
    /// Number of axes.
    pub axes: usize,
    /// Stations in u.
    pub stations: Vec<f64>,
    /// p, p', p'' and p'''.
    pub derivatives: [Vec<f64>; 4],
}

impl Sampled {
    /// Samples `path` at `count` stations.
    pub fn new(path: &GridPath, count: usize) -> Self {
        let axes = path.axes.len();
        let share = path.length() / (count - 1) as f64;
        let stations: Vec<f64> = (0..count).map(|k| k as f64 * share).collect();
        let mut derivatives = [const { Vec::new() }; 4];
        let mut span = 0;
        for &u in &stations {
            while span + 1 < path.spans() && path.breaks[span + 1] as f64 * path.step <= u {
                span += 1;
            }
            let x = u - path.breaks[span] as f64 * path.step;
            for axis in 0..axes {
                let piece = path.piece(axis, span);
                let position = path.position(axis, span, x);
                let jet = [position, piece.first(x), piece.second(x), piece.third()];
                derivatives.iter_mut().zip(jet).for_each(|(all, value)| all.push(value));
            }
        }
        Self { axes, stations, derivatives }
    }

    /// One derivative, axis by axis.
    pub fn by_axis(&self, order: usize) -> Vec<Vec<f64>> {
        let of = |axis| self.derivatives[order].iter().skip(axis).step_by(self.axes).copied().collect();
        (0..self.axes).map(of).collect()
    }
}
