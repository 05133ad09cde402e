//! The vector table in RAM, so that interrupts can be entered while flash cannot be read.

use core::ptr;

use cortex_m::peripheral::SCB;

unsafe extern "C" {
    /// The vector table in flash, from cortex-m-rt. It has entries for all parts of the family, 76.
    static __vector_table: u32;
    /// The table in RAM, up to `_ram_vectors_end`. The linker script gives it the part's number of entries and aligns it.
    static mut _ram_vectors: u32;
    static _ram_vectors_end: u32;
}

/// Copies the table to RAM and makes the core use it. Interrupts must be disabled.
pub(crate) fn move_to_ram(scb: &SCB) {
    let (table, end) = (&raw mut _ram_vectors, &raw const _ram_vectors_end);
    let vectors = (end as usize - table as usize) / size_of::<u32>();
    // SAFETY: the table in flash is at least as long as the one in RAM. Nothing else accesses the table in RAM, and the
    // core does not use it until VTOR is written.
    unsafe { ptr::copy_nonoverlapping(&raw const __vector_table, table, vectors) };
    cortex_m::asm::dsb();
    // SAFETY: the table is complete and aligned.
    unsafe { scb.vtor.write(table as u32) };
    cortex_m::asm::dsb();
}

/// Enters the handler of an interrupt in the table in RAM. The interrupt must be disabled.
pub(crate) fn set(interrupt: u16, handler: extern "C" fn()) {
    // SAFETY: the table has an entry for every interrupt of the part, after the 16 of the core. The core reads an entry
    // only when its interrupt is enabled.
    unsafe {
        let entry = (&raw mut _ram_vectors).add(16 + usize::from(interrupt));
        entry.write_volatile(handler as usize as u32);
    }
    cortex_m::asm::dsb();
}
