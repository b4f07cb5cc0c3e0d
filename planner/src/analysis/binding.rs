//! How much of the time each limit rules.

use std::collections::BTreeMap;

use super::cells::{feed_ratio, nearest_limit};
use super::motion::{AxisState, MotionSpan, pieces, spans};
use crate::feed::job::PlannedSection;
use crate::geometry::grid_path::Piece;
use crate::geometry::section::SpeedCap;
use crate::tolerances::BINDING;
use crate::topp::problem::Binding;

/// Places of a span that are looked at, both ends among them.
const PER_SPAN: u32 = 5;

/// Time by ruling limit, over any number of sections.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BindingShares {
    seconds: BTreeMap<Binding, f64>,
}

/// One limit's share of the motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Share {
    /// The limit.
    pub limit: Binding,
    /// How long it rules [s].
    pub seconds: f64,
    /// Of all motion time.
    pub share: f64,
}

impl BindingShares {
    /// Adds one section, given what [`rulings`] says of it.
    pub fn add(&mut self, section: &PlannedSection, rulings: &[Binding]) {
        for (span, &limit) in spans(&section.table).zip(rulings) {
            *self.seconds.entry(limit).or_insert(0.0) += span.duration_s;
        }
    }

    /// The shares, the longest first.
    pub fn shares(&self) -> Vec<Share> {
        let total: f64 = self.seconds.values().sum();
        let mut shares: Vec<Share> = self
            .seconds
            .iter()
            .filter(|&(_, &seconds)| seconds > 0.0)
            .map(|(&limit, &seconds)| Share { limit, seconds, share: seconds / total })
            .collect();
        shares.sort_by(|a, b| b.seconds.total_cmp(&a.seconds));
        shares
    }
}

/// What rules each span of a section, read off its table.
///
/// A span counts for the limit that comes nearest to being reached anywhere on it, if it is reached to within
/// [`BINDING`]. A quadratic q cannot hold a limit all along a span, so the places within a span do not count one
/// by one.
pub fn rulings(section: &PlannedSection) -> Vec<Binding> {
    let table = &section.table;
    let last = table.spans().saturating_sub(1);
    let (mut geometry, mut cubics) = (usize::MAX, Vec::new());
    let rule = |span: MotionSpan| {
        if span.geometry != geometry {
            geometry = span.geometry;
            cubics = pieces(table, geometry);
        }
        let rests = span.index == 0 || span.index == last;
        if rests { Binding::Rest } else { ruling(section, &span, &cubics) }
    };
    spans(table).map(rule).collect()
}

/// What rules an inner span.
fn ruling(section: &PlannedSection, span: &MotionSpan, cubics: &[Piece]) -> Binding {
    let (grid, caps) = (&section.table.path.axes, &section.marks.caps);
    let mut axes = vec![AxisState::default(); grid.len()];
    let mut most = (Binding::Free, 1.0 - BINDING);
    for k in 0..PER_SPAN {
        let share = f64::from(k) / f64::from(PER_SPAN - 1);
        let path = span.at_place(share * span.length());
        for ((axis, cubic), grid) in axes.iter_mut().zip(cubics).zip(grid) {
            *axis = span.axis(cubic, grid.lsb, &path);
        }
        // The cap that holds inside the span next to this place.
        let place = span.from as f64 + share * (span.to - span.from) as f64;
        let passed = |until: u64| if k == 0 { until as f64 <= place } else { (until as f64) < place };
        let cap = caps.get(caps.partition_point(|c| passed(c.until))).map_or(SpeedCap::None, |c| c.speed);
        let feed = (Binding::Feed, feed_ratio(cap, path.speed, &axes).unwrap_or(0.0));
        for found in [feed, nearest_limit(&axes, &section.limits)] {
            if found.1 > most.1 {
                most = found;
            }
        }
    }
    most.0
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

    fn shares(section: &PlannedSection) -> Vec<Share> {
        let mut shares = BindingShares::default();
        shares.add(section, &rulings(section));
        shares.shares()
    }

    #[test]
    fn shares_sum_to_one_and_rest_spans_count_as_rest() {
        let section = bent_section();
        let found = shares(&section);
        assert!((found.iter().map(|s| s.share).sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(found.windows(2).all(|w| w[0].seconds >= w[1].seconds));
        let n = section.table.spans();
        let rest = section.table.law(0).duration() + section.table.law(n - 1).duration();
        let of = |limit| found.iter().find(|s| s.limit == limit).map_or(0.0, |s| s.seconds);
        assert!((of(Binding::Rest) - rest).abs() < 1e-9);
        assert!((of(Binding::Free) - (section.table.duration() - rest)).abs() < 1e-9);
        assert_eq!(BindingShares::default().shares(), []);
    }

    #[test]
    fn a_limit_that_is_reached_rules() {
        let mut section = bent_section();
        let table = &section.table;
        let unit = AxisLimits { velocity: 1.0, acceleration: f64::INFINITY, jerk: f64::INFINITY };
        let top = certify(table, &[unit; 2], &[]).velocity_ratio;
        section.limits = vec![AxisLimits { velocity: top, ..unit }; 2];
        assert!(rulings(&section).contains(&Binding::Velocity(0)));
        let speed = certify(table, &[unit; 2], &section.marks.caps).feed_ratio * 25.0;
        section.marks.caps[0].speed = SpeedCap::Tangential { axes: 3, speed };
        assert!(rulings(&section).contains(&Binding::Feed));
    }
}
