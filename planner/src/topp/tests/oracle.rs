//! Dense sampling of a table's motion by direct formulas.

use crate::feed::table::{FeedTable, SpanLaw};
use crate::geometry::section::SpeedCap;
use crate::topp::problem::{Binding, Plan, Problem};
use crate::topp::rows::SPANS_PER_TICK;
use crate::topp::sweep::Sweep;

/// Largest ratios of value to limit that sampling finds.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Oracle {
    pub(super) velocity: f64,
    pub(super) acceleration: f64,
    pub(super) jerk: f64,
    pub(super) feed: f64,
    pub(super) shortest_s: f64,
    pub(super) longest_s: f64,
    pub(super) curved: f64,
}

const SAMPLES: usize = 100;

impl Oracle {
    pub(super) fn of(problem: &Problem, table: &FeedTable) -> Self {
        let mut worst = Oracle { shortest_s: f64::INFINITY, ..Oracle::default() };
        let path = &table.path;
        let mut knot = 0u64;
        let mut g = 0;
        for i in 0..table.spans() {
            while path.breaks[g + 1] <= knot {
                g += 1;
            }
            let law = table.law(i);
            let seconds = law.duration();
            assert!(seconds.is_finite() && seconds > 0.0);
            worst.shortest_s = worst.shortest_s.min(seconds);
            worst.longest_s = worst.longest_s.max(seconds);
            let offset = (knot - path.breaks[g]) as f64 * path.step;
            let pieces: Vec<_> = (0..path.axes.len()).map(|a| path.piece(a, g)).collect();
            if let SpanLaw::Quadratic { h, q } = law {
                let end = q[0] + h * (q[1] + h * q[2]);
                let w = h / (q[0].sqrt() + end.sqrt());
                worst.curved = worst.curved.max((q[2] * w * w).abs());
            }
            for k in 0..=SAMPLES {
                let t = k as f64 / SAMPLES as f64;
                let (x, v, a, j) = motion(&law, t);
                let speed_at = |mask: u16| {
                    (0..pieces.len())
                        .filter(|axis| mask >> axis & 1 == 1)
                        .map(|axis| (pieces[axis].first(offset + x) * v).powi(2))
                        .sum::<f64>()
                        .sqrt()
                };
                for (p, l) in pieces.iter().zip(problem.limits) {
                    let x = offset + x;
                    let (p1, p2, p3) = (p.first(x), p.second(x), p.third());
                    worst.velocity = worst.velocity.max((p1 * v).abs() / l.velocity);
                    worst.acceleration = worst.acceleration.max((p2 * v * v + p1 * a).abs() / l.acceleration);
                    let jerk = (p3 * v * v * v + 3.0 * p2 * v * a + p1 * j).abs() / l.jerk;
                    worst.jerk = worst.jerk.max(jerk);
                }
                let at = knot as f64 + x / path.step;
                let mut from = 0.0;
                for c in problem.caps {
                    if (from..=c.until as f64).contains(&at) {
                        let ratio = match c.speed {
                            SpeedCap::None => 0.0,
                            SpeedCap::Rate(rate) => v / rate,
                            SpeedCap::Tangential { axes, speed } => speed_at(axes) / speed,
                        };
                        // At a step of the cap itself either side may rule.
                        if at > from + 1e-6 && at < c.until as f64 - 1e-6 {
                            worst.feed = worst.feed.max(ratio);
                        }
                    }
                    from = c.until as f64;
                }
            }
            knot += u64::from(table.steps[i]);
        }
        assert_eq!(knot, path.grid_length());
        worst
    }

    pub(super) fn assert_sound(&self, problem: &Problem, plan: &Plan) {
        const ROOM: f64 = 1.0 + 1e-6;
        let text = format!("{self:?}");
        assert!(self.velocity <= ROOM && self.acceleration <= ROOM, "{text}");
        assert!(self.jerk <= ROOM && self.feed <= ROOM, "{text}");
        let shortest = problem.control_tick_s / SPANS_PER_TICK;
        assert!(self.shortest_s >= shortest * (1.0 - 1e-6), "{text}");
        assert!(self.longest_s < 1.0 && self.curved <= 0.25, "{text}");
        assert!(plan.table.codes.iter().all(|&c| c > 0));
        assert_eq!(plan.table.codes.len() + 2, plan.table.spans());
        assert_eq!(plan.binding.len(), plan.table.spans());
        assert_eq!(plan.binding[0], Binding::Rest);
        let sweep = Sweep::new(problem).duration();
        assert!(plan.table.duration() > 0.995 * sweep, "{} below the sweep {sweep}", plan.table.duration());
    }
}

/// Largest jerk^2/J^2 that Bernstein coefficients of f^2 q leave possible within the inner spans, each divided into
/// 16 parts.
pub(super) fn certified_jerk(problem: &Problem, table: &FeedTable) -> f64 {
    const PARTS: usize = 16;
    let path = &table.path;
    let (mut knot, mut g, mut worst) = (0u64, 0, 0.0f64);
    for i in 0..table.spans() {
        while path.breaks[g + 1] <= knot {
            g += 1;
        }
        let offset = (knot - path.breaks[g]) as f64 * path.step;
        knot += u64::from(table.steps[i]);
        let SpanLaw::Quadratic { h, q } = table.law(i) else { continue };
        for (axis, l) in problem.limits.iter().enumerate() {
            let p = path.piece(axis, g);
            let at = |x: f64| q[0] + x * (q[1] + x * q[2]);
            let f = |x: f64| {
                let u = offset + x;
                p.third() * at(x) + 1.5 * p.second(u) * (q[1] + 2.0 * q[2] * x) + p.first(u) * q[2]
            };
            for part in 0..PARTS {
                let (a, b) = (h * part as f64 / PARTS as f64, h * (part + 1) as f64 / PARTS as f64);
                let (fb, qb) = (quadratic(f, a, b), quadratic(at, a, b));
                let jerk = product(&product(&fb, &fb), &qb);
                worst = jerk.into_iter().fold(worst, |w, c| w.max(c / (l.jerk * l.jerk)));
            }
        }
    }
    worst
}

/// Bernstein coefficients over [a, b] of a quadratic, from its values.
fn quadratic(f: impl Fn(f64) -> f64, a: f64, b: f64) -> Vec<f64> {
    let (start, middle, end) = (f(a), f(0.5 * (a + b)), f(b));
    vec![start, 2.0 * middle - 0.5 * (start + end), end]
}

/// Bernstein coefficients of a product.
fn product(a: &[f64], b: &[f64]) -> Vec<f64> {
    let (n, m) = (a.len() - 1, b.len() - 1);
    let choose = |n: usize, k: usize| (0..k).fold(1.0, |c, i| c * (n - i) as f64 / (i + 1) as f64);
    let mut c = vec![0.0; n + m + 1];
    for (i, a) in a.iter().enumerate() {
        for (j, b) in b.iter().enumerate() {
            c[i + j] += choose(n, i) * choose(m, j) / choose(n + m, i + j) * a * b;
        }
    }
    c
}

/// x, dx/dt, d2x/dt2, d3x/dt3 at share `t` of a span: of its time for rest spans, of its length otherwise.
fn motion(law: &SpanLaw, t: f64) -> (f64, f64, f64, f64) {
    match *law {
        SpanLaw::Launch { h, duration: d } => {
            (h * t.powi(3), 3.0 * h * t * t / d, 6.0 * h * t / (d * d), 6.0 * h / d.powi(3))
        }
        SpanLaw::Landing { h, duration: d } => {
            let r = 1.0 - t;
            (h - h * r.powi(3), 3.0 * h * r * r / d, -6.0 * h * r / (d * d), 6.0 * h / d.powi(3))
        }
        SpanLaw::Quadratic { h, q } => {
            let x = h * t;
            let v = (q[0] + x * (q[1] + x * q[2])).sqrt();
            (x, v, 0.5 * q[1] + q[2] * x, q[2] * v)
        }
    }
}
