//! What happens when the program is wrong: the device starts over. A reset takes the slot's lines
//! back to floating, which is off for every module.

use core::panic::PanicInfo;

use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};

#[panic_handler]
fn panic(_info: &PanicInfo<'_>) -> ! {
    SCB::sys_reset()
}

// SAFETY: the handler touches nothing of the interrupted program; it resets the chip.
#[exception]
unsafe fn HardFault(_frame: &ExceptionFrame) -> ! {
    SCB::sys_reset()
}

// SAFETY: as above.
#[exception]
unsafe fn DefaultHandler(_number: i16) {
    SCB::sys_reset()
}
