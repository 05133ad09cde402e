//! The part's memories, flash and SRAM.
//!
//! The core reads them, and writes SRAM, through a raw pointer while it runs, so they are kept behind one
//! and lent out as slices only between its calls.

use core::fmt;
use core::ptr::NonNull;
use std::alloc::{Layout, alloc_zeroed, dealloc, handle_alloc_error};

/// Where the flash starts (RM0008 3.3.3); it is at 0 as well (boot from main flash, RM0008 3.4).
pub const FLASH_BASE: u32 = 0x0800_0000;
/// Where the SRAM starts (RM0008 3.3.1).
pub const RAM_BASE: u32 = 0x2000_0000;
/// Bytes of a page of crate rigless's: accesses are sent to the bus page by page.
pub(super) const ROUTED_PAGE: usize = 1024;

/// More than any page size the core asks for.
const ALIGNMENT: usize = 4096;

/// A memory of the part, at a fixed place in the host's.
pub struct Memory {
    start: NonNull<u8>,
    layout: Layout,
}

// SAFETY: a `Memory` owns its bytes alone, as a `Box<[u8]>` does.
unsafe impl Send for Memory {}

impl Memory {
    /// `size` bytes, each `fill`.
    ///
    /// # Panics
    ///
    /// When `size` is 0 or the host has no memory left.
    #[must_use]
    pub fn new(size: usize, fill: u8) -> Self {
        assert!(size > 0, "a memory of no bytes");
        let layout = Layout::from_size_align(size, ALIGNMENT).expect("a small memory");
        // SAFETY: the layout is not of size 0.
        let start = unsafe { alloc_zeroed(layout) };
        let Some(start) = NonNull::new(start) else {
            handle_alloc_error(layout)
        };
        let mut memory = Self { start, layout };
        memory.bytes_mut().fill(fill);
        memory
    }

    /// Where the core finds it. Nothing returned by the other methods may be alive while the core runs on it.
    pub fn host(&mut self) -> *mut u8 {
        self.start.as_ptr()
    }

    /// The bytes.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        // SAFETY: `start` owns `size` initialised bytes, and the borrow of `self` keeps the core, which
        // writes only during a `&mut` call on the machine that holds this, from running.
        unsafe { core::slice::from_raw_parts(self.start.as_ptr(), self.layout.size()) }
    }

    /// The bytes, to change.
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        // SAFETY: as for `bytes`, and the borrow is exclusive.
        unsafe { core::slice::from_raw_parts_mut(self.start.as_ptr(), self.layout.size()) }
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        // SAFETY: allocated in `new` with this layout, and freed only here.
        unsafe { dealloc(self.start.as_ptr(), self.layout) };
    }
}

impl fmt::Debug for Memory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Memory({} bytes)", self.layout.size())
    }
}
