//! Plans of many kinds of path against an oracle that shares no row code.

mod families;
mod oracle;

use self::families::{Rng, line, limits, settings, walk, zigzag};
use self::oracle::Oracle;
use super::problem::{Plan, Problem, Solver};
use super::sweep::Sweep;
use super::{PlanError, plan};
use crate::geometry::grid_path::GridPath;
use crate::geometry::section::{FeedCap, SpeedCap};
use crate::job::machine::AxisLimits;

fn planned(path: &GridPath, limits: &[AxisLimits], caps: &[FeedCap]) -> Plan {
    let problem = Problem { path, limits, caps, shortest_span_s: 1e-3 };
    let plan = plan(&problem, &settings()).unwrap();
    let oracle = Oracle::of(&problem, &plan.table);
    oracle.assert_sound(&problem, &plan);
    plan
}

#[test]
fn smoke() {
    let mut rng = Rng::new(1);
    let path = walk(&mut rng, 3, 40, 8.0, 0.5);
    let l = limits(3, 100.0, 500.0, 1e4);
    let p = planned(&path, &l, &[]);
    let problem = Problem { path: &path, limits: &l, caps: &[], shortest_span_s: 1e-3 };
    println!("{} spans T {} sweep {} it {}", p.table.spans(), p.table.duration(), Sweep::new(&problem).duration(), p.iterations);
}
