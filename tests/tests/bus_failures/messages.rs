//! Messages that make no sense, on their way to a drive in the middle of a session.

use host_sim::bus::BitTiming;
use planner::feed::messages::frames;
use protocol::bus::{Frame, FrameSize, Segments, ids};
use protocol::message::{HostMessage, Part, State, encode};
use protocol::table::Limits;
use tests::fleet::Job;
use tests::scene::Scene;

/// Drives with an open epoch, under torque and with a table; their host is silent from now on.
fn ready<'m>(job: &'m Job, buffers: &'m mut [host_sim::drive_node::Buffers]) -> (Scene<'m>, u16) {
    let mut scene = Scene::new(job, buffers);
    scene.until_all(State::Ready);
    scene.fleet.kill_host();
    let host = scene.host;
    scene.bus.flush(host);
    let (epoch, open) = scene.fleet.drive(0).epoch();
    assert!(open);
    (scene, epoch)
}

fn to_all(scene: &mut Scene<'_>, epoch: u16, message: &HostMessage<'_>) {
    frames(ids::BROADCAST, FrameSize::Classic, epoch, message).into_iter().for_each(|frame| scene.say(frame));
}

#[test]
fn numbers_that_are_none() {
    let job = Job::short(BitTiming::default());
    let axis = job.cast.orders[0].packed.axes[0].header;
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 0.0] {
        let limits = |velocity, acceleration, jerk| Limits { velocity, acceleration, jerk: Some(jerk) };
        let mut messages = vec![
            HostMessage::MoveTo { position: i64::MAX, velocity: Some(bad) },
            HostMessage::OpenAxis(protocol::table::AxisHeader { limits: limits(bad, 1.0, 1.0), ..axis }),
            HostMessage::OpenAxis(protocol::table::AxisHeader { limits: limits(1.0, bad, 1.0), ..axis }),
            HostMessage::OpenAxis(protocol::table::AxisHeader { limits: limits(1.0, 1.0, bad), ..axis }),
        ];
        if !bad.is_finite() {
            messages.push(HostMessage::MoveAt { velocity: bad });
        }
        let mut buffers = job.buffers();
        let (mut scene, epoch) = ready(&job, &mut buffers);
        for message in &messages {
            to_all(&mut scene, epoch, message);
            scene.pass(10);
        }
        scene.assert_never_moves(300);
        scene.assert_no_fault();
    }
}

#[test]
fn lengths_that_are_huge_or_zero() {
    let job = Job::short(BitTiming::default());
    let header = job.cast.orders[0].packed.header;
    let axis = job.cast.orders[0].packed.axes[0].header;
    let mut buffers = job.buffers();
    let (mut scene, epoch) = ready(&job, &mut buffers);
    for bytes in [0, 1, u32::MAX, u32::MAX - 4, 1 << 24] {
        for (geometry_bytes, span_bytes) in [(bytes, 40), (40, bytes), (bytes, bytes)] {
            let table = 7;
            let header = protocol::table::TableHeader { table, geometry_bytes, span_bytes, ..header };
            to_all(&mut scene, epoch, &HostMessage::Open(header));
            let axis = protocol::table::AxisHeader { table, control_bytes: bytes, ..axis };
            to_all(&mut scene, epoch, &HostMessage::OpenAxis(axis));
            for part in [Part::Shared, Part::Axis] {
                to_all(&mut scene, epoch, &HostMessage::Seal { table, part, crc: 0 });
            }
            to_all(&mut scene, epoch, &HostMessage::Start { table, tick: 0 });
            to_all(&mut scene, epoch, &HostMessage::Alive);
            scene.pass(12);
        }
    }
    scene.assert_never_moves(400);
    scene.assert_no_fault();
}

/// Blocks whose length field, numbers or ends are wrong; frames that are empty.
#[test]
fn blocks_that_are_cut_wrongly() {
    let job = Job::short(BitTiming::default());
    let mut buffers = job.buffers();
    let (mut scene, epoch) = ready(&job, &mut buffers);
    let mut buffer = [0; 64];
    let move_at = HostMessage::MoveAt { velocity: 1_000.0 };
    let message = encode(&move_at, &mut buffer).unwrap().to_vec();
    let sound: Vec<Frame> =
        Segments::new(ids::BROADCAST, FrameSize::Classic, epoch, &message).unwrap().collect();
    for frame in 0..sound.len() {
        for byte in 0..sound[frame].data().len() {
            for mask in [0x01u8, 0x80, 0xff] {
                for (k, other) in sound.iter().enumerate() {
                    let mut data = other.data().to_vec();
                    if k == frame {
                        data[byte] ^= mask;
                    }
                    // Frames of one number, twice: harmless; everything else ends the block.
                    scene.say(Frame::new(ids::BROADCAST, &data).unwrap());
                }
            }
        }
    }
    scene.say(Frame::new(ids::BROADCAST, &[]).unwrap());
    for id in [0x080, 0x012, 0x200, 0x201, 0x281, 0x300, 0x301, 0x081] {
        scene.say(Frame::new(id, &[]).unwrap());
        scene.say(Frame::new(id, &[0xff; 8]).unwrap());
    }
    scene.assert_never_moves(400);
    scene.assert_no_fault();
}

/// Both buffers are taken, whatever the sender counts: a third table is refused, and what is held is not touched.
#[test]
fn a_third_table_is_refused() {
    let job = Job::short(BitTiming::default());
    let mut buffers = job.buffers();
    let mut scene = Scene::new(&job, &mut buffers);
    scene.until_moving();
    let epoch = scene.fleet.drive(0).epoch().0;
    let header = job.cast.orders[0].packed.header;
    // One plays; each of these takes the other buffer, or the same number again.
    for table in [5, 6, 7, 0, 8] {
        to_all(&mut scene, epoch, &HostMessage::Open(protocol::table::TableHeader { table, ..header }));
        to_all(&mut scene, epoch, &HostMessage::Start { table, tick: 0 });
        scene.pass(12);
    }
    scene.assert_comes_to_rest(1_000);
    scene.assert_played_to_the_end();
    scene.assert_on_path(&job.path());
}
