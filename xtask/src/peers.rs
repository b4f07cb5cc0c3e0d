//! Other planners beside this one: a Python of their own, the package that runs them, and its table.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::shell::{Step, cargo};

/// The version of TOPP-RA that is compared with.
const TOPPRA: &str = "toppra==0.6.10";

/// Builds and runs the peers; the table is written to `target/peers/peers.json`.
pub(crate) fn run(root: &Path) -> Step {
    let target = root.join("target/peers");
    fs::create_dir_all(&target).map_err(|e| format!("{}: {e}", target.display()))?;
    let python = match python(&target.join("python")) {
        Ok(python) => Some(python),
        Err(reason) => {
            eprintln!("xtask: SKIPPED toppra, it is not compared with: {reason}");
            None
        }
    };
    let json = target.join("peers.json");
    let mut words = vec!["run", "--release", "--locked", "--manifest-path", "tests/peers/Cargo.toml"];
    let (target, json) = (target.to_string_lossy(), json.to_string_lossy());
    words.extend(["--target-dir", &target, "--", &json]);
    let python = python.as_deref().map(Path::to_string_lossy);
    words.extend(python.as_deref());
    cargo(root, &words)
}

/// The interpreter of an environment that has TOPP-RA, made where there is none yet.
fn python(environment: &Path) -> Result<PathBuf, String> {
    let inside = environment.join("bin/python3");
    let has = |python: &Path| {
        Command::new(python).args(["-c", "import toppra"]).output().is_ok_and(|o| o.status.success())
    };
    if !has(&inside) {
        quiet(Command::new("python3").args(["-m", "venv"]).arg(environment))?;
        quiet(Command::new(&inside).args(["-m", "pip", "install", "--quiet", TOPPRA]))?;
    }
    if has(&inside) { Ok(inside) } else { Err(format!("{TOPPRA} does not import")) }
}

/// Runs a command; an error holds what it said.
fn quiet(command: &mut Command) -> Step {
    let output = command.output().map_err(|e| format!("{}: {e}", command.get_program().display()))?;
    if output.status.success() { Ok(()) } else { Err(String::from_utf8_lossy(&output.stderr).trim().into()) }
}
