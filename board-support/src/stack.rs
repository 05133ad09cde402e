//! How much of the stack was never used.
//!
//! The stack lies at the bottom of the RAM and grows towards its start, with the statics above it
//! (firmware's memory.x): one that is too deep runs into addresses where there is no memory, and the
//! bus answers with a fault, before it can overwrite a static. That needs no linker of its own, as
//! flip-link would. cortex-m-rt paints it before anything runs on it; what still has the paint has
//! never been written.

use core::ptr;

use cortex_m_rt::STACK_PAINT_VALUE;

unsafe extern "C" {
    /// Where the stack ends: its lowest address, and that of the RAM. Placed by memory.x.
    static _stack_end: u32;
    /// Where it starts: one beyond its highest address.
    static _stack_start: u32;
}

/// The stack's lowest address.
#[must_use]
pub fn bottom() -> u32 {
    &raw const _stack_end as u32
}

/// The address just above the stack.
#[must_use]
pub fn top() -> u32 {
    &raw const _stack_start as u32
}

/// Bytes of the stack that were never used since the start: 0 to its size, in steps of 4.
///
/// Takes some 20 us for each KiB that is free; meant for the background.
#[must_use]
pub fn free_low_water() -> u16 {
    let unused = (bottom()..top())
        .step_by(4)
        // SAFETY: these are the words of the stack, which is RAM. What they hold is somebody else's and
        // changes at any time, so it is read as volatile and only compared.
        .take_while(|&word| unsafe { ptr::read_volatile(word as *const u32) } == STACK_PAINT_VALUE)
        .count();
    (unused * 4) as u16
}
