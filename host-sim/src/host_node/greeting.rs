//! How an epoch is opened: the host asks every drive who it is, refuses those that do not fit, and opens one epoch with all.

use planner::feed::pack::Packed;
use protocol::message::{Identity, Reject};
use protocol::schema;
use protocol::table::FORMAT_VERSION;

use super::command::Command;
use super::link::Link;
use super::{HostError, MAX_ROUNDS};

/// In what a drive does not fit.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Mismatch {
    /// It speaks another version of the protocol.
    #[error("its messages have schema {found:#018x}, this host's {:#018x}", schema::HASH)]
    Schema {
        /// The drive's.
        found: u64,
    },
    /// It plays another table format.
    #[error("it plays table format {found}, this host sends {FORMAT_VERSION}")]
    Format {
        /// The drive's.
        found: u8,
    },
    /// It ticks otherwise than the job was planned for.
    #[error("its control tick is {found} ns, the job is planned for {wanted} ns")]
    Tick {
        /// The drive's [ns].
        found: u32,
        /// The job's [ns].
        wanted: u32,
    },
    /// It is another axis.
    #[error("it is axis {found} of its machine")]
    Axis {
        /// Which one it is.
        found: u8,
    },
    /// The job was planned for more than it may do.
    #[error("the job is planned for limits above its own")]
    Limits,
    /// A table does not fit its memory.
    #[error("a table of {needed} bytes does not fit its {room} bytes")]
    Room {
        /// What the table takes [bytes].
        needed: u64,
        /// What the drive has [bytes].
        room: u32,
    },
    /// It has a key, and the host has none or another one.
    #[error("it has a key, and this host does not sign with it")]
    Key,
    /// It is busy with another host.
    #[error("another host has it in use, or it still moves")]
    InUse,
}

/// The opening of an epoch.
#[derive(Debug, Default)]
pub(super) struct Greeting {
    epoch: Option<u16>,
    /// The newest one that any drive knows.
    newest: u16,
    begun: u128,
    open: bool,
    next: u64,
    rounds: u32,
    busy: Option<Reject>,
}

impl Greeting {
    pub(super) fn epoch(&self) -> u16 {
        self.epoch.unwrap_or(self.newest)
    }

    pub(super) fn is_open(&self) -> bool {
        self.open
    }

    /// The epoch has ended.
    pub(super) fn close(&mut self) {
        self.newest = self.epoch();
        *self = Self { newest: self.newest, next: self.next, ..Self::default() };
    }

    /// A drive has opened an epoch.
    pub(super) fn begun(&mut self, axis: usize, epoch: u16) {
        if Some(epoch) == self.epoch {
            self.begun |= 1 << axis;
            self.rounds = 0;
        }
    }

    /// A drive has refused to.
    pub(super) fn refused(&mut self, link: &mut Link, reason: Reject) {
        match reason {
            Reject::Epoch { epoch } => {
                // All are asked again, with a newer one.
                if newer(epoch, self.newest) {
                    self.newest = epoch;
                }
                if self.epoch.is_some_and(|own| !newer(own, epoch)) {
                    (self.epoch, self.begun) = (None, 0);
                }
            }
            Reject::Boot => link.identity = None,
            reason => self.busy = Some(reason),
        }
    }

    /// What is to be said next.
    pub(super) fn proceed(
        &mut self,
        drives: &mut [Link],
        needs: Option<&Packed>,
        tick_ns: u32,
        tick: u64,
        patience: u64,
    ) -> Result<Vec<Command>, HostError> {
        let all = if drives.len() < 128 { (1u128 << drives.len()) - 1 } else { u128::MAX };
        if self.epoch.is_some() && self.begun == all {
            self.open = true;
            return Ok(Vec::new());
        }
        if tick < self.next {
            return Ok(Vec::new());
        }
        self.next = tick + patience;
        self.rounds += 1;
        if let Some(axis) = drives.iter().position(|link| link.identity.is_none()) {
            return if self.rounds > MAX_ROUNDS {
                Err(HostError::Silent { axis })
            } else {
                Ok(vec![Command::Identify])
            };
        }
        for (axis, link) in drives.iter().enumerate() {
            let Some(identity) = &link.identity else { continue };
            let table = || needs.and_then(|packed| unfit_for(identity, packed, axis));
            if let Some(mismatch) = unfit(identity, tick_ns, axis).or_else(table) {
                return Err(HostError::Mismatch { axis, mismatch });
            }
            if newer(identity.epoch, self.newest) {
                self.newest = identity.epoch;
            }
        }
        let silent = (0..drives.len()).find(|axis| self.begun >> axis & 1 == 0).unwrap_or(0);
        if self.rounds > MAX_ROUNDS {
            return Err(match self.busy {
                Some(_) => HostError::Mismatch { axis: silent, mismatch: Mismatch::InUse },
                None => HostError::Silent { axis: silent },
            });
        }
        let epoch = *self.epoch.get_or_insert(self.newest.wrapping_add(1));
        let members = drives.iter().fold(0u128, |set, link| set | 1 << (link.address.number() - 1));
        let asked = drives.iter().enumerate().filter(|(axis, _)| self.begun >> axis & 1 == 0);
        Ok(asked
            .filter_map(|(drive, link)| {
                let boot = link.identity.as_ref()?.boot;
                Some(Command::Begin { drive, boot, members, epoch })
            })
            .collect())
    }
}

/// Serial numbers: newer is what is less than half the circle ahead.
fn newer(a: u16, b: u16) -> bool {
    let ahead = a.wrapping_sub(b);
    ahead != 0 && ahead <= u16::MAX / 2
}

/// In what a drive does not fit at all.
fn unfit(identity: &Identity, tick_ns: u32, axis: usize) -> Option<Mismatch> {
    if identity.schema != schema::HASH {
        Some(Mismatch::Schema { found: identity.schema })
    } else if identity.format != FORMAT_VERSION {
        Some(Mismatch::Format { found: identity.format })
    } else if identity.tick_ns != tick_ns {
        Some(Mismatch::Tick { found: identity.tick_ns, wanted: tick_ns })
    } else if usize::from(identity.axis) != axis {
        Some(Mismatch::Axis { found: identity.axis })
    } else {
        None
    }
}

/// In what a drive does not fit a table.
fn unfit_for(identity: &Identity, packed: &Packed, axis: usize) -> Option<Mismatch> {
    let header = &packed.header;
    let Some(part) = packed.axes.get(axis) else { return Some(Mismatch::Axis { found: identity.axis }) };
    let (asked, has) = (part.header.limits, identity.limits);
    let jerk = match (asked.jerk, has.jerk) {
        (_, None) => true,
        (Some(asked), Some(has)) => asked <= has,
        (None, Some(_)) => false,
    };
    let needed = header.shared_bytes() + u64::from(part.header.control_bytes);
    if !(asked.velocity <= has.velocity && asked.acceleration <= has.acceleration && jerk) {
        Some(Mismatch::Limits)
    } else if needed > u64::from(identity.room) {
        Some(Mismatch::Room { needed, room: identity.room })
    } else {
        None
    }
}
