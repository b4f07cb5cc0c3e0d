//! What a user hands in: machine files, part programs and way-points.

pub mod gcode;
pub mod machine;
pub mod machine_error;
mod machine_file;
pub mod program;
pub mod samples;
pub mod waypoints;
