//! Reading the flash the program runs from.

/// Where the flash of the smallest part ends: 64 KiB (DS5319 table 2).
const END: u32 = 0x0801_0000;
const START: u32 = 0x0800_0000;

/// `N` bytes at an address, or `None` when they are not all in the first 64 KiB.
#[must_use]
pub fn read<const N: usize>(address: u32) -> Option<[u8; N]> {
    let length = u32::try_from(N).ok()?;
    if address < START || address.checked_add(length)? > END {
        return None;
    }
    // SAFETY: the range was just checked to be flash, which is always readable and never written
    // while this runs. Volatile, because a programmer may have changed what the linker placed here.
    Some(unsafe { core::ptr::read_volatile(address as *const [u8; N]) })
}
