//! The rounded values against every row, and what binds where.

use rayon::prelude::*;

use super::layout::Layout;
use super::problem::Binding;
use super::rows::{CellRows, RowBuilder, RowSource, Source, dot};
use crate::feed::table::{FeedTable, SpanLaw};

/// Inner spans checked by one task.
const CHUNK: usize = 512;
/// A limit within this share of its bound binds.
const BINDING_SLACK: f64 = 1e-3;
/// Largest |gamma| w^2 of a table span.
const MOST_CURVED: f64 = 0.25;
/// Longest duration of a table span [s].
const LONGEST_S: f64 = 1.0;
/// Duration that spans which are too long are divided to [s].
const DIVIDED_S: f64 = 0.4;

/// What the rounded values amount to.
#[derive(Clone, Debug)]
pub(super) struct Findings {
    /// Largest row value; a plan keeps every limit when it is at most 1.
    pub(super) worst: f64,
    /// Table span it occurs in.
    pub(super) span: usize,
    /// What binds each table span.
    pub(super) binding: Vec<Binding>,
}

/// Checks all rows at the rounded control values `x`. What rounding may take (`half`) counts as used for `binding`.
pub(super) fn rows(source: &RowSource, x: &[f64], half: &[f64]) -> Findings {
    let m = x.len();
    let starts: Vec<usize> = (0..m).step_by(CHUNK).collect();
    let parts: Vec<Findings> = starts
        .par_iter()
        .map(|&from| {
            let mut builder = RowBuilder::new(source);
            let mut cell = CellRows::default();
            let mut part = Findings { worst: 0.0, span: from + 1, binding: Vec::new() };
            for s in from..(from + CHUNK).min(m) {
                let get = |v: &[f64], j: usize| if j == 0 || j > m { 0.0 } else { v[j - 1] };
                let c = [get(x, s), get(x, s + 1), get(x, s + 2)];
                let half = [get(half, s), get(half, s + 1), get(half, s + 2)];
                let mut nearest = Nearest::default();
                for k in 0..usize::from(source.layout.cells[s + 1]) {
                    builder.cell(s, k, &mut cell);
                    nearest.cell(&cell, &c, &half);
                }
                if nearest.worst > part.worst || nearest.worst.is_nan() {
                    (part.worst, part.span) = (nearest.worst, s + 1);
                }
                part.binding.push(nearest.binding());
            }
            part
        })
        .collect();
    let mut all = Findings { worst: 0.0, span: 1, binding: vec![Binding::Rest] };
    for part in parts {
        if part.worst > all.worst || part.worst.is_nan() {
            (all.worst, all.span) = (part.worst, part.span);
        }
        all.binding.extend(part.binding);
    }
    all.binding.push(Binding::Rest);
    all
}

/// The row nearest to its bound.
#[derive(Default)]
struct Nearest {
    worst: f64,
    used: f64,
    by: Option<Binding>,
}

impl Nearest {
    fn cell(&mut self, rows: &CellRows, c: &[f64; 3], half: &[f64; 3]) {
        let loss = |a: &[f64; 3]| a[0].abs() * half[0] + a[1].abs() * half[1] + a[2].abs() * half[2];
        for row in rows.upper.iter().filter(|row| row.bound > 0.0) {
            self.note(dot(&row.a, c), loss(&row.a), binding(row.source));
        }
        for (a, source) in rows.pairs() {
            self.note(dot(&a, c).abs(), loss(&a), binding(source));
        }
        if rows.jerks.is_empty() {
            return;
        }
        let x = rows.x.map(|x| dot(&x, c));
        self.worst = self.worst.max(tangent_bound(rows, c, &x));
        for (a, k, axis) in rows.forces() {
            // The jerk itself, at the ends of the cell and, by the middle coefficient, in between.
            let root = x[k].max(0.0).sqrt();
            let used = dot(&a, c).abs() * root;
            self.nearest(used + loss(&a) * root, Some(Binding::Jerk(axis)));
        }
    }

    fn note(&mut self, value: f64, loss: f64, by: Option<Binding>) {
        self.worst = if value > self.worst || value.is_nan() { value } else { self.worst };
        self.nearest(value + loss, by);
    }

    fn nearest(&mut self, used: f64, by: Option<Binding>) {
        if used > self.used {
            (self.used, self.by) = (used, by);
        }
    }

    fn binding(&self) -> Binding {
        if self.used < 1.0 - BINDING_SLACK { Binding::Free } else { self.by.unwrap_or(Binding::Free) }
    }
}

/// The ruling that a row at its bound stands for.
fn binding(source: Source) -> Option<Binding> {
    match source {
        Source::Velocity(axis) => Some(Binding::Velocity(axis)),
        Source::Acceleration(axis) => Some(Binding::Acceleration(axis)),
        Source::Jerk(axis) => Some(Binding::Jerk(axis)),
        Source::Feed => Some(Binding::Feed),
        Source::Rest => Some(Binding::Rest),
        Source::Format | Source::Bend => None,
    }
}

/// The largest jerk row at the tangent that makes it smallest: convex in s, golden section.
fn tangent_bound(rows: &CellRows, c: &[f64; 3], x: &[f64; 3]) -> f64 {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let mut force = [0.0f64; 3];
    for (a, k, _) in rows.forces() {
        force[k] = force[k].max(dot(&a, c).abs());
    }
    let at =
        |s: f64| (0..3).map(|k| force[k] / (1.5 * s) + s * s / 3.0 * x[k]).fold(f64::NEG_INFINITY, f64::max);
    // Most cells are well inside at the mean of x already.
    let plain = at((3.0 / (x[0] + x[1] + x[2]).max(f64::MIN_POSITIVE)).sqrt());
    if plain <= 1.0 {
        return plain;
    }
    let low = x.iter().copied().fold(f64::INFINITY, f64::min).max(f64::MIN_POSITIVE);
    let high = x.iter().copied().fold(0.0, f64::max).max(f64::MIN_POSITIVE);
    let (mut a, mut b) = (0.5 / high.sqrt(), 2.0 / low.sqrt());
    let (mut p, mut q) = (b - GOLDEN * (b - a), a + GOLDEN * (b - a));
    let (mut fp, mut fq) = (at(p), at(q));
    for _ in 0..48 {
        if fp < fq {
            (b, q, fq) = (q, p, fp);
            p = b - GOLDEN * (b - a);
            fp = at(p);
        } else {
            (a, p, fp) = (p, q, fq);
            q = a + GOLDEN * (b - a);
            fq = at(q);
        }
    }
    fp.min(fq)
}

/// Into how many parts each span must be divided before the table keeps its format; `None` when it does.
pub(super) fn format(layout: &Layout, table: &FeedTable) -> Option<Vec<u32>> {
    let mut parts = vec![1; layout.spans()];
    let mut sound = true;
    for (i, part) in parts.iter_mut().enumerate() {
        let law = table.law(i);
        let seconds = law.duration();
        if seconds >= LONGEST_S {
            *part = ((seconds / DIVIDED_S).ceil().min(1e6) as u32).next_power_of_two();
            sound = false;
        }
        if let SpanLaw::Quadratic { h, q: [alpha, beta, gamma] } = law {
            let end = alpha + h * (beta + h * gamma);
            let w = h / (alpha.max(0.0).sqrt() + end.max(0.0).sqrt());
            let curved = (gamma * w * w).abs();
            if curved > MOST_CURVED || alpha <= 0.0 || end <= 0.0 {
                // At the same q, the argument falls with the square of the length.
                let parts = (1.2 * (curved / MOST_CURVED).sqrt()).ceil().clamp(2.0, 8.0);
                *part = (*part).max((parts as u32).next_power_of_two());
                sound = false;
            }
        }
    }
    (!sound).then_some(parts)
}
