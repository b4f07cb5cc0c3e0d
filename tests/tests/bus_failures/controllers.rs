//! Queues, error states and foreign nodes.

use host_sim::bus::can::{Controller, ErrorState, Noise, Recovery, Source};
use host_sim::bus::{BitTiming, FrameSize};
use host_sim::host_node::HostError;
use protocol::bus::Node;
use protocol::message::State;
use tests::fleet::Job;
use tests::scene::{MS, Scene};

const FOR_EVER: u64 = u64::MAX;

#[test]
fn send_queues_are_full() {
    let job = Job::short(BitTiming::default());
    let mut buffers = job.buffers();
    let mut scene = Scene::new(&job, &mut buffers);
    scene.bus.controller(scene.host).send_depth = 10;
    for axis in 0..3 {
        let node = scene.drive_node(axis);
        scene.bus.controller(node).send_depth = 3;
    }
    scene.until_moving();
    scene.assert_comes_to_rest(1_000);
    scene.assert_played_to_the_end();
    scene.assert_on_path(&job.path());
    assert_eq!(scene.bus.history(scene.host).refused, 0);
}

/// The host is cut off and dies; what its interface holds goes out when the bus returns.
#[test]
fn a_stale_queue_is_flushed_after_the_bus_returns() {
    let job = Job::short(BitTiming::default());
    let mut stale = 0;
    for cut_ms in [60, 90, 130, 180, 240, 330, 430, 460, 480, 500, 520] {
        let mut buffers = job.buffers();
        let mut scene = Scene::new(&job, &mut buffers);
        scene.pass(cut_ms);
        let moving = scene.moved.iter().any(|moved| *moved);
        let (host, now) = (scene.host, scene.fleet.now());
        scene.bus.cut(host, now);
        // The host goes on for a while, and so do its signs of life.
        scene.pass(60);
        scene.fleet.kill_host();
        scene.pass(900);
        let before: Vec<i64> = scene.statuses().iter().map(|status| status.position).collect();
        let now = scene.fleet.now();
        stale += host_sim::bus::Bus::waiting(&scene.bus, host);
        scene.bus.join(host, now);
        scene.assert_comes_to_rest(400);
        assert_eq!(host_sim::bus::Bus::waiting(&scene.bus, host), 0);
        let after: Vec<i64> = scene.statuses().iter().map(|status| status.position).collect();
        assert_eq!(before, after, "{cut_ms}");
        if !moving && before.iter().zip(&job.cast.drives).all(|(at, drive)| *at == drive.axis.position) {
            scene.assert_never_moves(300);
        }
        scene.assert_on_path(&job.path());
        scene.assert_no_fault();
    }
    assert!(stale > 50, "{stale}");
}

/// Takes a node off the bus; when it garbles no more, it may come back.
fn take_off(scene: &mut Scene<'_>, nodes: &[host_sim::bus::NodeIndex], recovery: Recovery) {
    for &node in nodes {
        scene.bus.controller(node).recovery = recovery;
        scene.bus.controller(node).garbles = 1.0;
    }
    scene.until("bus-off", |scene| {
        nodes.iter().all(|&node| {
            let history = scene.bus.history(node);
            history.bus_offs > 0
        })
    });
    nodes.iter().for_each(|&node| scene.bus.controller(node).garbles = 0.0);
}

/// After a recovery by hand, long after everything has stopped, nothing moves by itself.
fn come_back_and_rest(scene: &mut Scene<'_>, nodes: &[host_sim::bus::NodeIndex]) {
    scene.assert_comes_to_rest(900);
    let now = scene.fleet.now();
    nodes.iter().for_each(|&node| scene.bus.recover(node, now));
    let before: Vec<i64> = scene.statuses().iter().map(|status| status.position).collect();
    scene.assert_comes_to_rest(300);
    let after: Vec<i64> = scene.statuses().iter().map(|status| status.position).collect();
    assert_eq!(before, after);
    assert!(nodes.iter().all(|&node| scene.bus.counters(node).state() != ErrorState::BusOff));
    scene.assert_no_fault();
}

#[test]
fn bus_off_of_the_host_that_recovers_by_itself() {
    let job = Job::short(BitTiming::default());
    let mut buffers = job.buffers();
    let mut scene = Scene::new(&job, &mut buffers);
    scene.until_moving();
    let host = scene.host;
    take_off(&mut scene, &[host], Recovery::Automatic);
    scene.assert_comes_to_rest(1_000);
    scene.assert_played_to_the_end();
    scene.assert_on_path(&job.path());
}

#[test]
fn bus_off_of_the_host_that_somebody_recovers() {
    let job = Job::short(BitTiming::default());
    let mut buffers = job.buffers();
    let mut scene = Scene::new(&job, &mut buffers);
    scene.until_moving();
    let host = scene.host;
    take_off(&mut scene, &[host], Recovery::Manual);
    come_back_and_rest(&mut scene, &[host]);
    scene.assert_on_path(&job.path());
    assert!(scene.statuses().iter().all(|status| status.state == State::Held), "{:?}", scene.statuses());
    assert!(matches!(scene.error, Some(HostError::Stopped { .. })), "{:?}", scene.error);
}

#[test]
fn bus_off_of_one_drive_that_recovers_by_itself() {
    let job = Job::short(BitTiming::default());
    let mut buffers = job.buffers();
    let mut scene = Scene::new(&job, &mut buffers);
    scene.until_moving();
    let drive = scene.drive_node(1);
    take_off(&mut scene, &[drive], Recovery::Automatic);
    scene.assert_comes_to_rest(1_000);
    scene.assert_played_to_the_end();
    scene.assert_on_path(&job.path());
}

#[test]
fn bus_off_of_one_drive_that_somebody_recovers() {
    let job = Job::short(BitTiming::default());
    for axis in 0..3 {
        let mut buffers = job.buffers();
        let mut scene = Scene::new(&job, &mut buffers);
        scene.until_moving();
        let drive = scene.drive_node(axis);
        take_off(&mut scene, &[drive], Recovery::Manual);
        come_back_and_rest(&mut scene, &[drive]);
        scene.assert_on_path(&job.path());
        assert!(matches!(scene.error, Some(HostError::Stopped { .. })), "{:?}", scene.error);
    }
}

#[test]
fn bus_off_of_all_that_recover_by_themselves() {
    let job = Job::short(BitTiming::default());
    let mut buffers = job.buffers();
    let mut scene = Scene::new(&job, &mut buffers);
    scene.until_moving();
    let from = scene.fleet.now();
    scene.bus.disturb(Noise { from, until: from + 60 * MS, share: 1.0 });
    scene.assert_comes_to_rest(1_000);
    scene.assert_played_to_the_end();
    scene.assert_on_path(&job.path());
    assert!(scene.bus.history(scene.host).bus_offs > 0);
}

#[test]
fn bus_off_of_all_that_somebody_recovers() {
    let job = Job::short(BitTiming::default());
    let mut buffers = job.buffers();
    let mut scene = Scene::new(&job, &mut buffers);
    scene.until_moving();
    let mut nodes: Vec<_> = (0..3).map(|axis| scene.drive_node(axis)).collect();
    nodes.push(scene.host);
    take_off(&mut scene, &nodes, Recovery::Manual);
    come_back_and_rest(&mut scene, &nodes);
    scene.assert_on_path(&job.path());
}

/// A node that never stops sending, and whose own errors have made it passive.
#[test]
fn an_error_passive_node_babbles() {
    let job = Job::short(BitTiming::default());
    // Behind all others, among them, and in front of all of them.
    for (id, plays_on) in [(0x7f0, true), (0x290, false), (0x001, false)] {
        let mut buffers = job.buffers();
        let mut scene = Scene::new(&job, &mut buffers);
        let mad = scene.bus.attach_source(Source::babbler(id, 500 * MS, 1_500 * MS));
        scene.bus.controller(mad).misreads = 1.0;
        scene.until_moving();
        scene.assert_comes_to_rest(2_500);
        scene.assert_on_path(&job.path());
        scene.assert_no_fault();
        assert_eq!(scene.bus.counters(mad).state(), ErrorState::Passive);
        assert!(scene.bus.history(mad).sent > 3_000);
        if plays_on {
            scene.assert_played_to_the_end();
        }
    }
}

#[test]
fn receive_queues_overrun() {
    let job = Job::short(BitTiming::default());
    for depth in [3, 5, 8] {
        let mut buffers = job.buffers();
        let mut scene = Scene::new(&job, &mut buffers);
        for axis in 0..3 {
            let node = scene.drive_node(axis);
            scene.bus.controller(node).receive_depth = depth;
        }
        let host = scene.host;
        scene.bus.controller(host).receive_depth = depth;
        scene.assert_comes_to_rest(6_000);
        scene.assert_on_path(&job.path());
        scene.assert_no_fault();
        let overruns = scene.bus.history(scene.drive_node(1)).overruns;
        assert!(overruns > 10 || depth > 5, "{depth}: {overruns}");
        // It is played, or the host says why not; alone moves nobody.
        if scene.error.is_none() {
            scene.assert_played_to_the_end();
        } else {
            scene.assert_never_moves(100);
        }
    }
}

#[test]
fn two_drives_have_one_number() {
    let mut job = Job::short(BitTiming::default());
    job.cast.drives[1].node = Node::new(1).unwrap();
    let mut buffers = job.buffers();
    let mut scene = Scene::new(&job, &mut buffers);
    scene.until("an error", |scene| scene.error.is_some());
    scene.assert_never_moves(500);
    assert!(
        matches!(scene.error, Some(HostError::Silent { .. } | HostError::Mismatch { .. })),
        "{:?}",
        scene.error
    );
}

/// Three drives as they should be, and a fourth one with the number of the second.
#[test]
fn a_fourth_drive_has_the_number_of_the_second() {
    let mut job = Job::short(BitTiming::default());
    let mut twin = job.cast.drives[1];
    twin.watch.boot = 99;
    job.cast.drives.push(twin);
    let mut buffers = job.buffers();
    let twins = job.cast.drives.clone();
    job.cast.drives.truncate(3);
    let mut bus = host_sim::bus::CanBus::new(BitTiming::default(), host_sim::bus::Stuffing::Exact, 3);
    let host = job.host(&mut bus);
    let settings = host_sim::fleet::FleetSettings::default();
    let mut fleet = host_sim::fleet::Fleet::new(&twins, &mut buffers, host, settings, &mut bus);
    let (mut moved, mut error) = ([false; 4], None);
    while fleet.now() < 8_000 * MS {
        match fleet.step(&mut bus) {
            host_sim::fleet::Event::Tick { axis, setpoint, .. } => moved[axis] |= !setpoint.done,
            host_sim::fleet::Event::Failed(found) => {
                error = error.or(Some(found));
                fleet.kill_host();
            }
            host_sim::fleet::Event::Host => {}
        }
    }
    assert_eq!(moved, [false; 4]);
    assert!(error.is_some());
}

#[test]
fn a_classic_node_on_an_fd_bus() {
    let fd = BitTiming { format: FrameSize::Fd, ..BitTiming::default() };
    let job = Job::short(fd);
    let mut buffers = job.buffers();
    let mut scene = Scene::on(&job, &mut buffers, fd);
    let node = scene.drive_node(1);
    scene.bus.controller(node).format = Some(FrameSize::Classic);
    scene.until("an error", |scene| scene.error.is_some());
    scene.assert_never_moves(500);
    assert!(matches!(scene.error, Some(HostError::Silent { .. })), "{:?}", scene.error);
}

#[test]
fn a_drive_that_sends_classic_frames_on_an_fd_bus() {
    let fd = BitTiming { format: FrameSize::Fd, ..BitTiming::default() };
    let mut job = Job::short(fd);
    job.cast.drives[1].frames = FrameSize::Classic;
    let mut buffers = job.buffers();
    let mut scene = Scene::on(&job, &mut buffers, fd);
    scene.until_moving();
    scene.assert_comes_to_rest(1_000);
    scene.assert_played_to_the_end();
    scene.assert_on_path(&job.path());
}

#[test]
fn a_node_has_a_wrong_bit_rate() {
    let job = Job::short(BitTiming::default());
    let mut buffers = job.buffers();
    let mut scene = Scene::new(&job, &mut buffers);
    let node = scene.drive_node(2);
    *scene.bus.controller(node) = Controller::out_of_rate();
    scene.until("an error", |scene| scene.error.is_some());
    scene.assert_never_moves(500);
    assert!(matches!(scene.error, Some(HostError::Silent { axis: 2 })), "{:?}", scene.error);
}

#[test]
fn a_drive_is_cut_off_for_a_while() {
    let job = Job::short(BitTiming::default());
    for (axis, ms) in [(0, 50), (1, 100), (2, 300), (0, 400), (1, 2_000)] {
        let mut buffers = job.buffers();
        let mut scene = Scene::new(&job, &mut buffers);
        scene.until_moving();
        scene.pass(30);
        let (node, now) = (scene.drive_node(axis), scene.fleet.now());
        scene.bus.cut(node, now);
        scene.pass(ms);
        let now = scene.fleet.now();
        scene.bus.join(node, now);
        scene.assert_comes_to_rest(1_000);
        scene.assert_on_path(&job.path());
        scene.assert_no_fault();
    }
}

#[test]
fn foreign_traffic_takes_more_than_nine_tenths_of_the_bus() {
    let job = Job::short(BitTiming::default());
    // Behind the motion's own frames, and in front of them.
    for (ids, plays) in [([0x400, 0x6ff], true), ([0x020, 0x07f], false)] {
        let mut buffers = job.buffers();
        let mut scene = Scene::new(&job, &mut buffers);
        scene.bus.attach_source(Source { until: FOR_EVER, ..Source::foreign(ids, 0.93, 4) });
        scene.assert_comes_to_rest(12_000);
        scene.assert_on_path(&job.path());
        scene.assert_no_fault();
        if plays {
            scene.assert_played_to_the_end();
        }
        let load = host_sim::bus::Bus::traffic(&scene.bus).busy as f64 / scene.fleet.now() as f64;
        assert!(load > 0.9, "{load}");
    }
}
