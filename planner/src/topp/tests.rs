//! Plans of many kinds of path against an oracle that shares no row code.

mod families;
mod oracle;

use self::families::{Rng, cap, circle, limits, line, settings, walk, zigzag};
use self::oracle::Oracle;
use super::plan;
use super::problem::{Plan, Problem, Settings, Solver};
use super::sweep::Sweep;
use crate::geometry::grid_path::GridPath;
use crate::geometry::section::{FeedCap, SpeedCap};
use crate::job::machine::AxisLimits;

fn planned(name: &str, path: &GridPath, limits: &[AxisLimits], caps: &[FeedCap]) -> Plan {
    let problem = Problem { path, limits, caps, shortest_span_s: 1e-3 };
    let before = std::time::Instant::now();
    let plan = plan(&problem, &settings()).unwrap_or_else(|e| panic!("{name}: {e}"));
    let took = before.elapsed().as_secs_f64();
    println!(
        "{name}: {} spans T {} sweep {} it {} took {took:.4}",
        plan.table.spans(),
        plan.table.duration(),
        Sweep::new(&problem).duration(),
        plan.iterations
    );
    let oracle = Oracle::of(&problem, &plan.table);
    println!("   {oracle:?}");
    oracle.assert_sound(&problem, &plan);
    plan
}

/// Shortest time of a straight move from rest to rest under velocity, acceleration and jerk [Biagiotti2008 3.4].
fn double_s(length: f64, v: f64, a: f64, j: f64) -> f64 {
    let ramp = |v: f64| if v * j >= a * a { v / a + a / j } else { 2.0 * (v / j).sqrt() };
    if v * ramp(v) <= length {
        return 2.0 * ramp(v) + (length - v * ramp(v)) / v;
    }
    let (mut low, mut high) = (0.0, v);
    for _ in 0..200 {
        let mid = 0.5 * (low + high);
        if mid * ramp(mid) <= length { low = mid } else { high = mid }
    }
    2.0 * ramp(low)
}

#[test]
fn exp_lines() {
    for length in [1e-3, 1e-2, 0.1, 1.0, 5.0, 20.0, 60.0, 300.0, 10_000.0] {
        for (v, a, j) in [(100.0, 500.0, 1e4), (500.0, 2000.0, 5e4)] {
            let path = line(&[1.0, 0.0], length, 1);
            let p = planned(&format!("line {length} {v}"), &path, &limits(2, v, a, j), &[]);
            println!("  loss {:.3} %", 100.0 * (p.table.duration() / double_s(length, v, a, j) - 1.0));
        }
    }
}
#[test]
fn exp_va() {
    for length in [1e-3, 0.1, 5.0, 60.0, 10_000.0] {
        let path = line(&[1.0, 0.0], length, 1);
        let p = planned(&format!("va line {length}"), &path, &limits(2, 100.0, 500.0, f64::INFINITY), &[]);
        let t = if length < 20.0 { 2.0 * (length / 500.0f64).sqrt() } else { length / 100.0 + 0.2 };
        println!("  loss {:.3} %", 100.0 * (p.table.duration() / t - 1.0));
    }
    let mut rng = Rng::new(1);
    let path = walk(&mut rng, 3, 40, 8.0, 0.5);
    planned("va walk", &path, &limits(3, 100.0, 500.0, f64::INFINITY), &[]);
}
#[test]
fn exp_walks() {
    let mut rng = Rng::new(1);
    for axes in 1..=9 {
        let path = walk(&mut rng, axes, 40, 8.0, 0.5);
        planned(&format!("walk {axes}"), &path, &limits(axes, 100.0, 500.0, 1e4), &[]);
    }
    let path = zigzag(&mut rng, 600, 0.2);
    planned("zigzag", &path, &limits(2, 100.0, 500.0, 1e4), &[]);
    planned("zigzag fast", &path, &limits(2, 150.0, 1500.0, 5e4), &[]);
    planned(
        "zigzag F",
        &path,
        &limits(2, 150.0, 1500.0, 5e4),
        &cap(&path, SpeedCap::Tangential { axes: 3, speed: 2.0 }),
    );
    let path = circle(10.0, 3.0, 36);
    planned("circle", &path, &limits(2, 100.0, 500.0, 1e4), &[]);
    planned(
        "circle slow",
        &path,
        &limits(2, 100.0, 500.0, 1e4),
        &cap(&path, SpeedCap::Tangential { axes: 3, speed: 0.1 }),
    );
    let path = circle(0.05, 3.0, 36);
    planned("circle small", &path, &limits(2, 100.0, 500.0, 1e4), &[]);
}
