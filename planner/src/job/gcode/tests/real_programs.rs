//! Programs from outside, checked against reference figures; skipped unless `FEEDSPLINE_REAL` names their folder.
//!
//! The folder holds `reference.csv` with lines `file,lines,arcs,feed length [mm],rapid length [mm]` (an empty
//! field is not checked) and `refused.csv` with lines `file,line`; `.gz` files are unpacked by gzip.

use std::fs::File;
use std::io::{BufRead, BufReader, Cursor};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use super::mill;
use crate::job::gcode::{Options, Program};
use crate::job::program::Item;

fn folder() -> Option<PathBuf> {
    let folder = std::env::var_os("FEEDSPLINE_REAL").map(PathBuf::from);
    if folder.is_none() {
        eprintln!("SKIPPED: FEEDSPLINE_REAL is not set, no program from outside is read");
    }
    folder
}

fn rows(path: &Path) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let fields = |line: &str| line.split(',').map(|f| f.trim().to_owned()).collect();
    text.lines().filter(|l| !l.trim().is_empty()).map(fields).collect()
}

fn open(path: &Path) -> Box<dyn BufRead> {
    if path.extension().is_some_and(|e| e == "gz") {
        let unpacked = Command::new("gzip").arg("-dc").arg(path).output().unwrap();
        assert!(unpacked.status.success(), "gzip cannot unpack {}", path.display());
        Box::new(Cursor::new(unpacked.stdout))
    } else {
        Box::new(BufReader::with_capacity(1 << 16, File::open(path).unwrap()))
    }
}

#[test]
fn figures_agree_with_the_reference() {
    let Some(folder) = folder() else { return };
    for row in rows(&folder.join("reference.csv")) {
        let path = folder.join(&row[0]);
        let reader = open(&path);
        let clock = Instant::now();
        let mut program = Program::new(reader, &row[0], &mill(), Options::default());
        let mut last_end = [0.0; 9];
        for item in &mut program {
            if let Item::Move(step) = item.unwrap_or_else(|e| panic!("{e}")) {
                assert_eq!(step.start, last_end, "{}:{}", row[0], step.line);
                last_end = step.end;
            }
        }
        let elapsed = clock.elapsed();
        let c = program.counters();
        eprintln!("{}: {c:?} {:.0} ns/block", row[0], elapsed.as_nanos() as f64 / c.blocks.max(1) as f64);
        let found = [c.lines as f64, c.arcs as f64, c.feed_length_mm, c.rapid_length_mm];
        for ((field, found), relative) in row[1..].iter().zip(found).zip([0.0, 0.0, 1e-4, 1e-4]) {
            if field.is_empty() {
                continue;
            }
            let expected: f64 = field.parse().unwrap();
            assert!((found - expected).abs() <= relative * expected, "{}: {found} {expected}", row[0]);
        }
    }
}

#[test]
fn refusals_name_their_line() {
    let Some(folder) = folder() else { return };
    for row in rows(&folder.join("refused.csv")) {
        let path = folder.join(&row[0]);
        let program = Program::new(open(&path), &row[0], &mill(), Options::default());
        let error = program.filter_map(Result::err).next();
        let error = error.unwrap_or_else(|| panic!("{} is not refused", row[0]));
        eprintln!("{error}");
        assert_eq!(error.line(), row[1].parse().ok(), "{error}");
    }
}
