//! The board's first serial port: Arm's CMSDK UART.

/// The port. There is one of it.
#[derive(Debug)]
pub struct Uart {
    registers: *mut Registers,
}

// The registers may be used from anywhere, as long as one context at a time does.
unsafe impl Send for Uart {}

#[repr(C)]
struct Registers {
    data: u32,
    state: u32,
    control: u32,
    interrupt: u32,
    divider: u32,
}

/// Bits of `state`.
const TRANSMIT_FULL: u32 = 1;
const RECEIVE_FULL: u32 = 1 << 1;
/// Bits of `control`.
const TRANSMIT_AND_RECEIVE: u32 = 3;
const RECEIVE_INTERRUPT: u32 = 1 << 3;
/// Bit of `interrupt`.
const RECEIVE_RAISED: u32 = 1 << 1;

impl Uart {
    /// Switches the port on.
    ///
    /// # Safety
    /// At most one `Uart` may exist.
    pub unsafe fn new() -> Self {
        let registers = 0x4000_4000 as *mut Registers;
        // SAFETY: the port's registers lie there, and nobody else uses them.
        unsafe {
            (&raw mut (*registers).divider).write_volatile(16);
            (&raw mut (*registers).control).write_volatile(TRANSMIT_AND_RECEIVE);
        }
        Self { registers }
    }

    /// The byte that has come, if one has.
    pub fn read(&mut self) -> Option<u8> {
        // SAFETY: the port's registers lie there, and nobody else uses them.
        unsafe {
            let state = (&raw const (*self.registers).state).read_volatile();
            (state & RECEIVE_FULL != 0).then(|| (&raw const (*self.registers).data).read_volatile() as u8)
        }
    }

    /// From now on a byte that comes raises the port's interrupt, number 0 of the board: who waits for one may sleep.
    pub fn raise_on_receive(&mut self) {
        // SAFETY: the port's registers lie there, and nobody else uses them.
        unsafe {
            (&raw mut (*self.registers).control).write_volatile(TRANSMIT_AND_RECEIVE | RECEIVE_INTERRUPT);
        }
    }

    /// The interrupt has been heard.
    pub fn acknowledge(&mut self) {
        // SAFETY: the port's registers lie there, and nobody else uses them.
        unsafe { (&raw mut (*self.registers).interrupt).write_volatile(RECEIVE_RAISED) }
    }

    /// Sends a byte, and waits until there is room for it.
    pub fn write(&mut self, byte: u8) {
        // SAFETY: the port's registers lie there, and nobody else uses them.
        unsafe {
            while (&raw const (*self.registers).state).read_volatile() & TRANSMIT_FULL != 0 {}
            (&raw mut (*self.registers).data).write_volatile(u32::from(byte));
        }
    }
}
