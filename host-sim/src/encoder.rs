//! The position sensor on the motor side.

/// An incremental encoder: positions rounded to the nearest line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Encoder {
    /// Distance between two lines [m or rad].
    resolution: f64,
}

impl Encoder {
    /// An encoder with lines `resolution` apart [m or rad]; the caller has checked that it is positive.
    pub fn new(resolution: f64) -> Self {
        Self { resolution }
    }

    /// The measured position [m or rad]: `position` to the nearest line, at most half a line off.
    pub fn measure(&self, position: f64) -> f64 {
        (position / self.resolution).round() * self.resolution
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn measured_position_is_a_whole_number_of_lines_and_at_most_half_a_line_off() {
        let encoder = Encoder::new(1e-6);
        for k in 0..1000 {
            let x = 0.123 + f64::from(k) * 1.7e-7;
            let y = encoder.measure(x);
            assert!((y - x).abs() <= 0.5e-6 * (1.0 + 1e-9));
            assert!((y / 1e-6 - (y / 1e-6).round()).abs() < 1e-6);
        }
    }
}
