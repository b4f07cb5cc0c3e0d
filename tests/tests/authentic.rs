//! Drives with a key: whoever does not have it moves nothing, and nothing is obeyed twice; a stop is obeyed from anybody.
#![allow(clippy::unwrap_used, clippy::panic, reason = "helpers of tests fail as tests do")]

use firmware_core::axis::AxisConfig;
use firmware_core::drive::{Drive, DriveConfig};
use firmware_core::session::Watch;
use host_sim::bus::{BitTiming, InProcessBus};
use host_sim::fleet::{Event, Fleet, FleetSettings};
use host_sim::host_node::{HostError, Mismatch};
use planner::feed::messages::{frames, signed_frames};
use planner::feed::pack::Packed;
use protocol::authentic::{KEY_BYTES, Key, needs_tag};
use protocol::bus::stop::Stop;
use protocol::bus::{Frame, FrameSize, Node, Reassembler, ids};
use protocol::message::{DriveMessage, HostMessage, Part, Reject, State, decode};
use protocol::power::{Power, PowerEvent};
use protocol::table::Limits;
use tests::fleet::Job;
use tests::tables::{COARSE, Random, Sample, TICK_NS};

const KEY: Key = Key::new([0x5a; KEY_BYTES]);
const OTHER: Key = Key::new([0x5b; KEY_BYTES]);
const EPOCH: u16 = 3;

/// Plays the short job; the error that the host gives up with, if it does.
fn play(of_drives: Option<Key>, of_host: Option<Key>) -> Result<Vec<i64>, HostError> {
    let mut job = Job::short(BitTiming::default());
    job.cast.drives.iter_mut().for_each(|drive| drive.key = of_drives);
    let mut buffers = job.buffers();
    let mut bus = InProcessBus::new(BitTiming::default());
    let mut host = job.host(&mut bus);
    if let Some(key) = of_host {
        host.sign_with(key, 0);
    }
    let mut fleet = Fleet::new(&job.cast.drives, &mut buffers, host, FleetSettings::default(), &mut bus);
    while fleet.now() < 6_000_000_000 {
        match fleet.step(&mut bus) {
            Event::Failed(error) => return Err(error),
            Event::Tick { setpoint, .. } => {
                assert!(of_drives == of_host || of_drives.is_none() || setpoint.done)
            }
            Event::Host => {}
        }
    }
    Ok((0..fleet.axes()).map(|axis| fleet.drive(axis).status().position).collect())
}

#[test]
fn a_job_is_played_under_a_key_as_without_one() {
    let plain = play(None, None).unwrap();
    assert_ne!(plain, [0; 3]);
    assert_eq!(play(Some(KEY), Some(KEY)).unwrap(), plain);
}

#[test]
fn another_key_or_none_is_refused_by_name_before_anything_is_armed() {
    for host in [None, Some(OTHER)] {
        let error = play(Some(KEY), host).unwrap_err();
        assert!(matches!(error, HostError::Mismatch { mismatch: Mismatch::Key, .. }), "{host:?}: {error}");
    }
}

#[test]
fn tables_under_a_key_mean_nothing_to_a_drive_without_one() {
    // It can open what is signed, but not believe the seal.
    assert!(matches!(play(None, Some(KEY)), Err(HostError::Silent { .. })));
}

fn node() -> Node {
    Node::new(1).unwrap()
}

struct Bench<'a> {
    drive: Drive<'a>,
    counter: u64,
}

impl<'a> Bench<'a> {
    fn new(position: i64, [a, b]: &'a mut [Vec<u8>; 2]) -> Self {
        let limits = Limits { velocity: 1e9, acceleration: 1e12, jerk: None };
        let axis = AxisConfig { position, status_ticks: 10, ..AxisConfig::new(0, TICK_NS, limits) };
        let watch = Watch { host_ticks: 0, ..Watch::new(TICK_NS, 10) };
        let config = DriveConfig { node: node(), frames: FrameSize::Classic, axis, watch, key: Some(KEY) };
        Self { drive: Drive::new(config, a, b), counter: 0 }
    }

    /// The frames of a message with the next counter.
    fn signed(&mut self, epoch: u16, message: &HostMessage<'_>, key: &Key) -> Vec<Frame> {
        self.counter += 1;
        let id = match message {
            HostMessage::Open(_)
            | HostMessage::Start { .. }
            | HostMessage::Seal { part: Part::Shared, .. } => ids::BROADCAST,
            _ => node().to_drive(),
        };
        signed_frames(id, FrameSize::Classic, epoch, message, Some(key), self.counter)
    }

    fn hear(&mut self, all: &[Frame]) -> Vec<DriveMessage> {
        all.iter().for_each(|frame| self.drive.receive(frame, 0));
        let (mut incoming, mut messages) = (Reassembler::<96>::new(), Vec::new());
        while let Some(frame) = self.drive.poll_transmit() {
            if frame.id() == node().from_drive()
                && let Ok(Some((_, bytes))) = incoming.push(frame.data())
            {
                messages.push(decode(bytes).unwrap());
            }
        }
        messages
    }

    fn say(&mut self, message: &HostMessage<'_>) -> Vec<DriveMessage> {
        let all = self.signed(EPOCH, message, &KEY);
        self.hear(&all)
    }

    /// Opens an epoch, gives torque, and sends a table.
    fn prepare(&mut self, packed: &Packed) {
        let begun = self.say(&HostMessage::Begin { boot: 0, members: 1 });
        assert!(begun.contains(&DriveMessage::Begun { epoch: EPOCH }), "{begun:?}");
        self.say(&HostMessage::Power(PowerEvent::Shutdown));
        self.say(&HostMessage::Power(PowerEvent::EnableOperation));
        self.say(&HostMessage::Open(packed.header));
        self.say(&HostMessage::OpenAxis(packed.axes[0].header));
        for part in [None, Some(0)] {
            let data = (0..).map_while(|unit| packed.data_frame(part, node(), FrameSize::Classic, unit));
            self.hear(&data.collect::<Vec<_>>());
        }
    }

    fn seal(&mut self, packed: &Packed) -> Vec<DriveMessage> {
        let mut said = self.say(&packed.seal_under(None, &KEY));
        said.extend(self.say(&packed.seal_under(Some(0), &KEY)));
        said
    }
}

fn refused(said: &[DriveMessage]) -> bool {
    said.iter().any(|message| matches!(message, DriveMessage::Reject { reason: Reject::Key, .. }))
}

fn table() -> Packed {
    Sample::new(&mut Random::new(4), COARSE).packed(1).unwrap()
}

fn memory() -> [Vec<u8>; 2] {
    [vec![0; 4096], vec![0; 4096]]
}

#[test]
fn everything_that_moves_or_configures_needs_the_key() {
    let (packed, mut memory) = (table(), memory());
    let mut bench = Bench::new(packed.axes[0].header.start, &mut memory);
    let all = [
        HostMessage::Begin { boot: 0, members: 1 },
        HostMessage::Open(packed.header),
        HostMessage::OpenAxis(packed.axes[0].header),
        packed.seal_under(None, &KEY),
        HostMessage::Start { table: 1, tick: 50 },
        HostMessage::Power(PowerEvent::EnableOperation),
        HostMessage::Power(PowerEvent::ResetFault),
        HostMessage::MoveTo { position: 9, velocity: None },
        HostMessage::MoveAt { velocity: 9.0 },
        HostMessage::Override { permille: 500, tick: 9, number: 1 },
    ];
    for message in &all {
        assert!(needs_tag(message));
        let plain = frames(node().to_drive(), FrameSize::Classic, EPOCH, message);
        let foreign = bench.signed(EPOCH, message, &OTHER);
        // Signed for another epoch, and another drive.
        let mut moved = bench.signed(EPOCH + 1, message, &KEY);
        moved = with_epoch(&moved, EPOCH);
        for wrong in [plain, foreign, moved] {
            assert!(refused(&bench.hear(&wrong)), "{message:?}");
        }
    }
    assert_eq!(bench.drive.epoch(), (0, false));
    assert_eq!(bench.drive.status().power, Power::SwitchOnDisabled);
}

/// The block of some frames, as one of another epoch.
fn with_epoch(all: &[Frame], epoch: u16) -> Vec<Frame> {
    let mut incoming = Reassembler::<328>::new();
    let mut block = None;
    for frame in all {
        if let Ok(Some((_, bytes))) = incoming.push(frame.data()) {
            block = Some(bytes.to_vec());
        }
    }
    let block = block.unwrap();
    protocol::bus::Segments::new(all[0].id(), FrameSize::Classic, epoch, &block).unwrap().collect()
}

#[test]
fn nothing_is_obeyed_twice() {
    let (packed, mut memory) = (table(), memory());
    let mut bench = Bench::new(packed.axes[0].header.start, &mut memory);
    bench.prepare(&packed);
    assert!(bench.seal(&packed).iter().any(|m| matches!(m, DriveMessage::Ready { .. })));
    let jog = bench.signed(EPOCH, &HostMessage::MoveTo { position: 1, velocity: None }, &KEY);
    let start = bench.signed(EPOCH, &HostMessage::Start { table: 1, tick: 40 }, &KEY);
    bench.hear(&start);
    assert_eq!(bench.drive.status().state, State::Armed);
    bench.say(&HostMessage::Stop);
    // Late, and again: neither is obeyed, nor answered.
    let before = bench.drive.dropped();
    assert_eq!((bench.hear(&jog), bench.hear(&start)), (vec![], vec![]));
    assert_eq!(bench.drive.dropped(), before + 2);
    for _ in 0..60 {
        let setpoint = bench.drive.tick();
        assert_eq!((setpoint.velocity, setpoint.position), (0.0, packed.axes[0].header.start));
    }
}

#[test]
fn changed_bytes_of_a_table_are_found_even_where_their_checksum_is_right() {
    let (packed, mut memory) = (table(), memory());
    let mut bench = Bench::new(packed.axes[0].header.start, &mut memory);
    bench.prepare(&packed);
    // Somebody changes a byte on the way, and knows how to seal that without a key.
    let mut forged = packed.clone();
    forged.axes[0].controls[0] ^= 1;
    let data = forged.data_frame(Some(0), node(), FrameSize::Classic, 0).unwrap();
    bench.hear(&[data]);
    let said = bench.seal(&packed);
    assert!(
        said.iter().any(|m| matches!(m, DriveMessage::Reject { reason: Reject::Checksum(Part::Axis), .. })),
        "{said:?}"
    );
    let plain = frames(node().to_drive(), FrameSize::Classic, EPOCH, &forged.seal(Some(0)));
    assert!(refused(&bench.hear(&plain)));
}

#[test]
fn a_stop_needs_no_key() {
    let stops = [
        frames(ids::BROADCAST, FrameSize::Classic, 0, &HostMessage::Stop),
        frames(ids::BROADCAST, FrameSize::Classic, 0, &HostMessage::QuickStop),
        frames(node().to_drive(), FrameSize::Classic, 0, &HostMessage::Power(PowerEvent::DisableVoltage)),
        vec![Stop::Path { tick: None }.frame().unwrap()],
        vec![Stop::Quick.frame().unwrap()],
        vec![Stop::Off.frame().unwrap()],
    ];
    for stop in stops {
        let (packed, mut memory) = (table(), memory());
        let mut bench = Bench::new(packed.axes[0].header.start, &mut memory);
        bench.prepare(&packed);
        bench.seal(&packed);
        bench.say(&HostMessage::Start { table: 1, tick: 20 });
        bench.hear(&stop);
        for _ in 0..400 {
            bench.drive.tick();
            bench.hear(&[]);
        }
        let status = bench.drive.status();
        assert_ne!(status.state, State::Running, "{status:?}");
        assert_eq!(
            (status.position, bench.drive.epoch().1),
            (packed.axes[0].header.start, false),
            "{stop:?}"
        );
    }
}
