//! The numbers behind a report: what moves when, what limits it, and what it is compared with.

pub mod binding;
pub mod cells;
pub mod comparison;
pub mod double_s;
pub mod inspect;
pub mod motion;
pub mod operations;
#[cfg(test)]
pub(crate) mod samples;
pub mod shortfall;
pub mod steady;
