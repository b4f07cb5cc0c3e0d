//! The `feedspline` command.
fn main() {}
