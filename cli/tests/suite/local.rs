//! The verbs on the real planner and simulator: what one small job amounts to.

use std::fs;
use std::path::Path;

use cli::local::Local;
use serde_json::Value;

const PROGRAM: &str = "G21 G90 G94 G64 P0.02\n\
                       (MSG, first)\n\
                       G0 X5 Y5 Z2\n\
                       G1 Z0 F600\n\
                       G1 X40 F3000\n\
                       Y20\n\
                       (MSG, second)\n\
                       G3 X30 Y30 R10\n\
                       G1 X5\n\
                       G4 P0.25\n\
                       G1 Y5\n\
                       M30\n";

/// Plays the program; its object and its report.
fn play(folder: &Path) -> (Value, String) {
    let job = folder.join("part.ngc");
    fs::write(&job, PROGRAM).unwrap();
    let out = folder.join("out");
    let words = ["feedspline", "run", job.to_str().unwrap(), "--json", "-o", out.to_str().unwrap()];
    let (mut said, mut err) = (Vec::new(), Vec::new());
    let status = cli::status(words.map(Into::into).to_vec(), &Local, &mut said, &mut err);
    assert_eq!((status, err.len()), (0, 0), "{}", String::from_utf8_lossy(&said));
    (serde_json::from_slice(&said).unwrap(), fs::read_to_string(out.join("report.html")).unwrap())
}

fn sum(list: &Value, field: &str) -> f64 {
    list.as_array().unwrap().iter().map(|entry| entry[field].as_f64().unwrap()).sum()
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-6
}

#[test]
fn the_parts_of_a_job_add_up() {
    let home = tempfile::tempdir().unwrap();
    let (told, report) = play(home.path());
    let number = |name: &str| told[name].as_f64().unwrap();
    assert!(near(sum(&told["binding"], "seconds"), number("motion_time_s")));
    assert!(near(sum(&told["binding"], "share"), 1.0));
    let stops: u64 = told["stops_by_cause"].as_object().unwrap().values().map(|n| n.as_u64().unwrap()).sum();
    assert_eq!(told["stops"].as_u64(), Some(stops));
    assert_eq!(told["stops_by_cause"]["dwell"], 1);

    let operations = &told["operations"];
    let names: Vec<&str> =
        operations.as_array().unwrap().iter().map(|o| o["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["first", "second"]);
    assert!(near(
        ["feed_s", "rapid_s", "dwell_s"].map(|f| sum(operations, f)).iter().sum(),
        number("cycle_time_s")
    ));
    assert!((sum(operations, "feed_length_mm") / number("feed_length_mm") - 1.0).abs() < 0.01);
    // Lines 4 to 6 with 52 mm; the remark of line 7 stands inside the stretch from line 4 to the wait.
    assert!((operations[0]["feed_length_mm"].as_f64().unwrap() - 52.0).abs() < 1.0, "{operations}");
    assert_eq!((&operations[0]["dwell_s"], &operations[1]["dwell_s"]), (&0.0.into(), &0.25.into()));

    let places = told["feed_not_reached"].as_array().unwrap();
    assert!(places.windows(2).all(|w| w[0]["lost_s"].as_f64() >= w[1]["lost_s"].as_f64()));
    assert!(places.iter().all(|p| p["lowest_mm_s"].as_f64() < p["programmed_mm_s"].as_f64()));
    for limit in told["binding"].as_array().unwrap().iter().chain(places) {
        let kind = limit.get("kind").or(limit.get("limited_by")).unwrap().as_str().unwrap();
        assert_eq!(
            limit["axis"].is_string(),
            ["velocity", "acceleration", "jerk"].contains(&kind),
            "{limit}"
        );
    }

    let simulation = &told["simulation"];
    let error = |name: &str| simulation[name].as_f64().unwrap();
    assert!(error("max_contour_error_mm") <= error("max_following_error_mm") * 2.0f64.sqrt());
    assert!(
        error("rms_contour_error_mm") > 0.0 && error("rms_contour_error_mm") < error("max_contour_error_mm")
    );
    let load = simulation["bus"]["load"].as_f64().unwrap();
    assert!(load > 0.0 && load < 1.0 && simulation["bus"]["frames"].as_u64() > Some(10));
    assert!(told["iterations"].as_u64() > Some(0));
    assert!(report.contains("dwell") && report.contains("Contour error, simulated"));
}
