//! Independent checkers: they share nothing with the code they judge but the meaning of a table's integers.

pub mod cone;
pub mod dense;
pub mod deviation;
pub mod random_table;
pub mod real;
pub mod spline;
pub mod sweep;
