//! The sweep of samples against its formulas, one station after the other.

use super::families::{Rng, walk};
use crate::geometry::grid_path::GridPath;
use crate::job::machine::AxisLimits;
use crate::topp::sweep::{Samples, SamplesError, Sweeper};

/// The sweep station by station, as its formulas read.
fn plain(stations: &[f64], first: &[Vec<f64>], second: &[Vec<f64>], limits: &[AxisLimits]) -> Vec<f64> {
    let (n, axes) = (stations.len(), first.len());
    let strip = |a: usize, k: usize| {
        let sign = if first[a][k] < 0.0 { -1.0 } else { 1.0 };
        (first[a][k].abs(), sign * second[a][k], limits[a].acceleration)
    };
    let mut q: Vec<f64> = (0..n)
        .map(|k| {
            let mut most = f64::INFINITY;
            for (a, l) in limits.iter().enumerate() {
                let (gain, slope, bound) = strip(a, k);
                most = most.min((l.velocity / gain).powi(2));
                if gain == 0.0 {
                    most = most.min(bound / slope.abs());
                }
                for b in a + 1..axes {
                    let (other, bend, limit) = strip(b, k);
                    most = most.min((bound * other + limit * gain) / (slope * other - bend * gain).abs());
                }
            }
            most
        })
        .collect();
    (q[0], q[n - 1]) = (0.0, 0.0);
    let largest = q.iter().copied().filter(|q| q.is_finite()).fold(0.0, f64::max);
    q.iter_mut().filter(|q| q.is_infinite()).for_each(|q| *q = largest);
    for k in (0..n - 1).rev() {
        let d = 2.0 * (stations[k + 1] - stations[k]);
        for (gain, slope, bound) in (0..axes).map(|a| strip(a, k)) {
            if gain - d * slope > 0.0 {
                q[k] = q[k].min((gain * q[k + 1] + d * bound) / (gain - d * slope));
            }
        }
    }
    for k in 0..n - 1 {
        let d = 2.0 * (stations[k + 1] - stations[k]);
        let moving = (0..axes).map(|a| strip(a, k)).filter(|s| s.0 > 0.0);
        let w =
            moving.map(|(gain, slope, bound)| (bound - slope * q[k]) / gain).fold(f64::INFINITY, f64::min);
        q[k + 1] = q[k + 1].min((q[k] + d * w).max(0.0));
    }
    q
}

/// p' and p'' of every axis at equally spaced stations.
fn derivatives(path: &GridPath, stations: &[f64]) -> [Vec<Vec<f64>>; 2] {
    let at = |u: f64, axis: usize| {
        let g = (0..path.spans()).rev().find(|&g| path.breaks[g] as f64 * path.step <= u).unwrap();
        let (p, x) = (path.piece(axis, g), u - path.breaks[g] as f64 * path.step);
        [p.first(x), p.second(x)]
    };
    [0, 1].map(|d| (0..path.axes.len()).map(|a| stations.iter().map(|&u| at(u, a)[d]).collect()).collect())
}

fn assert_alike(found: &[f64], expected: &[f64]) {
    let top = expected.iter().copied().fold(0.0, f64::max);
    assert_eq!(found.len(), expected.len());
    for (k, (f, e)) in found.iter().zip(expected).enumerate() {
        assert!((f - e).abs() <= 1e-11 * top + 1e-9 * e, "{f} is not {e} at {k} of {}", found.len());
    }
}

#[test]
fn lanes_agree_with_one_station_after_the_other() {
    let mut sweeper = Sweeper::new();
    for seed in 0..60 {
        let mut rng = Rng::new(seed);
        let axes = 1 + (seed % 9) as usize;
        let turn = if seed % 3 == 0 { 1.5 } else { 0.3 };
        let path = walk(&mut rng, axes, 12 + seed as usize, 2.0, turn);
        let limits: Vec<AxisLimits> = (0..axes)
            .map(|_| AxisLimits {
                velocity: 10f64.powf(rng.within(1.0, 3.0)),
                acceleration: 10f64.powf(rng.within(2.0, 4.0)),
                jerk: f64::INFINITY,
            })
            .collect();
        let samples = Samples::uniform(&path, 200 + 7 * seed as usize).unwrap();
        let [first, second] = derivatives(&path, samples.stations());
        let expected = plain(samples.stations(), &first, &second, &limits);
        assert_alike(sweeper.sweep(&samples, &limits).unwrap(), &expected);
        let given = Samples::new(samples.stations().to_vec(), &first, &second).unwrap();
        assert_alike(sweeper.sweep(&given, &limits).unwrap(), &expected);
    }
}

#[test]
fn axes_that_stand_still_or_only_bend_are_bounded_too() {
    let stations: Vec<f64> = (0..40).map(f64::from).collect();
    let limits = [AxisLimits { velocity: 10.0, acceleration: 2.0, jerk: f64::INFINITY }; 2];
    let still = vec![0.0; 40];
    let bent: Vec<f64> = (0..40).map(|k| if k % 5 == 2 { -0.5 } else { 0.0 }).collect();
    let moves: Vec<f64> = (0..40).map(|k| if (20..24).contains(&k) { 0.0 } else { 1.0 }).collect();
    for (first, second) in [
        ([still.clone(), moves.clone()], [bent.clone(), still.clone()]),
        ([still.clone(), moves.clone()], [still.clone(), bent.clone()]),
        ([still.clone(), still.clone()], [bent.clone(), still.clone()]),
    ] {
        let samples = Samples::new(stations.clone(), &first, &second).unwrap();
        let expected = plain(&stations, &first, &second, &limits);
        let mut sweeper = Sweeper::new();
        assert_alike(sweeper.sweep(&samples, &limits).unwrap(), &expected);
    }
}

#[test]
fn a_straight_line_is_a_triangle_of_q() {
    let limits = [AxisLimits { velocity: 1e3, acceleration: 40.0, jerk: 1.0 }; 2];
    let stations: Vec<f64> = (0..=100).map(|k| 0.1 * f64::from(k)).collect();
    let samples = Samples::new(stations, &[[0.6; 101], [0.8; 101]], &[[0.0; 101]; 2]).unwrap();
    let mut sweeper = Sweeper::new();
    // The steeper axis allows w = 40/0.8; q = 2 w u up to the middle.
    let expected: Vec<f64> = (0..=100).map(|k| 100.0 * 0.1 * f64::from(k.min(100 - k))).collect();
    assert_alike(sweeper.sweep(&samples, &limits).unwrap(), &expected);
}

#[test]
fn unsound_samples_and_limits_are_refused() {
    let (stations, none): (Vec<f64>, [Vec<f64>; 0]) = (vec![0.0, 1.0, 2.0], []);
    let flat = [vec![1.0; 3]];
    let of = |stations: &[f64], first: &[Vec<f64>]| Samples::new(stations.to_vec(), first, &flat).err();
    assert_eq!(Samples::new(stations.clone(), &none, &none).err(), Some(SamplesError::Axes { axes: 0 }));
    assert_eq!(of(&[0.0], &flat), Some(SamplesError::Few { stations: 1 }));
    assert_eq!(of(&[0.0, 0.0, 1.0], &flat), Some(SamplesError::Station { index: 1 }));
    assert_eq!(of(&[0.0, 1.0, f64::NAN], &flat), Some(SamplesError::Station { index: 2 }));
    assert_eq!(of(&stations, &[vec![f64::NAN; 3]]), Some(SamplesError::Derivatives { axis: 0 }));
    assert_eq!(of(&stations, &[vec![1.0; 2]]), Some(SamplesError::Derivatives { axis: 0 }));
    let samples = Samples::new(stations, &flat, &flat).unwrap();
    let limits = |velocity| AxisLimits { velocity, acceleration: 1.0, jerk: 1.0 };
    let mut sweeper = Sweeper::new();
    assert!(sweeper.sweep(&samples, &[]).is_err());
    assert!(sweeper.sweep(&samples, &[limits(f64::NAN)]).is_err());
    assert!(sweeper.sweep(&samples, &[limits(0.0)]).is_err());
    assert_eq!(sweeper.sweep(&samples, &[limits(1.0)]).map(<[f64]>::len), Ok(3));
}
