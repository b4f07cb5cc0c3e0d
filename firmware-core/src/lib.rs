//! What runs on every motor drive: table store, evaluator, drive state.
//!
//! No allocation, no panic, no `f64`, no `unsafe`; bounded work per tick.
#![no_std]
