//! Where coarse knots cost time, and how finely they should be divided.
//!
//! Within a span q'' stands still, and with it the jerk along the path, nearly. The fastest motion switches between
//! its jerk limits; a span across a switch has to make do with something in between. How far the jerk of a span is from
//! its neighbours', in units of what the limits allow, tells where that happens.

use super::layout::{Derivatives, Layout, Pieces};
use super::problem::{Problem, Settings};
use super::rounding;
use crate::feed::table::{FeedTable, SpanLaw};
use crate::job::machine::AxisLimits;

/// Time lost per span time and squared unevenness: 0.10 to 0.26 on part programs of several kinds, against knots eight
/// times as dense.
const LOSS: f64 = 0.15;
/// Unevenness from which a span gets two parts, and from which it gets three.
const TWO_PARTS: f64 = 0.1;
const THREE_PARTS: f64 = 0.15;
/// Divided spans are this many control ticks long or longer, and rounding takes at most this share of a limit.
const CLEAR_TICKS: f64 = 1.3;
const ROUNDING_SHARE: f64 = 0.02;

/// Into how many parts each span should be divided; `None` where that would save less than the settings ask for.
pub(super) fn parts(
    problem: &Problem,
    settings: &Settings,
    layout: &Layout,
    table: &FeedTable,
) -> Option<Vec<u32>> {
    // du/dt of the smallest code.
    let step = f64::from(table.q_scale).sqrt();
    let n = layout.spans();
    let spans: Vec<Span> = spans(problem, layout, table, step).collect();
    let uneven = |i: usize| {
        let jump = |j: usize| (spans[j].jerk - spans[j - 1].jerk).abs();
        0.5 * jump(i).max(jump(i + 1))
    };
    let mut parts = vec![1; n];
    let (mut lost, mut total) = (0.0, spans[0].seconds + spans[n - 1].seconds);
    for i in 1..n - 1 {
        let Span { seconds, shortest_s, .. } = spans[i];
        let uneven = uneven(i).min(1.0);
        total += seconds;
        let wanted = match uneven {
            u if u > THREE_PARTS => 3,
            u if u > TWO_PARTS => 2,
            _ => 1,
        };
        let most = (seconds / shortest_s).max(1.0) as u32;
        parts[i] = wanted.min(most).min((layout.knots[i + 1] - layout.knots[i]).min(3) as u32);
        if parts[i] > 1 {
            lost += LOSS * seconds * uneven * uneven;
        }
    }
    (lost > settings.largest_loss * total).then_some(parts)
}

/// What is to be known of a span.
struct Span {
    seconds: f64,
    /// Jerk along the path in units of the largest that the axes' limits allow.
    jerk: f64,
    /// Shortest part it may be divided into [s].
    shortest_s: f64,
}

fn spans<'a>(
    problem: &'a Problem,
    layout: &'a Layout,
    table: &'a FeedTable,
    step: f64,
) -> impl Iterator<Item = Span> + 'a {
    let path = problem.path;
    let mut pieces = Pieces::new(path);
    (0..layout.spans()).map(move |i| {
        let law = table.law(i);
        let seconds = law.duration();
        let h = layout.h[i];
        let jerk = match law {
            SpanLaw::Quadratic { q, .. } => q[2] * h / seconds,
            SpanLaw::Launch { .. } | SpanLaw::Landing { .. } => 6.0 * h / seconds.powi(3),
        };
        let g = layout.geometry[i] as usize;
        let offset = (layout.knots[i] - path.breaks[g]) as f64 * path.step;
        let slopes = pieces.at(g).iter().map(|p| Derivatives::of(p, offset, h).first_max());
        let (mut shortest_s, mut most) = (CLEAR_TICKS * problem.control_tick_s, f64::INFINITY);
        for (slope, l) in slopes.zip(problem.limits).filter(|(slope, _)| *slope > 0.0) {
            shortest_s = shortest_s.max(rounding::shortest_s(slope, l, step, ROUNDING_SHARE));
            most = most.min(most_jerk(l, seconds) / slope);
        }
        Span { seconds, jerk: if most.is_finite() { jerk / most } else { 0.0 }, shortest_s }
    })
}

/// Largest jerk that matters to a span: where it is not limited, what turns the acceleration round within it.
fn most_jerk(limits: &AxisLimits, seconds: f64) -> f64 {
    limits.jerk.min(2.0 * limits.acceleration / seconds)
}
