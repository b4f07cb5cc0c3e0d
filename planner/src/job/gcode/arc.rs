//! Circular arcs from their end point and centre or radius.

use std::f64::consts::{FRAC_PI_2, TAU};

use super::fault::ErrorKind;
use crate::job::program::Arc;
use crate::tolerances::{
    ARC_RADII_MM, ARC_RADII_MOST_MM, ARC_RADII_RATIO, ARC_RADIUS_LEAST_MM, ARC_RADIUS_MOST_MM, ARC_REACH_MM,
    SAME_POINT,
};

/// What fixes the circle, besides its start and end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Circle {
    /// The centre [mm].
    Centre([f64; 2]),
    /// The radius [mm]; negative for the arc of more than half a turn.
    Radius(f64),
}

/// The arc from `start` to `end` in a plane, `turns` times past its end counting the last.
pub(super) fn arc(
    plane: [usize; 2],
    start: [f64; 2],
    end: [f64; 2],
    circle: Circle,
    clockwise: bool,
    turns: u32,
) -> Result<Arc, ErrorKind> {
    let [dx, dy] = [end[0] - start[0], end[1] - start[1]];
    let size = start[0].abs().max(start[1].abs()).max(end[0].abs()).max(end[1].abs());
    let more_turns = f64::from(turns.saturating_sub(1)) * TAU;
    match circle {
        Circle::Centre(centre) => {
            let from = [start[0] - centre[0], start[1] - centre[1]];
            let to = [end[0] - centre[0], end[1] - centre[1]];
            let (radius, end_radius) = (from[0].hypot(from[1]), to[0].hypot(to[1]));
            if radius < ARC_RADIUS_LEAST_MM || end_radius < ARC_RADIUS_LEAST_MM {
                return Err(ErrorKind::ZeroRadius);
            }
            if radius > ARC_RADIUS_MOST_MM {
                return Err(ErrorKind::RadiusTooLarge { radius_mm: radius });
            }
            let allowed_mm = (ARC_RADII_RATIO * radius).clamp(ARC_RADII_MM, ARC_RADII_MOST_MM);
            if (end_radius - radius).abs() > allowed_mm {
                return Err(ErrorKind::RadiiDiffer { start_mm: radius, end_mm: end_radius, allowed_mm });
            }
            let closed = dx.hypot(dy) <= SAME_POINT * (size + radius);
            let turned = (from[0] * to[1] - from[1] * to[0]).atan2(from[0] * to[0] + from[1] * to[1]);
            let sweep = match (closed, clockwise) {
                (true, _) => TAU,
                (false, false) if turned <= 0.0 => turned + TAU,
                (false, true) if turned >= 0.0 => TAU - turned,
                (false, _) => turned.abs(),
            } + more_turns;
            Ok(Arc {
                plane,
                centre,
                radius,
                radius_change: if closed { 0.0 } else { end_radius - radius },
                start_angle: from[1].atan2(from[0]),
                sweep: if clockwise { -sweep } else { sweep },
            })
        }
        Circle::Radius(signed) => {
            let given = signed.abs();
            let half_chord = 0.5 * dx.hypot(dy);
            if given < ARC_RADIUS_LEAST_MM {
                return Err(ErrorKind::ZeroRadius);
            }
            if given > ARC_RADIUS_MOST_MM {
                return Err(ErrorKind::RadiusTooLarge { radius_mm: given });
            }
            if 2.0 * half_chord <= SAME_POINT * (size + given) {
                return Err(ErrorKind::RadiusFullCircle);
            }
            if half_chord - given > ARC_REACH_MM {
                return Err(ErrorKind::RadiusTooSmall { radius_mm: given, half_chord_mm: half_chord });
            }
            let radius = given.max(half_chord);
            // Distance of the centre from the chord, towards the left of the way from start to end.
            let height = ((radius - half_chord) * (radius + half_chord)).sqrt();
            let left = if clockwise == (signed < 0.0) { height } else { -height };
            let centre = [
                start[0] + 0.5 * dx - left * dy / (2.0 * half_chord),
                start[1] + 0.5 * dy + left * dx / (2.0 * half_chord),
            ];
            let short = 2.0 * half_chord.atan2(height);
            let sweep = if signed < 0.0 { TAU - short } else { short } + more_turns;
            Ok(Arc {
                plane,
                centre,
                radius,
                radius_change: 0.0,
                start_angle: (start[1] - centre[1]).atan2(start[0] - centre[0]),
                sweep: if clockwise { -sweep } else { sweep },
            })
        }
    }
}

/// Length in the plane [mm]. A change of radius is counted as an even spiral, to second order.
pub(super) fn length_in_plane(arc: &Arc) -> f64 {
    ((arc.radius + 0.5 * arc.radius_change) * arc.sweep).hypot(arc.radius_change)
}

/// Lowest and highest coordinate along the two axes of the plane [mm], between the given ends.
pub(super) fn extent(arc: &Arc, start: [f64; 2], end: [f64; 2]) -> [[f64; 2]; 2] {
    let mut extent = [0, 1].map(|i| [start[i].min(end[i]), start[i].max(end[i])]);
    let (from, to) = if arc.sweep < 0.0 {
        (arc.start_angle + arc.sweep, arc.start_angle)
    } else {
        (arc.start_angle, arc.start_angle + arc.sweep)
    };
    let first = (from / FRAC_PI_2).ceil();
    // Four quarters meet every extreme once; on a spiral, the last turn is the outermost or the first one is.
    let radius = arc.radius.max(arc.radius + arc.radius_change);
    for quarter in 0..4 {
        let angle = (first + f64::from(quarter)) * FRAC_PI_2;
        if angle > to {
            break;
        }
        let share = (angle - arc.start_angle) / arc.sweep;
        let here = if arc.sweep.abs() > TAU { radius } else { arc.radius + arc.radius_change * share };
        let point = [arc.centre[0] + here * angle.cos(), arc.centre[1] + here * angle.sin()];
        for (range, value) in extent.iter_mut().zip(point) {
            *range = [range[0].min(value), range[1].max(value)];
        }
    }
    extent
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(arc: &Arc, t: f64) -> [f64; 2] {
        let (r, a) = (arc.radius + t * arc.radius_change, arc.start_angle + t * arc.sweep);
        [arc.centre[0] + r * a.cos(), arc.centre[1] + r * a.sin()]
    }

    fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
        (a[0] - b[0]).hypot(a[1] - b[1])
    }

    #[test]
    fn quarter_circles_turn_as_said() {
        let ccw = arc([0, 1], [1.0, 0.0], [0.0, 1.0], Circle::Centre([0.0, 0.0]), false, 1).unwrap();
        assert!((ccw.sweep - FRAC_PI_2).abs() < 1e-15);
        let cw = arc([0, 1], [1.0, 0.0], [0.0, 1.0], Circle::Centre([0.0, 0.0]), true, 2).unwrap();
        assert!((cw.sweep + 1.5 * TAU / 2.0 + TAU).abs() < 1e-14);
        assert_eq!(extent(&cw, [1.0, 0.0], [0.0, 1.0]), [[-1.0, 1.0], [-1.0, 1.0]]);
    }

    #[test]
    fn a_closed_arc_is_a_full_circle() {
        let full = arc([0, 1], [3.0, 4.0], [3.0, 4.0], Circle::Centre([0.0, 0.0]), true, 1).unwrap();
        assert_eq!(full.sweep, -TAU);
        assert!((length_in_plane(&full) - 5.0 * TAU).abs() < 1e-12);
    }

    #[test]
    fn radii_must_agree() {
        let of = |end: f64, x: f64| arc([0, 1], [0.0, 0.0], [end, 0.0], Circle::Centre([x, 0.0]), true, 1);
        assert!(of(20.0, 10.0).is_ok());
        assert!(of(20.02, 10.0).is_err());
        // 2.857 mm of 3001 mm is below 0.1 % and still no circle.
        assert!(matches!(of(6000.0, 3001.4284), Err(ErrorKind::RadiiDiffer { .. })));
    }

    #[test]
    fn radius_must_reach_the_end() {
        let of = |r: f64| arc([0, 1], [0.0, 0.0], [10.0, 0.0], Circle::Radius(r), true, 1);
        assert!(of(5.0).is_ok());
        assert!(of(4.999).is_ok(), "within the rounding of R");
        assert!(matches!(of(4.9), Err(ErrorKind::RadiusTooSmall { .. })));
        assert!(matches!(of(0.0), Err(ErrorKind::ZeroRadius)));
        let closed = arc([0, 1], [2.0, 2.0], [2.0, 2.0], Circle::Radius(1.0), true, 1);
        assert_eq!(closed, Err(ErrorKind::RadiusFullCircle));
    }

    proptest! {
        #[test]
        fn arcs_by_radius_start_and_end_where_they_say(
            start in prop::array::uniform2(-1e3..1e3f64), end in prop::array::uniform2(-1e3..1e3f64),
            surplus in 0.0..10.0f64, long: bool, clockwise: bool,
        ) {
            let half = 0.5 * distance(start, end);
            prop_assume!(half > 1e-3);
            let radius = half * (1.0 + surplus);
            let circle = Circle::Radius(if long { -radius } else { radius });
            let a = arc([0, 1], start, end, circle, clockwise, 1).unwrap();
            prop_assert!(distance(at(&a, 0.0), start) < 1e-9);
            prop_assert!(distance(at(&a, 1.0), end) < 1e-9);
            prop_assert_eq!(a.sweep < 0.0, clockwise);
            prop_assert_eq!(a.sweep.abs() > TAU / 2.0 + 1e-9, long && surplus > 1e-9);
        }

        #[test]
        fn arcs_by_centre_stay_in_their_extent(
            centre in prop::array::uniform2(-1e3..1e3f64), radius in 0.1..1e3f64,
            angles in prop::array::uniform2(-4.0..4.0f64), clockwise: bool, turns in 1..4u32,
        ) {
            let on = |a: f64| [centre[0] + radius * a.cos(), centre[1] + radius * a.sin()];
            let (start, end) = (on(angles[0]), on(angles[1]));
            let a = arc([0, 1], start, end, Circle::Centre(centre), clockwise, turns).unwrap();
            prop_assert!(distance(at(&a, 0.0), start) < 1e-9);
            prop_assert!(distance(at(&a, 1.0), end) < 1e-9);
            let box_ = extent(&a, start, end);
            let mut seen = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
            for k in 0..=2000 {
                let p = at(&a, f64::from(k) / 2000.0);
                for i in 0..2 {
                    seen[i] = [seen[i][0].min(p[i]), seen[i][1].max(p[i])];
                }
            }
            for i in 0..2 {
                prop_assert!(seen[i][0] >= box_[i][0] - 1e-9 && seen[i][1] <= box_[i][1] + 1e-9);
                // A step of the scan leaves out at most r (1 - cos(step / 2)).
                let missed = radius * (a.sweep / 4000.0).powi(2);
                prop_assert!(seen[i][0] - box_[i][0] <= missed + 1e-9 && box_[i][1] - seen[i][1] <= missed + 1e-9);
            }
        }
    }
}
