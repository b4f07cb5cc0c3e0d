//! Turns a job into the fastest motion a machine's limits allow, as a certified feed table.
//!
//! The data's way: [`job`] reads machine files, part programs and way-points; [`geometry`] turns the
//! programmed contour into a C2 cubic spline inside the tolerance, [`splines`] runs one through way-points; [`topp`]
//! finds the fastest motion along it; [`feed`] rounds and packs that motion as a feed table; [`certificate`] proves
//! the rounded table against every limit. [`pipeline`] runs them in order.

pub mod analysis;
pub mod certificate;
pub mod feed;
pub mod geometry;
pub mod job;
pub mod pipeline;
pub mod splines;
pub mod tolerances;
pub mod topp;
