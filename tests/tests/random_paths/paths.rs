//! Random paths: C2 cubic splines with integer knots and control points.

use planner::geometry::grid_path::{GridAxis, GridPath};

use crate::chance::Chance;

/// The shape of a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Shape {
    /// A walk that turns a little or sharply.
    Walk,
    /// Straight.
    Line,
    /// One axis moves to and fro, the others stand still.
    OneAxis,
    /// A circle or helix.
    Round,
    /// Legs with sharp turns between them.
    Zigzag,
    /// A walk on which the slope of all axes vanishes at places.
    Cusp,
    /// A walk and the same way back.
    Reversal,
    /// A line with control points that repeat.
    Repeats,
}

const SHAPES: [Shape; 8] = [
    Shape::Walk,
    Shape::Line,
    Shape::OneAxis,
    Shape::Round,
    Shape::Zigzag,
    Shape::Cusp,
    Shape::Reversal,
    Shape::Repeats,
];

/// Any shape.
pub(crate) fn shape(chance: &mut Chance) -> Shape {
    SHAPES[chance.below(SHAPES.len())]
}

/// A path of so many axes; `scale` is the order of its length in u.
pub(crate) fn path(chance: &mut Chance, shape: Shape, axes: usize, scale: f64) -> GridPath {
    let spans = match chance.below(8) {
        0 => 1,
        1..6 => 2 + chance.below(12),
        6 => 14 + chance.below(30),
        _ => 44 + chance.below(120),
    };
    let bits = 12 + chance.below(13) as i32;
    let spacing = scale / spans as f64;
    let step = (spacing.log2().floor() as i32 - bits) as f64;
    let step = step.exp2();
    let mut breaks = breaks(chance, spans, spacing / step);
    if shape == Shape::Reversal {
        let length = breaks[spans];
        let back: Vec<u64> = breaks[..spans].iter().rev().map(|b| 2 * length - b).collect();
        breaks.extend(back);
    }
    let nodes: Vec<f64> = greville(&breaks).iter().map(|g| g * step).collect();
    let mut points = match shape {
        Shape::Line | Shape::Repeats => line(chance, axes, &nodes),
        Shape::OneAxis => one_axis(chance, axes, &nodes),
        Shape::Round => round(chance, axes, &nodes),
        Shape::Zigzag => walk(chance, axes, &nodes, 3.0),
        Shape::Walk | Shape::Cusp | Shape::Reversal => {
            let turn = chance.decades(-2.0, 0.5);
            walk(chance, axes, &nodes, turn)
        }
    };
    match shape {
        Shape::Cusp | Shape::Repeats => repeat(chance, &mut points, 2..4),
        Shape::Reversal => {
            let n = points.len();
            (0..n / 2).for_each(|i| points[n - 1 - i] = points[i].clone());
        }
        _ => {}
    }
    let lsb = ((spacing.log2().floor() as i32 - 20 - chance.below(8) as i32) as f64).exp2();
    let axes = (0..axes)
        .map(|a| GridAxis { lsb, controls: points.iter().map(|p| (p[a] / lsb).round() as i64).collect() })
        .collect();
    GridPath { step, breaks, axes }
}

/// Knots about `spacing` grid steps apart, or over a decade.
fn breaks(chance: &mut Chance, spans: usize, spacing: f64) -> Vec<u64> {
    let decades = if chance.one_in(3) { 1.0 } else { 0.0 };
    let mut breaks = vec![0];
    for k in 0..spans {
        let length = (spacing * chance.decades(-decades, 0.0)).round().max(1.0);
        breaks.push(breaks[k] + length as u64);
    }
    // The format's least.
    let short = 5u64.saturating_sub(breaks[spans]);
    breaks[spans] += short;
    breaks
}

/// Abscissae of the control points [grid steps].
fn greville(breaks: &[u64]) -> Vec<f64> {
    let last = breaks.len() as isize - 1;
    let knot = |k: isize| breaks[k.clamp(0, last) as usize] as f64;
    (0..last + 3).map(|i| (knot(i - 2) + knot(i - 1) + knot(i)) / 3.0).collect()
}

/// Largest slope of the control polygons: no axis is steeper.
pub(crate) fn steepest(path: &GridPath) -> f64 {
    let nodes = greville(&path.breaks);
    let slopes = path.axes.iter().flat_map(|axis| {
        let legs = nodes.windows(2).zip(axis.controls.windows(2));
        legs.map(|(u, c)| c[1].abs_diff(c[0]) as f64 * axis.lsb / ((u[1] - u[0]) * path.step))
    });
    slopes.fold(0.0, f64::max)
}

fn unit(chance: &mut Chance, axes: usize) -> Vec<f64> {
    let mut d: Vec<f64> = (0..axes).map(|_| chance.within(-1.0, 1.0)).collect();
    normalise(&mut d);
    d
}

fn normalise(d: &mut [f64]) {
    let norm = d.iter().map(|d| d * d).sum::<f64>().sqrt().max(1e-3);
    d.iter_mut().for_each(|d| *d /= norm);
}

fn walk(chance: &mut Chance, axes: usize, nodes: &[f64], turn: f64) -> Vec<Vec<f64>> {
    let mut direction = unit(chance, axes);
    let extent = nodes[nodes.len() - 1] * chance.decades(-2.0, 2.0);
    let mut at: Vec<f64> = (0..axes).map(|_| extent * chance.within(-1.0, 1.0)).collect();
    let mut points = vec![at.clone()];
    for leg in nodes.windows(2) {
        direction.iter_mut().for_each(|d| *d += turn * chance.within(-1.0, 1.0));
        normalise(&mut direction);
        at.iter_mut().zip(&direction).for_each(|(p, d)| *p += d * (leg[1] - leg[0]));
        points.push(at.clone());
    }
    points
}

fn line(chance: &mut Chance, axes: usize, nodes: &[f64]) -> Vec<Vec<f64>> {
    let mut direction = unit(chance, axes);
    if chance.one_in(3) {
        // Axes that hardly move.
        direction[1..].iter_mut().for_each(|d| *d *= chance.decades(-6.0, 0.0));
    }
    nodes.iter().map(|u| direction.iter().map(|d| d * u).collect()).collect()
}

fn one_axis(chance: &mut Chance, axes: usize, nodes: &[f64]) -> Vec<Vec<f64>> {
    let moving = chance.below(axes);
    let turns = chance.within(0.0, 6.0);
    let length = nodes[nodes.len() - 1];
    let straight = chance.one_in(2);
    let at = |u: f64| if straight { u } else { length * (turns * u / length).sin() / turns.max(1.0) };
    nodes.iter().map(|u| (0..axes).map(|a| if a == moving { at(*u) } else { 0.0 }).collect()).collect()
}

fn round(chance: &mut Chance, axes: usize, nodes: &[f64]) -> Vec<Vec<f64>> {
    let length = nodes[nodes.len() - 1];
    let most = (nodes.len() as f64 / 6.0).max(0.3);
    let radius = length / (std::f64::consts::TAU * chance.within(0.05, most));
    let rise: Vec<f64> = (0..axes).map(|_| chance.within(-0.5, 0.5)).collect();
    let at = |u: f64, a: usize| match a {
        0 => radius * (u / radius).sin(),
        1 => radius * (u / radius).cos(),
        _ => rise[a] * u,
    };
    nodes.iter().map(|&u| (0..axes).map(|a| at(u, a)).collect()).collect()
}

/// Repeats control points at up to three places, so many in a row. Four in a row would be a span along which nothing
/// moves: no motion, and refused.
fn repeat(chance: &mut Chance, points: &mut Vec<Vec<f64>>, count: std::ops::Range<usize>) {
    for _ in 0..3 {
        let run = count.start + chance.below(count.len());
        if run >= points.len() {
            continue;
        }
        let first = chance.below(points.len() - run);
        let mut repeated = points.clone();
        let shared = &points[first];
        repeated[first..first + run].iter_mut().for_each(|p| p.clone_from(shared));
        if repeated.windows(4).all(|w| w.iter().any(|p| *p != w[0])) {
            *points = repeated;
        }
    }
}
