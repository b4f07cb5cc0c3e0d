//! The drive's own proof of its limits, on tables that are meant to pass and on tables that are not.

#![allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use std::collections::BTreeMap;

use firmware_core::evaluate::Cursor;
use firmware_core::table::{CheckedTable, TableView};
use planner::feed::pack::Packed;
use planner::job::gcode::Options;
use planner::job::machine::{LimitSet, Machine};
use protocol::table::rules::USUAL_MARGIN;
use protocol::table::{AxisHeader, AxisLimit, Limits, TableError, TableHeader};
use tests::chain;
use tests::drives::asked;
use tests::tables::{COARSE, FINE, Random, Sample};

const TICK_NS: u32 = 1_000_000;
/// Places at which each span is sampled.
const SAMPLES: u64 = 12;
/// What sampling may see above a bound that holds: the rounding of set-points, and of quotients of their differences.
const SEEN: f64 = 2e-3;

/// One axis' table in pieces that can be changed.
#[derive(Clone)]
struct Parts {
    header: TableHeader,
    axis: AxisHeader,
    shared: Vec<u8>,
    controls: Vec<u8>,
}

impl Parts {
    fn of(packed: &Packed, axis: usize) -> Self {
        let part = &packed.axes[axis];
        Parts {
            header: packed.header,
            axis: part.header,
            shared: packed.shared.clone(),
            controls: part.controls.clone(),
        }
    }

    fn view(&self) -> Result<TableView<'_>, TableError> {
        TableView::new(&self.header, &self.axis, &self.shared, &self.controls)
    }
}

/// Largest |velocity|, |acceleration| and |jerk| at many places of every span; jerk from differences within spans.
fn peaks(table: &CheckedTable<'_>) -> [f64; 3] {
    let mut cursor = Cursor::new(table).unwrap();
    let (mut time, mut most) = (0u64, [0.0f64; 3]);
    let mut before: Option<(u32, u64, f64)> = None;
    while time < table.duration() {
        let now = cursor.evaluate(table, time).unwrap();
        let (velocity, acceleration) = (f64::from(now.velocity), f64::from(now.acceleration));
        most[0] = most[0].max(velocity.abs());
        most[1] = most[1].max(acceleration.abs());
        if let Some((span, then, old)) = before
            && span == cursor.span()
        {
            let seconds = (time - then) as f64 / (1u64 << 32) as f64;
            // Differences of like numbers are only as good as these.
            let noise = 1e-6 * acceleration.abs().max(old.abs()).max(most[1] * 0.1) / seconds;
            most[2] = most[2].max((acceleration - old).abs() / seconds - noise);
        }
        before = Some((cursor.span(), time, acceleration));
        time += (cursor.duration() / SAMPLES).max(1);
    }
    most
}

fn limits_of(peaks: [f64; 3], factors: [f64; 3]) -> Limits {
    let [v, a, j] = [0, 1, 2].map(|k| (peaks[k].max(1e-3) * factors[k]) as f32);
    Limits { velocity: v, acceleration: a, jerk: Some(j) }
}

#[test]
fn what_the_planner_packs_is_proven() {
    let machine = include_str!("../../jobs/mill3.toml");
    let machine = Machine::from_toml(machine, "mill3.toml").unwrap();
    let mut proven = 0;
    for program in [include_str!("../../jobs/cat.ngc"), include_str!("../../jobs/wave.ngc")] {
        for set in [LimitSet::default(), LimitSet::VelocityAcceleration] {
            let job = chain::plan(program.as_bytes(), &machine, &Options::default(), set).unwrap();
            for (number, section) in job.plan.sections().enumerate() {
                let packed = chain::packed(section, number, TICK_NS, &machine).unwrap();
                for axis in 0..packed.axes.len() {
                    let parts = Parts::of(&packed, axis);
                    let proof = parts.view().unwrap().prove(None);
                    assert!(proof.is_ok(), "section {number}, axis {axis}: {:?}", proof.err());
                    proven += 1;
                }
            }
        }
    }
    assert!(proven > 300, "{proven}");
}

/// Random tables under limits near what they need, some with bytes changed: whatever is accepted keeps its limits.
///
/// `FEEDSPLINE_CASES` asks for so many tables, `FEEDSPLINE_SEED` for others.
#[test]
fn no_table_that_breaks_its_limits_is_accepted() {
    let (cases, seed): (u64, u64) = (asked("FEEDSPLINE_CASES", 20_000), asked("FEEDSPLINE_SEED", 1));
    let mut random = Random::new(seed);
    let mut told = BTreeMap::<&str, u64>::new();
    let mut base: Option<(Parts, [f64; 3])> = None;
    for case in 0..cases {
        if case % 50 == 0 || base.is_none() {
            let kind = if random.whole(0, 1) == 0 { FINE } else { COARSE };
            let packed = Sample::new(&mut random, kind).packed(1).unwrap();
            let parts = Parts::of(&packed, 0);
            let found = peaks(&parts.view().unwrap().check().unwrap());
            base = Some((parts, found));
        }
        let (mut parts, found) = base.clone().unwrap();
        let mut factors = [0; 3].map(|_| random.scale(0.97, 20.0));
        factors[random.whole(0, 2) as usize] = random.between(0.9, 1.1);
        parts.axis.limits = limits_of(found, factors);
        for _ in 0..random.whole(0, 3) {
            let stream = if random.whole(0, 1) == 0 { &mut parts.shared } else { &mut parts.controls };
            let at = random.whole(0, stream.len() as u64 - 1) as usize;
            stream[at] ^= 1 << random.whole(0, 7);
        }
        let verdict = parts.view().and_then(|view| view.prove(None));
        let name = match &verdict {
            Ok(_) => "accepted",
            Err(TableError::Limit { limit: AxisLimit::Velocity, .. }) => "velocity",
            Err(TableError::Limit { limit: AxisLimit::Acceleration, .. }) => "acceleration",
            Err(TableError::Limit { limit: AxisLimit::Jerk, .. }) => "jerk",
            Err(_) => "no table",
        };
        *told.entry(name).or_default() += 1;
        if let Ok(table) = verdict {
            let seen = peaks(&table);
            let Limits { velocity, acceleration, jerk } = parts.axis.limits;
            for (seen, limit) in seen.into_iter().zip([velocity, acceleration, jerk.unwrap()]) {
                let most = f64::from(limit) * (1.0 + f64::from(USUAL_MARGIN) * 1e-3 + SEEN);
                assert!(seen <= most, "case {case}: {seen} above {limit}: {:?}", parts.axis);
            }
        }
    }
    println!("{told:?}");
    for name in ["accepted", "velocity", "acceleration", "jerk", "no table"] {
        assert!(told.get(name).is_some_and(|n| *n > cases / 200), "{name}: {told:?}");
    }
}

#[test]
fn travel_is_proven_too() {
    let mut random = Random::new(3);
    let packed = Sample::new(&mut random, COARSE).packed(1).unwrap();
    let parts = Parts::of(&packed, 0);
    let table = parts.view().unwrap().check().unwrap();
    let mut cursor = Cursor::new(&table).unwrap();
    let positions: Vec<i64> = (0..=1000u64)
        .map(|k| cursor.evaluate(&table, table.duration() / 1000 * k).unwrap().position)
        .collect();
    let (low, high) = (*positions.iter().min().unwrap(), *positions.iter().max().unwrap());
    let mut free = parts.clone();
    free.axis.limits = Limits { velocity: 1e12, acceleration: 1e15, jerk: None };
    let prove = |travel| {
        free.view()
            .unwrap()
            .prove(Some(travel))
            .map(|_| ())
            .map_err(|e| matches!(e, TableError::Limit { limit: AxisLimit::Travel, .. }))
    };
    let room = (high - low) / 2 + 100;
    assert_eq!(prove([low - room, high + room]), Ok(()));
    assert_eq!(prove([low + 3, high + room]), Err(true));
    assert_eq!(prove([low - room, high - 3]), Err(true));
}
