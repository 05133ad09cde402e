//! What the board needs before anything else, in the loader and in the application.

use stm32f1xx_hal::{
    pac,
    rcc::{Enable, Reset},
};

use crate::{
    boards::{BOARD, Held},
    pin::{Mode, Port},
};

/// Holds the pins of the board that must not float, before the start-up code of cortex-m-rt clears the RAM, which takes a
/// millisecond. cortex-m-rt calls this by its name.
///
/// # Safety
///
/// Only for cortex-m-rt. Nothing here uses the RAM but for the stack.
#[unsafe(no_mangle)]
unsafe extern "C" fn __pre_init() {
    if BOARD.held.is_empty() {
        return;
    }
    // SAFETY: nothing else runs.
    let (mut rcc, afio) = unsafe { (pac::RCC::steal(), pac::AFIO::steal()) };
    ports_on(&mut rcc);
    write_mapr(&mut rcc, &afio);
    for (pin, held) in BOARD.held {
        pin.set(matches!(held, Held::High));
        pin.configure(match held {
            Held::Low | Held::High => Mode::Output,
            Held::PulledDown => Mode::Pulled,
        });
    }
}

/// Writes AFIO_MAPR as a whole, because the setting of the debug port cannot be read.
pub(crate) fn write_mapr(rcc: &mut pac::RCC, afio: &pac::AFIO) {
    pac::AFIO::enable(rcc);
    if BOARD.mapr != 0 {
        // SAFETY: the board's descriptor has a valid value.
        afio.mapr().write(|w| unsafe { w.bits(BOARD.mapr) });
    }
}

/// Turns the clocks of the ports on.
pub(crate) fn ports_on(rcc: &mut pac::RCC) {
    pac::GPIOA::enable(rcc);
    pac::GPIOB::enable(rcc);
    pac::GPIOC::enable(rcc);
    if BOARD.last_port as u8 >= Port::D as u8 {
        pac::GPIOD::enable(rcc);
    }
    if BOARD.last_port as u8 >= Port::E as u8 {
        pac::GPIOE::enable(rcc);
    }
}

/// Makes every pin a floating input, as after a reset of the chip. On a board that holds pins this would release them.
/// There all other pins float already.
pub(crate) fn float_pins(rcc: &mut pac::RCC) {
    if BOARD.held.is_empty() {
        pac::GPIOA::reset(rcc);
        pac::GPIOB::reset(rcc);
        pac::GPIOC::reset(rcc);
    }
}
