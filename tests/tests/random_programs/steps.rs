//! Random part programs: steps relative to where the program stands, written as absolute G-code.

use std::f64::consts::{PI, TAU};

use planner::job::machine::Machine;
use proptest::prelude::*;

/// One thing a program does.
#[derive(Clone, Debug)]
pub(crate) enum Step {
    /// Straight, in a direction over all axes.
    Line { towards: [f64; 4], length: f64 },
    /// At rapid speed.
    Rapid { towards: [f64; 4], length: f64 },
    /// An arc or helix; `sweep` of a full turn, and further turns by P.
    Arc { plane: usize, radius: f64, from: f64, sweep: f64, rise: f64, turns: u8 },
    /// A circle of points, off by up to `noise`.
    Polygon { radius: f64, corners: u16, noise: f64, sweep: f64 },
    /// To and fro across a direction.
    Zigzag { towards: [f64; 4], pitch: f64, depth: f64, count: u8 },
    /// Back to where the last step started.
    Back,
    /// To where the program stands already.
    Nowhere,
    /// To an end of an axis' travel.
    Edge { axis: usize, high: bool },
    /// F.
    Feed(f64),
    /// One line in inverse time.
    Timed { towards: [f64; 4], length: f64, seconds: f64 },
    /// G61, G61.1, G64 ...
    Mode(Mode),
    /// G4.
    Dwell(f64),
    /// A stop that is no wait.
    Spindle,
}

/// How blocks join.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Mode {
    Exact,
    Stop,
    BestSpeed,
    Within(f64),
    Narrowed(f64, f64),
}

fn scale(from: f64, to: f64) -> impl Strategy<Value = f64> {
    (from.ln()..to.ln()).prop_map(f64::exp)
}

/// As [`scale`], with the largest for the simplest.
pub(crate) fn quick(from: f64, to: f64) -> impl Strategy<Value = f64> {
    (-to.ln()..-from.ln()).prop_map(|x| (-x).exp())
}

fn towards() -> impl Strategy<Value = [f64; 4]> {
    let any = prop::array::uniform4(-1.0..1.0f64);
    let straight = (0usize..4, prop::bool::ANY).prop_map(|(axis, back)| {
        let mut d = [0.0; 4];
        d[axis] = if back { -1.0 } else { 1.0 };
        d
    });
    prop_oneof![2 => any, 1 => straight]
}

fn length() -> impl Strategy<Value = f64> {
    prop_oneof![
        6 => scale(0.05, 40.0),
        3 => scale(1e-4, 0.1),
        1 => scale(40.0, 900.0),
    ]
}

fn mode() -> impl Strategy<Value = Mode> {
    prop_oneof![
        2 => Just(Mode::Exact),
        1 => Just(Mode::Stop),
        1 => Just(Mode::BestSpeed),
        4 => scale(5e-4, 1.0).prop_map(Mode::Within),
        1 => (scale(5e-4, 0.5), 0.0..1.0f64).prop_map(|(p, q)| Mode::Narrowed(p, p * q)),
    ]
}

/// Any step.
pub(crate) fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        12 => (towards(), length()).prop_map(|(towards, length)| Step::Line { towards, length }),
        3 => (towards(), length()).prop_map(|(towards, length)| Step::Rapid { towards, length }),
        8 => arc(),
        2 => (scale(0.01, 30.0), 3u16..200, scale(1e-6, 0.05), 0.1..TAU)
            .prop_map(|(radius, corners, noise, sweep)| Step::Polygon { radius, corners, noise, sweep }),
        2 => (towards(), scale(1e-3, 1.0), scale(1e-3, 2.0), 2u8..40)
            .prop_map(|(towards, pitch, depth, count)| Step::Zigzag { towards, pitch, depth, count }),
        2 => Just(Step::Back),
        1 => Just(Step::Nowhere),
        1 => (0usize..4, prop::bool::ANY).prop_map(|(axis, high)| Step::Edge { axis, high }),
        3 => quick(10.0, 60_000.0).prop_map(Step::Feed),
        1 => (towards(), length(), quick(10.0, 1000.0))
            .prop_map(|(towards, length, speed)| Step::Timed { towards, length, seconds: length / speed }),
        3 => mode().prop_map(Step::Mode),
        1 => (0.0..0.2f64).prop_map(Step::Dwell),
        1 => Just(Step::Spindle),
    ]
}

fn arc() -> impl Strategy<Value = Step> {
    let sweep = prop_oneof![4 => 0.02..6.2f64, 1 => Just(TAU), 1 => scale(1e-3, 0.1)];
    let rise = prop_oneof![3 => Just(0.0), 1 => -5.0..5.0f64];
    (0usize..3, scale(0.02, 60.0), 0.0..TAU, (sweep, prop::bool::ANY), rise, 1u8..4).prop_map(
        |(plane, radius, from, (sweep, back), rise, turns)| {
            let sweep = if back { -sweep } else { sweep };
            let turns = if sweep.abs() < TAU && turns < 3 { 1 } else { turns };
            Step::Arc { plane, radius, from, sweep, rise, turns }
        },
    )
}

/// Writes `steps` for `machine`, with so many digits after the point.
pub(crate) fn write(steps: &[Step], machine: &Machine, digits: usize, f: f64) -> String {
    let mut writer = Writer::new(machine, digits);
    writer.line(format!("G21 G90 G94 G91.1 F{f:.3}"));
    for step in steps {
        writer.step(step);
    }
    // A program without motion is no program.
    writer.line_to("G1", &[1.0, 0.5, 0.25, 0.125], 0.5);
    writer.text + "M2\n"
}

struct Writer<'m> {
    machine: &'m Machine,
    digits: usize,
    at: Vec<f64>,
    before: Vec<f64>,
    text: String,
    noise: u64,
}

impl<'m> Writer<'m> {
    fn new(machine: &'m Machine, digits: usize) -> Self {
        let at = vec![0.0; machine.axes.len()];
        Self { machine, digits, before: at.clone(), at, text: String::new(), noise: 1 }
    }

    fn line(&mut self, line: impl AsRef<str>) {
        self.text += line.as_ref();
        self.text.push('\n');
    }

    fn rounded(&self, x: f64) -> f64 {
        let unit = 10f64.powi(self.digits as i32);
        (x * unit).round() / unit
    }

    /// The nearest point that the program can name and the machine can reach.
    fn reachable(&self, p: &[f64]) -> Vec<f64> {
        let axes = self.machine.axes.iter().zip(p);
        axes.map(|(axis, x)| self.rounded(*x).clamp(axis.travel[0], axis.travel[1])).collect()
    }

    fn words(&self, p: &[f64]) -> String {
        let axes = self.machine.axes.iter().zip(p);
        axes.map(|(axis, x)| format!(" {}{:.*}", axis.name, self.digits, x)).collect()
    }

    fn go(&mut self, word: &str, p: &[f64]) {
        let p = self.reachable(p);
        let words = self.words(&p);
        self.line(format!("{word}{words}"));
        self.before = std::mem::replace(&mut self.at, p);
    }

    fn line_to(&mut self, word: &str, towards: &[f64; 4], length: f64) {
        let p: Vec<f64> = self.at.iter().zip(towards).map(|(x, d)| x + d * length).collect();
        self.go(word, &p);
    }

    /// A number from -1 to 1.
    fn random(&mut self) -> f64 {
        self.noise =
            self.noise.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.noise >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn step(&mut self, step: &Step) {
        match *step {
            Step::Line { towards, length } => self.line_to("G1", &towards, length),
            Step::Rapid { towards, length } => self.line_to("G0", &towards, length),
            Step::Arc { plane, radius, from, sweep, rise, turns } => {
                self.arc(plane, radius, from, sweep, rise, turns);
            }
            Step::Polygon { radius, corners, noise, sweep } => {
                let centre = self.at.clone();
                for k in 0..=corners {
                    let angle = sweep * f64::from(k) / f64::from(corners);
                    let mut p = centre.clone();
                    for (axis, value) in
                        [radius * (angle.cos() - 1.0), radius * angle.sin()].iter().enumerate()
                    {
                        let noise = noise * self.random();
                        if let Some(p) = p.get_mut(axis) {
                            *p += value + noise;
                        }
                    }
                    self.go("G1", &p);
                }
            }
            Step::Zigzag { towards, pitch, depth, count } => {
                for k in 0..count {
                    let mut d = towards.map(|x| x * pitch);
                    d[usize::from(k) % 2] += if k % 4 < 2 { depth } else { -depth };
                    self.line_to("G1", &d, 1.0);
                }
            }
            Step::Back => {
                let p = self.before.clone();
                self.go("G1", &p);
            }
            Step::Nowhere => {
                let p = self.at.clone();
                self.go("G1", &p);
            }
            Step::Edge { axis, high } => {
                let axis = axis % self.at.len();
                let mut p = self.at.clone();
                p[axis] = self.machine.axes[axis].travel[usize::from(high)];
                self.go("G1", &p);
            }
            Step::Feed(f) => self.line(format!("F{f:.4}")),
            Step::Timed { towards, length, seconds } => {
                self.line_to(&format!("G93 G1 F{:.5}", 60.0 / seconds), &towards, length);
                self.line("G94 F1200");
            }
            Step::Mode(mode) => self.line(match mode {
                Mode::Exact => "G61".into(),
                Mode::Stop => "G61.1".into(),
                Mode::BestSpeed => "G64".into(),
                Mode::Within(p) => format!("G64 P{p:.5}"),
                Mode::Narrowed(p, q) => format!("G64 P{p:.5} Q{q:.5}"),
            }),
            Step::Dwell(seconds) => self.line(format!("G4 P{seconds:.3}")),
            Step::Spindle => self.line("M5"),
        }
    }

    fn arc(&mut self, plane: usize, radius: f64, from: f64, sweep: f64, rise: f64, turns: u8) {
        let (word, names, offsets) = [
            ("G17", ["X", "Y", "Z"], ["I", "J"]),
            ("G18", ["Z", "X", "Y"], ["K", "I"]),
            ("G19", ["Y", "Z", "X"], ["J", "K"]),
        ][plane];
        let index = |name: &str| self.machine.axes.iter().position(|a| a.name == name);
        let (Some(a), Some(b)) = (index(names[0]), index(names[1])) else { return };
        let i = self.rounded(radius * (from + PI).cos());
        let j = self.rounded(radius * (from + PI).sin());
        let centre = [self.at[a] + i, self.at[b] + j];
        let radius = i.hypot(j);
        let inside = [(a, centre[0]), (b, centre[1])].iter().all(|&(axis, c)| {
            let [low, high] = self.machine.axes[axis].travel;
            c - 1.001 * radius >= low && c + 1.001 * radius <= high
        });
        if !inside || radius < 0.01 {
            return;
        }
        let full = sweep.abs() >= TAU;
        let mut p = self.at.clone();
        if !full {
            let angle = f64::atan2(-j, -i) + sweep;
            (p[a], p[b]) = (centre[0] + radius * angle.cos(), centre[1] + radius * angle.sin());
        }
        if let Some(c) = index(names[2]) {
            p[c] += rise;
        }
        let p = self.reachable(&p);
        // An arc too short for the digits would be a full circle.
        if !full && (p[a], p[b]) == (self.at[a], self.at[b]) {
            return;
        }
        let g = if sweep < 0.0 { "G2" } else { "G3" };
        let [u, v] = offsets;
        let turns = if turns > 1 { format!(" P{turns}") } else { String::new() };
        let words = self.words(&p);
        self.line(format!("{word} {g}{words} {u}{:.*} {v}{:.*}{turns}", self.digits, i, self.digits, j));
        self.before = std::mem::replace(&mut self.at, p);
    }
}
