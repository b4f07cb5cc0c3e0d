//! The lower part of the report: tables.

use maud::{Markup, html};
use planner::analysis::shortfall::Shortfall;

use super::colour;
use super::data::{PINS, speed_unit};
use super::model::{Bounds, Limit, Report};
use super::words::{aligned, bytes, count, duration, length, number, percent, small};

/// Stands where there is nothing to say.
const NOTHING: &str = "\u{2013}";

/// Slow places shown at once; the others unfold.
const SHOWN: usize = PINS;

/// Where the programmed feed is not reached, and why.
pub(super) fn slow(report: &Report) -> Markup {
    let slow = &report.slow;
    let unit = speed_unit(report);
    let (first, rest) = slow.places.split_at(slow.places.len().min(SHOWN));
    html! {
        section {
            h2 { "Where the programmed feed is not reached" }
            @if slow.places.is_empty() {
                @if report.certificate.verdict.feed_ratio.is_none() { p { "No feed is programmed." } }
                @else { p { "It is reached everywhere." } }
            } @else {
                p {
                    b { (duration(slow.lost_s)) } " are lost against the programmed feed, in "
                    (count(slow.count)) " places. The most costly:"
                }
                (slow_table(report, first, 0, unit))
                @if !rest.is_empty() {
                    details {
                        summary { (rest.len()) " more" }
                        (slow_table(report, rest, first.len(), unit))
                    }
                }
            }
        }
    }
}

fn slow_table(report: &Report, places: &[Shortfall], from: usize, unit: &str) -> Markup {
    let fastest = places.iter().map(|p| p.programmed).fold(0.0, f64::max);
    html! {
        div.scroll { table {
            thead { tr {
                th.n { "#" } th { "Line" } th.n { "Length" } th.n { "Programmed" } th.n { "Lowest" } th.n { "Mean" }
                th { "Limited by" } th.n { "Lost" }
            } }
            tbody { @for (i, p) in places.iter().enumerate() {
                tr {
                    td.n { (from + i + 1) }
                    td { (p.first_line) @if p.last_line != p.first_line { "\u{2013}" (p.last_line) } }
                    td.n { (length(p.length)) }
                    td.n { (number(p.programmed)) " " (unit) }
                    td.n { (aligned(p.lowest, fastest)) }
                    td.n { (aligned(p.mean, fastest)) }
                    @let limit = Limit::from(p.limit);
                    td { i.swatch style=(format!("background:{}", colour::of_limit(limit))) {} (limit.words(&report.axes)) }
                    td.n { (duration(p.lost_s)) }
                }
            } }
        } }
    }
}

/// Time per operation.
pub(super) fn operations(report: &Report) -> Markup {
    let total: f64 = report.operations.iter().map(|o| o.seconds()).sum();
    let feeds = report.operations.iter().filter(|o| o.feed_s > 0.0).map(|o| o.feed_length_mm / o.feed_s);
    let fastest = feeds.fold(0.0, f64::max);
    html! {
        @if total > 0.0 {
            section {
                h2 { "Time per operation" }
                div.scroll { table {
                    thead { tr {
                        th { "Operation" } th { "From line" } th.n { "Feed" } th.n { "Rapid" } th.n { "Waiting" }
                        th.n { "Total" } th.n { "Share" } th.n { "Feed length" } th.n { "Mean feed" }
                    } }
                    tbody { @for o in &report.operations {
                        tr {
                            td.wide { @if !o.name.is_empty() { (o.name) } @else if report.way_points.is_some() { "way-points" } @else { "before the first remark" } }
                            td { (o.line.max(1)) }
                            @for seconds in [o.feed_s, o.rapid_s, o.dwell_s] {
                                td.n { (if seconds > 0.0 { duration(seconds) } else { NOTHING.into() }) }
                            }
                            td.n { b { (duration(o.seconds())) } }
                            td.n { (percent(o.seconds() / total)) }
                            @if o.feed_s > 0.0 {
                                td.n { (length(o.feed_length_mm)) }
                                td.n { (aligned(o.feed_length_mm / o.feed_s, fastest)) " mm/s" }
                            } @else {
                                td.n { (NOTHING) } td.n { (NOTHING) }
                            }
                        }
                    } }
                } }
            }
        }
    }
}

fn ratio(value: Option<f64>) -> Markup {
    html! {
        @match value {
            Some(r) => td.n {
                meter min="0" max="1" value=(format!("{:.4}", r.clamp(0.0, 1.0))) {}
                (format!("{r:.6}"))
            },
            None => td.n.dim { "not limited" },
        }
    }
}

/// The certificate, the tolerance, the end state.
pub(super) fn proof(report: &Report) -> Markup {
    let verdict = &report.certificate.verdict;
    let tolerance = &report.tolerance;
    html! {
        section {
            h2 { "Certificate" }
            p {
                @if verdict.holds { b.good { "Every limit is kept at every instant." } }
                @else { b.bad { "A limit is exceeded; no feed table was written." } }
                " Largest value over limit, proven on the rounded table that the drives play:"
            }
            div.scroll { table {
                thead { tr { th { "Axis" } th.n { "Velocity" } th.n { "Acceleration" } th.n { "Jerk" } } }
                tbody {
                    @for (a, r) in report.axes.iter().zip(&report.certificate.axes) {
                        tr { td { (a.name) } (ratio(Some(r.velocity))) (ratio(Some(r.acceleration))) (ratio(r.jerk)) }
                    }
                    tr { td { "Path, against the programmed feed" } (ratio(verdict.feed_ratio)) td {} td {} }
                }
            } }
            p {
                "The path is nowhere further than " b { (small(tolerance.deviation_mm)) " mm" }
                @if report.way_points.is_some() { " from the way-points" } @else { " from the programmed contour" }
                " (line " (tolerance.line) "); "
                (small(tolerance.tolerance_mm)) " mm are allowed, set by the " (tolerance.source) "."
            }
            @if let Some(sim) = &report.simulation {
                h3 { "End state of the simulated drives" }
                div.scroll { table {
                    thead { tr {
                        th { "Axis" } th.n { "End of program" } th.n { "Last set-point" } th { "State" }
                        th.n { "Largest following error" } th.n { "rms" } th.n { "Largest motor effort" }
                    } }
                    tbody { @for (a, d) in report.axes.iter().zip(&sim.axes) {
                        tr {
                            td { (a.name) }
                            td.n { (number(d.target_counts as f64)) " counts" }
                            td.n { (number(d.reached_counts as f64)) " counts" }
                            td {
                                @if d.arrived() { span.good { "\u{2713} exact, at rest" } }
                                @else if d.at_rest { span.bad { "\u{2717} at rest elsewhere" } }
                                @else { span.bad { "\u{2717} still moving" } }
                            }
                            td.n { (number(d.max_error)) " " (a.unit) } td.n { (number(d.rms_error)) " " (a.unit) }
                            td.n { (percent(d.effort_ratio)) " of limit" }
                        }
                    } }
                } }
                p.note {
                    (count(sim.setpoints)) " set-points of all axes at " (number(sim.tick_s * 1e3)) " ms, hash "
                    code { (sim.setpoint_hash) } ", never more than " (number(sim.path_deviation_counts))
                    " counts from the exact plan. "
                    @if let Some(c) = sim.contour {
                        "Across the path the load is never further than " (number(c.max_mm)) " mm from it, "
                        (number(c.rms_mm)) " mm rms. "
                    }
                    (count(sim.bus.frames)) " frames with " (bytes(sim.bus.bytes)) " crossed the bus, which was busy "
                    (percent(sim.bus.load)) " of the time."
                }
            }
        }
    }
}

fn bounds(b: &Bounds) -> Markup {
    html! {
        td.n { (number(b.velocity)) }
        td.n { (number(b.acceleration)) }
        td.n { @if let Some(j) = b.jerk { (number(j)) } @else { "none" } }
    }
}

fn fact(name: &str, value: &str) -> Markup {
    html! { tr { td { (name) } td.n { (value) } } }
}

/// Program, table, machine and planning.
pub(super) fn facts(report: &Report) -> Markup {
    let c = &report.counts;
    let t = &report.table;
    let p = &report.planning;
    html! {
        section.columns {
            div {
                h2 { @if report.way_points.is_some() { "Way-points" } @else { "Program" } }
                table.facts { tbody {
                    @if let Some(points) = &report.way_points {
                        (fact("Way-points", &count(points.count)))
                        (fact("Ends of the spline", &points.ends))
                        (fact("Knots of the spline", &points.knots))
                    }
                    @if report.way_points.is_none() {
                        (fact("Blocks", &count(c.blocks)))
                        (fact("Lines", &count(c.lines)))
                        (fact("Arcs", &count(c.arcs)))
                    }
                    @if c.splines > 0 { (fact("Splines", &count(c.splines))) }
                    (fact("Rapids", &count(c.rapids)))
                    (fact("Dwells", &count(c.dwells)))
                    (fact("Feed length", &length(c.feed_mm)))
                    (fact("Rapid length", &length(c.rapid_mm)))
                } }
            }
            div {
                h2 { "Stops by cause" }
                table.facts { tbody {
                    @for s in &report.stops { (fact(&s.cause, &count(s.count))) }
                    @if report.stops.is_empty() { tr { td { "none" } td {} } }
                } }
            }
            div {
                h2 { "Feed table" }
                table.facts { tbody {
                    (fact("Shared by all axes", &bytes(t.shared)))
                    @for (a, n) in report.axes.iter().zip(&t.axes) { (fact(&format!("Axis {}", a.name), &bytes(*n))) }
                    tr.sum { td { "Together" } td.n { (bytes(t.total())) } }
                    (fact("Sections, rest to rest", &count(t.sections)))
                    (fact("Spans of q", &count(t.spans)))
                    (fact("Spans of geometry", &count(t.geometry_spans)))
                    (fact("Shared bytes per span", &format!("{:.2}", t.shared as f64 / t.spans.max(1) as f64)))
                    @let own = t.axes.iter().sum::<u64>() as f64;
                    @let cells = (t.geometry_spans * t.axes.len() as u64).max(1) as f64;
                    (fact("Bytes per geometry span and axis", &format!("{:.2}", own / cells)))
                    @if report.times.motion_s > 0.0 {
                        (fact("Bytes per second of motion", &format!("{:.0}", t.total() as f64 / report.times.motion_s)))
                    }
                } }
            }
            div {
                h2 { "What ran where" }
                table.facts { tbody {
                    (fact("Solver", &p.solver))
                    (fact("Iterations", &count(p.iterations)))
                    @if let Some(gap) = p.gap { (fact("Left by the solver at most", &format!("{:.4} %", 100.0 * gap))) }
                    (fact("Jerk limit", &p.jerk_form))
                    (fact("Windows", &p.windows))
                    (fact("Planned and certified in", &duration(p.seconds)))
                    @if let Some(m) = p.peak_memory_mib { (fact("Peak memory", &format!("{m:.0} MiB"))) }
                    (fact("Set-points", if report.simulation.is_some() { "simulated drives" } else { "not played" }))
                    (fact("Physical drives", "none was used"))
                } }
            }
        }
        section {
            h2 { "Machine limits" }
            div.scroll { table {
                thead {
                    tr {
                        th rowspan="2" { "Axis" } th.c colspan="3" { "Feed" } th.c colspan="3" { "Rapid" }
                        th.n rowspan="2" { "Travel" } th.n rowspan="2" { "Counts per unit" } th.n rowspan="2" { "Motor" }
                    }
                    tr { @for _ in 0..2 { th.n { "Velocity" } th.n { "Acceleration" } th.n { "Jerk" } } }
                }
                tbody { @for a in &report.axes {
                    tr {
                        td { b { (a.name) } " " span.dim { (a.unit) } }
                        (bounds(&a.feed)) (bounds(&a.rapid))
                        td.n { (number(a.travel[0])) " to " (number(a.travel[1])) }
                        td.n { (number(a.counts_per_unit)) }
                        td.n { (number(a.effort)) @if a.linear { " N" } @else { " N m" } }
                    }
                } }
            } }
            p.note { "Per second, second squared and second cubed, in the unit of the axis." }
        }
    }
}

/// Most notes listed.
const NOTES: usize = 200;

/// Remarks and skipped codes.
pub(super) fn notes(report: &Report) -> Markup {
    html! {
        @if !report.notes.is_empty() {
            section {
                h2 { "Notes" }
                ul.notes { @for n in report.notes.iter().take(NOTES) {
                    li { span.dim { "line " (n.line) } " " (n.text) }
                } }
                @if report.notes.len() > NOTES { p.note { "and " (report.notes.len() - NOTES) " more, all in plan.json" } }
            }
        }
    }
}
