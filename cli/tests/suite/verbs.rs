//! The verbs on a scripted engine: files, streams, exit status, JSON.

use std::collections::BTreeSet;
use std::fs;
use std::io::{ErrorKind, Write};
use std::path::Path;

use cli::args::{CompareArgs, PlanArgs, RunArgs};
use cli::engine::{Compared, Engine, Outcome};
use cli::failure::Failure;
use cli::json::{AxisRatiosJson, CertificateJson, FlashJson, InspectAxisJson, InspectJson, VerifyJson};
use cli::progress::Progress;
use protocol::bus::Node;
use protocol::message::Identity;
use protocol::schema;
use protocol::table::Limits;
use serde_json::Value;

use crate::sample;

/// An engine that answers as told.
struct Scripted {
    holds: bool,
    fails: bool,
}

impl Scripted {
    fn outcome(&self, simulated: bool) -> Result<Outcome, Failure> {
        if self.fails {
            return Err(Failure::input("feed is zero")
                .at(Path::new("part.ngc"), 7, 5)
                .with_help("Program a feed above zero."));
        }
        let mut outcome = sample::outcome(simulated);
        outcome.json.certificate.holds = self.holds;
        Ok(outcome)
    }

    fn certificate(&self) -> CertificateJson {
        CertificateJson {
            holds: self.holds,
            velocity_ratio: 0.9,
            acceleration_ratio: 1.0,
            jerk_ratio: None,
            feed_ratio: None,
        }
    }
}

impl Engine for Scripted {
    fn plan(&self, _: &PlanArgs, _: &mut Progress) -> Result<Outcome, Failure> {
        self.outcome(false)
    }

    fn run(&self, args: &RunArgs, trace: &mut dyn Write, _: &mut Progress) -> Result<Outcome, Failure> {
        writeln!(trace, "every,{:?}", args.trace_every).map_err(|e| Failure::internal(e.to_string()))?;
        self.outcome(true)
    }

    fn compare(&self, _: &CompareArgs, _: &mut Progress) -> Result<Compared, Failure> {
        let mut compared = sample::compared();
        self.outcome(false)?;
        if !self.holds {
            compared.json.methods[1].certified = Some(false);
        }
        Ok(compared)
    }

    fn verify(&self, file: &Path, _: &mut Progress) -> Result<VerifyJson, Failure> {
        let name = "X".into();
        let axis = AxisRatiosJson { name, velocity_ratio: 0.9, acceleration_ratio: 1.0, jerk_ratio: None };
        Ok(VerifyJson {
            file: file.display().to_string(),
            sections: 2,
            spans: 40,
            motion_time_s: 1.5,
            certificate: self.certificate(),
            axes: vec![axis],
            fault_count: if self.holds { 0 } else { 3 },
            faults: if self.holds { Vec::new() } else { vec!["table 1, line 9: jerk".into()] },
            verify_seconds: 0.01,
        })
    }

    fn inspect(&self, file: &Path) -> Result<InspectJson, Failure> {
        let axis = InspectAxisJson {
            name: "X".into(),
            unit: "mm".into(),
            counts_per_unit: 1e4,
            start_counts: 0,
            end_counts: -5,
            bytes: 40,
        };
        Ok(InspectJson {
            file: file.display().to_string(),
            file_bytes: 200,
            format_version: 1,
            schema_hash: "00112233aabbccdd".into(),
            control_tick_s: 1e-3,
            sections: 2,
            dwells: 1,
            spans: 40,
            geometry_spans: 12,
            cycle_time_s: 2.5,
            motion_time_s: 1.5,
            table_bytes: 150,
            shared_bytes: 110,
            axes: vec![axis],
        })
    }
}

struct Said {
    status: u8,
    out: String,
    err: String,
}

fn say(engine: &Scripted, words: &[&str]) -> Said {
    let (mut out, mut err) = (Vec::new(), Vec::new());
    let args = ["feedspline"].iter().chain(words).map(Into::into);
    let status = cli::status(args.collect::<Vec<_>>(), engine, &mut out, &mut err);
    Said { status, out: String::from_utf8(out).unwrap(), err: String::from_utf8(err).unwrap() }
}

fn json(said: &Said) -> Value {
    serde_json::from_str(&said.out).unwrap()
}

fn keys(value: &Value) -> Vec<&str> {
    value.as_object().unwrap().keys().map(String::as_str).collect()
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> =
        fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

const GOOD: Scripted = Scripted { holds: true, fails: false };
const BROKEN: Scripted = Scripted { holds: false, fails: false };
const BAD_INPUT: Scripted = Scripted { holds: true, fails: true };

#[test]
fn run_writes_table_plan_report_and_trace() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().join("out");
    let said = say(&GOOD, &["run", "jobs/part.ngc", "-o", folder.to_str().unwrap(), "--trace-every", "4"]);
    assert_eq!((said.status, said.err.as_str()), (0, ""));
    assert_eq!(names(&folder), ["part.feed", "plan.json", "report.html", "trace.csv"]);
    assert_eq!(fs::read_to_string(folder.join("trace.csv")).unwrap(), "every,Some(4)\n");
    assert_eq!(fs::read(folder.join("part.feed")).unwrap(), b"a feed table");
    assert!(said.out.contains("cycle time") && said.out.contains("report.html"), "{}", said.out);
}

#[test]
fn json_on_standard_output_is_the_plan_file() {
    let home = tempfile::tempdir().unwrap();
    let said = say(&GOOD, &["run", "part.ngc", "--json", "-o", home.path().to_str().unwrap()]);
    let file: Value = serde_json::from_slice(&fs::read(home.path().join("plan.json")).unwrap()).unwrap();
    assert_eq!(json(&said), file);
}

#[test]
fn field_names_of_plan_and_run_are_pinned() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().to_str().unwrap();
    let run = json(&say(&GOOD, &["run", "part.ngc", "--json", "-o", folder]));
    let mut expected: Vec<&str> = "job job_kind way_points machine axes blocks rapids lines arcs splines dwells stops stops_by_cause feed_length_mm \
        rapid_length_mm bounding_box_mm tolerance_mm tolerance_source max_deviation_mm cycle_time_s motion_time_s \
        constant_feed_time_s stop_every_block_time_s binding feed_not_reached operations spans table_bytes plan_seconds \
        peak_memory_mib solver jerk_form windows iterations gap_estimate certificate simulation notes files"
        .split_whitespace()
        .collect();
    expected.sort_unstable();
    let mut found = keys(&run);
    found.sort_unstable();
    assert_eq!(found, expected);
    assert_eq!(keys(&run["bounding_box_mm"]), ["max", "min"]);
    let ratios = ["acceleration_ratio", "feed_ratio", "holds", "jerk_ratio", "velocity_ratio"];
    assert_eq!(keys(&run["certificate"]), ratios);
    assert_eq!(keys(&run["binding"][0]), ["axis", "kind", "seconds", "share"]);
    let place = [
        "axis",
        "first_line",
        "last_line",
        "length_mm",
        "limited_by",
        "lost_s",
        "lowest_mm_s",
        "mean_mm_s",
        "programmed_mm_s",
    ];
    assert_eq!(keys(&run["feed_not_reached"][0]), place);
    let operation = ["dwell_s", "feed_length_mm", "feed_s", "line", "name", "rapid_length_mm", "rapid_s"];
    assert_eq!(keys(&run["operations"][0]), operation);
    assert_eq!(keys(&run["simulation"]["bus"]), ["bytes", "frames", "load"]);
    let simulation = [
        "at_end",
        "bus",
        "max_contour_error_mm",
        "max_following_error_mm",
        "max_path_deviation_counts",
        "real_time_factor",
        "rms_contour_error_mm",
        "rms_following_error_mm",
        "setpoint_hash",
        "setpoints",
    ];
    assert_eq!(keys(&run["simulation"]), simulation);
    assert_eq!(keys(&run["files"]), ["feed", "plan", "report", "trace"]);
    let plan = json(&say(&GOOD, &["plan", "part.ngc", "--json", "-o", folder]));
    assert!(plan.get("simulation").is_none() && plan["files"].get("trace").is_none());
}

#[test]
fn field_names_of_compare_and_sample_are_pinned() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().to_str().unwrap();
    let compare = json(&say(&GOOD, &["compare", "points.csv", "--json", "-o", folder]));
    let expected = "axes feed_length_mm files geometry_spans job job_kind machine methods peak_memory_mib sections \
                    threads way_points";
    assert_eq!(keys(&compare), expected.split_whitespace().collect::<Vec<_>>());
    let expected = "acceleration_ratio binding certified compute_seconds constant_feed_mm_s feed_ratio gap_estimate \
                    iterations jerk_form jerk_ratio lost_s method over_whole remark solver spans state \
                    traverse_time_s velocity_ratio windows";
    assert_eq!(keys(&compare["methods"][0]), expected.split_whitespace().collect::<Vec<_>>());
    assert_eq!(keys(&compare["way_points"]), ["count", "ends", "geometry_spans", "knots"]);
    assert_eq!(keys(&compare["files"]), ["compare", "report"]);
    let states: Vec<&Value> =
        compare["methods"].as_array().unwrap().iter().map(|method| &method["state"]).collect();
    assert_eq!(states, ["planned", "planned", "timed", "left_out", "planned"]);
    let file = home.path().join("cat.csv");
    let written = json(&say(&GOOD, &["sample", "cat", "--json", "-o", file.to_str().unwrap()]));
    assert_eq!(keys(&written), ["file", "file_bytes", "points"]);
}

#[test]
fn compare_writes_its_page_and_its_object() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().join("out");
    let words = ["compare", "points.csv", "-o", folder.to_str().unwrap()];
    let said = say(&GOOD, &words);
    assert_eq!((said.status, said.err.as_str()), (0, ""));
    assert_eq!(names(&folder), ["compare.html", "compare.json"]);
    for part in ["whole", "zhao", "sweep", "left out: takes minutes", "12.5", "compare.html"] {
        assert!(said.out.contains(part), "{part} in {}", said.out);
    }
    let told = json(&say(&GOOD, &[&words[..], &["--json"]].concat()));
    let file: Value = serde_json::from_slice(&fs::read(folder.join("compare.json")).unwrap()).unwrap();
    assert_eq!(told, file);
}

#[test]
fn compare_fails_with_a_method_that_breaks_its_promise_but_not_with_one_that_makes_none() {
    let home = tempfile::tempdir().unwrap();
    let words = ["compare", "points.csv", "-o", home.path().to_str().unwrap()];
    // The sample's collocation is not certified either way.
    assert_eq!(say(&GOOD, &words).status, 0);
    let broken = say(&BROKEN, &words);
    assert_eq!(broken.status, 1);
    assert!(broken.out.contains("NO"), "{}", broken.out);
    assert_eq!(names(home.path()), ["compare.html", "compare.json"]);
}

#[test]
fn sample_writes_what_it_is_asked_for() {
    let home = tempfile::tempdir().unwrap();
    let file = home.path().join("deep/tooth.csv");
    let words = ["sample", "tooth", "--rows", "3", "--points", "7", "-o", file.to_str().unwrap()];
    assert_eq!(say(&GOOD, &words).status, 0);
    let text = fs::read_to_string(&file).unwrap();
    assert_eq!((text.lines().next(), text.lines().count()), (Some("X [mm],Y [mm],Z [mm]"), 22));
    for bad in [
        &["cat", "--rows", "3"][..],
        &["cat", "--points", "1"],
        &["tooth", "--rows", "0"],
        &["tooth", "--rows", "100000", "--points", "1000"],
        &["tooth", "-o", ".."],
        &["dog"],
    ] {
        let words = [&["sample", "--json"], bad].concat();
        let said = say(&GOOD, &words);
        assert_eq!((said.status, &json(&said)["error"]["kind"]), (2, &"input".into()), "{bad:?}");
    }
    assert_eq!(names(home.path()), ["deep"]);
}

#[test]
fn field_names_of_verify_and_inspect_are_pinned() {
    let verify = json(&say(&GOOD, &["verify", "a.feed", "--json"]));
    let expected = "axes certificate fault_count faults file motion_time_s sections spans verify_seconds";
    assert_eq!(keys(&verify), expected.split_whitespace().collect::<Vec<_>>());
    let axis = ["acceleration_ratio", "jerk_ratio", "name", "velocity_ratio"];
    assert_eq!(keys(&verify["axes"][0]), axis);
    let inspect = json(&say(&GOOD, &["inspect", "a.feed", "--json"]));
    let expected = "axes control_tick_s cycle_time_s dwells file file_bytes format_version geometry_spans \
                    motion_time_s schema_hash sections shared_bytes spans table_bytes";
    assert_eq!(keys(&inspect), expected.split_whitespace().collect::<Vec<_>>());
    let axis = ["bytes", "counts_per_unit", "end_counts", "name", "start_counts", "unit"];
    assert_eq!(keys(&inspect["axes"][0]), axis);
}

/// The names of all fields of an object and of what it holds.
fn fields(value: &Value, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(map) => {
            for (key, inner) in map {
                found.insert(key.clone());
                fields(inner, found);
            }
        }
        Value::Array(list) => list.iter().for_each(|inner| fields(inner, found)),
        _ => {}
    }
}

/// What a drive says of itself, as `flash` tells it.
fn flashed(schema: u64) -> FlashJson {
    let limits = Limits { velocity: 1e6, acceleration: 1e8, jerk: None };
    let identity = Identity {
        version: [1, 2, 3],
        format: 1,
        schema,
        axis: 4,
        tick_ns: 250_000,
        limits,
        room: 4096,
        boot: 7,
        epoch: 3,
    };
    FlashJson::of("emulated", Path::new("drive"), Node::new(5).unwrap(), &identity, schema == schema::HASH)
}

#[test]
fn flash_tells_whether_the_drive_speaks_this_protocol() {
    let text = cli::summary::flash(&flashed(schema::HASH));
    assert!(text.contains("1.2.3") && text.contains("the host's") && !text.contains("NOT"), "{text}");
    assert!(cli::summary::flash(&flashed(7)).contains("0000000000000007, NOT the host's"));
    let said = say(&GOOD, &["flash", "--board", "emulated", "--image", "/does/not/exist"]);
    assert_eq!((said.status, said.out.as_str()), (2, ""));
    assert!(said.err.contains("/does/not/exist"), "{}", said.err);
    assert_eq!(say(&GOOD, &["flash", "--board", "emulated", "--node", "0"]).status, 2);
    assert_eq!(say(&GOOD, &["flash", "--board", "toaster"]).status, 2);
    let said = say(&GOOD, &["flash", "--board", "stm32g4"]);
    assert!(said.status == 2 && said.err.contains("--line is missing"), "{}", said.err);
    assert_eq!(say(&GOOD, &["flash", "--board", "emulated", "--line", "/dev/null"]).status, 2);
}

/// Fields of the verbs that speak to drives, whatever they have to say.
fn live_fields() -> BTreeSet<String> {
    use cli::json::{
        AxisAtJson, DecodedJson, DriveAxisJson, DriveJson, DrivesJson, ErrandJson, HealthJson, MalformedJson,
        StatusJson, StopJson, StreamJson, UpdateJson, WatchedJson,
    };
    let value = |object: Result<serde_json::Value, _>| object.unwrap();
    let health = HealthJson::default();
    let objects = [
        value(serde_json::to_value(StreamJson::default())),
        value(serde_json::to_value(ErrandJson {
            axes: vec![AxisAtJson { name: "X".into(), position: 1.0 }],
            seconds: 1.0,
            stopped: false,
        })),
        value(serde_json::to_value(StatusJson { drives: vec![DriveJson::default()] })),
        value(serde_json::to_value(UpdateJson::default())),
        value(serde_json::to_value(StopJson { stop: "path".into(), frames_sent: 3 })),
        value(serde_json::to_value(DrivesJson {
            drives: vec![DriveAxisJson::default()],
            bus_health: health,
            ..DrivesJson::default()
        })),
        value(serde_json::to_value(WatchedJson {
            decoded: vec![DecodedJson::default()],
            malformed: vec![MalformedJson::default()],
            bus_health: Some(health),
            ..WatchedJson::default()
        })),
    ];
    let mut found = BTreeSet::new();
    objects.iter().for_each(|object| fields(object, &mut found));
    found
}

#[test]
fn the_documentation_explains_every_field_and_no_other() {
    let text = include_str!("../../../docs/json.md");
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().to_str().unwrap();
    let mut found = BTreeSet::new();
    fields(&json(&say(&GOOD, &["run", "part.ngc", "--json", "-o", folder])), &mut found);
    fields(&json(&say(&GOOD, &["compare", "points.csv", "--json", "-o", folder])), &mut found);
    let file = home.path().join("cat.csv");
    fields(&json(&say(&GOOD, &["sample", "cat", "--json", "-o", file.to_str().unwrap()])), &mut found);
    fields(&json(&say(&GOOD, &["verify", "a.feed", "--json"])), &mut found);
    fields(&json(&say(&GOOD, &["inspect", "a.feed", "--json"])), &mut found);
    fields(&json(&say(&BAD_INPUT, &["plan", "part.ngc", "--json", "-o", folder])), &mut found);
    let file = home.path().join("moves.csv");
    fs::write(&file, super::moves::PAIRS).unwrap();
    fields(&json(&say(&GOOD, &["move", file.to_str().unwrap(), "--json"])), &mut found);
    let one = ["--p0", "0", "--p1", "1", "--vmax", "1", "--amax", "1", "--jmax", "1"];
    fields(&json(&say(&GOOD, &[&["move", "--json"][..], &one].concat())), &mut found);
    fields(&serde_json::to_value(flashed(schema::HASH)).unwrap(), &mut found);
    found.extend(live_fields());
    for name in &found {
        assert!(text.contains(&format!("`{name}`")), "docs/json.md does not explain {name}");
    }
    // The first cell of a row holds names in backticks.
    let rows = text.lines().filter_map(|line| line.strip_prefix("| `")?.split('|').next());
    for name in rows.flat_map(|cell| cell.split('`').step_by(2)) {
        assert!(found.contains(name), "docs/json.md explains {name}, which does not exist");
    }
}

#[test]
fn bad_input_is_status_two_with_a_diagnostic_and_no_file() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().join("deep/out");
    for verb in ["plan", "run", "compare"] {
        let said = say(&BAD_INPUT, &[verb, "part.ngc", "-o", folder.to_str().unwrap()]);
        assert_eq!((said.status, said.out.as_str()), (2, ""));
        assert!(said.err.contains("part.ngc:7:5: feed is zero"), "{}", said.err);
        assert!(said.err.contains("Program a feed above zero."), "{}", said.err);
        assert!(names(home.path()).is_empty());
    }
}

#[test]
fn bad_input_in_json_is_one_object() {
    let home = tempfile::tempdir().unwrap();
    let said = say(&BAD_INPUT, &["plan", "part.ngc", "--json", "-o", home.path().to_str().unwrap()]);
    assert_eq!(said.status, 2);
    let error = &json(&said)["error"];
    assert_eq!(error["kind"], "input");
    assert_eq!(
        (&error["file"], &error["line"], &error["column"]),
        (&"part.ngc".into(), &7.into(), &5.into())
    );
    assert_eq!(error["message"], "feed is zero");
    assert_eq!(error["help"], "Program a feed above zero.");
}

#[test]
fn a_broken_certificate_is_status_one_with_a_report_and_no_table() {
    let home = tempfile::tempdir().unwrap();
    let words = ["plan", "part.ngc", "-o", home.path().to_str().unwrap()];
    assert_eq!(say(&GOOD, &words).status, 0);
    assert_eq!(names(home.path()), ["part.feed", "plan.json", "report.html"]);
    let said = say(&BROKEN, &words);
    assert_eq!(said.status, 1);
    assert_eq!(names(home.path()), ["plan.json", "report.html"]);
    assert!(said.out.contains("DOES NOT HOLD"), "{}", said.out);
}

#[test]
fn verify_says_what_does_not_hold() {
    let said = say(&BROKEN, &["verify", "a.feed"]);
    assert_eq!(said.status, 1);
    assert!(said.out.contains("  fault               table 1, line 9: jerk\n"), "{}", said.out);
    assert!(said.out.contains("and 2 more"), "{}", said.out);
    let told = json(&say(&BROKEN, &["verify", "a.feed", "--json"]));
    assert_eq!((&told["fault_count"], &told["faults"][0]), (&3.into(), &"table 1, line 9: jerk".into()));
    let sound = say(&GOOD, &["verify", "a.feed"]);
    assert!(sound.status == 0 && !sound.out.contains("fault"), "{}", sound.out);
}

#[test]
fn quiet_says_nothing() {
    let home = tempfile::tempdir().unwrap();
    let said = say(&GOOD, &["plan", "part.ngc", "-q", "-o", home.path().to_str().unwrap()]);
    assert_eq!((said.status, said.out.as_str(), said.err.as_str()), (0, "", ""));
}

#[test]
fn usage_errors_are_status_two_and_help_is_not_an_error() {
    assert_eq!(say(&GOOD, &["plan"]).status, 2);
    assert_eq!(say(&GOOD, &["plan", "a.ngc", "--tolerance", "-1"]).status, 2);
    assert_eq!(say(&GOOD, &["paln", "a.ngc"]).status, 2);
    let help = say(&GOOD, &["run", "--help"]);
    assert_eq!(help.status, 0);
    assert!(help.out.contains("Example: feedspline run"));
    assert_eq!(say(&GOOD, &["plan", ".."]).status, 2);
}

#[test]
fn usage_errors_in_json_are_one_object() {
    for (words, part) in [
        (vec!["plan", "--json"], "required arguments"),
        (vec!["plan", "a.ngc", "--json", "--tolerance", "-1"], "zero or more"),
        (vec!["run", "a.ngc", "--json", "--speed", "3"], "--speed"),
    ] {
        let said = say(&GOOD, &words);
        let error = &json(&said)["error"];
        assert_eq!((said.status, &error["kind"]), (2, &"input".into()), "{error}");
        assert!(error["message"].as_str().unwrap().contains(part), "{error}");
        assert!(error["help"].as_str().unwrap().contains("--help"), "{error}");
        assert!(said.err.starts_with("error: "), "{}", said.err);
    }
    assert_eq!(say(&GOOD, &["plan", "--", "--json", "b.ngc"]).out, "");
}

/// A stream with no room.
struct Full(ErrorKind);

impl Write for Full {
    fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
        Err(self.0.into())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_full_standard_output_is_a_failure_and_a_closed_one_is_not() {
    for words in [&["inspect", "a.feed"][..], &["verify", "a.feed", "--json"], &["--help"]] {
        let args = || ["feedspline"].iter().chain(words).map(Into::into).collect::<Vec<_>>();
        let mut err = Vec::new();
        assert_eq!(cli::status(args(), &GOOD, &mut Full(ErrorKind::StorageFull), &mut err), 1, "{words:?}");
        let err = String::from_utf8(err).unwrap();
        assert_eq!(err.matches("standard output:").count(), 1, "{err}");
        let mut err = Vec::new();
        assert_eq!(cli::status(args(), &GOOD, &mut Full(ErrorKind::BrokenPipe), &mut err), 0, "{words:?}");
        assert!(err.is_empty());
    }
}

#[test]
fn summaries_align_their_columns() {
    let home = tempfile::tempdir().unwrap();
    let said = say(&GOOD, &["run", "part.ngc", "-o", home.path().to_str().unwrap()]);
    for line in said.out.lines().skip(1) {
        let (name, value) = line.split_at(21);
        assert!(name.ends_with(' ') && name.starts_with("  "), "{line}");
        assert!(!value.starts_with("  "), "{line}");
    }
}
