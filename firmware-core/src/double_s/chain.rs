//! The fastest motions of one direction, as a curve of one parameter.
//!
//! Of all motions that take a given time, the one that gets furthest has the jerks + 0 - [cruise] - 0 + : its costate is
//! quadratic in time. All of these motions between two velocities and accelerations form a chain, ordered by the
//! second extremum of acceleration, -z: from z = -a1, without a third phase, up to where the peak velocity meets its
//! limit, and on with a cruise.

use super::real::Real;
use super::task::Task;

/// The chain of a task.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chain<R> {
    pub(super) task: Task<R>,
    /// x^2 = c + z^2, x the first extremum of acceleration.
    pub(super) c: R,
    /// Velocity at the peak is w + k z^2.
    pub(super) w: R,
    pub(super) k: R,
}

/// One motion of a chain.
#[derive(Clone, Copy, Debug)]
pub(super) struct Link<R> {
    /// First and second extremum of acceleration, the second with its sign changed, both within their limits.
    pub(super) x: R,
    pub(super) z: R,
    /// Durations: up, hold, down, hold, up.
    pub(super) times: [R; 5],
    /// How far it gets, and a bound on what it travels forwards and backwards.
    pub(super) distance: R,
    pub(super) scale: R,
    /// How the distance grows with z.
    pub(super) slope: R,
}

impl<R: Real> Link<R> {
    /// How long it takes.
    #[cfg(feature = "host")]
    pub(super) fn duration(&self) -> R {
        let [up, hold, down, held, last] = self.times;
        up + hold + down + held + last
    }
}

impl<R: Real> Chain<R> {
    pub(super) fn new(task: Task<R>) -> Self {
        let k = task.k();
        let gain = task.v1 - task.v0 + (task.a0 - task.a1) * (task.a0 + task.a1) * R::HALF / task.j_up;
        Self { task, c: gain / k, w: task.v1 - R::HALF * task.a1 * task.a1 / task.j_up, k }
    }

    /// Where z starts.
    pub(super) fn begin(&self) -> R {
        -self.task.a1
    }

    /// How far z gets: to where the peak velocity meets its limit.
    pub(super) fn range(&self) -> R {
        (((self.task.v_max - self.w) / self.k).root() - self.begin()).most(R::ZERO)
    }

    /// Change of the distance with the time taken: the velocity at the start of the third part and what it gains.
    pub(super) fn pace(&self, z: R) -> R {
        let x = (self.c + z * z).root().least(self.task.a_up);
        self.w + self.k * z * z + R::HALF * x * z.least(self.task.a_down) / self.task.j_down
    }

    /// The motion `s` after the first: z = -a1 + s. Near the first one, where x may all but vanish, x^2 then changes by as
    /// little as s can.
    pub(super) fn link(&self, s: R) -> Link<R> {
        let begin = self.begin();
        self.link_of(begin + s, (self.c + begin * begin) + s * (begin + begin + s))
    }

    /// The motion at `z`; for z that may all but vanish.
    pub(super) fn link_at(&self, z: R) -> Link<R> {
        self.link_of(z, self.c + z * z)
    }

    #[inline(never)]
    fn link_of(&self, z: R, square: R) -> Link<R> {
        let Task { v0, a0, v1, a1, a_up, a_down, j_up, j_down, .. } = self.task;
        let free = square.root();
        let (mut x, mut hold_up) = (free, R::ZERO);
        if free > a_up {
            (x, hold_up) = (a_up, self.k * (square - a_up * a_up) / a_up);
        }
        let (mut low, mut hold_down) = (z, R::ZERO);
        if z > a_down {
            (low, hold_down) = (a_down, self.k * (z * z - a_down * a_down) / a_down);
        }
        // Rounding goes into the velocity: accelerations meet exactly, and no part takes less than no time.
        let x = x.most(a0).most(-low);
        let low = low.most(-a1);
        let times = [(x - a0) / j_up, hold_up, (x + low) / j_down, hold_down, (a1 + low) / j_up];
        let [up, hold, down, held, last] = times;
        let (two, six) = (R::whole(2), R::whole(6));
        // Forwards from the start.
        let first = up * (v0 + up * (two * a0 + x) / six);
        let v_hold = v0 + R::HALF * (a0 + x) * up;
        let second = hold * (v_hold + R::HALF * x * hold);
        let v_down = v_hold + x * hold;
        let third = down * (v_down + down * (two * x - low) / six);
        // Backwards from the end.
        let v_last = v1 - R::HALF * (a1 - low) * last;
        let fifth = last * (v_last + last * (a1 - two * low) / six);
        let v_held = v_last + low * held;
        let fourth = held * (v_held - R::HALF * low * held);
        let distance = first + second + third + (fourth + fifth);
        // Parts may turn back within themselves: what they travel, not where they end, is what rounding is relative to.
        let travel = |time: R, from: R, to: R| time * from.abs().most(to.abs());
        let scale = travel(up, v0, v_hold)
            + travel(hold, v_hold, v_down)
            + travel(down, v_down, v_held)
            + travel(held, v_held, v_last)
            + travel(last, v_last, v1);
        // dT/dz = 2 k (z/x + z/low); the latter is 1 without a hold.
        let ratio = |a: R, b: R| if b > R::ZERO { a / b } else { R::ZERO };
        let growth = ratio(z, x) + if hold_down > R::ZERO { ratio(z, low) } else { R::ONE };
        let slope = self.pace(z) * R::whole(2) * self.k * growth;
        Link { x, z: low, times, distance, scale, slope }
    }
}
