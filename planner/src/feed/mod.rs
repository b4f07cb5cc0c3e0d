//! The feed table: what is certified, simulated, stored and sent.

pub mod job;
pub mod table;
