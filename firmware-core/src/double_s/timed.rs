//! Motions of a given duration between two states, for axes that have to arrive together.
//!
//! Of a given duration T, the displacements that can be reached are an interval: its ends are the motions of the chain
//! and of the reversed chain that take T. Where that interval holds the wanted displacement, the blend of the two
//! motions is one that takes T exactly: both share their end states, and all limits are convex. As T grows the wanted
//! displacement may leave the interval and come back: durations in between are impossible.

use heapless::Vec;

use super::chain::{Chain, Link};
use super::limits::{DoubleSError, MotionLimits, State};
use super::profile::{MOST_SEGMENTS, Profile, Segment};
use super::real::Real;
use super::root;
use super::solve::{self, PARTS, Solution};
use super::task::Task;
use super::{Inside, accept, check, enter};

/// Most segments of a blend: what leads back into the limits, and those of two motions cut at each other's ends.
pub const TIMED_SEGMENTS: usize = MOST_SEGMENTS - PARTS + 2 * PARTS;

/// Most durations at which the wanted displacement enters or leaves what can be reached: three on either chain of two
/// families of motions, the way with a cruise, and where these families begin.
pub const MOST_EDGES: usize = 20;

/// Steps of a bisection: to the last digit from any width.
const HALVINGS: u32 = 160;

/// All motions between two states, by their duration.
#[derive(Clone, Debug)]
pub struct Timed<R> {
    from: State<R>,
    to: State<R>,
    limits: MotionLimits<R>,
    entry: Inside<R>,
    families: [Option<Family<R>>; 2],
}

/// Motions whose durations are one interval.
#[derive(Clone, Copy, Debug)]
struct Family<R> {
    /// That with the largest displacement, of each duration, and that with the smallest, as the reversed task sees it.
    ends: [Arc<R>; 2],
    mirrored: bool,
}

/// A chain up to its end.
#[derive(Clone, Copy, Debug)]
struct Arc<R> {
    chain: Chain<R>,
    range: R,
    /// Beyond its end the motion cruises; without, there is no motion that takes longer.
    cruises: bool,
}

/// A motion of an arc.
#[derive(Clone, Copy, Debug)]
struct Spot<R> {
    link: Link<R>,
    cruise: Option<R>,
    distance: R,
}

impl<R: Real> Timed<R> {
    /// All motions from a state to another.
    ///
    /// # Errors
    /// As [`super::plan`].
    pub fn new(from: &State<R>, to: &State<R>, limits: &MotionLimits<R>) -> Result<Self, DoubleSError> {
        check(from, to, limits)?;
        let entry = enter(from, to, limits)?;
        let (task, mirrored) = solve::upright(&entry.task);
        let mainland = Family {
            ends: [task, task.reversed()].map(|task| {
                let chain = Chain::new(task);
                Arc { chain, range: chain.range(), cruises: true }
            }),
            mirrored,
        };
        let island = solve::island_task(&task).map(|task| Family {
            ends: [task, task.reversed()].map(|task| {
                let chain = Chain::new(task);
                Arc { chain, range: solve::island_range(&chain), cruises: false }
            }),
            mirrored: !mirrored,
        });
        Ok(Self { from: *from, to: *to, limits: *limits, entry, families: [Some(mainland), island] })
    }

    /// Whether there is a motion that takes `duration`.
    pub fn admits(&self, duration: R) -> bool {
        self.pair(duration).is_some()
    }

    /// Durations at which motions begin or cease to be possible, in no order; between two neighbours either all are
    /// possible or none is.
    pub fn edges(&self) -> Vec<R, MOST_EDGES> {
        let mut edges = Vec::new();
        let before = self.entry.profile.duration();
        for arc in self.families.iter().flatten().flat_map(|family| &family.ends) {
            arc.edges(|duration| {
                // There is room for all of them.
                let _ = edges.push(before + duration);
            });
        }
        edges
    }

    /// The motion that takes `duration`; `None` where there is none.
    ///
    /// # Errors
    /// [`DoubleSError::Precision`] where what was found does not arrive within the limits.
    pub fn plan(&self, duration: R) -> Result<Option<Profile<R, TIMED_SEGMENTS>>, DoubleSError> {
        let Some((family, far, near)) = self.pair(duration) else { return Ok(None) };
        let solutions = [family.solution(0, &far), family.solution(1, &near)];
        let [most, least] = solutions.each_ref().map(Solution::distance);
        let wanted = self.entry.task.distance;
        let width = most - least;
        let share = if width.abs() > R::ZERO { (wanted - least) / width } else { R::ONE };
        let share = share.most(R::ZERO).least(R::ONE);
        let mut profile = Profile::<R, TIMED_SEGMENTS>::at_rest(self.from);
        for segment in self.entry.profile.segments() {
            profile.push(*segment);
        }
        let parts = solutions.each_ref().map(Solution::parts);
        let fits = blend(&parts, share, |segment| {
            let start =
                State { position: self.entry.inside.position + segment.start.position, ..segment.start };
            profile.push(Segment { start, ..segment })
        });
        if !fits {
            return Err(DoubleSError::Precision);
        }
        profile.ends_at(self.to);
        // The two motions are laid over each other by their time since the start.
        let clock = R::whole(4) * R::ULP * duration;
        accept::check(&profile, &self.from, self.entry.profile.segments().len(), &self.limits, clock)?;
        Ok(Some(profile))
    }

    /// The motions with the largest and the smallest displacement that take `duration`, if the wanted one is between.
    fn pair(&self, duration: R) -> Option<(&Family<R>, Spot<R>, Spot<R>)> {
        let duration = duration - self.entry.profile.duration();
        self.families.iter().flatten().find_map(|family| {
            let [far, near] = &family.ends;
            let spots = (far.at(duration)?, near.at(duration)?);
            let enough = |arc: &Arc<R>, spot: &Spot<R>| {
                arc.chain.task.distance <= spot.distance + R::EDGE * (spot.link.scale + spot.distance.abs())
            };
            (enough(far, &spots.0) && enough(near, &spots.1)).then_some((family, spots.0, spots.1))
        })
    }
}

impl<R: Real> Family<R> {
    /// A motion of one of its arcs, as the states see it.
    fn solution(&self, end: usize, spot: &Spot<R>) -> Solution<R> {
        let reversed = end == 1;
        let arc = if reversed { &self.ends[1] } else { &self.ends[0] };
        let task = Task { distance: spot.distance, ..arc.chain.task };
        Solution { task, link: spot.link, cruise: spot.cruise, mirrored: self.mirrored, reversed }
    }
}

impl<R: Real> Arc<R> {
    /// The motion that takes `duration`.
    fn at(&self, duration: R) -> Option<Spot<R>> {
        let slack = R::EDGE * duration;
        let spot = |link: Link<R>| Spot { link, cruise: None, distance: link.distance };
        let (first, last) = (self.chain.link(R::ZERO), self.chain.link(self.range));
        if duration <= first.duration() {
            return (duration + slack >= first.duration()).then(|| spot(first));
        }
        let extra = duration - last.duration();
        if extra >= R::ZERO {
            if self.cruises {
                let distance = last.distance + extra * self.chain.task.v_max;
                return Some(Spot { link: last, cruise: Some(extra), distance });
            }
            return (extra <= slack).then(|| spot(last));
        }
        let s = bisect([R::ZERO, self.range], |s| self.chain.link(s).duration() >= duration);
        Some(spot(self.chain.link(s)))
    }

    /// Says at which durations the displacement passes the wanted one, and where the arc begins.
    fn edges(&self, mut say: impl FnMut(R)) {
        let wanted = self.chain.task.distance;
        let distance = |s: R| self.chain.link(s).distance;
        say(self.chain.link(R::ZERO).duration());
        let turns = root::turns(&self.chain, self.range);
        for at in [[R::ZERO, turns[0]], turns, [turns[1], self.range]] {
            let rises = distance(at[1]) >= wanted;
            if at[1] > at[0] && (distance(at[0]) >= wanted) != rises {
                let s = bisect(at, |s| (distance(s) >= wanted) == rises);
                say(self.chain.link(s).duration());
            }
        }
        let last = self.chain.link(self.range);
        let v_max = self.chain.task.v_max;
        if self.cruises && last.distance < wanted && v_max > R::ZERO {
            say(last.duration() + (wanted - last.distance) / v_max);
        } else if !self.cruises {
            say(last.duration());
        }
    }
}

/// Where a condition that fails at the first of two places comes to hold, to the last digit.
fn bisect<R: Real>(mut at: [R; 2], holds: impl Fn(R) -> bool) -> R {
    for _ in 0..HALVINGS {
        let middle = R::HALF * (at[0] + at[1]);
        if !(middle > at[0] && middle < at[1]) {
            break;
        }
        at[usize::from(holds(middle))] = middle;
    }
    at[1]
}

/// Gives out the segments of `share` of the first motion and the rest of the second, as long as `take` takes them.
fn blend<R: Real>(
    parts: &[[Segment<R>; PARTS]; 2],
    share: R,
    mut take: impl FnMut(Segment<R>) -> bool,
) -> bool {
    let rest = R::ONE - share;
    let mut lists = parts.each_ref().map(|parts| parts.iter().filter(|part| part.duration > R::ZERO));
    let mut now = lists.each_mut().map(|list| list.next().map(|part| (*part, R::ZERO)));
    while let [Some((a, done_a)), Some((b, done_b))] = now {
        let (left_a, left_b) = (a.duration - done_a, b.duration - done_b);
        let duration = left_a.least(left_b);
        let (first, second) = (a.at(done_a), b.at(done_b));
        let mix = |a: R, b: R| share * a + rest * b;
        let start = State {
            position: mix(first.position, second.position),
            velocity: mix(first.velocity, second.velocity),
            acceleration: mix(first.acceleration, second.acceleration),
        };
        if duration > R::ZERO && !take(Segment { duration, start, jerk: mix(a.jerk, b.jerk) }) {
            return false;
        }
        now[0] = if left_a > duration {
            Some((a, done_a + duration))
        } else {
            lists[0].next().map(|p| (*p, R::ZERO))
        };
        now[1] = if left_b > duration {
            Some((b, done_b + duration))
        } else {
            lists[1].next().map(|p| (*p, R::ZERO))
        };
    }
    true
}
