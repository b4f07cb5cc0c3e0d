//! The report as a file: complete, self-contained, bounded, safe against what programs hold.

use crate::sample::{self, Kind};
use cli::json::NoteJson;
use cli::report::model::{AxisTraces, Limit, Mode, Report};
use cli::report::page;
use cli::report::record::{AxisInstant, DriveInstant, Instant, Recorder};

const ALL: [Kind; 4] = [Kind::Space, Kind::Flat, Kind::Rotary, Kind::Slide];

#[test]
fn the_report_refers_to_nothing_outside_itself() {
    for kind in ALL {
        let page = page(&sample::report(kind, 1));
        for outside in
            ["http:", "https:", "//cdn", "<link", "src=", "href=", "url(", "@import", "fetch(", "XMLHttp"]
        {
            assert!(!page.contains(outside), "{kind:?} holds {outside}");
        }
        assert!(page.contains("default-src 'none'"));
    }
}

/// Texts that try to leave their place in the page.
const HOSTILE: [&str; 4] = [
    "<script>alert(1)</script>",
    "</script><script>alert(2)</script>",
    "\"><img onerror=alert(3)>",
    "</title></style>]]>--><svg/onload=alert(4)>",
];

fn poisoned(text: &str) -> Report {
    let mut report = sample::report(Kind::Flat, 1);
    report.job = text.into();
    report.machine = text.into();
    report.tolerance.source = text.into();
    report.planning.solver = text.into();
    for axis in &mut report.axes {
        axis.name = text.into();
        axis.unit = text.into();
    }
    for operation in &mut report.operations {
        operation.name = text.into();
    }
    for stop in &mut report.stops {
        stop.cause = text.into();
    }
    report.notes = vec![NoteJson { line: 1, text: text.into() }];
    if let Some(simulation) = &mut report.simulation {
        simulation.setpoint_hash = text.into();
    }
    report
}

#[test]
fn hostile_names_and_comments_stay_text() {
    let plain = page(&sample::report(Kind::Flat, 1));
    for text in HOSTILE {
        let page = page(&poisoned(text));
        assert!(!page.contains(text), "{text}");
        for tag in ["<script", "</script", "<img", "<svg", "</style", "</title"] {
            assert_eq!(page.matches(tag).count(), plain.matches(tag).count(), "{tag} from {text}");
        }
    }
}

#[test]
fn the_embedded_numbers_are_json_with_every_series() {
    let page = page(&sample::report(Kind::Space, 1));
    let start = page.find("application/json\">").unwrap() + "application/json\">".len();
    let end = start + page[start..].find("</script>").unwrap();
    let data: serde_json::Value = serde_json::from_str(&page[start..end]).unwrap();
    let intervals = data["t"]["time"]["d"].as_array().unwrap().len();
    assert!(intervals > 1000, "{intervals}");
    for axis in data["t"]["axes"].as_array().unwrap() {
        for series in ["v", "a", "j", "e", "f"] {
            assert_eq!(axis[series]["d"].as_array().unwrap().len(), intervals, "{series}");
        }
    }
    let corners = data["path"]["time"]["d"].as_array().unwrap().len();
    assert_eq!(data["path"]["at"].as_array().unwrap().len(), 3);
    assert!(
        data["path"]["at"].as_array().unwrap().iter().all(|s| s["d"].as_array().unwrap().len() == corners)
    );
}

#[test]
fn every_headline_and_table_is_there() {
    let page = page(&sample::report(Kind::Space, 1));
    for text in [
        "Cycle time",
        "Constant feed would take",
        "Stopping at every block",
        "Certificate",
        "Deviation from the program",
        "End state, simulated",
        "What limits the speed",
        "Where the programmed feed is not reached",
        "Time per operation",
        "Stops by cause",
        "Machine limits",
        "no physical drive was used",
        "Contour error, simulated",
        "crossed the bus",
        "before the first remark",
        "40 places",
        "allowed by the machine",
        "0.999998",
    ] {
        assert!(page.contains(text), "{text}");
    }
}

#[test]
fn without_a_simulation_nothing_is_claimed_of_drives() {
    let mut report = sample::report(Kind::Flat, 1);
    report.simulation = None;
    for axis in &mut report.motion.traces.axes {
        *axis = AxisTraces { error: Default::default(), effort: Default::default(), ..axis.clone() };
    }
    let page = page(&report);
    assert!(page.contains("nothing was played"));
    assert!(!page.contains("End state") && !page.contains("Following error"));
}

#[test]
fn a_broken_certificate_is_said_plainly() {
    let mut report = sample::report(Kind::Flat, 1);
    report.certificate.verdict.holds = false;
    let page = page(&report);
    assert!(page.contains("does not hold") && page.contains("no feed table was written"));
}

#[test]
fn the_worst_job_of_a_nine_axis_machine_stays_below_three_megabytes() {
    let mut report = sample::report(Kind::Flat, 1);
    let axis = report.axes[0].clone();
    report.axes = vec![axis; 9];
    let mut recorder = Recorder::new(&report.axes);
    let mut state = 1u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    for i in 0..300_000u32 {
        let mut instant = || AxisInstant {
            position: random() * 1e3,
            velocity: random() * 1e3,
            acceleration: random() * 1e4,
            jerk: random() * 1e6,
            drive: Some(DriveInstant { error: random(), effort: random() * 100.0 }),
        };
        let axes: Vec<AxisInstant> = (0..9).map(|_| instant()).collect();
        let limit = Limit::Jerk((i % 9) as u8);
        let (time, speed) = (f64::from(i) * 1e-3, 50.0 + 90.0 * random());
        let mode = Mode::Feed;
        recorder.push(&Instant { time, line: i, mode, limit, speed, feed: Some(80.0), axes: &axes });
    }
    report.motion = recorder.finish();
    let size = page(&report).len();
    assert!(size < 3_000_000, "{size}");
}

#[test]
fn a_job_that_moves_nothing_still_has_a_report() {
    let mut report = sample::report(Kind::Slide, 1);
    report.motion = Recorder::new(&report.axes).finish();
    report.times.motion_s = 0.0;
    report.times.constant_feed_s = 0.0;
    let page = page(&report);
    let visible = &page[..page.find("application/json").unwrap()];
    assert!(!visible.contains("NaN") && !visible.contains("inf "), "{visible}");
}
