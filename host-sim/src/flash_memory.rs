//! Memory for two images and the record that says which one starts up, as a board's flash would be: power may fail at any byte.

use std::cell::RefCell;
use std::rc::Rc;

use firmware_core::boot::{RECORD_BYTES, Record};
use firmware_core::update::{ImageStore, MemoryFault};

/// What erased bytes are.
const ERASED: u8 = 0xff;

/// Two images and the record, twice.
#[derive(Clone, Debug)]
pub struct FlashMemory {
    images: [Vec<u8>; 2],
    lengths: [usize; 2],
    copies: [[u8; RECORD_BYTES]; 2],
    second: bool,
    /// Bytes that can be written or erased before power fails; none: it does not.
    power: Option<u64>,
}

impl FlashMemory {
    /// With places of so many bytes, and an image in the first.
    pub fn new(room: usize, image: &[u8]) -> Self {
        let mut first = vec![ERASED; room.max(image.len())];
        first[..image.len()].copy_from_slice(image);
        Self {
            images: [first, vec![ERASED; room]],
            lengths: [image.len(), 0],
            copies: [[ERASED; RECORD_BYTES]; 2],
            second: false,
            power: None,
        }
    }

    /// Power comes, and fails after so many bytes were changed, if it does. The image that runs now.
    pub fn start(&mut self, power: Option<u64>) -> &[u8] {
        self.power = power;
        let (record, older) = Record::newest(&self.copies);
        let (next, second) = record.start();
        if next != record && self.write_record(older, next).is_err() {
            // Power has failed before anything ran.
            return &[];
        }
        self.second = second;
        let which = usize::from(second);
        &self.images[which][..self.lengths[which]]
    }

    /// Power has failed.
    pub fn is_dead(&self) -> bool {
        self.power == Some(0)
    }

    fn spend(&mut self) -> Result<(), MemoryFault> {
        match &mut self.power {
            Some(0) => Err(MemoryFault),
            Some(left) => {
                *left -= 1;
                Ok(())
            }
            None => Ok(()),
        }
    }

    fn write_record(&mut self, which: usize, record: Record) -> Result<(), MemoryFault> {
        for (k, byte) in record.to_bytes().into_iter().enumerate() {
            self.spend()?;
            self.copies[which][k] = byte;
        }
        Ok(())
    }

    fn record(&mut self, change: impl FnOnce(Record) -> Record) -> Result<(), MemoryFault> {
        let (record, older) = Record::newest(&self.copies);
        let next = change(record);
        if next == record { Ok(()) } else { self.write_record(older, next) }
    }

    /// The place of the image that does not run.
    fn other(&mut self) -> usize {
        usize::from(!self.second)
    }
}

impl ImageStore for FlashMemory {
    fn room(&self) -> u32 {
        let which = usize::from(!self.second);
        u32::try_from(self.images[which].len()).unwrap_or(u32::MAX)
    }

    fn erase(&mut self, bytes: u32) -> Result<(), MemoryFault> {
        let which = self.other();
        for k in 0..bytes as usize {
            self.spend()?;
            *self.images[which].get_mut(k).ok_or(MemoryFault)? = ERASED;
        }
        self.lengths[which] = bytes as usize;
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), MemoryFault> {
        let which = self.other();
        for (k, byte) in bytes.iter().enumerate() {
            self.spend()?;
            let place = self.images[which].get_mut(offset as usize + k).ok_or(MemoryFault)?;
            // Bits can be cleared only.
            *place &= byte;
        }
        Ok(())
    }

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), MemoryFault> {
        let which = self.other();
        let from = offset as usize;
        let found = self.images[which].get(from..from + bytes.len()).ok_or(MemoryFault)?;
        bytes.copy_from_slice(found);
        if self.is_dead() { Err(MemoryFault) } else { Ok(()) }
    }

    fn try_next(&mut self) -> Result<(), MemoryFault> {
        self.record(Record::trying)
    }

    fn is_on_trial(&self) -> bool {
        Record::newest(&self.copies).0.trial
    }

    fn keep(&mut self) -> Result<(), MemoryFault> {
        self.record(Record::keeping)
    }
}

/// A memory that outlives the drive that uses it.
#[derive(Clone, Debug)]
pub struct SharedFlash(Rc<RefCell<FlashMemory>>);

impl SharedFlash {
    /// Shares a memory.
    pub fn new(memory: FlashMemory) -> Self {
        Self(Rc::new(RefCell::new(memory)))
    }

    /// As [`FlashMemory::start`].
    pub fn start(&self, power: Option<u64>) -> Vec<u8> {
        self.0.borrow_mut().start(power).to_vec()
    }

    /// Power has failed.
    pub fn is_dead(&self) -> bool {
        self.0.borrow().is_dead()
    }
}

impl ImageStore for SharedFlash {
    fn room(&self) -> u32 {
        self.0.borrow().room()
    }

    fn erase(&mut self, bytes: u32) -> Result<(), MemoryFault> {
        self.0.borrow_mut().erase(bytes)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), MemoryFault> {
        self.0.borrow_mut().write(offset, bytes)
    }

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), MemoryFault> {
        self.0.borrow_mut().read(offset, bytes)
    }

    fn try_next(&mut self) -> Result<(), MemoryFault> {
        self.0.borrow_mut().try_next()
    }

    fn is_on_trial(&self) -> bool {
        self.0.borrow().is_on_trial()
    }

    fn keep(&mut self) -> Result<(), MemoryFault> {
        self.0.borrow_mut().keep()
    }
}
