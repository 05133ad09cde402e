//! A memory of the part, the flash or the SRAM.
//!
//! The core accesses a memory through a raw pointer while it runs. So a [`Memory`] owns its bytes through a raw
//! pointer, too, and lends them as slices only while the core does not run.

use core::fmt;
use core::ptr::NonNull;
use std::alloc::{Layout, alloc_zeroed, dealloc, handle_alloc_error};

/// Start address of the flash (RM0008 3.3.3). The flash is also at address 0 (boot from main flash, RM0008 3.4).
pub const FLASH_BASE: u32 = 0x0800_0000;
/// Start address of the SRAM (RM0008 3.3.1).
pub const RAM_BASE: u32 = 0x2000_0000;
/// Size of a page of crate rigless, in bytes. Each page is either read directly or sent to the bus.
pub(super) const ROUTED_PAGE: usize = 1024;

/// Alignment of a memory, in bytes. It is a multiple of [`ROUTED_PAGE`].
const ALIGNMENT: usize = 4096;

/// A memory of the part, at a fixed address of the host.
pub struct Memory {
    start: NonNull<u8>,
    layout: Layout,
}

// SAFETY: a `Memory` owns its bytes alone, as a `Box<[u8]>` does.
unsafe impl Send for Memory {}

impl Memory {
    /// Creates a memory of `size` bytes with the value `fill`.
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

    /// Returns the address of the memory on the host, for the core. While the core runs, no slice that another method
    /// has returned may exist.
    pub fn host(&mut self) -> *mut u8 {
        self.start.as_ptr()
    }

    /// Returns the bytes.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        // SAFETY: `start` owns `size` initialised bytes, and the borrow of `self` keeps the core, which
        // writes only during a `&mut` call on the machine that holds this, from running.
        unsafe { core::slice::from_raw_parts(self.start.as_ptr(), self.layout.size()) }
    }

    /// Returns the bytes for changes.
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
