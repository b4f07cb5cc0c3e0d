//! Following error, contour error and effort over a run.

mod contour;

pub use contour::ContourError;

/// Greatest and root-mean-square value of a signal.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Magnitude {
    max: f64,
    sum_of_squares: f64,
    count: u64,
}

impl Magnitude {
    /// Takes one value in.
    pub fn add(&mut self, value: f64) {
        self.max = self.max.max(value.abs());
        self.sum_of_squares += value * value;
        self.count += 1;
    }

    /// Greatest absolute value.
    pub fn max(&self) -> f64 {
        self.max
    }

    /// Root of the mean square; zero of nothing.
    pub fn rms(&self) -> f64 {
        if self.count == 0 { 0.0 } else { (self.sum_of_squares / self.count as f64).sqrt() }
    }

    /// The magnitude of both signals together.
    #[must_use]
    pub fn join(self, other: Self) -> Self {
        Self {
            max: self.max.max(other.max),
            sum_of_squares: self.sum_of_squares + other.sum_of_squares,
            count: self.count + other.count,
        }
    }
}
