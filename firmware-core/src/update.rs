//! A new image comes in, is checked as it was stored, and is tried.
//!
//! Every call does a bounded piece of work: a message writes its bytes, and [`Updater::work`] reads back one chunk at a time
//! for the hash. What the memory is, and how the other image gets to run, is the board's ([`ImageStore`]).

use core::fmt;

use protocol::message::{DriveMessage, Reject};
use protocol::update::{CHUNK_BYTES, HASH_BYTES, Image, Progress, Update, UpdateFault};
use sha2::{Digest, Sha256};

/// The memory fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryFault;

/// Where the image lies that does not run, and what decides which one does.
pub trait ImageStore {
    /// Its place [bytes].
    fn room(&self) -> u32;

    /// Makes the place for an image of so many bytes ready to be written.
    ///
    /// # Errors
    /// The memory fails.
    fn erase(&mut self, bytes: u32) -> Result<(), MemoryFault>;

    /// Writes bytes of it, each of them once.
    ///
    /// # Errors
    /// The memory fails.
    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), MemoryFault>;

    /// Reads bytes of it.
    ///
    /// # Errors
    /// The memory fails.
    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), MemoryFault>;

    /// The image is to be tried with the next start-up ([`crate::boot::Record::trying`]).
    ///
    /// # Errors
    /// The memory fails.
    fn try_next(&mut self) -> Result<(), MemoryFault>;

    /// The image that runs is on trial.
    fn is_on_trial(&self) -> bool;

    /// The image that runs stays ([`crate::boot::Record::keeping`]).
    ///
    /// # Errors
    /// The memory fails.
    fn keep(&mut self) -> Result<(), MemoryFault>;
}

enum Phase {
    Idle,
    /// The motion is asked whether the power stage is off.
    Asking(Image),
    Receiving {
        image: Image,
        next: u32,
    },
    Verifying {
        image: Image,
        read: u32,
        hasher: Sha256,
    },
    Verified(Image),
    Restarting,
}

/// The coming of an image.
pub struct Updater<'a> {
    store: Option<&'a mut dyn ImageStore>,
    phase: Phase,
}

impl fmt::Debug for Updater<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Updater").field("progress", &self.progress()).finish_non_exhaustive()
    }
}

/// What a message asks of the rest of the drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Next {
    /// To say this.
    Say(DriveMessage),
    /// To ask the motion how it is, and to tell [`Updater::status`].
    Ask,
}

fn fault(fault: UpdateFault) -> DriveMessage {
    DriveMessage::Reject { table: 0, reason: Reject::Update(fault) }
}

impl<'a> Updater<'a> {
    /// With a place for images, or none.
    pub(crate) fn new(store: Option<&'a mut dyn ImageStore>) -> Self {
        Self { store, phase: Phase::Idle }
    }

    /// An image is on its way: nothing may be switched on.
    pub(crate) fn is_busy(&self) -> bool {
        !matches!(self.phase, Phase::Idle)
    }

    /// The drive has to start up anew, when everything is said.
    pub(crate) fn wants_restart(&self) -> bool {
        matches!(self.phase, Phase::Restarting)
    }

    fn progress(&self) -> Progress {
        match self.phase {
            Phase::Idle if self.store.as_ref().is_some_and(|store| store.is_on_trial()) => Progress::Trial,
            Phase::Idle | Phase::Asking(_) => Progress::None,
            Phase::Receiving { next, .. } => Progress::Receiving { next },
            Phase::Verifying { read, .. } => Progress::Verifying { read },
            Phase::Verified(_) => Progress::Verified,
            Phase::Restarting => Progress::Restarting,
        }
    }

    /// Takes a step; `open`: an epoch is open.
    pub(crate) fn handle(&mut self, step: Update<'_>, open: bool) -> Next {
        let result = match step {
            Update::Ask => Ok(()),
            _ if self.store.is_none() => Err(UpdateFault::Unable),
            Update::Begin(_) if open => Err(UpdateFault::Powered),
            Update::Begin(image) => match self.begin(image) {
                Ok(true) => return Next::Ask,
                Ok(false) => Ok(()),
                Err(fault) => Err(fault),
            },
            Update::Data { offset, bytes } => self.data(offset, bytes),
            Update::Try => self.try_next(),
            Update::Keep => self.keep(),
        };
        Next::Say(match result {
            Ok(()) => DriveMessage::Update(self.progress()),
            Err(reason) => fault(reason),
        })
    }

    /// Whether the motion has to be asked.
    fn begin(&mut self, image: Image) -> Result<bool, UpdateFault> {
        let same = match &self.phase {
            Phase::Receiving { image: old, .. }
            | Phase::Verifying { image: old, .. }
            | Phase::Verified(old) => *old == image,
            Phase::Restarting => return Err(UpdateFault::Order),
            Phase::Idle | Phase::Asking(_) => false,
        };
        if same {
            return Ok(false);
        }
        let room = self.store.as_ref().map_or(0, |store| store.room());
        if image.bytes == 0 || image.bytes > room {
            return Err(UpdateFault::Size { room });
        }
        self.phase = Phase::Asking(image);
        Ok(true)
    }

    /// What the motion has said: `off` is at rest without torque.
    pub(crate) fn status(&mut self, off: bool) -> Option<DriveMessage> {
        let Phase::Asking(image) = self.phase else { return None };
        self.phase = Phase::Idle;
        if !off {
            return Some(fault(UpdateFault::Powered));
        }
        let store = self.store.as_mut()?;
        Some(match store.erase(image.bytes) {
            Ok(()) => {
                self.phase = Phase::Receiving { image, next: 0 };
                DriveMessage::Update(self.progress())
            }
            Err(MemoryFault) => fault(UpdateFault::Memory),
        })
    }

    fn data(&mut self, offset: u32, bytes: &[u8]) -> Result<(), UpdateFault> {
        let Phase::Receiving { image, next } = self.phase else {
            // Repeats of what came last are answered as if they had been the first.
            return if self.is_busy() { Ok(()) } else { Err(UpdateFault::Order) };
        };
        let Some(store) = self.store.as_mut() else { return Err(UpdateFault::Unable) };
        let left = image.bytes.saturating_sub(next) as usize;
        if offset != next || bytes.is_empty() || bytes.len() > left {
            return Ok(());
        }
        if store.write(offset, bytes) == Err(MemoryFault) {
            self.phase = Phase::Idle;
            return Err(UpdateFault::Memory);
        }
        let next = next.saturating_add(bytes.len() as u32);
        self.phase = if next >= image.bytes {
            Phase::Verifying { image, read: 0, hasher: Sha256::new() }
        } else {
            Phase::Receiving { image, next }
        };
        Ok(())
    }

    /// Reads back another chunk; what there is to say when all were read.
    pub(crate) fn work(&mut self) -> Option<DriveMessage> {
        let Phase::Verifying { image, read, hasher } = &mut self.phase else { return None };
        let store = self.store.as_mut()?;
        let mut chunk = [0u8; CHUNK_BYTES];
        let count = (image.bytes.saturating_sub(*read) as usize).min(CHUNK_BYTES);
        let part = chunk.get_mut(..count)?;
        if store.read(*read, part) == Err(MemoryFault) {
            self.phase = Phase::Idle;
            return Some(fault(UpdateFault::Memory));
        }
        hasher.update(&*part);
        *read = read.saturating_add(count as u32);
        if *read < image.bytes {
            return None;
        }
        let found: [u8; HASH_BYTES] = core::mem::take(hasher).finalize().into();
        let right = found == image.hash;
        self.phase = if right { Phase::Verified(*image) } else { Phase::Idle };
        Some(if right { DriveMessage::Update(Progress::Verified) } else { fault(UpdateFault::Hash) })
    }

    fn try_next(&mut self) -> Result<(), UpdateFault> {
        match self.phase {
            Phase::Restarting => return Ok(()),
            Phase::Verified(_) => {}
            _ => return Err(UpdateFault::Order),
        }
        let store = self.store.as_mut().ok_or(UpdateFault::Unable)?;
        store.try_next().map_err(|MemoryFault| UpdateFault::Memory)?;
        self.phase = Phase::Restarting;
        Ok(())
    }

    fn keep(&mut self) -> Result<(), UpdateFault> {
        if self.is_busy() {
            return Err(UpdateFault::Order);
        }
        let store = self.store.as_mut().ok_or(UpdateFault::Unable)?;
        store.keep().map_err(|MemoryFault| UpdateFault::Memory)
    }

    /// An epoch has been opened, or torque given: there is no update any more.
    pub(crate) fn forget(&mut self) {
        self.phase = Phase::Idle;
    }
}
