//! Simulated drives, servos, plants and bus around the shipped firmware core.
//!
//! [`scenario::simulate`] plays a planned job to its end: a [`host_node`] sends its tables over a [`bus`] in virtual
//! time to one [`drive_node`] per axis, which runs the very core that drives run; behind each set-point an
//! [`axis_loop`] closes [`encoder`], [`servo`] and [`plant`]. Meanwhile [`recording`] compares set-points with the
//! plan ([`planner::analysis::motion`]), hashes them, feeds the [`trace`] and gathers the [`statistics`] of the
//! [`report`]. A [`fleet`] has a clock for every drive instead, for what goes wrong between them. Everything runs in one thread and in one order: two runs are the same to the bit.

pub mod axis_loop;
pub mod axis_scale;
pub mod bus;
pub mod drive_node;
pub mod emulator;
pub mod encoder;
pub mod flash_memory;
pub mod fleet;
pub mod group;
pub mod host_node;
pub mod live;
pub mod plant;
pub mod recording;
pub mod report;
pub mod scenario;
pub mod serial_port;
pub mod servo;
pub mod setpoint_hash;
pub mod slcan_line;
pub mod statistics;
pub mod trace;
pub mod update;
