//! CSV in, way-points out; one line in memory at a time.

use std::io::{BufRead, BufReader, ErrorKind, Read};
use std::ops::Range;

use csv_core::{ReadRecordResult, Reader, ReaderBuilder, Terminator};

use super::WayPointErrorKind as Kind;
use super::{Collector, WayPointError, WayPoints};
use crate::job::machine::{Axis, AxisKind, Machine, Unit};

/// Longest line [bytes].
const LINE_LIMIT_BYTES: usize = 1 << 14;

/// Longest piece of a field that a message shows [characters].
const SHOWN: usize = 40;

/// The fields of one line.
struct Record {
    line: u32,
    raw: Vec<u8>,
    /// The fields without their quotes, one after another.
    text: Vec<u8>,
    /// Where each field ends in `text`.
    ends: Vec<usize>,
    count: usize,
}

/// One column of the file.
struct Column {
    axis: usize,
    /// Axis units per unit of the column.
    scale: f64,
}

/// Reads way-points from `source`; `name` is the file's name in messages.
pub(super) fn read<'m>(
    source: impl Read,
    name: &str,
    machine: &'m Machine,
) -> Result<WayPoints<'m>, WayPointError> {
    let mut source = BufReader::new(source);
    // A carriage return inside a line is a mistake to be shown, not an end.
    let mut csv = ReaderBuilder::new().terminator(Terminator::Any(b'\n')).build();
    let mut record = Record::new();
    if !record.next(&mut source, &mut csv, name)? {
        return Err(WayPointError::of_file(name, Kind::Empty));
    }
    let columns = header(&record, name, machine)?;
    let axes = columns.iter().map(|c| c.axis).collect();
    let mut points = Collector::new(name, machine, axes);
    points.0.digits.fill(f64::INFINITY);
    let mut row = Vec::with_capacity(columns.len());
    while record.next(&mut source, &mut csv, name)? {
        record.numbers(&columns, machine, name, &mut row)?;
        points.push(&row, record.line)?;
        record.digits(&columns, &mut points.0.digits);
    }
    points.finish()
}

/// What a one in the last digit of a number stands for.
fn last_digit(text: &str) -> f64 {
    let (mantissa, exponent) = text.split_once(['e', 'E']).unwrap_or((text, "0"));
    let decimals = mantissa.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    let exponent = exponent.parse::<i32>().unwrap_or(0);
    10f64.powi(exponent.saturating_sub(i32::try_from(decimals).unwrap_or(i32::MAX)))
}

impl Record {
    fn new() -> Self {
        let text = vec![0; LINE_LIMIT_BYTES];
        let ends = vec![0; LINE_LIMIT_BYTES + 1];
        Self { line: 0, raw: Vec::with_capacity(LINE_LIMIT_BYTES), text, ends, count: 0 }
    }

    /// Moves on to the next line that is neither blank nor a comment; false at the end of the file.
    fn next(
        &mut self,
        source: &mut impl BufRead,
        csv: &mut Reader,
        name: &str,
    ) -> Result<bool, WayPointError> {
        loop {
            self.raw.clear();
            let read = source.take(LINE_LIMIT_BYTES as u64 + 1).read_until(b'\n', &mut self.raw);
            let bytes = read.map_err(|e| unreadable(name, &e))?;
            if bytes == 0 {
                return Ok(false);
            }
            self.line = self.line.saturating_add(1);
            if bytes > LINE_LIMIT_BYTES {
                let kind = Kind::LineTooLong { limit_bytes: LINE_LIMIT_BYTES };
                return Err(WayPointError::of_line(name, self.line, kind));
            }
            while self.raw.last().is_some_and(|b| matches!(b, b'\n' | b'\r')) {
                self.raw.pop();
            }
            if self.line == 1 && self.raw.starts_with(b"\xef\xbb\xbf") {
                self.raw.drain(..3);
            }
            let content = self.raw.trim_ascii_start();
            if !content.is_empty() && !content.starts_with(b"#") {
                self.split(csv);
                return Ok(true);
            }
        }
    }

    /// Cuts the line into fields: one line is one record, whatever its quotes are.
    fn split(&mut self, csv: &mut Reader) {
        csv.reset();
        let (mut input, mut written) = (self.raw.as_slice(), 0);
        self.count = 0;
        loop {
            let (result, read, out, ends) =
                csv.read_record(input, &mut self.text[written..], &mut self.ends[self.count..]);
            input = &input[read..];
            written += out;
            self.count += ends;
            // An empty input tells the reader that the record is over.
            if !matches!(result, ReadRecordResult::InputEmpty) {
                break;
            }
        }
    }

    fn field(&self, i: usize) -> &[u8] {
        let start = if i == 0 { 0 } else { self.ends[i - 1] };
        self.text[start..self.ends[i]].trim_ascii()
    }

    /// Where field `i` stands in the raw line, without the blanks around it.
    fn place(&self, i: usize) -> Range<usize> {
        let (mut field, mut quoted, mut start, mut end) = (0, false, 0, self.raw.len());
        for (at, &b) in self.raw.iter().enumerate() {
            match b {
                b'"' => quoted = !quoted,
                b',' if !quoted && field == i => {
                    end = at;
                    break;
                }
                b',' if !quoted => {
                    field += 1;
                    start = at + 1;
                }
                _ => {}
            }
        }
        let blank = self.raw[start..end].len() - self.raw[start..end].trim_ascii_start().len();
        start + blank..start + blank + self.raw[start..end].trim_ascii().len()
    }

    fn error(&self, name: &str, field: usize, kind: Kind) -> WayPointError {
        WayPointError::at(name, self.line, &self.raw, self.place(field), kind)
    }

    /// The fields as positions in axis units, checked against the travel.
    fn numbers(
        &self,
        columns: &[Column],
        machine: &Machine,
        name: &str,
        row: &mut Vec<f64>,
    ) -> Result<(), WayPointError> {
        if self.count != columns.len() {
            let kind = Kind::Ragged { found: self.count, expected: columns.len() };
            return Err(self.error(name, self.count.min(columns.len()) - 1, kind));
        }
        row.clear();
        for (i, column) in columns.iter().enumerate() {
            let field = self.field(i);
            let parsed = std::str::from_utf8(field).ok().and_then(|f| f.parse::<f64>().ok());
            let Some(number) = parsed else {
                return Err(self.error(name, i, Kind::NotANumber { text: shown(field) }));
            };
            let value = number * column.scale;
            if !value.is_finite() {
                return Err(self.error(name, i, Kind::NotFinite { text: shown(field) }));
            }
            let Axis { name: axis, travel: [min, max], .. } = &machine.axes[column.axis];
            if !(*min <= value && value <= *max) {
                let kind = Kind::OutsideTravel { axis: axis.clone(), value, min: *min, max: *max };
                return Err(self.error(name, i, kind));
            }
            row.push(value);
        }
        Ok(())
    }

    /// Notes the last digits of the columns where they are finer than any before.
    fn digits(&self, columns: &[Column], finest: &mut [f64]) {
        for ((i, column), finest) in columns.iter().enumerate().zip(finest) {
            let digit = std::str::from_utf8(self.field(i)).map_or(0.0, last_digit) * column.scale;
            *finest = finest.min(digit);
        }
    }
}

pub(super) fn unreadable(name: &str, error: &std::io::Error) -> WayPointError {
    let reason = match error.kind() {
        ErrorKind::IsADirectory => "it is a directory".into(),
        _ => error.to_string(),
    };
    WayPointError::of_file(name, Kind::Unreadable { reason })
}

fn shown(field: &[u8]) -> String {
    String::from_utf8_lossy(field).chars().take(SHOWN).collect()
}

/// Which axis each column is, and in which unit.
fn header(record: &Record, name: &str, machine: &Machine) -> Result<Vec<Column>, WayPointError> {
    let mut columns: Vec<Column> = Vec::new();
    for i in 0..record.count {
        let fail = |kind| Err(record.error(name, i, kind));
        let Ok(field) = std::str::from_utf8(record.field(i)) else { return fail(Kind::NotText) };
        let (title, unit) = title_and_unit(field);
        if title.is_empty() {
            return fail(Kind::ColumnName);
        }
        if title.parse::<f64>().is_ok() {
            return fail(Kind::HeaderMissing { text: shown(title.as_bytes()) });
        }
        let Some(axis) = machine.axes.iter().position(|a| a.name.eq_ignore_ascii_case(title)) else {
            let known: Vec<&str> = machine.axes.iter().map(|a| a.name.as_str()).collect();
            let kind = Kind::UnknownAxis { name: shown(title.as_bytes()), known: known.join(", ") };
            return fail(kind);
        };
        let described = &machine.axes[axis];
        if columns.iter().any(|c| c.axis == axis) {
            return fail(Kind::ColumnTwice { axis: described.name.clone() });
        }
        let scale = match unit {
            None => 1.0,
            Some(unit) => match scale(unit, described) {
                Ok(scale) => scale,
                Err(kind) => return fail(kind),
            },
        };
        columns.push(Column { axis, scale });
    }
    Ok(columns)
}

/// Divides `X [mm]`, `X (mm)` or `X` into the name and the unit.
fn title_and_unit(field: &str) -> (&str, Option<&str>) {
    let bracketed = [('[', ']'), ('(', ')')].into_iter().find_map(|(open, close)| {
        let (title, unit) = field.strip_suffix(close)?.split_once(open)?;
        Some((title.trim(), Some(unit.trim())))
    });
    bracketed.unwrap_or((field, None))
}

/// Axis units per `unit`.
fn scale(unit: &str, axis: &Axis) -> Result<f64, Kind> {
    let (kind, size) = match unit.to_ascii_lowercase().as_str() {
        "um" | "µm" | "μm" => (AxisKind::Linear, 1e-3),
        "mm" => (AxisKind::Linear, 1.0),
        "cm" => (AxisKind::Linear, 10.0),
        "m" => (AxisKind::Linear, 1000.0),
        "in" | "inch" => (AxisKind::Linear, 25.4),
        "deg" | "°" => (AxisKind::Rotary, if axis.unit == Unit::Deg { 1.0 } else { 1f64.to_radians() }),
        "rad" => (AxisKind::Rotary, if axis.unit == Unit::Rad { 1.0 } else { 1f64.to_degrees() }),
        _ => return Err(Kind::UnknownUnit { unit: shown(unit.as_bytes()) }),
    };
    if kind == axis.kind {
        return Ok(size);
    }
    let kind = if axis.kind == AxisKind::Linear { "linear" } else { "rotary" };
    Err(Kind::UnitOfKind { axis: axis.name.clone(), kind, unit: unit.to_owned() })
}
