//! What the images need of the board.
#![no_std]

pub mod images;
pub mod stack;
pub mod steps;
pub mod uart;
pub mod workload;

/// The core's clock [Hz], also SysTick's.
pub const CLOCK_HZ: u32 = 25_000_000;
