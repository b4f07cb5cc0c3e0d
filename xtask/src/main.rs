//! One front door for building, checking and measuring: `cargo xtask <word>`.

mod firmware;
mod fuzz;
mod names;
mod peers;
mod real;
mod scale;
mod shell;
mod tests;
mod vcan;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use shell::{Step, cargo, run_all};

/// Builds, checks and measures the workspace.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct Cli {
    #[command(subcommand)]
    word: Word,
}

/// What to do.
#[derive(Debug, Subcommand)]
enum Word {
    /// Format every crate
    Fmt,
    /// Clippy on every target, warnings are errors
    Lint,
    /// Everything that has to pass: format, lints, names in the documentation, all tests, the drive's images, a real bus
    Test,
    /// Run the benches; what they measure is in docs/benchmarks.md
    Bench {
        /// Then run other planners on the same paths, and print one table with ratios
        #[arg(long)]
        peers: bool,
    },
    /// Plan paths of up to a million spans and print time and memory of each
    Scale,
    /// Build the documentation, warnings are errors
    Doc,
    /// What a change has to pass before it goes in: test, doc and a release build
    Ci,
    /// Build the drive's images, hold them to their gates, and prove that an emulated Cortex-M4F computes the same bits
    Firmware,
    /// Check that what docs/architecture.md and the README name exists
    Names,
    /// Plan many random paths under random limits and check every plan
    RandomPaths {
        /// How many
        #[arg(long, default_value_t = 10_000)]
        count: u64,
        /// Which
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// The first one looked at
        #[arg(long, default_value_t = 0)]
        from: u64,
    },
    /// Plan random motions from state to state beside another planner, and integrate every one of them
    DoubleS {
        /// How many of each kind
        #[arg(long, default_value_t = 1_000_000)]
        count: u64,
        /// Which
        #[arg(long, default_value_t = 1)]
        seed: u64,
    },
    /// Feed everything that reads bytes of others with bytes that nobody would send
    Fuzz {
        /// For how long, each target [s]
        #[arg(long, default_value_t = 60)]
        seconds: u64,
    },
    /// Run a session on a genuine CAN bus of Linux, inside an emulated machine
    Vcan,
    /// Run the release binary over a folder of part programs and print a table
    Real {
        /// The folder; sub-folders are searched, .gz files are unpacked with gzip
        dir: PathBuf,
        /// Machine file for all of them
        #[arg(long)]
        machine: Option<PathBuf>,
    },
}

fn main() -> ExitCode {
    let root = root();
    let result = match Cli::parse().word {
        Word::Fmt => cargo(&root, &["fmt", "--all"]),
        Word::Lint => lint(&root),
        Word::Test => test(&root),
        Word::Bench { peers } => bench(&root, peers),
        Word::Scale => scale::run(&root),
        Word::Doc => doc(&root),
        Word::Ci => run_all(&[
            ("test", &|| test(&root)),
            ("doc", &|| doc(&root)),
            ("release build", &|| cargo(&root, &["build", "--release"])),
        ]),
        Word::Firmware => firmware::run(&root),
        Word::Names => names::check(&root),
        Word::RandomPaths { count, seed, from } => random_paths(&root, count, seed, from),
        Word::DoubleS { count, seed } => double_s(&root, count, seed),
        Word::Fuzz { seconds } => fuzz::run(&root, seconds),
        Word::Vcan => vcan::run(&root),
        Word::Real { dir, machine } => real::table(&root, &dir, machine.as_deref()),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("xtask: {message}");
            ExitCode::FAILURE
        }
    }
}

/// The workspace: the folder above this crate.
fn root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().unwrap_or(here).to_path_buf()
}

fn lint(root: &Path) -> Step {
    cargo(root, &["clippy", "--workspace", "--all-targets", "--locked", "--", "-D", "warnings"])
}

/// The benches, and after them the peers if wanted.
fn bench(root: &Path, peers: bool) -> Step {
    cargo(root, &["bench", "--workspace", "--locked", "--bench", "*"])?;
    if peers { peers::run(root) } else { Ok(()) }
}

fn random_paths(root: &Path, count: u64, seed: u64, from: u64) -> Step {
    let [count, seed, from] = [count, seed, from].map(|n| n.to_string());
    shell::cargo_with(
        root,
        &[
            "test",
            "--release",
            "--locked",
            "--package",
            "tests",
            "--test",
            "random_paths",
            "--",
            "--nocapture",
        ],
        &[("FEEDSPLINE_CASES", &count), ("FEEDSPLINE_SEED", &seed), ("FEEDSPLINE_FROM", &from)],
    )
}

/// The core's own random tests in larger numbers, then the comparison with a peer.
fn double_s(root: &Path, count: u64, seed: u64) -> Step {
    /// Cases of each kind in the core's tests, about.
    const TESTED: u64 = 40_000;
    let times = count.div_ceil(TESTED).to_string();
    let [count, seed] = [count, seed].map(|n| n.to_string());
    shell::cargo_with(
        root,
        &["test", "--release", "--locked", "--package", "firmware-core", "double_s"],
        &[("FEEDSPLINE_CASES", &times), ("FEEDSPLINE_SEED", &seed)],
    )?;
    let manifest = ["--manifest-path", "tests/peers/Cargo.toml", "--target-dir", "target"];
    let words =
        [&["run", "--release", "--locked", "--bin", "double_s"][..], &manifest, &["--", &count, &seed]];
    cargo(root, &words.concat())
}

fn doc(root: &Path) -> Step {
    shell::cargo_with(
        root,
        &["doc", "--workspace", "--no-deps", "--locked"],
        &[("RUSTDOCFLAGS", "-D warnings")],
    )
}

/// Goes on after a failed step, so that one run tells of everything.
fn test(root: &Path) -> Step {
    run_all(&[
        ("format", &|| cargo(root, &["fmt", "--all", "--check"])),
        ("lints", &|| lint(root)),
        ("names", &|| names::check(root)),
        ("tests", &|| tests::run(root)),
        ("firmware", &|| firmware::run(root)),
        ("real bus", &|| vcan::run(root)),
    ])
}
