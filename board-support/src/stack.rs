//! Measures how much of the stack was never used.
//!
//! The stack lies at the bottom of the RAM and grows downwards, with the statics above it (memory.x). A
//! stack that is too deep reaches addresses without memory, and the bus reports a fault before the stack can
//! overwrite a static. This needs no special linker such as flip-link. cortex-m-rt paints the stack before it is
//! used; words that still hold the paint were never written.

use core::ptr;

use cortex_m_rt::STACK_PAINT_VALUE;

unsafe extern "C" {
    /// End of the stack: its lowest address, which is also the lowest of the RAM. Defined by memory.x.
    static _stack_end: u32;
    /// Start of the stack: the address after its highest one.
    static _stack_start: u32;
}

/// Returns the stack's lowest address.
#[must_use]
pub fn bottom() -> u32 {
    &raw const _stack_end as u32
}

/// Returns the address just above the stack.
#[must_use]
pub fn top() -> u32 {
    &raw const _stack_start as u32
}

/// Words checked in one call, in about 1.5 us.
const AT_ONCE: u32 = 16;

/// Finds the lowest address that the stack has reached, a few words per call. Checking the whole stack takes about 20 us
/// for each KiB.
#[derive(Debug)]
pub struct LowWater {
    /// Lowest address found in use.
    lowest: u32,
    /// Next address to check.
    next: u32,
}

impl LowWater {
    /// Checks the next 16 words, upwards from the end of the stack, and returns the number of bytes never used
    /// since the start: 0 to the size of the stack, in steps of 4.
    ///
    /// Deeper use of the stack is found after at most one pass over the unused part, one call for every 64 bytes.
    pub fn check(&mut self) -> u16 {
        let end = self.lowest.min(self.next + 4 * AT_ONCE);
        let used = (self.next..end).step_by(4).find(|&word| {
            // SAFETY: these are words of the stack, which is RAM. Their content may change at any time, so it is
            // read as volatile and only compared.
            unsafe { ptr::read_volatile(word as *const u32) != STACK_PAINT_VALUE }
        });
        self.lowest = used.unwrap_or(self.lowest);
        self.next = if end < self.lowest { end } else { bottom() };
        (self.lowest - bottom()) as u16
    }
}

impl Default for LowWater {
    /// Creates the search with the present stack pointer as the lowest address in use.
    fn default() -> Self {
        Self {
            lowest: cortex_m::register::msp::read().max(bottom()).min(top()) & !3,
            next: bottom(),
        }
    }
}
