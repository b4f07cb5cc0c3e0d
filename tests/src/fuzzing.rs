//! What has to hold for any bytes whatever: one body for each decoder, and one for a whole drive.
//!
//! Every body is a plain function of bytes that panics when something does not hold. `fuzz/` lets a fuzzer look for such bytes;
//! [`run`] tries random ones and changed valid ones in this process, the same ones for each seed.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::missing_panics_doc,
    reason = "a body fails by panicking"
)]

mod decoders;
mod receiver;
mod seeds;

pub use decoders::{
    drive_message, feed_file, frame, host_message, reassembler, slcan, streams, table, varint,
};
pub use receiver::{lives, receiver};

use crate::tables::Random;

/// One body with valid inputs to begin with.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// Its name, which is that of its fuzzing target too.
    pub name: &'static str,
    /// The body.
    pub body: fn(&[u8]),
    /// Inputs that lead far into it.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// Longest random input.
    pub longest: usize,
}

/// All of them.
pub const TARGETS: [Target; 10] = [
    Target { name: "frame", body: frame, seeds: seeds::frame, longest: 70 },
    Target { name: "slcan", body: slcan, seeds: seeds::slcan, longest: 300 },
    Target { name: "reassembler", body: reassembler, seeds: seeds::reassembler, longest: 500 },
    Target { name: "host_message", body: host_message, seeds: seeds::host_message, longest: 120 },
    Target { name: "drive_message", body: drive_message, seeds: seeds::drive_message, longest: 120 },
    Target { name: "varint", body: varint, seeds: seeds::varint, longest: 40 },
    Target { name: "streams", body: streams, seeds: seeds::streams, longest: 200 },
    Target { name: "table", body: table, seeds: seeds::table, longest: 400 },
    Target { name: "feed_file", body: feed_file, seeds: seeds::feed_file, longest: 400 },
    Target { name: "receiver", body: receiver, seeds: seeds::receiver, longest: 300 },
];

/// Tries inputs until `enough` says so; how many there were.
pub fn run(target: &Target, seed: u64, mut enough: impl FnMut(u64) -> bool) -> u64 {
    let seeds = (target.seeds)();
    let mut random = Random::new(seed);
    seeds.iter().for_each(|input| (target.body)(input));
    let mut count = seeds.len() as u64;
    while !enough(count) {
        let mut input = match random.whole(0, 3) {
            0 => noise(&mut random, target.longest),
            _ => seeds[random.whole(0, seeds.len() as u64 - 1) as usize].clone(),
        };
        for _ in 0..random.whole(0, 4) {
            change(&mut input, &mut random, &seeds);
        }
        (target.body)(&input);
        count += 1;
    }
    count
}

fn noise(random: &mut Random, longest: usize) -> Vec<u8> {
    (0..random.whole(0, longest as u64)).map(|_| random.bits() as u8).collect()
}

/// Changes, removes, doubles or moves bytes, or puts pieces of two inputs together.
fn change(input: &mut Vec<u8>, random: &mut Random, seeds: &[Vec<u8>]) {
    if input.is_empty() {
        input.extend(noise(random, 8));
        return;
    }
    let last = input.len() as u64 - 1;
    let at = random.whole(0, last) as usize;
    match random.whole(0, 7) {
        0 => input[at] ^= 1 << random.whole(0, 7),
        1 => input[at] = random.bits() as u8,
        2 => input[at] = [0, 1, 0x7f, 0x80, 0xff][random.whole(0, 4) as usize],
        3 => {
            let until = (at + random.whole(1, 8) as usize).min(input.len());
            input.drain(at..until);
        }
        4 => {
            let more = noise(random, 8);
            input.splice(at..at, more);
        }
        5 => {
            let until = (at + random.whole(1, 32) as usize).min(input.len());
            let piece = input[at..until].to_vec();
            let to = random.whole(0, last) as usize;
            input.splice(to..to, piece);
        }
        6 => input.truncate(at),
        _ => {
            let other = &seeds[random.whole(0, seeds.len() as u64 - 1) as usize];
            let from = random.whole(0, other.len() as u64) as usize;
            input.truncate(at);
            input.extend_from_slice(&other[from..]);
        }
    }
}
