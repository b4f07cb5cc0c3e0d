//! Lowest and highest values per interval, thinned out as the record grows.

use super::model::Envelope;

impl Envelope {
    /// Opens a new interval with its first value.
    pub fn open(&mut self, value: f64) {
        self.lo.push(value);
        self.hi.push(value);
    }

    /// Widens the last interval to hold the value.
    pub fn widen(&mut self, value: f64) {
        if let (Some(lo), Some(hi)) = (self.lo.last_mut(), self.hi.last_mut()) {
            *lo = lo.min(value);
            *hi = hi.max(value);
        }
    }

    /// Joins neighbouring intervals two by two.
    pub fn halve(&mut self) {
        self.lo = self.lo.chunks(2).map(|c| c.iter().copied().fold(f64::INFINITY, f64::min)).collect();
        self.hi = self.hi.chunks(2).map(|c| c.iter().copied().fold(f64::NEG_INFINITY, f64::max)).collect();
    }

    /// Holds nothing.
    pub fn is_empty(&self) -> bool {
        self.lo.is_empty()
    }
}

/// Keeps the first of every two neighbours.
pub(super) fn every_other<T: Copy>(values: &mut Vec<T>) {
    let mut i = 0;
    values.retain(|_| {
        i += 1;
        i % 2 == 1
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn extremes_survive_any_thinning(values in prop::collection::vec(-1e3..1e3f64, 1..200), times in 0usize..9) {
            let mut e = Envelope::default();
            for (i, &v) in values.iter().enumerate() {
                if i % 3 == 0 { e.open(v) } else { e.widen(v) }
            }
            for _ in 0..times {
                e.halve();
            }
            let min = |v: &[f64]| v.iter().copied().fold(f64::INFINITY, f64::min);
            let max = |v: &[f64]| v.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            prop_assert_eq!(min(&e.lo), min(&values));
            prop_assert_eq!(max(&e.hi), max(&values));
            prop_assert!(e.lo.iter().zip(&e.hi).all(|(l, h)| l <= h));
        }
    }
}
