//! Hosts that die and drives that will not.

use host_sim::bus::{BitTiming, Bus};
use host_sim::host_node::{HostError, Mismatch, Order};
use planner::feed::messages::frames;
use protocol::bus::{FrameSize, ids};
use protocol::message::{HostMessage, Reject, State};
use protocol::table::TableError;
use tests::fleet::Job;
use tests::scene::Scene;

/// The host dies with everything that it has queued.
fn crash(scene: &mut Scene<'_>) {
    scene.fleet.kill_host();
    let host = scene.host;
    scene.bus.flush(host);
}

fn assert_all_closed(scene: &Scene<'_>) {
    assert!((0..3).all(|axis| !scene.fleet.drive(axis).epoch().1), "an epoch is open");
}

#[test]
fn the_host_crashes_in_the_middle_of_a_block() {
    let job = Job::short(BitTiming::default());
    for frames in (3..90).step_by(7) {
        let mut buffers = job.buffers();
        let mut scene = Scene::new(&job, &mut buffers);
        scene.until("frames", |scene| scene.bus.history(scene.host).sent >= frames);
        crash(&mut scene);
        scene.assert_never_moves(600);
        assert_all_closed(&scene);
        scene.assert_no_fault();
    }
}

#[test]
fn the_host_crashes_between_seal_and_start() {
    let job = Job::short(BitTiming::default());
    let mut buffers = job.buffers();
    let mut scene = Scene::new(&job, &mut buffers);
    scene.until_all(State::Ready);
    crash(&mut scene);
    scene.assert_never_moves(1_000);
    assert_all_closed(&scene);
}

#[test]
fn the_host_crashes_between_arm_and_start() {
    let job = Job::short(BitTiming::default());
    for some in [true, false] {
        let mut buffers = job.buffers();
        let mut scene = Scene::new(&job, &mut buffers);
        let armed = |scene: &Scene<'_>| scene.statuses().iter().filter(|s| s.state == State::Armed).count();
        scene.until("arming", |scene| if some { armed(scene) > 0 } else { armed(scene) == 3 });
        crash(&mut scene);
        scene.assert_comes_to_rest(1_200);
        scene.assert_on_path(&job.path());
        scene.assert_no_fault();
        assert_all_closed(&scene);
        let all = scene.moved.iter().filter(|moved| **moved).count();
        assert!(all == 0 || all == 3, "{:?}", scene.moved);
    }
}

#[test]
fn the_host_crashes_at_the_start() {
    let job = Job::short(BitTiming::default());
    let mut buffers = job.buffers();
    let mut scene = Scene::new(&job, &mut buffers);
    scene.until_moving();
    crash(&mut scene);
    scene.assert_comes_to_rest(1_200);
    scene.assert_on_path(&job.path());
    scene.assert_no_fault();
    assert_all_closed(&scene);
    assert!(scene.statuses().iter().all(|status| status.state == State::Held), "{:?}", scene.statuses());
}

#[test]
fn one_axis_rejects() {
    let mut job = Job::short(BitTiming::default());
    // The checksum is right, the declared limits are not kept.
    job.cast.orders[0].packed.header.warp = None;
    job.cast.orders[0].packed.axes[1].header.limits.acceleration *= 0.05;
    let mut buffers = job.buffers();
    let mut scene = Scene::new(&job, &mut buffers);
    scene.until("an error", |scene| scene.error.is_some());
    scene.assert_never_moves(800);
    let reason = match scene.error {
        Some(HostError::Rejected { axis: 1, reason, .. }) => reason,
        other => panic!("{other:?}"),
    };
    assert!(matches!(reason, Reject::Table(TableError::Limit { .. })), "{reason:?}");
}

#[test]
fn a_table_with_a_right_checksum_breaks_its_limits() {
    for which in 0..3 {
        let mut job = Job::short(BitTiming::default());
        job.cast.orders[0].packed.header.warp = None;
        for axis in &mut job.cast.orders[0].packed.axes {
            let limits = &mut axis.header.limits;
            match which {
                0 => limits.velocity *= 0.05,
                1 => limits.acceleration *= 0.05,
                _ => limits.jerk = limits.jerk.map(|jerk| 0.05 * jerk),
            }
        }
        let mut buffers = job.buffers();
        let mut scene = Scene::new(&job, &mut buffers);
        scene.until("an error", |scene| scene.error.is_some());
        scene.assert_never_moves(800);
        let refused = |reason: Reject| matches!(reason, Reject::Table(TableError::Limit { .. }));
        assert!(
            matches!(scene.error, Some(HostError::Rejected { reason, .. }) if refused(reason)),
            "{:?}",
            scene.error
        );
    }
}

/// It stands elsewhere than the table begins: what the others have armed already must not begin.
#[test]
fn one_axis_never_arms() {
    let mut job = Job::short(BitTiming::default());
    job.cast.drives[1].axis.position += 1_000;
    let mut buffers = job.buffers();
    let mut scene = Scene::new(&job, &mut buffers);
    scene.until("an error", |scene| scene.error.is_some());
    scene.assert_never_moves(1_500);
    assert!(
        matches!(scene.error, Some(HostError::Rejected { axis: 1, reason: Reject::Position { .. }, .. })),
        "{:?}",
        scene.error
    );
    assert_all_closed(&scene);
}

#[test]
fn a_drive_resets_in_motion() {
    let job = Job::short(BitTiming::default());
    for axis in 0..3 {
        let (mut buffers, mut spare) = (job.buffers(), job.buffers());
        let mut scene = Scene::new(&job, &mut buffers);
        scene.until_moving();
        scene.pass(20);
        let mut config = job.cast.drives[axis];
        config.watch.boot += 100;
        config.axis.position = scene.statuses()[axis].position;
        scene.fleet.restart(axis, &config, &mut spare[0]);
        let stood = config.axis.position;
        scene.assert_comes_to_rest(1_000);
        scene.assert_no_fault();
        assert_eq!(scene.statuses()[axis].position, stood, "the drive that has started up moves");
        assert!(matches!(scene.error, Some(HostError::Stopped { .. })), "{:?}", scene.error);
        let others = (0..3).filter(|other| *other != axis);
        let states: Vec<_> = others.map(|other| scene.statuses()[other]).collect();
        assert!(states.iter().all(|status| status.state == State::Held), "{axis}: {states:?}");
    }
}

/// A new host while the motion of the old one goes on: it is refused until that has come to rest, and moves nothing.
#[test]
fn a_host_restarts_in_motion() {
    let job = Job::short(BitTiming::default());
    let mut buffers = job.buffers();
    let mut scene = Scene::new(&job, &mut buffers);
    scene.until_moving();
    scene.pass(20);
    crash(&mut scene);
    scene.new_host();
    scene.assert_comes_to_rest(2_500);
    scene.assert_on_path(&job.path());
    scene.assert_no_fault();
    let refused = matches!(
        scene.error,
        Some(
            HostError::Rejected { reason: Reject::Position { .. }, .. }
                | HostError::Mismatch { mismatch: Mismatch::InUse, .. }
        )
    );
    assert!(refused, "{:?}", scene.error);
}

#[test]
fn a_host_restarts_with_an_old_session_before_the_motion() {
    let job = Job::short(BitTiming::default());
    for ms in [60, 150, 300] {
        let mut buffers = job.buffers();
        let mut scene = Scene::new(&job, &mut buffers);
        scene.pass(ms);
        crash(&mut scene);
        let old = scene.words_of_the_host();
        scene.new_host();
        scene.pass(100);
        // What the old one has said comes again between the words of the new one.
        old.into_iter().for_each(|frame| scene.say(frame));
        scene.until_moving();
        scene.assert_comes_to_rest(1_500);
        scene.assert_played_to_the_end();
        scene.assert_on_path(&job.path());
    }
}

#[test]
fn motions_do_not_join() {
    let mut job = Job::short(BitTiming::default());
    let mut packed = job.cast.orders[0].packed.clone();
    packed.header.table = 1;
    packed.axes.iter_mut().for_each(|axis| axis.header.table = 1);
    job.cast.orders.push(Order { packed, pause: 0 });
    let mut buffers = job.buffers();
    let mut scene = Scene::new(&job, &mut buffers);
    scene.until_moving();
    scene.assert_comes_to_rest(2_500);
    scene.assert_played_to_the_end();
    scene.assert_on_path(&job.path());
    scene.assert_no_fault();
    assert!(
        matches!(scene.error, Some(HostError::Rejected { table: 1, reason: Reject::Position { .. }, .. })),
        "{:?}",
        scene.error
    );
}

#[test]
fn memory_is_full() {
    let mut job = Job::short(BitTiming::default());
    job.cast.buffer_bytes /= 2;
    let mut buffers = job.buffers();
    let mut scene = Scene::new(&job, &mut buffers);
    scene.until("an error", |scene| scene.error.is_some());
    scene.assert_never_moves(600);
    let full = matches!(scene.error, Some(HostError::Mismatch { mismatch: Mismatch::Room { .. }, .. }));
    assert!(full, "{:?}", scene.error);
}

#[test]
fn starts_are_replayed() {
    let job = Job::short(BitTiming::default());
    let mut buffers = job.buffers();
    let mut scene = Scene::new(&job, &mut buffers);
    scene.until_moving();
    let (epoch, now) = (scene.fleet.drive(0).epoch().0, scene.statuses()[0].tick);
    // In motion, to the tick of the start and to others.
    for tick in [now - 1, now, now + 1, now + 50, now + 10_000, 0] {
        let start = HostMessage::Start { table: 0, tick };
        frames(ids::BROADCAST, FrameSize::Classic, epoch, &start)
            .into_iter()
            .for_each(|frame| scene.say(frame));
        scene.pass(10);
    }
    scene.assert_comes_to_rest(1_200);
    scene.assert_played_to_the_end();
    // When it is over, with everything that led to it.
    for frame in scene.words_of_the_host() {
        scene.say(frame);
    }
    scene.assert_comes_to_rest(1_200);
    scene.assert_played_to_the_end();
    scene.assert_on_path(&job.path());
    // And when the host has gone.
    crash(&mut scene);
    scene.pass(400);
    for frame in scene.words_of_the_host() {
        scene.say(frame);
    }
    scene.assert_comes_to_rest(1_200);
    scene.assert_played_to_the_end();
    assert!(scene.bus.traffic().frames > 1_000);
}

/// What follows is called off, which ends the epoch: what plays goes on to its end, but not without one of the drives.
#[test]
fn a_drive_is_lost_after_the_host_has_called_off_what_follows() {
    let job = Job::short(BitTiming::default());
    for lost in [false, true] {
        let mut buffers = job.buffers();
        let mut scene = Scene::new(&job, &mut buffers);
        scene.until_moving();
        crash(&mut scene);
        let epoch = scene.fleet.drive(0).epoch().0;
        let words = frames(ids::BROADCAST, FrameSize::Classic, epoch, &HostMessage::Stop);
        words.into_iter().for_each(|frame| scene.say(frame));
        scene.pass(10);
        assert_all_closed(&scene);
        let (node, now) = (scene.drive_node(1), scene.fleet.now());
        if lost {
            scene.bus.cut(node, now);
        }
        scene.assert_comes_to_rest(1_000);
        scene.assert_on_path(&job.path());
        scene.assert_no_fault();
        if lost {
            assert!(
                scene.statuses().iter().all(|status| status.state == State::Held),
                "{:?}",
                scene.statuses()
            );
        } else {
            scene.assert_played_to_the_end();
        }
    }
}
