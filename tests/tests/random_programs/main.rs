//! Random programs on random machines: planned, proven, measured, played.
//!
//! Cases are drawn from a fixed seed. These variables ask for others: `FEEDSPLINE_CASES` how many, `FEEDSPLINE_SEED`
//! which, `FEEDSPLINE_FROM` the first one looked at, `FEEDSPLINE_SHRINK` how many findings of each kind are made
//! simpler before they are printed.
#![allow(clippy::unwrap_used, clippy::panic, reason = "helpers of tests fail as tests do")]

mod machines;
mod steps;

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};

use machines::{Frame, frame};
use planner::geometry::sections::{GeometryError, SectionError};
use planner::job::gcode::Options;
use planner::job::machine::LimitSet;
use planner::pipeline::JobError;
use planner::topp::PlanError;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use steps::{Step, quick, step, write};
use tests::chain::{self, ChainError};
use tests::judge::{Finding, judge};

/// Longer motion is proven and measured, but not played [s].
const LONGEST_S: f64 = 60.0;

/// Samples per span of the dense oracle.
const SAMPLES: usize = 20;

/// Attempts to make one finding simpler.
const SHRINKING: usize = 200;

#[derive(Clone, Debug)]
struct Case {
    frame: Frame,
    steps: Vec<Step>,
    digits: usize,
    feed: f64,
    limits: LimitSet,
}

fn case() -> impl Strategy<Value = Case> {
    let limits = prop::bool::weighted(0.15).prop_map(|free| {
        if free { LimitSet::VelocityAcceleration } else { LimitSet::VelocityAccelerationJerk }
    });
    (frame(), prop::collection::vec(step(), 1..24), 2usize..6, quick(20.0, 40_000.0), limits)
        .prop_map(|(frame, steps, digits, feed, limits)| Case { frame, steps, digits, feed, limits })
}

/// One word that tells errors apart.
fn kind(error: &ChainError) -> &'static str {
    match error {
        JobError::Section(SectionError::Program(_)) => "refused",
        JobError::Section(SectionError::Geometry(GeometryError::NotCertified { .. })) => "not certified",
        JobError::Section(SectionError::Geometry(_)) => "geometry",
        JobError::Plan { fault: PlanError::Uneven { .. }, .. } => "uneven",
        JobError::Plan { fault: PlanError::Resolution { .. }, .. } => "resolution",
        JobError::Plan { fault: PlanError::Slow { .. }, .. } => "slow",
        JobError::Plan { .. } => "plan",
    }
}

impl Case {
    fn text(&self) -> String {
        write(&self.steps, &self.frame.machine(), self.digits, self.feed)
    }

    fn check(&self) -> Result<(), Finding> {
        let machine = self.frame.machine();
        let planned = chain::plan(self.text().as_bytes(), &machine, &Options::default(), self.limits);
        let chain = planned.map_err(|e| Finding { kind: kind(&e), text: e.to_string() })?;
        judge(&chain, &machine, SAMPLES, LONGEST_S).map(|_| ())
    }

    /// As [`Case::check`]; a panic is a finding too.
    fn outcome(&self) -> Result<(), Finding> {
        catch_unwind(AssertUnwindSafe(|| self.check())).unwrap_or_else(|cause| {
            let text = cause.downcast_ref::<String>().cloned();
            let text = text.or_else(|| cause.downcast_ref::<&str>().map(|s| (*s).to_string()));
            Err(Finding { kind: "panic", text: text.unwrap_or_default() })
        })
    }

    fn tell(&self, number: u64, finding: &Finding) {
        println!("case {number}, {:?}: {finding}\n{}\n{}", self.limits, self.frame.toml(), self.text());
    }
}

/// The simplest case met on the way down a tree that has a finding of the same kind.
fn simplest(mut tree: impl ValueTree<Value = Case>, finding: Finding) -> (Case, Finding) {
    let mut best = (tree.current(), finding);
    let mut simpler = tree.simplify();
    for _ in 0..SHRINKING {
        if !simpler {
            break;
        }
        simpler = match tree.current().outcome() {
            Err(found) if found.kind == best.1.kind => {
                best = (tree.current(), found);
                tree.simplify()
            }
            _ => tree.complicate(),
        };
    }
    best
}

fn setting(name: &str, default: u64) -> u64 {
    std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(default)
}

#[test]
fn random_programs_hold() {
    let (cases, from) = (setting("FEEDSPLINE_CASES", 80), setting("FEEDSPLINE_FROM", 0));
    let mut seed = [0; 32];
    seed[..8].copy_from_slice(&setting("FEEDSPLINE_SEED", 1).to_le_bytes());
    let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &seed);
    let mut runner = TestRunner::new_with_rng(Config::default(), rng);
    let strategy = case();
    let mut findings: BTreeMap<&str, u64> = BTreeMap::new();
    for number in 0..cases {
        let tree = strategy.new_tree(&mut runner).unwrap();
        if number < from {
            continue;
        }
        let case = tree.current();
        let Err(finding) = case.outcome() else { continue };
        let count = findings.entry(finding.kind).or_default();
        *count += 1;
        if *count <= setting("FEEDSPLINE_SHRINK", 1) {
            let (case, finding) = simplest(tree, finding);
            case.tell(number, &finding);
        } else {
            println!("case {number}, {:?}: {finding}", case.limits);
        }
    }
    assert!(findings.is_empty(), "{findings:?} in {cases} cases");
}
