use super::*;

use std::fs::File;
use std::io::Read;
use std::os::unix::net::{UnixListener, UnixStream};
use std::time::Duration;

use firmware_core::axis::AxisConfig;
use firmware_core::drive::DriveConfig;
use firmware_core::session::Watch;
use protocol::bus::{BLOCK_BYTES, Node, Reassembler, Segments, ids};
use protocol::message::{DriveMessage, HostMessage, MessageBuffer, decode, encode};
use protocol::table::Limits;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

use crate::bus::Bus;
use crate::bus::real::wire::Wire;
use crate::bus::real::{RealBus, open};
use crate::drive_node::DriveNode;

/// Nothing here takes longer.
const PATIENCE: Duration = Duration::from_secs(20);

fn over(stream: UnixStream) -> Wire<SerialPort> {
    Wire::new(SerialPort::over(stream.try_clone().unwrap(), stream, FrameSize::Classic))
}

/// Goes on with the bus until there is an answer.
fn until<T>(bus: &mut dyn RealBus, mut look: impl FnMut(&mut dyn RealBus) -> Option<T>) -> T {
    let end = Instant::now() + PATIENCE;
    loop {
        let now = bus.now();
        bus.advance(now);
        if let Some(found) = look(bus) {
            return found;
        }
        assert!(Instant::now() < end, "nothing comes");
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn frames_cross_both_ways_and_are_confirmed() {
    let (here, there) = UnixStream::pair().unwrap();
    let (mut a, mut b) = (over(here), over(there));
    let (from, to) = (a.attach(), b.attach());
    let frames: Vec<Frame> = (0..40).map(|k| Frame::new(0x200, &[k]).unwrap()).collect();
    frames.iter().for_each(|frame| a.send(from, *frame, 0));
    let mut heard = Vec::new();
    let mut sent = 0;
    let end = Instant::now() + PATIENCE;
    while (heard.len() < 40 || sent < 40) && Instant::now() < end {
        let (now, later) = (a.now(), b.now());
        a.advance(now);
        b.advance(later);
        while a.sent(from).is_some() {
            sent += 1;
        }
        heard.extend(std::iter::from_fn(|| b.receive(to)).map(|received| received.frame));
    }
    assert_eq!((heard, sent, a.waiting(from)), (frames, 40, 0));
    assert_eq!(a.receive(from), None);
}

#[test]
fn noise_is_counted_and_a_line_that_breaks_is_told_of_once() {
    let (here, mut there) = UnixStream::pair().unwrap();
    let mut bus = over(here);
    let node = bus.attach();
    there.write_all(b"t1\r\x07t0012AB01\rt0G0\r").unwrap();
    let received = until(&mut bus, |bus| bus.receive(node));
    assert_eq!(received.frame, Frame::new(1, &[0xab, 1]).unwrap());
    until(&mut bus, |bus| (bus.health().errors == 3).then_some(()));
    drop(there);
    let error = until(&mut bus, |bus| bus.take_error());
    assert_eq!(error.to_string(), "slcan:test: the line is broken");
    bus.send(node, Frame::new(1, &[]).unwrap(), 0);
    assert_eq!(bus.waiting(node), 0);
}

#[test]
fn an_adapter_behind_a_socket_is_opened_first() {
    let folder = std::env::temp_dir().join(format!("feedspline-slcan-{}", std::process::id()));
    let _ = std::fs::remove_file(&folder);
    let listener = UnixListener::bind(&folder).unwrap();
    let spec = format!("slcan:{}", folder.display());
    let mut bus = open(&spec, FrameSize::Fd).unwrap();
    let node = bus.attach();
    bus.send(node, Frame::new(0x7ff, &[1; 12]).unwrap(), 0);
    let expected = b"\rC\rS8\rY5\rO\rb7FF9010101010101010101010101\r";
    let (mut there, _) = listener.accept().unwrap();
    let mut found = vec![0; expected.len()];
    there.read_exact(&mut found).unwrap();
    assert_eq!(String::from_utf8_lossy(&found), String::from_utf8_lossy(expected));
    std::fs::remove_file(&folder).unwrap();
}

#[test]
fn a_drive_behind_a_pseudo_terminal_says_who_it_is() {
    let controller = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    grantpt(&controller).unwrap();
    unlockpt(&controller).unwrap();
    let name = ptsname(&controller, Vec::new()).unwrap().into_string().unwrap();
    let mut drives = open(&format!("slcan:{name}"), FrameSize::Classic).unwrap();
    let controller = File::from(controller);
    let mut host =
        Wire::new(SerialPort::over(controller.try_clone().unwrap(), controller, FrameSize::Classic));

    let node = Node::new(5).unwrap();
    let limits = Limits { velocity: 1e5, acceleration: 1e6, jerk: Some(1e8) };
    let axis = AxisConfig { status_ticks: 5, ..AxisConfig::new(4, 1_000_000, limits) };
    let config =
        DriveConfig { node, frames: FrameSize::Classic, axis, watch: Watch::new(1_000_000, 5), key: None };
    let mut buffers = [vec![0; 512], vec![0; 512]];
    let mut drive = DriveNode::new(config, &mut buffers, drives.as_mut());
    let to_drives = host.attach();

    let mut buffer: MessageBuffer = [0; _];
    let question = encode(&HostMessage::Identify, &mut buffer).unwrap();
    for frame in Segments::new(ids::BROADCAST, FrameSize::Classic, 0, question).unwrap() {
        host.send(to_drives, frame, 0);
    }
    let mut block = Reassembler::<BLOCK_BYTES>::new();
    let axis = until(&mut host, |host| {
        let now = drives.now();
        drives.advance(now);
        drive.tick(drives.as_mut(), now);
        while let Some(received) = host.receive(to_drives) {
            if Node::of_answer(received.frame.id()) == Some(node)
                && let Ok(Some((_, bytes))) = block.push(received.frame.data())
                && let Ok(DriveMessage::Identity(identity)) = decode(bytes)
            {
                return Some(identity.axis);
            }
        }
        None
    });
    assert_eq!(axis, 4);
    assert!(drives.take_error().is_none());
}
