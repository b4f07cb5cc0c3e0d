//! The images of the drive: built, looked into, and run on an emulated Cortex-M4F beside the host.

mod image;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::shell::{Step, cargo, cargo_command, skip};

/// How images are built: where they are looked for, whatever the environment says.
const BUILD: [&str; 5] = ["build", "--release", "--locked", "--target-dir", "target"];
/// What the images are built for.
const TARGET: &str = "thumbv7em-none-eabihf";
/// The emulator, and the board it plays: one instruction takes 1024 ns of its timer's time.
const QEMU: &str = "qemu-system-arm";
const BOARD: [&str; 10] = [
    "-machine",
    "mps2-an386",
    "-display",
    "none",
    "-monitor",
    "none",
    "-semihosting-config",
    "enable=on,target=native",
    "-icount",
    "shift=10",
];
/// Seconds after which the emulator is stopped.
const PATIENCE_S: &str = "300";

/// What host and image have to agree on.
const SAME: [&str; 7] =
    ["setpoints", "setpoint_hash", "driven", "driven_hash", "plans", "imprecise", "plan_hash"];

/// Most instructions, and bytes of stack, that the image may report: what was measured, and a twentieth more. docs/benchmarks.md has targets.
const MOST: [(&str, u64); 17] = [
    ("stack", 2_000),
    ("evaluate_most", 156),
    ("evaluate_mean", 153),
    ("span_most", 1_440),
    ("span_mean", 770),
    ("tick_most", 1_640),
    ("tick_mean", 370),
    ("tick_end_most", 5_400),
    ("tick_end_mean", 3_450),
    ("tick_override_most", 2_310),
    ("tick_override_mean", 658),
    ("tick_fallback_most", 900),
    ("tick_fallback_mean", 305),
    ("prove_per_span_most", 1_285),
    ("prove_per_span_mean", 1_090),
    ("plan_most", 13_570),
    ("plan_mean", 6_440),
];

/// Builds the images, holds them to their gates, and proves that they compute the same bits as the host; then the host leads
/// three of them through a job.
pub(crate) fn run(root: &Path) -> Step {
    if !has_target() {
        skip("firmware", &format!("no {TARGET}: rustup target add {TARGET}"));
        return Ok(());
    }
    let folder = root.join("firmware/emulated");
    let chip = root.join("firmware/stm32g4");
    for features in [&[][..], &["--features", "fd"]] {
        let args = [&BUILD, features].concat();
        cargo(&chip, &args)?;
        image::check_instructions(&chip.join("target").join(TARGET).join("release/drive"))?;
    }
    let tables = root.join("target/proof.tables");
    let host = host(root, &tables)?;
    let tables = tables.display().to_string();
    eprintln!("$ cargo build --release (firmware/emulated)");
    let built = cargo_command(&folder, &BUILD)
        .env("FEEDSPLINE_TABLES", &tables)
        .status()
        .map_err(|e| format!("cargo does not start: {e}"))?;
    if !built.success() {
        return Err(format!("the images cannot be built: {built}"));
    }
    let image = |name: &str| folder.join("target").join(TARGET).join("release").join(name);
    image::check(&image("drive"))?;
    image::check_instructions(&image("proof"))?;
    if !has_qemu() {
        skip("emulated drive", &format!("no {QEMU}: apt-get install qemu-system-arm"));
        return Ok(());
    }
    compare(&host, &emulated(&image("proof"))?)?;
    image::check_instructions(&image("stepped"))?;
    let stepped = image("stepped").display().to_string();
    let session =
        ["run", "--release", "--locked", "--package", "tests", "--example", "emulated_session", "--"];
    cargo(root, &[&session[..], &[&stepped]].concat())
}

/// Whether the target is there, or could be fetched.
fn has_target() -> bool {
    // Without rustup the target may have come another way; building will tell.
    let Ok(listed) = Command::new("rustup").args(["target", "list", "--installed"]).output() else {
        return true;
    };
    String::from_utf8_lossy(&listed.stdout).lines().any(|line| line == TARGET)
        || Command::new("rustup").args(["target", "add", TARGET]).status().is_ok_and(|s| s.success())
}

/// Whether the emulator is there, or could be fetched.
fn has_qemu() -> bool {
    let there = || Command::new(QEMU).arg("--version").output().is_ok_and(|o| o.status.success());
    let apt = |words: &[&str]| Command::new("apt-get").args(words).status().is_ok_and(|s| s.success());
    there()
        || (apt(&["update", "-qq"])
            && apt(&["install", "-y", "-qq", "--no-install-recommends", QEMU])
            && there())
}

/// Writes the tables, and returns what they come to on the host.
fn host(root: &Path, tables: &Path) -> Result<BTreeMap<String, u64>, String> {
    cargo(root, &["build", "--release", "--locked", "--package", "tests", "--example", "proof"])?;
    let output = Command::new(root.join("target/release/examples/proof"))
        .arg(tables)
        .output()
        .map_err(|e| format!("the host's side of the proof does not start: {e}"))?;
    if !output.status.success() {
        return Err(format!("the host's side of the proof: {}", output.status));
    }
    Ok(figures(&output.stdout))
}

/// What the image reports.
fn emulated(image: &PathBuf) -> Result<BTreeMap<String, u64>, String> {
    eprintln!("$ {QEMU} -kernel {}", image.display());
    let output = Command::new("timeout")
        .args([PATIENCE_S, QEMU])
        .args(BOARD)
        .args(["-serial", "null", "-kernel"])
        .arg(image)
        .output()
        .map_err(|e| format!("{QEMU} does not start: {e}"))?;
    // Semihosting's console is standard error or output, by version.
    let text = [output.stdout, output.stderr].concat();
    if !output.status.success() {
        return Err(format!("the proof image: {}: {}", output.status, String::from_utf8_lossy(&text)));
    }
    Ok(figures(&text))
}

/// Lines of a name and a number.
fn figures(text: &[u8]) -> BTreeMap<String, u64> {
    let line = |line: &str| {
        let (name, number) = line.split_once(' ')?;
        Some((name.to_owned(), number.trim().parse().ok()?))
    };
    String::from_utf8_lossy(text).lines().filter_map(line).collect()
}

fn compare(host: &BTreeMap<String, u64>, image: &BTreeMap<String, u64>) -> Step {
    for (name, number) in image {
        eprintln!("  {name:<22} {number}");
    }
    let of = |figures: &BTreeMap<String, u64>, name: &str| {
        figures.get(name).copied().ok_or_else(|| format!("{name} is missing from the proof"))
    };
    for name in SAME {
        let (here, there) = (of(host, name)?, of(image, name)?);
        if here != there {
            return Err(format!("{name}: {here} on the host, {there} on the emulated Cortex-M4F"));
        }
    }
    for (name, most) in MOST {
        let found = of(image, name)?;
        if found > most {
            return Err(format!("{name}: {found} instructions, at most {most} are allowed"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod checks {
    use super::*;

    fn all(change: impl Fn(&str) -> u64) -> BTreeMap<String, u64> {
        SAME.into_iter().chain(MOST.map(|m| m.0)).map(|name| (name.to_owned(), change(name))).collect()
    }

    #[test]
    fn another_bit_and_another_cost_are_found() {
        let host = all(|_| 7);
        assert_eq!(compare(&host, &all(|_| 7)), Ok(()));
        let bits = compare(&host, &all(|name| if name == "plan_hash" { 8 } else { 7 }));
        assert!(bits.unwrap_err().contains("plan_hash: 7 on the host, 8"));
        let cost = compare(&host, &all(|name| if name == "tick_most" { 100_000 } else { 7 }));
        assert!(cost.unwrap_err().contains("tick_most: 100000"));
        assert!(compare(&host, &BTreeMap::new()).is_err());
    }

    #[test]
    fn figures_are_names_and_numbers() {
        let read = figures(b"setpoints 12\nnoise\nplan_hash 18446744073709551615\n");
        assert_eq!(read.len(), 2);
        assert_eq!(read["plan_hash"], u64::MAX);
    }
}
