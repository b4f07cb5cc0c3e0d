//! The few functions beyond + - * / that the core needs.

/// Square root, correctly rounded as IEEE 754 asks: the same bits wherever it runs.
#[cfg(not(all(target_arch = "arm", target_abi = "eabihf")))]
pub(crate) fn sqrt(x: f32) -> f32 {
    libm::sqrtf(x)
}

/// Square root, correctly rounded as IEEE 754 asks, by the instruction that the floating-point unit has for it.
#[cfg(all(target_arch = "arm", target_abi = "eabihf"))]
pub(crate) fn sqrt(x: f32) -> f32 {
    vfp::sqrt(x)
}

/// The nearest integer, halves up; saturates, and NaN gives 0.
pub(crate) fn nearest(x: f32) -> i32 {
    let whole = x as i32;
    let rest = x - whole as f32;
    if rest >= 0.5 {
        whole.saturating_add(1)
    } else if rest < -0.5 {
        whole.saturating_sub(1)
    } else {
        whole
    }
}

/// As [`nearest`], as far as i64 goes: what is too large for a fraction in f32 is whole.
pub(crate) fn nearest_long(x: f32) -> i64 {
    const WHOLE: f32 = 8_388_608.0;
    if x.abs() < WHOLE { i64::from(nearest(x)) } else { x as i64 }
}

/// S(z) = sum z^k/(2k+1)!, five terms; exact to f32 for |z| <= 1.21.
pub(crate) fn s_series(z: f32) -> f32 {
    1.0 + z * (1.0 / 6.0 + z * (1.0 / 120.0 + z * (1.0 / 5_040.0 + z * (1.0 / 362_880.0))))
}

/// G(z) = sum z^k/(2k+2)!, five terms; exact to f32 for |z| <= 1.21.
pub(crate) fn g_series(z: f32) -> f32 {
    0.5 + z * (1.0 / 24.0 + z * (1.0 / 720.0 + z * (1.0 / 40_320.0 + z * (1.0 / 3_628_800.0))))
}

/// A(y) = sum y^k/(2k+1) = artanh(sqrt y)/sqrt y, for |y| <= 1/4.
///
/// One half-angle step, y2 = y/(1 + sqrt(1-y))^2, A(y) = 2/(1 + sqrt(1-y)) A(y2), leaves |y2| < 0.072; then the
/// eighth term is below 1e-9.
pub(crate) fn a_series(y: f32) -> f32 {
    let half = 1.0 / (1.0 + sqrt(1.0 - y));
    let z = y * half * half;
    let tail = 1.0 / 9.0 + z * (1.0 / 11.0 + z * (1.0 / 13.0 + z * (1.0 / 15.0)));
    let sum = 1.0 + z * (1.0 / 3.0 + z * (1.0 / 5.0 + z * (1.0 / 7.0 + z * tail)));
    2.0 * half * sum
}

#[cfg(test)]
mod tests {
    use super::*;

    extern crate std;

    #[test]
    fn square_root_is_the_ieee_one_for_every_exponent() {
        let mut bits = 1u32;
        let mut checked = 0;
        while bits < 0x7f80_0000 {
            let x = f32::from_bits(bits);
            assert_eq!(sqrt(x).to_bits(), x.sqrt().to_bits(), "{bits:#x}");
            checked += 1;
            bits += 1 + bits % 1021;
        }
        assert!(checked > 3_000_000);
        assert_eq!(sqrt(0.0), 0.0);
        assert!(sqrt(-1.0).is_nan());
    }

    #[test]
    fn nearest_rounds_halves_up() {
        let cases =
            [(0.5, 1), (-0.5, 0), (0.49, 0), (-0.51, -1), (1.5, 2), (-1.5, -1), (8_388_607.5, 8_388_608)];
        for (x, n) in cases {
            assert_eq!(nearest(x), n, "{x}");
        }
        assert_eq!(
            (nearest_long(-2.5), nearest_long(2_199_023_255_552.0), nearest_long(f32::NAN)),
            (-2, 1 << 41, 0)
        );
        assert_eq!((nearest(1e30), nearest(-1e30), nearest(f32::NAN)), (i32::MAX, i32::MIN, 0));
    }

    #[test]
    fn series_match_their_functions() {
        for i in -1210..=1210 {
            let z = f64::from(i) * 1e-3;
            let r = z.abs().sqrt();
            let (s, c) = if z < 0.0 { (r.sin(), r.cos()) } else { (r.sinh(), r.cosh()) };
            if r > 1e-1 {
                assert!((f64::from(s_series(z as f32)) / (s / r) - 1.0).abs() < 3e-7, "S {z}");
                assert!((f64::from(g_series(z as f32)) / ((c - 1.0) / z) - 1.0).abs() < 3e-7, "G {z}");
            }
        }
        for i in -250..=250i32 {
            let y = f64::from(i) * 1e-3;
            let r = y.abs().sqrt();
            let a = if y > 0.0 { r.atanh() / r } else { r.atan() / r };
            if i != 0 {
                assert!((f64::from(a_series(y as f32)) / a - 1.0).abs() < 3e-7, "A {y}");
            }
        }
    }
}
