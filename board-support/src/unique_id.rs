//! The number that no other chip has.

use core::ptr;

/// Where it stands (RM0008 30.2). It may be read in any width.
const ADDRESS: *const [u16; 6] = 0x1FFF_F7E8 as *const [u16; 6];

/// The 96 bits as half-words, in the order of their addresses.
pub(crate) fn read() -> [u16; 6] {
    // SAFETY: the factory's half-words are aligned, readable at any time and never change.
    unsafe { ptr::read_volatile(ADDRESS) }
}
