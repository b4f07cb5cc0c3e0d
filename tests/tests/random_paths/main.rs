//! Random paths under random limits: planned, proven, sampled, compared with what no motion can undercut.
//!
//! These variables ask for other cases: `FEEDSPLINE_CASES` how many, `FEEDSPLINE_SEED` which, `FEEDSPLINE_FROM` the
//! first one looked at.
#![allow(clippy::unwrap_used, clippy::panic, reason = "helpers of tests fail as tests do")]

mod case;
mod chance;
mod paths;

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use case::Case;
use planner::certificate::certify;
use planner::feed::table::SpanLaw;
use planner::tolerances::{CERTIFICATE_RATIO, TABLE_SERIES_ARGUMENT};
use planner::topp::problem::{Problem, Settings};
use planner::topp::{PlanError, plan};
use tests::oracle::dense::largest_ratios;
use tests::oracle::sweep::swept_time;

/// Samples per span of the dense oracle.
const SAMPLES: usize = 12;

/// Samples may exceed a proven bound by this share: the rounding of the oracle's own arithmetic.
const ORACLE: f64 = 1e-9;

/// A plan may undercut the swept time by this share: the sweep is first-order accurate.
const SWEEP: f64 = 0.01;

/// What is told of a case.
#[derive(Debug)]
struct Finding {
    kind: &'static str,
    text: String,
}

fn found<T>(kind: &'static str, text: String) -> Result<T, Finding> {
    Err(Finding { kind, text })
}

fn kind(error: &PlanError) -> &'static str {
    match error {
        PlanError::Uneven { .. } => "uneven",
        PlanError::Resolution { .. } => "resolution",
        PlanError::Slow { .. } => "slow",
        PlanError::TooLong { .. } => "too long",
        _ => "refused",
    }
}

fn check(case: &Case) -> Result<(), Finding> {
    let Case { path, limits, caps, tick_s, .. } = case;
    let problem = Problem { path, limits, caps, control_tick_s: *tick_s };
    let plan = match plan(&problem, &Settings::default()) {
        Ok(plan) => plan,
        Err(e) => return found(kind(&e), e.to_string()),
    };
    let proof = certify(&plan.table, limits, caps);
    if !proof.holds {
        return found("certificate", format!("{proof:?}"));
    }
    for span in 0..plan.table.spans() {
        let law = plan.table.law(span);
        let seconds = law.duration();
        let bend = match law {
            SpanLaw::Quadratic { h, q: [alpha, beta, gamma] } => {
                let end = alpha + h * (beta + h * gamma);
                gamma * (h / (alpha.sqrt() + end.sqrt())).powi(2)
            }
            SpanLaw::Launch { .. } | SpanLaw::Landing { .. } => 0.0,
        };
        if !(seconds > 0.0 && seconds < 1.0 && bend.abs() <= TABLE_SERIES_ARGUMENT) {
            return found("format", format!("span {span} takes {seconds} s and bends by {bend}"));
        }
    }
    let sampled = largest_ratios(&plan.table, limits, caps, SAMPLES);
    let pairs = [
        (proof.velocity_ratio, sampled.velocity),
        (proof.acceleration_ratio, sampled.acceleration),
        (proof.jerk_ratio, sampled.jerk),
        (proof.feed_ratio, sampled.feed),
    ];
    let sound = |&(proven, sampled): &(f64, f64)| {
        sampled <= proven * (1.0 + ORACLE) && sampled <= 1.0 + CERTIFICATE_RATIO
    };
    if !pairs.iter().all(sound) {
        return found("samples", format!("{sampled:?} above {proof:?}"));
    }
    // Many stations where few are too inaccurate.
    let seconds = plan.table.duration();
    let undercut = |stations: usize| seconds < swept_time(path, limits, caps, stations) * (1.0 - SWEEP);
    if !seconds.is_finite() || (undercut(64) && undercut(2048)) {
        return found("sweep", format!("{seconds} s is less than a motion without jerk takes"));
    }
    Ok(())
}

/// As [`check`]; a panic is a finding too.
fn outcome(case: &Case) -> Result<(), Finding> {
    catch_unwind(AssertUnwindSafe(|| check(case))).unwrap_or_else(|cause| {
        let text = cause.downcast_ref::<String>().cloned();
        let text = text.or_else(|| cause.downcast_ref::<&str>().map(|s| (*s).to_string()));
        found("panic", text.unwrap_or_default())
    })
}

fn setting(name: &str, default: u64) -> u64 {
    std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(default)
}

#[test]
fn random_paths_hold() {
    let (cases, from) = (setting("FEEDSPLINE_CASES", 300), setting("FEEDSPLINE_FROM", 0));
    let seed = setting("FEEDSPLINE_SEED", 1);
    let findings: Mutex<BTreeMap<&str, u64>> = Mutex::default();
    let next = AtomicU64::new(from);
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get());
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= cases {
                        break;
                    }
                    let case = Case::of(seed, number);
                    if let Err(Finding { kind, text }) = outcome(&case) {
                        println!("case {number}, {:?}: {kind}: {text}", case.shape);
                        *findings.lock().unwrap().entry(kind).or_default() += 1;
                    }
                }
            });
        }
    });
    let findings = findings.into_inner().unwrap();
    assert!(findings.is_empty(), "{findings:?} in {cases} cases of seed {seed}");
}
