//! Commands as steps.

use std::path::Path;
use std::process::Command;
use std::sync::Mutex;
use std::time::Instant;

/// How a step ended; an error says what failed.
pub(crate) type Step = Result<(), String>;

/// What could not be done for want of something outside, and what that is.
static SKIPPED: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// Says that something is left out, now and in the table at the end.
pub(crate) fn skip(what: &str, reason: &str) {
    let line = format!("SKIPPED {what}: {reason}");
    eprintln!("{line}");
    if let Ok(mut all) = SKIPPED.lock() {
        all.push(line);
    }
}

/// Runs cargo in the workspace.
pub(crate) fn cargo(root: &Path, args: &[&str]) -> Step {
    cargo_with(root, args, &[])
}

/// As [`cargo`], with environment variables.
pub(crate) fn cargo_with(root: &Path, args: &[&str], environment: &[(&str, &str)]) -> Step {
    let words = args.join(" ");
    eprintln!("$ cargo {words}");
    let status = cargo_command(root, args)
        .envs(environment.iter().copied())
        .status()
        .map_err(|e| format!("cargo does not start: {e}"))?;
    if status.success() { Ok(()) } else { Err(format!("cargo {words}: {status}")) }
}

/// The cargo that runs this program, not started yet.
pub(crate) fn cargo_command(root: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(root).args(args);
    command
}

/// Runs all named steps, says how each went, and fails if one did.
pub(crate) fn run_all(steps: &[(&str, &dyn Fn() -> Step)]) -> Step {
    let mut lines = Vec::new();
    let mut failed = Vec::new();
    for (name, step) in steps {
        let begin = Instant::now();
        let result = step();
        let seconds = begin.elapsed().as_secs_f64();
        let verdict = match &result {
            Ok(()) => "ok".to_string(),
            Err(message) => format!("FAILED: {message}"),
        };
        lines.push(format!("  {name:<14} {seconds:7.1} s  {verdict}"));
        if result.is_err() {
            failed.push(*name);
        }
    }
    eprintln!("\n{}", lines.join("\n"));
    if let Ok(skipped) = SKIPPED.lock().as_deref()
        && !skipped.is_empty()
    {
        eprintln!("  {} left out: {}", skipped.len(), skipped.join("; "));
    }
    if failed.is_empty() { Ok(()) } else { Err(format!("failed: {}", failed.join(", "))) }
}
