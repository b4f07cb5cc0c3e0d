//! The derivatives of a path at stations, laid out for passes that take several stations at once.

use thiserror::Error;

use super::super::layout::Pieces;
use crate::geometry::grid_path::GridPath;
use crate::job::machine::MAX_AXES;

/// Stations taken at once.
pub(super) const LANES: usize = 8;

/// One number for each of several neighbouring stations.
pub(super) type Lanes = [f64; LANES];

/// p' and p'' of every axis at stations along a path, and what else bounds the speed there.
#[derive(Clone, Debug)]
pub struct Samples {
    pub(super) axes: usize,
    pub(super) stations: Vec<f64>,
    /// Twice the distance to the next station; zero from the last one on.
    pub(super) steps: Vec<Lanes>,
    /// p' and p'': the axes of the first lanes, then those of the next.
    pub(super) first: Vec<Lanes>,
    pub(super) second: Vec<Lanes>,
    /// Largest q that caps on the path speed allow.
    pub(super) cap: Vec<Lanes>,
}

/// Why stations and derivatives make no samples.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum SamplesError {
    /// No axis, or more than a machine has.
    #[error("{axes} axes; a path has 1 to {MAX_AXES}")]
    Axes {
        /// How many.
        axes: usize,
    },
    /// Fewer than two stations.
    #[error("{stations} stations; a path has at least 2")]
    Few {
        /// How many.
        stations: usize,
    },
    /// Stations that do not rise, or are not finite.
    #[error("station {index} does not lie behind the one before it")]
    Station {
        /// Which one.
        index: usize,
    },
    /// An axis without a finite p' and p'' at every station.
    #[error("axis {axis} has no finite derivatives at every station")]
    Derivatives {
        /// Which one.
        axis: usize,
    },
}

impl Samples {
    /// Of given derivatives: `first[a][k]` and `second[a][k]` are p' and p'' of axis a at station k.
    ///
    /// # Errors
    ///
    /// [`SamplesError`] where they are not one finite number per axis and station.
    pub fn new(
        stations: Vec<f64>,
        first: &[impl AsRef<[f64]>],
        second: &[impl AsRef<[f64]>],
    ) -> Result<Self, SamplesError> {
        let axes = first.len();
        if axes == 0 || axes > MAX_AXES {
            return Err(SamplesError::Axes { axes });
        }
        validate(&stations)?;
        let mut samples = Self::still(axes, stations);
        let n = samples.stations.len();
        let sound = |v: &[f64]| v.len() == n && v.iter().all(|v| v.is_finite());
        for axis in 0..axes {
            let second = second.get(axis).map_or(&[][..], AsRef::as_ref);
            let first = first[axis].as_ref();
            if !sound(first) || !sound(second) {
                return Err(SamplesError::Derivatives { axis });
            }
            for (k, (&first, &second)) in first.iter().zip(second).enumerate() {
                samples.set(axis, k, first, second);
            }
        }
        Ok(samples)
    }

    /// Of a path at `stations` stations equally far apart in u.
    ///
    /// # Errors
    ///
    /// [`SamplesError`] where the path is not sound or stations are too few.
    pub fn uniform(path: &GridPath, stations: usize) -> Result<Self, SamplesError> {
        let axes = path.axes.len();
        if axes == 0 || axes > MAX_AXES {
            return Err(SamplesError::Axes { axes });
        }
        if stations < 2 {
            return Err(SamplesError::Few { stations });
        }
        let share = path.length() / (stations - 1) as f64;
        let stations: Vec<f64> = (0..stations).map(|k| k as f64 * share).collect();
        validate(&stations)?;
        let mut geometry = Vec::with_capacity(stations.len());
        let mut g = 0;
        for &u in &stations {
            while g + 2 < path.breaks.len() && path.breaks[g + 1] as f64 * path.step <= u {
                g += 1;
            }
            geometry.push(g);
        }
        Ok(Self::along(path, stations, &geometry))
    }

    /// Of a sound path at rising stations, each in its geometry span.
    pub(super) fn along(path: &GridPath, stations: Vec<f64>, geometry: &[usize]) -> Self {
        let mut samples = Self::still(path.axes.len(), stations);
        let mut pieces = Pieces::new(path);
        for (k, &g) in geometry.iter().enumerate() {
            let x = samples.stations[k] - path.breaks[g] as f64 * path.step;
            for (axis, piece) in pieces.at(g).iter().enumerate() {
                samples.set(axis, k, piece.first(x), piece.second(x));
            }
        }
        samples
    }

    /// Where nothing moves.
    fn still(axes: usize, stations: Vec<f64>) -> Self {
        let chunks = stations.len().div_ceil(LANES);
        let mut steps = vec![[0.0; LANES]; chunks];
        for (k, pair) in stations.windows(2).enumerate() {
            steps[k / LANES][k % LANES] = 2.0 * (pair[1] - pair[0]);
        }
        let zero = vec![[0.0; LANES]; chunks * axes];
        let cap = vec![[f64::INFINITY; LANES]; chunks];
        Samples { axes, stations, steps, first: zero.clone(), second: zero, cap }
    }

    fn set(&mut self, axis: usize, k: usize, first: f64, second: f64) {
        let (row, lane) = (k / LANES * self.axes + axis, k % LANES);
        self.first[row][lane] = first;
        self.second[row][lane] = second;
    }

    /// Number of axes.
    pub fn axes(&self) -> usize {
        self.axes
    }

    /// The stations in u.
    pub fn stations(&self) -> &[f64] {
        &self.stations
    }

    /// p' of an axis at station `k`.
    pub(super) fn first_at(&self, axis: usize, k: usize) -> f64 {
        self.first[k / LANES * self.axes + axis][k % LANES]
    }

    /// Bounds q at station `k`.
    pub(super) fn bound(&mut self, k: usize, q: f64) {
        let cap = &mut self.cap[k / LANES][k % LANES];
        *cap = cap.min(q);
    }
}

fn validate(stations: &[f64]) -> Result<(), SamplesError> {
    if stations.len() < 2 {
        return Err(SamplesError::Few { stations: stations.len() });
    }
    let unsound = |k: &usize| {
        let behind = *k == 0 || stations[*k] > stations[*k - 1];
        !behind || !stations[*k].is_finite()
    };
    (0..stations.len()).find(unsound).map_or(Ok(()), |index| Err(SamplesError::Station { index }))
}
