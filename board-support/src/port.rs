//! The registers of the ports, for what the HAL's pins do not offer: several pins at once, and pins
//! whose use changes while they run.

use stm32f1xx_hal::pac::{GPIOA, GPIOB, gpioa::RegisterBlock};

/// Port A. Who changes a pin through it is to own that pin, and the configuration register.
pub(crate) fn a() -> &'static RegisterBlock {
    // SAFETY: the registers are there for ever, and no access to them can break memory.
    unsafe { &*GPIOA::ptr() }
}

/// Port B, as [port A](a).
pub(crate) fn b() -> &'static RegisterBlock {
    // SAFETY: as above.
    unsafe { &*GPIOB::ptr() }
}
