//! Oracles, generators and shared pieces of the whole-product suites.

pub mod tables;
