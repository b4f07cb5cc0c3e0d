//! A job that looks like a real one, made without the planner: curves with a plausible motion on them.

use std::f64::consts::TAU;

use cli::engine::{Compared, Outcome};
use cli::json::{
    AxisJson, BindingJson, BoxJson, BusJson, CertificateJson, CompareFilesJson, CompareJson,
    FeedNotReachedJson, FilesJson, MethodJson, MethodState, NoteJson, PlanJson, SimulationJson,
    WayPointsJson,
};
use cli::report::model::{
    Axis, Bounds, Certificate, ContourError, Counts, DriveEnd, Limit, Mode, Planning, Ratios, Report, Share,
    Simulation, SlowPlaces, Stops, TableSize, Times, Tolerance,
};
use cli::report::record::{AxisInstant, DriveInstant, Instant, Recorder};
use planner::analysis::operations::Operation;
use planner::analysis::shortfall::Shortfall;
use planner::job::machine::MAX_AXES;
use planner::topp::problem::Binding;

/// Which axes the sample machine has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// X, Y, Z mill with all three moving.
    Space,
    /// X, Y plotter.
    Flat,
    /// X and a turntable A.
    Rotary,
    /// A single slide.
    Slide,
}

const TICK_S: f64 = 1e-3;

/// The axes of a sample machine.
pub(crate) fn axes(kind: Kind) -> Vec<Axis> {
    let slide = |name: &str, velocity: f64| {
        let bounds = |s: f64| Bounds { velocity: s * velocity, acceleration: 1500.0, jerk: Some(50_000.0) };
        Axis {
            name: name.into(),
            unit: "mm".into(),
            linear: true,
            feed: bounds(1.0),
            rapid: bounds(1.5),
            travel: [-10.0, 400.0],
            counts_per_unit: 10_000.0,
            effort: 300.0,
        }
    };
    let table = Axis { name: "A".into(), unit: "deg".into(), linear: false, effort: 4.0, ..slide("A", 90.0) };
    match kind {
        Kind::Space => vec![slide("X", 150.0), slide("Y", 150.0), slide("Z", 60.0)],
        Kind::Flat => vec![slide("X", 150.0), slide("Y", 150.0)],
        Kind::Rotary => vec![slide("X", 150.0), table],
        Kind::Slide => vec![slide("X", 150.0)],
    }
}

/// One curve of the sample: `at(s)` for s in 0..1, its mode, its feed, the line numbers.
struct Curve {
    mode: Mode,
    feed: Option<f64>,
    lines: [u32; 2],
    at: Box<dyn Fn(f64) -> [f64; 3]>,
}

fn curves(size: f64) -> Vec<Curve> {
    let line =
        move |a: [f64; 3], b: [f64; 3]| move |s: f64| std::array::from_fn(|c| a[c] + s * (b[c] - a[c]));
    let lissajous = move |s: f64| {
        let t = TAU * s;
        let (x, y) = (100.0 + 80.0 * (3.0 * t).sin() * size, 80.0 + 60.0 * (4.0 * t).sin() * size);
        [x, y, -6.0 + 5.0 * (7.0 * t).cos()]
    };
    let wave = move |s: f64| {
        let x = 20.0 + 160.0 * s;
        [x, 190.0 + 14.0 * (TAU * 9.0 * s).sin().signum() * (TAU * 9.0 * s).sin().abs().powf(0.35), -4.0]
    };
    let (home, above) = ([0.0, 0.0, 25.0], lissajous(0.0));
    let clear = [above[0], above[1], 25.0];
    let second = [20.0, 190.0, 25.0];
    let wave_end = wave(1.0);
    let rapid = |lines, a, b| Curve { mode: Mode::Rapid, feed: None, lines, at: Box::new(line(a, b)) };
    let feed = |lines, feed, at: Box<dyn Fn(f64) -> [f64; 3]>| Curve {
        mode: Mode::Feed,
        feed: Some(feed),
        lines,
        at,
    };
    vec![
        rapid([5, 5], home, clear),
        feed([6, 6], 12.0, Box::new(line(clear, above))),
        feed([7, 1206], 110.0, Box::new(lissajous)),
        rapid([1207, 1207], above, clear),
        rapid([1210, 1210], clear, second),
        feed([1211, 1211], 12.0, Box::new(line(second, wave(0.0)))),
        feed([1212, 1611], 60.0, Box::new(wave)),
        rapid([1612, 1612], wave_end, [wave_end[0], wave_end[1], 25.0]),
        rapid([1613, 1613], [wave_end[0], wave_end[1], 25.0], home),
    ]
}

/// A plausible motion: forward and backward acceleration sweeps on a fine grid.
fn ride(curve: &Curve, axes: &[Axis], map: &dyn Fn([f64; 3]) -> Vec<f64>) -> Vec<(f64, Vec<f64>, Limit)> {
    let n = 6000;
    let p: Vec<Vec<f64>> = (0..=n).map(|i| map((curve.at)(f64::from(i) / f64::from(n)))).collect();
    let step: Vec<f64> = p.windows(2).map(|w| dist(&w[0], &w[1]).max(1e-9)).collect();
    let n = step.len();
    let mut v = vec![0.0; n + 1];
    let mut why = vec![Limit::Feed; n + 1];
    for i in 1..n {
        let h = 0.5 * (step[i - 1] + step[i]);
        v[i] = curve.feed.unwrap_or(f64::INFINITY);
        for (k, axis) in axes.iter().enumerate() {
            let d = (p[i + 1][k] - p[i - 1][k]) / (2.0 * h);
            let dd = (p[i + 1][k] - 2.0 * p[i][k] + p[i - 1][k]) / (h * h);
            let b = if curve.mode == Mode::Rapid { &axis.rapid } else { &axis.feed };
            for (cap, limit) in [
                (b.velocity / d.abs().max(1e-9), Limit::Velocity(k as u8)),
                ((0.6 * b.acceleration / dd.abs().max(1e-9)).sqrt(), Limit::Acceleration(k as u8)),
            ] {
                if cap < v[i] {
                    (v[i], why[i]) = (cap, limit);
                }
            }
        }
    }
    for i in 1..=n {
        sweep(&mut v, &mut why, i, i - 1, step[i - 1], axes.len());
    }
    for i in (0..n).rev() {
        sweep(&mut v, &mut why, i, i + 1, step[i], axes.len());
    }
    let mut out = Vec::new();
    let (mut i, mut x) = (0, 0.0);
    while i < n {
        let f = x / step[i];
        let speed = (v[i] * v[i] + f * (v[i + 1] * v[i + 1] - v[i] * v[i]))
            .max(0.0)
            .sqrt()
            .max(0.05 * v[i].max(v[i + 1]))
            .max(0.3);
        let at = p[i].iter().zip(&p[i + 1]).map(|(a, b)| a + f * (b - a)).collect();
        out.push((i as f64 / n as f64, at, why[i]));
        x += speed * TICK_S;
        while i < n && x >= step[i] {
            x -= step[i];
            i += 1;
        }
    }
    out.push((1.0, p[n].clone(), Limit::Rest));
    out
}

fn sweep(v: &mut [f64], why: &mut [Limit], i: usize, from: usize, step: f64, axes: usize) {
    let cap = (v[from] * v[from] + 2.0 * 800.0 * step).sqrt();
    if cap < v[i] {
        v[i] = cap;
        why[i] = if cap < 18.0 { Limit::Rest } else { Limit::Jerk((i / 700 % axes.min(2)) as u8) };
    }
}

fn dist(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

fn smooth(values: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let half = 11usize;
    (0..values.len())
        .map(|i| {
            let window = &values[i.saturating_sub(half)..(i + half + 1).min(values.len())];
            (0..values[0].len())
                .map(|k| window.iter().map(|p| p[k]).sum::<f64>() / window.len() as f64)
                .collect()
        })
        .collect()
}

/// The report of a sample job, whose length grows with `rounds`.
pub(crate) fn report(kind: Kind, rounds: usize) -> Report {
    let axes = axes(kind);
    let map: Box<dyn Fn([f64; 3]) -> Vec<f64>> = match kind {
        Kind::Space => Box::new(|p| p.to_vec()),
        Kind::Flat => Box::new(|p| p[..2].to_vec()),
        Kind::Rotary => Box::new(|p| vec![p[0], 3.0 * p[1]]),
        Kind::Slide => Box::new(|p| vec![p[0]]),
    };
    let mut recorder = Recorder::new(&axes);
    let mut time = 0.0;
    let mut motion_s = 0.0;
    for round in 0..rounds {
        for curve in curves(1.0 / (1.0 + 0.02 * round as f64)) {
            // Standing still before and after, so that smoothing makes soft starts and stops.
            let ticks = ride(&curve, &axes, &*map);
            let hold = |k: usize| std::iter::repeat_n((ticks[k].0, ticks[k].1.clone(), Limit::Rest), 40);
            let ticks: Vec<_> = hold(0).chain(ticks.iter().cloned()).chain(hold(ticks.len() - 1)).collect();
            let at = ticks.iter().map(|t| t.1.clone()).collect::<Vec<_>>();
            let at = smooth(&smooth(&smooth(&at)));
            let still = |k: usize| at[at.len() - 1 - k.min(at.len() - 1)].clone();
            let begin = time;
            for i in 0..at.len() {
                time = begin + i as f64 * TICK_S;
                let get = |d: usize| at[i.saturating_sub(d)].as_slice();
                let instants: Vec<AxisInstant> = (0..axes.len())
                    .map(|k| {
                        let velocity = (get(0)[k] - get(1)[k]) / TICK_S;
                        let before = (get(1)[k] - get(2)[k]) / TICK_S;
                        let earlier = (get(2)[k] - get(3)[k]) / TICK_S;
                        let acceleration = (velocity - before) / TICK_S;
                        let jerk = (acceleration - (before - earlier) / TICK_S) / TICK_S;
                        let noise = ((i * 7919 + k * 104_729) % 17) as f64 / 17.0 - 0.5;
                        let effort = axes[k].effort
                            * (acceleration / 2400.0 + 0.1 * (velocity / 3.0).tanh() + velocity / 1500.0);
                        let error = 2e-6 * acceleration + 2e-5 * velocity + 2e-4 * noise;
                        AxisInstant {
                            position: get(0)[k],
                            velocity,
                            acceleration,
                            jerk,
                            drive: Some(DriveInstant { error, effort }),
                        }
                    })
                    .collect();
                let speed =
                    instants.iter().zip(&axes).filter(|(_, a)| a.linear).map(|(i, _)| i.velocity.powi(2));
                let [from, to] = curve.lines;
                recorder.push(&Instant {
                    time,
                    line: from + (ticks[i].0 * f64::from(to - from)) as u32,
                    mode: curve.mode,
                    limit: ticks[i].2,
                    speed: speed.sum::<f64>().sqrt(),
                    feed: curve.feed,
                    axes: &instants,
                });
            }
            motion_s += time - begin;
            let wait = if curve.lines[0] == 1207 { 0.8 } else { TICK_S };
            time += wait;
            let position = still(0);
            let rest: Vec<AxisInstant> = position
                .iter()
                .map(|&position| AxisInstant::standing(position, Some(DriveInstant::default())))
                .collect();
            recorder.push(&Instant::standing(time, curve.lines[1], &rest));
        }
    }
    finish(axes, recorder, time, motion_s)
}

const BUS: BusJson = BusJson { frames: 2120, bytes: 16_412, load: 0.031 };

/// A place where the sample does not reach its feed.
fn place(k: u32) -> Shortfall {
    let mut slowest_at = [0.0; MAX_AXES];
    (slowest_at[0], slowest_at[1]) = (30.0 + 10.0 * f64::from(k), 20.0 + 9.0 * f64::from(k));
    Shortfall {
        first_line: 100 * k + 7,
        last_line: 100 * k + 9,
        start_s: f64::from(k),
        length: 3.2,
        programmed: 110.0,
        lowest: 61.0,
        mean: 84.0,
        slowest_s: f64::from(k) + 0.2,
        slowest_at,
        limit: Binding::Acceleration(0),
        seconds: 0.038,
        lost_s: 0.009,
    }
}

fn finish(axes: Vec<Axis>, recorder: Recorder, cycle_s: f64, motion_s: f64) -> Report {
    let n = axes.len();
    let operation = |name: &str, line, share: f64| Operation {
        name: name.into(),
        line,
        feed_s: share * motion_s * 0.8,
        rapid_s: share * motion_s * 0.2,
        dwell_s: 0.0,
        feed_length_mm: share * motion_s * 40.0,
        rapid_length_mm: share * motion_s * 10.0,
    };
    let ratios = |k: usize| Ratios {
        velocity: 0.91 - 0.2 * k as f64,
        acceleration: 0.999_981 - 0.1 * k as f64,
        jerk: Some(0.999_998 - 0.03 * k as f64),
    };
    let end = |k: usize| DriveEnd {
        target_counts: 0,
        reached_counts: 0,
        at_rest: true,
        max_error: 0.0041 - 0.001 * k as f64,
        rms_error: 0.000_82,
        effort_ratio: 0.63,
    };
    let stops = [
        ("between rapid and feed", 8),
        ("program end", 1),
        ("tool change", 1),
        ("reversal over 170\u{b0}", 1),
    ];
    Report {
        job: "lissajous.ngc".into(),
        way_points: None,
        machine: "three-axis mill".into(),
        times: Times {
            cycle_s,
            motion_s,
            constant_feed_s: 0.87 * motion_s,
            stop_every_block_s: Some(11.4 * motion_s),
        },
        tolerance: Tolerance {
            tolerance_mm: 0.01,
            source: "machine".into(),
            deviation_mm: 0.00973,
            line: 412,
        },
        counts: Counts {
            blocks: 1608,
            rapids: 5,
            lines: 1597,
            arcs: 6,
            splines: 0,
            dwells: 1,
            feed_mm: 2178.4,
            rapid_mm: 441.2,
        },
        operations: vec![
            operation("", 0, 0.02),
            operation("T1 6 mm end mill: contour", 5, 0.60),
            operation("T2 engraver: wave", 1210, 0.38),
        ],
        stops: stops.map(|(cause, count)| Stops { cause: cause.into(), count }).to_vec(),
        certificate: Certificate {
            verdict: CertificateJson {
                holds: true,
                velocity_ratio: 0.91,
                acceleration_ratio: 0.999_981,
                jerk_ratio: Some(0.999_998),
                feed_ratio: Some(0.999_993),
            },
            axes: (0..n).map(ratios).collect(),
        },
        table: TableSize {
            sections: 9,
            spans: 2412,
            geometry_spans: 1633,
            shared: 8315,
            axes: (0..n as u64).map(|k| 4910 - 310 * k).collect(),
            headers: 720,
        },
        motion: recorder.finish(),
        shares: vec![
            Share { limit: Limit::Acceleration(0), seconds: 0.6 * motion_s },
            Share { limit: Limit::Feed, seconds: 0.3 * motion_s },
            Share { limit: Limit::Rest, seconds: 0.1 * motion_s },
            Share { limit: Limit::Dwell, seconds: cycle_s - motion_s },
        ],
        slow: SlowPlaces { places: (0..14).map(place).collect(), count: 40, lost_s: 0.1 * motion_s },
        simulation: Some(Simulation {
            tick_s: TICK_S,
            setpoints: n as u64 * (cycle_s / TICK_S) as u64,
            setpoint_hash: "9f2c4411d07be83a".into(),
            path_deviation_counts: 0.62,
            contour: Some(ContourError { max_mm: 0.0021, rms_mm: 0.0004 }),
            bus: BUS,
            axes: (0..n).map(end).collect(),
        }),
        planning: Planning {
            solver: "interior-point".into(),
            iterations: 187,
            gap: Some(7e-6),
            jerk_form: "true".into(),
            windows: "overlap".into(),
            seconds: 0.412,
            peak_memory_mib: Some(48.0),
        },
        notes: vec![NoteJson { line: 3, text: "G64 without P: 0.05 mm used".into() }],
        axes,
    }
}

/// A whole outcome of `plan` or `run` around a small sample report.
pub(crate) fn outcome(simulated: bool) -> Outcome {
    let mut report = report(Kind::Flat, 1);
    let simulation = SimulationJson {
        setpoints: 23_410,
        setpoint_hash: "9f2c4411d07be83a".into(),
        max_path_deviation_counts: 0.62,
        max_following_error_mm: 0.0041,
        rms_following_error_mm: 0.00082,
        max_contour_error_mm: 0.0021,
        rms_contour_error_mm: 0.0004,
        bus: BUS,
        at_end: true,
        real_time_factor: 61.0,
    };
    if !simulated {
        report.simulation = None;
    }
    let c = report.counts;
    let json = PlanJson {
        job: report.job.clone(),
        job_kind: "program",
        way_points: None,
        machine: report.machine.clone(),
        axes: report.axes.iter().map(|a| AxisJson { name: a.name.clone(), unit: a.unit.clone() }).collect(),
        blocks: c.blocks,
        rapids: c.rapids,
        lines: c.lines,
        arcs: c.arcs,
        splines: c.splines,
        dwells: c.dwells,
        stops: 11,
        stops_by_cause: [("program_end", 1), ("rapid", 8), ("reversal", 1), ("tool_change", 1)].into(),
        feed_length_mm: c.feed_mm,
        rapid_length_mm: c.rapid_mm,
        bounding_box_mm: BoxJson { min: vec![0.0, 0.0], max: vec![180.0, 205.0] },
        tolerance_mm: 0.01,
        tolerance_source: "machine".into(),
        max_deviation_mm: 0.00973,
        cycle_time_s: report.times.cycle_s,
        motion_time_s: report.times.motion_s,
        constant_feed_time_s: report.times.constant_feed_s,
        stop_every_block_time_s: report.times.stop_every_block_s,
        binding: vec![
            BindingJson { kind: "jerk", axis: Some("X".into()), seconds: 7.0, share: 0.7 },
            BindingJson { kind: "feed", axis: None, seconds: 3.0, share: 0.3 },
        ],
        feed_not_reached: vec![FeedNotReachedJson {
            first_line: 7,
            last_line: 9,
            length_mm: 3.2,
            programmed_mm_s: 110.0,
            lowest_mm_s: 61.0,
            mean_mm_s: 84.0,
            limited_by: "acceleration",
            axis: Some("X".into()),
            lost_s: 0.009,
        }],
        operations: report.operations.clone(),
        spans: report.table.spans,
        table_bytes: report.table.total(),
        plan_seconds: 0.412,
        peak_memory_mib: Some(48.0),
        solver: "interior-point".into(),
        jerk_form: "true".into(),
        windows: "overlap".into(),
        iterations: report.planning.iterations,
        gap_estimate: Some(7e-6),
        certificate: report.certificate.verdict,
        simulation: simulated.then_some(simulation),
        notes: report.notes.clone(),
        files: FilesJson::default(),
    };
    Outcome { json, report, feed: b"a feed table".to_vec() }
}

/// A comparison of five methods, two of them without a motion.
pub(crate) fn compared() -> Compared {
    let report = report(Kind::Flat, 1);
    let method = |name: &str, share: f64| MethodJson {
        method: name.into(),
        state: MethodState::Planned,
        solver: Some("interior-point".into()),
        jerk_form: "true".into(),
        windows: Some("whole".into()),
        compute_seconds: Some(0.0125),
        traverse_time_s: Some(12.5 * (1.0 + share)),
        over_whole: Some(share),
        certified: Some(true),
        velocity_ratio: Some(0.91),
        acceleration_ratio: Some(0.999_9),
        jerk_ratio: Some(0.999_8),
        feed_ratio: None,
        spans: Some(3059),
        iterations: Some(84),
        gap_estimate: Some(7e-6),
        constant_feed_mm_s: None,
        lost_s: None,
        binding: vec![BindingJson { kind: "jerk", axis: Some("X".into()), seconds: 12.5, share: 1.0 }],
        remark: None,
    };
    let bare = |name: &str, state| MethodJson { method: name.into(), state, ..MethodJson::default() };
    let sweep = MethodJson { traverse_time_s: Some(11.0), ..bare("sweep", MethodState::Timed) };
    let remark = Some("takes minutes on a path this long; name it with --methods".into());
    let clarabel = MethodJson { remark, ..bare("clarabel", MethodState::LeftOut) };
    let collocation =
        MethodJson { certified: Some(false), jerk_ratio: Some(2.4), ..method("collocation", -0.02) };
    let motion = Some(report.motion.clone());
    Compared {
        json: CompareJson {
            job: "jobs/points.csv".into(),
            job_kind: "way-points",
            way_points: Some(WayPointsJson {
                count: 3000,
                ends: "not-a-knot".into(),
                knots: "chord".into(),
                geometry_spans: 900,
            }),
            machine: report.machine.clone(),
            axes: report
                .axes
                .iter()
                .map(|a| AxisJson { name: a.name.clone(), unit: a.unit.clone() })
                .collect(),
            feed_length_mm: 860.0,
            sections: 1,
            geometry_spans: 2997,
            threads: 2,
            methods: vec![method("whole", 0.0), method("zhao", 2e-4), sweep, clarabel, collocation],
            peak_memory_mib: Some(40.0),
            files: CompareFilesJson::default(),
        },
        axes: report.axes,
        motions: vec![motion.clone(), motion.clone(), None, None, motion],
    }
}
