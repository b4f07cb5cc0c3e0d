//! TOPP-RA, in a Python of its own.

use std::fs;
use std::path::Path;
use std::process::Command;

use planner::job::machine::AxisLimits;
use serde_json::Value;

use crate::sample::Sampled;

/// What TOPP-RA took.
pub struct Toppra {
    /// Name and version.
    pub name: String,
    /// Building the instance [s].
    pub setup: f64,
    /// Computing the profile [s].
    pub compute: f64,
    /// Traverse time [s].
    pub time: f64,
}

/// Runs TOPP-RA in `python` under the same limits on every axis.
pub fn toppra(python: &Path, path: &Sampled, limits: &AxisLimits, repeats: usize) -> Result<Toppra, String> {
    let data = std::env::temp_dir().join(format!("toppra-{}.f64", std::process::id()));
    let bytes: Vec<u8> = path.derivatives[1..=2].iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
    fs::write(&data, bytes).map_err(|e| format!("{}: {e}", data.display()))?;
    let length = path.stations[path.stations.len() - 1];
    let numbers =
        [path.stations.len() as f64, path.axes as f64, length, limits.velocity, limits.acceleration];
    let output = Command::new(python)
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/toppra_peer.py"))
        .arg(&data)
        .args(numbers.map(|n| n.to_string()))
        .arg(repeats.to_string())
        .output();
    let _ = fs::remove_file(&data);
    let output = output.map_err(|e| format!("{}: {e}", python.display()))?;
    if !output.status.success() {
        return Err(format!("toppra: {}", String::from_utf8_lossy(&output.stderr)));
    }
    let answer: Value = serde_json::from_slice(&output.stdout).map_err(|e| format!("toppra: {e}"))?;
    let number = |field: &str| answer[field].as_f64().ok_or_else(|| format!("toppra gives no {field}"));
    let name = format!("toppra {}", answer["version"].as_str().unwrap_or("?"));
    Ok(Toppra { name, setup: number("setup")?, compute: number("compute")?, time: number("time")? })
}
