//! Paths planned while they arrive.
#![allow(clippy::unwrap_used, reason = "tests stop on an error")]

use std::time::{Duration, Instant};

use planner::certificate::certify;
use planner::feed::table::FeedTable;
use planner::geometry::grid_path::GridPath;
use planner::geometry::section::{FeedCap, SpeedCap};
use planner::job::machine::AxisLimits;
use planner::topp::horizon::{Commit, Deadline, Horizon, HorizonSettings, Record, pieces};
use planner::topp::problem::{Problem, Settings, Windows};
use proptest::prelude::*;
use tests::meander::{limits, meander};
use tests::tables::Random;

const TICK_S: f64 = 1e-3;

/// What came of a streamed path.
struct Streamed {
    table: FeedTable,
    commits: usize,
    /// Geometry spans received before the first commitment, and most in memory.
    first_output: Option<usize>,
    most_kept: usize,
    longest: Duration,
    most_window: usize,
}

/// Streams a path in pieces; every commitment with its stop must be a certified plan of the path so far that keeps
/// what was committed before.
fn streamed(
    path: &GridPath,
    limits: &[AxisLimits],
    caps: &[FeedCap],
    settings: HorizonSettings,
    deadline: Deadline,
    spans: usize,
) -> Streamed {
    let (start, pieces) = pieces(path, caps, spans);
    let mut horizon = Horizon::new(&start, limits, TICK_S, settings).unwrap();
    let mut record = Record::new(&start, horizon.q_scale());
    let mut out = Streamed {
        table: record.clone().table(&Default::default()),
        commits: 0,
        first_output: None,
        most_kept: 0,
        longest: Duration::ZERO,
        most_window: 0,
    };
    let mut received = 0;
    let mut last: Option<(Commit, FeedTable)> = None;
    let mut complete = false;
    let mut drain = |horizon: &mut Horizon, record: &mut Record, received: usize| {
        loop {
            let begun = Instant::now();
            let Some(commit) = horizon.advance(deadline).unwrap() else { break };
            out.longest = out.longest.max(begun.elapsed());
            out.first_output.get_or_insert(received);
            record.commit(&commit);
            let table = record.table(&commit.stop);
            let certificate = certify(&table, limits, caps);
            assert!(certificate.holds, "commit {}: {certificate:?}", out.commits);
            if let Some((before, old)) = &last {
                let kept = old.steps.len() - before.stop.steps.len();
                assert_eq!(old.steps[..kept], table.steps[..kept]);
                assert_eq!(old.codes[..kept - 1], table.codes[..kept - 1]);
            }
            out.commits += 1;
            out.most_window = out.most_window.max(commit.window);
            complete = commit.complete;
            last = Some((commit, table));
        }
        out.most_kept = out.most_kept.max(horizon.kept_spans());
    };
    for piece in pieces {
        horizon.push(&piece).unwrap();
        record.path(&piece);
        received += piece.breaks.len();
        drain(&mut horizon, &mut record, received);
    }
    horizon.finish();
    drain(&mut horizon, &mut record, received);
    assert!(complete);
    assert_eq!(horizon.advance(deadline).unwrap(), None);
    out.table = last.unwrap().1;
    assert_eq!(&out.table.path, path);
    out
}

fn whole(path: &GridPath, limits: &[AxisLimits], caps: &[FeedCap]) -> f64 {
    let problem = Problem { path, limits, caps, control_tick_s: TICK_S };
    let settings = Settings { windows: Windows::Whole, largest_loss: f64::INFINITY, ..Settings::default() };
    planner::topp::plan(&problem, &settings).unwrap().table.duration()
}

#[test]
fn streamed_paths_lose_almost_nothing() {
    for (seed, axes, spans, spacing, turn) in
        [(1, 2, 150, 6.0, 0.3), (2, 3, 150, 6.0, 0.8), (3, 3, 60, 40.0, 0.1), (5, 6, 100, 3.0, 0.6)]
    {
        let path = meander(&mut Random::new(seed), axes, spans, spacing, turn);
        let limits = limits(axes, 100.0, 500.0, 1e4);
        let out = streamed(&path, &limits, &[], HorizonSettings::default(), Deadline::NONE, 3);
        let best = whole(&path, &limits, &[]);
        let gap = out.table.duration() / best - 1.0;
        assert!(gap < 5e-4, "seed {seed}: {gap}");
        assert!(out.commits > 3 && out.first_output.unwrap() < spans && out.most_kept < spans);
    }
}

#[test]
fn a_longer_lookahead_gains_nothing() {
    // The same on knots that are hardly affected by where windows end: what 2.5 braking distances leave to gain.
    for (seed, axes, turn) in [(7, 2, 0.4), (8, 3, 0.7)] {
        let path = meander(&mut Random::new(seed), axes, 120, 6.0, turn);
        let limits = limits(axes, 100.0, 500.0, 1e4);
        let with = |lookahead: f64| {
            let settings = HorizonSettings { lookahead, ..HorizonSettings::default() };
            streamed(&path, &limits, &[], settings, Deadline::NONE, 3).table.duration()
        };
        let [short, usual, long] = [0.3, 2.5, 8.0].map(with);
        assert!((usual / long - 1.0).abs() < 5e-4, "{usual} {long}");
        assert!(short > long * 1.01, "{short} {long}");
    }
}

#[test]
fn a_deadline_of_nothing_still_gives_plans() {
    let path = meander(&mut Random::new(4), 3, 60, 6.0, 0.5);
    let limits = limits(3, 100.0, 500.0, 1e4);
    let at_once = |iterations| {
        let deadline = Deadline { iterations, at: None };
        streamed(&path, &limits, &[], HorizonSettings::default(), deadline, 5).table.duration()
    };
    let times = [at_once(0), at_once(3), at_once(8), at_once(40)];
    assert!(times.windows(2).all(|t| t[1] < t[0]), "{times:?}");
    let passed = Deadline { iterations: 40, at: Some(Instant::now()) };
    let late = streamed(&path, &limits, &[], HorizonSettings::default(), passed, 5);
    assert_eq!(late.table.duration(), times[0]);
}

#[test]
fn caps_that_change_are_kept() {
    let path = meander(&mut Random::new(6), 2, 80, 8.0, 0.4);
    let limits = limits(2, 100.0, 500.0, 1e4);
    let total = path.grid_length();
    let caps = [
        FeedCap { until: total / 3, speed: SpeedCap::Tangential { axes: 3, speed: 40.0 } },
        FeedCap { until: total / 2 + 77, speed: SpeedCap::Tangential { axes: 3, speed: 10.0 } },
        FeedCap { until: total, speed: SpeedCap::None },
    ];
    let out = streamed(&path, &limits, &caps, HorizonSettings::default(), Deadline::NONE, 2);
    let gap = out.table.duration() / whole(&path, &limits, &caps) - 1.0;
    assert!(gap < 5e-4, "{gap}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 16, max_shrink_iters: 4, ..ProptestConfig::default() })]

    /// Any smooth path under limits that fit each other: every commitment is a certified plan, and the whole is near
    /// the fastest motion.
    #[test]
    fn random_paths_and_limits(seed in any::<u64>(), axes in 1usize..7, spans in 20usize..90) {
        let mut random = Random::new(seed);
        let scale = random.scale(0.01, 100.0);
        let turn = random.scale(0.01, 2.0);
        let path = meander(&mut random, axes, spans, scale, turn);
        let velocity = scale * random.scale(1.0, 100.0);
        let (speed_ramp, ramp) = (random.scale(0.02, 1.0), random.scale(0.005, 0.1));
        let limits: Vec<AxisLimits> = (0..axes)
            .map(|_| {
                let velocity = velocity * random.between(0.5, 2.0);
                let acceleration = velocity / speed_ramp * random.between(0.5, 2.0);
                AxisLimits { velocity, acceleration, jerk: acceleration / ramp * random.between(0.5, 2.0) }
            })
            .collect();
        let out = streamed(&path, &limits, &[], HorizonSettings::default(), Deadline::NONE, 3);
        // Other knots than the whole path's, so this is no measure of the lookahead alone.
        let ratio = out.table.duration() / whole(&path, &limits, &[]);
        prop_assert!(ratio < 1.05, "{ratio}");
    }
}
