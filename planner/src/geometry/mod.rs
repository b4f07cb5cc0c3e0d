//! The path: from programmed primitives to a C2 cubic spline on an integer grid, certified within a tolerance.
//!
//! [`sections::sections`] gathers the program's moves until motion must rest, `contour` lays them out over their
//! arc length, `fit` finds a spline inside the tolerance, `round` puts it on the integer grid, `certify` proves
//! how far the rounded spline can be from the programmed contour, and `marks` says which place belongs to which
//! line and feed.

mod certify;
mod contour;
mod fit;
mod gather;
pub mod grid_path;
mod knots;
mod marks;
mod round;
pub mod section;
pub mod sections;
