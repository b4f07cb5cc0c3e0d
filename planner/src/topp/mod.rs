//! Time-optimal path parameterisation: the fastest motion along a path under its limits.

pub mod problem;
