//! What the proof image and the host both do, to the bit: tables played at their tick, motions planned from random states.
//!
//! The host includes this very file; it needs nothing but the core and `protocol`.

use firmware_core::double_s::{Bounds, DoubleSError, MotionLimits, State, plan};
use firmware_core::evaluate::Cursor;
use firmware_core::table::TableView;
use firmware_core::time::PathClock;
use protocol::checksum::Fnv64;
use protocol::table::{AxisHeader, TableHeader};

/// A table as the image carries it: headers as postcard, then streams, each with its length before it (u32, little-endian).
#[derive(Clone, Copy, Debug)]
pub struct Stored<'a> {
    bytes: &'a [u8],
}

impl<'a> Stored<'a> {
    /// All tables in `bytes`.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes }
    }
}

impl<'a> Iterator for Stored<'a> {
    type Item = [&'a [u8]; 4];

    fn next(&mut self) -> Option<Self::Item> {
        let mut parts = [&[][..]; 4];
        for part in &mut parts {
            let (length, rest) = self.bytes.split_first_chunk::<4>()?;
            let (bytes, rest) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
            (*part, self.bytes) = (bytes, rest);
        }
        Some(parts)
    }
}

/// What playing has come to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Played {
    /// Set-points.
    pub setpoints: u64,
    /// Hash over all of them: position, and the bits of velocity and acceleration.
    pub hash: u64,
}

/// Proves and plays every table; `around` is put round each proof and each set-point, with the number of spans or `None`.
///
/// `None`: a table is refused.
pub fn play(bytes: &[u8], mut around: impl FnMut(Option<u32>, &mut dyn FnMut())) -> Option<Played> {
    let (mut hash, mut setpoints) = (Fnv64::new(), 0u64);
    for [header, axis, shared, controls] in Stored::new(bytes) {
        let header: TableHeader = protocol::message::decode(header).ok()?;
        let axis: AxisHeader = protocol::message::decode(axis).ok()?;
        let view = TableView::new(&header, &axis, shared, controls).ok()?;
        let mut checked = None;
        around(Some(header.spans), &mut || checked = view.prove(None).ok());
        let table = checked?;
        let mut cursor = Cursor::new(&table).ok()?;
        let mut clock = PathClock::new(header.tick_ns);
        loop {
            let mut setpoint = None;
            around(None, &mut || setpoint = cursor.evaluate(&table, clock.time()).ok());
            let s = setpoint?;
            clock.advance();
            setpoints += 1;
            hash = hash
                .with(&s.position.to_le_bytes())
                .with(&s.velocity.to_bits().to_le_bytes())
                .with(&s.acceleration.to_bits().to_le_bytes());
            if s.done {
                break;
            }
        }
    }
    Some(Played { setpoints, hash: hash.finish() })
}

/// What planning has come to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Planned {
    /// Motions.
    pub plans: u32,
    /// Refused for the arithmetic's sake.
    pub imprecise: u32,
    /// Hash over the durations and jerks of their segments.
    pub hash: u64,
}

/// Plans `count` random motions; `around` is put round each.
pub fn plan_moves(count: u32, mut around: impl FnMut(&mut dyn FnMut())) -> Planned {
    let mut chance = Chance(0x9e37_79b9_7f4a_7c15);
    let mut hash = Fnv64::new();
    let mut planned = Planned::default();
    for _ in 0..count {
        let limits = MotionLimits {
            velocity: Bounds { min: -chance.size(), max: chance.size() },
            acceleration: Bounds { min: -10.0 * chance.size(), max: 10.0 * chance.size() },
            jerk: Bounds { min: -100.0 * chance.size(), max: 100.0 * chance.size() },
        };
        let mut state = |reach: f32, share: f32| State {
            position: reach * chance.sway(),
            velocity: limits.velocity.max * share * chance.sway(),
            acceleration: limits.acceleration.max * share * chance.sway(),
        };
        // Starts reach beyond their limits, targets keep well within.
        let (from, to) = (state(3.0, 1.3), state(3.0, 0.4));
        let mut found = Err(DoubleSError::Precision);
        around(&mut || found = plan(&from, &to, &limits));
        match found {
            Ok(profile) => {
                planned.plans += 1;
                for segment in profile.segments() {
                    hash = hash
                        .with(&segment.duration.to_bits().to_le_bytes())
                        .with(&segment.jerk.to_bits().to_le_bytes());
                }
            }
            Err(DoubleSError::Precision) => planned.imprecise += 1,
            Err(_) => {}
        }
    }
    planned.hash = hash.finish();
    planned
}

/// Random numbers by Marsaglia's xorshift (13, 7, 17), the same everywhere.
struct Chance(u64);

impl Chance {
    fn unit(&mut self) -> f32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 40) as f32 / (1u32 << 24) as f32
    }

    /// Between -1 and 1; one in eight is 0.
    fn sway(&mut self) -> f32 {
        if self.unit() < 0.125 { 0.0 } else { 2.0 * self.unit() - 1.0 }
    }

    /// Over a decade.
    fn size(&mut self) -> f32 {
        let x = self.unit();
        0.3 + 2.7 * x * x
    }
}
