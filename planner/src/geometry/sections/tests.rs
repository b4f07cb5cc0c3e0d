use std::convert::Infallible;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

use proptest::prelude::*;

use super::*;
use crate::geometry::grid_path::GridPath;
use crate::geometry::section::SpeedCap;
use crate::job::machine::{Axis, AxisKind, CornerMode, OverrideRule, Plant, Servo, Unit};
use crate::job::program::{Arc, Corner, Feed, Move, Shape, ToleranceSource};

fn axis(name: &str, kind: AxisKind, counts_per_unit: f64) -> Axis {
    let limits = AxisLimits { velocity: 150.0, acceleration: 1500.0, jerk: 5e4 };
    let unit = if kind == AxisKind::Linear { Unit::Mm } else { Unit::Deg };
    Axis {
        name: name.into(),
        kind,
        unit,
        counts_per_unit,
        travel: [-1e7, 1e7],
        limits,
        rapid: limits,
        headroom: [1.0; 3],
        plant: Plant {
            inertia: 1.0,
            viscous: 0.0,
            coulomb: 0.0,
            effort_limit: 1e3,
            encoder_counts_per_count: 1.0,
            two_mass: None,
        },
        servo: Servo {
            position_gain: 50.0,
            velocity_bandwidth: 500.0,
            integral_time_s: 0.02,
            velocity_feed_forward: 1.0,
            acceleration_feed_forward: 1.0,
        },
    }
}

fn machine(axes: Vec<Axis>) -> Machine {
    Machine {
        name: "test".into(),
        control_tick_s: 1e-3,
        tolerance_mm: 0.01,
        tolerance_rotary: 0.02,
        best_speed_mm: 0.05,
        exact_path_mm: 0.001,
        corner: CornerMode::Blend,
        axes,
        home: [0.0; MAX_AXES],
        second_home: [0.0; MAX_AXES],
        tools: Vec::new(),
        override_rule: OverrideRule::default(),
    }
}

fn mill() -> Machine {
    machine(["X", "Y", "Z"].map(|n| axis(n, AxisKind::Linear, 1e4)).into())
}

fn point(xyz: &[f64]) -> Point {
    let mut p = [0.0; MAX_AXES];
    p[..xyz.len()].copy_from_slice(xyz);
    p
}

/// A program under construction.
struct Program {
    at: Point,
    corner: Corner,
    feed: Option<Feed>,
    items: Vec<Item>,
}

impl Program {
    fn new(start: &[f64], corner: Corner) -> Self {
        Self { at: point(start), corner, feed: Some(Feed::Speed(20.0)), items: Vec::new() }
    }

    fn go(&mut self, kind: MoveKind, shape: Shape, end: Point) {
        let feed = if kind == MoveKind::Feed { self.feed } else { None };
        let line = self.items.len() as u32 + 1;
        self.items.push(Item::Move(Move {
            kind,
            shape,
            start: self.at,
            end,
            feed,
            corner: self.corner,
            line,
        }));
        self.at = end;
    }

    fn line(&mut self, xyz: &[f64]) -> &mut Self {
        self.go(MoveKind::Feed, Shape::Line, point(xyz));
        self
    }

    fn rapid(&mut self, xyz: &[f64]) -> &mut Self {
        self.go(MoveKind::Rapid, Shape::Line, point(xyz));
        self
    }

    /// An arc in `plane` whose centre lies `radius` away in the direction `angle + pi`; all axes move by `rise`.
    fn arc(&mut self, plane: [usize; 2], radius: f64, angle: f64, sweep: f64, rise: f64) -> &mut Self {
        let centre = [self.at[plane[0]] - radius * angle.cos(), self.at[plane[1]] - radius * angle.sin()];
        let mut end = self.at;
        end[3 - plane[0] - plane[1]] += rise;
        end[plane[0]] = centre[0] + radius * (angle + sweep).cos();
        end[plane[1]] = centre[1] + radius * (angle + sweep).sin();
        let arc = Arc { plane, centre, radius, radius_change: 0.0, start_angle: angle, sweep };
        self.go(MoveKind::Feed, Shape::Arc(arc), end);
        self
    }

    fn run(&self, machine: &Machine) -> Vec<Section> {
        let mut found = Vec::new();
        for item in sections(self.stream(), machine, &PathSettings::of(machine, LimitSet::default())) {
            if let SectionItem::Section(s) = item.expect("the program is sound") {
                found.push(s);
            }
        }
        found
    }

    fn stream(&self) -> impl Iterator<Item = Result<Item, Infallible>> {
        self.items.clone().into_iter().map(Ok)
    }

    fn moves(&self) -> impl Iterator<Item = &Move> {
        self.items.iter().filter_map(|i| if let Item::Move(m) = i { Some(m) } else { None })
    }

    /// The programmed contour as a fine polyline.
    fn contour(&self) -> Vec<Point> {
        self.moves().flat_map(|m| sampled(m, 1e-5)).collect()
    }
}

/// Points on a move, close enough that chords are within `fine` of it.
fn sampled(m: &Move, fine: f64) -> Vec<Point> {
    let straight = |t: f64| -> Point { std::array::from_fn(|a| m.start[a] + t * (m.end[a] - m.start[a])) };
    let Shape::Arc(arc) = m.shape else { return vec![straight(0.0), straight(1.0)] };
    let step = (8.0 * fine / arc.radius).sqrt().min(0.1);
    let parts = (arc.sweep.abs() / step).ceil();
    (0..=parts as usize)
        .map(|i| {
            let t = i as f64 / parts;
            let mut p = straight(t);
            let angle = arc.start_angle + arc.sweep * t;
            p[arc.plane[0]] = arc.centre[0] + arc.radius * angle.cos();
            p[arc.plane[1]] = arc.centre[1] + arc.radius * angle.sin();
            p
        })
        .collect()
}

/// De Boor's algorithm on the path's integers.
fn de_boor(path: &GridPath, axis: usize, span: usize, u: f64) -> f64 {
    let last = path.breaks.len() as isize - 1;
    let knot = |i: usize| {
        let k = (i as isize - 3).clamp(0, last) as usize;
        path.breaks[k] as f64 * path.step
    };
    let j = span + 3;
    let a = &path.axes[axis];
    let mut d: Vec<f64> = (0..4).map(|k| a.controls[span + k] as f64 * a.lsb).collect();
    for r in 1..4 {
        for k in (r..4).rev() {
            let i = j + k - 3;
            let w = (u - knot(i)) / (knot(i + 4 - r) - knot(i));
            d[k] = (1.0 - w) * d[k - 1] + w * d[k];
        }
    }
    d[3]
}

fn path_points(path: &GridPath, per_span: usize) -> Vec<Point> {
    let mut points = Vec::new();
    for span in 0..path.spans() {
        let (a, b) = (path.breaks[span] as f64 * path.step, path.breaks[span + 1] as f64 * path.step);
        for i in 0..=per_span {
            let u = a + (b - a) * i as f64 / per_span as f64;
            let mut p = [0.0; MAX_AXES];
            for (axis, p) in p.iter_mut().enumerate().take(path.axes.len()) {
                *p = de_boor(path, axis, span, u);
            }
            points.push(p);
        }
    }
    points
}

fn to_segment(p: &Point, a: &Point, b: &Point) -> f64 {
    let dot = |x: &Point, y: &Point| x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
    let ab: Point = std::array::from_fn(|i| b[i] - a[i]);
    let ap: Point = std::array::from_fn(|i| p[i] - a[i]);
    let t = if dot(&ab, &ab) > 0.0 { (dot(&ap, &ab) / dot(&ab, &ab)).clamp(0.0, 1.0) } else { 0.0 };
    let d: Point = std::array::from_fn(|i| ap[i] - t * ab[i]);
    dot(&d, &d).sqrt()
}

/// Largest distance from a point of `from` (and points between them) to the polyline `to`.
fn one_way(from: &[Point], to: &[Point], between: usize) -> f64 {
    let mut worst = 0.0f64;
    let mut near = 0;
    for pair in from.windows(2) {
        for i in 0..between {
            let t = i as f64 / between as f64;
            let p: Point = std::array::from_fn(|a| pair[0][a] + t * (pair[1][a] - pair[0][a]));
            // Start from where the last point was nearest: any segment close enough will do.
            let mut best = f64::INFINITY;
            for k in (near..to.len() - 1).chain(0..near) {
                let d = to_segment(&p, &to[k], &to[k + 1]);
                if d < best {
                    (best, near) = (d, k);
                }
                if best <= worst {
                    break;
                }
            }
            worst = worst.max(best);
        }
    }
    worst
}

/// Everything that must hold for any program.
fn examine(program: &Program, machine: &Machine) -> Vec<Section> {
    let found = program.run(machine);
    let contour = program.contour();
    let size = contour.iter().flatten().fold(1.0f64, |m, v| m.max(v.abs()));
    let (mut bound, mut whole) = (0.0f64, Vec::new());
    let mut at: Option<Vec<i64>> = None;
    for s in &found {
        let d = s.marks.deviation;
        assert!(d.bound_mm <= d.tolerance_mm, "{d:?}");
        bound = bound.max(d.bound_mm);
        assert!(s.path.breaks.windows(2).all(|w| w[0] < w[1]));
        assert_eq!(s.marks.caps.last().map(|c| c.until), Some(s.path.grid_length()));
        assert_eq!(s.marks.blocks.last().map(|c| c.until), Some(s.path.grid_length()));
        assert!(s.marks.caps.windows(2).all(|w| w[0].until < w[1].until && w[0].speed != w[1].speed));
        assert!(s.marks.blocks.windows(2).all(|w| w[0].until < w[1].until && w[0].line != w[1].line));
        let counts = |i: usize| -> Vec<i64> {
            let axes = s.path.axes.iter().zip(&machine.axes);
            axes.map(|(g, axis)| {
                let divisions = (1.0 / (g.lsb * axis.counts_per_unit)).round() as i64;
                assert_eq!(g.controls[i] % divisions, 0, "ends are whole counts");
                g.controls[i] / divisions
            })
            .collect()
        };
        if let Some(at) = &at {
            assert_eq!(&counts(0), at, "starts where the last one ended");
        }
        at = Some(counts(s.path.spans() + 2));
        for (g, axis) in s.path.axes.iter().zip(&machine.axes) {
            let fraction_bits = -(g.lsb * axis.counts_per_unit).log2().round();
            assert!((0.0..=f64::from(rules::MAX_FRACTION_BITS)).contains(&fraction_bits));
            let furthest = rules::MAX_CONTROL_STEP << fraction_bits as u32;
            assert!(g.controls.windows(2).all(|c| (c[1] - c[0]).abs() < furthest));
        }
        assert!(rules::STEP_EXPONENT.contains(&(s.path.step.log2() as i8)));
        assert!(s.path.breaks.windows(2).all(|w| w[1] - w[0] < u64::from(rules::MAX_GEOMETRY_LENGTH)));
        for span in 0..s.path.spans() {
            let pieces: Vec<_> = (0..s.path.axes.len()).map(|a| s.path.piece(a, span)).collect();
            for i in 0..=20 {
                let x = pieces[0].length * f64::from(i) / 20.0;
                let speed = pieces.iter().map(|p| p.first(x).powi(2)).sum::<f64>().sqrt();
                assert!(speed > 0.04, "|r'| = {speed} in span {span}");
                for (p, axis) in pieces.iter().zip(&machine.axes) {
                    assert!(p.offset(x).abs() * axis.counts_per_unit < f64::from(1 << 20));
                }
            }
        }
        whole.extend(path_points(&s.path, 200));
    }
    if let (Some(at), Some(last)) = (&at, contour.last()) {
        for (a, axis) in machine.axes.iter().enumerate() {
            assert_eq!(at[a], (last[a] * axis.counts_per_unit).round() as i64);
        }
    }
    // Sampled chords and far coordinates are not exact either.
    let slop = 1.2e-5 + 1e-13 * size + 1e-3 * bound;
    if !whole.is_empty() {
        let there = one_way(&whole, &contour, 1);
        assert!(there <= bound + slop, "path to contour {there}, proven {bound}");
        // Sub-count moves make no section; a count diagonal is inside every tolerance.
        let back = one_way(&contour, &whole, 20);
        assert!(back <= bound.max(1.8e-4) + slop, "contour to path {back}, proven {bound}");
    }
    found
}

const FINE: Corner = within(0.01);

const fn within(tolerance_mm: f64) -> Corner {
    Corner::Within { tolerance_mm, source: ToleranceSource::Program }
}

#[test]
fn a_line_is_one_exact_section() {
    let mut p = Program::new(&[0.1, 0.2, 0.3], FINE);
    p.line(&[30.0, -17.0, 4.0]);
    let found = examine(&p, &mill());
    assert_eq!(found.len(), 1);
    assert!(found[0].path.spans() <= 2, "{}", found[0].path.spans());
    assert!(found[0].marks.deviation.bound_mm < 2e-4);
    assert_eq!(found[0].marks.end, StopCause::ProgramEnd);
}

#[test]
fn a_micrometre_move_works() {
    let mut p = Program::new(&[5.0, 0.0, 0.0], FINE);
    p.line(&[5.001, 0.0, 0.0]);
    let found = examine(&p, &mill());
    assert_eq!(found[0].path.axes[0].controls.last(), found[0].path.axes[0].controls.iter().max());
    assert!(found[0].path.grid_length() >= 1000);
}

#[test]
fn corners_are_rounded_within_the_tolerance_and_use_it() {
    for degrees in [5.0, 30.0, 90.0, 135.0, 165.0f64] {
        let mut p = Program::new(&[0.0], FINE);
        let (sin, cos) = degrees.to_radians().sin_cos();
        p.line(&[20.0]).line(&[20.0 + 20.0 * cos, 20.0 * sin]);
        let found = examine(&p, &mill());
        assert_eq!(found.len(), 1);
        let bound = found[0].marks.deviation.bound_mm;
        assert!(bound > 0.005, "{degrees} degrees: {bound}");
    }
}

#[test]
fn arcs_and_helices_in_every_plane() {
    for plane in [[0, 1], [2, 0], [1, 2]] {
        let mut p = Program::new(&[1.0, 2.0, 3.0], FINE);
        p.arc(plane, 10.0, 0.3, 2.0, 0.0)
            .arc(plane, 3.0, 2.3, -3.0 * TAU, 5.0)
            .arc(plane, 0.5, 1.0, PI, -1.0);
        examine(&p, &mill());
    }
}

#[test]
fn a_full_circle_is_not_a_zero_move() {
    let mut p = Program::new(&[0.0], FINE);
    p.arc([0, 1], 5.0, 0.0, TAU, 0.0);
    let found = examine(&p, &mill());
    assert_eq!(found.len(), 1);
    assert!((found[0].path.length() - 5.0 * TAU).abs() < 0.01);
}

#[test]
fn a_tangent_arc_joint_needs_no_stop_even_on_an_exact_path() {
    let mut p = Program::new(&[0.0], Corner::Exact);
    p.line(&[20.0]).arc([0, 1], 10.0, -FRAC_PI_2, PI, 0.0).line(&[0.0, 20.0]);
    let found = examine(&p, &mill());
    assert_eq!(found.len(), 1);
    assert!(found[0].marks.deviation.bound_mm <= 0.001);
}

#[test]
fn exact_corners_reversals_stops_and_rapids_end_sections() {
    let mut p = Program::new(&[0.0], Corner::Exact);
    p.line(&[10.0]).line(&[10.0, 10.0]);
    p.corner = FINE;
    p.line(&[10.0, 20.0]).line(&[10.0, 5.0]);
    p.corner = Corner::Stop;
    p.line(&[10.0, 0.0]);
    p.corner = FINE;
    p.line(&[10.0, -5.0]).rapid(&[0.0]).rapid(&[5.0]).line(&[6.0]);
    p.items.push(Item::Dwell { seconds: 0.5, line: 90 });
    p.line(&[7.0]);
    p.corner = within(0.0);
    p.line(&[8.0]).line(&[8.0, 1.0]);
    p.items.push(Item::Stop { cause: StopCause::ToolChange, line: 91 });
    let machine = mill();
    let found = examine(&p, &machine);
    let ends: Vec<_> = found.iter().map(|s| s.marks.end).collect();
    use StopCause::{Dwell, ExactPathCorner, ExactStop, Rapid, Reversal, ToolChange};
    let expected =
        [ExactPathCorner, Reversal, ExactStop, Rapid, Rapid, Rapid, Dwell, ExactPathCorner, ToolChange];
    assert_eq!(ends, expected);
    let mut all = sections(p.stream(), &machine, &PathSettings::of(&machine, LimitSet::default()));
    let items: Vec<_> = all.by_ref().map(Result::unwrap).collect();
    assert!(items.contains(&SectionItem::Dwell { seconds: 0.5, line: 90 }));
    assert_eq!(items.last(), Some(&SectionItem::Stop { cause: ToolChange, line: 91 }));
    assert_eq!(all.stops()[&ExactPathCorner], 2);
    assert_eq!(all.counts(), Some(&[80_000, 10_000, 0][..]));
}

#[test]
fn zero_moves_vanish_but_their_stop_stays() {
    let mut p = Program::new(&[0.0], FINE);
    p.line(&[10.0]).line(&[10.0]);
    p.corner = Corner::Stop;
    p.line(&[10.0]);
    p.corner = FINE;
    p.line(&[20.0]);
    let ends: Vec<_> = examine(&p, &mill()).iter().map(|s| s.marks.end).collect();
    assert_eq!(ends, [StopCause::ExactStop, StopCause::ProgramEnd]);
}

#[test]
fn notes_do_not_stop_motion() {
    let mut p = Program::new(&[0.0], FINE);
    p.line(&[10.0]);
    p.items.push(Item::Note { text: "half way".into(), line: 2 });
    p.line(&[20.0]);
    assert_eq!(examine(&p, &mill()).len(), 1);
}

#[test]
fn feeds_become_caps_where_they_were_programmed() {
    let mut p = Program::new(&[0.0], FINE);
    p.line(&[10.0]);
    p.feed = Some(Feed::Speed(5.0));
    p.line(&[20.0]).line(&[30.0]);
    p.feed = Some(Feed::Duration(4.0));
    p.line(&[40.0]);
    let found = examine(&p, &mill());
    let s = &found[0];
    let caps: Vec<_> = s.marks.caps.iter().map(|c| (c.until as f64 * s.path.step, c.speed)).collect();
    assert_eq!(caps.len(), 3);
    assert!((caps[0].0 - 10.0).abs() < s.path.step && (caps[1].0 - 30.0).abs() < s.path.step);
    assert_eq!(caps[1].1, SpeedCap::Tangential { axes: 0b111, speed: 5.0 });
    assert!(matches!(caps[2].1, SpeedCap::Rate(r) if (r - 2.5).abs() < 1e-6));
    assert_eq!(s.marks.blocks.iter().map(|b| b.line).collect::<Vec<_>>(), [1, 2, 3, 4]);
}

#[test]
fn each_block_keeps_its_own_tolerance() {
    let mut p = Program::new(&[0.0], within(0.5));
    p.line(&[20.0]).line(&[20.0, 20.0]);
    p.corner = within(0.002);
    p.line(&[40.0, 25.0]).line(&[45.0, 0.0]).line(&[50.0, 20.0]);
    p.corner = within(0.5);
    p.line(&[60.0, 20.0]).line(&[65.0, 0.0]);
    let found = examine(&p, &mill());
    assert_eq!(found.len(), 1);
    let whole = path_points(&found[0].path, 200);
    let tight: Vec<Point> = p.moves().skip(2).take(3).flat_map(|m| [m.start, m.end]).collect();
    assert!(one_way(&tight, &whole, 500) < 0.0021);
    assert!(found[0].marks.deviation.bound_mm > 0.1);
}

#[test]
fn a_cloud_of_micrometre_moves_neither_stalls_nor_explodes() {
    let mut p = Program::new(&[0.0], FINE);
    let (mut x, mut y, mut seed) = (0.0, 0.0, 12345u64);
    for _ in 0..5000 {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        let angle = (seed >> 33) as f64;
        x += 1e-3 * angle.cos();
        y += 1e-3 * angle.sin();
        p.line(&[x, y]);
    }
    let found = p.run(&mill());
    let spans: usize = found.iter().map(|s| s.path.spans()).sum();
    assert!(spans < 5000, "{spans} spans in {} sections", found.len());
    assert!(found.iter().all(|s| s.marks.deviation.bound_mm <= 0.01));
}

#[test]
fn dense_samples_of_a_curve_take_few_spans() {
    let mut p = Program::new(&[10.0, 0.0], within(0.05));
    for i in 1..=10_000 {
        let a = f64::from(i) * TAU / 5000.0;
        let digits = |x: f64| (x * 1e4).round() / 1e4;
        p.line(&[digits(10.0 * a.cos()), digits(10.0 * a.sin()), 0.0]);
    }
    let found = p.run(&mill());
    assert_eq!(found.len(), 1);
    assert!(found[0].path.spans() < 50, "{}", found[0].path.spans());
}

#[test]
fn rotary_axes_keep_their_own_tolerance() {
    let mut axes: Vec<Axis> = ["X", "Y", "Z"].map(|n| axis(n, AxisKind::Linear, 1e4)).into();
    axes.push(axis("A", AxisKind::Rotary, 1000.0));
    let machine = machine(axes);
    let mut p = Program::new(&[0.0], FINE);
    p.line(&[10.0, 0.0, 0.0, 90.0]).line(&[20.0, 0.0, 0.0, 60.0]).line(&[20.0, 0.0, 0.0, 90.0]);
    p.line(&[20.0, 5.0, 0.0, 90.0]);
    let found = p.run(&machine);
    assert_eq!(found.len(), 1);
    let s = &found[0];
    assert!(s.marks.deviation.bound_mm <= 0.01);
    let (rotary, linear) = (0b1000, 0b111);
    let masks: Vec<_> = s
        .marks
        .caps
        .iter()
        .map(|c| if let SpeedCap::Tangential { axes, .. } = c.speed { axes } else { 0 })
        .collect();
    assert_eq!(masks, [linear, rotary, linear]);
    let only = |p: &Point, a: std::ops::Range<usize>| -> Point {
        std::array::from_fn(|i| if a.contains(&i) { p[i] } else { 0.0 })
    };
    let (path, contour) = (path_points(&s.path, 200), p.contour());
    for (axes, tolerance) in [(0..3, 0.01), (3..4, 0.02)] {
        let a: Vec<_> = path.iter().map(|p| only(p, axes.clone())).collect();
        let b: Vec<_> = contour.iter().map(|p| only(p, axes.clone())).collect();
        assert!(one_way(&a, &b, 1) <= tolerance * 1.001);
    }
}

#[test]
fn coarse_counts_widen_the_tolerance_to_what_they_allow() {
    let machine = machine(["X", "Y"].map(|n| axis(n, AxisKind::Linear, 100.0)).into());
    let mut p = Program::new(&[0.0], within(0.001));
    p.line(&[1.234567, 0.2]).line(&[2.0, 2.34567]).arc([0, 1], 1.0, 0.0, 2.0, 0.0);
    let found = p.run(&machine);
    let d = found[0].marks.deviation;
    assert!(d.tolerance_mm < 0.0142 && d.bound_mm <= d.tolerance_mm, "{d:?}");
}

#[test]
fn bad_numbers_and_gaps_are_refused() {
    let machine = mill();
    let first_error = |p: &Program| {
        sections(p.stream(), &machine, &PathSettings::of(&machine, LimitSet::default()))
            .find_map(|r| r.err())
            .expect("refused")
    };
    let mut p = Program::new(&[0.0], FINE);
    p.line(&[f64::NAN]);
    assert_eq!(first_error(&p), SectionError::Geometry(GeometryError::NotFinite { line: 1 }));
    let mut p = Program::new(&[0.0], FINE);
    p.line(&[1.0]);
    p.at[0] = 2.0;
    p.line(&[3.0]);
    assert_eq!(first_error(&p), SectionError::Geometry(GeometryError::Gap { line: 2 }));
    let mut p = Program::new(&[0.0], FINE);
    p.line(&[1e15]);
    assert!(matches!(first_error(&p), SectionError::Geometry(_)));
}

#[test]
fn short_reversals_within_the_tolerance_do_not_stall() {
    let mut p = Program::new(&[0.0], within(0.05));
    p.line(&[0.024]).line(&[0.0072]).line(&[0.0118]).line(&[0.0107]);
    examine(&p, &mill());
}

#[test]
fn hostile_numbers_end_in_bounded_time() {
    let machine = mill();
    let sizes = [1e-300, 1e-12, 1e-4, 1.0, 1e5, 1e11, 1e300];
    for tolerance in [1e-300, 1e-9, 1e-3, 1e9] {
        for size in sizes {
            for sweep in [1e-12, 3.0, -1e4, 1e12] {
                let mut p = Program::new(&[0.0], within(tolerance));
                p.line(&[size, 0.0, 0.0]).arc([0, 1], size, 0.0, sweep, size).line(&[0.0, -size, size]);
                for item in sections(p.stream(), &machine, &PathSettings::of(&machine, LimitSet::default())) {
                    let Ok(SectionItem::Section(s)) = item else { continue };
                    assert!(s.marks.deviation.bound_mm <= s.marks.deviation.tolerance_mm);
                }
            }
        }
    }
}

/// A move relative to the last end.
#[derive(Clone, Debug)]
enum Step {
    Line { length: f64, heading: f64, rise: f64 },
    Arc { plane: usize, radius: f64, angle: f64, sweep: f64, rise: f64 },
    Back,
    Ahead,
}

fn step() -> impl Strategy<Value = Step> {
    let size = (-3.5..1.2f64).prop_map(|e| 10f64.powf(e));
    prop_oneof![
        6 => (size.clone(), 0.0..TAU, -0.5..0.5f64)
            .prop_map(|(length, heading, rise)| Step::Line { length, heading, rise }),
        2 => (0..3usize, size, 0.0..TAU, -7.0..7.0f64, -0.5..0.5f64).prop_map(
            |(plane, radius, angle, sweep, rise)| Step::Arc { plane, radius, angle, sweep, rise }
        ),
        1 => Just(Step::Back),
        1 => Just(Step::Ahead),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, ..ProptestConfig::default() })]

    #[test]
    fn any_contour_is_fitted_within_its_tolerance(
        steps in prop::collection::vec(step(), 1..14),
        tolerance in prop_oneof![Just(0.002), Just(0.01), Just(0.05), Just(0.5)],
        origin in prop_oneof![Just(0.0), -100.0..100.0f64, Just(1e6)],
    ) {
        let mut p = Program::new(&[origin, -origin, 0.5 * origin], within(tolerance));
        for s in steps {
            let [x, y, z] = [p.at[0], p.at[1], p.at[2]];
            match s {
                Step::Line { length, heading, rise } => {
                    p.line(&[x + length * heading.cos(), y + length * heading.sin(), z + rise * length]);
                }
                Step::Arc { plane, radius, angle, sweep, rise } => {
                    p.arc([[0, 1], [2, 0], [1, 2]][plane], radius, angle, sweep, rise * radius);
                }
                Step::Back | Step::Ahead => {
                    let Some(m) = p.moves().last() else { continue };
                    let sign = if matches!(s, Step::Back) { -0.7 } else { 0.4 };
                    let end: [f64; 3] = std::array::from_fn(|a| m.end[a] + sign * (m.end[a] - m.start[a]));
                    p.line(&end);
                }
            }
        }
        examine(&p, &mill());
    }
}
