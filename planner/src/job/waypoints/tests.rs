use super::WayPointErrorKind as Kind;
use super::*;
use crate::certificate::certify;
use crate::geometry::grid_path::GridPath;
use crate::geometry::section::SpeedCap;
use crate::job::program::StopCause;
use crate::job::samples::{cat_contour, tooth_raster};
use crate::topp;
use crate::topp::problem::{Problem, Settings};
use miette::Diagnostic;
use proptest::prelude::*;

const ALL_ENDS: [Ends; 4] = [Ends::NotAKnot, Ends::Clamped, Ends::Natural, Ends::Periodic];
const ALL_KNOTS: [Knots; 3] = [Knots::Uniform, Knots::Chord, Knots::Centripetal];

/// X, Y, Z in mm, A and Q1 in deg.
fn machine() -> Machine {
    let axis = |name: &str, unit: &str, counts: u32| {
        let kind = if unit == "mm" { "linear" } else { "rotary" };
        format!(
            "[[axis]]\nname = \"{name}\"\nkind = \"{kind}\"\nunit = \"{unit}\"\ncounts_per_unit = {counts}\n\
             travel = [-400, 400]\nvelocity = 100\nacceleration = 500\njerk = 10000\n"
        )
    };
    let axes =
        [("X", "mm", 1000), ("Y", "mm", 1000), ("Z", "mm", 1600), ("A", "deg", 100), ("Q1", "deg", 1000)];
    let text: String = axes.iter().map(|&(name, unit, counts)| axis(name, unit, counts)).collect();
    Machine::from_toml(&text, "bench.toml").unwrap()
}

fn refusal(text: &str) -> WayPointError {
    read_from(text.as_bytes(), "job.csv", &machine()).expect_err(text)
}

/// Kind, line and column of the refusal of a file.
fn refused(text: &str) -> (Kind, Option<u32>, Option<u32>) {
    let error = refusal(text);
    (error.kind().clone(), error.line(), error.column())
}

fn form(ends: Ends, knots: Knots) -> SplineForm {
    SplineForm { ends, knots, ..SplineForm::default() }
}

/// Position of an axis at a grid step.
fn position(path: &GridPath, axis: usize, at: u64) -> f64 {
    let span = path.breaks.partition_point(|&b| b <= at).clamp(1, path.spans()) - 1;
    path.position(axis, span, (at - path.breaks[span]) as f64 * path.step)
}

/// Everything that holds of any section, checked from its numbers alone.
fn check_section(points: &WayPoints<'_>, section: &Section, periodic: bool) {
    let path = &section.path;
    assert_eq!(path.axes.len(), points.machine.axes.len());
    assert_eq!(path.step.log2().fract(), 0.0);
    assert!(path.breaks.windows(2).all(|w| w[0] < w[1] && w[1] - w[0] < 1 << 29));
    let ends = section.marks.blocks.iter().map(|b| b.until);
    let knots: Vec<u64> = std::iter::once(0).chain(ends).collect();
    assert_eq!(knots.len(), points.count());
    assert_eq!(knots.last(), path.breaks.last());
    assert_eq!(section.marks.caps.last().map(|c| c.until), Some(path.grid_length()));
    for (a, (grid, axis)) in path.axes.iter().zip(&points.machine.axes).enumerate() {
        assert_eq!(grid.controls.len(), path.breaks.len() + 2);
        let fraction = 1.0 / (grid.lsb * axis.counts_per_unit);
        assert!((1.0..=4096.0).contains(&fraction.round()) && (fraction - fraction.round()).abs() < 1e-9);
        for w in grid.controls.windows(2) {
            assert!((w[1].abs_diff(w[0]) as f64) < fraction * f64::from(1u32 << 20));
        }
        let whole = |c: i64| c % fraction.round() as i64 == 0;
        assert!(whole(grid.controls[0]) && whole(grid.controls[grid.controls.len() - 1]));
        for (i, &at) in knots.iter().enumerate() {
            let mut wanted = points.point(i)[a];
            if periodic && i + 1 == knots.len() {
                wanted = points.point(0)[a];
            }
            let miss = (position(path, a, at) - wanted).abs();
            assert!(miss <= 0.5 / axis.counts_per_unit * (1.0 + 1e-9), "axis {a} misses point {i} by {miss}");
        }
    }
    let deviation = &section.marks.deviation;
    assert!(deviation.bound_mm <= deviation.tolerance_mm, "{deviation:?}");
}

#[test]
fn header_names_axes_in_any_order_case_and_unit() {
    let text = "\u{feff}# a comment\n\n y (IN) , x,\"A [deg]\",q1 [rad] \r\n1,2,3,1\r\n # more\n\n 1.5 ,+2e1,-.5,\"0\"";
    let machine = machine();
    let points = read_from(text.as_bytes(), "job.csv", &machine).unwrap();
    assert_eq!(points.count(), 2);
    assert_eq!(points.lines, [4, 7]);
    assert_eq!(points.point(0)[..5], [2.0, 25.4, 0.0, 3.0, 180.0 / std::f64::consts::PI]);
    assert_eq!(points.point(1)[..5], [20.0, 1.5 * 25.4, 0.0, -0.5, 0.0]);
}

#[test]
fn every_mistake_has_its_place() {
    let known = || "X, Y, Z, A, Q1".to_string();
    assert_eq!(refused(""), (Kind::Empty, None, None));
    assert_eq!(refused("\n# only\n"), (Kind::Empty, None, None));
    assert_eq!(refused("1,2\n3,4\n"), (Kind::HeaderMissing { text: "1".into() }, Some(1), Some(1)));
    let unknown = Kind::UnknownAxis { name: "W".into(), known: known() };
    assert_eq!(refused("X, W [mm]\n"), (unknown, Some(1), Some(4)));
    let unknown = Kind::UnknownAxis { name: "X;Y".into(), known: known() };
    assert_eq!(refused("X;Y\n1;2\n"), (unknown, Some(1), Some(1)));
    assert_eq!(refused("X,,Y\n"), (Kind::ColumnName, Some(1), Some(3)));
    assert_eq!(refused("X,Y,x [mm]\n"), (Kind::ColumnTwice { axis: "X".into() }, Some(1), Some(5)));
    assert_eq!(refused("X [ell]\n"), (Kind::UnknownUnit { unit: "ell".into() }, Some(1), Some(1)));
    let unit = Kind::UnitOfKind { axis: "A".into(), kind: "rotary", unit: "mm".into() };
    assert_eq!(refused("X,A [mm]\n"), (unit, Some(1), Some(3)));
    let unit = Kind::UnitOfKind { axis: "X".into(), kind: "linear", unit: "deg".into() };
    assert_eq!(refused("X [deg]\n"), (unit, Some(1), Some(1)));
    assert_eq!(refused("X,Y\n1,2\n3\n"), (Kind::Ragged { found: 1, expected: 2 }, Some(3), Some(1)));
    assert_eq!(refused("X,Y\n1,2,3\n"), (Kind::Ragged { found: 3, expected: 2 }, Some(2), Some(3)));
    let number = |text: &str| Kind::NotANumber { text: text.into() };
    assert_eq!(refused("X,Y\n1, a2\n"), (number("a2"), Some(2), Some(4)));
    assert_eq!(refused("X,Y\n1,\n"), (number(""), Some(2), Some(3)));
    assert_eq!(refused("X\n1\r2\n"), (number("1\r2"), Some(2), Some(1)));
    assert_eq!(refused("X\n1_0\n"), (number("1_0"), Some(2), Some(1)));
    for text in ["NaN", "inf", "-Infinity", "1e999"] {
        let kind = Kind::NotFinite { text: text.into() };
        assert_eq!(refused(&format!("X,Y\n0,0\n0,{text}\n")), (kind, Some(3), Some(3)));
    }
    let outside = Kind::OutsideTravel { axis: "Y".into(), value: 508.0, min: -400.0, max: 400.0 };
    assert_eq!(refused("X,Y [in]\n0,0\n1,20\n"), (outside, Some(3), Some(3)));
    assert_eq!(refused("X,Y\n1,1\n"), (Kind::TooFewPoints { found: 1, least: 2 }, None, None));
    assert_eq!(refused("X,Y\n0,0\n5,1\n\n5,1\n"), (Kind::Repeated { earlier: 3 }, Some(5), None));
    assert_eq!(refused("X\n0\n0.0001\n"), (Kind::Standstill, None, None));
    assert_eq!(refused("X\n\"1\n2\"\n"), (number("2\""), Some(3), Some(1)));
}

#[test]
fn unreadable_files_are_refused() {
    let machine = machine();
    let folder = tempfile::tempdir().unwrap();
    for path in [folder.path().to_path_buf(), folder.path().join("missing.csv")] {
        let error = read(&path, &machine).unwrap_err();
        assert!(matches!(error.kind(), Kind::Unreadable { .. }), "{error}");
    }
}

#[test]
fn garbage_ends_at_the_first_line() {
    let endless = std::io::repeat(0).take(1 << 30);
    let error = read_from(endless, "zeros", &machine()).unwrap_err();
    assert!(matches!(error.kind(), Kind::LineTooLong { .. }) && error.line() == Some(1), "{error}");
    let error = read_from(&b"\x7fELF\xff\xfe,\x80\n1,2\n"[..], "binary", &machine()).unwrap_err();
    assert_eq!(error.kind(), &Kind::NotText);
}

#[test]
fn messages_show_place_text_and_help() {
    let error = refusal("X,Y\n1,2\n1,zwei\n");
    assert_eq!(error.to_string(), "job.csv:3:3: \"zwei\" is not a number");
    assert!(error.help().unwrap().to_string().contains("decimal sign"));
    let label = error.labels().unwrap().next().unwrap();
    let source = error.source_code().unwrap().read_span(label.inner(), 1, 1).unwrap();
    assert_eq!((source.data(), source.line(), label.offset(), label.len()), (&b"1,zwei"[..], 2, 2, 4));
}

#[test]
fn two_points_are_a_straight_line() {
    let machine = machine();
    let points = read_from(&b"X,Y\n0,0\n30,40\n"[..], "line", &machine).unwrap();
    for knots in ALL_KNOTS {
        for ends in [Ends::NotAKnot, Ends::Natural] {
            let section = points.section(&form(ends, knots), None).unwrap();
            check_section(&points, &section, false);
            let path = &section.path;
            assert!((path.length() - 50.0).abs() < 0.01);
            for share in 0..=10 {
                let at = path.grid_length() * share / 10;
                let (x, y) = (position(path, 0, at), position(path, 1, at));
                assert!((x / 3.0 - y / 4.0).abs() < 1e-3);
            }
            assert_eq!(section.marks.end, StopCause::ProgramEnd);
        }
    }
    let periodic = points.section(&form(Ends::Periodic, Knots::Chord), None).unwrap_err();
    assert_eq!(periodic.kind(), &Kind::TooFewPoints { found: 2, least: 3 });
}

#[test]
fn a_long_line_is_divided_for_the_drives() {
    let mut machine = machine();
    machine.axes[0].counts_per_unit = 5e6;
    let points = read_from(&b"X\n-400\n400\n"[..], "line", &machine).unwrap();
    let section = points.section(&SplineForm::default(), None).unwrap();
    check_section(&points, &section, false);
    assert!(section.path.spans() >= 4000 && section.path.spans() < 20_000, "{}", section.path.spans());
}

#[test]
fn the_cat_is_a_section_with_every_spline() {
    let machine = machine();
    let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../jobs/cat2d.csv");
    let points = read(file, &machine).unwrap();
    let drawn = WayPoints::from_rows(cat_contour(3000).unwrap(), [0, 1], "cat", &machine).unwrap();
    assert_eq!((points.count(), drawn.count()), (3000, 3000));
    for ends in ALL_ENDS {
        for knots in ALL_KNOTS {
            let section = points.section(&form(ends, knots), Some(80.0)).unwrap();
            check_section(&points, &section, ends == Ends::Periodic);
            assert!((section.path.length() / 860.0 - 1.0).abs() < 2e-3);
            let spans = if ends == Ends::NotAKnot { 2997 } else { 2999 };
            assert_eq!(section.path.spans(), spans);
            assert_eq!(section.marks.caps[0].speed, SpeedCap::Tangential { axes: 0b111, speed: 80.0 });
            assert_eq!(section.marks.blocks[0].line, 3);
            assert_eq!(section.marks.blocks[2998].line, 3001);
        }
    }
}

#[test]
fn periodic_ends_join_with_equal_slope_and_curvature() {
    let machine = machine();
    let points = WayPoints::from_rows(cat_contour(90).unwrap(), [0, 1], "cat", &machine).unwrap();
    let path = points.section(&form(Ends::Periodic, Knots::Chord), None).unwrap().path;
    let last = path.spans() - 1;
    for axis in 0..2 {
        let (a, b) = (path.piece(axis, 0), path.piece(axis, last));
        // Differences of control points that are half a unit off.
        let (lsb, h) = (path.axes[axis].lsb, a.length.min(b.length));
        assert!((a.first(0.0) - b.first(b.length)).abs() < 6.0 * lsb / h);
        assert!((a.second(0.0) - b.second(b.length)).abs() < 24.0 * lsb / (h * h));
        assert!(a.first(0.0).abs() > 100.0 * lsb / h || a.second(0.0).abs() > 100.0 * lsb / (h * h));
    }
}

#[test]
fn clamped_ends_leave_in_the_given_direction() {
    let machine = machine();
    let points = read_from(&b"X,Y\n0,0\n30,40\n80,10\n"[..], "bend", &machine).unwrap();
    let mut end_slopes = [Point::default(); 2];
    (end_slopes[0][1], end_slopes[1][0]) = (1.0, 0.75);
    let clamped = SplineForm { end_slopes, ..form(Ends::Clamped, Knots::Chord) };
    let path = points.section(&clamped, None).unwrap().path;
    let (start, end) = (path.piece(1, 0), path.piece(0, path.spans() - 1));
    assert!((start.first(0.0) - 1.0).abs() < 1e-4 && path.piece(0, 0).first(0.0).abs() < 1e-4);
    assert!((end.first(end.length) - 0.75).abs() < 1e-4);
    end_slopes[1][0] = f64::NAN;
    let error = points.section(&SplineForm { end_slopes, ..clamped }, None).unwrap_err();
    assert!(matches!(error.kind(), Kind::EndSlope { .. }));
}

#[test]
fn rotary_axes_weigh_as_their_tolerance_beside_linear_ones() {
    let mut machine = machine();
    machine.tolerance_rotary = 0.05;
    let mixed = read_from(&b"X,A\n0,0\n3,20\n0,40\n"[..], "mixed", &machine).unwrap();
    let path = mixed.section(&form(Ends::NotAKnot, Knots::Chord), None).unwrap().path;
    assert!((path.length() - 10.0).abs() < 0.01, "{}", path.length());
    let rotary = read_from(&b"Q1\n0\n1\n-1\n"[..], "rotary", &machine).unwrap();
    let section = rotary.section(&form(Ends::NotAKnot, Knots::Chord), Some(2.0)).unwrap();
    assert!((section.path.length() - 3.0).abs() < 0.01);
    assert_eq!(section.marks.caps[0].speed, SpeedCap::Tangential { axes: 0b11000, speed: 2.0 });
}

#[test]
fn a_path_that_turns_back_is_kept() {
    let machine = machine();
    let points = read_from(&b"X,Y\n0,0\n30,40\n0,0\n30,40\n"[..], "there and back", &machine).unwrap();
    for ends in [Ends::NotAKnot, Ends::Natural, Ends::Clamped] {
        let section = points.section(&form(ends, Knots::Chord), None).unwrap();
        check_section(&points, &section, false);
    }
}

#[test]
fn what_the_spline_cannot_do_is_refused_at_its_line() {
    let machine = machine();
    let refusal = |text: &str, form: &SplineForm, feed| {
        let points = read_from(text.as_bytes(), "job.csv", &machine).unwrap();
        let error = points.section(form, feed).unwrap_err();
        (error.kind().clone(), error.line())
    };
    let open = "X,Y\n0,0\n30,40\n80,10\n";
    let (kind, line) = refusal(open, &form(Ends::Periodic, Knots::Chord), None);
    assert_eq!((kind, line), (Kind::NotClosed { axis: "X".into(), start: 0.0, end: 80.0 }, Some(4)));
    for value in [0.0, -1.0, f64::INFINITY] {
        assert_eq!(refusal(open, &SplineForm::default(), Some(value)).0, Kind::Feed { value });
    }
    let (kind, line) = refusal("X\n0\n399\n399.5\n0\n1\n", &form(Ends::Natural, Knots::Uniform), None);
    assert!(
        matches!(kind, Kind::Overshoot { value, .. } if value > 400.0) && line == Some(4),
        "{kind:?} {line:?}"
    );
    let stall =
        "X,Y\n0,0\n1e-6,0\n2e-6,0\n3e-6,0\n4e-6,0\n5e-6,0\n6e-6,0\n7e-6,0\n8e-6,0\n9e-6,0\n1e-5,0\n200,300\n";
    let (kind, line) = refusal(stall, &form(Ends::Clamped, Knots::Uniform), None);
    assert!(matches!(kind, Kind::Stall { .. }), "{kind:?} {line:?}");
}

/// Way-points on a circle of radius 20 mm, written with so many decimals.
fn circle(count: usize, decimals: usize) -> String {
    let angle = |i: usize| std::f64::consts::TAU * i as f64 / (count - 1) as f64;
    let row = |i: usize| {
        let (y, x) = angle(i).sin_cos();
        format!("{:.decimals$},{:.decimals$}\n", 20.0 * x - 20.0, 20.0 * y)
    };
    "X,Y\n".to_owned() + &(0..count).map(row).collect::<String>()
}

/// Distance of a way-point from a path, by looking at many places of it.
fn sampled_distance(path: &GridPath, point: &Point, samples: u64) -> f64 {
    let end = path.grid_length();
    let at = |k: u64| (u128::from(end) * u128::from(k) / u128::from(samples)) as u64;
    (0..=samples)
        .map(|k| (0..2).map(|a| (position(path, a, at(k)) - point[a]).powi(2)).sum::<f64>().sqrt())
        .fold(f64::INFINITY, f64::min)
}

#[test]
fn dense_way_points_need_few_knots() {
    let machine = machine();
    for (decimals, most) in [(3, 700), (6, 100), (12, 100)] {
        let text = circle(3000, decimals);
        let points = read_from(text.as_bytes(), "circle.csv", &machine).unwrap();
        assert_eq!(points.resolution_mm(), 1e-3, "{decimals} decimals");
        for ends in ALL_ENDS {
            let exact = form(ends, Knots::Chord);
            let near = SplineForm { tolerance_mm: points.resolution_mm(), ..exact };
            let section = points.section(&near, None).unwrap();
            assert!(section.path.spans() < most, "{} spans with {decimals} decimals", section.path.spans());
            let deviation = section.marks.deviation;
            assert!(deviation.bound_mm <= 1e-3, "{deviation:?}");
            for i in (0..points.count()).step_by(97) {
                let found = sampled_distance(&section.path, &points.point(i), 20_000);
                // Samples are up to 7 um apart: at most half of that along the path.
                assert!(found <= deviation.bound_mm.hypot(3.6e-3), "{i}: {found} {deviation:?}");
            }
            assert_eq!(section.marks.blocks.len(), points.count() - 1);
            assert!(points.section(&exact, None).unwrap().path.spans() >= points.count() - 3);
        }
    }
}

#[test]
fn rough_way_points_are_all_knots() {
    let machine = machine();
    let rows = (0..400).map(|i| [f64::from(i) * 0.2, if i % 2 == 0 { 0.0 } else { 0.3 }]);
    let points = WayPoints::from_rows(rows, [0, 1], "zigzag.csv", &machine).unwrap();
    let near = SplineForm { tolerance_mm: 1e-3, ..form(Ends::Natural, Knots::Chord) };
    assert_eq!(points.section(&near, None).unwrap().path.spans(), 399);
}

#[test]
fn the_last_digit_counts_as_far_as_it_is_fine() {
    let machine = machine();
    let resolution = |text: &str| read_from(text.as_bytes(), "job.csv", &machine).unwrap().resolution_mm();
    let tolerance = machine.tolerance_mm;
    // Whole millimetres are exact positions, not ones within a millimetre.
    assert_eq!(resolution("X,Y\n0,0\n10,3\n20,5\n"), 0.1 * tolerance);
    assert_eq!(resolution("X,Y\n0,0\n10.001,3.25\n20,5\n"), 1e-3f64.max(0.1 * tolerance));
    assert_eq!(resolution("X,Y\n0,0\n1.00012e1,3.25001\n20,5\n"), 1e-3);
}

#[test]
fn rows_from_memory_are_checked_too() {
    let machine = machine();
    let kind = |rows: &[[f64; 2]], axes| {
        let error = WayPoints::from_rows(rows.iter().copied(), axes, "rows", &machine).unwrap_err();
        (error.kind().clone(), error.line())
    };
    assert!(matches!(kind(&[[0.0; 2]], [0, 9]).0, Kind::UnknownAxis { .. }));
    assert!(matches!(kind(&[[0.0; 2]], [1, 1]).0, Kind::ColumnTwice { .. }));
    assert!(matches!(kind(&[[0.0; 2], [1.0, f64::NAN]], [0, 1]), (Kind::NotFinite { .. }, Some(2))));
    assert!(matches!(kind(&[[0.0; 2], [1.0, 401.0]], [0, 1]), (Kind::OutsideTravel { .. }, Some(2))));
}

#[test]
fn a_tooth_raster_is_one_section() {
    let machine = machine();
    let points = WayPoints::from_rows(tooth_raster(30, 100), [0, 1, 2], "tooth", &machine).unwrap();
    for knots in ALL_KNOTS {
        let section = points.section(&form(Ends::NotAKnot, knots), None).unwrap();
        check_section(&points, &section, false);
    }
}

#[test]
fn sections_can_be_planned_and_certified() {
    let machine = machine();
    let limits: Vec<_> = machine.axes.iter().map(|a| a.limits).collect();
    let settings = Settings { relative_gap: 1e-3, spans_per_ramp: 2.0, ..Settings::default() };
    let cat = WayPoints::from_rows(cat_contour(60).unwrap(), [0, 1], "cat", &machine).unwrap();
    let tooth = WayPoints::from_rows(tooth_raster(4, 25), [0, 1, 2], "tooth", &machine).unwrap();
    let back = read_from(&b"X,Y\n0,0\n30,40\n0,0\n30,40\n"[..], "there and back", &machine).unwrap();
    for (points, ends) in [(cat, Ends::Periodic), (tooth, Ends::NotAKnot), (back, Ends::Natural)] {
        for knots in ALL_KNOTS {
            let Section { path, marks, .. } = points.section(&form(ends, knots), Some(60.0)).unwrap();
            let problem = Problem {
                path: &path,
                limits: &limits,
                caps: &marks.caps,
                control_tick_s: machine.control_tick_s,
            };
            let table = topp::plan(&problem, &settings).unwrap().table;
            let certificate = certify(&table, &limits, &marks.caps);
            assert!(certificate.holds, "{knots:?} {certificate:?}");
        }
    }
}

/// Random walks with steps over four decades, in one to three axes.
fn walks() -> impl Strategy<Value = Vec<[f64; 3]>> {
    let step = (-2.0..2.0f64, prop::array::uniform3(-1.0..1.0f64));
    (1usize..=3, prop::collection::vec(step, 1..60)).prop_map(|(axes, steps)| {
        let mut at = [0.0; 3];
        let walk = steps.into_iter().map(|(size, direction)| {
            for a in 0..axes {
                at[a] = (at[a] + 10f64.powf(size) * direction[a]).clamp(-300.0, 300.0);
            }
            at
        });
        std::iter::once([0.0; 3]).chain(walk).collect()
    })
}

proptest! {
    /// A section that holds what it promises, or one of the refusals that depend on the shape.
    #[test]
    fn any_walk_gives_a_sound_section_or_a_reason(
        walk in walks(),
        ends in prop::sample::select(ALL_ENDS.to_vec()),
        knots in prop::sample::select(ALL_KNOTS.to_vec()),
    ) {
        let mut machine = machine();
        // So fine that spans have to be divided for the drives.
        machine.axes[1].counts_per_unit = 5e6;
        let mut walk = walk;
        if ends == Ends::Periodic {
            walk.push([0.0; 3]);
        }
        let points = match WayPoints::from_rows(walk, [0, 1, 2], "walk", &machine) {
            Ok(points) => points,
            Err(error) => {
                let expected = matches!(error.kind(), Kind::Repeated { .. } | Kind::Standstill);
                prop_assert!(expected, "{error}");
                return Ok(());
            }
        };
        match points.section(&form(ends, knots), None) {
            Ok(section) => check_section(&points, &section, ends == Ends::Periodic),
            Err(error) => {
                let expected = matches!(
                    error.kind(),
                    Kind::Overshoot { .. } | Kind::Stall { .. } | Kind::TooFewPoints { .. }
                );
                prop_assert!(expected, "{error}");
                let placed = matches!(error.kind(), Kind::TooFewPoints { .. }) || error.line().is_some();
                prop_assert!(placed, "{error}");
            }
        }
    }

    /// No file makes the reader panic, and what it refuses it can show.
    #[test]
    fn any_bytes_are_read_or_refused(
        header in prop::sample::select(vec!["X,Y", "\"X [mm]\" ,a(rad)", "Y", "Z [", "\u{feff}X"]),
        body in prop::collection::vec(prop::sample::select(b"0159.,,-e\"\n\n\r# \xff\xc3".to_vec()), 0..80),
        stray in prop::collection::vec(any::<u8>(), 0..6),
    ) {
        let machine = machine();
        let file = [header.as_bytes(), b"\n", &body, &stray].concat();
        match read_from(file.as_slice(), "job.csv", &machine) {
            Ok(points) => prop_assert!(points.values.iter().all(|v| v.abs() <= 400.0) && points.count() >= 2),
            Err(error) => {
                prop_assert!(error.help().is_some());
                if let (Some(source), Some(mut labels)) = (error.source_code(), error.labels()) {
                    let label = labels.next().unwrap();
                    prop_assert!(source.read_span(label.inner(), 0, 0).is_ok(), "{error}");
                }
            }
        }
    }
}
