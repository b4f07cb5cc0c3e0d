//! The summaries of `drive` and `bus`.

use super::{Sheet, bytes, count, duration, printable};
use crate::json::{DecodedJson, DrivesJson, HealthJson, UpdateJson, WatchedJson};

/// The summary of `drive`.
pub fn drives(d: &DrivesJson) -> String {
    let heading =
        format!("{} drives of {} on {} for {}", d.drives.len(), d.machine, d.bus, duration(d.seconds));
    let mut s = Sheet::new(&heading);
    for drive in &d.drives {
        let open = if drive.epoch_open { "open" } else { "closed" };
        let fault = drive.fault.as_ref().map(|fault| format!(", FAULT {fault}")).unwrap_or_default();
        s.row(
            &format!("node {} {}", drive.node, drive.axis),
            &format!(
                "{}, {}, epoch {} {open}, at {} counts, {} ticks{fault}",
                drive.state,
                drive.power,
                drive.epoch,
                drive.position_counts,
                count(drive.ticks)
            ),
        );
    }
    let late = count(d.late_ticks);
    s.row("late ticks", &format!("{late}, by {} at most", duration(d.worst_lateness_s)));
    health(&mut s, &d.bus_health);
    s.text
}

/// The summary of `update`.
pub fn updated(u: &UpdateJson) -> String {
    let mut s = Sheet::new(&format!("node {} runs {}", u.node, u.image));
    s.row("image", &format!("{} in {}", bytes(u64::from(u.image_bytes)), duration(u.seconds)));
    s.row("sha256", &u.sha256);
    s.text
}

/// The line of something that was said on a bus.
pub fn decoded(d: &DecodedJson) -> String {
    let node = d.node.map_or_else(|| "-".to_owned(), |node| node.to_string());
    let text = printable(&d.text);
    format!("{:17.6}  {:>8}  {node:>3}  {:<9}  {text}\n", d.time_s, d.id, d.kind)
}

/// The summary of `bus`.
pub fn watched(w: &WatchedJson) -> String {
    let mut s = Sheet::new(&w.source);
    let kinds: Vec<String> = w.counts.iter().map(|(kind, n)| format!("{} {kind}", count(*n))).collect();
    s.row("frames", &format!("{}: {}", count(w.frames), kinds.join(", ")));
    if let Some(h) = &w.bus_health {
        health(&mut s, h);
    }
    if w.malformed_lines > 0 {
        s.row("malformed lines", &count(w.malformed_lines));
    }
    s.text
}

fn health(s: &mut Sheet, h: &HealthJson) {
    let mut text = format!("{} frames, {}", count(h.frames), bytes(h.bytes));
    for (number, word) in [
        (h.bus_errors, "errors"),
        (h.overruns, "lost on the way in"),
        (h.foreign, "of others"),
        (h.dropped, "not sent"),
        (h.unconfirmed, "sent without confirmation"),
    ] {
        if number > 0 {
            text.push_str(&format!(", {} {word}", count(number)));
        }
    }
    s.row("bus", &text);
}
