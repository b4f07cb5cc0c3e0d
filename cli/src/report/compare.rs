//! The page of `compare`: a table of methods, what limits each, and their motion over time.

use maud::{Markup, html};
use planner::tolerances::CERTIFICATE_RATIO;
use serde::Serialize;

use super::colour;
use super::data::{Band, Series, band, fine, text};
use super::html::shell;
use super::model::{Axis, Envelope, Limit, Motion};
use super::words::{count, duration, length, number, percent, times};
use crate::engine::Compared;
use crate::json::{BindingJson, CompareJson, MethodJson, MethodState};

const SCRIPT: &str = include_str!("compare.js");

/// Methods whose motion is drawn at first.
const DRAWN: [&str; 3] = ["whole", "zhao", "overlap"];

/// Stands where there is nothing to say.
const NOTHING: &str = "\u{2013}";

/// What each method is.
const METHODS: [(&str, &str); 9] = [
    ("whole", "Minimum time under velocity, acceleration and true jerk, the path in one piece."),
    (
        "zhao",
        "The same limits; the path is divided, every part solved from rest to rest, and the parts are spliced where \
         the motion is slow (Zhao 2016, sec. 3.2).",
    ),
    ("overlap", "The same limits; windows are solved side by side, then once more round their joints."),
    (
        "constant-feed",
        "One speed all along: the largest at which no axis exceeds its velocity, acceleration or jerk anywhere on the \
         path, and no programmed feed is exceeded. It is reached from rest and left for rest as fast as the limits allow.",
    ),
    (
        "pseudo-jerk",
        "Jerk limited by the linear form of Zhao 2016, eq. 3.4, which is stricter than the limit itself.",
    ),
    (
        "no-jerk",
        "Velocity and acceleration only; the ratio of jerk shows what that would ask of the machine.",
    ),
    (
        "sweep",
        "Velocity and acceleration by one backward and one forward pass; limits hold at stations along the path. It \
         gives a time, no table.",
    ),
    (
        "clarabel",
        "The problem of \u{201c}whole\u{201d}, by the solver Clarabel on a sequence of linear programmes.",
    ),
    (
        "collocation",
        "Limits are asked for in the middle of each span only, as the literature has it. What happens in between is \
         what the certificate finds.",
    ),
];

#[derive(Serialize)]
struct Data {
    axes: Vec<AxisData>,
    methods: Vec<MethodData>,
}

#[derive(Serialize)]
struct AxisData {
    v: f64,
    a: f64,
    j: Option<f64>,
}

#[derive(Serialize)]
struct MethodData {
    name: String,
    colour: String,
    time: Series,
    speed: Band,
    /// v, a, j of each axis.
    axes: Vec<[Band; 3]>,
}

/// The page as one HTML file.
pub fn page(compared: &Compared) -> String {
    let Compared { json, axes, motions } = compared;
    let drawn: Vec<usize> = (0..motions.len()).filter(|&i| motions[i].is_some()).collect();
    let body = html! {
        (header(json))
        (table(json))
        (limiting(json, axes))
        @if !drawn.is_empty() { (plots(compared, &drawn)) }
        (meaning(json))
    };
    let methods = json.methods.iter().zip(motions).enumerate();
    let data = Data {
        axes: axes
            .iter()
            .map(|a| AxisData { v: a.feed.velocity, a: a.feed.acceleration, j: a.feed.jerk })
            .collect(),
        methods: methods.filter_map(|(i, (row, m))| Some(method_data(i, row, m.as_ref()?))).collect(),
    };
    shell(&format!("{} \u{2013} methods compared", name(json)), &body, &text(&data), SCRIPT)
}

fn method_data(i: usize, row: &MethodJson, motion: &Motion) -> MethodData {
    let t = &motion.traces;
    MethodData {
        name: row.method.clone(),
        colour: colour::of_method(i),
        time: fine(&t.time),
        speed: band(&t.speed),
        axes: t.axes.iter().map(|a| [band(&a.velocity), band(&a.acceleration), band(&a.jerk)]).collect(),
    }
}

/// File name of the job.
fn name(json: &CompareJson) -> &str {
    json.job.rsplit(['/', '\\']).next().unwrap_or(&json.job)
}

fn header(json: &CompareJson) -> Markup {
    html! {
        header {
            p.kind { "Methods compared" }
            h1 { (name(json)) }
            p {
                "on " b { (json.machine) } " \u{00b7} " (length(json.feed_length_mm)) " of feed moves"
                @if let Some(points) = &json.way_points {
                    " through " (count(points.count)) " way-points (" (points.ends) " spline, " (points.knots) " knots)"
                }
                ", " (count(json.geometry_spans)) " spans of geometry in " (count(json.sections))
                @if json.sections == 1 { " stretch" } @else { " stretches" }
                " from rest to rest \u{00b7} " (json.threads)
                @if json.threads == 1 { " thread" } @else { " threads" }
                " \u{00b7} nothing was played, no physical drive was used."
            }
        }
    }
}

fn swatch(i: usize) -> Markup {
    html! { i.swatch style=(format!("background:{}", colour::of_method(i))) {} }
}

fn figure(value: Option<String>) -> Markup {
    html! { td.n { (value.unwrap_or_else(|| NOTHING.into())) } }
}

/// Traverse time against that of the whole path in one piece: `+0.0120 %`, `62.2 times`.
pub(crate) fn change(share: f64) -> String {
    if share >= 1.0 {
        return times(1.0 + share);
    }
    let percent = 100.0 * share;
    let decimals: usize = if percent.abs() < 1.0 { 4 } else { 2 };
    let text = format!("{percent:+.decimals$} %");
    // No sign on what rounds to nothing.
    if text.contains(|c: char| ('1'..='9').contains(&c)) { text } else { "0 %".into() }
}

/// A ratio; one above its limit stands out where the method was given that limit.
fn ratio(value: Option<f64>, given: bool) -> Markup {
    match value {
        Some(r) if r > 1.0 + CERTIFICATE_RATIO && given => html! { td.n { b.bad { (format!("{r:.4}")) } } },
        Some(r) if !given => html! { td.n { span.dim { (format!("{r:.4}")) } } },
        value => figure(value.map(|r| format!("{r:.4}"))),
    }
}

fn table(json: &CompareJson) -> Markup {
    let feed = json.methods.iter().any(|m| m.feed_ratio.is_some());
    html! {
        section {
            h2 { "Time" }
            div.scroll { table {
                thead {
                    tr {
                        th rowspan="2" { "Method" } th.n rowspan="2" { "Computing" } th.n rowspan="2" { "Traverse" }
                        th.n rowspan="2" { "Against whole" } th rowspan="2" { "Certified" }
                        th.c colspan=(if feed { 4 } else { 3 }) { "Largest value over limit, at every instant" }
                        @if feed { th.n rowspan="2" { "Lost against feed" } }
                        th.n rowspan="2" { "Spans" } th.n rowspan="2" { "Iterations" }
                    }
                    tr {
                        th.n { "Velocity" } th.n { "Acceleration" } th.n { "Jerk" } @if feed { th.n { "Feed" } }
                    }
                }
                tbody { @for (i, m) in json.methods.iter().enumerate() {
                    tr {
                        td { (swatch(i)) b { (m.method) }
                            @if let Some(speed) = m.constant_feed_mm_s { span.dim { " " (number(speed)) " mm/s" } }
                        }
                        @if let Some(remark) = &m.remark {
                            td.wide colspan=(if feed { 11 } else { 9 }) {
                                @if m.state == MethodState::LeftOut { span.dim { "left out: " (remark) } }
                                @else { span.bad { "no motion: " (remark) } }
                            }
                        } @else {
                            (figure(m.compute_seconds.map(seconds)))
                            (figure(m.traverse_time_s.map(duration)))
                            (figure(m.over_whole.map(change)))
                            td {
                                @match m.certified {
                                    Some(true) => span.good { "\u{2713} yes" },
                                    Some(false) => span.bad { "\u{2717} no" },
                                    None => (NOTHING),
                                }
                            }
                            (ratio(m.velocity_ratio, true)) (ratio(m.acceleration_ratio, true)) (ratio(m.jerk_ratio, m.jerk_form != "none"))
                            @if feed { (ratio(m.feed_ratio, true)) (figure(m.lost_s.map(duration))) }
                            (figure(m.spans.map(count)))
                            (figure(m.iterations.map(count)))
                        }
                    }
                } }
            } }
            p.note {
                "Methods run one after the other; of up to three runs the shortest counts. Computing is finding the motion on "
                "the finished path: reading, fitting and the certificate are left out, for they are alike. The certificate "
                "is about the limits that a method is given; ratios are against the limits of the machine."
            }
        }
    }
}

/// A computing time, short ones in milliseconds.
pub(crate) fn seconds(s: f64) -> String {
    if s < 1.0 { format!("{:.1} ms", 1e3 * s) } else { duration(s) }
}

/// Which limit rules each method for how long.
fn limiting(json: &CompareJson, axes: &[Axis]) -> Markup {
    let mut seen: Vec<Limit> = Vec::new();
    for b in json.methods.iter().flat_map(|m| &m.binding) {
        let limit = limit(b, axes);
        if !seen.contains(&limit) {
            seen.push(limit);
        }
    }
    seen.sort_unstable();
    html! {
        @if !seen.is_empty() {
            section {
                h2 { "What limits the speed" }
                table.bars { tbody { @for m in json.methods.iter().filter(|m| !m.binding.is_empty()) {
                    tr {
                        td { (m.method) }
                        td.wide { div.bar role="img" aria-label="Share of time per limit" { @for b in &m.binding {
                            @let limit = limit(b, axes);
                            span style=(format!("flex-grow:{:.5};background:{}", b.share, colour::of_limit(limit)))
                                title=(format!("{}: {}", limit.words(axes), percent(b.share))) {}
                        } } }
                    }
                } } }
                ul.legend { @for limit in seen {
                    li {
                        i style=(format!("background:{}", colour::of_limit(limit))) {}
                        @if limit == Limit::Feed { "feed" } @else { (limit.words(axes)) }
                    }
                } }
            }
        }
    }
}

/// The limit that an entry of the JSON object names.
fn limit(b: &BindingJson, axes: &[Axis]) -> Limit {
    let axis = b.axis.as_ref().and_then(|name| axes.iter().position(|a| a.name == *name)).unwrap_or(0) as u8;
    match b.kind {
        "velocity" => Limit::Velocity(axis),
        "acceleration" => Limit::Acceleration(axis),
        "jerk" => Limit::Jerk(axis),
        "feed" => Limit::Feed,
        "rest" => Limit::Rest,
        _ => Limit::Free,
    }
}

fn plot(kind: &str, axis: Option<usize>, title: &str, unit: &str) -> Markup {
    html! {
        figure.plot data-plot=(kind) data-axis=[axis] {
            figcaption { b { (title) } span.dim { (unit) } output {} }
            canvas role="img" aria-label=(format!("{title} over time")) {}
        }
    }
}

fn plots(compared: &Compared, drawn: &[usize]) -> Markup {
    let Compared { json, axes, motions } = compared;
    // Axes that stand still all along have nothing to show.
    let moves = |e: &Envelope| e.lo.iter().chain(&e.hi).any(|v| *v != 0.0);
    let traces = |axis: usize| motions.iter().flatten().filter_map(move |m| m.traces.axes.get(axis));
    let moving: Vec<bool> = (0..axes.len()).map(|i| traces(i).any(|t| moves(&t.velocity))).collect();
    let named = |i: usize| DRAWN.contains(&json.methods[i].method.as_str());
    let any = drawn.iter().any(|&i| named(i));
    html! {
        section {
            h2 { "Motion" }
            noscript { p.note { "The plots need JavaScript; the tables are complete without it." } }
            div.controls { @for (k, &i) in drawn.iter().enumerate() {
                label {
                    input type="checkbox" name="method" value=(k) checked[!any || named(i)];
                    " " (swatch(i)) (json.methods[i].method)
                }
            } }
            (plot("speed", None, "Path speed", "mm/s"))
            div.triple {
                @for (i, a) in axes.iter().enumerate().filter(|(i, _)| moving[*i]) {
                    (plot("v", Some(i), &format!("{} velocity", a.name), &format!("{}/s", a.unit)))
                    (plot("a", Some(i), &format!("{} acceleration", a.name), &format!("{}/s\u{00b2}", a.unit)))
                    (plot("j", Some(i), &format!("{} jerk", a.name), &format!("{}/s\u{00b3}", a.unit)))
                }
            }
            p.note {
                "Dashed: the limits. Where a quantity changes faster than the picture is fine, its range is filled. "
                "Drag to magnify all plots together, double-click to go back."
            }
        }
    }
}

fn meaning(json: &CompareJson) -> Markup {
    html! {
        section {
            h2 { "The methods" }
            table.facts { tbody { @for (name, words) in METHODS {
                @if json.methods.iter().any(|m| m.method == name) {
                    tr { td { b { (name) } } td.wide { (words) } }
                }
            } } }
        }
    }
}
