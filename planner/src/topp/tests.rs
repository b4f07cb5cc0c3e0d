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
#[test]
fn exp_big() {
    let mut rng = Rng::new(1);
    for (axes, spans) in [(3, 140), (3, 13_500), (7, 140), (3, 1350)] {
        let path = walk(&mut rng, axes, spans, 8.0, 0.5);
        let l = limits(axes, 100.0, 500.0, 1e4);
        let problem = Problem { path: &path, limits: &l, caps: &[], shortest_span_s: 1e-3 };
        for _ in 0..2 {
            let before = std::time::Instant::now();
            let p = plan(&problem, &settings()).unwrap();
            let took = before.elapsed().as_secs_f64();
            println!(
                "{axes} axes: {} spans T {} it {} took {took:.4} {:.2} us/span",
                p.table.spans(),
                p.table.duration(),
                p.iterations,
                1e6 * took / p.table.spans() as f64
            );
        }
    }
}
#[test]
fn exp_clarabel() {
    let mut rng = Rng::new(1);
    for (axes, spans, turn) in [(2, 20, 0.5), (3, 40, 0.5), (7, 20, 0.5), (3, 40, 1.5), (1, 5, 0.1)] {
        let path = walk(&mut rng, axes, spans, 8.0, turn);
        let l = limits(axes, 100.0, 500.0, 1e4);
        let problem = Problem { path: &path, limits: &l, caps: &[], shortest_span_s: 1e-3 };
        let p = plan(&problem, &Settings { relative_gap: 1e-6, ..settings() }).unwrap();
        let before = std::time::Instant::now();
        let c =
            plan(&problem, &Settings { solver: Solver::Clarabel, relative_gap: 1e-6, ..settings() }).unwrap();
        println!(
            "{} {} {} {} {} took {:.3}",
            p.table.spans(),
            p.table.duration(),
            c.table.duration(),
            p.iterations,
            c.iterations,
            before.elapsed().as_secs_f64()
        );
    }
}
#[test]
fn exp_random() {
    let from: u64 = std::env::var("SEED").map_or(0, |s| s.parse().unwrap());
    for seed in from..from + 400 {
        let mut rng = Rng::new(seed);
        let axes = 1 + (rng.unit() * 9.0) as usize;
        let scale = 10f64.powf(rng.within(-3.0, 3.0));
        let spans = 1 + (rng.unit() * 40.0) as usize;
        let turn = 10f64.powf(rng.within(-2.0, 0.7));
        let path = walk(&mut rng, axes, spans, scale, turn);
        let l: Vec<AxisLimits> = (0..axes)
            .map(|_| AxisLimits {
                velocity: 10f64.powf(rng.within(-1.0, 4.0)),
                acceleration: 10f64.powf(rng.within(0.0, 5.0)),
                jerk: 10f64.powf(rng.within(1.0, 7.0)),
            })
            .collect();
        let problem = Problem { path: &path, limits: &l, caps: &[], shortest_span_s: 1e-3 };
        if std::env::var("SAY").is_ok() {
            println!(
                "{seed}: axes {axes} scale {scale} spans {spans} turn {turn} {l:?} sweep {}",
                Sweep::new(&problem).duration()
            );
        }
        if Sweep::new(&problem).duration() > 60.0 {
            println!("{seed} skipped");
            continue;
        }
        let before = std::time::Instant::now();
        match plan(&problem, &settings()) {
            Err(e) => println!("{seed}: {e}"),
            Ok(p) => {
                let o = Oracle::of(&problem, &p.table);
                let took = before.elapsed().as_secs_f64();
                let bad = o.velocity.max(o.acceleration).max(o.jerk) > 1.0 + 1e-6
                    || o.curved > 0.25
                    || o.longest_s >= 1.0
                    || o.shortest_s < 0.999e-3;
                let sw = Sweep::new(&problem).duration();
                if bad
                    || p.table.spans() > 20000
                    || took > 0.5
                    || p.table.duration() < 0.995 * sw
                    || p.table.duration() > 4.0 * sw
                {
                    println!(
                        "{seed}: {} spans T {} sweep {sw} it {} took {took:.4} {o:?}",
                        p.table.spans(),
                        p.table.duration(),
                        p.iterations
                    );
                }
            }
        }
    }
}
#[test]
fn exp_one() {
    let path = line(&[1.0, 0.0], 1.0, 1);
    let p = planned("line", &path, &limits(2, 100.0, 500.0, 1e4), &[]);
    for i in 1..p.table.spans() - 1 {
        let crate::feed::table::SpanLaw::Quadratic { h, q } = p.table.law(i) else { continue };
        let e = q[0] + h * (q[1] + h * q[2]);
        println!(
            "{i} h {h:.4} v {:.3} {:.3} a {:.1} {:.1} j {:.0} {:.0} T {:.5} {:?}",
            q[0].sqrt(),
            e.sqrt(),
            q[1] / 2.0,
            q[1] / 2.0 + q[2] * h,
            q[2] * q[0].sqrt(),
            q[2] * e.sqrt(),
            p.table.law(i).duration(),
            p.binding[i]
        );
    }
}
