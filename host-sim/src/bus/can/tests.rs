use super::*;
use crate::bus::FrameSize;

const MS: u64 = 1_000_000;

fn bus() -> CanBus {
    CanBus::new(BitTiming::default(), Stuffing::Exact, 5)
}

fn frame(id: u16) -> Frame {
    Frame::new(id, &[id as u8; 8]).unwrap()
}

fn drain(bus: &mut CanBus, node: NodeIndex) -> Vec<u16> {
    core::iter::from_fn(|| bus.receive(node)).map(|r| r.frame.id()).collect()
}

fn three(bus: &mut CanBus) -> [NodeIndex; 3] {
    [bus.attach(), bus.attach(), bus.attach()]
}

#[test]
fn without_errors_it_is_the_simple_bus() {
    for stuffing in [Stuffing::Worst, Stuffing::Exact] {
        let mut simple = crate::bus::InProcessBus::new(BitTiming::default());
        let mut real = CanBus::new(BitTiming::default(), stuffing, 1);
        let nodes: Vec<_> = (0..4).map(|_| (simple.attach(), real.attach())).collect();
        let mut random = fastrand::Rng::with_seed(3);
        let mut now = 0;
        for _ in 0..400 {
            now += random.u64(0..200_000);
            simple.advance(now);
            real.advance(now);
            let from = random.usize(0..3);
            // Identifiers of different nodes differ.
            let frame = frame(random.u16(0..300) * 4 + from as u16);
            simple.send(nodes[from].0, frame, now);
            real.send(nodes[from].1, frame, now);
        }
        simple.advance(now + 500 * MS);
        real.advance(now + 500 * MS);
        let simple: Vec<Received> = core::iter::from_fn(|| simple.receive(nodes[3].0)).collect();
        let found: Vec<Received> = core::iter::from_fn(|| real.receive(nodes[3].1)).collect();
        assert_eq!(found.len(), 400);
        if stuffing == Stuffing::Worst {
            assert_eq!(simple, found);
        } else {
            assert!(
                found.iter().zip(&simple).filter(|(f, s)| f.frame == s.frame).all(|(f, s)| f.time <= s.time)
            );
        }
        assert_eq!(real.destroyed(), 0);
    }
}

#[test]
fn a_destroyed_frame_reaches_nobody_and_is_sent_again() {
    let mut bus = bus();
    let [a, b, c] = three(&mut bus);
    bus.disturb(Noise { from: 0, until: 50_000, share: 1.0 });
    bus.send(a, frame(0x123), 0);
    bus.advance(60_000);
    assert!(drain(&mut bus, b).is_empty() && bus.sent(a).is_none());
    bus.advance(MS);
    assert_eq!((drain(&mut bus, b), drain(&mut bus, c)), (vec![0x123], vec![0x123]));
    assert_eq!(bus.sent(a).map(|s| s.frame), Some(frame(0x123)));
    let history = bus.history(a);
    assert_eq!((history.sent, history.retried, bus.destroyed()), (1, 1, 1));
    // Eight for the failure, one back for the success; one for each receiver, and back.
    assert_eq!(bus.counters(a).transmit(), 7);
    assert_eq!([bus.counters(b).receive(), bus.counters(c).receive()], [0, 0]);
}

#[test]
fn an_error_costs_part_of_the_frame_its_flags_and_the_interframe_space() {
    let mut bus = bus();
    let [a, ..] = three(&mut bus);
    let whole = BitTiming::default().time(&frame(1), Stuffing::Exact);
    bus.disturb(Noise { from: 0, until: 1, share: 1.0 });
    bus.send(a, frame(1), 0);
    bus.advance(MS);
    let end = bus.sent(a).unwrap().time;
    assert!(end > whole + 23_000 + whole / 6 && end < 2 * whole + 23_000, "{end}");
}

#[test]
fn a_sender_that_garbles_leaves_the_bus_and_comes_back_by_itself() {
    let mut bus = bus();
    let [a, b, c] = three(&mut bus);
    bus.controller(a).garbles = 1.0;
    bus.send(a, frame(5), 0);
    bus.advance(3 * MS);
    assert_eq!(bus.counters(a).state(), ErrorState::BusOff);
    assert_eq!(bus.history(a).retried, 32);
    assert!(drain(&mut bus, b).is_empty());
    // The others go on, and their frames count for its way back.
    bus.controller(a).garbles = 0.0;
    bus.send(b, frame(7), 3 * MS);
    bus.advance(4 * MS);
    assert_eq!((drain(&mut bus, c), drain(&mut bus, a)), (vec![7], vec![]));
    bus.advance(6 * MS);
    assert_eq!(bus.counters(a).state(), ErrorState::Active);
    assert_eq!(drain(&mut bus, b), [5]);
    assert_eq!((bus.history(a).bus_offs, bus.history(a).recoveries), (1, 1));
    // 128 times 11 bits after it has left.
    let left = bus.sent(a).unwrap().time;
    assert!((3 * MS..6 * MS).contains(&left), "{left}");
}

#[test]
fn a_busy_bus_lets_a_node_back_after_128_frames() {
    let mut bus = bus();
    let [a, b, c] = three(&mut bus);
    bus.controller(a).garbles = 1.0;
    bus.send(a, frame(5), 0);
    bus.advance(5 * MS);
    bus.controller(a).garbles = 0.0;
    // Off since some time, and back soon.
    bus.advance(20 * MS);
    bus.controller(a).garbles = 1.0;
    bus.send(a, frame(6), 20 * MS);
    (0..400).for_each(|_| bus.send(b, frame(7), 20 * MS));
    bus.advance(20 * MS + 32 * 150_000);
    assert_eq!(bus.counters(a).state(), ErrorState::BusOff);
    let before = bus.history(b).sent;
    bus.controller(a).garbles = 0.0;
    bus.advance(100 * MS);
    let heard: Vec<u16> = drain(&mut bus, c);
    let at = heard.iter().rposition(|id| *id == 6).unwrap() as u64;
    assert!((before..=before + 130).contains(&at), "{before} {at}");
}

#[test]
fn manual_recovery_waits_to_be_asked() {
    let mut bus = bus();
    let [a, b, _] = three(&mut bus);
    *bus.controller(a) = Controller { recovery: Recovery::Manual, garbles: 1.0, ..Controller::default() };
    bus.send(a, frame(5), 0);
    bus.advance(500 * MS);
    assert_eq!(bus.counters(a).state(), ErrorState::BusOff);
    bus.controller(a).garbles = 0.0;
    bus.recover(a, 500 * MS);
    bus.advance(500 * MS + 1_407_000);
    assert_eq!(bus.counters(a).state(), ErrorState::BusOff);
    bus.advance(502 * MS);
    assert_eq!((bus.counters(a).state(), drain(&mut bus, b)), (ErrorState::Active, vec![5]));
}

#[test]
fn a_frame_that_nobody_acknowledges_was_not_sent() {
    let mut bus = bus();
    let [a, b, c] = three(&mut bus);
    bus.cut(a, 0);
    bus.send(a, frame(9), 0);
    bus.send(b, frame(8), 0);
    bus.advance(100 * MS);
    assert!(bus.sent(a).is_none());
    assert_eq!((bus.waiting(a), drain(&mut bus, c), drain(&mut bus, a)), (1, vec![8], vec![]));
    assert_eq!((bus.counters(a).state(), bus.counters(a).transmit()), (ErrorState::Passive, 128));
    assert_eq!(bus.counters(b).transmit(), 0);
    bus.join(a, 100 * MS);
    bus.advance(101 * MS);
    assert_eq!((drain(&mut bus, b), bus.history(a).sent), (vec![9], 1));
    // A node whose partners are all cut off is as alone as they are.
    bus.cut(b, 101 * MS);
    bus.cut(c, 101 * MS);
    bus.send(a, frame(10), 101 * MS);
    bus.advance(120 * MS);
    assert_eq!((bus.history(a).sent, bus.waiting(a)), (1, 1));
}

#[test]
fn a_one_shot_is_not_repeated() {
    let mut bus = bus();
    let [a, b, c] = three(&mut bus);
    bus.controller(a).one_shot = true;
    bus.send(a, Frame::new(0x77, &[1]).unwrap(), 0);
    bus.send(b, Frame::new(0x77, &[2]).unwrap(), 0);
    bus.advance(MS);
    assert_eq!((bus.history(a).sent, bus.history(b).sent, bus.destroyed()), (0, 1, 1));
    assert_eq!(bus.receive(c).map(|r| r.frame.data().to_vec()), Some(vec![2]));
}

#[test]
fn listeners_do_not_acknowledge() {
    let mut bus = bus();
    let [a, b] = [bus.attach(), bus.attach()];
    bus.controller(b).listen_only = true;
    bus.send(a, frame(9), 0);
    bus.advance(10 * MS);
    assert_eq!((bus.history(a).sent, drain(&mut bus, b).len()), (0, 0));
}

#[test]
fn a_full_receive_queue_loses_the_newest() {
    let mut bus = bus();
    let [a, b, c] = three(&mut bus);
    bus.controller(b).receive_depth = 3;
    (1..=5).for_each(|id| bus.send(a, frame(id), 0));
    bus.advance(MS);
    assert_eq!((drain(&mut bus, b), bus.history(b).overruns), (vec![1, 2, 3], 2));
    assert_eq!(drain(&mut bus, c), [1, 2, 3, 4, 5]);
}

#[test]
fn a_full_send_queue_refuses() {
    let mut bus = bus();
    let [a, b, _] = three(&mut bus);
    bus.controller(a).send_depth = 2;
    (1..=5).for_each(|id| bus.send(a, frame(id), 0));
    assert!(!bus.has_room(a));
    bus.advance(MS);
    assert_eq!((drain(&mut bus, b), bus.history(a).refused), (vec![1, 2], 3));
    assert!(bus.has_room(a));
}

#[test]
fn two_senders_of_one_identifier_leave_the_bus_together() {
    let mut bus = bus();
    let [a, b, c] = three(&mut bus);
    bus.send(a, Frame::new(0x77, &[1]).unwrap(), 0);
    bus.send(b, Frame::new(0x77, &[2]).unwrap(), 0);
    bus.advance(4 * MS);
    assert_eq!([a, b].map(|n| bus.history(n).bus_offs), [1, 1]);
    assert!(drain(&mut bus, c).is_empty());
    // Frames that are alike to the bit do not disturb each other.
    let mut bus = super::tests::bus();
    let [a, b, c] = three(&mut bus);
    bus.send(a, frame(0x77), 0);
    bus.send(b, frame(0x77), 0);
    bus.advance(4 * MS);
    assert_eq!((drain(&mut bus, c), bus.history(a).sent, bus.history(b).sent), (vec![0x77], 1, 1));
}

#[test]
fn a_receiver_that_misreads_disturbs_all_until_it_is_passive() {
    let mut bus = bus();
    let [a, b, c] = three(&mut bus);
    bus.controller(c).misreads = 1.0;
    (0..20).for_each(|id| bus.send(a, frame(id), 0));
    bus.advance(20 * MS);
    assert_eq!(bus.counters(c).state(), ErrorState::Passive);
    assert_eq!((drain(&mut bus, b).len(), drain(&mut bus, c).len()), (20, 0));
    // Nine for each frame that it has destroyed.
    assert_eq!(bus.history(a).retried, 15);
    assert_eq!(bus.history(c).misread, 20);
}

#[test]
fn an_fd_frame_is_an_error_to_a_classic_node() {
    let mut bus = bus();
    let [a, b, c] = three(&mut bus);
    bus.controller(a).format = Some(FrameSize::Fd);
    bus.controller(b).format = Some(FrameSize::Fd);
    bus.send(a, Frame::new(5, &[1; 64]).unwrap(), 0);
    bus.advance(20 * MS);
    // It goes through once the classic node can no longer object; that one never sees it.
    assert_eq!((drain(&mut bus, b), drain(&mut bus, c)), (vec![5], vec![]));
    assert!(bus.history(a).retried >= 14);
}

#[test]
fn foreign_traffic_takes_the_share_that_it_asks_for() {
    for load in [0.3, 0.6, 0.9] {
        let mut bus = bus();
        three(&mut bus);
        bus.attach_source(Source::foreign([0x400, 0x4ff], load, 9));
        (1..=2000).for_each(|ms| bus.advance(ms * MS));
        let found = bus.traffic().busy as f64 / (2000 * MS) as f64;
        assert!((found - load).abs() < 0.04, "{load}: {found}");
    }
}

#[test]
fn a_babbler_keeps_everybody_behind_it_from_sending() {
    let mut bus = bus();
    let [a, b, _] = three(&mut bus);
    let mad = bus.attach_source(Source::babbler(0x100, MS, 50 * MS));
    bus.send(a, frame(0x200), 2 * MS);
    bus.send(b, frame(0x080), 3 * MS);
    (1..=60).for_each(|ms| bus.advance(ms * MS));
    let at = |r: Option<Received>| r.unwrap().time;
    assert!(at(bus.sent(b)) < 4 * MS);
    let last = at(bus.sent(a));
    assert!((50 * MS..52 * MS).contains(&last), "{last}");
    assert!(bus.history(mad).sent > 350);
}

#[test]
fn an_error_passive_sender_lets_others_go_first() {
    let mut bus = bus();
    let [a, b, c] = three(&mut bus);
    bus.controller(a).garbles = 1.0;
    bus.send(a, frame(1), 0);
    bus.send(b, frame(0x7ff), 0);
    let mut now = 0;
    let heard = loop {
        now += 10_000;
        bus.advance(now);
        let heard = drain(&mut bus, c);
        if !heard.is_empty() {
            break heard;
        }
    };
    // The lower identifier has won each time, until it had to wait behind its own error.
    assert_eq!((heard, bus.history(a).retried), (vec![0x7ff], 16));
}

#[test]
fn the_seed_decides_and_nothing_else() {
    let run = |seed: u64, step: u64| {
        let mut bus = CanBus::new(BitTiming::default(), Stuffing::Exact, seed);
        let [a, b, c] = three(&mut bus);
        bus.disturb(Noise { from: 0, until: u64::MAX, share: 0.2 });
        bus.controller(c).misreads = 0.1;
        for id in 0..200 {
            bus.send(a, frame(2 * id), 0);
            bus.send(b, frame(2 * id + 1), 0);
        }
        (1..=100 * MS / step).for_each(|k| bus.advance(k * step));
        let heard: Vec<Received> = core::iter::from_fn(|| bus.receive(c)).collect();
        (heard, bus.destroyed())
    };
    assert_eq!(run(1, MS), run(1, 370_000 / 10));
    assert_ne!(run(1, MS), run(2, MS));
}
