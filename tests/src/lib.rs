//! Oracles, generators and shared pieces of the whole-product suites.

pub mod oracle;
pub mod tables;
