//! Simulated drives, servos, plants and bus around the shipped firmware core.

pub mod axis_scale;
pub mod encoder;
pub mod plant;
pub mod servo;
