//! The feed table: what is certified, simulated, stored and sent.

pub mod chunk;
pub mod file;
pub mod job;
pub mod messages;
pub mod override_bounds;
pub mod pack;
pub mod stream;
pub mod table;
