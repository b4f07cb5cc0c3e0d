//! Interpolating splines: from way-points to a smooth path.
//!
//! [`knots`] spreads the parameter over the way-points, [`cubic`] finds the C2 cubic through them in O(N), and
//! [`grid`] carries it over exactly to the integer B-spline form of
//! [`GridPath`](crate::geometry::grid_path::GridPath).

pub mod cubic;
pub mod grid;
pub mod knots;
mod tridiagonal;
