use super::*;

/// What a port has been told to do, and what has become of it.
#[derive(Debug, Default)]
struct Fake {
    room: usize,
    taken: Vec<Frame>,
    heard: VecDeque<Heard>,
    down: bool,
}

impl Port for Fake {
    fn send(&mut self, frame: &Frame) -> Result<Handed, BusError> {
        if self.down {
            return Err(BusError::Down { bus: "fake0".into() });
        }
        if self.room == 0 {
            return Ok(Handed::Full);
        }
        self.room -= 1;
        self.taken.push(*frame);
        Ok(Handed::Taken)
    }

    fn receive(&mut self) -> Result<Option<Heard>, BusError> {
        Ok(self.heard.pop_front())
    }

    fn reopen(&mut self) -> bool {
        !self.down
    }

    fn overruns(&self) -> u64 {
        7
    }
}

fn frame(id: u16, byte: u8) -> Frame {
    Frame::new(id, &[byte]).unwrap()
}

fn wire(room: usize) -> Wire<Fake> {
    Wire::new(Fake { room, ..Fake::default() })
}

fn advance(wire: &mut Wire<Fake>) {
    let now = wire.now();
    wire.advance(now);
}

#[test]
fn a_full_queue_keeps_frames_and_sends_them_later_stops_first() {
    let mut wire = wire(1);
    let node = wire.attach();
    for k in 0..3 {
        wire.send(node, frame(0x300, k), 0);
    }
    wire.send(node, frame(ids::STOP, 9), 0);
    assert_eq!((wire.waiting(node), wire.port.taken.as_slice()), (4, &[frame(0x300, 0)][..]));
    wire.port.room = 10;
    advance(&mut wire);
    let order: Vec<u8> = wire.port.taken.iter().map(|frame| frame.data()[0]).collect();
    assert_eq!(order, [0, 9, 1, 2]);
    assert!(wire.take_error().is_none());
}

#[test]
fn only_so_many_are_under_way_and_the_lowest_identifier_of_two_nodes_goes_first() {
    let mut wire = wire(100);
    let [a, b] = [wire.attach(), wire.attach()];
    for k in 0..12 {
        wire.send(a, frame(0x300, k), 0);
    }
    assert_eq!((wire.port.taken.len(), wire.waiting(a)), (UNDER_WAY, 12));
    wire.send(b, frame(0x280, 99), 0);
    let first = wire.port.taken[0];
    wire.port.heard.push_back(Heard::Frame(Instant::now(), first));
    advance(&mut wire);
    assert_eq!(wire.port.taken.last(), Some(&frame(0x280, 99)));
    let now = wire.now();
    wire.advance(now);
    assert_eq!(wire.sent(a).map(|sent| sent.frame), Some(first));
    assert_eq!(wire.sent(a), None);
    // Whoever shares the opening hears it, who sent it does not.
    assert_eq!(wire.receive(b).map(|received| received.frame), Some(first));
    assert_eq!(wire.receive(a), None);
    assert_eq!(wire.traffic().frames, 1);
}

#[test]
fn what_comes_later_than_asked_for_is_kept() {
    let mut wire = wire(0);
    let node = wire.attach();
    std::thread::sleep(Duration::from_millis(2));
    wire.port.heard.push_back(Heard::Frame(Instant::now(), frame(0x181, 1)));
    wire.advance(1);
    assert_eq!(wire.receive(node), None);
    advance(&mut wire);
    assert!(wire.receive(node).is_some_and(|received| received.time >= 2_000_000));
}

#[test]
fn what_waited_for_a_bus_that_was_gone_is_not_sent_when_it_comes_back() {
    let mut wire = wire(0);
    let node = wire.attach();
    wire.send(node, frame(0x300, 1), 0);
    wire.port.down = true;
    advance(&mut wire);
    assert!(matches!(wire.take_error(), Some(BusError::Down { .. })));
    assert!(wire.take_error().is_none());
    wire.send(node, frame(0x300, 2), 0);
    assert_eq!((wire.waiting(node), wire.health().dropped), (0, 2));
    (wire.port.down, wire.port.room) = (false, 10);
    std::thread::sleep(AGAIN);
    advance(&mut wire);
    wire.send(node, frame(0x300, 3), 0);
    assert_eq!(wire.port.taken, [frame(0x300, 3)]);
}

#[test]
fn frames_grow_old_but_stops_do_not() {
    let mut wire = wire(1);
    let node = wire.attach();
    for (id, byte) in [(0x300, 0), (0x300, 1), (ids::STOP, 2)] {
        wire.send(node, frame(id, byte), 0);
    }
    std::thread::sleep(Duration::from_nanos(STALE) + Duration::from_millis(50));
    wire.port.room = 10;
    advance(&mut wire);
    assert_eq!(wire.port.taken, [frame(0x300, 0), frame(ids::STOP, 2)]);
    let health = wire.health();
    assert_eq!((health.dropped, health.unconfirmed, health.overruns), (1, 1, 7));
    // A late confirmation is still known for what it is.
    let first = wire.port.taken[0];
    wire.port.heard.push_back(Heard::Frame(Instant::now(), first));
    advance(&mut wire);
    let now = wire.now();
    wire.advance(now);
    assert_eq!(wire.receive(node), None);
}

#[test]
fn errors_and_strangers_are_counted() {
    let mut wire = wire(0);
    wire.port.heard.extend([Heard::Error, Heard::Foreign, Heard::Error]);
    advance(&mut wire);
    let health = wire.health();
    assert_eq!((health.errors, health.foreign), (2, 1));
}
