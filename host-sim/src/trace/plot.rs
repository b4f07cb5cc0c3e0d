//! The trace in memory, thinned so that no peak is lost.

use std::io;

use super::{AxisSample, TraceHeader, TraceRow, TraceSink};

/// What is kept per axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Set-point position [axis unit].
    Position,
    /// Set-point velocity [axis unit/s].
    Velocity,
    /// Set-point acceleration [axis unit/s^2].
    Acceleration,
    /// Load position [axis unit].
    Actual,
    /// Set-point minus load position [axis unit].
    FollowingError,
    /// Motor force or torque [N or N m].
    Effort,
}

impl Quantity {
    /// All of them, in the order of their columns.
    pub const ALL: [Quantity; 6] = [
        Quantity::Position,
        Quantity::Velocity,
        Quantity::Acceleration,
        Quantity::Actual,
        Quantity::FollowingError,
        Quantity::Effort,
    ];

    fn of(self, s: &AxisSample) -> f64 {
        match self {
            Quantity::Position => s.position,
            Quantity::Velocity => s.velocity,
            Quantity::Acceleration => s.acceleration,
            Quantity::Actual => s.actual,
            Quantity::FollowingError => s.following_error,
            Quantity::Effort => s.effort,
        }
    }
}

/// Least and greatest value over a bucket of ticks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extremes {
    /// Least.
    pub min: f64,
    /// Greatest.
    pub max: f64,
}

impl Extremes {
    fn join(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }
}

/// One axis' buckets.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AxisPlot {
    buckets: Vec<[Extremes; Quantity::ALL.len()]>,
}

impl AxisPlot {
    /// The extremes of one quantity, bucket by bucket.
    pub fn series(&self, quantity: Quantity) -> impl Iterator<Item = Extremes> {
        self.buckets.iter().map(move |b| b[quantity as usize])
    }
}

/// Collects least and greatest values in a bounded number of buckets of equal length.
///
/// When all buckets are full, neighbours are merged and the length doubles: memory stays bounded without knowing
/// the length of the job.
#[derive(Clone, Debug)]
pub struct PlotTrace {
    capacity: usize,
    ticks_per_bucket: u64,
    in_last: u64,
    tick_s: f64,
    axes: Vec<AxisPlot>,
}

impl PlotTrace {
    /// A collector of at most `buckets` buckets, rounded up to an even number.
    pub fn new(buckets: usize) -> Self {
        let capacity = buckets.max(2).next_multiple_of(2);
        Self { capacity, ticks_per_bucket: 1, in_last: 0, tick_s: 0.0, axes: Vec::new() }
    }

    /// The axes, in the machine's order.
    pub fn axes(&self) -> &[AxisPlot] {
        &self.axes
    }

    /// Time that a bucket covers [s].
    pub fn bucket_s(&self) -> f64 {
        self.tick_s * self.ticks_per_bucket as f64
    }
}

impl TraceSink for PlotTrace {
    fn begin(&mut self, header: &TraceHeader) -> io::Result<()> {
        self.tick_s = header.tick_s;
        self.axes = vec![AxisPlot::default(); header.names.len()];
        (self.ticks_per_bucket, self.in_last) = (1, 0);
        Ok(())
    }

    fn row(&mut self, row: &TraceRow<'_>) -> io::Result<()> {
        let fresh = self.in_last == 0;
        let full = self.axes.first().is_some_and(|a| a.buckets.len() == self.capacity);
        if fresh && full {
            for axis in &mut self.axes {
                axis.buckets = axis
                    .buckets
                    .chunks(2)
                    .map(|pair| core::array::from_fn(|q| pair[0][q].join(pair[pair.len() - 1][q])))
                    .collect();
            }
            self.ticks_per_bucket *= 2;
        }
        for (axis, sample) in self.axes.iter_mut().zip(row.axes) {
            let now = Quantity::ALL.map(|q| Extremes { min: q.of(sample), max: q.of(sample) });
            match axis.buckets.last_mut() {
                Some(last) if !fresh => *last = core::array::from_fn(|q| last[q].join(now[q])),
                _ => axis.buckets.push(now),
            }
        }
        self.in_last = (self.in_last + 1) % self.ticks_per_bucket;
        Ok(())
    }

    fn end(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_peak_is_lost_and_memory_stays_bounded() {
        let mut plot = PlotTrace::new(100);
        plot.begin(&TraceHeader {
            names: vec!["X".into()],
            units: vec!["mm"],
            effort_units: vec!["N"],
            tick_s: 1e-3,
            expected_ticks: 0,
        })
        .unwrap();
        let spike = |tick: u64| match tick {
            12_345 => 9.0,
            54_321 => -7.0,
            _ => (tick % 3) as f64,
        };
        for tick in 0..100_003u64 {
            let axes = [AxisSample { effort: spike(tick), ..AxisSample::default() }];
            plot.row(&TraceRow { tick, time_s: 0.0, place: None, axes: &axes }).unwrap();
        }
        let efforts: Vec<Extremes> = plot.axes()[0].series(Quantity::Effort).collect();
        assert!(efforts.len() <= 100 && efforts.len() > 50);
        let bucket = |tick: u64| efforts[(tick as f64 * 1e-3 / plot.bucket_s()) as usize];
        assert_eq!(bucket(12_345).max, 9.0);
        assert_eq!(bucket(54_321).min, -7.0);
        assert_eq!(efforts.iter().filter(|e| e.max > 2.0 || e.min < 0.0).count(), 2);
        assert!((plot.bucket_s() * efforts.len() as f64 - 100.003).abs() <= plot.bucket_s());
    }
}
