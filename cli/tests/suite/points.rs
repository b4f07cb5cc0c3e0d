//! Files of way-points on the real planner and simulator.

use std::f64::consts::TAU;
use std::fmt::Write;
use std::fs;
use std::path::Path;

use cli::local::Local;
use serde_json::Value;

/// Radius of the circle [mm].
pub(crate) const RADIUS: f64 = 25.0;

/// A circle of 120 way-points round (40, 10), from its rightmost point and back to it.
pub(crate) fn circle() -> String {
    let mut text = "# once round\nX [mm],Y [cm]\n".to_owned();
    for k in 0..=120 {
        let (s, c) = if k == 120 { (0.0, 1.0) } else { (TAU * f64::from(k) / 120.0).sin_cos() };
        writeln!(text, "{:.9},{:.10}", 40.0 + RADIUS * c, 1.0 + 0.1 * RADIUS * s).unwrap();
    }
    text
}

/// What a verb says, with `words` behind the file; the exit status has to be 0.
pub(crate) fn tell(folder: &Path, verb: &str, file: &Path, words: &[&str]) -> Value {
    let out = folder.join("out");
    let fixed = ["feedspline", verb, file.to_str().unwrap(), "--json"];
    let mut args = [&fixed[..], words].concat();
    if ["plan", "run", "compare"].contains(&verb) {
        args.extend(["-o", out.to_str().unwrap()]);
    }
    let (mut said, mut err) = (Vec::new(), Vec::new());
    let args: Vec<_> = args.into_iter().map(Into::into).collect();
    let status = cli::status(args, &Local, &mut said, &mut err);
    assert_eq!((status, err.len()), (0, 0), "{words:?}: {}", String::from_utf8_lossy(&said));
    serde_json::from_slice(&said).unwrap()
}

/// Plans the circle.
fn plan(words: &[&str]) -> Value {
    let home = tempfile::tempdir().unwrap();
    let file = home.path().join("ring.csv");
    fs::write(&file, circle()).unwrap();
    tell(home.path(), "plan", &file, words)
}

fn number(told: &Value, name: &str) -> f64 {
    told[name].as_f64().unwrap_or_else(|| panic!("{name} is no number in {told}"))
}

#[test]
fn way_points_are_a_job_like_any_other() {
    let home = tempfile::tempdir().unwrap();
    let file = home.path().join("ring.csv");
    fs::write(&file, circle()).unwrap();
    let told = tell(home.path(), "run", &file, &["--spline", "periodic"]);
    assert_eq!((&told["job_kind"], &told["way_points"]["count"]), (&"way-points".into(), &121.into()));
    assert_eq!(
        (&told["way_points"]["ends"], &told["way_points"]["knots"]),
        (&"periodic".into(), &"chord".into())
    );
    // The machine starts at 0: a rapid to (65, 10), then the circle.
    let counts = ["blocks", "rapids", "lines", "splines"].map(|n| told[n].as_u64().unwrap());
    assert_eq!(counts, [0, 1, 0, 1]);
    assert_eq!(told["stops_by_cause"], serde_json::json!({ "program_end": 1, "rapid": 1 }));
    assert!((number(&told, "rapid_length_mm") - 65f64.hypot(10.0)).abs() < 1e-6);
    assert!((number(&told, "feed_length_mm") / (TAU * RADIUS) - 1.0).abs() < 1e-4);
    let corners = |name: &str| -> Vec<f64> {
        told["bounding_box_mm"][name].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
    };
    assert_eq!((corners("min"), corners("max")), (vec![15.0, -15.0, 0.0], vec![65.0, 35.0, 0.0]));
    assert!(number(&told, "max_deviation_mm") < 1e-4);
    assert_eq!((&told["certificate"]["holds"], &told["simulation"]["at_end"]), (&true.into(), &true.into()));
    assert!(told["simulation"]["max_path_deviation_counts"].as_f64().unwrap() <= 1.0);
    assert_eq!(told["certificate"]["feed_ratio"], Value::Null);
    assert_eq!(told["feed_not_reached"], serde_json::json!([]));

    let table = home.path().join("out/ring.feed");
    let verified = tell(home.path(), "verify", &table, &[]);
    assert_eq!(verified["certificate"], told["certificate"]);
    let inspected = tell(home.path(), "inspect", &table, &[]);
    assert_eq!((&inspected["sections"], &inspected["spans"]), (&2.into(), &told["spans"]));
    let ends = |name: &str| -> Vec<i64> {
        inspected["axes"].as_array().unwrap().iter().map(|a| a[name].as_i64().unwrap()).collect()
    };
    assert_eq!((ends("start_counts"), ends("end_counts")), (vec![0, 0, 0], vec![650_000, 100_000, 0]));
    let report = fs::read_to_string(home.path().join("out/report.html")).unwrap();
    assert!(report.contains("Way-points") && report.contains("periodic"));
}

#[test]
fn the_way_to_the_first_point_is_left_out_when_the_machine_is_there() {
    let home = tempfile::tempdir().unwrap();
    let file = home.path().join("line.CSV");
    fs::write(&file, "Y,X\n0,0\n1,10\n0,20\n1,30\n").unwrap();
    let told = tell(home.path(), "plan", &file, &[]);
    assert_eq!(
        (&told["rapids"], &told["stops"], &told["rapid_length_mm"]),
        (&0.into(), &1.into(), &0.0.into())
    );
}

#[test]
fn every_spline_passes_the_points_and_takes_about_the_same_time() {
    let usual = number(&plan(&[]), "motion_time_s");
    for ends in ["not-a-knot", "clamped", "natural", "periodic"] {
        for knots in ["uniform", "chord", "centripetal"] {
            let told = plan(&["--spline", ends, "--knots", knots]);
            assert_eq!(told["certificate"]["holds"], true, "{ends} {knots}");
            assert!(number(&told, "max_deviation_mm") < 1e-4, "{ends} {knots}");
            // Natural ends are straight and clamped ones set out along a chord: on a circle both cost a little.
            assert!((number(&told, "motion_time_s") / usual - 1.0).abs() < 0.15, "{ends} {knots}: {told}");
        }
    }
}

#[test]
fn a_feed_is_kept_and_what_is_lost_against_it_is_told() {
    let told = plan(&["--feed", "3000"]);
    let certificate = &told["certificate"];
    let ratio = certificate["feed_ratio"].as_f64().unwrap();
    assert!(ratio > 0.99 && ratio <= 1.000_001, "{ratio}");
    // 50 mm/s: on 157 mm that rules most of the time; rest to rest costs at both ends.
    assert_eq!(told["binding"][0]["kind"], "feed");
    let places = told["feed_not_reached"].as_array().unwrap();
    assert_eq!(places.len(), 2, "{places:?}");
    let lines: Vec<u64> = places.iter().map(|p| p["first_line"].as_u64().unwrap()).collect();
    assert!(lines.contains(&4) && lines.iter().any(|l| *l > 115), "{lines:?}");
    assert!(places.iter().all(|p| (number(p, "programmed_mm_s") - 50.0).abs() < 1e-9));
    let constant = number(&told, "constant_feed_time_s");
    let approach = 65.0 / 250.0;
    assert!((constant - approach - TAU * RADIUS / 50.0).abs() < 1e-3, "{constant}");
    assert!(constant < number(&told, "motion_time_s"));
}

#[test]
fn jerk_forms_and_limits_are_told_and_ordered() {
    let time = |words: &[&str], form: &str| {
        let told = plan(words);
        assert_eq!(told["jerk_form"], form, "{words:?}");
        assert_eq!(told["certificate"]["jerk_ratio"].is_null(), form == "none", "{words:?}");
        assert_eq!(told["certificate"]["holds"], true, "{words:?}");
        number(&told, "motion_time_s")
    };
    let (free, real, pseudo) =
        (time(&["--jerk", "none"], "none"), time(&[], "true"), time(&["--jerk", "pseudo"], "pseudo"));
    assert_eq!(time(&["--limits", "va"], "none"), free);
    assert!(free < real && real <= pseudo * (1.0 + 1e-4), "{free} {real} {pseudo}");
    let stops = |words: &[&str]| number(&plan(words), "stop_every_block_time_s");
    assert!(stops(&["--limits", "va"]) < stops(&[]));
    for windows in ["overlap", "whole", "zhao"] {
        assert_eq!(plan(&["--windows", windows])["windows"], windows);
    }
    let gap = number(&plan(&[]), "gap_estimate");
    assert!((0.0..1e-3).contains(&gap), "{gap}");
}

#[test]
fn pseudo_jerk_counts_as_a_ruling_where_it_is_at_its_own_bound() {
    let home = tempfile::tempdir().unwrap();
    let jobs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../jobs");
    let machine = jobs.join("compact3.toml");
    let words = ["--machine", machine.to_str().unwrap(), "--jerk", "pseudo"];
    let told = tell(home.path(), "plan", &jobs.join("cat2d.csv"), &words);
    let rulings = told["binding"].as_array().unwrap();
    let share: f64 = rulings.iter().filter(|b| b["kind"] == "jerk").map(|b| number(b, "share")).sum();
    // Measured against the true limit it hardly ever rules.
    assert!(share > 0.2, "{share}");
}

#[test]
fn a_tolerance_saves_spans_and_none_takes_the_path_through_every_point() {
    let (near, exact) = (plan(&["--tolerance", "0.01"]), plan(&["--tolerance", "0"]));
    let spans = |told: &Value| told["way_points"]["geometry_spans"].as_u64().unwrap();
    assert!(spans(&near) < spans(&plan(&[])) || spans(&plan(&[])) < spans(&exact), "{near}");
    assert!(2 * spans(&near) < spans(&exact), "{} {}", spans(&near), spans(&exact));
    assert_eq!(near["tolerance_source"], "command line");
    assert_eq!(plan(&[])["tolerance_source"], "resolution of the way-points");
    for told in [near, exact] {
        assert!(number(&told, "max_deviation_mm") <= number(&told, "tolerance_mm"));
        assert_eq!(told["certificate"]["holds"], true);
    }
}

#[test]
fn a_raster_that_turns_back_at_every_row_is_planned_and_proven() {
    let home = tempfile::tempdir().unwrap();
    let file = home.path().join("tooth.csv");
    let words =
        ["feedspline", "sample", "tooth", "--rows", "30", "--points", "40", "-o", file.to_str().unwrap()];
    let (mut said, mut err) = (Vec::new(), Vec::new());
    assert_eq!(cli::status(words.map(Into::into).to_vec(), &Local, &mut said, &mut err), 0);
    let told = tell(home.path(), "plan", &file, &[]);
    assert_eq!((&told["way_points"]["count"], &told["certificate"]["holds"]), (&1200.into(), &true.into()));
    let verified = tell(home.path(), "verify", &home.path().join("out/tooth.feed"), &[]);
    assert_eq!(verified["certificate"], told["certificate"]);
    // 30 rows of 12 mm along x at least, and the way up and down the tooth.
    assert!(number(&told, "feed_length_mm") > 30.0 * 11.7);
}
