//! Moves from state to state, from the command line to the answer.

use std::fs;

use cli::local::Local;
use serde_json::Value;

/// Two axes: together, on one line, and with a limit that makes no sense.
pub(crate) const PAIRS: &str = "\
p0_x,v0_x,a0_x,p1_x,v1_x,a1_x,vmax_x,amax_x,jmax_x,p0_y,p1_y,vmax_y,amax_y,jmax_y,sync
0,0.5,0,10,0,0,5,20,200,0,2,5,20,200,time
0,0,0,10,0,0,5,20,200,0,-2,5,20,200,phase
0,0,0,10,0,0,5,20,200,0,2,5,nan,200,none
";

struct Said {
    status: u8,
    out: String,
    err: String,
}

fn say(words: &[&str]) -> Said {
    let (mut out, mut err) = (Vec::new(), Vec::new());
    let args = ["feedspline", "move"].iter().chain(words).map(Into::into).collect::<Vec<_>>();
    let status = cli::status(args, &Local, &mut out, &mut err);
    Said { status, out: String::from_utf8(out).unwrap(), err: String::from_utf8(err).unwrap() }
}

/// What integrating the phases gives: how long, and where it ends.
fn flown(phases: &Value) -> (f64, [f64; 3]) {
    let get = |v: &Value, key: &str| v[key].as_f64().unwrap();
    let mut end = [0.0; 3];
    let mut seconds = 0.0;
    for (index, phase) in phases.as_array().unwrap().iter().enumerate() {
        let [p, v, a] = ["position", "velocity", "acceleration"].map(|key| get(phase, key));
        let (t, j) = (get(phase, "duration_s"), get(phase, "jerk"));
        if index > 0 {
            for (before, now) in end.iter().zip([p, v, a]) {
                assert!((before - now).abs() < 1e-9, "{before} {now} in {phases}");
            }
        }
        end = [p + t * (v + t * (a / 2.0 + t * j / 6.0)), v + t * (a + t * j / 2.0), a + t * j];
        seconds += t;
    }
    (seconds, end)
}

#[test]
fn one_move_from_rest_to_rest() {
    let said = say(&["--p0", "-1", "--p1", "9", "--vmax", "5", "--amax", "20", "--jmax", "200", "--json"]);
    assert_eq!((said.status, said.err.as_str()), (0, ""));
    let rows: Value = serde_json::from_str(&said.out).unwrap();
    // d/v + v/a + a/j
    assert!((rows[0]["duration_s"].as_f64().unwrap() - 2.35).abs() < 1e-12);
    let (seconds, end) = flown(&rows[0]["phases"]);
    assert!((seconds - 2.35).abs() < 1e-12 && (end[0] - 9.0).abs() < 1e-12);
    assert_eq!(rows[0]["end"]["position"], 9.0);
    assert_eq!(rows.as_array().unwrap().len(), 1);
}

#[test]
fn rows_of_a_file_are_answered_in_order_whatever_becomes_of_them() {
    let home = tempfile::tempdir().unwrap();
    let file = home.path().join("moves.csv");
    fs::write(&file, PAIRS).unwrap();
    let file = file.to_str().unwrap();
    let said = say(&[file, "--json"]);
    assert_eq!(said.status, 2);
    assert!(said.err.contains("1 of 3 moves"), "{}", said.err);
    let rows: Value = serde_json::from_str(&said.out).unwrap();
    for (row, sync) in [(0, "time"), (1, "phase")] {
        assert_eq!(rows[row]["sync"], sync);
        let longest = rows[row]["duration_s"].as_f64().unwrap();
        for (axis, target) in [(0, 10.0), (1, if row == 0 { 2.0 } else { -2.0 })] {
            let (seconds, end) = flown(&rows[row]["axes"][axis]["phases"]);
            assert!(
                (seconds - longest).abs() < 1e-9 && (end[0] - target).abs() < 1e-9,
                "{said}",
                said = said.out
            );
        }
    }
    assert_eq!(rows[2]["error"]["name"], "limit");
    assert_eq!(rows[2]["error"]["axis"], "y");
    let text = say(&[file]);
    assert_eq!(text.status, 2);
    assert!(text.out.contains("row 3, line 4: axis y: limit: "), "{}", text.out);
    assert!(say(&[file, "--quiet"]).out.is_empty());
}

#[test]
fn what_cannot_be_read_is_one_error_and_nothing_else() {
    let home = tempfile::tempdir().unwrap();
    let file = home.path().join("moves.csv");
    fs::write(&file, "p0,p1,vmax,amax,jmax\n0,1,2,3,4\n0,1,2,three,4\n").unwrap();
    let said = say(&[file.to_str().unwrap(), "--json"]);
    assert_eq!(said.status, 2);
    let error: Value = serde_json::from_str(&said.out).unwrap();
    assert!(error["error"].to_string().contains("three"), "{error}");
    assert!(said.err.contains("moves.csv:3:4"), "{}", said.err);
    let missing = say(&["--p0", "0", "--p1", "1", "--vmax", "2", "--amax", "3"]);
    assert_eq!(missing.status, 2);
    assert!(missing.err.contains("--jmax is missing"), "{}", missing.err);
    assert_eq!(say(&[file.to_str().unwrap(), "--p0", "1"]).status, 2);
}
