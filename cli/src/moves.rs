//! Files of moves: one row a move, columns for every axis.

use std::path::Path;

use host_sim::group::{Axis, Bounds, MotionLimits, State, Sync, Target};

use crate::args::MoveArgs;
use crate::failure::Failure;

/// What a column may be, in the order of [`Cells`].
const QUANTITIES: [&str; 12] =
    ["p0", "v0", "a0", "p1", "v1", "a1", "vmax", "amax", "jmax", "vmin", "amin", "jmin"];

/// The column that says how axes wait for each other.
const SYNC: &str = "sync";

const EXPECTED: &str = "The first line names the columns: p0 v0 a0 p1 v1 a1 vmax amax jmax, and vmin amin jmin where limits are \
                        not symmetric; p0_0, p0_1 and so on for several axes; sync for none, time or phase. Without p1 the \
                        target is a velocity.";

/// Moves, and the names of their axes; one axis without a name has an empty one.
#[derive(Clone, Debug, PartialEq)]
pub struct Moves {
    /// What follows the underscore in the columns' names, in order.
    pub axes: Vec<String>,
    /// One a move.
    pub rows: Vec<Row>,
}

/// One move.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Line in the file.
    pub line: u32,
    /// What every axis has to do.
    pub axes: Vec<Axis>,
    /// How they wait for each other.
    pub sync: Sync,
}

/// The numbers of one axis, as far as they are given.
type Cells = [Option<f64>; QUANTITIES.len()];

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Column {
    /// A quantity of an axis, both by number.
    Cell(usize, usize),
    Sync,
}

/// The move that the command line asks for.
///
/// # Errors
/// A number is missing.
pub fn single(args: &MoveArgs) -> Result<Moves, Failure> {
    let cells = [
        args.p0, args.v0, args.a0, args.p1, args.v1, args.a1, args.vmax, args.amax, args.jmax, args.vmin,
        args.amin, args.jmin,
    ];
    let axis = axis(&cells).map_err(|missing| {
        Failure::input(format!("--{missing} is missing")).with_help(
            "Give --p0, --vmax, --amax, --jmax and --p1 or --v1; or name a file of moves. See feedspline move --help.",
        )
    })?;
    let row = Row { line: 1, axes: vec![axis], sync: args.sync.into() };
    Ok(Moves { axes: vec![String::new()], rows: vec![row] })
}

/// Reads a file of moves; rows that say nothing of it wait for each other as `sync` says.
///
/// # Errors
/// The file cannot be read, or the place of what is wrong in it.
pub fn read(file: &Path, sync: Sync) -> Result<Moves, Failure> {
    let text = std::fs::read(file).map_err(|e| Failure::unreadable(file, &e))?;
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_reader(text.as_slice());
    let mut record = csv::StringRecord::new();
    if !next(&mut reader, &mut record, file)? {
        return Err(Failure::input("the file is empty").in_file(file).with_help(EXPECTED));
    }
    let (axes, columns) = header(&record).map_err(|(column, message)| {
        Failure::input(message).at(file, line(&reader, &text), column).with_help(EXPECTED)
    })?;
    let mut rows = Vec::new();
    while next(&mut reader, &mut record, file)? {
        let line = line(&reader, &text);
        let row = row(&record, line, axes.len(), &columns, sync);
        let wrong = |(column, message): (usize, String)| {
            let help =
                "Give a decimal number, such as 0.25 or -3e-4; the first line of the file names the columns.";
            Failure::input(message).at(file, line, column.min(u32::MAX as usize) as u32).with_help(help)
        };
        rows.push(row.map_err(wrong)?);
    }
    if rows.is_empty() {
        return Err(Failure::input("there is no row below the header").in_file(file).with_help(EXPECTED));
    }
    Ok(Moves { axes, rows })
}

fn next(
    reader: &mut csv::Reader<&[u8]>,
    record: &mut csv::StringRecord,
    file: &Path,
) -> Result<bool, Failure> {
    reader.read_record(record).map_err(|error| {
        let line = error.position().map_or(1, csv::Position::line);
        let message = match error.kind() {
            csv::ErrorKind::Io(e) => return Failure::unreadable(file, e),
            csv::ErrorKind::Utf8 { .. } => "this is not UTF-8 text".to_owned(),
            _ => error.to_string(),
        };
        Failure::input(message).at(file, line.min(u64::from(u32::MAX)) as u32, 1).with_help(EXPECTED)
    })
}

/// The line of the record just read: comments and blank lines before it count too.
fn line(reader: &csv::Reader<&[u8]>, text: &[u8]) -> u32 {
    let end = reader.position();
    let last = usize::try_from(end.byte()).ok().and_then(|byte| text.get(byte.checked_sub(1)?));
    let line = end.line() - u64::from(last == Some(&b'\n'));
    u32::try_from(line).unwrap_or(u32::MAX)
}

/// The axes' names and what each column holds; or the first column, from 1, that makes no sense.
fn header(record: &csv::StringRecord) -> Result<(Vec<String>, Vec<Column>), (u32, String)> {
    let mut axes: Vec<String> = Vec::new();
    let mut columns = Vec::new();
    for (index, name) in record.iter().enumerate() {
        let at = index as u32 + 1;
        let column = if name == SYNC {
            Column::Sync
        } else {
            let (quantity, axis) = name.split_once('_').unwrap_or((name, ""));
            let Some(quantity) = QUANTITIES.iter().position(|q| *q == quantity) else {
                return Err((at, format!("there is no column `{name}`")));
            };
            let axis = match axes.iter().position(|known| known == axis) {
                Some(known) => known,
                None => {
                    axes.push(axis.to_owned());
                    axes.len() - 1
                }
            };
            Column::Cell(axis, quantity)
        };
        if columns.contains(&column) {
            return Err((at, format!("the column `{name}` comes twice")));
        }
        columns.push(column);
    }
    if axes.is_empty() {
        return Err((1, "no column belongs to an axis".into()));
    }
    if axes.len() > 1
        && let Some(index) = axes.iter().position(String::is_empty)
    {
        let at = columns.iter().position(|c| matches!(c, Column::Cell(axis, _) if *axis == index));
        let message =
            "a column without an axis among columns with one: all or none need `_` and an axis".into();
        return Err((at.unwrap_or(0) as u32 + 1, message));
    }
    for (axis, name) in axes.iter().enumerate() {
        let has = |quantity: &str| {
            columns
                .iter()
                .any(|c| matches!(c, Column::Cell(a, q) if *a == axis && QUANTITIES[*q] == quantity))
        };
        let missing = ["p0", "vmax", "amax", "jmax"].into_iter().find(|q| !has(q));
        let missing = missing.or((!has("p1") && !has("v1")).then_some("p1"));
        if let Some(quantity) = missing {
            let suffix = if name.is_empty() { String::new() } else { format!("_{name}") };
            return Err((1, format!("the column `{quantity}{suffix}` is missing")));
        }
    }
    Ok((axes, columns))
}

/// The move of one line; or the first cell, from 1, that makes no sense.
fn row(
    record: &csv::StringRecord,
    line: u32,
    axes: usize,
    columns: &[Column],
    sync: Sync,
) -> Result<Row, (usize, String)> {
    if record.len() != columns.len() {
        let (found, wanted) = (record.len(), columns.len());
        return Err((found.min(wanted) + 1, format!("{found} cells, the first line has {wanted}")));
    }
    let mut cells = vec![[None; QUANTITIES.len()]; axes];
    let mut sync = sync;
    for (index, (text, column)) in record.iter().zip(columns).enumerate() {
        match *column {
            _ if text.is_empty() => {}
            Column::Cell(axis, quantity) => {
                let number = text.parse::<f64>();
                cells[axis][quantity] =
                    Some(number.map_err(|_| (index + 1, format!("`{text}` is not a number")))?);
            }
            Column::Sync => {
                sync = match text {
                    "none" => Sync::None,
                    "time" => Sync::Time,
                    "phase" => Sync::Phase,
                    _ => return Err((index + 1, format!("sync is none, time or phase, not `{text}`"))),
                };
            }
        }
    }
    let cell_of = |axis: usize, quantity: &str| {
        let here = |c: &Column| matches!(c, Column::Cell(a, q) if *a == axis && QUANTITIES[*q] == quantity);
        columns.iter().position(here).unwrap_or(0) + 1
    };
    let axes = cells
        .iter()
        .enumerate()
        .map(|(index, cells)| {
            axis(cells).map_err(|missing| (cell_of(index, missing), format!("{missing} is missing")))
        })
        .collect::<Result<_, _>>()?;
    Ok(Row { line, axes, sync })
}

/// One axis; or the name of the first number that is missing.
fn axis(cells: &Cells) -> Result<Axis, &'static str> {
    let [p0, v0, a0, p1, v1, a1, vmax, amax, jmax, vmin, amin, jmin] = *cells;
    let bounds = |max: Option<f64>, min: Option<f64>, name| {
        let max = max.ok_or(name)?;
        Ok::<_, &'static str>(Bounds { min: min.unwrap_or(-max), max })
    };
    let from =
        State { position: p0.ok_or("p0")?, velocity: v0.unwrap_or(0.0), acceleration: a0.unwrap_or(0.0) };
    let to = match (p1, v1) {
        (Some(position), _) => {
            Target::State(State { position, velocity: v1.unwrap_or(0.0), acceleration: a1.unwrap_or(0.0) })
        }
        (None, Some(velocity)) => Target::Velocity(velocity),
        (None, None) => return Err("p1"),
    };
    let limits = MotionLimits {
        velocity: bounds(vmax, vmin, "vmax")?,
        acceleration: bounds(amax, amin, "amax")?,
        jerk: bounds(jmax, jmin, "jmax")?,
    };
    Ok(Axis { from, to, limits })
}

#[cfg(test)]
mod tests;
