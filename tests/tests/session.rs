//! Hosts that die, frames that get lost, clocks that differ: the drives stop together, on the path, and nothing old moves them.
#![allow(clippy::unwrap_used, clippy::panic, reason = "helpers of tests fail as tests do")]

use host_sim::bus::{BitTiming, Bus, Fate, InProcessBus, Meddler, NodeIndex, Received};
use host_sim::fleet::{Event, Fleet, FleetSettings};
use protocol::bus::stop::Stop;
use protocol::message::State;
use tests::drives::asked;
use tests::fleet::{Job, Record};

const MS: u64 = 1_000_000;

fn bus() -> InProcessBus {
    InProcessBus::new(BitTiming::default())
}

/// Runs until all drives stand still for good, or the time is over; what they did from the first motion on.
fn rest(fleet: &mut Fleet<'_>, bus: &mut dyn Bus, limit: u64) -> Record {
    let (mut record, mut moved, mut still) = (Record::default(), false, 0);
    while fleet.now() < limit {
        let event = fleet.step(bus);
        if let Event::Tick { setpoint, .. } = event {
            moved |= !setpoint.done;
            still = if setpoint.done { still + 1 } else { 0 };
        }
        if moved {
            record.add(&event, fleet.axes(), fleet.now());
        }
        let stands = |axis| {
            let status = fleet.drive(axis).status();
            matches!(status.state, State::Holding | State::Idle | State::Ready | State::Held)
        };
        if moved && (0..fleet.axes()).all(stands) && still > 200 {
            return record;
        }
        // Drives that are held on the path give set-points that are not done.
        if moved && (0..fleet.axes()).all(|axis| fleet.drive(axis).status().state == State::Held) {
            return record;
        }
    }
    record
}

/// Runs until the axes move.
fn run_until_moving(fleet: &mut Fleet<'_>, bus: &mut dyn Bus) {
    while !matches!(fleet.step(bus), Event::Tick { setpoint, .. } if !setpoint.done) {
        assert!(fleet.now() < 5_000 * MS, "they never move");
    }
}

#[test]
fn a_job_runs_on_drives_that_each_have_a_clock_of_their_own() {
    let job = Job::short(BitTiming::default());
    let mut buffers = job.buffers();
    let mut bus = bus();
    let settings = FleetSettings {
        host_jitter: 50_000,
        stamp_jitter: 500,
        crystals_ppm: vec![100.0, -100.0, 35.0],
        starts: vec![0, 3_333_333, 777_777],
        ..FleetSettings::default()
    };
    let mut fleet = job.fleet(&mut buffers, settings, &mut bus);
    let record = rest(&mut fleet, &mut bus, 10_000 * MS);
    let path = job.path();
    let worst = record.complete().map(|p| path.distance(&p)).fold(0.0, f64::max);
    assert!(record.ticks.len() > 300, "{}", record.ticks.len());
    assert!(worst <= 1.0, "{worst} counts off the path");
    assert!(record.skew() <= 2_000, "{:?} ns of skew", record.skews());
    for axis in 0..fleet.axes() {
        assert_eq!(fleet.drive(axis).status().position, job.cast.orders[0].packed.axes[axis].header.end);
        assert!(fleet.drive(axis).clock().residual_ns() < 2_000.0);
    }
}

/// A long job, SYNC lost for a second on the way: ticks stay within 5 us, and the residual that drives report is honest.
#[test]
fn clocks_stay_together_while_sync_is_lost_for_a_second() {
    let program = "G21 G90 G64 P0.05\nG1 F1500 X40 Y10 Z-5\nX10 Y40 Z0\nX60 Y60 Z-9\nX0 Y0 Z0\nM2\n";
    let job = Job::of(program, BitTiming::default());
    let mut buffers = job.buffers();
    let settings = FleetSettings {
        host_jitter: 50_000,
        stamp_jitter: 1_000,
        crystals_ppm: vec![-100.0, 100.0, 60.0],
        starts: vec![0, 5_123_456, 901_234],
        seed: 3,
        ..FleetSettings::default()
    };
    let lost = |_: NodeIndex, received: &Received| {
        let silent = (4_000 * MS..5_000 * MS).contains(&received.time);
        if silent && matches!(received.frame.id(), 0x080 | 0x012) { Fate::Lose } else { Fate::Pass }
    };
    let mut bus = Meddler::new(bus(), lost);
    let mut fleet = job.fleet(&mut buffers, settings, &mut bus);
    run_until_moving(&mut fleet, &mut bus);
    let mut record = Record::default();
    let began = fleet.now();
    let mut residual = 0.0f32;
    while fleet.now() < 8_000 * MS {
        let event = fleet.step(&mut bus);
        record.add(&event, 3, fleet.now());
        if fleet.now() > 3_000 * MS {
            residual = residual.max(fleet.drive(1).clock().residual_ns());
        }
    }
    assert!(began < 3_000 * MS, "{began}");
    let skew = record.skew();
    assert!(skew <= 5_000, "{skew} ns");
    assert!(residual < 2_000.0 && residual > 50.0, "{residual} ns");
}

/// The host dies before each of its frames: every time the axes come to rest together, on the path.
///
/// `FEEDSPLINE_EVERY` thins the frames out; 1 takes every one.
#[test]
fn whenever_the_host_dies_the_axes_rest_on_the_path() {
    let job = Job::short(BitTiming::default());
    let path = job.path();
    let every = asked("FEEDSPLINE_EVERY", 23);
    let mut frames = 0;
    // How many frames a whole run has.
    {
        let mut buffers = job.buffers();
        let mut bus = bus();
        let mut fleet = job.fleet(&mut buffers, FleetSettings::default(), &mut bus);
        run_until_moving(&mut fleet, &mut bus);
        while !fleet.host().is_at_rest() && fleet.now() < 4_000 * MS {
            fleet.step(&mut bus);
        }
        frames += bus.traffic().frames;
    }
    assert!(frames > 300, "{frames}");
    let (mut whole, mut held, mut unmoved) = (0, 0, 0);
    for killed in (0..frames).step_by(every as usize) {
        let mut buffers = job.buffers();
        let mut bus = bus();
        let mut fleet = job.fleet(&mut buffers, FleetSettings::default(), &mut bus);
        let mut record = Record::default();
        let mut moved = false;
        while bus.traffic().frames < killed {
            let event = fleet.step(&mut bus);
            moved |= matches!(event, Event::Tick { setpoint, .. } if !setpoint.done);
            if moved {
                record.add(&event, 3, fleet.now());
            }
        }
        fleet.kill_host();
        let end = fleet.now() + 1_500 * MS;
        while fleet.now() < end {
            let event = fleet.step(&mut bus);
            moved |= matches!(event, Event::Tick { setpoint, .. } if !setpoint.done);
            if moved {
                record.add(&event, 3, fleet.now());
            }
        }
        let states: Vec<_> = (0..3).map(|axis| fleet.drive(axis).status()).collect();
        assert!(states.iter().all(|s| s.fault.is_none()), "{killed}: {states:?}");
        assert!(states.iter().all(|s| s.state == states[0].state), "{killed}: {states:?}");
        let at_end = (0..3).all(|a| states[a].position == job.cast.orders[0].packed.axes[a].header.end);
        match states[0].state {
            State::Held => held += 1,
            State::Holding if at_end => whole += 1,
            State::Idle | State::Receiving | State::Ready => unmoved += 1,
            _ => panic!("{killed}: {states:?}"),
        }
        let last: Vec<_> = record.complete().collect();
        for positions in last.iter().step_by(25).chain(last.last()) {
            let off = path.distance(positions);
            assert!(off <= 1.0, "{killed}: {off} counts off the path");
        }
        for axis in 0..3 {
            assert!(!fleet.drive(axis).epoch().1, "{killed}: the epoch is still open");
        }
    }
    assert!(held > 3 && unmoved > 3, "{held} held, {whole} to the end, {unmoved} unmoved");
}

/// Every single reception, and every pair of them, that is lost between the first word of a start and the motion: either all axes
/// move or none does, or those that do stop soon.
#[test]
fn whatever_gets_lost_around_a_start_no_axis_runs_alone() {
    let job = Job::short(BitTiming::default());
    // The receptions that matter: those of the host's words and of the drives' beats around the start.
    let window = std::cell::Cell::new((0u64, 0u64));
    let count = |from: u64, until: u64| {
        let seen = std::cell::Cell::new(0u64);
        let mut bus = Meddler::new(bus(), |_: NodeIndex, received: &Received| {
            if (from..until).contains(&received.time) {
                seen.set(seen.get() + 1);
            }
            Fate::Pass
        });
        let mut buffers = job.buffers();
        let mut fleet = job.fleet(&mut buffers, FleetSettings::default(), &mut bus);
        let mut armed = None;
        while fleet.now() < 3_000 * MS {
            let event = fleet.step(&mut bus);
            if armed.is_none() && (0..3).any(|a| fleet.drive(a).status().state == State::Armed) {
                armed = Some(fleet.now());
            }
            if matches!(event, Event::Tick { setpoint, .. } if !setpoint.done) {
                break;
            }
        }
        window.set((armed.unwrap(), fleet.now()));
        seen.get()
    };
    count(0, 0);
    let (armed, moving) = window.get();
    let (from, until) = (armed - 3 * MS, moving + MS);
    let receptions = count(from, until);
    assert!((30..600).contains(&receptions), "{receptions}");
    let pairs = (0..receptions).flat_map(|a| (a..receptions).map(move |b| (a, b)));
    let every = asked("FEEDSPLINE_EVERY", 29) as usize;
    let singles = (0..receptions).map(|a| (a, a));
    let (mut cases, mut alone) = (0u64, 0u64);
    for (a, b) in singles.chain(pairs.filter(|(a, b)| a != b).step_by(every)) {
        cases += 1;
        let mut seen = 0u64;
        let mut bus = Meddler::new(bus(), |_: NodeIndex, received: &Received| {
            if !(from..until).contains(&received.time) {
                return Fate::Pass;
            }
            seen += 1;
            if seen - 1 == a || seen - 1 == b { Fate::Lose } else { Fate::Pass }
        });
        let mut buffers = job.buffers();
        let mut fleet = job.fleet(&mut buffers, FleetSettings::default(), &mut bus);
        let mut apart = [0u64; 3];
        let mut running = [false; 3];
        let end = moving + 400 * MS;
        while fleet.now() < end {
            if let Event::Tick { axis, .. } = fleet.step(&mut bus) {
                let status = fleet.drive(axis).status();
                running[axis] = matches!(status.state, State::Running | State::Held);
                let lonely = running[axis] && running.iter().any(|r| !r) && fleet.drive(axis).epoch().1;
                apart[axis] += u64::from(lonely);
            }
        }
        let longest = *apart.iter().max().unwrap();
        alone += u64::from(longest > 3);
        // Three beats of 20 ms until it is seen, and what is left of the one before.
        assert!(longest <= 80, "{a} {b}: {longest} ms alone");
    }
    assert!(cases > 100, "{cases}");
    println!("{cases} cases, {alone} in which an axis ran alone for a while");
}

/// Loss, doubling and reordering: the tables that arrive are the ones that were sent, and the job is played to its end.
#[test]
fn a_bad_line_costs_time_and_nothing_else() {
    let job = Job::short(BitTiming::default());
    let path = job.path();
    for seed in 1..=6 {
        let mut random = fastrand_like(seed);
        let mut bus = Meddler::new(bus(), move |_: NodeIndex, _: &Received| match random() % 1000 {
            0..50 => Fate::Lose,
            50..100 => Fate::Double,
            100..150 => Fate::Delay(100_000 * (1 + random() % 8)),
            _ => Fate::Pass,
        });
        let mut buffers = job.buffers();
        let mut fleet = job.fleet(&mut buffers, FleetSettings::default(), &mut bus);
        let record = rest(&mut fleet, &mut bus, 20_000 * MS);
        for axis in 0..3 {
            let status = fleet.drive(axis).status();
            assert_eq!(
                status.position, job.cast.orders[0].packed.axes[axis].header.end,
                "{seed}: {status:?}"
            );
        }
        let worst = record.complete().step_by(5).map(|p| path.distance(&p)).fold(0.0, f64::max);
        assert!(worst <= 1.0, "{seed}: {worst}");
    }
}

/// SplitMix64 as a closure.
fn fastrand_like(seed: u64) -> impl FnMut() -> u64 {
    let mut random = tests::tables::Random::new(seed);
    move || random.bits() >> 11
}

/// A stop by anybody's hand, with no more than a frame on the bus: all axes stop alike, on the path, and what was said before
/// moves nothing any more.
#[test]
fn a_bare_stop_frame_stops_all_axes_on_the_path() {
    let job = Job::short(BitTiming::default());
    let path = job.path();
    for after_ms in [1, 40, 90, 160] {
        let mut buffers = job.buffers();
        let mut bus = bus();
        let somebody = bus.attach();
        let settings = FleetSettings { starts: vec![0, 400_000, 700_000], ..FleetSettings::default() };
        let mut fleet = job.fleet(&mut buffers, settings, &mut bus);
        run_until_moving(&mut fleet, &mut bus);
        let mut record = Record::default();
        let at = fleet.now() + after_ms * MS;
        let mut sent = false;
        let end = at + 1_000 * MS;
        while fleet.now() < end {
            if fleet.now() >= at && !std::mem::replace(&mut sent, true) {
                let now = fleet.now();
                bus.send(somebody, Stop::Path { tick: None }.frame().unwrap(), now);
            }
            let event = fleet.step(&mut bus);
            record.add(&event, 3, fleet.now());
        }
        for axis in 0..3 {
            let status = fleet.drive(axis).status();
            assert_eq!((status.state, status.fault), (State::Held, None), "{after_ms} {axis}");
            assert!(!fleet.drive(axis).epoch().1);
        }
        let worst = record.complete().step_by(3).map(|p| path.distance(&p)).fold(0.0, f64::max);
        assert!(worst <= 1.0, "{after_ms}: {worst}");
    }
}

/// One axis faults: the others stop on the path, and soon.
#[test]
fn a_fault_of_one_axis_stops_all() {
    let job = Job::short(BitTiming::default());
    let mut buffers = job.buffers();
    let mut bus = bus();
    let mut fleet = job.fleet(&mut buffers, FleetSettings::default(), &mut bus);
    run_until_moving(&mut fleet, &mut bus);
    for _ in 0..300 {
        fleet.step(&mut bus);
    }
    fleet.trip(1, 0x77);
    let tripped = fleet.now();
    while fleet.now() < tripped + 900 * MS {
        fleet.step(&mut bus);
    }
    let status = |axis: usize| fleet.drive(axis).status();
    assert!(status(1).fault.is_some());
    for axis in [0, 2] {
        assert_eq!((status(axis).state, status(axis).fault), (State::Held, None), "{axis}");
    }
}
