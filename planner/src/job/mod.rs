//! What a user hands in: machine files and part programs.

pub mod machine;
pub mod program;
