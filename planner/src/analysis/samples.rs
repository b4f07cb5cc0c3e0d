//! Small tables, sections and machines for the tests of this module and its neighbours.

use crate::feed::job::PlannedSection;
use crate::feed::table::FeedTable;
use crate::geometry::grid_path::{GridAxis, GridPath};
use crate::geometry::section::{BlockMark, Deviation, FeedCap, Marks, SpeedCap};
use crate::job::machine::{Axis, AxisKind, AxisLimits, Plant, Servo, Unit};
use crate::job::program::{MoveKind, StopCause};

/// A bent path of 10 units in two axes with a gentle motion on it.
pub(crate) fn bent_table() -> FeedTable {
    let x = GridAxis { lsb: 1e-3, controls: vec![0, 300, 2000, 4500, 7400, 8900, 9300] };
    let y = GridAxis { lsb: 1e-3, controls: vec![0, 10, 400, 1900, 4600, 6300, 6400] };
    let path = GridPath { step: 1.0 / 64.0, breaks: vec![0, 100, 230, 440, 640], axes: vec![x, y] };
    let codes = vec![900, 2000, 2500, 2600, 2400, 1000];
    FeedTable { path, steps: vec![20, 40, 40, 130, 210, 100, 80, 20], q_scale: 1e-5, codes }
}

/// A section of two program lines around [`bent_table`], never nearer any limit than half of it.
pub(crate) fn bent_section() -> PlannedSection {
    let limits = AxisLimits { velocity: 20.0, acceleration: 500.0, jerk: 50_000.0 };
    let speed = SpeedCap::Tangential { axes: 3, speed: 25.0 };
    let blocks = vec![BlockMark { until: 300, line: 4 }, BlockMark { until: 640, line: 5 }];
    let deviation = Deviation { tolerance_mm: 0.01, bound_mm: 0.005, line: 4 };
    PlannedSection {
        kind: MoveKind::Feed,
        limits: vec![limits; 2],
        table: bent_table(),
        marks: Marks {
            caps: vec![FeedCap { until: 640, speed }],
            blocks,
            deviation,
            end: StopCause::ProgramEnd,
        },
    }
}

/// The same section travelled back to its start.
pub(crate) fn back_section() -> PlannedSection {
    let mut section = bent_section();
    let table = &mut section.table;
    let length = table.path.grid_length();
    table.path.breaks = table.path.breaks.iter().rev().map(|b| length - b).collect();
    table.path.axes.iter_mut().for_each(|a| a.controls.reverse());
    table.steps.reverse();
    table.codes.reverse();
    section
}

/// An axis with one set of limits for feed and rapid moves.
pub(crate) fn axis(kind: AxisKind, limits: AxisLimits) -> Axis {
    let plant = Plant {
        inertia: 1.0,
        viscous: 0.0,
        coulomb: 0.0,
        effort_limit: 1e4,
        encoder_counts_per_count: 1.0,
        two_mass: None,
    };
    let servo = Servo {
        position_gain: 50.0,
        velocity_bandwidth: 300.0,
        integral_time_s: 0.01,
        velocity_feed_forward: 1.0,
        acceleration_feed_forward: 1.0,
    };
    Axis {
        name: "X".to_owned(),
        kind,
        unit: if kind == AxisKind::Linear { Unit::Mm } else { Unit::Deg },
        counts_per_unit: 1000.0,
        travel: [-1.0, 11.0],
        limits,
        rapid: limits,
        headroom: [1.0; 3],
        plant,
        servo,
    }
}
