//! Types and bytes that the planner, the bus and the drives agree on. No motion mathematics.
#![no_std]
