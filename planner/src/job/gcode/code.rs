//! G and M codes and their modal groups.

use std::fmt;

/// A G or M code, such as G59.1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Code {
    letter: u8,
    tenths: u16,
}

impl Code {
    /// G `tenths` / 10.
    pub(super) const fn g(tenths: u16) -> Self {
        Self { letter: b'G', tenths }
    }

    /// M `number`.
    pub(super) const fn m(number: u16) -> Self {
        Self { letter: b'M', tenths: number * 10 }
    }

    /// The code that a word stands for: one decimal at most, below 1000.
    pub(super) fn from_word(letter: u8, value: f64) -> Option<Self> {
        let tenths = (value * 10.0).round();
        // A decimal fraction times ten is whole up to the rounding of its reading.
        let whole = (value * 10.0 - tenths).abs() < 1e-9;
        (whole && (0.0..10_000.0).contains(&tenths)).then_some(Self { letter, tenths: tenths as u16 })
    }

    /// `G` or `M`.
    pub fn letter(self) -> char {
        char::from(self.letter)
    }

    /// The number times ten.
    pub fn tenths(self) -> u16 {
        self.tenths
    }
}

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.letter(), self.tenths / 10)?;
        match self.tenths % 10 {
            0 => Ok(()),
            tenth => write!(f, ".{tenth}"),
        }
    }
}

/// Codes of one group exclude each other in a block (RS-274/NGC, table 4).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Group {
    NonModal,
    Motion,
    Plane,
    Distance,
    ArcDistance,
    FeedMode,
    Units,
    CutterCompensation,
    ToolLength,
    Retract,
    CoordinateSystem,
    PathControl,
    ExactStop,
    Stop,
    ToolChange,
    Spindle,
    Mist,
    Coolant,
    Override,
}

/// Number of groups.
pub(super) const GROUPS: usize = Group::Override as usize + 1;

/// The group of a supported code.
pub(super) fn group_of(code: Code) -> Option<Group> {
    use Group as G;
    Some(match (code.letter, code.tenths) {
        (b'G', 40 | 100 | 280 | 281 | 300 | 301 | 530 | 920..=923) => G::NonModal,
        (b'G', 0 | 10 | 20 | 30 | 730 | 740 | 800 | 810 | 820 | 830 | 840 | 850 | 860 | 890) => G::Motion,
        (b'G', 170 | 180 | 190) => G::Plane,
        (b'G', 900 | 910) => G::Distance,
        (b'G', 901 | 911) => G::ArcDistance,
        (b'G', 930 | 940) => G::FeedMode,
        (b'G', 200 | 210) => G::Units,
        (b'G', 400) => G::CutterCompensation,
        (b'G', 430 | 490) => G::ToolLength,
        (b'G', 980 | 990) => G::Retract,
        (b'G', 540 | 550 | 560 | 570 | 580 | 590 | 591 | 592 | 593) => G::CoordinateSystem,
        (b'G', 610 | 611 | 640) => G::PathControl,
        (b'G', 90) => G::ExactStop,
        (b'M', 0 | 10 | 20 | 300 | 600) => G::Stop,
        (b'M', 60) => G::ToolChange,
        (b'M', 30 | 40 | 50) => G::Spindle,
        (b'M', 70) => G::Mist,
        (b'M', 80 | 90) => G::Coolant,
        (b'M', 480 | 490) => G::Override,
        _ => return None,
    })
}

/// What the printer dialect does with a code of 3-D printers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PrinterCode {
    /// The whole block is skipped.
    Skip,
    /// The rest of the line is free text; the block is skipped.
    SkipText,
}

/// Codes of 3-D printers (Marlin, RepRap) that move no axis and wait for no position.
pub(super) fn printer_code(code: Code) -> Option<PrinterCode> {
    if !code.tenths.is_multiple_of(10) && code.tenths / 10 != 862 {
        return None;
    }
    match (code.letter, code.tenths / 10) {
        (b'G', 11 | 29) => Some(PrinterCode::Skip),
        (b'M', 117 | 118 | 486) => Some(PrinterCode::SkipText),
        (
            b'M',
            17
            | 18
            | 73
            | 82
            | 83
            | 84
            | 104..=107
            | 109
            | 110
            | 111
            | 113
            | 114
            | 115
            | 116
            | 140
            | 141
            | 190
            | 191
            | 200
            | 201
            | 203..=205
            | 207..=209
            | 220
            | 221
            | 280
            | 300
            | 302
            | 400
            | 412
            | 413
            | 420
            | 500..=503
            | 572
            | 593
            | 862
            | 900
            | 907,
        ) => Some(PrinterCode::Skip),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_keep_one_decimal_and_nothing_else() {
        let shown = |v: f64| Code::from_word(b'G', v).map(|c| c.to_string());
        assert_eq!(shown(1.0).as_deref(), Some("G1"));
        assert_eq!(shown(59.3).as_deref(), Some("G59.3"));
        assert_eq!(shown(1.25), None);
        assert_eq!(shown(-1.0), None);
        assert_eq!(shown(1e9), None);
    }
}
