//! What the proof image and the host both do, to the bit: tables played at their tick, motions planned from random states.
//!
//! The host includes this very file; it needs nothing but the core and `protocol`.

use firmware_core::axis::AxisConfig;
use firmware_core::double_s::{Bounds, DoubleSError, MotionLimits, State, plan};
use firmware_core::evaluate::{Cursor, Setpoint};
use firmware_core::player::Player;
use firmware_core::table::TableView;
use firmware_core::time::PathClock;
use protocol::bus::data;
use protocol::checksum::Fnv64;
use protocol::message::{HostMessage, Part, part_crc};
use protocol::power::PowerEvent;
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

/// Something whose cost is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Work {
    /// The proof of a table of so many spans.
    Proof(u32),
    /// A set-point within a span, without what is around it.
    Evaluate,
    /// A set-point that begins a span.
    Span,
    /// A control tick: a table at rate 1.
    Tick,
    /// A control tick in which a table begins or has ended.
    End,
    /// A control tick at another rate.
    Override,
    /// A control tick off the path, and the one that plans it.
    Fallback,
    /// A motion.
    Plan,
}

/// What playing has come to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Played {
    /// Set-points.
    pub setpoints: u64,
    /// Hash over all of them: position, and the bits of velocity and acceleration.
    pub hash: u64,
}

/// Proves and evaluates every table, tick by tick; `around` is put round each proof and each set-point.
///
/// `None`: a table is refused.
pub fn evaluate(bytes: &[u8], mut around: impl FnMut(&mut dyn FnMut() -> Work)) -> Option<Played> {
    let (mut hash, mut setpoints) = (Fnv64::new(), 0u64);
    for [header, axis, shared, controls] in Stored::new(bytes) {
        let header: TableHeader = protocol::message::decode(header).ok()?;
        let axis: AxisHeader = protocol::message::decode(axis).ok()?;
        let view = TableView::new(&header, &axis, shared, controls).ok()?;
        let mut checked = None;
        around(&mut || {
            checked = view.prove(None).ok();
            Work::Proof(header.spans)
        });
        let table = checked?;
        let mut cursor = Cursor::new(&table).ok()?;
        let mut clock = PathClock::new(header.tick_ns);
        loop {
            let mut setpoint = None;
            let span = cursor.span();
            around(&mut || {
                setpoint = cursor.evaluate(&table, clock.time()).ok();
                if cursor.span() == span { Work::Evaluate } else { Work::Span }
            });
            let s = setpoint?;
            clock.advance();
            setpoints += 1;
            hash = s.hashed(hash);
            if s.done {
                break;
            }
        }
    }
    Some(Played { setpoints, hash: hash.finish() })
}

/// Plays every table on a drive, with overrides, holds, quick stops and moves on the way; `around` is put round each tick.
///
/// `None`: a table is refused.
pub fn drive(
    bytes: &[u8],
    [a, b]: [&mut [u8]; 2],
    mut around: impl FnMut(&mut dyn FnMut() -> Work),
) -> Option<Played> {
    let (mut hash, mut setpoints) = (Fnv64::new(), 0u64);
    let mut chance = Chance(0x1234_5678_9abc_def1);
    for [header, axis, shared, controls] in Stored::new(bytes) {
        let header: TableHeader = protocol::message::decode(header).ok()?;
        let axis: AxisHeader = protocol::message::decode(axis).ok()?;
        let config =
            AxisConfig { position: axis.start, ..AxisConfig::new(axis.axis, header.tick_ns, axis.limits) };
        let mut player = Player::new(config, &mut *a, &mut *b);
        let table = header.table;
        for event in [PowerEvent::Shutdown, PowerEvent::EnableOperation] {
            player.handle(&HostMessage::Power(event));
        }
        player.handle(&HostMessage::Open(header));
        player.handle(&HostMessage::OpenAxis(axis));
        let sealed = [
            (Part::Shared, shared, part_crc(&header, &[shared]).ok()?),
            (Part::Axis, controls, part_crc(&axis, &[controls]).ok()?),
        ];
        for (part, bytes, crc) in sealed {
            let mut unit = 0u32;
            for bytes in bytes.chunks(12 * data::UNIT) {
                player.handle(&HostMessage::Data { tag: data::tag(table), part, unit, bytes });
                unit += 12;
            }
            player.handle(&HostMessage::Seal { table, part, crc });
        }
        player.handle(&HostMessage::Start { table, tick: 0 });
        let end = player.status().fill;
        let instant = |chance: &mut Chance| (end as f32 * chance.unit()) as u64;
        let (change, stop) = (instant(&mut chance), instant(&mut chance));
        // One table in three is played as it is, one at another rate, one is left on the way.
        let fate = (chance.unit() * 3.0) as u8;
        let permille = if chance.unit() < 0.5 { 0 } else { (chance.unit() * 1000.0) as u16 };
        if fate > 0 {
            player.handle(&HostMessage::Override { permille, tick: change, number: 0 });
        }
        let mut tick = 0u64;
        let mut returns = false;
        loop {
            if fate == 1 && tick == change + 600 {
                player.handle(&HostMessage::Override { permille: 1000, tick, number: 0 });
            }
            let stops = fate == 2 && tick == stop;
            if stops {
                player.handle(&HostMessage::QuickStop);
            }
            let plain = fate == 0 || tick <= change;
            let mut s = Setpoint::at_rest(0);
            around(&mut || {
                s = player.tick();
                if fate == 2 && tick >= stop {
                    Work::Fallback
                } else if tick == 0 || s.done {
                    Work::End
                } else if plain {
                    Work::Tick
                } else {
                    Work::Override
                }
            });
            tick += 1;
            setpoints += 1;
            hash = s.hashed(hash);
            if s.done && (fate < 2 || returns) {
                break;
            }
            if s.done && tick > stop {
                returns = true;
                player.handle(&HostMessage::Power(PowerEvent::EnableOperation));
                player.handle(&HostMessage::MoveTo { position: axis.end, velocity: None });
            }
        }
        let status = player.status();
        if status.fault.is_some() || status.position != axis.end {
            return None;
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
pub fn plan_moves(count: u32, mut around: impl FnMut(&mut dyn FnMut() -> Work)) -> Planned {
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
        around(&mut || {
            found = plan(&from, &to, &limits);
            Work::Plan
        });
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
