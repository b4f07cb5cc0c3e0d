//! `feedspline verify` on files whose checksums are right: what they say has to be proven all the same.
#![allow(clippy::unwrap_used, clippy::panic, reason = "helpers of tests fail as tests do")]

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use planner::feed::file::{self, FeedFile};
use planner::feed::job::{JobItem, PlannedSection};
use serde_json::Value;
use tempfile::TempDir;

const PROGRAM: &str =
    "G21 G90 G94 G64 P0.02\nG0 X5 Y5\nG1 X40 F6000\nG3 X40 Y25 J10\nG1 X5\nG4 P0.1\nG1 Y5\nM30\n";

fn feedspline(folder: &Path, words: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_feedspline")).args(words).current_dir(folder).output().unwrap()
}

/// A folder with the table of a small job.
fn planned() -> TempDir {
    let home = tempfile::tempdir().unwrap();
    fs::write(home.path().join("part.ngc"), PROGRAM).unwrap();
    let said = feedspline(home.path(), &["plan", "part.ngc", "-q", "-o", "."]);
    assert_eq!(said.status.code(), Some(0), "{}", String::from_utf8_lossy(&said.stderr));
    home
}

/// Writes the table again after `change`, sealed as any other, and has it verified.
fn verified_after(change: impl FnOnce(&mut FeedFile)) -> (Option<i32>, Value, String) {
    let home = planned();
    let mut read = file::read(&home.path().join("part.feed")).unwrap();
    change(&mut read);
    file::write(&home.path().join("changed.feed"), &read.header, &read.items).unwrap();
    let told = feedspline(home.path(), &["verify", "changed.feed", "--json"]);
    let text = feedspline(home.path(), &["verify", "changed.feed"]);
    assert_eq!(told.status.code(), text.status.code());
    let text = String::from_utf8(text.stdout).unwrap() + &String::from_utf8(text.stderr).unwrap();
    assert!(!text.contains("panicked"), "{text}");
    (told.status.code(), serde_json::from_slice(&told.stdout).unwrap(), text)
}

/// The longest section.
fn longest(read: &mut FeedFile) -> &mut PlannedSection {
    let sections = read.items.iter_mut().filter_map(|item| match item {
        JobItem::Section(section) => Some(section),
        JobItem::Dwell { .. } | JobItem::Note { .. } => None,
    });
    sections.max_by_key(|s| s.table.codes.len()).unwrap()
}

fn holds(told: &Value) -> bool {
    told["certificate"]["holds"].as_bool().unwrap()
}

fn faults(told: &Value) -> String {
    told["faults"].as_array().unwrap().iter().map(|f| format!("{f}\n")).collect()
}

#[test]
fn a_fresh_file_holds() {
    let (status, told, _) = verified_after(|_| ());
    assert_eq!((status, holds(&told), faults(&told)), (Some(0), true, String::new()));
}

#[test]
fn a_raised_code_breaks_a_limit() {
    let (status, told, text) = verified_after(|read| {
        let codes = &mut longest(read).table.codes;
        let middle = codes.len() / 2;
        codes[middle] = codes[middle] * 11 / 10;
    });
    assert_eq!((status, holds(&told)), (Some(1), false), "{told}");
    let c = &told["certificate"];
    let ratios =
        ["velocity_ratio", "acceleration_ratio", "jerk_ratio", "feed_ratio"].map(|r| c[r].as_f64().unwrap());
    assert!(ratios.iter().any(|r| *r > 1.0 + 1e-6), "{c}");
    assert!(faults(&told).contains("of its limit"), "{told}");
    assert!(text.contains("of its limit"), "{text}");
}

#[test]
fn limits_beyond_the_machine_are_not_granted() {
    let (status, told, _) = verified_after(|read| longest(read).limits[1].acceleration *= 2.0);
    assert_eq!((status, holds(&told)), (Some(1), false));
    assert!(faults(&told).contains("more than the machine grants"), "{told}");
}

#[test]
fn tables_have_to_follow_each_other() {
    let (status, told, _) = verified_after(|read| {
        let sections = read.items.iter().filter(|i| matches!(i, JobItem::Section(_))).count();
        assert!(sections > 2);
        let second = read.items.iter().position(|i| matches!(i, JobItem::Section(_))).unwrap() + 1;
        read.items.remove(second);
    });
    assert_eq!((status, holds(&told)), (Some(1), false));
    assert!(faults(&told).contains("counts away"), "{told}");
}

#[test]
fn a_machine_with_less_travel_is_left() {
    let (status, told, _) = verified_after(|read| read.header.axes[0].travel = [-30.0, 30.0]);
    assert_eq!((status, holds(&told)), (Some(1), false));
    assert!(faults(&told).contains("leaves its travel"), "{told}");
}
