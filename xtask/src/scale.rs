//! Long paths, each planned in a process of its own so that peak memory is its own too.

use std::path::Path;
use std::process::Command;

use crate::shell::{Step, cargo};

/// Axes, legs of about ten spans each, threads, and how the path is divided.
const RUNS: [(u32, u32, u32, &str); 7] = [
    (3, 110, 1, "overlap"),
    (3, 1_100, 1, "overlap"),
    (3, 11_000, 1, "overlap"),
    (3, 11_000, 2, "overlap"),
    (3, 11_000, 1, "whole"),
    (7, 1_000, 1, "overlap"),
    (3, 110_000, 2, "overlap"),
];

/// Plans them one after the other and prints one line of JSON for each.
pub(crate) fn run(root: &Path) -> Step {
    cargo(root, &["build", "--release", "--locked", "--package", "planner", "--example", "scale"])?;
    for (axes, legs, threads, windows) in RUNS {
        let status = Command::new(root.join("target/release/examples/scale"))
            .args([axes, legs, threads].map(|n| n.to_string()))
            .arg(windows)
            .status()
            .map_err(|e| format!("scale does not start: {e}"))?;
        if !status.success() {
            return Err(format!("{legs} legs on {axes} axes: {status}"));
        }
    }
    Ok(())
}
