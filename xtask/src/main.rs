//! One front door for building, checking and measuring.
fn main() {}
