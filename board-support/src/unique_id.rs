//! The chip's unique identity.

use core::ptr;

/// Address of the identity (RM0008 30.2). It may be read in any width.
const ADDRESS: *const [u16; 6] = 0x1FFF_F7E8 as *const [u16; 6];

/// Returns the 96 bits as half-words, in the order of their addresses.
pub(crate) fn read() -> [u16; 6] {
    // SAFETY: the half-words are aligned, always readable, and never change.
    unsafe { ptr::read_volatile(ADDRESS) }
}
