//! The vector table in RAM, so that interrupts can be entered while flash cannot be read.

use core::{cell::UnsafeCell, mem::MaybeUninit, ptr};

use cortex_m::peripheral::SCB;

use crate::boards::BOARD;

/// Number of vectors: 16 of the core and the part's interrupts.
const VECTORS: usize = 16 + BOARD.interrupts;

/// The linker aligns the table to 512 bytes, the next power of two above the size of 76 vectors (PM0056 4.4.4).
#[repr(transparent)]
struct Table(UnsafeCell<MaybeUninit<[u32; VECTORS]>>);

// SAFETY: written once, before interrupts are enabled; from then on only the core reads it.
unsafe impl Sync for Table {}

#[unsafe(link_section = ".ram_vectors")]
static TABLE: Table = Table(UnsafeCell::new(MaybeUninit::uninit()));

unsafe extern "C" {
    /// The vector table in flash, from cortex-m-rt. It has entries for all parts of the family, 76.
    static __vector_table: [u32; VECTORS];
}

/// Copies the table to RAM and makes the core use it. Interrupts must be disabled.
pub(crate) fn move_to_ram(scb: &SCB) {
    let table = TABLE.0.get();
    // SAFETY: the table in flash is at least as long as the one in RAM. Nothing else accesses the table in RAM, and the
    // core does not use it until VTOR is written.
    unsafe { ptr::copy_nonoverlapping(&raw const __vector_table, table.cast(), 1) };
    cortex_m::asm::dsb();
    // SAFETY: the table is complete and aligned.
    unsafe { scb.vtor.write(table as u32) };
    cortex_m::asm::dsb();
}
