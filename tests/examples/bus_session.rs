//! Judges what a session on a real bus has left: `cargo xtask vcan` runs one, and this program over its folder.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a program that stops on an error"
)]

use std::path::{Path, PathBuf};
use std::{env, fs};

use host_sim::bus::BitTiming;
use serde_json::Value;
use tests::fleet::Job;

const PROGRAM: &str = include_str!("../../xtask/src/vcan/part.ngc");

/// Exit status of a verb that was stopped from outside, or has met an error that is the user's to mend.
const REFUSED: i64 = 2;
/// Exit status of drives whose bus has gone.
const LOST: i64 = 1;

struct Results {
    folder: PathBuf,
    tag: &'static str,
}

impl Results {
    fn path(&self, name: &str, kind: &str) -> PathBuf {
        self.folder.join(format!("{}-{name}.{kind}", self.tag))
    }

    fn text(&self, name: &str, kind: &str) -> String {
        let path = self.path(name, kind);
        fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
    }

    /// What a verb has told, after it has ended as it should.
    fn told(&self, name: &str, status: i64) -> Value {
        let found: i64 = self.text(name, "status").trim().parse().expect("an exit status");
        let (told, error) = (self.text(name, "json"), self.text(name, "err"));
        assert_eq!(found, status, "{}-{name}: {told} {error}", self.tag);
        serde_json::from_str(&told).unwrap_or_else(|e| panic!("{}-{name}: {e}: {told}", self.tag))
    }

    /// Positions of drives that are all in a state, without a fault [counts].
    fn places(&self, name: &str, states: &[&str], open: bool) -> Vec<i64> {
        let told = self.told(name, 0);
        let drives = told["drives"].as_array().expect("drives");
        assert_eq!(drives.len(), 3, "{}-{name}: {told}", self.tag);
        for drive in drives {
            let state = drive["state"].as_str().expect("a state");
            assert!(states.contains(&state), "{}-{name}: {drive}", self.tag);
            assert!(drive["fault"].is_null() && drive["open"] == open, "{}-{name}: {drive}", self.tag);
        }
        drives.iter().map(|drive| drive["position_counts"].as_i64().expect("a position")).collect()
    }
}

fn main() {
    let folder = env::args().nth(1).expect("the folder of a session");
    let job = Job::of(PROGRAM, BitTiming::default());
    for tag in ["classic", "fd"] {
        judge(&Results { folder: Path::new(&folder).to_path_buf(), tag }, &job);
    }
}

fn judge(results: &Results, job: &Job) {
    const REST: [&str; 2] = ["Idle", "Holding"];
    let end: Vec<i64> = {
        let axes = &job.cast.orders.last().expect("a table").packed.axes;
        axes.iter().map(|axis| axis.header.end).collect()
    };
    let path = job.path();
    assert_eq!(results.places("who", &["Idle"], false), [0; 3]);

    let whole = results.told("whole", 0);
    assert_eq!((&whole["stopped"], &whole["aborted_starts"]), (&false.into(), &0.into()), "{whole}");
    assert_eq!(results.places("end", &REST, false), end);

    results.told("hold", 0);
    results.told("slower", 0);
    results.told("faster", 0);
    let held = results.places("at-hold", &["Held"], true);
    results.told("held", 0);
    assert_eq!(results.places("after-hold", &REST, false), end);

    let mut off = vec![("held", path.distance(&held))];
    for (name, status) in [("killed", None), ("stopped", Some(REFUSED))] {
        let stood = results.places(&format!("after-{}", &name[..4]), &["Held"], false);
        off.push((name, path.distance(&stood)));
        if let Some(status) = status {
            results.told(name, status);
        }
    }
    for (name, off) in &off {
        assert!(*off <= 1.0, "{}-{name}: {off} counts off the path", results.tag);
    }
    results.told("quick", REFUSED);
    let told = results.told("after-quick", 0);
    for drive in told["drives"].as_array().expect("drives") {
        assert_eq!((&drive["power"], &drive["fault"]), (&"QuickStopActive".into(), &Value::Null), "{told}");
    }
    for number in 1..=5 {
        results.told(&format!("home-{number}"), 0);
    }
    results.told("unplugged", REFUSED);
    results.told("drives", LOST);

    let log = results.told("log", 0);
    let count = |kind: &str| log["counts"][kind].as_u64().unwrap_or(0);
    for kind in ["beat", "sync", "time", "data", "command", "answer", "stop", "nmt", "boot"] {
        assert!(count(kind) > 0, "{}: no {kind} in the log: {}", results.tag, log["counts"]);
    }
    assert_eq!(&log["malformed_lines"], &0, "{}", log["malformed"]);
    // Messages of several frames of two hosts at once, or of one that was killed in the middle of one.
    let frames = log["frames"].as_u64().unwrap_or(0);
    assert!(count("broken") * 2_000 <= frames, "{}", log["counts"]);
    println!(
        "{}: {} pieces, at least {} ms in hand, off the path {:?} counts, {} frames in the log",
        results.tag, whole["pieces"], whole["lowest_fill_ms"], off, log["frames"]
    );
}
