//! Drives on the level of messages, with tables whose limits are near what they need.

use firmware_core::axis::AxisConfig;
use firmware_core::evaluate::Cursor;
use firmware_core::player::Player;
use firmware_core::table::TableView;
use planner::feed::pack::Packed;
use protocol::bus::data;
use protocol::message::{DriveMessage, HostMessage, Part};
use protocol::power::PowerEvent;
use protocol::table::Limits;

use crate::tables::TICK_NS;

/// A number that the environment asks for.
pub fn asked(name: &str, default: u64) -> u64 {
    std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(default)
}

/// What an axis of a table needs, by sampling, and a quarter more; without a limit of jerk if it is not `jerky`.
///
/// # Panics
/// The table breaks a rule of the format.
#[allow(clippy::expect_used, reason = "tables of tests obey the format")]
pub fn limits_of(packed: &Packed, axis: usize, jerky: bool) -> Limits {
    let part = &packed.axes[axis];
    let view = TableView::new(&packed.header, &part.header, &packed.shared, &part.controls);
    let table = view.and_then(TableView::check).expect("the table obeys the format");
    let mut cursor = Cursor::new(&table).expect("the table was checked");
    let (mut time, mut most) = (0u64, [0.0f32; 3]);
    let mut before: Option<(u32, u64, f32)> = None;
    while time < table.duration() {
        let now = cursor.evaluate(&table, time).expect("the table was checked");
        most = [most[0].max(now.velocity.abs()), most[1].max(now.acceleration.abs()), most[2]];
        if let Some((span, then, old)) = before
            && span == cursor.span()
        {
            let seconds = (time - then) as f32 / (1u64 << 32) as f32;
            most[2] = most[2].max((now.acceleration - old).abs() / seconds);
        }
        before = Some((cursor.span(), time, now.acceleration));
        time += (cursor.duration() / 12).max(1);
    }
    let [velocity, acceleration, jerk] = most.map(|most| 1.25 * most.max(1.0));
    // An axis without a limit of jerk is soft by itself.
    Limits { velocity, acceleration, jerk: jerky.then_some(jerk) }
}

/// A drive under torque where the table of one axis begins.
pub fn player<'a>(
    packed: &Packed,
    axis: usize,
    limits: Limits,
    a: &'a mut [u8],
    b: &'a mut [u8],
) -> Player<'a> {
    let position = packed.axes[axis].header.start;
    let config = AxisConfig { position, ..AxisConfig::new(axis as u8, TICK_NS, limits) };
    let mut player = Player::new(config, a, b);
    player.handle(&HostMessage::Power(PowerEvent::Shutdown));
    player.handle(&HostMessage::Power(PowerEvent::EnableOperation));
    player
}

/// Sends a drive its table; whether it is ready to play it.
pub fn bring(player: &mut Player<'_>, packed: &Packed, axis: usize) -> bool {
    send(player, packed, axis);
    matches!(player.poll_answer(), Some(DriveMessage::Ready { .. }))
}

/// Sends a drive its table.
pub fn send(player: &mut Player<'_>, packed: &Packed, axis: usize) {
    let part = &packed.axes[axis];
    let table = packed.header.table;
    player.handle(&HostMessage::Open(packed.header));
    player.handle(&HostMessage::OpenAxis(part.header));
    for (kind, bytes, crc) in
        [(Part::Shared, &packed.shared, packed.shared_crc()), (Part::Axis, &part.controls, part.crc())]
    {
        for (k, bytes) in bytes.chunks(12 * data::UNIT).enumerate() {
            let (tag, unit) = (data::tag(table), 12 * k as u32);
            player.handle(&HostMessage::Data { tag, part: kind, unit, bytes });
        }
        player.handle(&HostMessage::Seal { table, part: kind, crc });
    }
}
