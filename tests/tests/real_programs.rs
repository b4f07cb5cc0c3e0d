//! Programs from outside, through the whole product: `FEEDSPLINE_REAL` names their folder.
//!
//! Every file below the folder is judged that reads as a program; what is refused, and why, is printed. `.gz` files
//! are unpacked by gzip. Best run with `--release -- --nocapture`.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "helpers of tests fail as tests do"
)]

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use planner::geometry::sections::SectionError;
use planner::job::gcode::Options;
use planner::job::machine::{LimitSet, Machine};
use planner::pipeline::JobError;
use tests::chain;
use tests::judge::judge;

/// Samples per span.
const SAMPLES: usize = 100;

/// The sample mill, large enough for any part.
fn machine() -> Machine {
    let text = include_str!("../../jobs/mill3.toml");
    let mut machine = Machine::from_toml(text, "mill").unwrap_or_else(|e| panic!("{e}"));
    for axis in &mut machine.axes {
        axis.travel = [-1e4, 1e4];
    }
    machine
}

fn programs(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.to_string_lossy().to_lowercase();
        let plain = name.strip_suffix(".gz").unwrap_or(&name);
        if path.is_dir() {
            found.extend(programs(&path));
        } else if [".ngc", ".nc", ".gcode", ".tap"].iter().any(|e| plain.ends_with(e)) {
            found.push(path);
        }
    }
    found.sort();
    found
}

fn text(path: &Path) -> Vec<u8> {
    if path.extension().is_none_or(|e| e != "gz") {
        return std::fs::read(path).unwrap();
    }
    let unpacked = Command::new("gzip").arg("-dc").arg(path).output().unwrap();
    assert!(unpacked.status.success(), "gzip cannot unpack {}", path.display());
    unpacked.stdout
}

#[test]
#[ignore = "needs a folder of part programs, named by FEEDSPLINE_REAL"]
fn programs_from_outside_hold() {
    let folder =
        std::env::var_os("FEEDSPLINE_REAL").expect("FEEDSPLINE_REAL names a folder of part programs");
    let machine = machine();
    let (mut sound, mut refused, mut unsound) = (0, 0, Vec::new());
    for path in programs(Path::new(&folder)) {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let begin = Instant::now();
        let planned =
            chain::plan(&text(&path), &machine, &Options::default(), LimitSet::VelocityAccelerationJerk);
        let seconds = begin.elapsed().as_secs_f64();
        match planned {
            Ok(chain) => match judge(&chain, &machine, SAMPLES, f64::INFINITY) {
                Ok(figures) => {
                    sound += 1;
                    eprintln!(
                        "{name}: {} lines, {} arcs, planned in {seconds:.2} s; {:.2} s of motion, {:.2} at feed, {:.2} with \
                         stops; {:?} B/span shared, {:?} controls\n  {figures:?}",
                        chain.counters.lines,
                        chain.counters.arcs,
                        chain.motion_time_s(),
                        chain.constant_feed_time_s,
                        chain.stop_at_every_block_time_s,
                        figures.bytes.shared_per_span(),
                        figures.bytes.controls_per_span(),
                    );
                }
                Err(finding) => unsound.push(format!("{name}: {finding}")),
            },
            Err(JobError::Section(SectionError::Program(e))) => {
                refused += 1;
                eprintln!("{name}: refused at line {:?}: {e}", e.line());
            }
            Err(e) => unsound.push(format!("{name}: {e}")),
        }
    }
    eprintln!("{sound} programs hold, {refused} are refused");
    assert!(unsound.is_empty(), "{unsound:#?}");
    assert!(sound + refused > 0, "no program in {}", folder.display());
}
