//! The path: from programmed primitives to a C2 cubic spline on an integer grid, certified within a tolerance.

pub mod grid_path;
pub mod section;
