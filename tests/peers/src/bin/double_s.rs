//! This planner from state to state beside `rsruckig`, on the same random cases over twelve decades.
//!
//! `cargo xtask double-s` runs it. The peer runs in child processes: it may crash or never end, and then its cases are counted
//! as failed. An answer of the peer counts only where integrating its own phases arrives at the target to 1e-12.

use std::process::{Command, ExitCode};
use std::time::{Duration, Instant};

use firmware_core::double_s::{Bounds, DoubleSError, MotionLimits, State, plan};
use host_sim::group::{self, Axis, Sync, Target};
use rsruckig::prelude::*;

/// Cases per child process.
const CHUNK: u64 = 50_000;
/// Longest that a child may take.
const PATIENCE: Duration = Duration::from_secs(60);
/// How far the peer's own phases may miss the target, relative to its path and to its largest velocity and acceleration.
const ARRIVES: f64 = 1e-12;
/// Share by which a duration is longer.
const LONGER: f64 = 1e-9;

/// Kinds of cases.
const KINDS: [&str; 5] = ["general", "asymmetric", "degenerate", "outside", GROUP];
/// Three axes that arrive together.
const GROUP: &str = "three axes, time";

#[derive(Clone, Copy, Debug, Default)]
struct Tally {
    cases: u64,
    refused: u64,
    ours_failed: u64,
    peer_failed: u64,
    peer_misses: u64,
    ours_longer: u64,
    peer_longer: u64,
    ours_ns: u64,
    peer_ns: u64,
}

impl Tally {
    fn fields(&mut self) -> [(&'static str, &mut u64); 9] {
        [
            ("cases", &mut self.cases),
            ("refused", &mut self.refused),
            ("ours_failed", &mut self.ours_failed),
            ("peer_failed", &mut self.peer_failed),
            ("peer_misses", &mut self.peer_misses),
            ("ours_longer", &mut self.ours_longer),
            ("peer_longer", &mut self.peer_longer),
            ("ours_ns", &mut self.ours_ns),
            ("peer_ns", &mut self.peer_ns),
        ]
    }
}

#[derive(Debug)]
struct Case {
    from: State<f64>,
    to: State<f64>,
    limits: MotionLimits<f64>,
}

struct Chance(fastrand::Rng);

impl Chance {
    fn within(&mut self, a: f64, b: f64) -> f64 {
        a + (b - a) * self.0.f64()
    }

    fn decades(&mut self, a: f64, b: f64) -> f64 {
        10f64.powf(self.within(a, b))
    }

    /// Between -1 and 1; with `edges` often at an end or in the middle.
    fn share(&mut self, edges: bool) -> f64 {
        if edges && self.0.bool() { [-1.0, 0.0, 1.0][self.0.usize(0..3)] } else { self.within(-1.0, 1.0) }
    }

    fn case(&mut self, kind: &str) -> Case {
        let v = self.decades(-3.0, 3.0);
        let a = v / self.decades(-3.0, 0.0);
        let j = a / self.decades(-4.0, -0.5);
        let even = kind != "asymmetric";
        let mut bounds = |size: f64| {
            let mut side = || if even { size } else { size * self.decades(-0.7, 0.7) };
            Bounds { min: -side(), max: side() }
        };
        // The peer's jerk is the same both ways.
        let limits =
            MotionLimits { velocity: bounds(v), acceleration: bounds(a), jerk: Bounds { min: -j, max: j } };
        let edges = kind == "degenerate";
        let reach = if kind == "outside" { 3.0 } else { 1.0 };
        let part = |b: &Bounds<f64>, s: f64| if s < 0.0 { -s * b.min } else { s * b.max };
        let mut state = |reach: f64| {
            let (v, a) = (reach * self.share(edges), reach * self.share(edges));
            State {
                position: 0.0,
                velocity: part(&limits.velocity, v),
                acceleration: part(&limits.acceleration, a),
            }
        };
        let (from, mut to) = (state(reach), state(1.0));
        let natural = limits.velocity.max.powi(2) / limits.acceleration.max
            + limits.velocity.max * limits.acceleration.max / j;
        let sign = if self.0.bool() { 1.0 } else { -1.0 };
        to.position =
            if edges && self.0.u8(0..4) == 0 { 0.0 } else { sign * natural * self.decades(-9.0, 2.0) };
        if edges && self.0.u8(0..8) == 0 {
            (to.velocity, to.acceleration) = (from.velocity, from.acceleration);
        }
        Case { from, to, limits }
    }
}

/// What the peer makes of axes that arrive together: duration, and whether their phases arrive; `None` where it has no
/// answer.
fn peer<const N: usize>(
    otg: &mut Ruckig<N, ThrowErrorHandler>,
    cases: &[Case; N],
) -> (Option<(f64, bool)>, u64) {
    let mut input = InputParameter::<N>::new(None);
    input.synchronization = Synchronization::Time;
    let (mut v_min, mut a_min) = (input.max_velocity.clone(), input.max_velocity.clone());
    for (axis, case) in cases.iter().enumerate() {
        input.current_position[axis] = case.from.position;
        input.current_velocity[axis] = case.from.velocity;
        input.current_acceleration[axis] = case.from.acceleration;
        input.target_position[axis] = case.to.position;
        input.target_velocity[axis] = case.to.velocity;
        input.target_acceleration[axis] = case.to.acceleration;
        let MotionLimits { velocity, acceleration, jerk } = case.limits;
        input.max_velocity[axis] = velocity.max;
        input.max_acceleration[axis] = acceleration.max;
        input.max_jerk[axis] = jerk.max;
        v_min[axis] = velocity.min;
        a_min[axis] = acceleration.min;
    }
    (input.min_velocity, input.min_acceleration) = (Some(v_min), Some(a_min));
    let mut trajectory = Trajectory::<N>::new(None);
    let begun = Instant::now();
    let result = otg.calculate(&input, &mut trajectory);
    let took = begun.elapsed().as_nanos() as u64;
    if !matches!(result, Ok(RuckigResult::Working | RuckigResult::Finished)) {
        return (None, took);
    }
    let arrive = cases.iter().enumerate().all(|(axis, case)| arrives(&trajectory.profiles[0][axis], case));
    (Some((trajectory.get_duration(), arrive)), took)
}

/// Whether the phases of a profile of the peer's arrive.
fn arrives(profile: &Profile, case: &Case) -> bool {
    let brake = profile.brake.t.iter().zip(&profile.brake.j);
    let mut s = case.from;
    let (mut path, mut fastest, mut steepest) = (0.0f64, s.velocity.abs(), s.acceleration.abs());
    for (&t, &j) in brake.chain(profile.t.iter().zip(&profile.j)) {
        let before = s.velocity.abs();
        s = State {
            position: s.position + t * (s.velocity + t * (s.acceleration / 2.0 + t * j / 6.0)),
            velocity: s.velocity + t * (s.acceleration + t * j / 2.0),
            acceleration: s.acceleration + t * j,
        };
        path += t * before.max(s.velocity.abs());
        (fastest, steepest) = (fastest.max(s.velocity.abs()), steepest.max(s.acceleration.abs()));
    }
    (s.position - case.to.position).abs() <= ARRIVES * path
        && (s.velocity - case.to.velocity).abs() <= ARRIVES * fastest
        && (s.acceleration - case.to.acceleration).abs() <= ARRIVES * steepest
}

/// Our duration of axes that arrive together.
fn ours(cases: &[Case]) -> Result<f64, DoubleSError> {
    if let [case] = cases {
        return Ok(plan(&case.from, &case.to, &case.limits)?.duration());
    }
    let axes: Vec<Axis> = cases
        .iter()
        .map(|case| Axis { from: case.from, to: Target::State(case.to), limits: case.limits })
        .collect();
    group::plan(&axes, Sync::Time).map(|motion| motion.duration).map_err(|e| e.error)
}

/// One chunk of cases of `N` axes, printed as the fields of a tally.
fn child<const N: usize>(kind: &str, seed: u64, count: u64) {
    let mut chance = Chance(fastrand::Rng::with_seed(seed));
    let mut otg = Ruckig::<N, ThrowErrorHandler>::new(None, 0.001);
    let mut tally = Tally::default();
    for _ in 0..count {
        let cases: [Case; N] = std::array::from_fn(|_| chance.case(kind));
        let begun = Instant::now();
        let found = ours(&cases);
        let took = begun.elapsed().as_nanos() as u64;
        tally.cases += 1;
        let seconds = match found {
            Ok(seconds) => seconds,
            Err(DoubleSError::Precision) => {
                tally.ours_failed += 1;
                if tally.ours_failed <= 3 {
                    eprintln!("failed: {cases:?}");
                }
                continue;
            }
            // The target cannot be kept within the limits: the peer is not asked.
            Err(_) => {
                tally.refused += 1;
                continue;
            }
        };
        let (theirs, peer_took) = peer(&mut otg, &cases);
        tally.ours_ns += took;
        tally.peer_ns += peer_took;
        match theirs {
            None => tally.peer_failed += 1,
            Some((_, false)) => tally.peer_misses += 1,
            Some((other, true)) => {
                if seconds > other * (1.0 + LONGER) {
                    tally.ours_longer += 1;
                    if tally.ours_longer <= 3 {
                        eprintln!("longer: {seconds} {other} {cases:?}");
                    }
                } else if other > seconds * (1.0 + LONGER) {
                    tally.peer_longer += 1;
                }
            }
        }
    }
    for (name, value) in tally.fields() {
        println!("{name} {value}");
    }
}

/// Runs a chunk in a child process; `None` where it crashes or does not end.
fn chunk(kind: &str, seed: u64, count: u64) -> Option<Tally> {
    let me = std::env::current_exe().ok()?;
    let mut child = Command::new(me)
        .args(["child", kind, &seed.to_string(), &count.to_string()])
        .stdout(std::process::Stdio::piped())
        .spawn()
        .ok()?;
    let begun = Instant::now();
    while child.try_wait().ok()?.is_none() {
        if begun.elapsed() > PATIENCE {
            child.kill().ok()?;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    let output = child.wait_with_output().ok()?;
    let mut tally = Tally::default();
    for line in String::from_utf8_lossy(&output.stdout).lines() {
        let (name, value) = line.split_once(' ')?;
        let (_, field) = tally.fields().into_iter().find(|(known, _)| *known == name)?;
        *field = value.parse().ok()?;
    }
    (output.status.success() && tally.cases == count).then_some(tally)
}

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let number =
        |index: usize, default: u64| words.get(index).and_then(|w| w.parse().ok()).unwrap_or(default);
    if words.first().is_some_and(|w| w == "child") {
        let kind = words.get(1).map_or("general", String::as_str);
        let run = if kind == GROUP { child::<3> } else { child::<1> };
        run(kind, number(2, 1), number(3, CHUNK));
        return ExitCode::SUCCESS;
    }
    let (cases, seed) = (number(0, 1_000_000), number(1, 1));
    let mut longer = 0;
    println!(
        "| cases | number | refused targets | ours fails | ours longer | peer fails | peer misses | peer longer | crashed chunks | ns ours | ns peer | ratio |"
    );
    println!("|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|");
    for kind in KINDS {
        let (mut all, mut crashed) = (Tally::default(), 0);
        for index in 0..cases.div_ceil(CHUNK) {
            let count = CHUNK.min(cases - index * CHUNK);
            match chunk(kind, (seed << 32) + index, count) {
                Some(mut one) => {
                    let one = one.fields().map(|(_, value)| *value);
                    all.fields().into_iter().zip(one).for_each(|((_, sum), value)| *sum += value);
                }
                None => crashed += 1,
            }
        }
        let asked = (all.cases - all.refused - all.ours_failed).max(1) as f64;
        let (ours, peer) = (all.ours_ns as f64 / asked, all.peer_ns as f64 / asked);
        println!(
            "| {kind} | {} | {} | {} | {} | {} | {} | {} | {crashed} | {ours:.0} | {peer:.0} | {:.2} |",
            all.cases,
            all.refused,
            all.ours_failed,
            all.ours_longer,
            all.peer_failed,
            all.peer_misses,
            all.peer_longer,
            peer / ours
        );
        longer += all.ours_longer + all.ours_failed;
    }
    if longer == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
