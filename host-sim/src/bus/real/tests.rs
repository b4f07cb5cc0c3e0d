use super::*;

use std::cell::RefCell;
use std::rc::Rc;

/// A wire that takes so many frames, and gives what it is given.
#[derive(Default)]
struct Paper {
    room: usize,
    sent: Vec<u16>,
    coming: VecDeque<Frame>,
    broken: bool,
}

struct Shared(Rc<RefCell<Paper>>);

impl Wire for Shared {
    fn send(&mut self, frame: &Frame) -> Result<bool, BusError> {
        let mut paper = self.0.borrow_mut();
        if paper.broken {
            return Err(BusError::Down("paper".into()));
        }
        if paper.room == 0 {
            return Ok(false);
        }
        paper.room -= 1;
        paper.sent.push(frame.id());
        Ok(true)
    }

    fn receive(&mut self) -> Result<Option<Frame>, BusError> {
        Ok(self.0.borrow_mut().coming.pop_front())
    }
}

fn frame(id: u16) -> Frame {
    Frame::new(id, &[1]).unwrap()
}

fn bus(room: usize) -> (Live, Rc<RefCell<Paper>>) {
    let paper = Rc::new(RefCell::new(Paper { room, ..Paper::default() }));
    (Live::new(Box::new(Shared(Rc::clone(&paper)))), paper)
}

#[test]
fn nodes_of_one_process_hear_each_other_and_the_wire() {
    let (mut bus, paper) = bus(10);
    let [a, b] = [bus.attach(), bus.attach()];
    bus.send(a, frame(5), 7);
    paper.borrow_mut().coming.push_back(frame(6));
    bus.advance(9);
    let ids = |bus: &mut Live, node| -> Vec<(u64, u16)> {
        std::iter::from_fn(|| bus.receive(node)).map(|r| (r.time, r.frame.id())).collect()
    };
    assert_eq!(ids(&mut bus, a), [(9, 6)]);
    assert_eq!(ids(&mut bus, b), [(7, 5), (9, 6)]);
    assert_eq!(bus.sent(a).map(|r| r.frame.id()), Some(5));
    assert_eq!((bus.sent(a), bus.traffic().frames), (None, 2));
}

#[test]
fn a_full_queue_keeps_frames_in_order_until_they_are_stale() {
    let (mut bus, paper) = bus(1);
    let a = bus.attach();
    (1..=3).for_each(|id| bus.send(a, frame(id), 0));
    assert_eq!((bus.waiting(a), paper.borrow().sent.len()), (2, 1));
    paper.borrow_mut().room = 1;
    bus.advance(1_000);
    assert_eq!((bus.waiting(a), paper.borrow().sent.clone()), (1, vec![1, 2]));
    // The bus comes back when what waits is no longer true.
    paper.borrow_mut().room = 9;
    bus.advance(STALE_NS + 1);
    assert_eq!((bus.waiting(a), bus.stale(), paper.borrow().sent.len()), (0, 1, 2));
}

#[test]
fn a_bus_that_is_down_says_so_once_and_keeps_nothing() {
    let (mut bus, paper) = bus(9);
    paper.borrow_mut().broken = true;
    let a = bus.attach();
    bus.send(a, frame(1), 0);
    assert!(matches!(bus.take_error(), Some(BusError::Down(_))));
    assert!(bus.take_error().is_none());
    paper.borrow_mut().broken = false;
    bus.advance(1);
    assert_eq!((bus.waiting(a), paper.borrow().sent.len()), (0, 0));
}

#[test]
fn names_that_are_none_are_refused() {
    for name in ["", "a/b", "slcan", "this name is too long for one", "x:y"] {
        assert!(open(name, FrameSize::Classic).is_err(), "{name}");
    }
    let gone = open("slcan:/does/not/exist", FrameSize::Classic);
    assert!(matches!(gone.err(), Some(BusError::Open { .. })));
}
