//! Plans one long random spline in a process of its own and says what it took, as one line of JSON.
//!
//!     cargo run --release -p planner --example scale -- AXES LEGS THREADS [whole]
//!
//! Ten spans of q belong to each leg. `whole` plans in one piece, whatever the length.
#![allow(clippy::expect_used, reason = "a measurement stops on an error")]

#[path = "../benches/planning/paths.rs"]
mod paths;

use std::process::ExitCode;
use std::time::Instant;

use planner::certificate::certify;
use planner::topp::plan;
use planner::topp::problem::{Problem, Settings, Windows};

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let numbers: Vec<usize> = words.iter().take(3).filter_map(|w| w.parse().ok()).collect();
    let &[axes, legs, threads] = numbers.as_slice() else {
        eprintln!("expected: AXES LEGS THREADS [whole]");
        return ExitCode::from(2);
    };
    let windows = if words.get(3).is_some_and(|w| w == "whole") { Windows::Whole } else { Windows::Overlap };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
    let path = paths::random_spline(axes, legs);
    let limits = paths::limits(axes);
    let problem = Problem { path: &path, limits: &limits, caps: &[], control_tick_s: 1e-3 };
    // One solution, on knots as they are first placed.
    let settings = Settings { windows, largest_loss: f64::INFINITY, ..Settings::default() };
    let (begin, before) = (Instant::now(), cpu_seconds());
    let answer = pool.install(|| plan(&problem, &settings)).expect("a random spline has a plan");
    let seconds = begin.elapsed().as_secs_f64();
    let (peak, cpu) = (peak_mib(), cpu_seconds());
    let certificate = certify(&answer.table, &limits, &[]);
    let ratios = [certificate.velocity_ratio, certificate.acceleration_ratio, certificate.jerk_ratio];
    println!(
        "{{\"axes\": {axes}, \"threads\": {threads}, \"windows\": \"{windows:?}\", \"spans\": {}, \"seconds\": {seconds:.4}, \
         \"cpu_seconds\": {:.2}, \"cpu_us_per_span\": {:.2}, \"peak_mib\": {peak:.1}, \"time_s\": {:.6}, \"iterations\": {}, \"largest_ratio\": {:.9}, \
         \"holds\": {}}}",
        answer.table.spans(),
        cpu - before,
        1e6 * (cpu - before) / answer.table.spans() as f64,
        answer.table.duration(),
        answer.iterations,
        ratios.into_iter().fold(0.0, f64::max),
        certificate.holds
    );
    if certificate.holds { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Time that the threads of this process have run [s], to a hundredth: on a busy machine it says more than the wall
/// clock. 0 where the system does not tell.
fn cpu_seconds() -> f64 {
    const TICKS_PER_SECOND: f64 = 100.0;
    let status = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // Fields 14 and 15, counted from behind the name in parentheses, which is the second.
    let fields = status.rsplit(')').next().unwrap_or_default().split_whitespace();
    fields.skip(11).take(2).filter_map(|f| f.parse::<f64>().ok()).sum::<f64>() / TICKS_PER_SECOND
}

/// Most memory that the process has held so far [MiB]; 0 where the system does not tell.
fn peak_mib() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|l| l.trim().trim_end_matches("kB").trim().parse::<f64>().ok()).unwrap_or(0.0) / 1024.0
}
