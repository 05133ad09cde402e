//! The boards, each one constant: what is where on it.
//!
//! The features of the same names choose the one that is built for. What all boards have in common is in
//! [`board`](crate::board): the RS-485 line on PA8 to PA10, the DACs' bus on PB6 and PB7, the LEDs on PB8, PB9 and PC13.

pub mod modio_02;
pub mod modio_08;

use crate::pin::Pin;

/// A board.
#[derive(Clone, Copy, Debug)]
pub struct Descriptor {
    /// Its name, that of its row in crate register-map.
    pub name: &'static str,
    /// Its slots, in the order of their ports, which follow one another.
    pub slots: &'static [SlotPins],
    /// SW01, position 1 first. Each position, when ON, connects its pin to ground.
    pub switch: [Pin; 8],
    /// The addresses of the two pages of flash that keep the configuration. The linker keeps the program out of them.
    pub store: [u32; 2],
    /// Bytes of a page of flash, which is what one erase clears (PM0075 2.1).
    pub page_bytes: u32,
}

/// Where a slot is connected.
#[derive(Clone, Copy, Debug)]
pub struct SlotPins {
    /// Its lines 1 to 4. All are inputs of ADC1, too.
    pub lines: [Pin; 4],
    /// The address of an analog-output module's DAC on the bus, 0x60 to 0x67: each slot has its own.
    pub dac_address: u8,
}

impl Descriptor {
    /// Whether the descriptor is one that the code can work with, checked when it is compiled.
    const fn check(&self) {
        assert!(self.slots.len() <= 8, "there are 8 ports");
        let mut slot = 0;
        while slot < self.slots.len() {
            let mut line = 0;
            while line < 4 {
                let pin = self.slots[slot].lines[line];
                assert!(pin.adc_input().is_some(), "a slot's line can be analog");
                line += 1;
            }
            slot += 1;
        }
        let [first, second] = self.store;
        assert!(first.is_multiple_of(self.page_bytes));
        assert!(first + self.page_bytes == second, "two whole pages");
    }
}

const _: () = modio_02::BOARD.check();
const _: () = modio_08::BOARD.check();

// One feature, and no other: with two of them the name stands for two boards, and without one for none.
#[cfg(feature = "modio-02")]
pub use modio_02::BOARD;
#[cfg(feature = "modio-08")]
pub use modio_08::BOARD;

/// How many slots the board has.
#[cfg(target_os = "none")]
pub const SLOTS: usize = BOARD.slots.len();
