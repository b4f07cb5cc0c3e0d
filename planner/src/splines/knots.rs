//! How the parameter is spread over the way-points.

use std::str::FromStr;

use thiserror::Error;

/// Rule for the parameter lengths between way-points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Knots {
    /// All equal: for way-points that are evenly spread, or sampled at equal times.
    Uniform,
    /// Proportional to the distance (chord length): |dr/du| stays near one.
    Chord,
    /// Proportional to the square root of the distance (Lee 1989): milder overshoot in sharp turns.
    Centripetal,
}

/// Not the name of a rule for knots.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("expected uniform, chord or centripetal")]
pub struct UnknownKnots;

impl FromStr for Knots {
    type Err = UnknownKnots;

    fn from_str(name: &str) -> Result<Self, UnknownKnots> {
        match name {
            "uniform" => Ok(Self::Uniform),
            "chord" => Ok(Self::Chord),
            "centripetal" => Ok(Self::Centripetal),
            _ => Err(UnknownKnots),
        }
    }
}

impl Knots {
    /// Parameter lengths for the given distances; they sum to the sum of the distances.
    pub fn lengths(self, distances: &[f64]) -> Vec<f64> {
        let total: f64 = distances.iter().sum();
        let scaled = |weight: fn(f64) -> f64| {
            let sum: f64 = distances.iter().map(|&d| weight(d)).sum();
            distances.iter().map(|&d| weight(d) * (total / sum)).collect()
        };
        match self {
            Self::Uniform => scaled(|_| 1.0),
            Self::Chord => distances.to_vec(),
            Self::Centripetal => scaled(f64::sqrt),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_sum_to_the_distance_and_follow_their_power() {
        let d = [1.0, 4.0, 0.25];
        for (rule, power) in [(Knots::Uniform, 0.0), (Knots::Chord, 1.0), (Knots::Centripetal, 0.5)] {
            let h = rule.lengths(&d);
            assert!((h.iter().sum::<f64>() - 5.25).abs() < 1e-12);
            for i in 1..d.len() {
                assert!((h[i] / h[0] - (d[i] / d[0]).powf(power)).abs() < 1e-12, "{rule:?}");
            }
        }
    }

    #[test]
    fn names_are_understood() {
        assert_eq!("chord".parse(), Ok(Knots::Chord));
        assert_eq!("uniform".parse(), Ok(Knots::Uniform));
        assert_eq!("centripetal".parse(), Ok(Knots::Centripetal));
        assert_eq!("Chord ".parse::<Knots>(), Err(UnknownKnots));
    }
}
