//! The trace as comma-separated text.

use std::io::{self, Write};

use super::{TraceHeader, TraceRow, TraceSink};

/// How many rows a trace file gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rows {
    /// Every tick.
    All,
    /// Every n-th tick, n chosen so that there are about this many at most.
    AtMost(u64),
    /// Every n-th tick.
    Every(u64),
}

/// Rows that a trace file gets unless the user asks for more.
const DEFAULT_ROWS: u64 = 200_000;

impl Default for Rows {
    fn default() -> Self {
        Rows::AtMost(DEFAULT_ROWS)
    }
}

/// Writes one line per kept tick: `tick,time_s` and six columns per axis.
#[derive(Debug)]
pub struct CsvTrace<W> {
    out: W,
    rows: Rows,
    every: u64,
}

impl<W: Write> CsvTrace<W> {
    /// A trace written to `out`, which should be buffered.
    pub fn new(out: W, rows: Rows) -> Self {
        Self { out, rows, every: 1 }
    }

    /// The writer, after the trace has ended.
    pub fn into_inner(self) -> W {
        self.out
    }
}

impl<W: Write> TraceSink for CsvTrace<W> {
    fn begin(&mut self, header: &TraceHeader) -> io::Result<()> {
        self.every = match self.rows {
            Rows::All => 1,
            Rows::AtMost(rows) => header.expected_ticks.div_ceil(rows.max(1)).max(1),
            Rows::Every(n) => n.max(1),
        };
        write!(self.out, "tick,time_s")?;
        for ((name, unit), effort) in header.names.iter().zip(&header.units).zip(&header.effort_units) {
            let name = name.replace([',', '"', '\n', '\r'], "_");
            write!(
                self.out,
                ",{name}_setpoint_{unit},{name}_velocity_{unit}_s,{name}_acceleration_{unit}_s2"
            )?;
            write!(self.out, ",{name}_actual_{unit},{name}_following_error_{unit},{name}_effort_{effort}")?;
        }
        writeln!(self.out)
    }

    fn row(&mut self, row: &TraceRow<'_>) -> io::Result<()> {
        if !row.tick.is_multiple_of(self.every) {
            return Ok(());
        }
        write!(self.out, "{},{:.6}", row.tick, row.time_s)?;
        for a in row.axes {
            write!(self.out, ",{:.6},{:.6},{:.4}", a.position, a.velocity, a.acceleration)?;
            write!(self.out, ",{:.6},{:.7},{:.4}", a.actual, a.following_error, a.effort)?;
        }
        writeln!(self.out)
    }

    fn end(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::AxisSample;

    fn header(expected_ticks: u64) -> TraceHeader {
        TraceHeader {
            names: vec!["X".into(), "A".into()],
            units: vec!["mm", "deg"],
            effort_units: vec!["N", "Nm"],
            tick_s: 1e-3,
            expected_ticks,
        }
    }

    fn write(rows: Rows, ticks: u64) -> Vec<String> {
        let mut trace = CsvTrace::new(Vec::new(), rows);
        trace.begin(&header(ticks)).unwrap();
        for tick in 0..ticks {
            let axes = [AxisSample { position: tick as f64, effort: -1.5, ..AxisSample::default() }; 2];
            trace.row(&TraceRow { tick, time_s: tick as f64 * 1e-3, place: None, axes: &axes }).unwrap();
        }
        trace.end().unwrap();
        String::from_utf8(trace.into_inner()).unwrap().lines().map(String::from).collect()
    }

    #[test]
    fn every_line_has_a_value_for_every_column() {
        let lines = write(Rows::All, 5);
        assert_eq!(lines.len(), 6);
        assert!(lines[0].starts_with("tick,time_s,X_setpoint_mm,") && lines[0].ends_with(",A_effort_Nm"));
        assert!(lines.iter().all(|l| l.split(',').count() == 2 + 2 * 6));
        assert_eq!(lines[3].split(',').nth(2), Some("2.000000"));
    }

    #[test]
    fn a_long_trace_is_thinned_evenly() {
        let lines = write(Rows::AtMost(100), 1050);
        assert_eq!(lines.len(), 1 + 96);
        assert!(lines[2].starts_with("11,"));
        assert_eq!(write(Rows::Every(10), 1050).len(), 1 + 105);
    }
}
