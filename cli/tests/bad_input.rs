//! The installed command on bad input, and on good input as far as a caller of `--json` can see.
//!
//! Whatever is wrong, the command ends soon with status 2 and one diagnostic, and leaves no file behind.
#![allow(clippy::unwrap_used, clippy::panic, reason = "helpers of tests fail as tests do")]

use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::TempDir;

/// No run on bad input takes longer.
const TIME_LIMIT: Duration = Duration::from_secs(10);

const MILL: &str = include_str!("../../jobs/mill3.toml");

struct Said {
    status: Option<i32>,
    out: String,
    err: String,
}

fn job(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../jobs").join(name)
}

/// Runs the command in `folder`; it is ended and the test fails when it takes too long.
fn feedspline(folder: &Path, words: &[&str]) -> Said {
    let mut child = Command::new(env!("CARGO_BIN_EXE_feedspline"))
        .args(words)
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let (mut out, mut err) = (child.stdout.take().unwrap(), child.stderr.take().unwrap());
    let out = thread::spawn(move || {
        let mut bytes = Vec::new();
        out.read_to_end(&mut bytes).map(|_| bytes)
    });
    let err = thread::spawn(move || {
        let mut bytes = Vec::new();
        err.read_to_end(&mut bytes).map(|_| bytes)
    });
    let begin = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if begin.elapsed() > TIME_LIMIT {
            child.kill().unwrap();
            panic!("{words:?} takes longer than {TIME_LIMIT:?}");
        }
        thread::sleep(Duration::from_millis(2));
    };
    let text = |bytes: thread::JoinHandle<std::io::Result<Vec<u8>>>| {
        String::from_utf8(bytes.join().unwrap().unwrap()).unwrap()
    };
    Said { status: status.code(), out: text(out), err: text(err) }
}

/// Every file and folder below `folder`, by its path from there.
fn below(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut open = vec![folder.to_path_buf()];
    while let Some(next) = open.pop() {
        for entry in fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            found.push(path.strip_prefix(folder).unwrap().to_path_buf());
            if path.is_dir() {
                open.push(path);
            }
        }
    }
    found.sort();
    found
}

/// What a diagnostic names.
#[derive(Clone, Copy)]
struct Blamed<'a> {
    file: &'a str,
    /// Line and column, where the fault has a place.
    place: Option<(u64, u64)>,
    /// A part of the message.
    message: &'a str,
}

/// Runs the command with text and with JSON errors; both have to refuse, and `folder` has to stay as it is.
fn refused(folder: &Path, words: &[&str], blamed: Blamed<'_>) {
    let Blamed { file, place, message } = blamed;
    let before = below(folder);
    let said = feedspline(folder, words);
    let Said { status, out, err } = &said;
    assert_eq!((*status, out.as_str()), (Some(2), ""), "{words:?}: {err}");
    let start = match place {
        Some((line, column)) => format!("{file}:{line}:{column}: "),
        None => format!("{file}: "),
    };
    assert!(err.contains(&start), "{words:?}: no {start:?} in {err}");
    assert!(err.contains("help: "), "{words:?}: {err}");
    assert!(!err.contains("panicked"), "{words:?}: {err}");
    assert_eq!(below(folder), before, "{words:?}");

    let words = [words, &["--json"]].concat();
    let said = feedspline(folder, &words);
    assert_eq!(said.status, Some(2), "{words:?}: {}", said.err);
    assert!(!said.err.contains("panicked"), "{words:?}: {}", said.err);
    let told: Value = serde_json::from_str(&said.out).unwrap();
    let error = &told["error"];
    let text = |field: &str| error[field].as_str().unwrap_or_default().to_owned();
    assert!(text("message").contains(message), "{words:?}: {message:?} is not in {error}");
    assert_eq!((text("kind").as_str(), text("file").as_str()), ("input", file), "{error}");
    assert!(!text("help").is_empty(), "{error}");
    let found = error["line"].as_u64().zip(error["column"].as_u64());
    assert_eq!(found, place, "{words:?}: {error}");
    assert_eq!(below(folder), before, "{words:?}");
}

/// `plan` and `run` refuse `job` as it stands in `folder`.
fn job_refused(folder: &Path, job: &str, place: Option<(u64, u64)>, message: &str) {
    for verb in ["plan", "run"] {
        refused(folder, &[verb, job, "-o", "out/deep"], Blamed { file: job, place, message });
    }
}

/// A program with this text is refused.
fn program_refused(text: impl AsRef<[u8]>, place: (u64, u64), message: &str) {
    let home = tempfile::tempdir().unwrap();
    fs::write(home.path().join("part.ngc"), text).unwrap();
    job_refused(home.path(), "part.ngc", Some(place), message);
}

/// A sound little program is refused on a machine file with this text.
fn machine_refused(text: &str, place: (u64, u64), message: &str) {
    let home = tempfile::tempdir().unwrap();
    fs::write(home.path().join("part.ngc"), "G21 G0 X5\n").unwrap();
    fs::write(home.path().join("m.toml"), text).unwrap();
    let blamed = Blamed { file: "m.toml", place: Some(place), message };
    refused(home.path(), &["run", "part.ngc", "--machine", "m.toml", "-o", "out"], blamed);
}

/// Bytes that look like nothing (Marsaglia 2003, xorshift64).
fn noise(mut seed: u64, count: usize) -> Vec<u8> {
    let mut next = || {
        seed ^= seed << 13;
        seed ^= seed >> 7;
        seed ^= seed << 17;
        (seed >> 32) as u8
    };
    (0..count).map(|_| next()).collect()
}

#[test]
fn files_that_are_no_program() {
    program_refused("", (1, 1), "no motion");
    program_refused("%\n(nothing)\n%\n", (3, 1), "no motion");
    program_refused(vec![0; 6 << 20], (1, 1), "binary data");
    let home = tempfile::tempdir().unwrap();
    fs::create_dir(home.path().join("folder")).unwrap();
    job_refused(home.path(), "folder", None, "directory");
    job_refused(home.path(), "missing.ngc", None, "cannot be read");
}

#[test]
fn binary_garbage() {
    for seed in 1..=8 {
        let home = tempfile::tempdir().unwrap();
        fs::write(home.path().join("part.ngc"), noise(seed, 100_000)).unwrap();
        let said = feedspline(home.path(), &["plan", "part.ngc", "--json", "-o", "out"]);
        let told: Value = serde_json::from_str(&said.out).unwrap();
        let [line, column] = ["line", "column"].map(|f| told["error"][f].as_u64().unwrap());
        // Where it is noticed depends on the bytes; that it is noticed at once does not.
        assert!(line <= 10, "{told}");
        job_refused(home.path(), "part.ngc", Some((line, column)), "");
    }
}

#[test]
fn lines_that_ask_for_what_cannot_be() {
    let after = |text: &str| format!("G21 G90 G94\n{text}");
    program_refused(after("G1 X5 F100\nG1 X"), (3, 4), "X has no number");
    program_refused(after("F100\nG2 X10 Y0 I3 J0\n"), (3, 1), "arc");
    program_refused(after("F100\nG2 X10 R2\n"), (3, 1), "radius");
    program_refused(after("G1 X5 F0\n"), (2, 1), "feed rate is zero");
    program_refused(after("G1 X5\n"), (2, 1), "no feed rate");
    program_refused(after("G0 X1\nG1 X5000 F100\n"), (3, 4), "outside its travel");
    program_refused(after("G1 X1 A5 F100\n"), (2, 7), "no axis A");
}

#[test]
fn words_that_are_not_supported() {
    program_refused("G21\nG0 X5\no100 sub\n", (3, 1), "O-words");
    program_refused("G21\n#1=3\n", (2, 1), "parameters");
    program_refused("G21\nG0 X[1+2]\n", (2, 5), "expressions");
    program_refused("G21\nG0 X5\nG17 G41 D1\n", (3, 5), "G41");
    program_refused("G21\nG0 X5\n M98 P100\n", (3, 2), "M98");
}

/// A fault on the last line of a long program comes after thousands of planned moves, which leave nothing.
#[test]
fn a_fault_after_much_that_was_planned() {
    let mut text = String::from("G21 G90 G94 G64 P0.01 F3000\n");
    for k in 0..2000 {
        text += &format!("G1 X{} Y{}\n", k % 90, k % 70);
    }
    text += "G41 D1\n";
    program_refused(text, (2002, 1), "G41");
}

#[test]
fn machine_files() {
    let line_of = |text: &str| MILL.lines().position(|l| l == text).map(|k| k as u64 + 1).unwrap();
    for limit in ["velocity = 250", "acceleration = 2500", "jerk = 50_000"] {
        let (key, _) = limit.split_once(' ').unwrap();
        let place = (line_of(limit), key.len() as u64 + 4);
        machine_refused(&MILL.replacen(limit, &format!("{key} = 0"), 1), place, key);
    }
    machine_refused(&format!("speed = 3\n{MILL}"), (1, 1), "unknown field `speed`");
    let in_axis = MILL.replacen("velocity = 250", "velocity = 250\nspeed = 3", 1);
    machine_refused(&in_axis, (line_of("velocity = 250") + 1, 1), "unknown field `speed`");
    machine_refused("name = [\n", (1, 9), "unclosed array");
    machine_refused("", (1, 1), "no [[axis]]");

    let home = tempfile::tempdir().unwrap();
    fs::write(home.path().join("part.ngc"), "G21 G0 X5\n").unwrap();
    fs::create_dir(home.path().join("folder")).unwrap();
    for (file, message) in [("missing.toml", "cannot be read"), ("folder", "directory")] {
        let words = ["plan", "part.ngc", "--machine", file, "-o", "out"];
        refused(home.path(), &words, Blamed { file, place: None, message });
    }
}

#[test]
fn folders_that_cannot_hold_results() {
    let home = tempfile::tempdir().unwrap();
    fs::write(home.path().join("part.ngc"), "G21 G0 X5\n").unwrap();
    fs::write(home.path().join("file"), "mine").unwrap();
    for verb in ["plan", "run"] {
        for out in ["file", "file/below", "file/far/below"] {
            let blamed = Blamed { file: out, place: None, message: "cannot write" };
            refused(home.path(), &[verb, "part.ngc", "-o", out], blamed);
        }
    }
    assert_eq!(fs::read(home.path().join("file")).unwrap(), b"mine");
}

/// A file of way-points with this text is refused by every verb that reads jobs.
fn points_refused(text: impl AsRef<[u8]>, words: &[&str], place: Option<(u64, u64)>, message: &str) {
    let home = tempfile::tempdir().unwrap();
    fs::write(home.path().join("points.csv"), text).unwrap();
    for verb in ["plan", "run", "compare"] {
        let words = [&[verb, "points.csv", "-o", "out/deep"], words].concat();
        refused(home.path(), &words, Blamed { file: "points.csv", place, message });
    }
}

#[test]
fn files_of_way_points_that_are_none() {
    let row = |k: u32| format!("{k},0\n");
    points_refused("", &[], None, "holds nothing");
    points_refused("# only this\n\n", &[], None, "holds nothing");
    points_refused(vec![0; 6 << 20], &[], Some((1, 1)), "longer than");
    points_refused(noise(5, 50_000), &[], Some((1, 1)), "");
    points_refused("1,2\n3,4\n", &[], Some((1, 1)), "header is missing");
    points_refused("X;Y\n1;2\n", &[], Some((1, 1)), "not an axis");
    points_refused("X,W\n1,2\n", &[], Some((1, 3)), "not an axis");
    points_refused("X,X\n1,2\n", &[], Some((1, 3)), "two columns");
    points_refused("X [deg],Y\n1,2\n", &[], Some((1, 1)), "linear");
    points_refused("X,Y\n1,2\n3\n", &[], Some((3, 1)), "1 fields, the header has 2");
    points_refused("X,Y\n1,2\n3,4,5\n", &[], Some((3, 3)), "3 fields");
    points_refused("X,Y\n1,2\n3,four\n", &[], Some((3, 3)), "not a number");
    // Columns count bytes.
    points_refused("X,Y\n\"1\",\u{a0}2\n\u{e9},4\n", &[], Some((2, 5)), "not a number");
    points_refused("X,Y\n1,nan\n3,4\n", &[], Some((2, 3)), "not a finite number");
    points_refused("X,Y\n1,2\n3,1e400\n", &[], Some((3, 3)), "not a finite number");
    points_refused("X,Y\n1,2\n3,301\n", &[], Some((3, 3)), "outside its travel");
    points_refused("X,Y\n1,2\n", &[], None, "at least 2");
    points_refused("X,Y\n1,2\n3,4\n3,4\n5,6\n", &[], Some((4, 1)), "repeats");
    points_refused("X,Y\n0,0\n0.000001,0\n0.000002,0\n", &[], None, "whole drive count");
    let open: String = (0..5).map(row).collect();
    points_refused(format!("X,Y\n{open}"), &["--spline", "periodic"], Some((6, 1)), "not closed");
    points_refused("X,Y\n1,2\n3,4\n", &["--spline", "periodic"], None, "at least");
    let slow = "X,Y\n0,0\n100,0\n200,5\n300,0\n";
    points_refused(slow, &["--feed", "0.0001"], Some((3, 1)), "too many for one section");
    let wild = "X,Y\n0,0\n399,1\n399.001,2\n0,3\n-399,299\n1,0\n";
    points_refused(wild, &["--knots", "uniform"], Some((3, 1)), "outside its travel");
}

#[test]
fn options_that_do_not_fit_the_job() {
    let home = tempfile::tempdir().unwrap();
    fs::write(home.path().join("points.csv"), "X,Y\n0,0\n1,2\n3,4\n5,5\n").unwrap();
    fs::write(home.path().join("part.ngc"), "G21 G1 X5 F100\n").unwrap();
    for verb in ["plan", "run", "compare"] {
        for (file, words) in [
            ("points.csv", &["--ignore-feed"][..]),
            ("points.csv", &["--dialect", "printer"]),
            ("points.csv", &["--ignore-feed"]),
            ("part.ngc", &["--spline", "natural"]),
            ("part.ngc", &["--knots", "uniform"]),
            ("part.ngc", &["--feed", "100"]),
        ] {
            let words = [&[verb, file, "-o", "out"], words].concat();
            refused(home.path(), &words, Blamed { file, place: None, message: words[4] });
        }
    }
    // A corner that the path turns back from cannot be travelled at one speed.
    fs::write(home.path().join("back.csv"), "X\n0\n5\n10\n5\n0\n").unwrap();
    let words = ["compare", "back.csv", "--methods", "constant-feed", "-o", "out"];
    refused(home.path(), &words, Blamed { file: "back.csv", place: None, message: "turns back on itself" });
    // Rapids alone are nothing to compare.
    fs::write(home.path().join("rapid.ngc"), "G21 G0 X5\n").unwrap();
    let words = ["compare", "rapid.ngc", "-o", "out"];
    refused(home.path(), &words, Blamed { file: "rapid.ngc", place: None, message: "no feed move" });
}

/// A folder with the table of a small job, and its bytes.
fn table() -> (TempDir, Vec<u8>) {
    let home = tempfile::tempdir().unwrap();
    let text = "G21 G90 G94 G64 P0.02\nG0 X5 Y5\nG1 X20 F3000\nY20\nG4 P0.1\nG1 X5 Y5\nM30\n";
    fs::write(home.path().join("part.ngc"), text).unwrap();
    let said = feedspline(home.path(), &["plan", "part.ngc", "-q", "-o", "."]);
    assert_eq!(said.status, Some(0), "{}", said.err);
    let bytes = fs::read(home.path().join("part.feed")).unwrap();
    (home, bytes)
}

fn table_refused(folder: &Path, bytes: &[u8], story: &str) {
    fs::write(folder.join("bad.feed"), bytes).unwrap();
    for verb in ["verify", "inspect"] {
        let said = feedspline(folder, &[verb, "bad.feed"]);
        let Said { status, out, err } = &said;
        assert_eq!((*status, out.as_str()), (Some(2), ""), "{story}, {verb}: {err}");
        assert!(err.contains("bad.feed: ") && err.contains("help: "), "{story}, {verb}: {err}");
        assert!(!err.contains("panicked"), "{story}, {verb}: {err}");
    }
}

#[test]
fn files_that_are_no_sound_table() {
    let (home, bytes) = table();
    let home = home.path();
    fs::create_dir(home.join("folder")).unwrap();
    fs::write(home.join("empty.feed"), "").unwrap();
    fs::write(home.join("noise.feed"), noise(3, 50_000)).unwrap();
    fs::write(home.join("head.feed"), [&bytes[..8], &noise(4, 50_000)].concat()).unwrap();
    fs::write(home.join("short.feed"), &bytes[..bytes.len() / 2]).unwrap();
    fs::write(home.join("nul.feed"), vec![0; 4 << 20]).unwrap();
    for file in ["folder", "missing.feed", "empty.feed", "noise.feed", "head.feed", "short.feed", "nul.feed"]
    {
        for verb in ["verify", "inspect"] {
            refused(home, &[verb, file], Blamed { file, place: None, message: "" });
        }
    }
}

#[test]
fn truncated_and_damaged_tables() {
    let (home, bytes) = table();
    for step in 0..40 {
        let length = step * bytes.len() / 40;
        table_refused(home.path(), &bytes[..length], &format!("cut to {length} bytes"));
    }
    table_refused(home.path(), &bytes[..bytes.len() - 1], "cut by a byte");
    table_refused(home.path(), &[&bytes[..], b"\n"].concat(), "a byte too long");
    for step in 0..60 {
        let (at, bit) = (step * (bytes.len() - 1) / 59, step % 8);
        let mut bad = bytes.clone();
        bad[at] ^= 1 << bit;
        table_refused(home.path(), &bad, &format!("bit {bit} of byte {at} turned over"));
    }
}

fn run_cat(folder: &Path, words: &[&str]) -> Value {
    let cat = job("cat.ngc");
    let words = [&["run", cat.to_str().unwrap(), "--json", "-o", "out"], words].concat();
    let said = feedspline(folder, &words);
    assert_eq!((said.status, said.err.as_str()), (Some(0), ""));
    serde_json::from_str(&said.out).unwrap()
}

fn number(value: &Value, name: &str) -> f64 {
    value[name].as_f64().unwrap_or_else(|| panic!("{name} is no number in {value}"))
}

fn count(value: &Value, name: &str) -> u64 {
    value[name].as_u64().unwrap_or_else(|| panic!("{name} is no count in {value}"))
}

#[test]
fn run_tells_everything_in_json() {
    let home = tempfile::tempdir().unwrap();
    let told = run_cat(home.path(), &[]);
    for name in ["blocks", "rapids", "lines", "arcs", "stops", "spans", "table_bytes"] {
        assert!(count(&told, name) > 0, "{name}");
    }
    assert_eq!((count(&told, "splines"), count(&told, "dwells")), (0, 0));
    assert!(count(&told, "rapids") + count(&told, "lines") + count(&told, "arcs") <= 330);
    for name in ["feed_length_mm", "rapid_length_mm", "plan_seconds", "constant_feed_time_s"] {
        assert!(number(&told, name) > 0.0, "{name}");
    }
    assert!(number(&told, "max_deviation_mm") <= number(&told, "tolerance_mm"));
    assert!(number(&told, "constant_feed_time_s") <= number(&told, "motion_time_s"));
    assert!(number(&told, "motion_time_s") <= number(&told, "cycle_time_s"));
    assert!(told["peak_memory_mib"].is_null() || number(&told, "peak_memory_mib") > 1.0);
    let corner = |name: &str| -> Vec<f64> {
        let list = told["bounding_box_mm"][name].as_array().unwrap();
        list.iter().map(|x| x.as_f64().unwrap()).collect()
    };
    let (min, max) = (corner("min"), corner("max"));
    assert_eq!((min.len(), max.len()), (3, 3));
    assert!(min.iter().zip(&max).all(|(a, b)| a < b), "{min:?} {max:?}");
    let certificate = &told["certificate"];
    assert_eq!(certificate["holds"], true);
    for name in ["velocity_ratio", "acceleration_ratio", "jerk_ratio", "feed_ratio"] {
        let ratio = number(certificate, name);
        assert!(ratio > 0.5 && ratio <= 1.000_001, "{name}: {ratio}");
    }
    let simulation = &told["simulation"];
    // Three axes, one set-point per tick of a millisecond and axis; every section ends on a whole tick.
    let ticks = count(simulation, "setpoints") as f64 / 3.0;
    let motion = number(&told, "motion_time_s");
    assert!(ticks > 1000.0 * motion && ticks < 1100.0 * motion, "{ticks} ticks in {motion} s");
    let hash = simulation["setpoint_hash"].as_str().unwrap();
    assert!(hash.len() == 16 && u64::from_str_radix(hash, 16).is_ok(), "{hash}");
    let deviation = number(simulation, "max_path_deviation_counts");
    assert!(deviation > 0.0 && deviation <= 1.0, "{deviation}");
    let [rms, most] = ["rms_following_error_mm", "max_following_error_mm"].map(|n| number(simulation, n));
    assert!(rms > 0.0 && rms < most && most < 1.0, "{rms} {most}");
    assert_eq!(
        below(&home.path().join("out")),
        ["cat.feed", "plan.json", "report.html", "trace.csv"].map(PathBuf::from)
    );
}

#[test]
fn threads_change_neither_setpoints_nor_table() {
    let results = ["1", "2", "4"].map(|threads| {
        let home = tempfile::tempdir().unwrap();
        let told = run_cat(home.path(), &["--threads", threads]);
        let table = fs::read(home.path().join("out/cat.feed")).unwrap();
        (told["simulation"]["setpoint_hash"].clone(), table)
    });
    assert!(results[0].0.is_string() && !results[0].1.is_empty());
    assert!(results[0] == results[1] && results[0] == results[2]);
}

#[test]
fn plan_verify_and_inspect_agree() {
    let home = tempfile::tempdir().unwrap();
    let say = |words: &[&str]| -> Value {
        let said = feedspline(home.path(), words);
        assert_eq!((said.status, said.err.as_str()), (Some(0), ""), "{words:?}");
        serde_json::from_str(&said.out).unwrap()
    };
    let wave = job("wave.ngc");
    let plan = say(&["plan", wave.to_str().unwrap(), "--json", "-o", "."]);
    assert!(plan.get("simulation").is_none());
    let verify = say(&["verify", "wave.feed", "--json"]);
    assert_eq!((&verify["certificate"]["holds"], count(&verify, "fault_count")), (&true.into(), 0));
    assert_eq!(verify["certificate"], plan["certificate"]);
    let inspect = say(&["inspect", "wave.feed", "--json"]);
    for name in ["spans", "table_bytes"] {
        assert_eq!(count(&inspect, name), count(&plan, name), "{name}");
    }
    for told in [&verify, &inspect] {
        assert_eq!(number(told, "motion_time_s"), number(&plan, "motion_time_s"));
    }
    assert_eq!(count(&inspect, "file_bytes"), fs::metadata(home.path().join("wave.feed")).unwrap().len());
}

/// A job that comes through a pipe lasts until its writer is done; the interrupt comes before.
#[cfg(target_os = "linux")]
#[test]
fn an_interrupt_leaves_nothing_behind() {
    let home = tempfile::tempdir().unwrap();
    let done = |program: &str, words: &[&str]| {
        assert!(Command::new(program).args(words).current_dir(home.path()).status().unwrap().success());
    };
    done("mkfifo", &["pipe.ngc"]);
    // Shells start what they put in the background with Ctrl-C ignored.
    for (trap, signal) in [("", "-INT"), ("", "-TERM"), ("trap '' INT; ", "-TERM")] {
        let program = env!("CARGO_BIN_EXE_feedspline");
        let mut child = Command::new("sh")
            .args(["-c", &format!("{trap}exec '{program}' run pipe.ngc -o out/deep")])
            .current_dir(home.path())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let begin = Instant::now();
        let partial = |path: &PathBuf| path.extension().is_some_and(|e| e == "part");
        while !below(home.path()).iter().any(partial) && begin.elapsed() < TIME_LIMIT {
            thread::sleep(Duration::from_millis(2));
        }
        assert!(below(home.path()).iter().any(partial));
        done("kill", &[signal, &child.id().to_string()]);
        while child.try_wait().unwrap().is_none() && begin.elapsed() < TIME_LIMIT {
            thread::sleep(Duration::from_millis(2));
        }
        // Does nothing to a process that has ended.
        child.kill().unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(130), "{signal}");
        assert_eq!(below(home.path()), [PathBuf::from("pipe.ngc")], "{signal}");
    }
}
