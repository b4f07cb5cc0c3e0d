//! Fuzzing: by libFuzzer where it is installed, otherwise in this process.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::shell::{self, Step, cargo_with};

/// The file that lists the targets.
const MANIFEST: &str = "fuzz/Cargo.toml";

/// Fuzzes every target for so long.
pub(crate) fn run(root: &Path, seconds: u64) -> Step {
    match missing() {
        None => with_fuzzer(root, seconds),
        Some(what) => {
            shell::skip(
                "libFuzzer",
                &format!("{what}; the same bodies run on random and changed inputs instead"),
            );
            in_process(root, seconds)
        }
    }
}

/// What the fuzzer needs and this machine lacks.
fn missing() -> Option<&'static str> {
    let works = |words: &[&str]| {
        let mut command = Command::new("cargo");
        // Cargo tells its children which toolchain they belong to.
        command.args(words).env_remove("RUSTUP_TOOLCHAIN").env_remove("CARGO");
        command.stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok_and(|status| status.success())
    };
    if !works(&["+nightly", "--version"]) {
        Some("there is no nightly toolchain")
    } else if !works(&["+nightly", "fuzz", "--version"]) {
        Some("there is no cargo-fuzz")
    } else {
        None
    }
}

fn in_process(root: &Path, seconds: u64) -> Step {
    let words =
        ["test", "--release", "--locked", "--package", "tests", "--test", "fuzzing", "--", "--nocapture"];
    cargo_with(root, &words, &[("FEEDSPLINE_FUZZ_SECONDS", &seconds.to_string())])
}

/// One target after the other; those that fail do not keep the others from running.
fn with_fuzzer(root: &Path, seconds: u64) -> Step {
    let manifest = fs::read_to_string(root.join(MANIFEST)).map_err(|e| format!("{MANIFEST}: {e}"))?;
    let mut lines = Vec::new();
    let mut failed = Vec::new();
    for target in targets(&manifest) {
        let limit = format!("-max_total_time={seconds}");
        let words = [
            "+nightly",
            "fuzz",
            "run",
            target,
            "--",
            &limit,
            "-print_final_stats=1",
            "-max_len=4096",
            "-verbosity=0",
        ];
        eprintln!("$ cargo {}", words.join(" "));
        let mut command = Command::new("cargo");
        command.current_dir(root).args(words).env_remove("RUSTUP_TOOLCHAIN").env_remove("CARGO");
        let output =
            command.stderr(Stdio::piped()).output().map_err(|e| format!("cargo does not start: {e}"))?;
        let said = String::from_utf8_lossy(&output.stderr);
        match executions(&said) {
            Some(count) if output.status.success() => {
                lines.push(format!("  {target:<14} {count:>12} executions"))
            }
            _ => {
                eprintln!("{said}");
                lines.push(format!("  {target:<14} FAILED: {}", output.status));
                failed.push(target);
            }
        }
    }
    eprintln!("\n{}", lines.join("\n"));
    if failed.is_empty() { Ok(()) } else { Err(format!("failed: {}", failed.join(", "))) }
}

/// Names of the binaries of a manifest.
fn targets(manifest: &str) -> Vec<&str> {
    let bins = manifest.split("[[bin]]").skip(1);
    bins.filter_map(|bin| bin.split_once("name = \"")?.1.split_once('"').map(|(name, _)| name)).collect()
}

/// What the fuzzer says of how often it has run a body.
fn executions(said: &str) -> Option<u64> {
    said.lines().find_map(|line| line.strip_prefix("stat::number_of_executed_units:")?.trim().parse().ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_are_those_of_the_manifest_and_executions_those_of_the_fuzzer() {
        let manifest = "[package]\nname = \"fuzz\"\n[[bin]]\nname = \"frame\"\n[[bin]]\nname = \"table\"\n";
        assert_eq!(targets(manifest), ["frame", "table"]);
        assert_eq!(executions("x\nstat::number_of_executed_units: 4096\nstat::other: 1"), Some(4096));
        assert_eq!(executions("SUMMARY: libFuzzer: deadly signal"), None);
    }
}
