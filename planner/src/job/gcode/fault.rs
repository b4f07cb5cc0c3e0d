//! The reasons to refuse a part program.

use thiserror::Error;

use super::code::Code;

/// A reason with its place in the line.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Fault {
    pub(super) kind: ErrorKind,
    /// First byte of the place, from 0.
    pub(super) column: u32,
    /// Bytes of the place.
    pub(super) length: u32,
}

impl ErrorKind {
    pub(super) fn at(self, column: u32, length: u32) -> Fault {
        Fault { kind: self, column, length }
    }
}

/// What is wrong with a part program.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs, reason = "the fields are what the messages show")]
pub enum ErrorKind {
    /// The file cannot be opened or read.
    #[error("cannot be read: {reason}")]
    Unreadable { reason: String },
    /// The path names a directory.
    #[error("is a directory")]
    Directory,
    /// A byte that no text holds.
    #[error("binary data (byte 0x{byte:02x})")]
    Binary { byte: u8 },
    /// A line beyond the limit.
    #[error("line is longer than {limit_bytes} bytes")]
    LineTooLong { limit_bytes: usize },
    /// The program moves nothing.
    #[error("the program has no motion")]
    NoMotion,

    /// A character that starts nothing.
    #[error("unexpected {character:?}")]
    UnexpectedCharacter { character: char },
    /// A letter without its number.
    #[error("{letter} has no number")]
    MissingNumber { letter: char },
    /// A number that is none.
    #[error("the number of {letter} cannot be read")]
    MalformedNumber { letter: char },
    /// A number beyond all machines.
    #[error("the number of {letter} is too large")]
    NumberTooLarge { letter: char },
    /// A comment that never ends.
    #[error("comment is not closed")]
    UnclosedComment,
    /// A parenthesis inside a comment.
    #[error("comment inside a comment")]
    NestedComment,
    /// `#`.
    #[error("parameters (#) are not supported")]
    Parameter,
    /// `[`.
    #[error("expressions ([ ]) are not supported")]
    Expression,
    /// O-words.
    #[error("O-words (subprograms, loops, conditions) are not supported")]
    OWord,
    /// The checksum does not fit the line.
    #[error("checksum is {found}, the line has {computed}")]
    Checksum { found: u8, computed: u8 },
    /// The checksum is not a number up to 255 at the end of the line.
    #[error("checksum cannot be read")]
    MalformedChecksum,

    /// A word twice in a block.
    #[error("{letter} occurs twice in the block")]
    RepeatedWord { letter: char },
    /// A G or M code that is not supported.
    #[error("{code} is not supported")]
    UnsupportedCode { code: Code },
    /// A code of printers, without the printer dialect.
    #[error("{code} is a 3-D printer's code")]
    PrinterCode { code: Code },
    /// A code number that names nothing.
    #[error("{letter}{number} is not a code")]
    UnknownCode { letter: char, number: f64 },
    /// A letter that means nothing.
    #[error("word {letter} is not supported")]
    UnknownWord { letter: char },
    /// A word that no code of the block uses.
    #[error("word {letter} is not used by any code of the block")]
    UnusedWord { letter: char },
    /// Two codes of one modal group.
    #[error("{first} and {second} exclude each other in one block")]
    ModalConflict { first: Code, second: Code },
    /// Two codes that both need the axis words.
    #[error("{first} and {second} both take the axis words of the block")]
    AxisWordConflict { first: Code, second: Code },
    /// A machine without that axis.
    #[error("the machine has no axis {letter}")]
    AxisMissing { letter: char },
    /// Axis words that nothing uses.
    #[error("axis word {letter} without a motion mode")]
    NoMotionMode { letter: char },
    /// A number below zero.
    #[error("{letter} is {value}, below zero")]
    Negative { letter: char, value: f64 },
    /// A number that must be whole.
    #[error("{letter} is {value}, not a whole number")]
    NotInteger { letter: char, value: f64 },
    /// A number out of its range.
    #[error("{letter} is {value}, not in {min} to {max}")]
    OutOfRange { letter: char, value: f64, min: f64, max: f64 },
    /// A word that a code needs.
    #[error("{code} needs a word {letter}")]
    MissingWord { code: Code, letter: char },

    /// A feed move without a feed.
    #[error("no feed rate is set")]
    NoFeed,
    /// A feed of zero.
    #[error("feed rate is zero")]
    ZeroFeed,
    /// G93 without F in the block.
    #[error("inverse time feed (G93) needs F in every block that moves")]
    NoInverseTime,
    /// A position beyond the travel.
    #[error("axis {axis} would move to {value:.4} {unit}, outside its travel {min} to {max} {unit}")]
    OutsideTravel { axis: String, value: f64, min: f64, max: f64, unit: &'static str },

    /// An arc with neither centre nor radius.
    #[error("arc has neither centre ({words}) nor radius (R)")]
    NoArcCentre { words: &'static str },
    /// An arc with both centre and radius.
    #[error("arc has both a centre and a radius")]
    CentreAndRadius,
    /// An absolute centre needs both coordinates.
    #[error("absolute arc centre (G90.1) lacks {letter}")]
    IncompleteCentre { letter: char },
    /// A centre offset outside the plane.
    #[error("{letter} is outside the arc's plane ({plane})")]
    OutsidePlane { letter: char, plane: Code },
    /// An arc whose ends do not lie on one circle.
    #[error(
        "arc end radius {end_mm:.4} differs from start radius {start_mm:.4} by {:.4} mm (allowed {allowed_mm:.4})",
        (end_mm - start_mm).abs()
    )]
    RadiiDiffer { start_mm: f64, end_mm: f64, allowed_mm: f64 },
    /// A radius that does not reach the end point.
    #[error("arc radius {radius_mm:.4} mm is too small: the end is {:.4} mm away", 2.0 * half_chord_mm)]
    RadiusTooSmall { radius_mm: f64, half_chord_mm: f64 },
    /// A radius beyond all machines.
    #[error("arc radius {radius_mm:e} mm is too large")]
    RadiusTooLarge { radius_mm: f64 },
    /// A radius of zero.
    #[error("arc radius is zero")]
    ZeroRadius,
    /// An arc by radius that ends where it starts.
    #[error("arc given by R ends where it starts: its centre is undefined")]
    RadiusFullCircle,
    /// An arc over an axis that is no slide.
    #[error("arc needs linear axes, {axis} is rotary")]
    ArcAxisRotary { axis: char },

    /// G53 without G0 or G1.
    #[error("G53 needs G0 or G1")]
    MachineCoordinatesMode,
    /// G53 with G91.
    #[error("G53 cannot be used with incremental distances (G91)")]
    MachineCoordinatesIncremental,
    /// A tool that the machine file does not describe.
    #[error("tool {number} is not in the tool table")]
    ToolUnknown { number: u32 },
    /// A cycle that would drill upwards.
    #[error("cycle bottom {bottom:.4} is above its R plane {r:.4}")]
    CycleUpwards { bottom: f64, r: f64 },
    /// A cycle with an axis that it does not drive.
    #[error("axis word {letter} in a drilling cycle")]
    CycleAxis { letter: char },
    /// A cycle in inverse time.
    #[error("drilling cycle with inverse time feed (G93)")]
    CycleInverseTime,
    /// A peck so small that it would never end.
    #[error("the cycle takes {count} pecks for one hole")]
    TooManyPecks { count: f64, most: f64 },
    /// A printer code that shares its block.
    #[error("{code} shares its block with other codes")]
    PrinterCodeShares { code: Code },
}

impl ErrorKind {
    /// What to do about it.
    pub fn help(&self) -> String {
        use ErrorKind as K;
        match self {
            K::Unreadable { .. } => "give the path of a G-code file".into(),
            K::Directory => "give the path of a G-code file in it".into(),
            K::Binary { .. } | K::LineTooLong { .. } => "expected a text file with G-code".into(),
            K::NoMotion => "expected at least one move, such as G1 X10 F300".into(),
            K::UnexpectedCharacter { .. } => {
                "expected words of a letter and a number, and comments in ( ) or after ;".into()
            }
            K::MissingNumber { letter } => format!("expected a number after the letter, such as {letter}1.5"),
            K::MalformedNumber { .. } => {
                "expected digits with at most one sign and one point, such as -0.25".into()
            }
            K::NumberTooLarge { .. } => "expected at most 1000000000000".into(),
            K::UnclosedComment => "close the comment with ) on the same line".into(),
            K::NestedComment => "use one pair of parentheses per comment".into(),
            K::Parameter | K::Expression => {
                "write the number itself: have the CAM system post plain numbers".into()
            }
            K::OWord => "write the moves out: have the CAM system post without subprograms".into(),
            K::Checksum { .. } | K::MalformedChecksum => {
                "expected * and the exclusive or of all bytes before it, as the last word of the line".into()
            }
            K::RepeatedWord { .. } => "keep one of them, or split the block".into(),
            K::UnsupportedCode { code } => unsupported_help(*code).into(),
            K::PrinterCode { .. } => "use --dialect printer to skip printer codes".into(),
            K::UnknownCode { .. } => "expected a code such as G1, G54 or G59.1".into(),
            K::UnknownWord { letter: 'E' } => "use --dialect printer to skip extruder words".into(),
            K::UnusedWord { letter: 'D' } => {
                "cutter compensation is not supported: have the CAM system compensate for the tool".into()
            }
            K::UnknownWord { .. } | K::UnusedWord { .. } => {
                "remove the word, or add the code that it belongs to".into()
            }
            K::ModalConflict { .. } | K::AxisWordConflict { .. } => "split them over two blocks".into(),
            K::AxisMissing { .. } => "remove the word, or choose a machine with that axis (--machine)".into(),
            K::NoMotionMode { .. } => "start the block with G0, G1, G2, G3 or a cycle".into(),
            K::Negative { .. } => "expected zero or more".into(),
            K::NotInteger { .. } => "expected a whole number".into(),
            K::OutOfRange { min, max, .. } => format!("expected a number from {min} to {max}"),
            K::MissingWord { letter, .. } => format!("add {letter} to the block"),
            K::NoFeed | K::ZeroFeed => {
                "set F above zero before the first G1, G2 or G3, or use --ignore-feed".into()
            }
            K::NoInverseTime => "add F (1 / minutes that the block takes), or change to G94".into(),
            K::OutsideTravel { .. } => {
                "positions are machine positions (offsets included): check units (G20, G21), offsets and the \
                 machine file's travel"
                    .into()
            }
            K::NoArcCentre { words } => format!("add {words} (from the start to the centre) or R"),
            K::CentreAndRadius => "keep either the centre words or R".into(),
            K::IncompleteCentre { letter } => format!("add {letter}, or use offsets from the start (G91.1)"),
            K::OutsidePlane { .. } => "expected I J in G17, I K in G18, J K in G19: check the plane".into(),
            K::RadiiDiffer { .. } => {
                "check the centre words (offsets from the start unless G90.1), or use R".into()
            }
            K::RadiusTooSmall { .. } => "expected R of at least half the distance to the end point".into(),
            K::RadiusTooLarge { .. } => "use G1 for an arc that is straight".into(),
            K::ZeroRadius => "move the centre away from the start, or use G1".into(),
            K::RadiusFullCircle => "give the centre with I J K for a full circle".into(),
            K::ArcAxisRotary { .. } => "choose another plane (G17, G18, G19)".into(),
            K::MachineCoordinatesMode => "write G53 G0 or G53 G1".into(),
            K::MachineCoordinatesIncremental => "change to G90 first".into(),
            K::ToolUnknown { number } => {
                format!("add [[tool]] with number = {number} and length_mm to the machine file")
            }
            K::CycleUpwards { .. } => "expected Z below R".into(),
            K::CycleAxis { .. } => {
                "expected only X, Y and Z words; move the other axes in their own block".into()
            }
            K::CycleInverseTime => "change to G94 before the cycle".into(),
            K::TooManyPecks { most, .. } => format!("expected at most {most} pecks: choose a larger Q"),
            K::PrinterCodeShares { .. } => "write the code in a line of its own".into(),
        }
    }
}

/// What to do instead of a code.
fn unsupported_help(code: Code) -> &'static str {
    let (letter, tenths) = (code.letter(), code.tenths());
    match (letter, tenths) {
        ('G', 410..=429) => "have the CAM system compensate for the cutter radius and use G40",
        ('G', 50..=53 | 61 | 62) => "have the CAM system post splines as G1, G2 and G3 blocks",
        ('G', 70 | 80) => "lathe diameter and radius modes are not supported: remove the code",
        ('G', 330..=339 | 760 | 950 | 960 | 970) => {
            "motion tied to the spindle is not supported: use G94 feeds"
        }
        ('G', 380..=389 | 310) => "probing is not supported: remove the block",
        ('G', 700..=729) => "lathe cycles are not supported: have the CAM system post the moves",
        ('G', 870 | 880) => "use G81, G82, G83, G85, G86 or G89, or write the moves out",
        ('G', 431..=439) => "use G43 H with the tool table of the machine file",
        ('M', 980 | 990) => "subprograms are not supported: have the CAM system write the moves out",
        ('M', 1000..=1990) => "machine-specific codes are not supported: remove the block",
        _ => "remove the code, or have the CAM system post without it",
    }
}
