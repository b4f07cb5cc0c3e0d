//! Stops, holds and clocks.

use host_sim::host_node::HostError;
use protocol::bus::stop::Stop;
use protocol::bus::sync::{self, Time};
use protocol::bus::{Frame, ids};
use protocol::message::State;
use protocol::power::Power;
use tests::fleet::Job;
use tests::scene::{MS, Scene};

fn emergency_stop(scene: &mut Scene<'_>, stop: Stop) {
    (0..3).for_each(|_| scene.say(stop.frame().unwrap()));
}

/// The host, or whoever has written down what it has said, goes on sending: nothing moves.
fn release(scene: &mut Scene<'_>) {
    let before: Vec<i64> = scene.statuses().iter().map(|status| status.position).collect();
    for frame in scene.words_of_the_host() {
        scene.say(frame);
    }
    scene.assert_comes_to_rest(700);
    let after: Vec<i64> = scene.statuses().iter().map(|status| status.position).collect();
    assert_eq!(before, after);
}

#[test]
fn emergency_stop_while_drives_are_armed() {
    let job = Job::short(host_sim::bus::BitTiming::default());
    for stop in [Stop::Quick, Stop::Off, Stop::Path { tick: None }] {
        let mut buffers = job.buffers();
        let mut scene = Scene::new(&job, &mut buffers);
        scene.until_all(State::Armed);
        emergency_stop(&mut scene, stop);
        scene.assert_never_moves(1_500);
        assert!(matches!(scene.error, Some(HostError::Told { .. })), "{:?}", scene.error);
        release(&mut scene);
        scene.assert_never_moves(100);
        scene.assert_no_fault();
    }
}

#[test]
fn emergency_stop_before_anything_is_armed() {
    let job = Job::short(host_sim::bus::BitTiming::default());
    for ms in [20, 60, 120, 200, 300] {
        let mut buffers = job.buffers();
        let mut scene = Scene::new(&job, &mut buffers);
        scene.pass(ms);
        emergency_stop(&mut scene, Stop::Quick);
        scene.assert_never_moves(2_500);
        assert!(matches!(scene.error, Some(HostError::Told { .. })), "{:?}", scene.error);
    }
}

#[test]
fn emergency_stop_in_motion() {
    let job = Job::short(host_sim::bus::BitTiming::default());
    for (stop, power) in [(Stop::Quick, Power::QuickStopActive), (Stop::Off, Power::SwitchOnDisabled)] {
        let mut buffers = job.buffers();
        let mut scene = Scene::new(&job, &mut buffers);
        scene.until_moving();
        scene.pass(100);
        emergency_stop(&mut scene, stop);
        scene.assert_comes_to_rest(500);
        assert!(scene.statuses().iter().all(|status| status.power == power), "{:?}", scene.statuses());
        assert!(scene.error.is_some());
        release(&mut scene);
        assert!(scene.statuses().iter().all(|status| status.power == power), "{:?}", scene.statuses());
        scene.assert_no_fault();
    }
}

/// On the way to rest already: at the end of the table, and in a hold.
#[test]
fn emergency_stop_on_the_way_to_rest() {
    let job = Job::short(host_sim::bus::BitTiming::default());
    for hold in [false, true] {
        let mut buffers = job.buffers();
        let mut scene = Scene::new(&job, &mut buffers);
        scene.until_moving();
        if hold {
            scene.pass(100);
            scene.say(Stop::Path { tick: None }.frame().unwrap());
            scene.pass(60);
        } else {
            scene.until("the end", |scene| scene.statuses()[0].fill < 25);
        }
        emergency_stop(&mut scene, Stop::Quick);
        scene.assert_comes_to_rest(500);
        release(&mut scene);
        scene.assert_no_fault();
    }
}

#[test]
fn a_second_emergency_stop() {
    let job = Job::short(host_sim::bus::BitTiming::default());
    for after_ms in [2, 15, 40, 300] {
        let mut buffers = job.buffers();
        let mut scene = Scene::new(&job, &mut buffers);
        scene.until_moving();
        scene.pass(120);
        emergency_stop(&mut scene, Stop::Quick);
        scene.pass(after_ms);
        emergency_stop(&mut scene, Stop::Quick);
        scene.assert_comes_to_rest(500);
        assert!(scene.statuses().iter().all(|status| status.power == Power::QuickStopActive));
        emergency_stop(&mut scene, Stop::Off);
        release(&mut scene);
        assert!(scene.statuses().iter().all(|status| status.power == Power::SwitchOnDisabled));
        scene.assert_no_fault();
    }
}

#[test]
fn override_to_zero_and_back() {
    let job = Job::short(host_sim::bus::BitTiming::default());
    let mut buffers = job.buffers();
    let mut scene = Scene::new(&job, &mut buffers);
    scene.until_moving();
    scene.pass(60);
    let change = |scene: &mut Scene<'_>, permille: u16| {
        let now = scene.fleet.now();
        let host = scene.fleet.host();
        let tick = host.tick_at(now);
        host.change_rate(permille, tick);
    };
    change(&mut scene, 0);
    scene.until_all(State::Held);
    scene.pass(600);
    assert!(scene.statuses().iter().all(|status| status.state == State::Held), "{:?}", scene.statuses());
    change(&mut scene, 1000);
    scene.assert_comes_to_rest(2_000);
    scene.assert_played_to_the_end();
    scene.assert_on_path(&job.path());
    assert_eq!(scene.error, None);
}

/// Somebody leads the drives' counts to the end of 32 bits before there is a host.
fn at_the_wrap(before: u32) -> (u64, u64) {
    let job = Job::short(host_sim::bus::BitTiming::default());
    let mut buffers = job.buffers();
    let mut scene = Scene::new(&job, &mut buffers);
    scene.fleet.kill_host();
    let mut counter = 0;
    for tick in [0x6000_0000, 0xc000_0000, u32::MAX - before] {
        for _ in 0..3 {
            counter = sync::after(counter);
            scene.say(sync::sync(counter).unwrap());
            scene.say(Time { counter, tick, ns: 0 }.frame().unwrap());
            scene.pass(3);
        }
    }
    let far = (1u64 << 32) - u64::from(before) - 100;
    assert!(scene.statuses().iter().all(|status| status.tick > far), "{:?}", scene.statuses());
    scene.new_host();
    scene.until_moving();
    let from = scene.statuses()[0].tick;
    scene.until("rest", |scene| scene.statuses().iter().all(|status| status.state == State::Holding));
    let until = scene.statuses()[0].tick;
    scene.assert_played_to_the_end();
    scene.assert_on_path(&job.path());
    scene.pass(400);
    assert_eq!(scene.error, None);
    (from, until)
}

#[test]
fn ticks_of_32_bits_wrap() {
    let wrap = 1u64 << 32;
    let (from, until) = at_the_wrap(100_000);
    assert!(until < wrap);
    // In the middle of the motion, between the start's command and the start, while tables are sent.
    let at = |tick: u64| (100_000 - (wrap - tick)) as u32;
    let (from, until) = at_the_wrap(at((from + until) / 2));
    assert!(from < wrap && wrap < until, "{from} {until}");
    at_the_wrap(at(from.min(wrap - 1)).saturating_sub(20));
    at_the_wrap(150);
}

#[test]
fn the_time_master_dies_in_motion() {
    let job = Job::short(host_sim::bus::BitTiming::default());
    let mut buffers = job.buffers();
    let mut scene = Scene::new(&job, &mut buffers);
    scene.until_moving();
    scene.pass(40);
    let (node, now) = (scene.drive_node(0), scene.fleet.now());
    scene.bus.cut(node, now);
    scene.assert_comes_to_rest(1_200);
    scene.assert_on_path(&job.path());
    scene.assert_no_fault();
    assert!(scene.statuses().iter().all(|status| status.state == State::Held), "{:?}", scene.statuses());
    assert!(matches!(scene.error, Some(HostError::Stopped { .. })), "{:?}", scene.error);
}

#[test]
fn network_management_never_starts_anything() {
    let job = Job::short(host_sim::bus::BitTiming::default());
    let mut buffers = job.buffers();
    let mut scene = Scene::new(&job, &mut buffers);
    scene.until_all(State::Ready);
    scene.fleet.kill_host();
    let host = scene.host;
    scene.bus.flush(host);
    for command in [1u8, 2, 128, 129, 130, 1] {
        scene.say(Frame::new(ids::NMT, &[command, 0]).unwrap());
    }
    scene.assert_never_moves(400);
    assert!(scene.fleet.now() > 400 * MS);
}
