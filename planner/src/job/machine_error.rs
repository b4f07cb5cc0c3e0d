//! What can be wrong with a machine file, and where.

use std::fmt;

use miette::{Diagnostic, LabeledSpan, NamedSource, SourceCode};
use thiserror::Error;

/// A machine file is refused.
///
/// Shown as `file:line:column: what`; as a [`Diagnostic`] it carries the file's text, a label and help.
#[derive(Debug, Clone)]
pub struct MachineError(Box<Details>);

#[derive(Debug, Clone)]
struct Details {
    name: String,
    kind: MachineErrorKind,
    source: Option<Place>,
}

#[derive(Debug, Clone)]
struct Place {
    text: NamedSource<String>,
    offset: usize,
    length: usize,
    line: u32,
    column: u32,
}

/// What is wrong with a machine file.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs, reason = "the fields are what the messages show")]
pub enum MachineErrorKind {
    /// The file cannot be read.
    #[error("cannot be read: {reason}")]
    Unreadable { reason: String },
    /// The file is larger than any machine file.
    #[error("is larger than {limit_bytes} bytes")]
    TooLarge { limit_bytes: u64 },
    /// Not TOML, an unknown or missing key, or a value of the wrong type.
    #[error("{message}")]
    Toml { message: String },
    /// A value outside its range.
    #[error("{key} is {value}")]
    OutOfRange { key: &'static str, value: f64, expected: &'static str },
    /// The travel is empty.
    #[error("travel runs from {min} to {max}")]
    TravelOrder { min: f64, max: f64 },
    /// The travel does not hold the place where programs start.
    #[error("travel {min} to {max} does not contain 0")]
    TravelWithoutZero { min: f64, max: f64 },
    /// A stored position outside the travel.
    #[error("{key} of axis {axis} is {value}, outside its travel {min} to {max}")]
    OutsideTravel { key: &'static str, axis: String, value: f64, min: f64, max: f64 },
    /// The travel in counts does not fit a drive's position.
    #[error("travel and counts_per_unit give {counts:.0} counts")]
    TooManyCounts { counts: f64 },
    /// The machine has no axes.
    #[error("no [[axis]] is described")]
    NoAxes,
    /// The machine has too many axes.
    #[error("{count} axes are described")]
    TooManyAxes { count: usize, most: usize },
    /// An axis name that cannot be used.
    #[error("axis name {name:?} cannot be used")]
    AxisName { name: String },
    /// Two axes of one name.
    #[error("axis {name} is described twice")]
    AxisTwice { name: String },
    /// A position of an axis that is not described.
    #[error("{key} names axis {name}, which is not described")]
    AxisUnknown { key: &'static str, name: String },
    /// A unit that does not suit the kind of axis.
    #[error("a {kind} axis cannot be measured in {unit}")]
    UnitOfKind { kind: &'static str, unit: &'static str },
    /// Rotary axes in degrees beside rotary axes in radians.
    #[error("some rotary axes are in deg, this one is in rad or the other way round")]
    MixedRotaryUnits,
    /// A key that belongs to the other kind of axis.
    #[error("{key} does not belong to a {kind} axis")]
    KeyOfKind { key: &'static str, kind: &'static str, instead: &'static str },
    /// Two tools of one number.
    #[error("tool {number} is described twice")]
    ToolTwice { number: u32 },
}

impl MachineErrorKind {
    fn help(&self) -> String {
        use MachineErrorKind as K;
        match self {
            K::Unreadable { .. } => "give the path of a machine file, such as jobs/mill3.toml".into(),
            K::TooLarge { .. } => "give a machine file (TOML, a few kilobytes), such as jobs/mill3.toml".into(),
            K::Toml { .. } => "jobs/mill3.toml shows every key of a machine file".into(),
            K::OutOfRange { expected, .. } => format!("expected {expected}"),
            K::TravelOrder { .. } => "expected [min, max] with min < max, both finite".into(),
            K::TravelWithoutZero { .. } => {
                "programs start at machine position 0: measure positions from a place inside the travel".into()
            }
            K::OutsideTravel { .. } => "choose a position inside the travel of the axis".into(),
            K::TooManyCounts { .. } => {
                "a drive's position has 32 bits: choose a smaller travel or fewer counts per unit".into()
            }
            K::NoAxes => "describe one to nine axes, each under [[axis]]".into(),
            K::TooManyAxes { most, .. } => format!("expected at most {most}"),
            K::AxisName { .. } => {
                "expected a letter and then letters, digits, - or _, such as X; G-code knows A B C U V W X Y Z".into()
            }
            K::AxisTwice { .. } => "give every axis its own name".into(),
            K::AxisUnknown { .. } => "describe the axis under [[axis]] or remove it here".into(),
            K::UnitOfKind { .. } => "linear axes are measured in mm, rotary axes in deg or rad".into(),
            K::MixedRotaryUnits => "give all rotary axes the same unit".into(),
            K::KeyOfKind { instead, .. } => format!("use {instead}"),
            K::ToolTwice { .. } => "give every tool its own number".into(),
        }
    }
}

impl MachineError {
    /// An error about the file as a whole.
    pub(super) fn of_file(name: &str, kind: MachineErrorKind) -> Self {
        Self(Box::new(Details { name: name.to_owned(), kind, source: None }))
    }

    /// An error at bytes `span` of `text`.
    pub(super) fn at(name: &str, text: &str, span: std::ops::Range<usize>, kind: MachineErrorKind) -> Self {
        let mut offset = span.start.min(text.len());
        while !text.is_char_boundary(offset) {
            offset -= 1;
        }
        let before = &text[..offset];
        let line_start = before.rfind('\n').map_or(0, |at| at + 1);
        let line = before.bytes().filter(|&b| b == b'\n').count() + 1;
        let column = text[line_start..offset].chars().count() + 1;
        // A span over a whole table is shown by its first line.
        let first_line = text[offset..].find('\n').unwrap_or(text.len() - offset);
        let length = span.end.saturating_sub(offset).min(first_line);
        let source = Some(Place {
            text: NamedSource::new(name, text.to_owned()),
            offset,
            length,
            line: u32::try_from(line).unwrap_or(u32::MAX),
            column: u32::try_from(column).unwrap_or(u32::MAX),
        });
        Self(Box::new(Details { name: name.to_owned(), kind, source }))
    }

    /// What is wrong.
    pub fn kind(&self) -> &MachineErrorKind {
        &self.0.kind
    }

    /// Line of the file, from 1; `None` if the error is about the file as a whole.
    pub fn line(&self) -> Option<u32> {
        self.0.source.as_ref().map(|s| s.line)
    }

    /// Column in the line, in characters from 1.
    pub fn column(&self) -> Option<u32> {
        self.0.source.as_ref().map(|s| s.column)
    }
}

impl fmt::Display for MachineError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Details { name, kind, source } = &*self.0;
        match source {
            Some(Place { line, column, .. }) => write!(f, "{name}:{line}:{column}: {kind}"),
            None => write!(f, "{name}: {kind}"),
        }
    }
}

impl std::error::Error for MachineError {}

impl Diagnostic for MachineError {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        Some(Box::new(self.0.kind.help()))
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.0.source.as_ref().map(|s| &s.text as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let place = self.0.source.as_ref()?;
        let label = LabeledSpan::new(Some("here".into()), place.offset, place.length);
        Some(Box::new(std::iter::once(label)))
    }
}
