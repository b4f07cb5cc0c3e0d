//! Random programs on random machines: planned, proven, measured, played.
//!
//! `FEEDSPLINE_CASES` and `FEEDSPLINE_SEED` ask for more cases, or for others.
#![allow(clippy::unwrap_used, clippy::panic, reason = "helpers of tests fail as tests do")]

mod machines;
mod steps;

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};

use machines::{Frame, frame};
use planner::job::gcode::Options;
use planner::job::machine::LimitSet;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use steps::{Step, quick, step, write};
use tests::chain;
use tests::judge::{Finding, judge};

#[derive(Clone, Debug)]
struct Case {
    frame: Frame,
    steps: Vec<Step>,
    digits: usize,
    feed: f64,
    jerk: bool,
}

fn case() -> impl Strategy<Value = Case> {
    let feed = quick(20.0, 40_000.0);
    (frame(), prop::collection::vec(step(), 1..24), 2usize..6, feed, prop::bool::weighted(0.15))
        .prop_map(|(frame, steps, digits, feed, free)| Case { frame, steps, digits, feed, jerk: !free })
}

impl Case {
    fn text(&self) -> String {
        write(&self.steps, &self.frame.machine(), self.digits, self.feed)
    }

    fn check(&self) -> Result<(), Finding> {
        let machine = self.frame.machine();
        let limits =
            if self.jerk { LimitSet::VelocityAccelerationJerk } else { LimitSet::VelocityAcceleration };
        let text = self.text();
        let planned = chain::plan(text.as_bytes(), &machine, &Options::default(), limits);
        let chain = planned.map_err(|e| {
            let debug = format!("{e:?}");
            let kind = [
                "NotCertified",
                "TooManySpans",
                "TooFar",
                "Gap",
                "NotFinite",
                "Resolution",
                "Uneven",
                "Slow",
                "TooShort",
                "NothingMoves",
                "Solver",
                "Travel",
                "Radi",
            ]
            .into_iter()
            .find(|k| debug.contains(k))
            .unwrap_or("refused");
            Finding { kind, text: e.to_string() }
        })?;
        judge(&chain, &machine, 20).map(|_| ())
    }

    fn outcome(&self) -> Result<(), Finding> {
        catch_unwind(AssertUnwindSafe(|| self.check())).unwrap_or_else(|cause| {
            let text = cause.downcast_ref::<String>().cloned();
            let text = text.or_else(|| cause.downcast_ref::<&str>().map(|s| (*s).to_string()));
            Err(Finding { kind: "panic", text: text.unwrap_or_default() })
        })
    }
}

fn setting(name: &str, default: u64) -> u64 {
    std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(default)
}

#[test]
fn random_programs_hold() {
    let cases = setting("FEEDSPLINE_CASES", 16);
    let seed = setting("FEEDSPLINE_SEED", 1);
    let mut bytes = [0; 32];
    bytes[..8].copy_from_slice(&seed.to_le_bytes());
    let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &bytes);
    let mut runner = TestRunner::new_with_rng(Config::default(), rng);
    let strategy = case();
    let mut findings: BTreeMap<&str, u32> = BTreeMap::new();
    for number in 0..cases {
        let mut tree = strategy.new_tree(&mut runner).unwrap();
        if number < setting("FEEDSPLINE_FROM", 0)
            || setting("FEEDSPLINE_SAMPLES", 0) == 1 && tree.current().frame.axes > 1
            || setting("FEEDSPLINE_JERK", 0) == 1 && !tree.current().jerk
        {
            continue;
        }
        let begin = std::time::Instant::now();
        let outcome = tree.current().outcome();
        if begin.elapsed().as_secs_f64() > 5.0 && setting("FEEDSPLINE_SHRUNK", 1) == 0 {
            println!("== case {number} took {:?}", begin.elapsed());
        }
        let Err(mut finding) = outcome else { continue };
        let count = findings.entry(finding.kind).or_default();
        *count += 1;
        println!("== case {number} jerk {}: {finding}", tree.current().jerk);
        if std::env::var("FEEDSPLINE_ONLY").is_ok_and(|k| k != finding.kind)
            || *count > setting("FEEDSPLINE_SHRUNK", 1) as u32
        {
            continue;
        }
        let mut best = tree.current();
        let mut tries = setting("FEEDSPLINE_TRIES", 200);
        let mut simpler = tree.simplify();
        while simpler && tries > 0 {
            tries -= 1;
            match tree.current().outcome() {
                Err(f) if f.kind == finding.kind => {
                    (best, finding) = (tree.current(), f);
                    simpler = tree.simplify();
                }
                _ => simpler = tree.complicate(),
            }
        }
        println!(
            "== {finding}\n{best:?}\n{}\n{}",
            best.frame.toml().lines().next().unwrap_or_default(),
            best.text()
        );
    }
    assert!(findings.is_empty(), "{findings:?} of {cases}");
}
