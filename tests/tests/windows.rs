//! Divided paths against undivided ones.
#![allow(clippy::unwrap_used, reason = "tests stop on an error")]

use planner::certificate::certify;
use planner::topp::plan;
use planner::topp::problem::{Plan, Problem, Settings, Windows};
use tests::meander::{limits, meander};
use tests::tables::Random;

fn planned(problem: &Problem, windows: Windows) -> Plan {
    let settings = Settings { windows, relative_gap: 1e-6, ..Settings::default() };
    let plan = plan(problem, &settings).unwrap();
    let certificate = certify(&plan.table, problem.limits, problem.caps);
    assert!(certificate.holds, "{windows:?}: {:?}", certificate.worst);
    plan
}

#[test]
fn splices_and_overlaps_come_close_to_the_whole() {
    for (seed, axes, spans, turn) in [(1, 2, 500, 0.3), (2, 3, 700, 0.8), (3, 1, 400, 0.2)] {
        let path = meander(&mut Random::new(seed), axes, spans, 6.0, turn);
        let limits = limits(axes, 100.0, 500.0, 1e4);
        let problem = Problem { path: &path, limits: &limits, caps: &[], control_tick_s: 1e-3 };
        let whole = planned(&problem, Windows::Whole).table.duration();
        let overlap = planned(&problem, Windows::Overlap).table.duration();
        let zhao = planned(&problem, Windows::Zhao).table.duration();
        assert!((overlap / whole - 1.0).abs() < 2e-5, "{overlap} {whole}");
        // Its splices end at 0.5 % less speed than allowed, three places per segment.
        assert!((-1e-5..1e-3).contains(&(zhao / whole - 1.0)), "{zhao} {whole}");
    }
}

#[test]
fn spliced_plans_do_not_depend_on_threads() {
    let path = meander(&mut Random::new(4), 3, 400, 6.0, 0.5);
    let limits = limits(3, 100.0, 500.0, 1e4);
    let problem = Problem { path: &path, limits: &limits, caps: &[], control_tick_s: 1e-3 };
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| planned(&problem, Windows::Zhao).table)
    };
    assert_eq!(on(1), on(3));
}
