//! What runs on every motor drive: table store, evaluator, drive state.
//!
//! No allocation, no panic, no `f64`, no `unsafe`; bounded work per tick. Arithmetic is IEEE + - * / and square
//! root only, so the same source gives the same bits on every machine.
//!
//! [`table`] is the one door: bytes become a [`table::CheckedTable`] or a named error. [`evaluate`] plays a
//! checked table at any path time. [`double_s`] plans motion where there is no table, and
//! [`filter`] follows references that nobody knows ahead.
//!
//! A drive has two halves. [`intake`] talks: messages in, tables checked, answers out. [`motion`] moves: one set-point per
//! control tick. They share no memory and hand each other [`orders`], so that the tick never waits. [`player`] is both on the
//! level of messages; [`drive`] puts them behind CAN frames; [`halves`] is what a board runs. Between frames and [`intake`] stands
//! the [`session`]: it knows which epoch is open, watches over host and drives, and keeps the [`clock`].
#![no_std]

pub mod axis;
pub mod boot;
pub mod clock;
mod course;
pub mod double_s;
pub mod drive;
pub mod evaluate;
pub mod filter;
mod guard;
pub mod halves;
pub mod intake;
mod math;
pub mod motion;
pub mod orders;
mod peers;
pub mod player;
pub mod proof;
mod rate;
pub mod session;
mod store;
pub mod table;
mod telemetry;
pub mod time;
pub mod update;
