//! The report: one HTML file that needs nothing else.
//!
//! [`record::Recorder`] thins the motion out, [`model::Report`] holds all that is shown, [`page`] writes it.
//! The plots are drawn by `report.js` from numbers embedded in the page; everything else is plain HTML.

pub mod colour;
mod data;
mod envelope;
mod html;
pub mod model;
pub mod operations;
pub mod record;
mod sections;
pub mod simplify;
mod tables;
pub mod words;

pub use html::page;
