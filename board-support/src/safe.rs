//! Turns the outputs off from any point of the program.

use stm32f1xx_hal::pac;

use crate::{boards::BOARD, pin::Mode, pin_io::LACKS, rs485};

/// Makes the lines of all slots floating inputs, which turns every module's outputs off, and turns the RS-485
/// driver off. For fault handlers, after which the interrupted program does not run again; it ignores who owns the
/// pins.
///
/// The analog outputs of 4AO and 2AI2AO are not changed. Their DACs keep their last codes until the restarted
/// program writes them, some milliseconds after the reset. A fault handler must not start a transfer on a bus that
/// may itself have caused the fault.
pub fn outputs_off() {
    // A port without its clock is still in its reset state and ignores accesses. The same start-up step turns the
    // clocks of all ports on, so checking one is enough.
    // SAFETY: reading the register has no side effect.
    if unsafe { &*pac::RCC::ptr() }
        .apb2enr()
        .read()
        .iopcen()
        .bit_is_clear()
    {
        return;
    }
    rs485::disable_driver();
    for slot in BOARD.slots {
        for line in slot.lines {
            if !LACKS || !line.is_none() {
                line.configure(Mode::Floating);
            }
        }
    }
}
