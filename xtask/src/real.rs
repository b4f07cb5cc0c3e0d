//! Runs the release binary over part programs and prints what it makes of them.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use crate::shell::{Step, cargo};

/// Extensions of part programs.
const PROGRAMS: [&str; 6] = ["ngc", "nc", "gcode", "tap", "cnc", "gc"];

/// Columns of numbers: heading, JSON field, decimals.
const COLUMNS: [(&str, &str, usize); 14] = [
    ("rapids", "rapids", 0),
    ("lines", "lines", 0),
    ("arcs", "arcs", 0),
    ("feed mm", "feed_length_mm", 3),
    ("rapid mm", "rapid_length_mm", 3),
    ("stops", "stops", 0),
    ("dev mm", "max_deviation_mm", 5),
    ("cycle s", "cycle_time_s", 2),
    ("const s", "constant_feed_time_s", 2),
    ("spans", "spans", 0),
    ("bytes", "table_bytes", 0),
    ("plan s", "plan_seconds", 2),
    ("MiB", "peak_memory_mib", 0),
    ("jerk", "jerk_ratio", 6),
];

/// Prints one row per program; a refused one shows its diagnostic. Fails when a program ends in anything but
/// success or a refusal.
pub(crate) fn table(root: &Path, dir: &Path, machine: Option<&Path>) -> Step {
    let mut programs = Vec::new();
    collect(dir, &mut programs)?;
    programs.sort();
    if programs.is_empty() {
        return Err(format!("{}: no part programs", dir.display()));
    }
    cargo(root, &["build", "--release", "--package", "cli"])?;
    let scratch = root.join("target/real");
    fs::create_dir_all(&scratch).map_err(|e| format!("{}: {e}", scratch.display()))?;
    let headings = COLUMNS.map(|(name, ..)| format!("{name:>10}")).join(" ");
    println!("{:<28} {:>4} {:>8} {headings}", "program", "exit", "wall s");
    let mut broken = Vec::new();
    for program in &programs {
        let (name, job) = unpack(program, &scratch)?;
        let begin = Instant::now();
        let mut command = Command::new(root.join("target/release/feedspline"));
        command.arg("run").arg(&job).arg("--json").arg("--out").arg(scratch.join(format!("{name}.out")));
        command.args(["--trace-every", "1000"]).stderr(Stdio::null());
        if let Some(machine) = machine {
            command.arg("--machine").arg(machine);
        }
        let output = command.output().map_err(|e| format!("feedspline does not start: {e}"))?;
        let wall = begin.elapsed().as_secs_f64();
        let text = String::from_utf8_lossy(&output.stdout);
        let code = output.status.code().map_or("?".into(), |c| c.to_string());
        let row = match text_field(&text, "message") {
            Some(message) => {
                let line = number(&text, "line").map(|l| format!("line {l}: ")).unwrap_or_default();
                format!("{line}{message}")
            }
            None => COLUMNS.map(|(_, field, decimals)| cell(number(&text, field), decimals)).join(" "),
        };
        println!("{name:<28} {code:>4} {wall:>8.2} {row}");
        if !matches!(output.status.code(), Some(0 | 2)) {
            broken.push(name);
        }
    }
    println!("{} programs", programs.len());
    if broken.is_empty() { Ok(()) } else { Err(format!("failed: {}", broken.join(", "))) }
}

fn collect(dir: &Path, found: &mut Vec<PathBuf>) -> Step {
    for entry in fs::read_dir(dir).map_err(|e| format!("{}: {e}", dir.display()))? {
        let path = entry.map_err(|e| e.to_string())?.path();
        if path.is_dir() {
            collect(&path, found)?;
        } else if is_program(&path) {
            found.push(path);
        }
    }
    Ok(())
}

fn is_program(path: &Path) -> bool {
    let name = path.to_string_lossy().to_lowercase();
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    name.rsplit_once('.').is_some_and(|(_, extension)| PROGRAMS.contains(&extension))
}

/// The program's name and a file that holds its text.
fn unpack(program: &Path, scratch: &Path) -> Result<(String, PathBuf), String> {
    let name = program.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let Some(plain) = name.strip_suffix(".gz") else { return Ok((name, program.to_path_buf())) };
    let target = scratch.join(plain);
    let file = File::create(&target).map_err(|e| format!("{}: {e}", target.display()))?;
    let status = Command::new("gzip")
        .arg("-dc")
        .arg(program)
        .stdout(file)
        .status()
        .map_err(|e| format!("gzip does not start: {e}"))?;
    if status.success() { Ok((plain.to_string(), target)) } else { Err(format!("gzip {name}: {status}")) }
}

/// What stands behind the first `"field":` of a JSON text.
fn value<'a>(json: &'a str, field: &str) -> Option<&'a str> {
    let key = format!("\"{field}\":");
    json.split_once(&key).map(|(_, rest)| rest.trim_start())
}

fn number(json: &str, field: &str) -> Option<f64> {
    let rest = value(json, field)?;
    let end = rest.find([',', '\n', '}']).unwrap_or(rest.len());
    rest[..end].trim().parse().ok()
}

fn text_field(json: &str, field: &str) -> Option<String> {
    let rest = value(json, field)?.strip_prefix('"')?;
    let mut text = String::new();
    let mut escaped = false;
    for c in rest.chars() {
        match c {
            '"' if !escaped => return Some(text),
            '\\' if !escaped => escaped = true,
            c => {
                escaped = false;
                text.push(c);
            }
        }
    }
    None
}

fn cell(value: Option<f64>, decimals: usize) -> String {
    value.map_or_else(|| format!("{:>10}", "-"), |v| format!("{v:>10.decimals$}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_read_from_pretty_json() {
        let json =
            "{\n  \"lines\": 12,\n  \"jerk_ratio\": null,\n  \"message\": \"a \\\"b\\\"\",\n  \"s\": 1.5e-3}";
        assert_eq!(number(json, "lines"), Some(12.0));
        assert_eq!(number(json, "s"), Some(1.5e-3));
        assert_eq!(number(json, "jerk_ratio"), None);
        assert_eq!(text_field(json, "message").as_deref(), Some("a \"b\""));
        assert_eq!(text_field(json, "absent"), None);
    }

    #[test]
    fn packed_programs_are_programs() {
        for (path, expected) in [("a/B.NGC", true), ("x.nc.gz", true), ("readme.md", false), ("ngc", false)] {
            assert_eq!(is_program(Path::new(path)), expected, "{path}");
        }
    }
}
