//! What can be wrong with a way-point job, and where.

use std::fmt;

use miette::{
    Diagnostic, LabeledSpan, MietteError, MietteSpanContents, SourceCode, SourceSpan, SpanContents,
};
use thiserror::Error;

/// A way-point job is refused.
///
/// Shown as `file:line:column: what`; as a [`Diagnostic`] it carries the line's text, a label and help.
#[derive(Debug, Clone)]
pub struct WayPointError(Box<Details>);

#[derive(Debug, Clone)]
struct Details {
    name: String,
    kind: WayPointErrorKind,
    line: Option<u32>,
    cell: Option<Cell>,
}

/// The line that holds the error; a whole file of way-points is not kept for its sake.
#[derive(Debug, Clone)]
struct Cell {
    name: String,
    text: String,
    line: u32,
    column: u32,
    offset: usize,
    length: usize,
}

/// What is wrong with a way-point job.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs, reason = "the fields are what the messages show")]
pub enum WayPointErrorKind {
    /// The file cannot be read.
    #[error("cannot be read: {reason}")]
    Unreadable { reason: String },
    /// No line but blank ones and comments.
    #[error("holds nothing")]
    Empty,
    /// A line longer than any way-point needs.
    #[error("line is longer than {limit_bytes} bytes")]
    LineTooLong { limit_bytes: usize },
    /// More lines than are planned at once.
    #[error("more than {most} way-points")]
    TooManyPoints { most: usize },
    /// The header is not UTF-8.
    #[error("header is not text")]
    NotText,
    /// The first line holds numbers.
    #[error("header is missing: the first line starts with the number {text}")]
    HeaderMissing { text: String },
    /// A column without a name.
    #[error("column has no name")]
    ColumnName,
    /// A column that is no axis of the machine.
    #[error("column {name:?} is not an axis of the machine")]
    UnknownAxis { name: String, known: String },
    /// Two columns of one axis.
    #[error("axis {axis} has two columns")]
    ColumnTwice { axis: String },
    /// A unit that is not known.
    #[error("unit {unit:?} is not known")]
    UnknownUnit { unit: String },
    /// An angle on a linear axis or a length on a rotary one.
    #[error("axis {axis} is {kind}, its way-points cannot be in {unit}")]
    UnitOfKind { axis: String, kind: &'static str, unit: String },
    /// A line with more or fewer fields than the header.
    #[error("{found} fields, the header has {expected}")]
    Ragged { found: usize, expected: usize },
    /// A field that is not a number.
    #[error("{text:?} is not a number")]
    NotANumber { text: String },
    /// A field that is NaN, infinite or out of range.
    #[error("{text} is not a finite number")]
    NotFinite { text: String },
    /// A way-point outside the travel.
    #[error("axis {axis} at {value}, outside its travel {min} to {max}")]
    OutsideTravel { axis: String, value: f64, min: f64, max: f64 },
    /// A way-point at the place of the one before it.
    #[error("way-point repeats the one of line {earlier}")]
    Repeated { earlier: u32 },
    /// Too few way-points for the end condition.
    #[error("{found} way-points, at least {least} needed")]
    TooFewPoints { found: usize, least: usize },
    /// All way-points are one place for the drives.
    #[error("no axis moves by a whole drive count")]
    Standstill,
    /// A closed curve was asked for, and the way-points do not close it.
    #[error("curve is not closed: axis {axis} ends at {end}, started at {start}")]
    NotClosed { axis: String, start: f64, end: f64 },
    /// An end slope is NaN or infinite.
    #[error("end slope of axis {axis} is {value}")]
    EndSlope { axis: String, value: f64 },
    /// The feed is no positive number.
    #[error("feed is {value}")]
    Feed { value: f64 },
    /// The spline leaves the travel between two way-points.
    #[error("spline takes axis {axis} to {value}, outside its travel {min} to {max}")]
    Overshoot { axis: String, value: f64, min: f64, max: f64 },
    /// Numbers on the way from way-points to counts leave the exact range.
    #[error("spline leaves the range of drive positions on axis {axis}")]
    OutOfRange { axis: String },
    /// The path hardly moves while its parameter runs.
    #[error("path nearly stands still: |dr/du| is {slope:.1e} at most")]
    Stall { slope: f64 },
}

impl WayPointErrorKind {
    fn help(&self) -> String {
        use WayPointErrorKind as K;
        let text = match self {
            K::Unreadable { .. } => "give the path of a CSV file of way-points, such as jobs/cat2d.csv",
            K::Empty | K::NotText | K::LineTooLong { .. } => {
                "expected a header such as `X [mm],Y [mm]` and one line of numbers per way-point"
            }
            K::TooManyPoints { .. } => "divide the job into several files",
            K::HeaderMissing { .. } => "put a line with the names of the axes first, such as `X [mm],Y [mm]`",
            K::ColumnName => "name an axis of the machine, such as `X` or `X [mm]`",
            K::UnknownAxis { known, .. } => {
                return format!("the machine's axes are {known}; columns are separated by commas");
            }
            K::ColumnTwice { .. } => "keep one column per axis",
            K::UnknownUnit { .. } => {
                "expected um, mm, cm, m or in for a linear axis, deg or rad for a rotary one"
            }
            K::UnitOfKind { .. } => "linear axes take um, mm, cm, m or in, rotary axes deg or rad",
            K::Ragged { .. } => "give every way-point one number per axis; the decimal sign is a point",
            K::NotANumber { .. } => "expected a number such as 12.5 or -3e-2; the decimal sign is a point",
            K::NotFinite { .. } => "expected a position inside the travel",
            K::OutsideTravel { .. } => {
                "positions are machine coordinates: move the way-points inside the travel"
            }
            K::Repeated { .. } => "remove one of the two lines; a spline cannot wait",
            K::TooFewPoints { .. } => "add way-points or choose another end condition",
            K::Standstill => {
                "way-points closer than a drive count are one place for the machine: check the units"
            }
            K::NotClosed { .. } => "end with the first way-point again, or choose another end condition",
            K::EndSlope { .. } => "expected a finite slope, in axis units per unit of path length",
            K::Feed { .. } => "expected a positive speed in axis units per second",
            K::Overshoot { .. } | K::OutOfRange { .. } => {
                "add way-points where the path turns, or choose chord or centripetal knots"
            }
            K::Stall { .. } => "spread the way-points more evenly, or choose chord knots",
        };
        text.into()
    }
}

impl WayPointError {
    /// An error about the file as a whole.
    pub(super) fn of_file(name: &str, kind: WayPointErrorKind) -> Self {
        Self(Box::new(Details { name: name.to_owned(), kind, line: None, cell: None }))
    }

    /// An error about the way-point of line `line`, or the path that leads to it.
    pub(super) fn of_line(name: &str, line: u32, kind: WayPointErrorKind) -> Self {
        Self(Box::new(Details { name: name.to_owned(), kind, line: Some(line), cell: None }))
    }

    /// An error at bytes `span` of the line `text`.
    pub(super) fn at(
        name: &str,
        line: u32,
        text: &[u8],
        span: std::ops::Range<usize>,
        kind: WayPointErrorKind,
    ) -> Self {
        let shown = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        let (start, end) =
            (span.start.min(text.len()), span.end.clamp(span.start, text.len().max(span.start)));
        let offset = shown(&text[..start]).len();
        let length = shown(&text[start..end.max(start).min(text.len())]).len();
        let column = u32::try_from(start + 1).unwrap_or(u32::MAX);
        let cell = Cell { name: name.to_owned(), text: shown(text), line, column, offset, length };
        Self(Box::new(Details { name: name.to_owned(), kind, line: Some(line), cell: Some(cell) }))
    }

    /// What is wrong.
    pub fn kind(&self) -> &WayPointErrorKind {
        &self.0.kind
    }

    /// Line of the file, from 1; `None` if the error is about the file as a whole.
    pub fn line(&self) -> Option<u32> {
        self.0.line
    }

    /// Column in the line, in bytes from 1, if the error is about one field.
    pub fn column(&self) -> Option<u32> {
        self.0.cell.as_ref().map(|cell| cell.column)
    }
}

impl SourceCode for Cell {
    fn read_span<'a>(
        &'a self,
        span: &SourceSpan,
        _before: usize,
        _after: usize,
    ) -> Result<Box<dyn SpanContents<'a> + 'a>, MietteError> {
        if span.offset() + span.len() > self.text.len() {
            return Err(MietteError::OutOfBounds);
        }
        let whole = SourceSpan::new(0.into(), self.text.len());
        let above = self.line as usize - 1;
        let contents =
            MietteSpanContents::new_named(self.name.clone(), self.text.as_bytes(), whole, above, 0, 1);
        Ok(Box::new(contents))
    }
}

impl fmt::Display for WayPointError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Details { name, kind, line, cell } = &*self.0;
        match (line, cell) {
            (Some(line), Some(cell)) => write!(f, "{name}:{line}:{}: {kind}", cell.column),
            (Some(line), None) => write!(f, "{name}:{line}: {kind}"),
            _ => write!(f, "{name}: {kind}"),
        }
    }
}

impl std::error::Error for WayPointError {}

impl Diagnostic for WayPointError {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        Some(Box::new(self.0.kind.help()))
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.0.cell.as_ref().map(|cell| cell as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let cell = self.0.cell.as_ref()?;
        let label = LabeledSpan::new(Some("here".into()), cell.offset, cell.length);
        Some(Box::new(std::iter::once(label)))
    }
}
