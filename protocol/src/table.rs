//! The feed table on the wire: two headers and three streams of varints.
//!
//! The **shared part** is the same for all axes and sent once: where the geometry knots lie
//! ([`geometry`]), and how the spans of q(u) = (du/dt)^2 divide the path and which value each has
//! ([`span`]). The **axis part** belongs to one drive: the control points of its cubic spline ([`control`]).
//! Each stream is read forward only, one entry at a time, in constant memory; knowing the geometry knots ahead
//! of q costs nothing, because they have a stream of their own.

pub mod control;
mod error;
pub mod geometry;
mod header;
pub mod rules;
pub mod span;
pub mod warp;

pub use error::{AxisLimit, HeaderField, Stream, TableError};
pub use header::{AxisHeader, FORMAT_VERSION, Joint, Limits, TableHeader};
pub use warp::Warp;

#[cfg(test)]
mod tests;
