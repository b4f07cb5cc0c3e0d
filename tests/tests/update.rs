//! New images over the bus: lost frames, power that fails at any byte, images that do not work, drives that are not off.
#![allow(clippy::unwrap_used, clippy::panic, reason = "helpers of tests fail as tests do")]

use firmware_core::axis::AxisConfig;
use firmware_core::drive::{Drive, DriveConfig};
use firmware_core::session::Watch;
use firmware_core::update::{ImageStore, MemoryFault};
use host_sim::bus::{BitTiming, Bus, Fate, FrameSize, InProcessBus, Meddler, NodeIndex};
use host_sim::flash_memory::{FlashMemory, SharedFlash};
use host_sim::update::{Stage, UpdateError, Updating};
use planner::feed::messages::frames;
use protocol::authentic::{KEY_BYTES, Key};
use protocol::bus::Node;
use protocol::message::HostMessage;
use protocol::power::PowerEvent;
use protocol::table::Limits;
use protocol::update::UpdateFault;
use tests::tables::Random;

const MS: u64 = 1_000_000;
const ROOM: usize = 2_000;

fn image(seed: u64, length: usize) -> Vec<u8> {
    let mut random = Random::new(seed);
    (0..length).map(|_| random.bits() as u8).collect()
}

/// The memory of a drive, with a byte that does not hold what is written.
#[derive(Clone)]
struct Worn {
    memory: SharedFlash,
    worn: Option<u32>,
}

impl ImageStore for Worn {
    fn room(&self) -> u32 {
        self.memory.room()
    }

    fn erase(&mut self, bytes: u32) -> Result<(), MemoryFault> {
        self.memory.erase(bytes)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), MemoryFault> {
        self.memory.write(offset, bytes)
    }

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), MemoryFault> {
        self.memory.read(offset, bytes)?;
        let place = self.worn.and_then(|worn| worn.checked_sub(offset));
        if let Some(byte) = place.and_then(|place| bytes.get_mut(place as usize)) {
            *byte ^= 0x10;
        }
        Ok(())
    }

    fn try_next(&mut self) -> Result<(), MemoryFault> {
        self.memory.try_next()
    }

    fn is_on_trial(&self) -> bool {
        self.memory.is_on_trial()
    }

    fn keep(&mut self) -> Result<(), MemoryFault> {
        self.memory.keep()
    }
}

/// A drive with its memory on a bus, and what happens to it.
struct Bench<B> {
    bus: B,
    node: NodeIndex,
    store: Worn,
    boot: u32,
    now: u64,
    key: Option<Key>,
    size: FrameSize,
    /// Whoever starts up after the first time does not come to anything.
    broken: bool,
}

/// How a run of the bench has ended.
#[derive(Clone, Copy, Debug, PartialEq)]
enum End {
    Done,
    Failed(UpdateError),
    /// Power has failed.
    Dead,
}

fn address() -> Node {
    Node::new(5).unwrap()
}

fn old() -> Vec<u8> {
    image(1, 700)
}

impl<B: Bus> Bench<B> {
    fn new(mut bus: B, size: FrameSize) -> Self {
        let store = Worn { memory: SharedFlash::new(FlashMemory::new(ROOM, &old())), worn: None };
        Self { node: bus.attach(), bus, store, boot: 0, now: 0, key: None, size, broken: false }
    }

    fn start(&mut self, power: Option<u64>) -> Vec<u8> {
        self.boot += 1;
        self.store.memory.start(power)
    }

    fn config(&self) -> DriveConfig {
        let limits = Limits { velocity: 1e9, acceleration: 1e12, jerk: None };
        let axis = AxisConfig { status_ticks: 20, ..AxisConfig::new(4, 1_000_000, limits) };
        let watch = Watch { boot: self.boot, ..Watch::new(1_000_000, 20) };
        DriveConfig { node: address(), frames: self.size, axis, watch, key: self.key }
    }

    fn updating(&mut self, bytes: Vec<u8>, key: Option<(Key, u64)>) -> Updating {
        Updating::new(bytes, address(), self.size, key, &mut self.bus).unwrap()
    }

    /// Lets the drive run with power for so long, and the update beside it; `before` says what the drive hears first.
    fn run(&mut self, mut updating: Updating, before: &[HostMessage<'_>]) -> End {
        let mut memory = [vec![0u8; 64], vec![0u8; 64]];
        let end = self.now + 20_000 * MS;
        let mut first = true;
        loop {
            let silent = self.broken && !first;
            let [a, b] = &mut memory;
            let mut store = self.store.clone();
            let mut drive = Drive::new(self.config(), a, b).with_images(&mut store);
            if core::mem::take(&mut first) {
                for message in before {
                    let all = frames(address().to_drive(), self.size, 1, message);
                    all.iter().for_each(|frame| drive.receive(frame, 0));
                }
                (0..50).for_each(|_| assert!(drive.tick().position >= 0));
            }
            loop {
                self.now += MS;
                assert!(self.now < end, "it never ends: {:?}", updating.stage());
                self.bus.advance(self.now);
                while self.bus.sent(self.node).is_some() {}
                while let Some(received) = self.bus.receive(self.node) {
                    if !silent {
                        drive.receive(&received.frame, 0);
                    }
                }
                drive.tick();
                while !silent && let Some(frame) = drive.poll_transmit() {
                    self.bus.send(self.node, frame, self.now);
                }
                if self.store.memory.is_dead() {
                    return End::Dead;
                }
                match updating.turn(&mut self.bus, self.now) {
                    Err(error) => return End::Failed(error),
                    Ok(()) if updating.stage() == Stage::Done => return End::Done,
                    Ok(()) => {}
                }
                if drive.wants_restart() {
                    break;
                }
            }
            drop(drive);
            let _ = self.start(None);
        }
    }
}

fn bench() -> Bench<InProcessBus> {
    Bench::new(InProcessBus::new(BitTiming::default()), FrameSize::Classic)
}

fn fd() -> Bench<InProcessBus> {
    let timing = BitTiming { format: FrameSize::Fd, ..BitTiming::default() };
    Bench::new(InProcessBus::new(timing), FrameSize::Fd)
}

#[test]
fn an_image_comes_is_tried_and_stays() {
    for mut bench in [bench(), fd()] {
        for (round, length) in [(2, 1_000), (3, 1), (4, 240), (5, 241), (6, ROOM)] {
            assert_ne!(bench.start(None), image(round, length));
            let updating = bench.updating(image(round, length), None);
            assert_eq!(bench.run(updating, &[]), End::Done);
            assert_eq!(bench.start(None), image(round, length));
        }
    }
}

#[test]
fn a_bad_line_costs_time_and_nothing_else() {
    for seed in 0..20 {
        let mut random = Random::new(seed);
        let bus = Meddler::new(InProcessBus::new(BitTiming::default()), move |_, _| match random.below(40) {
            0 | 1 => Fate::Lose,
            2 | 3 => Fate::Double,
            4 => Fate::Delay(3 * MS),
            _ => Fate::Pass,
        });
        let mut bench = Bench::new(bus, FrameSize::Classic);
        bench.start(None);
        let updating = bench.updating(image(9, 1_500), None);
        assert_eq!(bench.run(updating, &[]), End::Done, "{seed}");
        assert_eq!(bench.start(None), image(9, 1_500));
    }
}

#[test]
fn whenever_power_fails_one_image_or_the_other_runs() {
    let new = image(7, 500);
    let (mut back, mut gone_on) = (0, 0);
    for power in 0.. {
        let mut bench = bench();
        bench.start(Some(power));
        let updating = bench.updating(new.clone(), None);
        let end = bench.run(updating, &[]);
        if end == End::Done {
            // It takes less than that from end to end.
            assert!(power > 1_000 && back > 1_000 && gone_on > 0, "{power} {back} {gone_on}");
            return;
        }
        assert_eq!(end, End::Dead, "{power}");
        // Its last words are long forgotten.
        bench.now += 500 * MS;
        bench.bus.advance(bench.now);
        let now = bench.start(None);
        assert!(now == old() || now == new, "{power}");
        gone_on += u32::from(now == new);
        back += u32::from(now != new);
        // Whatever runs, the next update goes through.
        let updating = bench.updating(image(8, 900), None);
        assert_eq!(bench.run(updating, &[]), End::Done, "{power}");
        assert_eq!(bench.start(None), image(8, 900), "{power}");
    }
}

#[test]
fn an_image_that_does_not_work_is_gone_with_the_next_start() {
    let mut bench = bench();
    bench.start(None);
    bench.broken = true;
    let updating = bench.updating(image(3, 900), None);
    assert_eq!(bench.run(updating, &[]), End::Failed(UpdateError::Silent));
    // A watchdog, or somebody at the switch.
    assert_eq!(bench.start(None), old());
}

#[test]
fn what_was_stored_is_what_is_checked() {
    let mut bench = bench();
    bench.start(None);
    bench.store.worn = Some(333);
    let updating = bench.updating(image(3, 900), None);
    assert_eq!(bench.run(updating, &[]), End::Failed(UpdateError::Refused(UpdateFault::Hash)));
    assert_eq!(bench.start(None), old());
}

#[test]
fn images_that_do_not_fit_and_empty_ones_are_refused() {
    let mut bench = bench();
    bench.start(None);
    let updating = bench.updating(image(3, ROOM + 1), None);
    let room = ROOM as u32;
    assert_eq!(bench.run(updating, &[]), End::Failed(UpdateError::Refused(UpdateFault::Size { room })));
    let empty = Updating::new(Vec::new(), address(), FrameSize::Classic, None, &mut bench.bus);
    assert_eq!(empty.err(), Some(UpdateError::Empty));
}

#[test]
fn drives_that_are_not_off_are_left_alone() {
    let begin = HostMessage::Begin { boot: 1, members: 1 << 4 };
    let on = [PowerEvent::Shutdown, PowerEvent::EnableOperation].map(HostMessage::Power);
    let cases: [(&[HostMessage<'_>], bool); 5] = [
        // An epoch is open: somebody is about to move it.
        (&[begin], false),
        (&[begin, on[0], on[1]], false),
        // Its epoch is over, but it moves, or has torque.
        (
            &[
                begin,
                on[0],
                on[1],
                HostMessage::MoveTo { position: 1 << 40, velocity: Some(10.0) },
                HostMessage::Stop,
            ],
            false,
        ),
        (&[begin, on[0], on[1], HostMessage::Stop], false),
        (&[begin, on[0], on[1], HostMessage::Power(PowerEvent::DisableVoltage)], true),
    ];
    for (before, fits) in cases {
        let mut bench = bench();
        bench.start(None);
        let updating = bench.updating(image(3, 900), None);
        let end = bench.run(updating, before);
        let expected = if fits { End::Done } else { End::Failed(UpdateError::Refused(UpdateFault::Powered)) };
        assert_eq!(end, expected, "{before:?}");
    }
}

#[test]
fn drives_with_a_key_take_images_of_those_who_have_it() {
    let key = Key::new([9; KEY_BYTES]);
    for (of_host, expected) in [
        (None, End::Failed(UpdateError::Key)),
        (Some((Key::new([8; KEY_BYTES]), 0)), End::Failed(UpdateError::Key)),
        (Some((key, 0)), End::Done),
    ] {
        let mut bench = bench();
        bench.key = Some(key);
        bench.start(None);
        let updating = bench.updating(image(3, 900), of_host);
        assert_eq!(bench.run(updating, &[]), expected);
    }
}
