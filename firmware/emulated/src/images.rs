//! Two images and the record of which one runs, modelled in memory that no start-up clears.
//!
//! The board has no flash that the emulator would keep, and runs the code that it was started with, whichever image the record
//! names: what is modelled is where images go, how they are checked, tried, kept and given up.

use core::mem::MaybeUninit;

use firmware_core::boot::{RECORD_BYTES, Record};
use firmware_core::update::{ImageStore, MemoryFault};

/// Place for one image [bytes].
pub const IMAGE_BYTES: usize = 256 * 1024;

/// What erased bytes are.
const ERASED: u8 = 0xff;

/// What outlives a start-up; any bits are a value of it.
#[derive(Debug)]
#[repr(C)]
pub struct Memory {
    copies: [[u8; RECORD_BYTES]; 2],
    images: [[u8; IMAGE_BYTES]; 2],
}

#[unsafe(link_section = ".uninit.images")]
static mut MEMORY: MaybeUninit<Memory> = MaybeUninit::uninit();

/// The images of this board.
#[derive(Debug)]
pub struct Images {
    memory: &'static mut Memory,
    second: bool,
}

impl Images {
    /// Starts up: a trial begins, or is over.
    ///
    /// # Safety
    /// At most one `Images` may exist.
    pub unsafe fn start() -> Self {
        let place = &raw mut MEMORY;
        // SAFETY: nobody else uses the place, and any bits are bytes.
        let memory = unsafe { &mut *place.cast::<Memory>() };
        let (record, older) = Record::newest(&memory.copies);
        let (next, second) = record.start();
        if next != record
            && let Some(copy) = memory.copies.get_mut(older)
        {
            *copy = next.to_bytes();
        }
        Self { memory, second }
    }

    fn other(&mut self) -> &mut [u8; IMAGE_BYTES] {
        let [first, second] = &mut self.memory.images;
        if self.second { first } else { second }
    }

    fn record(&mut self, change: impl FnOnce(Record) -> Record) {
        let (record, older) = Record::newest(&self.memory.copies);
        let next = change(record);
        if next != record
            && let Some(copy) = self.memory.copies.get_mut(older)
        {
            *copy = next.to_bytes();
        }
    }
}

impl ImageStore for Images {
    fn room(&self) -> u32 {
        IMAGE_BYTES as u32
    }

    fn erase(&mut self, bytes: u32) -> Result<(), MemoryFault> {
        self.other().get_mut(..bytes as usize).ok_or(MemoryFault)?.fill(ERASED);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), MemoryFault> {
        let from = offset as usize;
        let place = self.other().get_mut(from..).and_then(|rest| rest.get_mut(..bytes.len()));
        // Bits can be cleared only.
        place.ok_or(MemoryFault)?.iter_mut().zip(bytes).for_each(|(place, byte)| *place &= byte);
        Ok(())
    }

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), MemoryFault> {
        let from = offset as usize;
        let place = self.other().get(from..).and_then(|rest| rest.get(..bytes.len()));
        place.ok_or(MemoryFault)?.iter().zip(bytes).for_each(|(byte, place)| *place = *byte);
        Ok(())
    }

    fn try_next(&mut self) -> Result<(), MemoryFault> {
        self.record(Record::trying);
        Ok(())
    }

    fn is_on_trial(&self) -> bool {
        Record::newest(&self.memory.copies).0.trial
    }

    fn keep(&mut self) -> Result<(), MemoryFault> {
        self.record(Record::keeping);
        Ok(())
    }
}
