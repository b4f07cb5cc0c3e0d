//! The fastest motion of a task: which chain it is on, and where.

use super::chain::{Chain, Link};
use super::limits::State;
use super::profile::Segment;
use super::real::Real;
use super::root::{self, Place};
use super::task::Task;

/// Parts of a motion: up, hold, down, cruise, down, hold, up.
pub(super) const PARTS: usize = 7;

/// A motion of a chain, and how the chain looks at the task.
#[derive(Clone, Copy, Debug)]
pub(super) struct Solution<R> {
    pub(super) task: Task<R>,
    pub(super) link: Link<R>,
    pub(super) cruise: Option<R>,
    pub(super) mirrored: bool,
    pub(super) reversed: bool,
}

/// The fastest motion that covers the task's distance. Start and target are within their limits.
pub(super) fn fastest<R: Real>(task: &Task<R>) -> Solution<R> {
    let (upright, mirrored) = upright(task);
    if let Some(solution) = island(&upright, mirrored) {
        return solution;
    }
    let (task, reversed, place) = directed(upright, Chain::range);
    let (link, cruise) = match place {
        Place::Before(link) | Place::At(link) => (link, None),
        Place::Beyond(link) => (link, Some((task.distance - link.distance) / task.v_max)),
    };
    Solution { task, link, cruise, mirrored, reversed }
}

/// The fastest change of velocity, wherever it ends.
pub(super) fn quickest<R: Real>(task: &Task<R>) -> Solution<R> {
    let (upright, mirrored) = upright(task);
    let link = Chain::new(upright).link(R::ZERO);
    let task = Task { distance: link.distance, ..upright };
    Solution { task, link, cruise: None, mirrored, reversed: false }
}

/// The task seen so that the velocity left without accelerations rises, and whether in a mirror.
pub(super) fn upright<R: Real>(task: &Task<R>) -> (Task<R>, bool) {
    let mirrored = task.start_velocity() < task.stop_velocity();
    (if mirrored { task.mirrored() } else { *task }, mirrored)
}

/// Where the distance lies on the chain, or on that of the reversed motion if it comes before the first; the task as that
/// chain sees it, and whether it is reversed. `range` says how far a chain goes.
fn directed<R: Real>(task: Task<R>, range: impl Fn(&Chain<R>) -> R) -> (Task<R>, bool, Place<R>) {
    let found = |task: Task<R>| {
        let chain = Chain::new(task);
        root::find(&chain, range(&chain))
    };
    match found(task) {
        Place::Before(_) => (task.reversed(), true, found(task.reversed())),
        place => (task, false, place),
    }
}

/// A motion on which the acceleration never returns to zero, if there is one: it is faster than all others.
fn island<R: Real>(upright: &Task<R>, mirrored: bool) -> Option<Solution<R>> {
    match directed(island_task(upright)?, island_range) {
        (task, reversed, Place::At(link)) => {
            Some(Solution { task, link, cruise: None, mirrored: !mirrored, reversed })
        }
        (_, _, Place::Before(_) | Place::Beyond(_)) => None,
    }
}

/// The task seen so that its chain is one of motions on which the acceleration never returns to zero: where both
/// accelerations point against the change of velocity that is left without them, such motions may exist, apart from
/// all others.
pub(super) fn island_task<R: Real>(upright: &Task<R>) -> Option<Task<R>> {
    if !(upright.a0 < R::ZERO && upright.a1 < R::ZERO) {
        return None;
    }
    let task = upright.mirrored();
    let difference = R::HALF * (task.a1 - task.a0) * (task.a1 + task.a0);
    let least = if difference > R::ZERO { difference / task.j_up } else { -difference / task.j_down };
    let gained = task.k() * (task.a0 * task.a0 + task.a1 * task.a1);
    let rounding = R::whole(8) * R::ULP * task.v0.abs().most(task.v1.abs()).most(gained);
    (task.v1 - task.v0 >= least - rounding).then_some(task)
}

/// How far the chain of such a task goes: to where the first extremum is the start itself.
pub(super) fn island_range<R: Real>(chain: &Chain<R>) -> R {
    let start = chain.task.a0 * chain.task.a0 - chain.c;
    (-start.root() - chain.begin()).most(R::ZERO)
}

impl<R: Real> Solution<R> {
    /// How far it gets.
    pub(super) fn distance(&self) -> R {
        let turned = self.mirrored != self.reversed;
        if turned { -self.task.distance } else { self.task.distance }
    }

    /// Its parts, from position 0 on, in order; some may take no time.
    #[inline(never)]
    pub(super) fn parts(&self) -> [Segment<R>; PARTS] {
        let (times, jerks) = self.schedule();
        let knots = self.knots(&times);
        core::array::from_fn(|i| {
            let index = if self.reversed { PARTS - 1 - i } else { i };
            let at = if self.reversed { index + 1 } else { index };
            let get = |values: &[R]| values.get(index).copied().unwrap_or(R::ZERO);
            let start = knots.get(at).copied().unwrap_or(knots[0]);
            let (duration, jerk) = (get(&times), get(&jerks));
            self.original(Segment { duration, start, jerk })
        })
    }

    fn schedule(&self) -> ([R; PARTS], [R; PARTS]) {
        let Task { j_up, j_down, .. } = self.task;
        let [up, hold, down, held, last] = self.link.times;
        let (to_peak, cruise, from_peak) = match self.cruise {
            Some(cruise) => (self.link.x / j_down, cruise, self.link.z / j_down),
            None => (down, R::ZERO, R::ZERO),
        };
        (
            [up, hold, to_peak, cruise, from_peak, held, last],
            [j_up, R::ZERO, -j_down, R::ZERO, -j_down, R::ZERO, j_up],
        )
    }

    /// States between the parts as the chain sees them: forwards from the start up to the peak, backwards from the
    /// target down to it.
    fn knots(&self, times: &[R; PARTS]) -> [State<R>; PARTS + 1] {
        let Task { distance, v0, a0, v1, a1, v_max, j_up, j_down, .. } = self.task;
        let Link { x, z: low, .. } = self.link;
        let [up, hold, to_peak, _, from_peak, held, last] = *times;
        let start = State { position: R::ZERO, velocity: v0, acceleration: a0 };
        let after = |start: State<R>, duration: R, jerk: R, acceleration: R| State {
            acceleration,
            ..Segment { duration, start, jerk }.end()
        };
        let first = after(start, up, j_up, x);
        let second = after(first, hold, R::ZERO, x);
        let target = State { position: distance, velocity: v1, acceleration: a1 };
        let before =
            |end: State<R>, duration: R, jerk: R, acceleration: R| after(end, -duration, jerk, acceleration);
        let sixth = before(target, last, j_up, -low);
        let fifth = before(sixth, held, R::ZERO, -low);
        let (third, fourth) = match self.cruise {
            Some(_) => {
                let third = after(second, to_peak, -j_down, R::ZERO);
                let fourth = before(fifth, from_peak, -j_down, R::ZERO);
                (State { velocity: v_max, ..third }, State { velocity: v_max, ..fourth })
            }
            None => (fifth, fifth),
        };
        [start, first, second, third, fourth, fifth, sixth, target]
    }

    /// A part of the chain as the task sees it.
    fn original(&self, part: Segment<R>) -> Segment<R> {
        let Segment { duration, start: State { position, velocity, acceleration }, jerk } = part;
        let (position, velocity, jerk) = if self.reversed {
            (position - self.task.distance, -velocity, -jerk)
        } else {
            (position, velocity, jerk)
        };
        if self.mirrored {
            let start = State { position: -position, velocity: -velocity, acceleration: -acceleration };
            Segment { duration, start, jerk: -jerk }
        } else {
            Segment { duration, start: State { position, velocity, acceleration }, jerk }
        }
    }
}
