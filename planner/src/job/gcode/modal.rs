//! What stays in force from block to block.

use super::code::Code;
use super::offsets::Offsets;
use crate::job::program::Corner;

/// Millimetres in an inch.
pub(super) const MM_PER_INCH: f64 = 25.4;

/// The plane of arcs and cycles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Plane {
    Xy,
    Zx,
    Yz,
}

impl Plane {
    /// Letters of the plane's two axes in right-handed order, and of the axis normal to it.
    pub(super) fn letters(self) -> ([u8; 2], u8) {
        match self {
            Plane::Xy => (*b"XY", b'Z'),
            Plane::Zx => (*b"ZX", b'Y'),
            Plane::Yz => (*b"YZ", b'X'),
        }
    }

    /// Letters of the centre words along the plane's axes, and of the one that has no meaning in it.
    pub(super) fn centre_letters(self) -> ([u8; 2], u8) {
        match self {
            Plane::Xy => (*b"IJ", b'K'),
            Plane::Zx => (*b"KI", b'J'),
            Plane::Yz => (*b"JK", b'I'),
        }
    }

    pub(super) fn code(self) -> Code {
        match self {
            Plane::Xy => Code::g(170),
            Plane::Zx => Code::g(180),
            Plane::Yz => Code::g(190),
        }
    }
}

/// What a block with axis words does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Motion {
    /// G80, or nothing said yet.
    None,
    /// G0.
    Rapid,
    /// G1.
    Line,
    /// G2, G3.
    Arc { clockwise: bool },
    /// G73, G74, G81 to G89.
    Cycle(Code),
}

/// A feed as programmed, in both readings it can have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FeedRate {
    /// For moves of linear axes [mm/s].
    pub(super) mm_per_s: f64,
    /// For moves of rotary axes alone [deg/s].
    pub(super) deg_per_s: f64,
}

/// Words of a drilling cycle that stay in force while cycles follow each other.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Sticky {
    /// R, Z (or what the normal of the plane is called) and Q as programmed [mm].
    pub(super) retract: Option<f64>,
    pub(super) bottom: Option<f64>,
    pub(super) peck: Option<f64>,
    /// P [s].
    pub(super) dwell: Option<f64>,
}

/// Everything that stays in force.
#[derive(Clone, Debug)]
pub(super) struct Modal {
    pub(super) motion: Motion,
    pub(super) plane: Plane,
    /// Millimetres per linear program unit.
    pub(super) unit_mm: f64,
    /// G20 or G21 has been said.
    pub(super) unit_said: bool,
    /// G91.
    pub(super) incremental: bool,
    /// G90.1.
    pub(super) absolute_centre: bool,
    /// G93.
    pub(super) inverse_time: bool,
    pub(super) feed: Option<FeedRate>,
    pub(super) corner: Corner,
    /// G99.
    pub(super) retract_to_r: bool,
    /// Position along the normal when the running series of cycles began (G98) [mm].
    pub(super) cycle_level: f64,
    pub(super) sticky: Sticky,
    pub(super) offsets: Offsets,
    pub(super) spindle_on: bool,
    pub(super) spindle_speed: f64,
    pub(super) tool: u32,
}

impl Modal {
    pub(super) fn new(corner: Corner) -> Self {
        Self {
            motion: Motion::None,
            plane: Plane::Xy,
            unit_mm: 1.0,
            unit_said: false,
            incremental: false,
            absolute_centre: false,
            inverse_time: false,
            feed: None,
            corner,
            retract_to_r: false,
            cycle_level: 0.0,
            sticky: Sticky::default(),
            offsets: Offsets::default(),
            spindle_on: false,
            spindle_speed: 0.0,
            tool: 0,
        }
    }
}
