//! How deep the stack has been: what lies below it is painted, and looked at afterwards.

/// Bytes that are painted.
const DEPTH: usize = 32 * 1024;
/// What is left out below the present frame: the frames of the functions here.
const MARGIN: usize = 256;
const PAINT: u32 = 0xa5a5_5a5a;

/// The painted part of the stack.
#[derive(Clone, Copy, Debug)]
pub struct Painted {
    top: *mut u32,
}

impl Painted {
    /// Paints what lies below the present frame.
    ///
    /// # Safety
    /// The stack has that much room and a little more, and no interrupt runs meanwhile.
    #[inline(never)]
    pub unsafe fn below() -> Self {
        let top = (cortex_m::register::msp::read() as usize - MARGIN) as *mut u32;
        for word in 1..DEPTH / 4 {
            // SAFETY: the caller says so.
            unsafe { top.sub(word).write_volatile(PAINT) };
        }
        Self { top }
    }

    /// How many bytes of it have been used since, counted from its top.
    #[must_use]
    pub fn used(&self) -> usize {
        // SAFETY: it was written.
        let painted = |word: &usize| unsafe { self.top.sub(*word).read_volatile() } == PAINT;
        let deepest = (1..DEPTH / 4).rev().find(|word| !painted(word)).unwrap_or(0);
        deepest * 4 + MARGIN
    }
}
