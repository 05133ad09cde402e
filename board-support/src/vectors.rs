//! The vector table in RAM, so that an interrupt is entered while flash cannot be read.

use core::{cell::UnsafeCell, mem::MaybeUninit, ptr};

use cortex_m::peripheral::SCB;

/// The core's 16 and the interrupts of the medium-density parts (RM0008 table 63).
const VECTORS: usize = 16 + 60;

/// The linker aligns it to 512 bytes, the next power of two that holds it (PM0056 4.4.4).
#[repr(transparent)]
struct Table(UnsafeCell<MaybeUninit<[u32; VECTORS]>>);

// SAFETY: written once, before interrupts are enabled; from then on the core alone reads it.
unsafe impl Sync for Table {}

#[unsafe(link_section = ".ram_vectors")]
static TABLE: Table = Table(UnsafeCell::new(MaybeUninit::uninit()));

unsafe extern "C" {
    /// Of cortex-m-rt: the table in flash.
    static __vector_table: [u32; VECTORS];
}

/// Copies the table to RAM and has the core use it. To be called with interrupts disabled.
pub(crate) fn move_to_ram(scb: &SCB) {
    let table = TABLE.0.get();
    // SAFETY: both are as long; nothing else touches the table in RAM, and the core does not until VTOR is written.
    unsafe { ptr::copy_nonoverlapping(&raw const __vector_table, table.cast(), 1) };
    cortex_m::asm::dsb();
    // SAFETY: the table is whole and aligned.
    unsafe { scb.vtor.write(table as u32) };
    cortex_m::asm::dsb();
}
