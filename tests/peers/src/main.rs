//! This planner and others on the same paths, one after the other in one process group, and what each took.
//!
//! `cargo xtask bench --peers` runs it. It prints a table and writes it as JSON to the file that is named first.

mod python;
mod rival;
mod sample;
mod table;

#[path = "../../../planner/benches/planning/paths.rs"]
mod paths;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use planner::topp;
use planner::topp::problem::{Plan, Problem, Settings, Solver};
use planner::topp::sweep::{Samples, Sweeper};

use rival::{Choice, Form};
use sample::Sampled;
use table::{Row, Table};

/// Stations of the sweeps.
const STATIONS: [usize; 2] = [1_000, 10_000];
/// Geometry spans that make about a thousand spans of q.
const LEGS: usize = 100;
/// Settings of copp: its own, and what made it faster or its answer better in trials. Its second-order cones with
/// equilibration take two to four times as long and settle at a longer time.
const CHOICES: [Choice; 4] = [
    Choice { form: Form::Linear, equilibrate: true, adaptive: false },
    Choice { form: Form::Linear, equilibrate: false, adaptive: false },
    Choice { form: Form::Linear, equilibrate: false, adaptive: true },
    Choice { form: Form::Conic, equilibrate: false, adaptive: false },
];
/// Repeats of short and of long runs; the least time counts.
const REPEATS: usize = 9;
const FEW: usize = 3;

fn main() -> ExitCode {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let mut table = Table::default();
    let result = sweeps(&mut table, arguments.nth(1)).and_then(|()| plans(&mut table));
    print!("{}", table.text());
    let written = std::env::args_os().nth(1).map(|path| std::fs::write(path, table.json()));
    match (result, written) {
        (Ok(()), None | Some(Ok(()))) => ExitCode::SUCCESS,
        (Err(message), _) => {
            eprintln!("peers: {message}");
            ExitCode::FAILURE
        }
        (_, Some(Err(error))) => {
            eprintln!("peers: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Velocity and acceleration, seven axes.
fn sweeps(table: &mut Table, python: Option<PathBuf>) -> Result<(), String> {
    for stations in STATIONS {
        let path = paths::random_spline(7, stations / 100);
        let limits = paths::limits(7);
        let sampled = Sampled::new(&path, stations);
        let [first, second] = [sampled.by_axis(1), sampled.by_axis(2)];
        let samples = Samples::new(sampled.stations.clone(), &first, &second).map_err(|e| e.to_string())?;
        let mut sweeper = Sweeper::new();
        let mut time = 0.0;
        let mut ours = f64::INFINITY;
        // Once more than the others: the first sweep allocates.
        for _ in 0..=REPEATS {
            let begin = Instant::now();
            let q = sweeper.sweep(&samples, &limits).map_err(|e| e.to_string())?;
            ours = ours.min(begin.elapsed().as_secs_f64());
            time = traverse(&sampled.stations, q);
        }
        let item = format!("sweep, 7 axes, {stations} stations");
        table.push(Row::ours(&item, "sweep", ours, time));
        let mut rival = rival::second_order(&sampled, &limits).map_err(|e| e.to_string())?;
        for _ in 1..REPEATS {
            let again = rival::second_order(&sampled, &limits).map_err(|e| e.to_string())?;
            rival.setup = rival.setup.min(again.setup);
            rival.compute = rival.compute.min(again.compute);
        }
        table.push(Row::peer(&item, "copp TOPP2-RA, compute only", rival.compute, rival.time, ours));
        table.push(Row::peer(
            &item,
            "copp TOPP2-RA, set-up included",
            rival.setup + rival.compute,
            rival.time,
            ours,
        ));
        let Some(python) = &python else {
            eprintln!("peers: SKIPPED toppra: no python with it was named");
            continue;
        };
        let peer = python::toppra(python, &sampled, &limits[0], FEW)?;
        table.push(Row::peer(
            &item,
            &format!("{}, seidel, compute only", peer.name),
            peer.compute,
            peer.time,
            ours,
        ));
        table.push(Row::peer(
            &item,
            &format!("{}, set-up included", peer.name),
            peer.setup + peer.compute,
            peer.time,
            ours,
        ));
    }
    Ok(())
}

/// Time of q linear between stations [s].
fn traverse(stations: &[f64], q: &[f64]) -> f64 {
    stations
        .windows(2)
        .zip(q.windows(2))
        .map(|(u, q)| 2.0 * (u[1] - u[0]) / (q[0].sqrt() + q[1].sqrt()))
        .sum()
}

/// Minimum time under jerk limits.
fn plans(table: &mut Table) -> Result<(), String> {
    for axes in [3, 7] {
        let path = paths::random_spline(axes, LEGS);
        let limits = paths::limits(axes);
        let problem = Problem { path: &path, limits: &limits, caps: &[], control_tick_s: 1e-3 };
        // One solution, on knots as they are first placed.
        let once = Settings { largest_loss: f64::INFINITY, ..Settings::default() };
        let (plan, ours) = timed(&problem, &once, REPEATS)?;
        let spans = plan.table.spans();
        let item = format!("true jerk, {axes} axes, {spans} spans");
        let name = format!("interior point, certified, {} iterations", plan.iterations);
        table.push(Row::ours(&item, &name, ours, plan.table.duration()));
        let settings = Settings { solver: Solver::Clarabel, ..once };
        let (other, seconds) = timed(&problem, &settings, 1)?;
        let name = format!("Clarabel on the same rows, {} iterations", other.iterations);
        table.push(Row::peer(&item, &name, seconds, other.table.duration(), ours));
        let sampled = Sampled::new(&path, spans + 1);
        for choice in CHOICES {
            let name = format!(
                "copp TOPP3-{}, {} stations{}{}",
                if choice.form == Form::Linear { "LP" } else { "SOCP" },
                spans + 1,
                if choice.equilibrate { "" } else { ", no equilibration" },
                if choice.adaptive { ", adaptive" } else { "" }
            );
            match rival::third_order(&sampled, &limits, choice) {
                Ok(run) => {
                    let settled = if run.settled { "converged" } else { "not converging" };
                    let name = format!("{name}, {settled} in {}", run.steps);
                    table.push(Row::peer(&item, &name, run.converged, run.time, ours));
                    table.push(Row::peer(&item, "  its first step", run.first, run.first_time, ours));
                }
                Err(error) => eprintln!("peers: {item}: {name}: {error}"),
            }
        }
    }
    Ok(())
}

/// The plan and the least time of some repeats [s].
fn timed(problem: &Problem, settings: &Settings, repeats: usize) -> Result<(Plan, f64), String> {
    let mut least = f64::INFINITY;
    let mut plan = None;
    for _ in 0..repeats {
        let begin = Instant::now();
        plan = Some(topp::plan(problem, settings).map_err(|e| e.to_string())?);
        least = least.min(begin.elapsed().as_secs_f64());
    }
    plan.map(|plan| (plan, least)).ok_or_else(|| "no repeats".to_string())
}
