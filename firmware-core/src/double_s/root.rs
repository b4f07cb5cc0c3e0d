//! Which motion of a chain gets exactly as far as wanted.

use super::chain::{Chain, Link};
use super::real::Real;

/// Where the wanted distance lies on a chain.
pub(super) enum Place<R> {
    /// Before its first motion, this one: the chain of the reversed motion leads there.
    Before(Link<R>),
    /// At this motion.
    At(Link<R>),
    /// Beyond its last motion, this one.
    Beyond(Link<R>),
}

/// The first motion within `range` of the chain's first that covers the task's distance.
pub(super) fn find<R: Real>(chain: &Chain<R>, range: R) -> Place<R> {
    let wanted = chain.task.distance;
    let first = chain.link(R::ZERO);
    // On one side of the first motion there may be a gap: rounding must not decide on which side of it the target is.
    if nearly(&first, wanted) {
        return Place::At(first);
    }
    if wanted < first.distance {
        return Place::Before(first);
    }
    // The distance rises, may fall where the acceleration never returns to zero, and rises again.
    if let Some(top) = summit(chain).filter(|top| *top > R::ZERO && *top < range) {
        let highest = chain.link(top);
        if wanted <= highest.distance {
            return Place::At(within(chain, [R::ZERO, top], [first, highest]));
        }
        return last(chain, [top, range], highest);
    }
    last(chain, [R::ZERO, range], first)
}

/// The motion on the last stretch of a chain.
fn last<R: Real>(chain: &Chain<R>, at: [R; 2], first: Link<R>) -> Place<R> {
    let wanted = chain.task.distance;
    let last = chain.link(at[1]);
    if last.distance >= wanted {
        Place::At(within(chain, at, [first, last]))
    } else if nearly(&last, wanted) {
        Place::At(last)
    } else {
        Place::Beyond(last)
    }
}

/// Whether a motion gets so far but for rounding.
fn reached<R: Real>(link: &Link<R>, wanted: R) -> bool {
    (link.distance - wanted).abs() <= tolerance(link, wanted)
}

/// Whether the first or last motion of a chain will do.
fn nearly<R: Real>(link: &Link<R>, wanted: R) -> bool {
    (link.distance - wanted).abs() <= R::EDGE * link.scale + tolerance(link, wanted)
}

/// What a motion misses, relative to its path.
fn miss<R: Real>(link: &Link<R>, wanted: R) -> R {
    (link.distance - wanted).abs() / (link.scale + wanted.abs())
}

fn tolerance<R: Real>(link: &Link<R>, wanted: R) -> R {
    R::whole(8) * R::ULP * (link.scale + wanted.abs())
}

/// The first extremum is held at its limit beyond this y = -z.
fn joint<R: Real>(chain: &Chain<R>) -> R {
    (chain.task.a_up * chain.task.a_up - chain.c).root()
}

/// Where the pace is lowest, as y = -z.
fn lowest_y<R: Real>(chain: &Chain<R>) -> R {
    let (t, two, joint) = (&chain.task, R::whole(2), joint(chain));
    let r = t.j_down / t.j_up;
    let rho = R::ONE + r + (r * r + two * r).sqrt();
    let (held, free) = (t.a_up / (two * (R::ONE + r)), (chain.c / (rho * rho - R::ONE)).root());
    if held > joint { held } else { free.least(joint) }
}

/// How far from the first motion the distance stops rising for the first time; `None` where it never does.
///
/// The pace falls only while z < 0. With y = -z its lowest point and, left of it, its root are in closed form, with
/// the first extremum held at its limit or not.
fn summit<R: Real>(chain: &Chain<R>) -> Option<R> {
    let t = &chain.task;
    if t.a1 <= R::ZERO || chain.pace(-t.a1) <= R::ZERO {
        return None;
    }
    let (two, quarter) = (R::whole(2), R::HALF * R::HALF);
    let Chain { c, w, k, .. } = *chain;
    let joint = joint(chain);
    let lowest = lowest_y(chain).least(t.a1);
    if chain.pace(-lowest) >= R::ZERO {
        return None;
    }
    // Between the lowest point and a1 the pace has one root.
    let root = if t.a1 > joint && chain.pace(-joint.most(lowest)) <= R::ZERO {
        // k y^2 - a_up y / (2 j_down) + w = 0, the larger root.
        let b = quarter * t.a_up / t.j_down;
        (b + (b * b - k * w).root()) / k
    } else {
        // (k^2 - 1/(4 j^2)) u^2 + (2 k w - c/(4 j^2)) u + w^2 = 0 with u = y^2, the larger root.
        let q = quarter / (t.j_down * t.j_down);
        let (a, b) = (k * k - q, R::HALF * (two * k * w - c * q));
        ((-b + (b * b - a * w * w).root()) / a).root()
    };
    Some(t.a1 - root.most(lowest).least(t.a1))
}

/// Where the distance stops rising and where it rises again, within `range` of the first motion; both at the first where
/// it never falls.
#[cfg(feature = "host")]
pub(super) fn turns<R: Real>(chain: &Chain<R>, range: R) -> [R; 2] {
    let begin = chain.begin();
    let rises = |s: R| chain.pace(begin + s) >= R::ZERO;
    let top = if chain.pace(begin) > R::ZERO {
        match summit(chain) {
            Some(top) if top < range => top.most(R::ZERO),
            _ => return [R::ZERO; 2],
        }
    } else {
        R::ZERO
    };
    // From there on the pace falls before it rises: it is lowest within z < 0, and has one root beyond.
    let (mut low, mut high) = (top.most(lowest(chain)).least(range), range);
    if !rises(high) {
        return [top, range];
    }
    for _ in 0..4 * R::MOST_STEPS {
        let middle = R::HALF * (low + high);
        if !(middle > low && middle < high) {
            break;
        }
        if rises(middle) { high = middle } else { low = middle }
    }
    [top, high]
}

/// How far from the first motion the pace is lowest.
#[cfg(feature = "host")]
fn lowest<R: Real>(chain: &Chain<R>) -> R {
    (chain.task.a1 - lowest_y(chain)).most(R::ZERO)
}

/// The motion between two of the chain that lie on either side of the wanted distance, the distance rising between.
fn within<R: Real>(chain: &Chain<R>, mut at: [R; 2], mut links: [Link<R>; 2]) -> Link<R> {
    let wanted = chain.task.distance;
    let t = &chain.task;
    let joint = joint(chain);
    // Where a hold begins or ends the curve changes its formula; near its start it is told by the distance from there,
    // further on by z.
    let begin = chain.begin();
    let away = if begin < R::ZERO { -R::HALF * begin } else { begin };
    for kink in [away, -joint - begin, joint - begin, t.a_down - begin] {
        if kink > at[0] && kink < at[1] {
            let link = chain.link(kink);
            let side = usize::from(link.distance >= wanted);
            (at[side], links[side]) = (kink, link);
        }
    }
    for link in &links {
        if reached(link, wanted) {
            return *link;
        }
    }
    let low = begin + at[0];
    if low >= t.a_down && chain.c + low * low >= t.a_up * t.a_up {
        return chain.link(held(chain, at[0], wanted - links[0].distance));
    }
    if at[0] < away {
        search(|s| chain.link(s), at, links, wanted)
    } else {
        search(|z| chain.link_at(z), at.map(|s| begin + s), links, wanted)
    }
}

/// With both accelerations held the distance is quadratic in w = k (z^2 - z0^2).
fn held<R: Real>(chain: &Chain<R>, from: R, rest: R) -> R {
    let t = &chain.task;
    let z = chain.begin() + from;
    let pace = chain.pace(z);
    let q = rest / (R::ONE / t.a_up + R::ONE / t.a_down);
    let root = (pace * pace + R::whole(2) * q).root();
    // The positive root, without a difference of like numbers.
    let w = if pace > R::ZERO { R::whole(2) * q / (pace + root) } else { root - pace };
    from + w / (chain.k * (z + (z * z + w / chain.k).root()))
}

/// Newton's method from a cubic model of the curve, kept inside a bracket that halves at least every other step.
fn search<R: Real>(curve: impl Fn(R) -> Link<R>, mut at: [R; 2], links: [Link<R>; 2], wanted: R) -> Link<R> {
    let mut before = links[0].distance - wanted;
    let mut best = links[usize::from(miss(&links[1], wanted) < miss(&links[0], wanted))];
    let mut s = model(at, &links, wanted);
    for _ in 0..R::MOST_STEPS {
        if !(s > at[0] && s < at[1]) {
            s = R::HALF * (at[0] + at[1]);
            if !(s > at[0] && s < at[1]) {
                break;
            }
        }
        let link = curve(s);
        let rest = link.distance - wanted;
        if miss(&link, wanted) < miss(&best, wanted) {
            best = link;
        }
        if miss(&link, wanted) <= R::whole(2) * R::ULP {
            break;
        }
        let width = at[1] - at[0];
        at[usize::from(rest >= R::ZERO)] = s;
        let newton = s - rest / link.slope;
        // A step that does not halve what is left is replaced by a bisection.
        let slow = rest.abs() > R::HALF * before.abs() && at[1] - at[0] > R::HALF * width;
        before = rest;
        s = if slow || !newton.is_finite() { R::HALF * (at[0] + at[1]) } else { newton };
    }
    best
}

/// Root of a s + b s^3, which has the slope of the curve at one end and its value at the other.
fn model<R: Real>(at: [R; 2], links: &[Link<R>; 2], wanted: R) -> R {
    let width = at[1] - at[0];
    let rest = wanted - links[0].distance;
    let a = links[0].slope.most(R::ZERO);
    let b = ((links[1].distance - links[0].distance) / width - a) / (width * width);
    if b <= R::ZERO {
        return at[0] + rest / a;
    }
    let mut s = (rest / b).cube_root_estimate();
    if a > R::ZERO {
        s = s.least(rest / a);
    }
    for _ in 0..3 {
        s = (rest + R::whole(2) * b * s * s * s) / (a + R::whole(3) * b * s * s);
    }
    at[0] + s
}
