//! Runs every test and counts what was skipped, loudly.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::Stdio;

use crate::shell::{Step, cargo_command};

/// What the test output says.
#[derive(Debug, Default, PartialEq, Eq)]
struct Tally {
    passed: u64,
    failed: u64,
    /// Names and reasons.
    skipped: Vec<String>,
}

impl Tally {
    /// Reads one line of libtest's output.
    fn read(&mut self, line: &str) {
        let line = line.trim();
        if let Some(counts) = line.strip_prefix("test result: ") {
            for part in counts.split([';', '.']) {
                let mut words = part.split_whitespace();
                let (Some(n), Some(what)) = (words.next().and_then(|n| n.parse::<u64>().ok()), words.next())
                else {
                    continue;
                };
                match what {
                    "passed" => self.passed += n,
                    "failed" => self.failed += n,
                    _ => {}
                }
            }
        } else if let Some((name, verdict)) = line.strip_prefix("test ").and_then(|l| l.split_once(" ... "))
            && let Some(reason) = verdict.strip_prefix("ignored")
        {
            let reason = reason.trim_start_matches([',', ' ']);
            let reason = if reason.is_empty() { "no reason given" } else { reason };
            self.skipped.push(format!("{name}: {reason}"));
        }
    }

    fn tell(&self) {
        eprintln!("\n{} passed, {} failed, {} SKIPPED", self.passed, self.failed, self.skipped.len());
        for name in &self.skipped {
            eprintln!("  SKIPPED {name}");
        }
    }
}

/// `cargo test --workspace`, doctests included.
pub(crate) fn run(root: &Path) -> Step {
    let args = ["test", "--workspace", "--locked", "--no-fail-fast"];
    eprintln!("$ cargo {}", args.join(" "));
    let mut child = cargo_command(root, &args)
        .stdout(Stdio::piped())
        .spawn()
        .map_err(|e| format!("cargo does not start: {e}"))?;
    let mut tally = Tally::default();
    if let Some(out) = child.stdout.take() {
        for line in BufReader::new(out).split(b'\n') {
            let line = line.map_err(|e| format!("the tests' output is lost: {e}"))?;
            let line = String::from_utf8_lossy(&line);
            println!("{line}");
            tally.read(&line);
        }
    }
    let status = child.wait().map_err(|e| format!("the tests are lost: {e}"))?;
    tally.tell();
    if !status.success() {
        return Err(format!("cargo test: {status}"));
    }
    if tally.passed == 0 { Err("no test ran".into()) } else { Ok(()) }
}

#[cfg(test)]
mod checks {
    use super::*;

    #[test]
    fn counts_and_reasons_are_read() {
        let mut tally = Tally::default();
        for line in [
            "running 3 tests",
            "test a::b ... ok",
            "test a::c ... ignored, needs a terminal",
            "test a::d ... ignored",
            "test result: ok. 5 passed; 0 failed; 2 ignored; 0 measured; 0 filtered out; finished in 0.00s",
            "test result: FAILED. 1 passed; 2 failed; 0 ignored; 0 measured; 0 filtered out; finished in 1.50s",
        ] {
            tally.read(line);
        }
        let skipped = vec!["a::c: needs a terminal".into(), "a::d: no reason given".into()];
        assert_eq!(tally, Tally { passed: 6, failed: 2, skipped });
    }
}
