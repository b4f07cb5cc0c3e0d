//! The host's side of a new image: asks, sends what is missing, has it tried, and keeps it when the drive is there again.

use planner::feed::messages::signed_frames;
use protocol::authentic::Key;
use protocol::bus::{BLOCK_BYTES, FrameSize, Node, Reassembler};
use protocol::message::{DriveMessage, HostMessage, Reject, decode};
use protocol::update::{CHUNK_BYTES, HASH_BYTES, Image, Progress, Update, UpdateFault};
use sha2::{Digest, Sha256};

use crate::bus::{Bus, Nanoseconds, NodeIndex};

/// How long an answer is waited for [ns].
const ANSWER_NS: Nanoseconds = 200_000_000;
/// How long between two looks at how far it has read [ns].
const READ_NS: Nanoseconds = 20_000_000;
/// Bytes that a message carries in classic frames: a block of few frames comes through a bad line more often.
const CLASSIC_BYTES: usize = 56;
/// How often it is asked again before the drive counts as silent.
const ATTEMPTS: u32 = 50;

/// Why an update has failed. The drive goes on with the image that it had.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UpdateError {
    /// There is nothing to send.
    #[error("the image is empty, or longer than 4 GiB")]
    Empty,
    /// The drive does not answer.
    #[error("the drive does not answer")]
    Silent,
    /// The drive has a key.
    #[error("the drive has a key, and this host does not sign with it")]
    Key,
    /// The drive refuses.
    #[error("the drive refuses: {0:?}")]
    Refused(UpdateFault),
    /// The drive has started up with the image that it had.
    #[error("the new image did not start up: the one before it runs")]
    RolledBack,
}

/// Where an update is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// The drive is asked who it is.
    Asking,
    /// The image goes to the drive; so many bytes are there.
    Sending(u32),
    /// The drive checks it; so many bytes are read.
    Checking(u32),
    /// The drive starts up with it.
    Restarting,
    /// It runs, and is told to stay.
    Keeping,
    /// It stays.
    Done,
}

/// What the drive is asked, until it answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Request {
    /// Who it is.
    Who,
    /// To take the image.
    Begin,
    /// To take bytes from here on.
    Data(u32),
    /// How far it has read.
    Read(u32),
    /// To start up with it.
    Try,
    /// Who it is, after that.
    Again,
    /// What runs.
    Confirm,
    /// To stay with it.
    Keep,
    /// Nothing any more.
    Nothing,
}

/// An update on its way.
#[derive(Debug)]
pub struct Updating {
    host: NodeIndex,
    node: Node,
    size: FrameSize,
    key: Option<Key>,
    counter: u64,
    bytes: Vec<u8>,
    image: Image,
    incoming: Reassembler<BLOCK_BYTES>,
    request: Request,
    boot: Option<u32>,
    asked: Option<Nanoseconds>,
    attempts: u32,
}

impl Updating {
    /// An update of the drive at `node`, under a key with a counter that is greater than those of all hosts before.
    ///
    /// # Errors
    /// The image is empty or too long.
    pub fn new(
        bytes: Vec<u8>,
        node: Node,
        size: FrameSize,
        key: Option<(Key, u64)>,
        bus: &mut dyn Bus,
    ) -> Result<Self, UpdateError> {
        let length =
            u32::try_from(bytes.len()).ok().filter(|length| *length > 0).ok_or(UpdateError::Empty)?;
        let image = Image { bytes: length, hash: Sha256::digest(&bytes).into() };
        Ok(Self {
            host: bus.attach(),
            node,
            size,
            key: key.map(|(key, _)| key),
            counter: key.map_or(0, |(_, counter)| counter),
            bytes,
            image,
            incoming: Reassembler::new(),
            request: Request::Who,
            boot: None,
            asked: None,
            attempts: 0,
        })
    }

    /// Where it is.
    pub fn stage(&self) -> Stage {
        match self.request {
            Request::Who => Stage::Asking,
            Request::Begin => Stage::Sending(0),
            Request::Data(next) => Stage::Sending(next),
            Request::Read(read) => Stage::Checking(read),
            Request::Try | Request::Again => Stage::Restarting,
            Request::Confirm | Request::Keep => Stage::Keeping,
            Request::Nothing => Stage::Done,
        }
    }

    /// Bytes of the image.
    pub fn length(&self) -> u32 {
        self.image.bytes
    }

    /// SHA-256 over it.
    pub fn hash(&self) -> [u8; HASH_BYTES] {
        self.image.hash
    }

    /// One turn; call it until [`Stage::Done`].
    ///
    /// # Errors
    /// The drive refuses, is silent, or runs the image that it had.
    pub fn turn(&mut self, bus: &mut dyn Bus, now: Nanoseconds) -> Result<(), UpdateError> {
        while let Some(received) = bus.receive(self.host) {
            let frame = received.frame;
            if frame.id() != self.node.from_drive() {
                continue;
            }
            if let Ok(Some((_, bytes))) = self.incoming.push(frame.data())
                && let Ok(message) = decode::<DriveMessage>(bytes)
                && let Some(next) = self.after(&message)?
            {
                (self.request, self.asked, self.attempts) = (next, None, 0);
            }
        }
        let patience = if matches!(self.request, Request::Read(_)) { READ_NS } else { ANSWER_NS };
        let waits = self.asked.is_some_and(|asked| now < asked + patience) || bus.waiting(self.host) > 0;
        if self.request == Request::Nothing || waits {
            return Ok(());
        }
        self.attempts += 1;
        if self.attempts > ATTEMPTS {
            return Err(UpdateError::Silent);
        }
        self.asked = Some(now);
        self.say(bus, now);
        Ok(())
    }

    /// What is to be asked after the drive has said something; `None`: the same again.
    fn after(&mut self, message: &DriveMessage) -> Result<Option<Request>, UpdateError> {
        Ok(match (self.request, message) {
            (Request::Who, DriveMessage::Identity(identity)) => {
                self.boot = Some(identity.boot);
                Some(Request::Begin)
            }
            (Request::Again, DriveMessage::Identity(identity)) => {
                (self.boot != Some(identity.boot)).then_some(Request::Confirm)
            }
            (_, DriveMessage::Reject { reason: Reject::Key, .. }) => return Err(UpdateError::Key),
            // It has lost what it had, or has started up already.
            (
                Request::Data(_) | Request::Read(_),
                DriveMessage::Reject { reason: Reject::Update(UpdateFault::Order), .. },
            ) => Some(Request::Begin),
            (Request::Try, DriveMessage::Reject { reason: Reject::Update(UpdateFault::Order), .. }) => {
                Some(Request::Again)
            }
            (_, DriveMessage::Reject { reason: Reject::Update(fault), .. }) => {
                return Err(UpdateError::Refused(*fault));
            }
            (request, DriveMessage::Update(progress)) => self.went(request, *progress)?,
            _ => None,
        })
    }

    fn went(&self, request: Request, progress: Progress) -> Result<Option<Request>, UpdateError> {
        use Request::{Again, Begin, Confirm, Data, Keep, Nothing, Read, Try};
        Ok(match (request, progress) {
            (Begin, Progress::Receiving { next }) => Some(Data(next)),
            (Data(at), Progress::Receiving { next }) => (next != at).then_some(Data(next)),
            (Begin | Data(_), Progress::Verifying { read }) => Some(Read(read)),
            (Read(at), Progress::Verifying { read }) => (read != at).then_some(Read(read)),
            (Begin | Data(_) | Read(_), Progress::Verified) => Some(Try),
            (Data(_) | Read(_), Progress::None | Progress::Trial) => Some(Begin),
            (Try, Progress::Restarting) => Some(Again),
            (Confirm, Progress::Trial) => Some(Keep),
            (Confirm, Progress::None) => return Err(UpdateError::RolledBack),
            (Keep, Progress::None) => Some(Nothing),
            _ => None,
        })
    }

    fn say(&mut self, bus: &mut dyn Bus, now: Nanoseconds) {
        let update = |step| HostMessage::Update(step);
        let most = match self.size {
            FrameSize::Classic => CLASSIC_BYTES,
            FrameSize::Fd => CHUNK_BYTES,
        };
        let chunk = |from: u32| {
            let from = from as usize;
            &self.bytes[from.min(self.bytes.len())..self.bytes.len().min(from + most)]
        };
        let message = match self.request {
            Request::Who | Request::Again => HostMessage::Identify,
            Request::Begin => update(Update::Begin(self.image)),
            Request::Data(offset) => update(Update::Data { offset, bytes: chunk(offset) }),
            Request::Read(_) | Request::Confirm => update(Update::Ask),
            Request::Try => update(Update::Try),
            Request::Keep => update(Update::Keep),
            Request::Nothing => return,
        };
        self.counter += 1;
        let id = self.node.to_drive();
        let frames = signed_frames(id, self.size, 0, &message, self.key.as_ref(), self.counter);
        frames.into_iter().for_each(|frame| bus.send(self.host, frame, now));
    }
}
