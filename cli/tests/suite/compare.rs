//! `compare` on the real planner, and its page.

use std::f64::consts::TAU;
use std::fs;

use cli::report::compare::page;
use serde_json::Value;

use crate::points::{RADIUS, circle, tell};
use crate::sample;

/// The entry of a method.
fn method<'a>(told: &'a Value, name: &str) -> &'a Value {
    let found = told["methods"].as_array().unwrap().iter().find(|m| m["method"] == name);
    found.unwrap_or_else(|| panic!("{name} is not in {told}"))
}

fn number(value: &Value, name: &str) -> f64 {
    value[name].as_f64().unwrap_or_else(|| panic!("{name} is no number in {value}"))
}

#[test]
fn methods_on_a_circle_come_out_in_their_order() {
    let home = tempfile::tempdir().unwrap();
    let file = home.path().join("ring.csv");
    fs::write(&file, circle()).unwrap();
    let told = tell(home.path(), "compare", &file, &["--spline", "periodic"]);
    let names: Vec<&str> =
        told["methods"].as_array().unwrap().iter().map(|m| m["method"].as_str().unwrap()).collect();
    let all = "whole zhao overlap constant-feed pseudo-jerk no-jerk sweep clarabel collocation";
    assert_eq!(names, all.split(' ').collect::<Vec<_>>());
    let time = |name: &str| number(method(&told, name), "traverse_time_s");
    let whole = time("whole");
    assert!((number(&told, "feed_length_mm") / (TAU * RADIUS) - 1.0).abs() < 1e-4);
    assert_eq!(number(method(&told, "whole"), "over_whole"), 0.0);
    for name in ["zhao", "overlap", "clarabel"] {
        assert!((time(name) / whole - 1.0).abs() < 2e-3, "{name}: {}", time(name));
    }
    assert!(time("no-jerk") < whole && time("pseudo-jerk") > whole && time("collocation") < whole * 1.001);
    assert!((time("sweep") / time("no-jerk") - 1.0).abs() < 0.01);

    // One speed all round: (A R)^(1/2) is 250 mm/s, (J R^2)^(1/3) is 315 mm/s, the axes allow 250 mm/s.
    let steady = method(&told, "constant-feed");
    assert!((number(steady, "constant_feed_mm_s") / 250.0 - 1.0).abs() < 0.01, "{steady}");
    assert!(time("constant-feed") > whole * 0.999);
    assert!(time("constant-feed") > TAU * RADIUS / 250.0);

    for m in told["methods"].as_array().unwrap() {
        let name = m["method"].as_str().unwrap();
        match name {
            "sweep" => assert_eq!((&m["state"], &m["certified"]), (&"timed".into(), &Value::Null)),
            "collocation" => assert!(number(m, "jerk_ratio") > 0.9),
            _ => assert_eq!((&m["state"], &m["certified"]), (&"planned".into(), &true.into()), "{name}"),
        }
        assert!(number(m, "compute_seconds") > 0.0);
        if name != "sweep" {
            let shares: f64 = m["binding"].as_array().unwrap().iter().map(|b| number(b, "share")).sum();
            assert!((shares - 1.0).abs() < 1e-9, "{name}");
        }
    }
    // What the plan without a jerk limit would ask of the machine.
    assert!(number(method(&told, "no-jerk"), "jerk_ratio") > 1.5);
}

#[test]
fn methods_are_chosen_and_a_program_compares_its_feed_moves() {
    let home = tempfile::tempdir().unwrap();
    let file = home.path().join("part.ngc");
    fs::write(&file, "G21 G90 G94 G64 P0.02\nG0 X50\nG1 X90 F1200\nY20\nG0 X0\nG4 P0.2\nG1 X20 F6000\nM30\n")
        .unwrap();
    let words = ["--methods", "overlap,whole,overlap", "--threads", "2"];
    let told = tell(home.path(), "compare", &file, &words);
    let names: Vec<&str> =
        told["methods"].as_array().unwrap().iter().map(|m| m["method"].as_str().unwrap()).collect();
    assert_eq!(names, ["overlap", "whole"]);
    assert_eq!((&told["job_kind"], &told["sections"]), (&"program".into(), &2.into()));
    // 60 mm at 20 mm/s, 20 mm at 100 mm/s: neither rapids nor the wait count.
    let whole = method(&told, "whole");
    let time = number(whole, "traverse_time_s");
    assert!(time > 60.0 / 20.0 + 20.0 / 100.0 && time < 3.8, "{time}");
    assert!(number(whole, "lost_s") > 0.0 && number(whole, "feed_ratio") <= 1.000_001);
    assert!((number(&told, "feed_length_mm") - 80.0).abs() < 0.1);
    let apart = tell(home.path(), "compare", &file, &["--methods", "constant-feed"]);
    let steady = method(&apart, "constant-feed");
    // No programmed feed may be exceeded; the rounded corner bends more than 20 mm/s can take.
    assert!(number(steady, "constant_feed_mm_s") <= 20.0);
    assert_eq!(steady["over_whole"], Value::Null);
}

#[test]
fn the_page_refers_to_nothing_outside_and_keeps_hostile_names_text() {
    let plain = page(&sample::compared());
    for outside in
        ["http:", "https:", "//cdn", "<link", "src=", "href=", "url(", "@import", "fetch(", "XMLHttp"]
    {
        assert!(!plain.contains(outside), "{outside}");
    }
    for text in ["<script>alert(1)</script>", "</title></style>]]>--><svg/onload=alert(4)>"] {
        let mut compared = sample::compared();
        compared.json.job = text.into();
        compared.json.machine = text.into();
        compared.json.methods[3].remark = Some(text.into());
        compared.json.methods[0].method = text.into();
        for axis in &mut compared.axes {
            (axis.name, axis.unit) = (text.into(), text.into());
        }
        let page = page(&compared);
        assert!(!page.contains(text), "{text}");
        for tag in ["<script", "</script", "<svg", "</style", "</title"] {
            assert_eq!(page.matches(tag).count(), plain.matches(tag).count(), "{tag} from {text}");
        }
    }
}

#[test]
fn the_page_holds_every_method_and_the_motion_of_those_that_have_one() {
    let page = page(&sample::compared());
    for text in ["whole", "zhao", "sweep", "left out: takes minutes", "\u{2717} no", "\u{2713} yes", "2.4000"]
    {
        assert!(page.contains(text), "{text}");
    }
    let start = page.find("application/json\">").unwrap() + "application/json\">".len();
    let end = start + page[start..].find("</script>").unwrap();
    let data: Value = serde_json::from_str(&page[start..end]).unwrap();
    let names: Vec<&str> =
        data["methods"].as_array().unwrap().iter().map(|m| m["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["whole", "zhao", "collocation"]);
    for m in data["methods"].as_array().unwrap() {
        let intervals = m["time"]["d"].as_array().unwrap().len();
        for axis in m["axes"].as_array().unwrap() {
            assert_eq!(axis.as_array().unwrap().len(), 3);
            assert!(axis.as_array().unwrap().iter().all(|s| s["d"].as_array().unwrap().len() == intervals));
        }
    }
}
