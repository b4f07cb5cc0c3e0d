//! What runs on every motor drive: table store, evaluator, drive state.
//!
//! No allocation, no panic, no `f64`, no `unsafe`; bounded work per tick. Arithmetic is IEEE + - * / and square
//! root only, so the same source gives the same bits on every machine.
//!
//! [`table`] is the one door: bytes become a [`table::CheckedTable`] or a named error. [`evaluate`] plays a
//! checked table at any path time. [`double_s`] plans motion where there is no table. [`player`] is the axis' state machine on the level of messages;
//! [`drive`] puts it behind CAN frames.
#![no_std]

mod course;
pub mod double_s;
pub mod drive;
pub mod evaluate;
mod math;
pub mod player;
pub mod proof;
mod store;
pub mod table;
mod telemetry;
pub mod time;
