//! Numbers in words: short, with units, readable at a glance.

/// A count with thin groups: 169 205.
pub fn count(n: u64) -> String {
    let digits = n.to_string();
    let mut text = String::with_capacity(digits.len() + digits.len() / 3);
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

/// A duration: `0.532 s`, `12.34 s`, `3 min 05 s`, `1 h 02 min 03 s`.
pub fn duration(seconds: f64) -> String {
    if !seconds.is_finite() {
        return "\u{2013}".into();
    }
    let whole = seconds.round() as u64;
    if seconds < 1.0 {
        format!("{seconds:.3} s")
    } else if seconds < 99.995 {
        format!("{seconds:.2} s")
    } else if whole < 3600 {
        format!("{} min {:02} s", whole / 60, whole % 60)
    } else {
        format!("{} h {:02} min {:02} s", whole / 3600, whole / 60 % 60, whole % 60)
    }
}

/// A length: `0.0042 mm`, `185.3 mm`, `42.79 m`.
pub fn length(mm: f64) -> String {
    match mm.abs() {
        m if m < 1.0 && m > 0.0 => format!("{mm:.4} mm"),
        m if m < 10_000.0 => format!("{mm:.1} mm"),
        _ => format!("{:.2} m", mm / 1e3),
    }
}

/// A bound that may be far below one, rounded up to two digits: `0.0043`, `0.000071`, `2.5`.
pub fn small(value: f64) -> String {
    if !(value > 0.0 && value.is_finite()) {
        return number(value);
    }
    let decimals = (1.0 - value.log10().floor()).clamp(0.0, 17.0);
    let scale = 10f64.powf(decimals);
    let shown = (value * scale * (1.0 - 1e-12)).ceil() / scale;
    format!("{shown:.*}", decimals as usize).trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// A size: `912 B`, `34.1 kB`, `2.10 MB`.
pub fn bytes(n: u64) -> String {
    match n {
        0..10_000 => format!("{} B", count(n)),
        10_000..1_000_000 => format!("{:.1} kB", n as f64 / 1e3),
        _ => format!("{:.2} MB", n as f64 / 1e6),
    }
}

/// A factor: `3.4 times`.
pub fn times(factor: f64) -> String {
    let decimals = if factor < 9.95 { 2 } else { 1 };
    format!("{factor:.decimals$} times")
}

/// A share of the whole: `0.4 %`, `37 %`.
pub fn percent(share: f64) -> String {
    let p = share * 100.0;
    if p >= 9.95 { format!("{p:.0} %") } else { format!("{p:.1} %") }
}

/// A limit or a reading with about four significant digits and no needless zeros.
pub fn number(value: f64) -> String {
    if !value.is_finite() {
        return "\u{2013}".into();
    }
    let magnitude = value.abs();
    if magnitude >= 1000.0 {
        let sign = if value < 0.0 { "\u{2212}" } else { "" };
        return format!("{sign}{}", count(magnitude.round() as u64));
    }
    let decimals: usize = match magnitude {
        m if m >= 100.0 => 1,
        m if m >= 10.0 => 2,
        m if m >= 1.0 => 3,
        _ => 5,
    };
    let text = format!("{value:.decimals$}");
    text.trim_end_matches('0').trim_end_matches('.').replace('-', "\u{2212}")
}

/// A reading in a column whose entries are up to about `largest`: all with the same decimals.
pub fn aligned(value: f64, largest: f64) -> String {
    if !value.is_finite() {
        return "\u{2013}".into();
    }
    let decimals: usize = match largest.abs() {
        m if m >= 1000.0 => return number(value.round()),
        m if m >= 10.0 => 1,
        m if m >= 1.0 => 2,
        _ => 4,
    };
    format!("{value:.decimals$}").replace('-', "\u{2212}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_bounds_are_rounded_up() {
        let shown = [0.0, 0.0000412, 0.00025, 0.02, 2.51, 4.0e-16].map(small);
        assert_eq!(shown, ["0", "0.000042", "0.00025", "0.02", "2.6", "0.0000000000000004"]);
    }

    #[test]
    fn counts_are_grouped_from_the_right() {
        let plain = |n| count(n).replace('\u{202f}', " ");
        assert_eq!([plain(0), plain(999), plain(1000), plain(169_205)], ["0", "999", "1 000", "169 205"]);
    }

    #[test]
    fn durations_carry_over() {
        assert_eq!(duration(0.5324), "0.532 s");
        assert_eq!(duration(99.999), "1 min 40 s");
        assert_eq!(duration(3599.6), "1 h 00 min 00 s");
        assert_eq!(duration(f64::NAN), "\u{2013}");
    }

    #[test]
    fn lengths_and_sizes_change_unit() {
        assert_eq!([length(0.0), length(0.0042), length(42_790.6)], ["0.0 mm", "0.0042 mm", "42.79 m"]);
        assert_eq!([bytes(912), bytes(34_120), bytes(2_100_000)], ["912 B", "34.1 kB", "2.10 MB"]);
    }

    #[test]
    fn columns_share_their_decimals() {
        assert_eq!(
            [aligned(22.0, 80.0), aligned(7.329, 80.0), aligned(-0.04, 80.0)],
            ["22.0", "7.3", "\u{2212}0.0"]
        );
        assert_eq!(
            [aligned(4.8181, 6.0), aligned(0.5, 0.8), aligned(1234.5, 3e3)],
            ["4.82", "0.5000", "1\u{202f}235"]
        );
    }

    #[test]
    fn numbers_keep_four_digits_and_no_padding() {
        assert_eq!([number(0.01), number(150.0), number(12.345), number(0.0)], ["0.01", "150", "12.35", "0"]);
        assert_eq!(number(-400.0), "\u{2212}400");
        assert_eq!(number(-50_000.0), "\u{2212}50\u{202f}000");
    }
}
