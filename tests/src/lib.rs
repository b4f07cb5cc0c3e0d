//! Oracles, generators and shared pieces of the whole-product suites.

pub mod bandwidth;
pub mod chain;
pub mod drives;
pub mod fleet;
pub mod fuzzing;
pub mod judge;
pub mod meander;
pub mod oracle;
pub mod scene;
pub mod tables;
