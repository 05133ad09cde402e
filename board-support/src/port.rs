//! The registers of the ports, for what the HAL's pins do not offer: several pins at once, and pins
//! whose use changes while they run.
//!
//! A configuration register (CRL, CRH) is changed by a read and a write, in between which a second owner's change
//! would be lost. So each has one owner at a time, who holds the HAL's token for it (`Cr`):
//!
//! | register | owner | changed |
//! |---|---|---|
//! | port A CRL | `Slot` | once, in `init`, before the first interrupt |
//! | port A CRH | `board::setup`, then `LineOff` | in `init` |
//! | port B CRL | `BusPins` of the DAC's bus | in `init` and by the background task alone |
//! | port B CRH, port C CRH | `board::setup` | in `init` |
//!
//! `outputs_off` writes port A CRL from fault handlers. That is a single store, and the interrupted program
//! does not run again. Output bits are changed through BSRR, a single store that leaves all other pins alone.

use stm32f1xx_hal::pac::{GPIOA, GPIOB, GPIOC, gpioa::RegisterBlock};

/// Port A. The caller must own the pin that it changes, and the configuration register.
pub(crate) fn a() -> &'static RegisterBlock {
    // SAFETY: the registers are there for ever, and no access to them can break memory.
    unsafe { &*GPIOA::ptr() }
}

/// Port B, as [port A](a).
pub(crate) fn b() -> &'static RegisterBlock {
    // SAFETY: as above.
    unsafe { &*GPIOB::ptr() }
}

/// Port C, as [port A](a).
pub(crate) fn c() -> &'static RegisterBlock {
    // SAFETY: as above.
    unsafe { &*GPIOC::ptr() }
}
