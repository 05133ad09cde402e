//! Outputs off at once, from wherever the program has come to.

use core::ptr;

use stm32f1xx_hal::pac;

use crate::{boards::BOARD, pin::Mode};

/// PA8 low: the upper half of the set/reset register (RM0008 9.2.5).
const DRIVER_OFF: u32 = 1 << (16 + 8);

/// Makes the lines of all slots floating inputs, which is off for every module, and turns the RS-485 driver
/// off. For fault handlers, which may not go on to use the pins: it does not ask who owns them.
///
/// The analog outputs of 4AO and 2AI2AO are out of reach from here: their DACs keep their last codes
/// until the program that starts over writes them, some milliseconds after the reset. A transfer on a
/// bus that may be the very thing that failed has no place in a fault handler.
pub fn outputs_off() {
    // SAFETY: single register accesses that are defined in every state of the chip. Whoever owned the
    // pins does not run again: that is what this is for.
    unsafe {
        // Without its clock a port is as the reset left it, and takes no access. All have theirs since the same step
        // of the start.
        if (*pac::RCC::ptr()).apb2enr().read().iopcen().bit_is_clear() {
            return;
        }
        ptr::write_volatile((*pac::GPIOA::ptr()).bsrr().as_ptr(), DRIVER_OFF);
    }
    for line in BOARD.slots.iter().flat_map(|slot| slot.lines) {
        line.configure(Mode::Floating);
    }
}
