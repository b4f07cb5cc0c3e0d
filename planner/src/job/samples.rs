//! Sample way-points of our own drawing, for demonstrations, comparisons and benchmarks.

use std::io::{self, Write};

use crate::splines::cubic::{CubicSystem, Ends, Jet, SplineError};
use crate::splines::knots::Knots;

/// Length round the cat [mm].
const CAT_LENGTH_MM: f64 = 860.0;

/// Lower left corner of the cat's bounding box [mm].
const CAT_CORNER_MM: [f64; 2] = [10.0, 10.0];

/// Lengths along the cat are summed at places this much finer than the way-points asked for.
const OVERSAMPLING: usize = 8;

/// The outline of a sitting cat, drawn counter-clockwise from the middle of its base in smooth strokes that meet
/// in sharp points: paws, tail tip, the ears.
const CAT_STROKES: [&[[f64; 2]]; 9] = [
    // Base, and round the right flank up to the tail.
    &[[0.0, 0.0], [14.0, 0.3], [27.0, 1.2], [36.0, 3.0]],
    // Under the tail, out to its tip.
    &[[36.0, 3.0], [46.0, 2.0], [57.0, 4.5], [65.0, 11.0], [68.0, 20.0], [66.5, 28.0], [61.5, 33.0]],
    // Back along the upper side of the tail.
    &[[61.5, 33.0], [63.0, 25.0], [61.0, 17.5], [54.0, 12.0], [45.0, 11.0], [39.5, 14.5]],
    // Hip, back, neck and cheek up to the tip of an ear.
    &[
        [39.5, 14.5],
        [41.0, 24.0],
        [39.0, 35.0],
        [33.5, 47.0],
        [26.0, 57.0],
        [20.5, 65.0],
        [20.0, 71.0],
        [22.0, 78.0],
        [21.8, 86.0],
        [23.0, 93.0],
        [22.6, 100.0],
        [21.0, 107.0],
    ],
    // Inner edge of that ear; the top of the head; inner edge of the other ear.
    &[[21.0, 107.0], [15.5, 102.5], [11.0, 98.0], [7.5, 95.5]],
    &[[7.5, 95.5], [2.0, 96.6], [-3.5, 95.5]],
    &[[-3.5, 95.5], [-7.0, 98.0], [-11.5, 102.5], [-17.0, 107.0]],
    // Outer edge of the other ear, cheek, chest and front leg.
    &[
        [-17.0, 107.0],
        [-18.6, 100.0],
        [-19.0, 93.0],
        [-18.5, 85.0],
        [-19.5, 78.0],
        [-16.5, 71.0],
        [-12.5, 65.5],
        [-13.5, 57.0],
        [-17.0, 46.0],
        [-18.5, 34.0],
        [-17.5, 22.0],
        [-17.0, 12.0],
        [-19.5, 6.5],
    ],
    // Paw.
    &[[-19.5, 6.5], [-22.5, 3.5], [-21.0, 0.6], [-14.0, 0.0], [-7.0, 0.0], [0.0, 0.0]],
];

/// `points` way-points [x, y] in mm, evenly spread round the outline of a cat, 860 mm in all; the last is the
/// first again.
///
/// # Errors
/// At fewer than two points.
pub fn cat_contour(points: usize) -> Result<Vec<[f64; 2]>, SplineError> {
    if points < 2 {
        return Err(SplineError::TooFew { found: points, least: 2 });
    }
    let strokes = CAT_STROKES.into_iter().map(Stroke::new).collect::<Result<Vec<_>, _>>()?;
    let legs: usize = strokes.iter().map(|s| s.lengths.len()).sum();
    let per_leg = (points * OVERSAMPLING).div_ceil(legs).max(50);
    // Length along the outline at finely spread parameters; a place between two of them is on the curve itself.
    let mut places: Vec<Place> = Vec::with_capacity(legs * per_leg);
    let mut length = 0.0;
    let mut low = [f64::INFINITY; 2];
    for (stroke, curve) in strokes.iter().enumerate() {
        for (leg, h) in curve.lengths.iter().enumerate() {
            let ends = (0..=per_leg).map(|k| curve.at(leg, h * k as f64 / per_leg as f64));
            let ends: Vec<[f64; 2]> = ends.collect();
            for (k, w) in ends.windows(2).enumerate() {
                let from = h * k as f64 / per_leg as f64;
                places.push(Place { stroke, leg, from, until: h * (k + 1) as f64 / per_leg as f64, length });
                length += (w[1][0] - w[0][0]).hypot(w[1][1] - w[0][1]);
                low = [low[0].min(w[0][0]), low[1].min(w[0][1])];
            }
        }
    }
    let scale = CAT_LENGTH_MM / length;
    let mut i = 0;
    let mut contour: Vec<[f64; 2]> = (0..points - 1)
        .map(|k| {
            let s = length * k as f64 / (points - 1) as f64;
            while i + 1 < places.len() && places[i + 1].length <= s {
                i += 1;
            }
            let p = &places[i];
            let end = places.get(i + 1).map_or(length, |next| next.length);
            let at = p.from + (s - p.length) / (end - p.length) * (p.until - p.from);
            let [x, y] = strokes[p.stroke].at(p.leg, at);
            [CAT_CORNER_MM[0] + scale * (x - low[0]), CAT_CORNER_MM[1] + scale * (y - low[1])]
        })
        .collect();
    contour.push(contour[0]);
    Ok(contour)
}

/// A short piece of a stroke, and the length of the outline before it.
struct Place {
    stroke: usize,
    leg: usize,
    from: f64,
    until: f64,
    length: f64,
}

/// A smooth curve through a few places: cubic Hermite pieces with the slopes of its spline.
struct Stroke {
    lengths: Vec<f64>,
    knots: Vec<[Jet; 2]>,
}

impl Stroke {
    fn new(places: &[[f64; 2]]) -> Result<Self, SplineError> {
        let chords: Vec<f64> =
            places.windows(2).map(|w| (w[1][0] - w[0][0]).hypot(w[1][1] - w[0][1])).collect();
        let lengths = Knots::Centripetal.lengths(&chords);
        let axis = |a: usize| -> Result<Vec<Jet>, SplineError> {
            let values: Vec<f64> = places.iter().map(|p| p[a]).collect();
            let system = CubicSystem::new(lengths.clone(), Ends::NotAKnot)?;
            let spline = system.interpolate(&values, [0.0; 2])?;
            Ok((0..places.len()).map(|i| spline.at_knot(i)).collect())
        };
        let knots = axis(0)?.into_iter().zip(axis(1)?).map(|(x, y)| [x, y]).collect();
        Ok(Self { lengths, knots })
    }

    /// The place `x` into leg `leg`.
    fn at(&self, leg: usize, x: f64) -> [f64; 2] {
        let (a, b) = (&self.knots[leg], &self.knots[leg + 1]);
        [0, 1].map(|axis| {
            let third = (b[axis].second - a[axis].second) / self.lengths[leg];
            let Jet { value, slope, second } = a[axis];
            value + x * (slope + x * (second / 2.0 + x * third / 6.0))
        })
    }
}

/// Half the width of the square that the tooth raster covers [mm].
const TOOTH_HALF_MM: f64 = 6.0;

/// Height [mm] of a molar-like crown over the point (x, y), |x| and |y| at most 6 mm, z = 0 at the neck.
///
/// A rounded block with steep sides, five cusps, a central pit and fissures between the cusps: smooth
/// everywhere, and nobody's tooth.
pub fn tooth_height_mm(x: f64, y: f64) -> f64 {
    let bump =
        |cx: f64, cy: f64, width: f64| (-((x - cx).powi(2) + (y - cy).powi(2)) / (width * width)).exp();
    // Superellipse outline, wider along x; the side falls off over about a millimetre.
    let radius = ((x / 5.2).powi(4) + (y / 4.6).powi(4)).powf(0.25);
    let body = 4.2 / (1.0 + (14.0 * (radius - 0.93)).exp());
    let cusps = 2.0 * bump(-2.4, 2.2, 1.5)
        + 1.8 * bump(2.1, 2.3, 1.4)
        + 2.1 * bump(-2.2, -2.1, 1.6)
        + 1.7 * bump(1.2, -2.4, 1.3)
        + 1.2 * bump(3.3, -0.7, 1.1);
    let pit = 1.3 * bump(0.0, 0.0, 1.4);
    let groove = |distance: f64, width: f64| (-(distance / width).powi(2)).exp();
    let fissures = 0.5 * groove(y - 0.25 * (1.3 * x).sin(), 0.35)
        + 0.35 * groove(x - 0.3 * y, 0.3) * bump(0.0, 0.0, 4.0);
    let inside = body / 4.2;
    body + inside * (cusps - pit - fissures)
}

/// A zigzag finishing pass over the tooth: `rows` rows along x of `points` way-points [x, y, z] each, in mm,
/// evenly spread over 12 mm by 12 mm, z on the surface.
pub fn tooth_raster(rows: usize, points: usize) -> Vec<[f64; 3]> {
    let place = |i: usize, of: usize| -TOOTH_HALF_MM + 2.0 * TOOTH_HALF_MM * (i as f64 + 0.5) / of as f64;
    let row = |r: usize| {
        let y = place(r, rows);
        (0..points).map(move |k| {
            let x = place(if r.is_multiple_of(2) { k } else { points - 1 - k }, points);
            [x, y, tooth_height_mm(x, y)]
        })
    };
    (0..rows).flat_map(row).collect()
}

/// Writes way-points as CSV under `header`, with so many digits after the point that rounding them does not shake the
/// machine.
///
/// # Errors
/// `out` cannot be written.
pub fn write_csv<const N: usize>(
    out: &mut dyn Write,
    header: &str,
    points: &[[f64; N]],
    digits: usize,
) -> io::Result<()> {
    writeln!(out, "{header}")?;
    for point in points {
        for (i, value) in point.iter().enumerate() {
            write!(out, "{}{value:.digits$}", if i > 0 { "," } else { "" })?;
        }
        writeln!(out)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn cat_is_closed_evenly_spread_and_860_mm_round() {
        let cat = cat_contour(3000).unwrap();
        assert_eq!(cat.len(), 3000);
        assert_eq!(cat[0], cat[2999]);
        let steps: Vec<f64> = cat.windows(2).map(|w| (w[1][0] - w[0][0]).hypot(w[1][1] - w[0][1])).collect();
        let length: f64 = steps.iter().sum();
        assert!((length / CAT_LENGTH_MM - 1.0).abs() < 2e-3, "{length}");
        let even = CAT_LENGTH_MM / 2999.0;
        assert!(steps.iter().all(|s| *s < even * 1.0001 && *s > 0.3 * even));
        assert_eq!(cat_contour(1), Err(SplineError::TooFew { found: 1, least: 2 }));
        assert_eq!(cat_contour(2).unwrap().len(), 2);
    }

    /// Signed area by the shoelace formula.
    #[test]
    fn cat_runs_counter_clockwise_and_does_not_cross_itself() {
        let cat = cat_contour(400).unwrap();
        let area: f64 = cat.windows(2).map(|w| w[0][0] * w[1][1] - w[1][0] * w[0][1]).sum::<f64>() / 2.0;
        assert!(area > 8000.0, "{area}");
        let side = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
            (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        };
        for (i, v) in cat.windows(2).enumerate() {
            for w in cat.windows(2).skip(i + 2) {
                let crosses = side(v[0], v[1], w[0]) * side(v[0], v[1], w[1]) < 0.0
                    && side(w[0], w[1], v[0]) * side(w[0], w[1], v[1]) < 0.0;
                assert!(!crosses, "{v:?} {w:?}");
            }
        }
    }

    #[test]
    fn file_of_the_cat_is_the_drawing() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../jobs/cat2d.csv");
        let mut drawn = Vec::new();
        write_csv(&mut drawn, "X [mm],Y [mm]", &cat_contour(3000).unwrap(), 7).unwrap();
        assert_eq!(std::fs::read_to_string(file).unwrap(), String::from_utf8(drawn).unwrap());
    }

    #[test]
    fn tooth_has_five_cusps_round_a_pit_and_stands_on_its_neck() {
        let at = tooth_height_mm;
        let cusps = [[-2.4, 2.2], [2.1, 2.3], [-2.2, -2.1], [1.2, -2.4], [3.3, -0.7]];
        for [x, y] in cusps {
            assert!(at(x, y) > at(0.0, 0.0) + 1.0, "{x} {y}");
        }
        for k in 0..48 {
            let (s, c) = (std::f64::consts::TAU * f64::from(k) / 48.0).sin_cos();
            assert!(at(6.0 * c, 6.0 * s) < 1.2 && at(6.0 * c, 6.0 * s) > -0.2);
        }
        assert!(at(6.0, 6.0).abs() < 0.01);
    }

    #[test]
    fn raster_turns_back_at_every_row_and_lies_on_the_tooth() {
        let raster = tooth_raster(7, 40);
        assert_eq!(raster.len(), 280);
        for (i, p) in raster.iter().enumerate() {
            assert_eq!(p[2], tooth_height_mm(p[0], p[1]));
            if i % 40 != 0 {
                assert!(((p[0] - raster[i - 1][0]).abs() - 0.3).abs() < 1e-12 && p[1] == raster[i - 1][1]);
            } else if i > 0 {
                assert_eq!(p[0], raster[i - 1][0]);
            }
        }
    }
}
