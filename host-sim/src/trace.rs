//! What the simulation records per tick and axis, and where it goes.

mod csv;
mod plot;

pub use csv::{CsvTrace, Rows};
pub use plot::{AxisPlot, Extremes, PlotTrace, Quantity};

use std::io;

/// One axis at one control tick; lengths in axis units (mm, deg or rad).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisSample {
    /// Set-point position.
    pub position: f64,
    /// Set-point velocity [per s].
    pub velocity: f64,
    /// Set-point acceleration [per s^2].
    pub acceleration: f64,
    /// Where the load is.
    pub actual: f64,
    /// Set-point position minus actual position.
    pub following_error: f64,
    /// Motor force or torque over the coming tick [N or N m].
    pub effort: f64,
}

/// All axes at one control tick.
#[derive(Clone, Copy, Debug)]
pub struct TraceRow<'a> {
    /// Control ticks since the simulation began.
    pub tick: u64,
    /// The same in seconds.
    pub time_s: f64,
    /// Which part of the job the set-points belong to; `None` while the drives stand.
    pub place: Option<Place>,
    /// The axes, in the machine's order.
    pub axes: &'a [AxisSample],
}

/// A place in a job.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Index of the table among the job's tables.
    pub table: usize,
    /// Time since its start [s].
    pub time_s: f64,
}

/// What a sink may know before the first row.
#[derive(Clone, Debug)]
pub struct TraceHeader {
    /// Names of the axes.
    pub names: Vec<String>,
    /// Unit of the lengths of each axis.
    pub units: Vec<&'static str>,
    /// Unit of the effort of each axis.
    pub effort_units: Vec<&'static str>,
    /// Length of a control tick [s].
    pub tick_s: f64,
    /// About how many rows will come.
    pub expected_ticks: u64,
}

/// A receiver of the trace.
pub trait TraceSink {
    /// Called once, before the first row.
    ///
    /// # Errors
    /// When the sink cannot be written.
    fn begin(&mut self, header: &TraceHeader) -> io::Result<()>;

    /// Called for every control tick, in order.
    ///
    /// # Errors
    /// When the sink cannot be written.
    fn row(&mut self, row: &TraceRow<'_>) -> io::Result<()>;

    /// Called once, after the last row.
    ///
    /// # Errors
    /// When the sink cannot be written.
    fn end(&mut self) -> io::Result<()>;
}

/// No trace.
impl TraceSink for () {
    fn begin(&mut self, _: &TraceHeader) -> io::Result<()> {
        Ok(())
    }

    fn row(&mut self, _: &TraceRow<'_>) -> io::Result<()> {
        Ok(())
    }

    fn end(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Two sinks fed with the same rows.
impl<A: TraceSink, B: TraceSink> TraceSink for (A, B) {
    fn begin(&mut self, header: &TraceHeader) -> io::Result<()> {
        self.0.begin(header)?;
        self.1.begin(header)
    }

    fn row(&mut self, row: &TraceRow<'_>) -> io::Result<()> {
        self.0.row(row)?;
        self.1.row(row)
    }

    fn end(&mut self) -> io::Result<()> {
        self.0.end()?;
        self.1.end()
    }
}

impl<S: TraceSink + ?Sized> TraceSink for &mut S {
    fn begin(&mut self, header: &TraceHeader) -> io::Result<()> {
        (**self).begin(header)
    }

    fn row(&mut self, row: &TraceRow<'_>) -> io::Result<()> {
        (**self).row(row)
    }

    fn end(&mut self) -> io::Result<()> {
        (**self).end()
    }
}
