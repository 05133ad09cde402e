//! The boards. One constant per board says what is connected to which pin. The rest of a board is its row in crate
//! register-map, which the linker script has from there.
//!
//! A cargo feature with the board's name selects the board. [`board`](crate::board) holds what all boards share:
//! the radio's UART on PB10 and PB11, the DACs' bus on PB6 and PB7, the LEDs on PB8,
//! PB9 and PC13.

pub mod modio_02;
pub mod modio_08;

use crate::{pin::Pin, usart::Usart};

/// A board.
#[derive(Clone, Copy, Debug)]
pub struct Descriptor {
    /// The board's name, as in its row in crate register-map.
    pub name: &'static str,
    /// AFIO_MAPR, which is written once: remapped pins, and whether the pins of the debug port are free (RM0008 9.4.2).
    pub mapr: u32,
    /// The RS-485 line.
    pub line: LinePins,
    /// The slots in the order of their ports. The port numbers are consecutive.
    pub slots: &'static [SlotPins],
    /// The pins of SW01, position 1 first. A position that is ON connects its pin to ground.
    pub switch: [Pin; 8],
    /// The pins of the LoRa radio, besides its UART on PB10 and PB11.
    pub radio: RadioPins,
}

/// The UART of the RS-485 line and its pins.
#[derive(Clone, Copy, Debug)]
pub struct LinePins {
    /// The UART, whose pins for TX and RX follow from it.
    pub uart: Usart,
    /// Driver enable of the transceiver: high turns the driver on.
    pub driver: Pin,
}

/// The pins and the DAC address of a slot.
#[derive(Clone, Copy, Debug)]
pub struct SlotPins {
    /// Lines 1 to 4. Each is also an input of ADC1.
    pub lines: [Pin; 4],
    /// I2C address of an analog-output module's DAC in this slot, 0x60 to 0x67. Each slot has a different address.
    pub dac_address: u8,
}

/// The pins of the LoRa radio.
#[derive(Clone, Copy, Debug)]
pub struct RadioPins {
    /// M0 and M1, which select the mode.
    pub mode: [Pin; 2],
    /// AUX, which is low while the radio is busy.
    pub aux: Pin,
}

impl LinePins {
    /// Returns the pin whose edges raise an interrupt: RX, unless a timer captures them.
    #[must_use]
    pub const fn edge(&self) -> Option<Pin> {
        if self.uart.is_captured() {
            None
        } else {
            Some(self.uart.rx())
        }
    }

    /// Returns the bits of the line's pins in a configuration register.
    #[must_use]
    pub const fn mode_bits(&self, register: u32) -> u32 {
        let pins = [self.driver, self.uart.tx(), self.uart.rx()];
        let (mut bits, mut n) = (0, 0);
        while n < pins.len() {
            if pins[n].mode_register() == register {
                bits |= pins[n].mode_bits();
            }
            n += 1;
        }
        bits
    }
}

impl Descriptor {
    /// Checks the descriptor at compile time.
    const fn check(&self) {
        assert!(self.slots.len() <= 8, "a board has at most 8 ports");
        let mut slot = 0;
        while slot < self.slots.len() {
            let mut line = 0;
            while line < 4 {
                let pin = self.slots[slot].lines[line];
                assert!(
                    pin.adc_input().is_some(),
                    "every line of a slot must be an ADC input"
                );
                line += 1;
            }
            slot += 1;
        }
    }
}

const _: () = modio_02::BOARD.check();
const _: () = modio_08::BOARD.check();

// Set exactly one board feature. With two features BOARD is defined twice, without one it is not defined.
#[cfg(any(feature = "modio-02", test))]
pub use modio_02::BOARD;
#[cfg(feature = "modio-08")]
pub use modio_08::BOARD;

/// Number of slots of the board.
#[cfg(target_os = "none")]
pub const SLOTS: usize = BOARD.slots.len();
