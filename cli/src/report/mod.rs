//! The report: one HTML file that needs nothing else.
//!
//! [`record::Recorder`] thins the motion out, [`model::Report`] holds all that is shown, [`page`] writes it.
//! [`compare`] does the same for methods side by side. The plots are drawn by scripts from numbers embedded in the page; everything else is plain HTML.

pub mod colour;
pub mod compare;
mod data;
mod envelope;
mod html;
pub mod model;
pub mod record;
mod sections;
pub mod simplify;
mod tables;
pub mod words;

pub use html::page;
