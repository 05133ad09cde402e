//! Turns the outputs off from any point of the program.

use core::ptr;

use stm32f1xx_hal::pac;

use crate::{boards::BOARD, pin::Mode};

/// Sets PA8 low: its bit in the upper half of the set/reset register (RM0008 9.2.5).
const DRIVER_OFF: u32 = 1 << (16 + 8);

/// Makes the lines of all slots floating inputs, which turns every module's outputs off, and turns the RS-485
/// driver off. For fault handlers, after which the interrupted program does not run again; it ignores who owns the
/// pins.
///
/// The analog outputs of 4AO and 2AI2AO are not changed. Their DACs keep their last codes until the restarted
/// program writes them, some milliseconds after the reset. A fault handler must not start a transfer on a bus that
/// may itself have caused the fault.
pub fn outputs_off() {
    // SAFETY: single register accesses that are defined in every state of the chip. The owner of the pins does not
    // run again.
    unsafe {
        // A port without its clock is still in its reset state and ignores accesses. The same start-up step turns
        // the clocks of all ports on, so checking one is enough.
        if (*pac::RCC::ptr()).apb2enr().read().iopcen().bit_is_clear() {
            return;
        }
        ptr::write_volatile((*pac::GPIOA::ptr()).bsrr().as_ptr(), DRIVER_OFF);
    }
    for line in BOARD.slots.iter().flat_map(|slot| slot.lines) {
        line.configure(Mode::Floating);
    }
}
