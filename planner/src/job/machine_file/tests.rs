use miette::Diagnostic;

use super::*;
use crate::job::machine_error::MachineErrorKind;

const MILL: &str = include_str!("../../../../jobs/mill3.toml");
const ROUTER: &str = include_str!("../../../../jobs/router4.toml");

const SMALL: &str = r#"
tolerance_mm = 0.02
[[axis]]
name = "x"
kind = "linear"
unit = "mm"
counts_per_unit = 1000
travel = [-10, 10]
velocity = 100
acceleration = 1000
jerk = 20000
[[axis]]
name = "C"
kind = "rotary"
unit = "rad"
counts_per_unit = 1e5
travel = [-100, 100]
velocity = 10
acceleration = 100
jerk = 2000
"#;

fn refused(text: &str) -> MachineError {
    Machine::from_toml(text, "m.toml").expect_err("the file is accepted")
}

#[test]
fn the_samples_are_read_as_written() {
    let mill = Machine::from_toml(MILL, "mill3.toml").unwrap();
    assert_eq!(mill.axes.len(), 3);
    assert_eq!(mill.axes[0].limits, AxisLimits { velocity: 250.0, acceleration: 2500.0, jerk: 50_000.0 });
    assert_eq!(mill.home[..3], [0.0, 0.0, 150.0]);
    assert_eq!(mill.tools[2], Tool { number: 3, length_mm: 8.25 });
    let router = Machine::from_toml(ROUTER, "router4.toml").unwrap();
    assert_eq!((router.axes[3].kind, router.axes[3].unit), (AxisKind::Rotary, Unit::Deg));
    assert_eq!(router.axes[0].rapid.velocity, 800.0);
    assert_eq!(router.axes[2].rapid, router.axes[2].limits);
}

#[test]
fn what_is_left_out_is_derived() {
    let m = Machine::from_toml(SMALL, "some/shop.toml").unwrap();
    assert_eq!((m.name.as_str(), m.corner), ("shop", CornerMode::Blend));
    assert_eq!((m.control_tick_s, m.best_speed_mm, m.exact_path_mm), (1e-3, 0.05, 1e-3));
    assert!((m.tolerance_rotary - 0.01_f64.to_radians()).abs() < 1e-15);
    let plant = m.axes[0].plant;
    // 50 kg at 1 m/s^2 and 0.1 m/s: 50 N to accelerate, a twentieth of it for either friction.
    assert_eq!((plant.inertia, plant.coulomb, plant.viscous), (50.0, 2.5, 25.0));
    assert!((plant.effort_limit - 80.0).abs() < 1e-9);
    assert_eq!(plant.encoder_counts_per_count, 1.0);
    let servo = m.axes[1].servo;
    assert!((servo.velocity_bandwidth - 300.0).abs() < 1e-9, "0.3 / 1 ms is below 2 pi 50 Hz");
    assert_eq!(servo.position_gain, servo.velocity_bandwidth / 4.0);
    assert_eq!(m.axes[0].name, "X");
}

/// Replacement in `SMALL`, line, start of the message.
const MISTAKES: &[(&str, &str, u32, &str)] = &[
    ("velocity = 100\n", "velocity = 0\n", 9, "velocity is 0"),
    ("velocity = 100\n", "velocity = -5\n", 9, "velocity is -5"),
    ("velocity = 100\n", "velocity = nan\n", 9, "velocity is NaN"),
    ("jerk = 20000", "jerk = inf", 11, "jerk is inf"),
    ("jerk = 20000", "jerk = \"high\"", 11, "invalid type"),
    ("jerk = 20000", "", 3, "missing field `jerk`"),
    ("jerk = 20000", "jerk = 20000\nsnap = 5", 12, "unknown field `snap`"),
    ("tolerance_mm = 0.02", "tolerance_mm = 0", 2, "tolerance_mm is 0"),
    ("tolerance_mm = 0.02", "control_tick_s = 1", 2, "control_tick_s is 1"),
    ("tolerance_mm = 0.02", "corner = \"round\"", 2, "unknown variant `round`"),
    ("tolerance_mm = 0.02", "tolerance_mm = ", 2, ""),
    ("tolerance_mm = 0.02", "home = { Z = 1 }", 2, "home names axis Z"),
    ("tolerance_mm = 0.02", "home = { X = 11 }", 2, "home of axis X is 11, outside"),
    ("[-10, 10]", "[10, -10]", 8, "travel runs from 10 to -10"),
    ("[-10, 10]", "[10, 20]", 8, "travel 10 to 20 does not contain 0"),
    ("[-10, 10]", "[-1e7, 1e7]", 8, "travel and counts_per_unit give 10000000000 counts"),
    ("unit = \"mm\"", "unit = \"deg\"", 6, "a linear axis cannot be measured in deg"),
    ("name = \"x\"", "name = \"c\"", 13, "axis C is described twice"),
    ("name = \"x\"", "name = \"\"", 4, "axis name \"\" cannot be used"),
    ("jerk = 20000", "jerk = 20000\nplant = { inertia_kg_m2 = 1 }", 12, "inertia_kg_m2 does not belong"),
    ("jerk = 20000", "jerk = 20000\nplant = { mass_kg = 0 }", 12, "mass_kg is 0"),
    ("jerk = 20000", "jerk = 20000\nservo = { velocity_feed_forward = 2 }", 12, "velocity_feed_forward is 2"),
    (
        "jerk = 20000",
        "jerk = 20000\nrapid = { velocity = 1, acceleration = 0, jerk = 1 }",
        12,
        "acceleration is 0",
    ),
];

#[test]
fn every_mistake_has_its_place_and_help() {
    for &(from, to, line, message) in MISTAKES {
        assert!(SMALL.contains(from), "{from}");
        let error = refused(&SMALL.replacen(from, to, 1));
        assert_eq!(error.line(), Some(line), "{to}: {error}");
        let text = error.kind().to_string();
        assert!(text.starts_with(message), "{to}: {text}");
        assert!(error.help().is_some() && error.labels().is_some());
    }
}

#[test]
fn machines_need_one_to_nine_axes() {
    assert_eq!(refused("tolerance_mm = 1").kind(), &MachineErrorKind::NoAxes);
    let axis = |n: usize| {
        SMALL[21..SMALL.find("[[axis]]\nname = \"C\"").unwrap()].replace("\"x\"", &format!("\"J{n}\""))
    };
    let ten: String = (0..10).map(axis).collect();
    assert!(matches!(refused(&ten).kind(), MachineErrorKind::TooManyAxes { count: 10, .. }));
    let twice = format!("{SMALL}[[tool]]\nnumber = 1\nlength_mm = 0\n[[tool]]\nnumber = 1\nlength_mm = 2\n");
    assert_eq!(refused(&twice).kind(), &MachineErrorKind::ToolTwice { number: 1 });
}

#[test]
fn unreadable_files_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let error = Machine::load(folder.path()).unwrap_err();
    assert!(error.to_string().contains("it is a directory"), "{error}");
    assert!(Machine::load(folder.path().join("none.toml")).is_err());
    let zeros = folder.path().join("zeros.toml");
    std::fs::File::create(&zeros).unwrap().set_len(1 << 30).unwrap();
    assert!(matches!(Machine::load(&zeros).unwrap_err().kind(), MachineErrorKind::TooLarge { .. }));
    let binary = folder.path().join("binary.toml");
    std::fs::write(&binary, [0xff, 0xfe, 0x00]).unwrap();
    assert!(matches!(Machine::load(&binary).unwrap_err().kind(), MachineErrorKind::Unreadable { .. }));
}
