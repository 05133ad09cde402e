//! The part as RTIC needs it: its peripherals and the names of its interrupts.

pub use stm32f1xx_hal::pac::{NVIC_PRIO_BITS, Peripherals};

/// The interrupts by their names in the reference manual, and those that depend on the board by what they are for. The
/// linker script gives their handlers the names that the vector table has.
pub mod interrupt {
    use stm32f1xx_hal::pac::Interrupt;
    pub use stm32f1xx_hal::pac::Interrupt::*;

    use crate::boards::BOARD;

    include!(concat!(env!("OUT_DIR"), "/interrupts.rs"));

    const _: () = assert!(
        LINE as u16 == BOARD.line.uart.interrupt(),
        "the row and the descriptor of the board name the same UART"
    );
}
