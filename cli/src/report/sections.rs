//! The upper part of the report: headline numbers and plots.

use maud::{Markup, html};
use planner::tolerances::FEED_REACHED;

use super::colour;
use super::data::speed_unit;
use super::model::{DriveEnd, Report};
use super::words::{bytes, count, duration, number, percent, small, times};

/// Who, what, on what.
pub(super) fn header(report: &Report) -> Markup {
    let played = match report.simulation {
        Some(_) => "Played on simulated drives; no physical drive was used.",
        None => "Planned and certified only; nothing was played, no physical drive was used.",
    };
    html! {
        header {
            p.kind { "Motion report" }
            h1 { (report.job) }
            p { "on " b { (report.machine) } " \u{00b7} " (played) }
        }
    }
}

fn card(name: &str, value: &str, more: &str, state: &str) -> Markup {
    html! {
        div class=(format!("card {state}")) {
            span.name { (name) }
            span.value { (value) }
            span.more { (more) }
        }
    }
}

/// The headline numbers.
pub(super) fn headline(report: &Report) -> Markup {
    let t = &report.times;
    let waits = t.cycle_s - t.motion_s;
    let waiting = if waits > 5e-4 {
        format!("{} in motion, {} waiting", duration(t.motion_s), duration(waits))
    } else {
        "all of it in motion".into()
    };
    let table = &report.table;
    let per_span = table.shared as f64 / table.spans.max(1) as f64;
    let mut table_more = format!("{} spans, {per_span:.1} B shared per span", count(table.spans));
    if t.motion_s > 0.0 {
        table_more.push_str(&format!(", {:.0} B/s", table.total() as f64 / t.motion_s));
    }
    let verdict = &report.certificate.verdict;
    let tolerance = &report.tolerance;
    html! {
        section.cards {
            (card("Cycle time", &duration(t.cycle_s), &waiting, "lead"))
            @if t.constant_feed_s > 0.0 && t.motion_s > 0.0 {
                (card(
                    "Constant feed would take",
                    &duration(t.constant_feed_s),
                    &format!("the motion takes {} as long", times(t.motion_s / t.constant_feed_s)),
                    "",
                ))
            }
            @if let Some(stop) = t.stop_every_block_s.filter(|_| t.motion_s > 0.0) {
                (card(
                    if report.way_points.is_some() { "Stopping at every way-point" } else { "Stopping at every block" },
                    &duration(stop),
                    &format!("{} as long as this plan", times(stop / t.motion_s)),
                    "",
                ))
            }
            (card(
                "Certificate",
                if verdict.holds { "\u{2713} holds" } else { "\u{2717} does not hold" },
                &worst(report),
                if verdict.holds { "good" } else { "bad" },
            ))
            (card(
                if report.way_points.is_some() { "Deviation from the way-points" } else { "Deviation from the program" },
                &format!("\u{2264} {} mm", small(tolerance.deviation_mm)),
                &format!("{} mm allowed by the {}", small(tolerance.tolerance_mm), tolerance.source),
                if tolerance.deviation_mm <= tolerance.tolerance_mm { "good" } else { "bad" },
            ))
            (card("Feed table", &bytes(table.total()), &table_more, ""))
            @if let Some(sim) = &report.simulation {
                @let arrived = sim.axes.iter().filter(|a| a.arrived()).count();
                @let all = arrived == sim.axes.len();
                (card(
                    "End state, simulated",
                    if all { "\u{2713} exact, at rest" } else { "\u{2717} off the end point" },
                    &format!("{arrived} of {} drives, {} set-points", sim.axes.len(), count(sim.setpoints)),
                    if all { "good" } else { "bad" },
                ))
                @let across = sim.contour.map(|c| format!(", {} mm of it across the path", number(c.max_mm)));
                (card(
                    "Following error, simulated",
                    &largest_error(report, &sim.axes),
                    &format!("at most{}", across.unwrap_or_default()),
                    "",
                ))
            }
        }
    }
}

/// The largest certified ratio and whose it is.
fn worst(report: &Report) -> String {
    let v = &report.certificate.verdict;
    let all = [
        ("velocity", Some(v.velocity_ratio)),
        ("acceleration", Some(v.acceleration_ratio)),
        ("jerk", v.jerk_ratio),
        ("feed", v.feed_ratio),
    ];
    let top = all.iter().filter_map(|(n, r)| r.map(|r| (n, r))).max_by(|a, b| a.1.total_cmp(&b.1));
    match top {
        Some((name, ratio)) => format!("{name} reaches {ratio:.6} of its limit, at every instant"),
        None => "no limit in force".into(),
    }
}

/// The largest error of the axes of one kind, linear ones if there are any.
fn largest_error(report: &Report, ends: &[DriveEnd]) -> String {
    let linear = report.axes.iter().any(|a| a.linear);
    let rows = report.axes.iter().zip(ends).filter(|(a, _)| a.linear == linear);
    let worst = rows.max_by(|x, y| x.1.max_error.total_cmp(&y.1.max_error));
    worst.map_or("\u{2013}".into(), |(a, e)| format!("{} {}", number(e.max_error), a.unit))
}

/// The path, coloured.
pub(super) fn picture(report: &Report) -> Markup {
    let axes = &report.motion.picture.axes;
    let name = |i: usize| report.axes.get(i).map_or("", |a| a.name.as_str());
    let hidden: Vec<&str> = (0..report.axes.len()).filter(|i| !axes.contains(i)).map(name).collect();
    let flat = match axes.len() {
        0 => return html! {},
        1 => format!("{} over time", name(axes[0])),
        _ => format!("{}{} view", name(axes[0]), name(axes[1])),
    };
    html! {
        section {
            h2 { "Path" }
            div.controls {
                span.choice role="group" aria-label="Colour of the path" {
                    label { input type="radio" name="colour" value="speed" checked; " speed" }
                    label { input type="radio" name="colour" value="limit"; " what limits it" }
                }
                label { input #slow type="checkbox" checked; " mark where the feed is not reached" }
                span #scale .scale {}
            }
            div class=(if axes.len() > 2 { "pair" } else { "single" }) {
                figure.path data-view="flat" {
                    figcaption { b { (flat) } output {} }
                    canvas role="img" aria-label="Path coloured by speed" {}
                }
                @if axes.len() > 2 {
                    figure.path data-view="space" {
                        figcaption { b { "In space" } span.hint { "drag to turn" } output {} }
                        canvas role="img" aria-label="Path in space coloured by speed" {}
                    }
                }
            }
            p.note {
                "Rapids are dashed. "
                span.halo { "Haloed" } " stretches run below " (percent(FEED_REACHED)) " of the programmed feed; numbers are the rows of the table below. "
                "Drag a box to magnify, double-click to go back."
                @if !hidden.is_empty() && axes.len() > 1 { " Not drawn: " (hidden.join(", ")) "." }
            }
        }
    }
}

/// Which limit rules for how long, and when.
pub(super) fn limiting(report: &Report) -> Markup {
    let shares = &report.shares;
    let total: f64 = shares.iter().map(|s| s.seconds).sum();
    if total <= 0.0 {
        return html! {};
    }
    html! {
        section {
            h2 { "What limits the speed" }
            div.bar role="img" aria-label="Share of time per limit" {
                @for s in shares {
                    @let share = s.seconds / total;
                    span style=(format!("flex-grow:{:.5};background:{}", share, colour::of_limit(s.limit)))
                        title=(format!("{}: {}", s.limit.words(&report.axes), percent(share))) {}
                }
            }
            ul.legend {
                @for s in shares {
                    li {
                        i style=(format!("background:{}", colour::of_limit(s.limit))) {}
                        (s.limit.words(&report.axes)) " " b { (percent(s.seconds / total)) } " "
                        span.dim { (duration(s.seconds)) }
                    }
                }
            }
            figure.plot.strip data-plot="strip" {
                figcaption { b { "Over time" } output {} }
                canvas role="img" aria-label="What limits the speed over time" {}
            }
        }
    }
}

fn plot(kind: &str, axis: Option<usize>, title: &str, unit: &str) -> Markup {
    html! {
        figure.plot data-plot=(kind) data-axis=[axis] {
            figcaption {
                @if let Some(axis) = axis { i.swatch style=(format!("background:{}", colour::of_axis(axis))) {} }
                b { (title) } span.dim { (unit) } output {}
            }
            canvas role="img" aria-label=(format!("{title} over time")) {}
        }
    }
}

/// Path speed over time and over the path.
pub(super) fn speed(report: &Report) -> Markup {
    let unit = speed_unit(report);
    html! {
        section {
            h2 { "Speed" }
            div.pair {
                (plot("speed", None, "Over time", unit))
                (plot("phase", None, "Phase plot: feed moves over the path", unit))
            }
            p.note {
                "Shaded: what the programmed feed and the axis velocities allow at that place. Drag to magnify all plots over time together, double-click to go back."
            }
        }
    }
}

/// Velocity, acceleration and jerk of every axis.
pub(super) fn axes(report: &Report) -> Markup {
    html! {
        section {
            h2 { "Axes against their limits" }
            div.triple {
                @for (i, a) in report.axes.iter().enumerate() {
                    (plot("v", Some(i), &format!("{} velocity", a.name), &format!("{}/s", a.unit)))
                    (plot("a", Some(i), &format!("{} acceleration", a.name), &format!("{}/s\u{00b2}", a.unit)))
                    (plot("j", Some(i), &format!("{} jerk", a.name), &format!("{}/s\u{00b3}", a.unit)))
                }
            }
            p.note { "Dashed: the limit in force, of feed moves or of rapids." }
        }
    }
}

/// Following error and motor effort of every axis.
pub(super) fn drives(report: &Report) -> Markup {
    if report.simulation.is_none() {
        return html! {};
    }
    html! {
        section {
            h2 { "Simulated drives" }
            div.pair {
                @for (i, a) in report.axes.iter().enumerate() {
                    @let (what, unit) = if a.linear { ("force", "N") } else { ("torque", "N m") };
                    (plot("e", Some(i), &format!("{} following error", a.name), &a.unit))
                    (plot("f", Some(i), &format!("{} motor {what}", a.name), unit))
                }
            }
            p.note { "Dashed: what the motor can give. The drives and their mechanics are simulated." }
        }
    }
}
