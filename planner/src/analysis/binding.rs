//! How much of the time each limit rules.

use std::collections::BTreeMap;

use serde::Serialize;

use super::cells::visit;
use crate::feed::job::PlannedSection;
use crate::topp::problem::Binding;

/// Cells that a span is cut into.
const PER_SPAN: usize = 3;

/// Time by ruling limit, over any number of sections.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BindingShares {
    seconds: BTreeMap<Binding, f64>,
}

/// One limit's share of the motion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Share {
    /// velocity, acceleration, jerk, feed, rest or free.
    pub kind: &'static str,
    /// The axis, where an axis limit rules.
    pub axis: Option<u8>,
    /// How long [s].
    pub seconds: f64,
    /// Of all motion time.
    pub share: f64,
}

impl BindingShares {
    /// Adds one section; what rules is read off the table itself.
    pub fn add(&mut self, section: &PlannedSection) {
        visit(section, PER_SPAN, |cell| {
            *self.seconds.entry(cell.binding(&section.limits)).or_insert(0.0) += cell.seconds;
        });
    }

    /// Adds what another collected.
    pub fn merge(&mut self, other: &Self) {
        for (&binding, &seconds) in &other.seconds {
            *self.seconds.entry(binding).or_insert(0.0) += seconds;
        }
    }

    /// The shares, in the order velocity, acceleration, jerk (each by axis), feed, rest, free.
    pub fn shares(&self) -> Vec<Share> {
        let total: f64 = self.seconds.values().sum();
        let share = |(&binding, &seconds): (&Binding, &f64)| {
            let (kind, axis) = name(binding);
            Share { kind, axis, seconds, share: if total > 0.0 { seconds / total } else { 0.0 } }
        };
        self.seconds.iter().map(share).collect()
    }
}

/// Name and axis of a ruling limit.
pub fn name(binding: Binding) -> (&'static str, Option<u8>) {
    match binding {
        Binding::Velocity(axis) => ("velocity", Some(axis)),
        Binding::Acceleration(axis) => ("acceleration", Some(axis)),
        Binding::Jerk(axis) => ("jerk", Some(axis)),
        Binding::Feed => ("feed", None),
        Binding::Rest => ("rest", None),
        Binding::Free => ("free", None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::samples::bent_section;
    use crate::certificate::certify;
    use crate::geometry::section::SpeedCap;
    use crate::job::machine::AxisLimits;

    fn kinds(section: &PlannedSection) -> Vec<Share> {
        let mut shares = BindingShares::default();
        shares.add(section);
        shares.shares()
    }

    #[test]
    fn shares_sum_to_one_and_rest_spans_count_as_rest() {
        let section = bent_section();
        let shares = kinds(&section);
        assert!((shares.iter().map(|s| s.share).sum::<f64>() - 1.0).abs() < 1e-12);
        assert_eq!(shares.iter().map(|s| s.kind).collect::<Vec<_>>(), ["rest", "free"]);
        let n = section.table.spans();
        let rest = section.table.law(0).duration() + section.table.law(n - 1).duration();
        assert!((shares[0].seconds - rest).abs() < 1e-9);
    }

    #[test]
    fn a_limit_that_is_reached_rules() {
        let mut section = bent_section();
        let table = &section.table;
        let unit = AxisLimits { velocity: 1.0, acceleration: f64::INFINITY, jerk: f64::INFINITY };
        let top = certify(table, &[unit; 2], &[]).velocity_ratio;
        section.limits = vec![AxisLimits { velocity: top, ..unit }; 2];
        assert!(kinds(&section).iter().any(|s| s.kind == "velocity" && s.axis == Some(0)));
        let speed = certify(table, &[unit; 2], &section.marks.caps).feed_ratio * 25.0;
        section.marks.caps[0].speed = SpeedCap::Tangential { axes: 3, speed };
        assert!(kinds(&section).iter().any(|s| s.kind == "feed" && s.axis.is_none()));
    }
}
