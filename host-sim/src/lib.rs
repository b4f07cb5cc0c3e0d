//! Simulated drives, servos, plants and bus around the shipped firmware core.

pub mod axis_loop;
pub mod axis_scale;
pub mod bus;
pub mod drive_node;
pub mod encoder;
pub mod host_node;
pub mod plant;
pub mod recording;
pub mod reference;
pub mod report;
pub mod scenario;
pub mod servo;
pub mod setpoint_hash;
pub mod statistics;
pub mod trace;
