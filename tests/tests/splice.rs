//! Motion that is planned while it plays: each piece takes over from the way to rest of the one before, or the axes stand.
#![allow(clippy::unwrap_used, clippy::panic, reason = "helpers of tests fail as tests do")]

use firmware_core::evaluate::{Cursor, Setpoint};
use firmware_core::table::TableView;
use planner::feed::chunk::Chunks;
use planner::feed::pack::{AxisScale, Packed, Target, pack};
use planner::feed::table::FeedTable;
use planner::job::gcode::Options;
use planner::job::machine::{AxisLimits, LimitSet, Machine, OverrideRule};
use planner::topp::horizon::{Deadline, Horizon, HorizonSettings, Record, pieces};
use protocol::message::{DriveMessage, HostMessage, Reject, State};
use protocol::power::Power;
use tests::chain;
use tests::drives::{player, send};
use tests::meander::{limits, meander};
use tests::tables::{Random, TICK_NS};

const COUNTS_PER_UNIT: f64 = 1e4;

/// Most memory that an axis needs for ten seconds of a sample program [bytes]: what was measured, and a twentieth more.
const MOST_BYTES: f64 = 17_200.0;

fn target(limits: &[AxisLimits]) -> Target {
    let scale = |&limits: &AxisLimits| AxisScale { counts_per_unit: COUNTS_PER_UNIT, limits };
    Target {
        tick_ns: TICK_NS,
        override_rule: OverrideRule::default(),
        axes: limits.iter().map(scale).collect(),
    }
}

/// A motion in pieces, and as a whole.
struct Streamed {
    pieces: Vec<Packed>,
    whole: Packed,
}

/// Plans a random path as it arrives.
fn streamed(seed: u64, axes: usize, spans: usize) -> Streamed {
    let mut path = meander(&mut Random::new(seed), axes, spans, 6.0, 0.5);
    // Whole counts, or halves, quarters ... of them.
    let unit = 2f64.powi(-6) / COUNTS_PER_UNIT;
    for axis in &mut path.axes {
        for control in &mut axis.controls {
            *control = (*control as f64 * axis.lsb / unit).round() as i64;
        }
        axis.lsb = unit;
    }
    let limits = limits(axes, 100.0, 500.0, 1e4);
    let target = target(&limits);
    let (start, pieces) = pieces(&path, &[], 3);
    let mut horizon = Horizon::new(&start, &limits, 1e-3, HorizonSettings::default()).unwrap();
    let mut record = Record::new(&start, horizon.q_scale());
    let (mut chunks, mut out) = (Chunks::default(), Vec::new());
    let mut whole: Option<FeedTable> = None;
    let mut drain = |horizon: &mut Horizon, record: &mut Record| {
        while let Some(commit) = horizon.advance(Deadline::NONE).unwrap() {
            record.commit(&commit);
            let table = record.table(&commit.stop);
            let fixed = table.steps.len() - commit.stop.steps.len();
            let number = out.len() as u32 + 1;
            out.extend(chunks.next(&table, fixed, commit.complete, number, &target).unwrap());
            whole = Some(table);
        }
    };
    for piece in pieces {
        horizon.push(&piece).unwrap();
        record.path(&piece);
        drain(&mut horizon, &mut record);
    }
    horizon.finish();
    drain(&mut horizon, &mut record);
    let whole = pack(&whole.unwrap(), 1, &target).unwrap();
    Streamed { pieces: out, whole }
}

/// Every set-point of a table of its own.
fn evaluated(packed: &Packed, axis: usize) -> Vec<Setpoint> {
    let part = &packed.axes[axis];
    let view = TableView::new(&packed.header, &part.header, &packed.shared, &part.controls).unwrap();
    let table = view.check().unwrap();
    let mut cursor = Cursor::new(&table).unwrap();
    let mut all = Vec::new();
    for n in 0u128.. {
        let time = ((n * u128::from(TICK_NS)) << 32) / 1_000_000_000;
        all.push(cursor.evaluate(&table, time as u64).unwrap());
        if all[all.len() - 1].done {
            break;
        }
    }
    all
}

type Player<'a> = firmware_core::player::Player<'a>;

/// Sends a piece and asks for its start; what the drive says.
fn bring(player: &mut Player<'_>, packed: &Packed, axis: usize) -> Vec<DriveMessage> {
    send(player, packed, axis);
    player.handle(&HostMessage::Start { table: packed.header.table, tick: 0 });
    std::iter::from_fn(|| player.poll_answer()).collect()
}

fn refusal(answers: &[DriveMessage]) -> Option<Reject> {
    answers.iter().find_map(|answer| match answer {
        DriveMessage::Reject { reason, .. } => Some(*reason),
        _ => None,
    })
}

#[test]
fn pieces_play_as_the_whole_does_to_the_bit() {
    for (seed, axes, spans) in [(1, 2, 150), (2, 3, 150), (3, 6, 80)] {
        let Streamed { pieces, whole } = streamed(seed, axes, spans);
        assert!(pieces.len() > 4, "{}", pieces.len());
        for axis in 0..axes {
            let expected = evaluated(&whole, axis);
            let (mut a, mut b) = (vec![0; 4096], vec![0; 4096]);
            let limits = whole.axes[axis].header.limits;
            let mut player = player(&whole, axis, limits, &mut a, &mut b);
            let mut next = pieces.iter();
            assert_eq!(refusal(&bring(&mut player, next.next().unwrap(), axis)), None);
            let mut waiting = next.next();
            for (tick, expected) in expected.iter().enumerate() {
                // As soon as a buffer is free, the next piece comes.
                if let Some(piece) = waiting {
                    match refusal(&bring(&mut player, piece, axis)) {
                        None => waiting = next.next(),
                        Some(Reject::Busy | Reject::NotOpen | Reject::NotReady) => {}
                        Some(reason) => panic!("tick {tick}: {reason:?}"),
                    }
                }
                assert_eq!(player.tick(), *expected, "seed {seed}, axis {axis}, tick {tick}");
            }
            assert!(waiting.is_none());
            assert_eq!(player.status().state, State::Holding);
        }
    }
}

#[test]
fn a_piece_that_does_not_come_is_a_stop_on_the_path_within_limits() {
    let Streamed { pieces, whole } = streamed(4, 3, 150);
    for missing in 1..pieces.len() {
        for late in [false, true] {
            let mut ends = Vec::new();
            for axis in 0..3 {
                let (mut a, mut b) = (vec![0; 4096], vec![0; 4096]);
                let limits = whole.axes[axis].header.limits;
                let mut player = player(&whole, axis, limits, &mut a, &mut b);
                let (mut next, mut ticks, mut last) = (0, 0u64, None::<Setpoint>);
                let tail_begun = loop {
                    if next < missing && refusal(&bring(&mut player, &pieces[next], axis)).is_none() {
                        next += 1;
                    }
                    let now = player.tick();
                    if let Some(last) = last {
                        let change = f64::from((now.acceleration - last.acceleration).abs());
                        assert!(
                            change
                                <= 1.01e-3 * f64::from(limits.jerk.unwrap())
                                    + 1e-4 * f64::from(limits.acceleration)
                        );
                        assert!(now.velocity.abs() <= 1.005 * limits.velocity);
                        assert!(now.acceleration.abs() <= 1.005 * limits.acceleration);
                    }
                    last = Some(now);
                    ticks += 1;
                    assert!(ticks < 1_000_000);
                    if now.done {
                        break ticks;
                    }
                    // Somewhere on the way to rest, behind the knot.
                    if late && next == missing && player.status().fill < 20 {
                        let answer = refusal(&bring(&mut player, &pieces[missing], axis));
                        assert!(matches!(answer, Some(Reject::Late { .. } | Reject::Busy)), "{answer:?}");
                    }
                };
                assert!(tail_begun > 10);
                let status = player.status();
                assert_eq!((status.power, status.fault), (Power::OperationEnabled, None));
                assert_eq!(status.position, pieces[missing - 1].axes[axis].header.end);
                ends.push(ticks);
            }
            assert!(ends.windows(2).all(|pair| pair[0] == pair[1]), "{ends:?}");
        }
    }
}

#[test]
fn pieces_that_do_not_fit_are_refused() {
    let Streamed { pieces, whole } = streamed(5, 2, 100);
    let limits = whole.axes[0].header.limits;
    let attempt = |change: &dyn Fn(&mut Packed)| {
        let (mut a, mut b) = (vec![0; 4096], vec![0; 4096]);
        let mut player = player(&whole, 0, limits, &mut a, &mut b);
        assert_eq!(refusal(&bring(&mut player, &pieces[0], 0)), None);
        let mut next = pieces[1].clone();
        change(&mut next);
        let answer = refusal(&bring(&mut player, &next, 0));
        // Whatever is refused changes nothing.
        let end = if answer.is_none() { &pieces[1] } else { &pieces[0] };
        let mut last = player.tick();
        while !last.done {
            last = player.tick();
        }
        assert_eq!(last.position, end.axes[0].header.end);
        answer
    };
    assert_eq!(attempt(&|_| {}), None);
    let joint = |change: &dyn Fn(&mut protocol::table::Joint)| {
        attempt(&|p: &mut Packed| change(p.header.joint.as_mut().unwrap()))
    };
    assert_eq!(joint(&|j| j.table = 9), Some(Reject::Joint));
    assert_eq!(joint(&|j| j.code += 1), Some(Reject::Joint));
    assert_eq!(joint(&|j| j.step += 1), Some(Reject::Joint));
    assert_eq!(joint(&|j| j.lengths[0] += 1), Some(Reject::Joint));
    assert_eq!(attempt(&|p| p.header.warp = None), Some(Reject::Joint));
    // Another place: the first control point is the first number of its stream.
    assert!(attempt(&|p| p.axes[0].controls[0] ^= 4).is_some());
    // Without its joint it is a table of its own, whose first span has no code.
    assert!(attempt(&|p| p.header.joint = None).is_some());
}

#[test]
fn ten_seconds_of_motion_take_no_more_memory_than_stated() {
    let machine = Machine::from_toml(include_str!("../../jobs/mill3.toml"), "mill3.toml").unwrap();
    for program in [
        include_str!("../../jobs/wave.ngc"),
        include_str!("../../jobs/bracket.ngc"),
        include_str!("../../jobs/cat.ngc"),
    ] {
        let job =
            chain::plan(program.as_bytes(), &machine, &Options::default(), LimitSet::default()).unwrap();
        let (mut bytes, mut seconds) = (0, 0.0);
        for (number, section) in job.plan.sections().enumerate() {
            let packed = chain::packed(section, number, TICK_NS, &machine).unwrap();
            let most = packed.axes.iter().map(|axis| axis.controls.len()).max().unwrap();
            bytes += packed.shared.len() + most;
            seconds += section.table.duration();
        }
        let ten_seconds = 10.0 * bytes as f64 / seconds;
        println!("{ten_seconds} bytes in ten seconds");
        // docs/benchmarks.md has the target.
        assert!(ten_seconds <= MOST_BYTES, "{ten_seconds} bytes");
    }
}
