//! The numbers behind the plots, as compact JSON.
//!
//! A series is integers `d` with an origin `o` and a step `s`: value = o + s d; `null` is no value. An
//! envelope adds `e`, highest minus lowest, unless they are all equal.

use serde::Serialize;

use super::colour;
use super::model::{Envelope, Limit, Mode, Report};

/// Steps across the range of a plotted quantity: finer than a pixel, four digits each.
const FINE: f64 = 4000.0;

/// Steps across the extent of the picture, which can be magnified.
const FINEST: f64 = 60_000.0;

#[derive(Serialize)]
pub(super) struct Data {
    axes: Vec<AxisData>,
    legend: Vec<LegendData>,
    t: TraceData,
    path: PathData,
    pins: Vec<[f64; 4]>,
    unit: &'static str,
}

#[derive(Serialize)]
struct AxisData {
    name: String,
    unit: String,
    colour: String,
    /// Limits by plot, at feed and in rapids.
    v: [f64; 2],
    a: [f64; 2],
    j: [Option<f64>; 2],
    f: f64,
}

#[derive(Serialize)]
struct LegendData {
    label: String,
    colour: String,
}

#[derive(Serialize)]
struct TraceData {
    time: Series,
    pos: Series,
    line: Series,
    mode: Vec<u8>,
    limit: Vec<usize>,
    speed: Band,
    ceiling: Series,
    axes: Vec<AxisTraceData>,
}

#[derive(Serialize)]
struct AxisTraceData {
    v: Band,
    a: Band,
    j: Band,
    e: Band,
    f: Band,
}

#[derive(Serialize)]
struct PathData {
    axes: Vec<[String; 2]>,
    at: Vec<Series>,
    time: Series,
    speed: Series,
    line: Series,
    mode: Vec<u8>,
    limit: Vec<usize>,
    slow: Vec<u8>,
}

#[derive(Serialize)]
pub(super) struct Series {
    o: f64,
    s: f64,
    d: Vec<Option<i64>>,
}

#[derive(Serialize)]
pub(super) struct Band {
    o: f64,
    s: f64,
    d: Vec<Option<i64>>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    e: Vec<i64>,
}

/// Unit of the path speed: millimetres unless no linear axis moves.
pub(super) fn speed_unit(report: &Report) -> &'static str {
    let moving = &report.motion.picture.axes;
    let rotary = |&i: &usize| report.axes.get(i).is_some_and(|a| !a.linear);
    if moving.is_empty() || !moving.iter().all(rotary) {
        return "mm/s";
    }
    if moving.iter().any(|&i| report.axes[i].unit == "rad") { "rad/s" } else { "deg/s" }
}

impl Data {
    pub(super) fn new(report: &Report) -> Self {
        let t = &report.motion.traces;
        let p = &report.motion.picture;
        let mut legend: Vec<Limit> = report.shares.iter().map(|s| s.limit).collect();
        // Drives also wait for the next table, which no share counts.
        for limit in t.limit.iter().chain(p.points.iter().map(|q| &q.limit)) {
            if !legend.contains(limit) {
                legend.push(*limit);
            }
        }
        let index = |limit: &Limit| legend.iter().position(|l| l == limit).unwrap_or(0);
        let points = || p.points.iter();
        let coordinates = p.axes.len().min(3);
        let extent = (0..coordinates).map(|c| spread(points().map(|q| q.at[c]))).fold(0.0, f64::max);
        let at = (0..coordinates)
            .map(|c| series(&points().map(|q| q.at[c]).collect::<Vec<_>>(), extent / FINEST))
            .collect();
        let times: Vec<f64> = points().map(|q| q.time).collect();
        let speeds: Vec<f64> = points().map(|q| q.speed).collect();
        let lines: Vec<f64> = points().map(|q| f64::from(q.line)).collect();
        let named = |&i: &usize| report.axes.get(i).map(|a| [a.name.clone(), a.unit.clone()]);
        Data {
            axes: report
                .axes
                .iter()
                .enumerate()
                .map(|(i, a)| AxisData {
                    name: a.name.clone(),
                    unit: a.unit.clone(),
                    colour: colour::of_axis(i),
                    v: [a.feed.velocity, a.rapid.velocity],
                    a: [a.feed.acceleration, a.rapid.acceleration],
                    j: [a.feed.jerk, a.rapid.jerk],
                    f: a.effort,
                })
                .collect(),
            legend: legend
                .iter()
                .map(|l| LegendData { label: l.words(&report.axes), colour: colour::of_limit(*l) })
                .collect(),
            t: TraceData {
                time: fine(&t.time),
                pos: fine(&t.position),
                line: series(&t.line, 1.0),
                mode: t.mode.iter().map(mode).collect(),
                limit: t.limit.iter().map(index).collect(),
                speed: band(&t.speed),
                ceiling: clipped(&t.ceiling, &t.speed),
                axes: t
                    .axes
                    .iter()
                    .map(|a| AxisTraceData {
                        v: band(&a.velocity),
                        a: band(&a.acceleration),
                        j: band(&a.jerk),
                        e: band(&a.error),
                        f: band(&a.effort),
                    })
                    .collect(),
            },
            path: PathData {
                axes: p.axes.iter().filter_map(named).collect(),
                at,
                time: fine(&times),
                speed: series(&speeds, spread(speeds.iter().copied()) / 400.0),
                line: series(&lines, 1.0),
                mode: points().map(|q| mode(&q.mode)).collect(),
                limit: points().map(|q| index(&q.limit)).collect(),
                slow: points().map(|q| u8::from(q.slow)).collect(),
            },
            pins: report
                .slow
                .places
                .iter()
                .take(PINS)
                .map(|place| {
                    let at = |c: usize| p.axes.get(c).map_or(0.0, |&axis| place.slowest_at[axis]);
                    [at(0), at(1), at(2), place.slowest_s]
                })
                .collect(),
            unit: speed_unit(report),
        }
    }
}

/// Numbers as text that can stand in a script element: no `<` can end it.
pub(super) fn text(data: &impl Serialize) -> String {
    serde_json::to_string(data).unwrap_or_default().replace('<', "\\u003c")
}

/// Slow places marked in the picture; the table numbers the same ones.
pub(super) const PINS: usize = 12;

fn mode(mode: &Mode) -> u8 {
    match mode {
        Mode::Still => 0,
        Mode::Feed => 1,
        Mode::Rapid => 2,
    }
}

fn spread(values: impl Iterator<Item = f64>) -> f64 {
    let (low, high) = values
        .filter(|v| v.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    if high > low { high - low } else { 0.0 }
}

pub(super) fn fine(values: &[f64]) -> Series {
    series(values, spread(values.iter().copied()) / (2.5 * FINE))
}

/// The ceiling is of interest near the speed only: what is far above is cut off.
fn clipped(values: &[f64], speed: &Envelope) -> Series {
    let top = 2.0 * speed.hi.iter().copied().fold(0.0, f64::max);
    fine(&values.iter().map(|v| if v.is_nan() { f64::NAN } else { v.min(top) }).collect::<Vec<_>>())
}

fn origin(values: &[f64]) -> f64 {
    let low = values.iter().copied().filter(|v| v.is_finite()).fold(f64::INFINITY, f64::min);
    if low.is_finite() { short(low) } else { 0.0 }
}

/// Seven significant digits: nobody sees more, and the text stays short.
fn short(value: f64) -> f64 {
    format!("{value:.6e}").parse().unwrap_or(value)
}

fn step(step: f64) -> f64 {
    if step.is_finite() && step > 0.0 { short(step) } else { 1.0 }
}

fn series(values: &[f64], resolution: f64) -> Series {
    let (o, s) = (origin(values), step(resolution));
    Series { o, s, d: values.iter().map(|&v| v.is_finite().then(|| ((v - o) / s).round() as i64)).collect() }
}

pub(super) fn band(envelope: &Envelope) -> Band {
    let all = envelope.lo.iter().chain(&envelope.hi).copied();
    let base = series(&envelope.lo, spread(all) / FINE);
    let e: Vec<i64> =
        envelope.lo.iter().zip(&envelope.hi).map(|(l, h)| ((h - l) / base.s).round() as i64).collect();
    let flat = e.iter().all(|&e| e == 0);
    Band { o: base.o, s: base.s, d: base.d, e: if flat { Vec::new() } else { e } }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_series_keeps_values_to_its_step(values in prop::collection::vec(-1e6..1e6f64, 1..100)) {
            let s = fine(&values);
            for (v, d) in values.iter().zip(&s.d) {
                let back = s.o + s.s * d.unwrap() as f64;
                prop_assert!((back - v).abs() <= 0.51 * s.s + 1e-12 * v.abs(), "{} {}", back, v);
            }
        }
    }

    #[test]
    fn values_that_are_no_number_are_null() {
        let s = fine(&[f64::NAN, 1.0, f64::INFINITY]);
        assert_eq!(s.d.iter().map(Option::is_some).collect::<Vec<_>>(), [false, true, false]);
        assert!(serde_json::to_string(&fine(&[f64::NAN])).unwrap().contains("\"d\":[null]"));
    }
}
