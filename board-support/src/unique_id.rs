//! The number that no other chip has.

use core::ptr;

/// Where it stands (RM0008 30.2). It may be read in any width.
const ADDRESS: *const [u8; 12] = 0x1FFF_F7E8 as *const [u8; 12];

/// The 96 bits in the order of their addresses.
pub(crate) fn read() -> [u8; 12] {
    // SAFETY: the factory's bytes are readable at any time and never change.
    unsafe { ptr::read_volatile(ADDRESS) }
}
