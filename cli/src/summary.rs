//! What a verb prints for people: one aligned column of names, one of values.

mod bus;
pub mod live;

pub use bus::{decoded, drives, updated, watched};

use crate::json::{
    BusJson, CertificateJson, CompareJson, DriveLimitsJson, FlashJson, InspectJson, MethodJson, MethodState,
    MoveJson, PhaseJson, PlanJson, SampleJson, StateJson, VerifyJson,
};
use crate::report::compare::{change, seconds};
use crate::report::words::{bytes, count, duration, length, percent, small, times};

/// The summary of `plan` and `run`.
pub fn plan(p: &PlanJson) -> String {
    let mut s = Sheet::new(&format!("{} on {}", p.job, p.machine));
    if let Some(points) = &p.way_points {
        let (ends, knots) = (&points.ends, &points.knots);
        let (points, spans) = (count(points.count), count(points.geometry_spans));
        s.row("way-points", &format!("{points}, {ends} spline in {spans} spans, {knots} knots"));
    } else {
        s.row("program", &blocks(p));
    }
    s.row("length", &format!("{} feed, {} rapid", length(p.feed_length_mm), length(p.rapid_length_mm)));
    s.row("stops", &format!("{}, {} dwells", count(p.stops), count(p.dwells)));
    s.row("cycle time", &format!("{} ({} in motion)", duration(p.cycle_time_s), duration(p.motion_time_s)));
    s.row("at constant feed", &duration(p.constant_feed_time_s));
    if let Some(stop) = p.stop_every_block_time_s {
        let gain = if p.motion_time_s > 0.0 { stop / p.motion_time_s } else { 1.0 };
        let name = if p.way_points.is_some() { "stop at each point" } else { "stop at each block" };
        s.row(name, &format!("{} ({} as long)", duration(stop), times(gain)));
    }
    let (bound, allowed) = (p.max_deviation_mm, p.tolerance_mm);
    let [bound, allowed] = [bound, allowed].map(small);
    s.row("deviation", &format!("{bound} mm of {allowed} mm allowed ({})", p.tolerance_source));
    let per_second = p.table_bytes as f64 / p.motion_time_s.max(f64::MIN_POSITIVE);
    let rate = if p.motion_time_s > 0.0 { format!(", {per_second:.0} B/s") } else { String::new() };
    s.row("table", &format!("{} in {} spans{rate}", bytes(p.table_bytes), count(p.spans)));
    s.certificate(&p.certificate);
    if let Some(sim) = &p.simulation {
        let end = if sim.at_end { "at the end point, at rest" } else { "NOT at the end point" };
        s.row("simulated drives", &format!("{} set-points, {end}", count(sim.setpoints)));
        let (max, rms) = (sim.max_following_error_mm, sim.rms_following_error_mm);
        s.row("following error", &format!("{max:.4} mm at most, {rms:.4} mm rms"));
        let (max, rms) = (sim.max_contour_error_mm, sim.rms_contour_error_mm);
        s.row("contour error", &format!("{max:.4} mm at most, {rms:.4} mm rms"));
        let BusJson { frames, bytes: size, load } = sim.bus;
        s.row("bus", &format!("{} frames, {}, busy {}", count(frames), bytes(size), percent(load)));
    }
    let memory = p.peak_memory_mib.map(|m| format!(", {m:.0} MiB")).unwrap_or_default();
    let gap = p.gap_estimate.map(|g| format!(", at most {:.4} % left", 100.0 * g)).unwrap_or_default();
    let jerk = if p.jerk_form == "none" { "no".into() } else { p.jerk_form.clone() };
    s.row("solver", &format!("{}, {jerk} jerk, {} iterations{gap}", p.solver, count(p.iterations)));
    s.row("planned in", &format!("{}{memory}", duration(p.plan_seconds)));
    for note in p.notes.iter().take(NOTES) {
        s.row("note", &format!("line {}: {}", note.line, note.text));
    }
    if p.notes.len() > NOTES {
        s.row("", &format!("and {} more, all in the report", p.notes.len() - NOTES));
    }
    if let Some(feed) = &p.files.feed {
        s.row("feed table", feed);
    }
    if let Some(report) = &p.files.report {
        s.row("report", report);
    }
    s.text
}

fn blocks(p: &PlanJson) -> String {
    let mut kinds = vec![format!("{} lines", count(p.lines)), format!("{} arcs", count(p.arcs))];
    if p.splines > 0 {
        kinds.push(format!("{} splines", count(p.splines)));
    }
    kinds.push(format!("{} rapids", count(p.rapids)));
    format!("{} blocks: {}", count(p.blocks), kinds.join(", "))
}

/// The table of `compare`.
pub fn compare(c: &CompareJson) -> String {
    let mut s = Sheet::new(&format!("{} on {}", c.job, c.machine));
    let threads = if c.threads == 1 { "1 thread".into() } else { format!("{} threads", c.threads) };
    s.row("path", &format!("{} in {} spans, {threads}", length(c.feed_length_mm), count(c.geometry_spans)));
    let columns = |cells: [&str; 9]| {
        let [computing, traverse, change, certified, v, a, j, spans, iterations] = cells;
        let text = format!(
            "{computing:<10} {traverse:>14} {change:>12}  {certified:<10}{v:>8} {a:>8} {j:>9} {spans:>9} {iterations:>10}"
        );
        text.trim_end().to_owned()
    };
    let heads = ["computing", "traverse", "on whole", "certified", "v", "a", "j", "spans", "iterations"];
    s.row("method", &columns(heads));
    for m in &c.methods {
        let text = match (&m.remark, m.state) {
            (Some(remark), MethodState::LeftOut) => format!("left out: {remark}"),
            (Some(remark), _) => format!("no motion: {remark}"),
            (None, _) => columns(cells(m).each_ref().map(String::as_str)),
        };
        s.row(&m.method, &text);
    }
    if let Some(speed) = c.methods.iter().find_map(|m| m.constant_feed_mm_s) {
        s.row("constant feed", &format!("{speed:.3} mm/s, the largest that keeps all limits all along"));
    }
    if let Some(report) = &c.files.report {
        s.row("report", report);
    }
    s.text
}

fn cells(m: &MethodJson) -> [String; 9] {
    let some = |value: Option<String>| value.unwrap_or_else(|| "\u{2013}".into());
    let ratio = |value: Option<f64>| some(value.map(|r| format!("{r:.4}")));
    [
        some(m.compute_seconds.map(seconds)),
        some(m.traverse_time_s.map(duration)),
        some(m.over_whole.map(change)),
        some(m.certified.map(|c| if c { "yes" } else { "NO" }.into())),
        ratio(m.velocity_ratio),
        ratio(m.acceleration_ratio),
        ratio(m.jerk_ratio),
        some(m.spans.map(count)),
        some(m.iterations.map(count)),
    ]
}

/// The summary of `sample`.
pub fn sample(written: &SampleJson) -> String {
    let mut s = Sheet::new(&written.file);
    s.row("way-points", &count(written.points));
    s.row("size", &bytes(written.file_bytes));
    s.text
}

/// One row of `move`.
pub fn motion(m: &MoveJson) -> String {
    let mut text = format!("row {}", m.row);
    if let Some(error) = &m.error {
        let axis = error.axis.as_ref().map(|a| format!("axis {a}: ")).unwrap_or_default();
        return format!("{text}, line {}: {axis}{}: {}\n", m.line, error.name, error.message);
    }
    let (seconds, sync) = (m.duration_s.unwrap_or_default(), m.sync.unwrap_or_default());
    text.push_str(&format!(": {seconds:.6} s"));
    if let Some(phases) = &m.phases {
        text.push('\n');
        text.push_str(&table(phases));
    }
    if m.axes.is_some() {
        text.push_str(&format!(", sync {sync}\n"));
    }
    for axis in m.axes.iter().flatten() {
        let name = printable(&axis.axis);
        text.push_str(&format!("  axis {name}: {:.6} s\n{}", axis.duration_s, table(&axis.phases)));
    }
    text
}

/// Phases, one a line.
fn table(phases: &[PhaseJson]) -> String {
    let head = ["seconds", "jerk", "from position", "velocity", "acceleration"];
    let mut text =
        format!("    {:>12} {:>14} {:>16} {:>14} {:>14}\n", head[0], head[1], head[2], head[3], head[4]);
    for p in phases {
        let StateJson { position, velocity, acceleration } = p.start;
        text.push_str(&format!(
            "    {:>12.6} {:>14} {:>16} {:>14} {:>14}\n",
            p.duration_s,
            digits(p.jerk),
            digits(position),
            digits(velocity),
            digits(acceleration)
        ));
    }
    text
}

/// Six digits, whatever the size.
fn digits(x: f64) -> String {
    let size = x.abs();
    if x == 0.0 {
        "0".into()
    } else if (1e-3..1e7).contains(&size) {
        let before = size.log10().floor() as i32 + 1;
        format!("{x:.*}", (6 - before).clamp(0, 8) as usize)
    } else {
        format!("{x:.5e}")
    }
}

/// The summary of `flash`.
pub fn flash(f: &FlashJson) -> String {
    let mut s = Sheet::new(&format!("drive {} on the board {}", f.node, f.board));
    s.row("image", &f.image);
    s.row("core", &format!("{}, table format {}", f.core_version, f.format_version));
    let same = if f.schema_matches { "the host's" } else { "NOT the host's" };
    s.row("protocol", &format!("{}, {same}", f.schema_hash));
    s.row("axis", &format!("{}, control tick {}", f.axis, duration(f.control_tick_s)));
    let DriveLimitsJson { velocity_counts_s: v, acceleration_counts_s2: a, jerk_counts_s3: j } =
        f.drive_limits;
    let jerk = j.map_or("no jerk limit".into(), |j| format!("{j:e} counts/s^3"));
    s.row("limits", &format!("{v:e} counts/s, {a:e} counts/s^2, {jerk}"));
    s.row("room for a table", &bytes(u64::from(f.table_room_bytes)));
    s.text
}

/// The summary of `verify`.
pub fn verify(v: &VerifyJson) -> String {
    let mut s = Sheet::new(&v.file);
    s.row("motion", &format!("{} in {} sections", duration(v.motion_time_s), count(v.sections)));
    s.row("proven", &format!("{} spans in {}", count(v.spans), duration(v.verify_seconds)));
    for axis in &v.axes {
        let jerk = axis.jerk_ratio.map(|j| format!("  j {j:.6}")).unwrap_or_default();
        s.row(
            &format!("axis {}", axis.name),
            &format!("v {:.6}  a {:.6}{jerk}", axis.velocity_ratio, axis.acceleration_ratio),
        );
    }
    s.certificate(&v.certificate);
    for fault in &v.faults {
        s.row("fault", fault);
    }
    if v.fault_count > v.faults.len() as u64 {
        s.row("", &format!("and {} more", count(v.fault_count - v.faults.len() as u64)));
    }
    s.text
}

/// The summary of `inspect`.
pub fn inspect(i: &InspectJson) -> String {
    let mut s = Sheet::new(&i.file);
    s.row("format", &format!("version {}, schema {}", i.format_version, i.schema_hash));
    s.row("size", &format!("{} file, {} tables", bytes(i.file_bytes), bytes(i.table_bytes)));
    s.row("sections", &format!("{}, {} dwells", count(i.sections), count(i.dwells)));
    s.row("spans", &format!("{} of q, {} of geometry", count(i.spans), count(i.geometry_spans)));
    s.row("cycle time", &format!("{} ({} in motion)", duration(i.cycle_time_s), duration(i.motion_time_s)));
    s.row("control tick", &format!("{} ms", i.control_tick_s * 1e3));
    s.row("shared part", &bytes(i.shared_bytes));
    for axis in &i.axes {
        let (start, end) = (axis.start_counts, axis.end_counts);
        let scale = axis.counts_per_unit;
        s.row(
            &format!("axis {}", axis.name),
            &format!("{}, counts {start} to {end}, {scale} per {}", bytes(axis.bytes), axis.unit),
        );
    }
    s.text
}

/// Most notes a summary lists.
const NOTES: usize = 5;

/// Lines of `name  value` under a heading.
struct Sheet {
    text: String,
}

impl Sheet {
    fn new(heading: &str) -> Self {
        Sheet { text: format!("{}\n", printable(heading)) }
    }

    fn row(&mut self, name: &str, value: &str) {
        self.text.push_str(&format!("  {name:<19} {}\n", printable(value)));
    }

    fn certificate(&mut self, c: &CertificateJson) {
        let mut ratios = format!("v {:.6}, a {:.6}", c.velocity_ratio, c.acceleration_ratio);
        for (name, ratio) in [("j", c.jerk_ratio), ("feed", c.feed_ratio)] {
            if let Some(ratio) = ratio {
                ratios.push_str(&format!(", {name} {ratio:.6}"));
            }
        }
        let verdict = if c.holds { "holds" } else { "DOES NOT HOLD" };
        self.row("certificate", &format!("{verdict}: {ratios} of the limits"));
    }
}

/// Text from files without control characters: a comment must not steer the terminal.
fn printable(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect()
}
