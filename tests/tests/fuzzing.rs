//! The bodies of the fuzzing targets on random and on changed valid inputs.
//!
//! `FEEDSPLINE_FUZZ_SECONDS` asks for a longer time for each of them, `FEEDSPLINE_SEED` for other inputs.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::time::{Duration, Instant};

use planner::feed::file::FeedReader;
use protocol::message::{HostMessage, decode};
use tests::drives::asked;
use tests::fuzzing::{TARGETS, lives, run};

/// Inputs of a target in a usual run.
fn usual(name: &str) -> u64 {
    match name {
        "receiver" => 30_000,
        "table" | "feed_file" => 100_000,
        _ => 300_000,
    }
}

/// Without that the bodies would look at beginnings only.
#[test]
fn inputs_to_begin_with_lead_far() {
    let of = |name: &str| (TARGETS.iter().find(|target| target.name == name).unwrap().seeds)();
    let moves = of("receiver").iter().filter(|input| lives(input)).count();
    assert!(moves >= 7, "{moves} of the drives move");
    for input in of("feed_file") {
        let file = FeedReader::new(&input[..]).and_then(FeedReader::read_all);
        assert!(file.is_ok(), "{file:?}");
    }
    for input in of("host_message") {
        assert!(decode::<HostMessage<'_>>(&input).is_ok());
    }
}

#[test]
fn no_bytes_break_a_decoder_or_a_drive() {
    let (seconds, seed) = (asked("FEEDSPLINE_FUZZ_SECONDS", 0), asked("FEEDSPLINE_SEED", 1));
    for target in &TARGETS {
        let began = Instant::now();
        let usual = usual(target.name);
        let long = Duration::from_secs(seconds);
        // The clock decides how many inputs there are, never what comes of one.
        let count = run(target, seed, |count| count >= usual && (seconds == 0 || began.elapsed() >= long));
        println!("{:<14} {count:>10} executions in {:.1} s", target.name, began.elapsed().as_secs_f64());
        assert!(count >= usual);
    }
}
