//! The fastest motion under velocity and acceleration limits alone, by brute force: two passes in the phase plane
//! over many stations (Bobrow, Dubowsky & Gibson 1985; Pham & Pham 2018, with the limits at the stations).

use planner::geometry::grid_path::GridPath;
use planner::geometry::section::{FeedCap, SpeedCap};
use planner::job::machine::AxisLimits;

use super::spline::{Basis, combine};

/// One station: largest q by itself, and per axis p', p'' and the acceleration limit.
struct Station {
    u: f64,
    most: f64,
    axes: Vec<[f64; 3]>,
}

/// Time of the swept motion [s] with so many stations per geometry span; first-order accurate in their distance.
pub fn swept_time(path: &GridPath, limits: &[AxisLimits], caps: &[FeedCap], per_span: usize) -> f64 {
    let stations = stations(path, limits, caps, per_span);
    let n = stations.len();
    let mut q: Vec<f64> = stations.iter().map(|s| s.most).collect();
    (q[0], q[n - 1]) = (0.0, 0.0);
    for k in (0..n - 1).rev() {
        let step = 2.0 * (stations[k + 1].u - stations[k].u);
        // The largest q from which the next station can be reached no faster than it allows.
        q[k] = stations[k].axes.iter().fold(q[k], |most, &[p1, p2, a]| {
            // Lowest w: (|p1| w + sign p2 q) >= -a; then q + step w <= q[k + 1].
            let (gain, bend) = (p1.abs(), p2 * p1.signum());
            let (room, cost) = (gain * q[k + 1] + step * a, gain - step * bend);
            if cost > 0.0 { most.min(room / cost) } else { most }
        });
    }
    for k in 0..n - 1 {
        let step = 2.0 * (stations[k + 1].u - stations[k].u);
        let quickest = stations[k].axes.iter().filter(|[p1, ..]| *p1 != 0.0).map(|&[p1, p2, a]| {
            let (gain, bend) = (p1.abs(), p2 * p1.signum());
            (a - bend * q[k]) / gain
        });
        let reach = q[k] + step * quickest.fold(f64::INFINITY, f64::min);
        q[k + 1] = q[k + 1].min(reach.max(0.0));
    }
    let pairs = stations.windows(2).zip(q.windows(2));
    pairs.map(|(s, q)| 2.0 * (s[1].u - s[0].u) / (q[0].sqrt() + q[1].sqrt())).sum()
}

fn stations(path: &GridPath, limits: &[AxisLimits], caps: &[FeedCap], per_span: usize) -> Vec<Station> {
    let breaks: Vec<f64> = path.breaks.iter().map(|&b| b as f64 * path.step).collect();
    let basis = Basis::clamped(3, &breaks);
    let relative = |a: usize| -> Vec<f64> {
        let axis = &path.axes[a];
        axis.controls.iter().map(|&c| (c - axis.controls[0]) as f64 * axis.lsb).collect()
    };
    let controls: Vec<Vec<f64>> = (0..path.axes.len()).map(relative).collect();
    let mut all = Vec::new();
    for span in 0..path.spans() {
        let (from, to) = (breaks[span], breaks[span + 1]);
        let last = usize::from(span + 1 == path.spans());
        for k in 0..per_span + last {
            // Closer together towards the ends, where q starts as its square root does.
            let t = 0.5 - 0.5 * (std::f64::consts::PI * k as f64 / per_span as f64).cos();
            let u = from + (to - from) * t;
            let weights = [1, 2].map(|d| basis.weights(span, u, d));
            let derivative = |c: &Vec<f64>| [combine(c, span, &weights[0]), combine(c, span, &weights[1])];
            let axes: Vec<[f64; 3]> = controls
                .iter()
                .zip(limits)
                .map(|(c, l)| {
                    let [p1, p2] = derivative(c);
                    [p1, p2, l.acceleration]
                })
                .collect();
            all.push(Station { u, most: most(&axes, limits, cap_at(caps, u / path.step)), axes });
        }
    }
    all
}

/// The looser of the caps on both sides of a place [grid steps].
fn cap_at(caps: &[FeedCap], place: f64) -> Vec<SpeedCap> {
    let k = caps.partition_point(|c| (c.until as f64) < place - 0.5);
    let next = caps.partition_point(|c| (c.until as f64) < place + 0.5);
    caps.iter().skip(k).take(next.saturating_sub(k) + 1).map(|c| c.speed).collect()
}

/// Largest q that some path acceleration goes with. Axes that stand still give 0/0, which `min` passes over.
fn most(axes: &[[f64; 3]], limits: &[AxisLimits], caps: Vec<SpeedCap>) -> f64 {
    let mut most =
        axes.iter().zip(limits).map(|(p, l)| (l.velocity / p[0]).powi(2)).fold(f64::INFINITY, f64::min);
    for (i, &[a1, a2, a]) in axes.iter().enumerate() {
        if a1 == 0.0 {
            most = most.min(a / a2.abs());
        }
        for &[b1, b2, b] in &axes[i + 1..] {
            // Two strips of w at q no longer meet.
            most = most.min((a * b1.abs() + b * a1.abs()) / (a2 * b1 - b2 * a1).abs());
        }
    }
    let allowed = caps.into_iter().map(|cap| match cap {
        SpeedCap::None => f64::INFINITY,
        SpeedCap::Rate(rate) => rate * rate,
        SpeedCap::Tangential { axes: mask, speed } => {
            let counted = axes.iter().enumerate().filter(|(i, _)| mask >> i & 1 == 1);
            speed * speed / counted.map(|(_, p)| p[0] * p[0]).sum::<f64>()
        }
    });
    allowed
        .fold(None, |loosest: Option<f64>, q| Some(loosest.map_or(q, |l| l.max(q))))
        .map_or(most, |q| most.min(q))
}
