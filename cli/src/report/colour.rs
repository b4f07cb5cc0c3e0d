//! Colours of the limits: one hue per axis, lighter for velocity, darker for jerk.

use super::model::Limit;

type Rgb = [u8; 3];

/// Hues that stay apart for colour-blind readers (Okabe and Ito, Color Universal Design, 2008).
const HUES: [Rgb; 7] = [
    [0x00, 0x72, 0xb2],
    [0xe6, 0x9f, 0x00],
    [0x00, 0x9e, 0x73],
    [0xcc, 0x79, 0xa7],
    [0xd5, 0x5e, 0x00],
    [0x56, 0xb4, 0xe9],
    [0xb5, 0xa8, 0x1c],
];

/// The hue of an axis as a CSS colour.
pub fn of_axis(axis: usize) -> String {
    css(HUES[axis % HUES.len()])
}

/// The colour of a method in a comparison as a CSS colour: after the hues violet, grey and black.
pub fn of_method(method: usize) -> String {
    const MORE: [Rgb; 3] = [[0x6f, 0x4e, 0xa1], [0x7d, 0x86, 0x92], [0x2b, 0x30, 0x36]];
    let all = HUES.len() + MORE.len();
    css(HUES.iter().chain(&MORE).copied().nth(method % all).unwrap_or(MORE[1]))
}

/// The colour of a limit as a CSS colour.
pub fn of_limit(limit: Limit) -> String {
    let hue = |axis: u8| HUES[usize::from(axis) % HUES.len()];
    css(match limit {
        Limit::Velocity(axis) => mix(hue(axis), [255; 3], 0.5),
        Limit::Acceleration(axis) => hue(axis),
        Limit::Jerk(axis) => mix(hue(axis), [0; 3], 0.4),
        Limit::Feed => [0x9a, 0xa3, 0xae],
        Limit::Rest => [0x5f, 0x67, 0x73],
        Limit::Free => [0xc6, 0xcc, 0xd4],
        Limit::Dwell => [0xb0, 0x9a, 0x86],
    })
}

fn mix(a: Rgb, b: Rgb, share: f64) -> Rgb {
    std::array::from_fn(|i| (f64::from(a[i]) * (1.0 - share) + f64::from(b[i]) * share).round() as u8)
}

fn css([r, g, b]: Rgb) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn ten_methods_have_ten_colours() {
        assert_eq!((0..10).map(of_method).collect::<BTreeSet<_>>().len(), 10);
    }

    #[test]
    fn every_limit_of_seven_axes_has_its_own_colour() {
        let mut limits = vec![Limit::Feed, Limit::Rest, Limit::Free, Limit::Dwell];
        for axis in 0..7 {
            limits.extend([Limit::Velocity(axis), Limit::Acceleration(axis), Limit::Jerk(axis)]);
        }
        let colours: BTreeSet<String> = limits.iter().map(|&l| of_limit(l)).collect();
        assert_eq!(colours.len(), limits.len());
    }
}
