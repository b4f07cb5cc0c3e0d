//! Random machines of one to four axes.

use planner::job::machine::Machine;
use proptest::prelude::*;

use crate::steps::quick;

/// What a machine is made of.
#[derive(Clone, Debug)]
pub(crate) struct Frame {
    /// Which set of axes.
    pub axes: usize,
    /// Decimal exponents of counts per unit, and limits of every axis.
    pub drives: [(i32, f64, f64, f64); 4],
    /// Control tick [s].
    pub tick_s: f64,
    /// Path tolerance [mm].
    pub tolerance_mm: f64,
}

/// Sets of axes; the empty ones stand for the sample machines.
const AXES: [&[&str]; 8] =
    [&[], &[], &["X", "Y", "Z"], &["X"], &["X", "Y"], &["X", "Z"], &["X", "Y", "A"], &["X", "Y", "Z", "A"]];

const SAMPLES: [&str; 2] =
    [include_str!("../../../jobs/mill3.toml"), include_str!("../../../jobs/router4.toml")];

fn scale(from: f64, to: f64) -> impl Strategy<Value = f64> {
    (from.ln()..to.ln()).prop_map(f64::exp)
}

/// Any frame.
pub(crate) fn frame() -> impl Strategy<Value = Frame> {
    let drive = (2i32..=5, quick(10.0, 1500.0), quick(50.0, 20_000.0), quick(500.0, 1e6));
    let tick = prop::sample::select(vec![0.001, 0.0005, 0.00025, 0.002, 0.004]);
    (prop_oneof![3 => 0usize..2, 4 => 2..AXES.len()], prop::array::uniform4(drive), tick, scale(1e-3, 0.1))
        .prop_map(|(axes, drives, tick_s, tolerance_mm)| Frame { axes, drives, tick_s, tolerance_mm })
}

impl Frame {
    /// The machine file.
    pub(crate) fn toml(&self) -> String {
        if let Some(sample) = SAMPLES.get(self.axes) {
            return (*sample).into();
        }
        let mut text = format!("control_tick_s = {}\ntolerance_mm = {}\n", self.tick_s, self.tolerance_mm);
        for (name, (exponent, velocity, acceleration, jerk)) in AXES[self.axes].iter().zip(self.drives) {
            let (kind, unit) = if *name == "A" { ("rotary", "deg") } else { ("linear", "mm") };
            text += &format!(
                "[[axis]]\nname = \"{name}\"\nkind = \"{kind}\"\nunit = \"{unit}\"\ncounts_per_unit = {}\n\
                 travel = [-500, 500]\nvelocity = {velocity}\nacceleration = {acceleration}\njerk = {jerk}\n",
                10i64.pow(exponent as u32),
            );
        }
        text
    }

    /// The machine.
    pub(crate) fn machine(&self) -> Machine {
        Machine::from_toml(&self.toml(), "random machine").unwrap_or_else(|e| panic!("{e}"))
    }
}
