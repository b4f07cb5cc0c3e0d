//! The failures that a motion on a CAN bus has to survive, one test each: no axis moves that should not, all come to rest, on the
//! path where the stop is one on the path, and no fault is hidden.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

#[path = "bus_failures/controllers.rs"]
mod controllers;
#[path = "bus_failures/hosts.rs"]
mod hosts;
#[path = "bus_failures/messages.rs"]
mod messages;
#[path = "bus_failures/stops.rs"]
mod stops;
