//! What the host knows of one drive.

use protocol::bus::beat::Beat;
use protocol::bus::emergency::{Cause, Emergency, STOP_CODE};
use protocol::bus::stop::Stop;
use protocol::bus::{BLOCK_BYTES, Frame, Node, Reassembler};
use protocol::message::{DriveMessage, Identity, State, Status, Telemetry, decode};

/// What the host knows of one drive.
#[derive(Debug)]
pub struct Link {
    pub(super) address: Node,
    incoming: Reassembler<BLOCK_BYTES>,
    beat: Option<Beat>,
    status: Option<Status>,
    /// It has not been looked at.
    fresh: bool,
    telemetry: Option<Telemetry>,
    pub(super) identity: Option<Identity>,
}

/// What a frame of a drive has said.
#[derive(Debug)]
pub(super) enum Heard {
    Beat(Beat),
    /// It has started up.
    Boot,
    Message(DriveMessage),
}

impl Link {
    pub(super) fn new(address: Node) -> Self {
        let incoming = Reassembler::new();
        Self { address, incoming, beat: None, status: None, fresh: false, telemetry: None, identity: None }
    }

    /// Its address.
    pub fn address(&self) -> Node {
        self.address
    }

    /// Its last beat.
    pub fn beat(&self) -> Option<&Beat> {
        self.beat.as_ref()
    }

    /// Its last status.
    pub fn status(&self) -> Option<&Status> {
        self.status.as_ref()
    }

    /// Its last status, if that has come since the last call.
    pub(super) fn take_fresh_status(&mut self) -> Option<Status> {
        if core::mem::take(&mut self.fresh) { self.status } else { None }
    }

    /// How it has followed lately.
    pub fn telemetry(&self) -> Option<&Telemetry> {
        self.telemetry.as_ref()
    }

    /// Who it is.
    pub fn identity(&self) -> Option<&Identity> {
        self.identity.as_ref()
    }

    /// It stands still, with nothing to come.
    pub(super) fn has_come_to_rest(&self) -> bool {
        use State::{Holding, Idle, Ready, Receiving};
        let rests =
            |beat: Beat| matches!(beat.state, Holding | Idle | Ready | Receiving) && beat.fill_ms == 0;
        self.beat.is_some_and(rests)
    }

    /// It stands still, on its way or at the end of it.
    pub(super) fn stands(&self) -> bool {
        self.has_come_to_rest() || self.beat.is_some_and(|beat| beat.state == State::Held)
    }

    /// Somebody stops this drive, or it passes on that somebody has.
    pub(super) fn is_told_to_stop(&self, frame: &Frame) -> bool {
        let announced = || {
            let emergency = Emergency::parse(frame.data()).filter(|_| frame.id() == self.address.emergency());
            emergency.is_some_and(|e| e.code == STOP_CODE && e.cause == Cause::Told)
        };
        Stop::of(frame, self.address.number()).is_some() || announced()
    }

    /// Takes in a frame, if it is one of this drive's.
    pub(super) fn listen(&mut self, id: u16, data: &[u8]) -> Option<Heard> {
        if id == self.address.beat() {
            let beat = Beat::parse(data)?;
            self.beat = Some(beat);
            return Some(Heard::Beat(beat));
        }
        if id == self.address.heartbeat() && data == [0] {
            // It has started up anew: what was known of it is no longer true.
            (self.identity, self.beat, self.status) = (None, None, None);
            return Some(Heard::Boot);
        }
        if id != self.address.from_drive() {
            return None;
        }
        // A message with a lost frame is as good as none: silence is what the host acts on.
        let Ok(Some((_, bytes))) = self.incoming.push(data) else { return None };
        let message = decode::<DriveMessage>(bytes).ok()?;
        match message {
            DriveMessage::Status(status) => (self.status, self.fresh) = (Some(status), true),
            DriveMessage::Telemetry(telemetry) => self.telemetry = Some(telemetry),
            DriveMessage::Identity(identity) => self.identity = Some(identity),
            _ => {}
        }
        Some(Heard::Message(message))
    }
}
