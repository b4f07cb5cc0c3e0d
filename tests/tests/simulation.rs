//! Jobs played to their end by the drive core on the simulated bus, with servos and plants behind it.
#![allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use std::f64::consts::PI;

use host_sim::bus::{BitTiming, FrameSize, InProcessBus, Recorder};
use host_sim::host_node::HostError;
use host_sim::report::SimReport;
use host_sim::scenario::{Loss, SimError, SimSettings, simulate, simulate_on};
use host_sim::trace::{CsvTrace, PlotTrace, Quantity, Rows};
use planner::feed::job::{JobItem, PlannedSection};
use planner::feed::table::FeedTable;
use planner::geometry::grid_path::{GridAxis, GridPath};
use planner::geometry::section::{Deviation, Marks};
use planner::job::machine::{
    Axis, AxisKind, AxisLimits, CornerMode, MAX_AXES, Machine, OverrideRule, Plant, Servo, TwoMass, Unit,
};
use planner::job::program::{MoveKind, StopCause};

const STEP: f64 = 1.0 / 1024.0;
const COUNTS_PER_UNIT: f64 = 1000.0;
const JERK: f64 = 20_000.0;

fn axis(name: &str, unit: Unit) -> Axis {
    // What the jobs below need: drives refuse tables that break their limits.
    let limits = AxisLimits { velocity: 300.0, acceleration: 2500.0, jerk: 50.0 * JERK };
    Axis {
        name: name.into(),
        kind: if unit == Unit::Mm { AxisKind::Linear } else { AxisKind::Rotary },
        unit,
        counts_per_unit: COUNTS_PER_UNIT,
        travel: [-1000.0, 1000.0],
        limits,
        rapid: limits,
        headroom: [1.0; 3],
        plant: Plant {
            inertia: if unit == Unit::Mm { 30.0 } else { 0.5 },
            viscous: if unit == Unit::Mm { 40.0 } else { 0.1 },
            coulomb: if unit == Unit::Mm { 15.0 } else { 0.4 },
            effort_limit: if unit == Unit::Mm { 600.0 } else { 60.0 },
            encoder_counts_per_count: 4.0,
            two_mass: None,
        },
        servo: Servo {
            position_gain: 50.0,
            velocity_bandwidth: 300.0,
            integral_time_s: 0.015,
            velocity_feed_forward: 1.0,
            acceleration_feed_forward: 1.0,
        },
    }
}

fn machine() -> Machine {
    Machine {
        name: "test mill".into(),
        control_tick_s: 1e-3,
        tolerance_mm: 0.01,
        tolerance_rotary: 0.01,
        best_speed_mm: 0.05,
        exact_path_mm: 0.001,
        corner: CornerMode::Blend,
        axes: vec![axis("X", Unit::Mm), axis("Y", Unit::Mm), axis("A", Unit::Deg)],
        home: [0.0; MAX_AXES],
        second_home: [0.0; MAX_AXES],
        tools: Vec::new(),
        override_rule: OverrideRule::default(),
    }
}

/// Lengths of q spans that grow away from both ends [grid steps].
fn graded_steps(length: f64) -> Vec<u32> {
    let mut half = Vec::new();
    let (mut step, mut sum) = (0.01f64, 0.0);
    while sum + step < 0.5 * length {
        half.push((step / STEP).round() as u32);
        sum += step;
        step = (1.5 * step).min(1.0);
    }
    let back: Vec<u32> = half.iter().rev().copied().collect();
    half.into_iter().chain(back).collect()
}

/// A motion along `curve(u)`, u from 0 to about `length`: jerk-limited at the ends, at most `speed` in u per second.
fn section(length: f64, speed: f64, curve: impl Fn(f64) -> [f64; 3]) -> PlannedSection {
    let steps = graded_steps(length);
    let n = steps.len();
    let mut at = vec![0u64];
    for step in &steps {
        at.push(at[at.len() - 1] + u64::from(*step));
    }
    let length = at[n] as f64 * STEP;
    let kept = |i: &usize| i.is_multiple_of(4) || *i == n;
    let breaks: Vec<u64> = (0..=n).filter(kept).map(|i| at[i]).collect();

    let knot = |i: isize| breaks[i.clamp(0, breaks.len() as isize - 1) as usize] as f64 * STEP;
    let greville = |i: isize| (knot(i - 2) + knot(i - 1) + knot(i)) / 3.0;
    let lsb = 1.0 / COUNTS_PER_UNIT / 16.0;
    let controls = |axis: usize| {
        let point = |i| (curve(greville(i))[axis] / lsb).round() as i64;
        GridAxis { lsb, controls: (0..breaks.len() as isize + 2).map(point).collect() }
    };
    let axes = (0..3).map(controls).collect();

    // A start with constant jerk has q = (6^(4/3)/4) J^(2/3) u^(4/3).
    let launch = 6f64.powf(4.0 / 3.0) / 4.0 * JERK.powf(2.0 / 3.0);
    let q = |u: f64| 1.0 / (1.0 / (speed * speed) + 1.0 / (launch * u.min(length - u).powf(4.0 / 3.0)));
    let q_scale = (1.1 * speed * speed / f64::from(u16::MAX).powi(2)) as f32;
    let code = |knots: u64, of: f64| (q(knots as f64 * STEP / of) / f64::from(q_scale)).sqrt().round() as u32;
    let codes = (1..n - 1).map(|i| match i {
        1 => code(at[1], 1.0),
        _ if i == n - 2 => code(at[n - 1], 1.0),
        _ => code(at[i] + at[i + 1], 2.0),
    });
    let codes = codes.collect();
    PlannedSection {
        kind: MoveKind::Feed,
        limits: machine().axes.iter().map(|a| a.limits).collect(),
        table: FeedTable { path: GridPath { step: STEP, breaks, axes }, steps, q_scale, codes },
        marks: Marks {
            caps: Vec::new(),
            blocks: Vec::new(),
            deviation: Deviation { tolerance_mm: 0.01, bound_mm: 0.0, line: 1 },
            end: StopCause::ProgramEnd,
        },
    }
}

fn end_of(section: &PlannedSection) -> [f64; 3] {
    [0, 1, 2].map(|i: usize| {
        let axis: &GridAxis = &section.table.path.axes[i];
        axis.controls[axis.controls.len() - 1] as f64 * axis.lsb
    })
}

/// A line, a wait, a wavy circle with the table turning, and the way back.
fn job() -> Vec<JobItem> {
    let line = section(40.0, 80.0, |u| [u, 0.75 * u, 0.0]);
    let from = end_of(&line);
    let round = section(120.0, 100.0, |u| {
        let a = 2.0 * PI * u / 120.0;
        let wave = 0.3 * (7.0 * a).sin();
        [from[0] + 20.0 * a.sin() + wave, from[1] + 20.0 * (1.0 - a.cos()), 45.0 * (1.0 - (0.5 * a).cos())]
    });
    let from = end_of(&round);
    let home = section(60.0, 150.0, |u| from.map(|x| x * (1.0 - u / 60.0)));
    vec![
        JobItem::Note { text: "pocket".into(), line: 1 },
        JobItem::Section(line),
        JobItem::Dwell { seconds: 0.25, line: 2 },
        JobItem::Section(round),
        JobItem::Section(home),
    ]
}

fn attempt(job: &[JobItem], machine: &Machine, settings: &SimSettings) -> Result<SimReport, SimError> {
    simulate(job, machine, settings, &mut (), &mut |_| {})
}

fn play(machine: &Machine, settings: &SimSettings) -> SimReport {
    attempt(&job(), machine, settings).unwrap()
}

#[test]
fn drives_follow_the_plan_to_the_count_and_end_on_it_at_rest() {
    let report = play(&machine(), &SimSettings::default());
    assert!(report.at_end);
    for axis in &report.axes {
        assert_eq!(axis.end_counts, axis.programmed_end_counts);
        assert!(axis.settled_error.abs() < 2e-3, "{axis:?}");
    }
    assert!(report.max_path_deviation_counts <= 1.0, "{} counts", report.max_path_deviation_counts);
    assert!(report.setpoints >= 3 * (report.motion_s / 1e-3) as u64);
    assert_eq!(report.bus.resent_blocks + report.bus.aborted_starts, 0);
}

#[test]
fn time_adds_up() {
    let report = play(&machine(), &SimSettings::default());
    assert_eq!(report.dwell_s, 0.25);
    let sum = report.motion_s + report.dwell_s + report.handover_s;
    assert!((report.cycle_time_s - sum).abs() < 1e-9);
    // Tables are sent while others play: between two of them lie whole ticks and the handover only.
    assert!(report.handover_s <= 3.0 * 4e-3, "{} s", report.handover_s);
    let settled = report.ticks as f64 * 1e-3 - report.cycle_time_s;
    assert!((settled - 0.2).abs() < 3e-3);
}

#[test]
fn two_runs_are_the_same_and_the_bus_does_not_matter_to_the_setpoints() {
    let machine = machine();
    let first = play(&machine, &SimSettings::default());
    assert_eq!(first, play(&machine, &SimSettings::default()));
    let fd = BitTiming { format: FrameSize::Fd, ..BitTiming::default() };
    let slow = BitTiming { nominal: 125_000, ..BitTiming::default() };
    for bus in [fd, slow] {
        let other = play(&machine, &SimSettings { bus, ..SimSettings::default() });
        assert_eq!((other.setpoints, other.setpoint_hash), (first.setpoints, first.setpoint_hash));
        assert!(other.at_end);
        assert_ne!(other.bus.frames, first.bus.frames);
    }
}

#[test]
fn lost_frames_cost_time_but_change_nothing() {
    let machine = machine();
    let clean = play(&machine, &SimSettings::default());
    for seed in 0..10 {
        let loss = Some(Loss { share: 0.02, seed });
        let lossy = play(&machine, &SimSettings { loss, ..SimSettings::default() });
        assert!(lossy.at_end && lossy.bus.resent_blocks > 0);
        assert_eq!((lossy.setpoints, lossy.setpoint_hash), (clean.setpoints, clean.setpoint_hash));
    }
}

#[test]
fn a_dead_bus_is_an_error_that_names_the_axis() {
    let loss = Some(Loss { share: 1.0, seed: 1 });
    let result = attempt(&job(), &machine(), &SimSettings { loss, ..SimSettings::default() });
    assert!(matches!(result, Err(SimError::Host(HostError::Silent { axis: 0 }))), "{result:?}");
}

#[test]
fn a_clock_that_never_agrees_is_an_error_that_names_its_axis() {
    use host_sim::bus::{Fate, Meddler, NodeIndex};
    // The second drive gets no times of SYNCs.
    let mut bus = Meddler::new(InProcessBus::new(BitTiming::default()), |node, received| {
        if node == NodeIndex(1) && received.frame.id() == 0x012 { Fate::Lose } else { Fate::Pass }
    });
    let settings = SimSettings::default();
    let error = simulate_on(&mut bus, &job(), &machine(), &settings, &mut (), &mut |_| {}).unwrap_err();
    assert!(matches!(error, SimError::Host(HostError::Unready { axis: 1, .. })), "{error:?}");
    assert!(error.to_string().contains("clock"), "{error}");
}

#[test]
fn drives_of_every_tick_come_to_agree() {
    for tick_s in [1e-4, 2.5e-4, 3e-4, 5e-4, 7e-4, 1e-3, 2e-3, 3e-3] {
        let machine = Machine { control_tick_s: tick_s, ..machine() };
        assert!(play(&machine, &SimSettings::default()).at_end, "{tick_s}");
        attempt(&[JobItem::Dwell { seconds: 0.1, line: 1 }], &machine, &SimSettings::default()).unwrap();
    }
}

#[test]
fn a_table_beyond_the_drives_limits_is_refused_by_name() {
    let mut job = job();
    let JobItem::Section(section) = &mut job[3] else { panic!("a section") };
    section.limits[1].acceleration *= 1.01;
    let error = attempt(&job, &machine(), &SimSettings::default()).unwrap_err();
    assert_eq!(error.to_string(), "axis 1 refuses table 1: Limits");
}

#[test]
fn a_section_that_does_not_start_where_the_last_one_ended_is_refused() {
    let mut job = job();
    job.remove(3);
    let error = attempt(&job, &machine(), &SimSettings::default()).unwrap_err().to_string();
    assert!(error.contains("refuses table 1: Position"), "{error}");
}

#[test]
fn exact_feed_forward_on_an_ideal_machine_leaves_microns() {
    let mut ideal = machine();
    for axis in &mut ideal.axes {
        axis.plant.viscous = 0.0;
        axis.plant.coulomb = 0.0;
        axis.plant.encoder_counts_per_count = 1000.0;
    }
    let report = play(&ideal, &SimSettings::default());
    assert!(report.max_following_error_mm < 3e-3, "{} mm", report.max_following_error_mm);
    let mut lazy = ideal.clone();
    for axis in &mut lazy.axes {
        axis.servo.velocity_feed_forward = 0.0;
    }
    let lagging = play(&lazy, &SimSettings::default());
    assert!(lagging.max_following_error_mm > 1.0);
    assert_eq!(lagging.setpoint_hash, report.setpoint_hash);
    // The lag is along the path: little of it is seen across.
    assert!(lagging.max_contour_error_mm < 0.2 * lagging.max_following_error_mm);
}

#[test]
fn an_elastic_coupling_shows_in_the_following_error() {
    let rigid = play(&machine(), &SimSettings::default());
    let mut soft = machine();
    for axis in &mut soft.axes {
        axis.plant.two_mass = Some(TwoMass { load_share: 0.5, frequency_hz: 25.0, damping: 0.02 });
    }
    let elastic = play(&soft, &SimSettings::default());
    assert!(elastic.max_following_error_mm > 2.0 * rigid.max_following_error_mm);
    assert_eq!(elastic.setpoint_hash, rigid.setpoint_hash);
}

#[test]
fn a_weak_motor_saturates_and_says_so() {
    let mut weak = machine();
    weak.axes[0].plant.effort_limit = 30.0;
    let report = play(&weak, &SimSettings::default());
    assert!(report.axes[0].saturated_share > 0.01 && report.axes[1].saturated_share == 0.0);
    assert!(report.axes[0].max_effort <= 30.0 && report.axes[0].effort_share <= 1.0);
}

#[test]
fn traces_hold_every_tick_or_as_many_as_asked() {
    let (job, machine, settings) = (job(), machine(), SimSettings::default());
    let (mut csv, mut plot) = (CsvTrace::new(Vec::new(), Rows::All), PlotTrace::new(500));
    let report = simulate(&job, &machine, &settings, &mut (&mut csv, &mut plot), &mut |_| {}).unwrap();
    let text = String::from_utf8(csv.into_inner()).unwrap();
    assert_eq!(text.lines().count() as u64, 1 + report.ticks);
    let peak = |m: f64, e: host_sim::trace::Extremes| m.max(e.max).max(-e.min);
    let peak = plot.axes()[0].series(Quantity::FollowingError).fold(0.0, peak);
    assert!((peak - report.axes[0].max_following_error).abs() < 1e-12);

    let mut thin = CsvTrace::new(Vec::new(), Rows::AtMost(1000));
    simulate(&job, &machine, &settings, &mut thin, &mut |_| {}).unwrap();
    let rows = String::from_utf8(thin.into_inner()).unwrap().lines().count();
    assert!((500..=1002).contains(&rows), "{rows}");
}

#[test]
fn the_bus_log_shows_every_frame() {
    let (job, machine, settings) = (job(), machine(), SimSettings::default());
    let mut bus = Recorder::new(InProcessBus::new(settings.bus), settings.bus.format, "can0", Vec::new());
    let report = simulate_on(&mut bus, &job, &machine, &settings, &mut (), &mut |_| {}).unwrap();
    let log = String::from_utf8(bus.finish().unwrap()).unwrap();
    assert_eq!(log.lines().count() as u64, report.bus.frames);
    assert!(log.lines().all(|l| l.starts_with('(') && l.contains(" can0 ")));
}

#[test]
fn simulation_is_much_faster_than_the_machine() {
    // Back and forth, two minutes of motion of three elastic axes at 1 kHz.
    let mut soft = machine();
    for axis in &mut soft.axes {
        axis.plant.two_mass = Some(TwoMass { load_share: 0.5, frequency_hz: 60.0, damping: 0.05 });
    }
    let there = |u: f64| [u, 0.5 * u, 0.25 * u];
    let out = section(100.0, 100.0, there);
    let reach = end_of(&out)[0];
    let back = section(100.0, 100.0, |u| there(reach - u));
    let job: Vec<JobItem> =
        (0..96).map(|i| JobItem::Section(if i % 2 == 0 { out.clone() } else { back.clone() })).collect();
    let began = std::time::Instant::now();
    let report = attempt(&job, &soft, &SimSettings::default()).unwrap();
    let speed = report.cycle_time_s / began.elapsed().as_secs_f64();
    assert!(report.at_end && report.cycle_time_s > 110.0);
    assert!(speed > 20.0, "{speed} times real time");
    println!("{speed:.0} times real time");
}

#[test]
fn tables_shorter_than_their_sending_wait_for_the_bus_and_say_so() {
    let out = section(0.5, 50.0, |u| [u, 0.0, 0.0]);
    let reach = end_of(&out)[0];
    let back = section(0.5, 50.0, |u| [reach - u, 0.0, 0.0]);
    let mut job: Vec<JobItem> =
        (0..12).map(|i| JobItem::Section(if i % 2 == 0 { out.clone() } else { back.clone() })).collect();
    job.push(JobItem::Dwell { seconds: 0.1, line: 9 });
    let slow = BitTiming { nominal: 125_000, ..BitTiming::default() };
    let report = attempt(&job, &machine(), &SimSettings { bus: slow, ..SimSettings::default() }).unwrap();
    assert!(report.at_end && report.dwell_s == 0.1);
    assert!(report.handover_s > 12.0 * 0.02, "{} s", report.handover_s);
    let quick = attempt(&job, &machine(), &SimSettings::default()).unwrap();
    assert!(quick.handover_s < report.handover_s && quick.setpoint_hash == report.setpoint_hash);
}

#[test]
fn the_end_point_is_rounded_as_the_format_says() {
    // Control points are sixteenths of a count; the half of a negative count goes up as that of a positive one.
    let mut section = section(10.0, 50.0, |u| [-u, u, 0.0]);
    let last = section.table.path.axes[0].controls.len() - 1;
    section.table.path.axes[0].controls[last] = -16 * 9900 - 8;
    section.table.path.axes[1].controls[last] = 16 * 9900 + 8;
    // The last half count is a jolt that no real limit would allow.
    let mut machine = machine();
    section.limits.fill(AxisLimits { velocity: 1e6, acceleration: 1e9, jerk: 1e13 });
    machine.axes.iter_mut().zip(&section.limits).for_each(|(axis, limits)| axis.limits = *limits);
    let report = attempt(&[JobItem::Section(section)], &machine, &SimSettings::default()).unwrap();
    assert!(report.at_end);
    assert_eq!((report.axes[0].end_counts, report.axes[1].end_counts), (-9900, 9901));
}

#[test]
fn progress_rises_to_the_whole() {
    let mut seen = Vec::new();
    let settings = SimSettings::default();
    simulate(&job(), &machine(), &settings, &mut (), &mut |p| seen.push(p.done_s / p.total_s)).unwrap();
    assert!(seen.is_sorted() && seen[seen.len() - 1] == 1.0);
}

#[test]
fn a_job_without_motion_stays_where_it_is() {
    let job = [JobItem::Dwell { seconds: 1e9, line: 1 }, JobItem::Note { text: "end".into(), line: 2 }];
    let report = attempt(&job, &machine(), &SimSettings::default()).unwrap();
    assert!(report.at_end);
    assert_eq!((report.setpoints, report.motion_s, report.dwell_s), (0, 0.0, 1e9));
    assert!((report.cycle_time_s - 1e9).abs() < 1e-2);
}

#[test]
fn impossible_machines_are_refused() {
    let refuse = |change: fn(&mut Machine)| {
        let mut machine = machine();
        change(&mut machine);
        attempt(&job(), &machine, &SimSettings::default()).unwrap_err().to_string()
    };
    assert!(refuse(|m| m.control_tick_s = 0.0).contains("control tick"));
    assert!(refuse(|m| m.axes.clear()).contains("0 axes"));
    assert!(refuse(|m| m.axes[1].plant.inertia = -1.0).starts_with("axis Y: plant parameter `inertia`"));
    assert!(refuse(|m| m.axes[2].servo.velocity_bandwidth = 1e5).contains("velocity_bandwidth"));
}
