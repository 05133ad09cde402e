//! Pins as data, and access to a pin through the registers of its port.
//!
//! Most pins are in the board's [descriptor](crate::boards::Descriptor).
//!
//! Code changes a configuration register (CRL, CRH) by a read and a write. A change by another context in between
//! would be lost, so only one context at a time may change each register:
//!
//! | register | changed by |
//! |---|---|
//! | all, for slots, SW01, LEDs and the lines | `board::setup`, `SlotPins`, `LineOff` and `SecondOff`: in `init`, before the first interrupt |
//! | port B CRL, for the DACs' bus | `BusPins`: in `init` and later by the background task alone |
//! | those of the line's pins | `Rs485::set_up` later, too, at the highest priority in use |
//! | all of them | `Registers`, which repairs them, at the highest priority in use |
//! | the slots' | `outputs_off`, from fault handlers, after which the interrupted program does not run again |
//!
//! Output bits are changed through BSRR by a single store, which does not affect other pins.

/// A GPIO port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Port {
    /// GPIOA.
    A = 0,
    /// GPIOB.
    B = 1,
    /// GPIOC.
    C = 2,
    /// GPIOD.
    D = 3,
    /// GPIOE.
    E = 4,
}

impl Port {
    /// Returns the base address of the port's registers (RM0008 table 3).
    #[must_use]
    pub const fn base(self) -> u32 {
        0x4001_0800 + 0x400 * self as u32
    }
}

/// A pin of a GPIO port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pin {
    port: Port,
    /// Number of the pin in its port, 0 to 15.
    number: u8,
}

impl Pin {
    /// No pin, for a channel that a port does not have.
    pub const NONE: Self = Self {
        port: Port::A,
        number: 16,
    };

    /// Returns whether this is no pin.
    #[must_use]
    pub const fn is_none(self) -> bool {
        self.number == Self::NONE.number
    }

    /// Returns a pin of port A.
    #[must_use]
    pub const fn a(number: u8) -> Self {
        Self::new(Port::A, number)
    }

    /// Returns a pin of port B.
    #[must_use]
    pub const fn b(number: u8) -> Self {
        Self::new(Port::B, number)
    }

    /// Returns a pin of port C.
    #[must_use]
    pub const fn c(number: u8) -> Self {
        Self::new(Port::C, number)
    }

    /// Returns a pin of port D.
    #[must_use]
    pub const fn d(number: u8) -> Self {
        Self::new(Port::D, number)
    }

    /// Returns a pin of port E.
    #[must_use]
    pub const fn e(number: u8) -> Self {
        Self::new(Port::E, number)
    }

    const fn new(port: Port, number: u8) -> Self {
        assert!(number < 16, "a port has pins 0 to 15");
        Self { port, number }
    }

    /// Returns the port of the pin.
    #[must_use]
    pub const fn port(self) -> Port {
        self.port
    }

    /// Returns the number of the pin in its port.
    #[must_use]
    pub const fn number(self) -> u8 {
        self.number
    }

    /// Returns the number of the interrupt that the edges of the pin can raise (RM0008 table 63).
    #[must_use]
    pub const fn edge_interrupt(self) -> u16 {
        match self.number {
            0..=4 => 6 + self.number as u16,
            5..=9 => 23,
            _ => 40,
        }
    }

    /// Returns the address of the configuration register of the pin, CRL or CRH (RM0008 9.2.1 and 9.2.2).
    #[must_use]
    pub const fn mode_register(self) -> u32 {
        self.port.base() + self.number as u32 / 8 * 4
    }

    /// Returns the bits of the pin in its configuration register.
    #[must_use]
    pub const fn mode_bits(self) -> u32 {
        0xF << (self.number % 8 * 4)
    }

    /// Returns the number of the DAC's output on this pin, if there is one (DS5792 table 5).
    #[must_use]
    pub const fn dac_output(self) -> Option<u8> {
        match (self.port, self.number) {
            (Port::A, 4) => Some(0),
            (Port::A, 5) => Some(1),
            _ => None,
        }
    }

    /// Returns the number of the ADC1 input on this pin, if there is one (DS5319 table 5, DS5792 table 5).
    #[must_use]
    pub const fn adc_input(self) -> Option<u8> {
        // A match would become a table, which is longer.
        let Self { port, number } = self;
        if matches!(port, Port::A) && number < 8 {
            Some(number)
        } else if matches!(port, Port::B) && number < 2 {
            Some(8 + number)
        } else if matches!(port, Port::C) && number < 6 {
            Some(10 + number)
        } else {
            None
        }
    }
}

/// Mode of a pin: its four bits in a configuration register (RM0008 9.2.1 and 9.2.2).
#[cfg(target_os = "none")]
#[derive(Clone, Copy)]
#[repr(u32)]
pub(crate) enum Mode {
    /// A floating input, as after a reset.
    Floating = 0b0100,
    /// An input with a pull-up or pull-down, selected by the output bit.
    Pulled = 0b1000,
    /// An analog input.
    Analog = 0b0000,
    /// A push-pull output with the slowest edges, 2 MHz.
    Output = 0b0010,
    /// A push-pull output with faster edges, 10 MHz.
    FastOutput = 0b0001,
    /// An open-drain output with the slowest edges.
    OpenDrain = 0b0110,
    /// A push-pull output of a peripheral, with the slowest edges.
    Peripheral = 0b1010,
    /// The same with faster edges, 10 MHz.
    FastPeripheral = 0b1001,
    /// An open-drain output of a peripheral, with the slowest edges.
    PeripheralOpenDrain = 0b1110,
}

#[cfg(target_os = "none")]
mod registers {
    use stm32f1xx_hal::pac::{GPIOA, gpioa::RegisterBlock};

    use super::{Mode, Pin, Port};

    impl Port {
        /// Returns the port's registers. The caller must own the pins that it changes.
        #[inline(always)]
        pub(crate) fn registers(self) -> &'static RegisterBlock {
            // The blocks have the same layout and lie 0x400 bytes apart (RM0008 table 3), and the PAC uses one type for
            // them. Code in RAM must not look them up in a table.
            let block = GPIOA::ptr().wrapping_byte_add(0x400 * self as usize);
            // SAFETY: the registers always exist, and no access to them can violate memory safety.
            unsafe { &*block }
        }
    }

    impl Pin {
        /// Sets the mode of the pin.
        pub(crate) fn configure(self, mode: Mode) {
            let registers = self.port.registers();
            let shift = u32::from(self.number % 8) * 4;
            let with = |bits: u32| bits & !(0b1111 << shift) | (mode as u32) << shift;
            if self.number < 8 {
                let bits = with(registers.crl().read().bits());
                // SAFETY: writes a valid mode to the four bits of this pin and keeps the other bits.
                registers.crl().write(|w| unsafe { w.bits(bits) });
            } else {
                let bits = with(registers.crh().read().bits());
                // SAFETY: as above.
                registers.crh().write(|w| unsafe { w.bits(bits) });
            }
        }

        /// Replaces the bits of `mask` in the configuration register of the pin.
        #[inline(always)]
        pub(crate) fn change_modes(self, mask: u32, bits: u32) {
            let registers = self.port.registers();
            // SAFETY: the callers give valid modes, and the other bits are kept.
            unsafe {
                if self.number < 8 {
                    registers
                        .crl()
                        .modify(|r, w| w.bits(r.bits() & !mask | bits));
                } else {
                    registers
                        .crh()
                        .modify(|r, w| w.bits(r.bits() & !mask | bits));
                }
            }
        }

        /// Makes the pin an input with pull-up.
        pub(crate) fn pull_up(self) {
            self.set(true);
            self.configure(Mode::Pulled);
        }

        /// Sets the output bit of the pin, which also selects between pull-up and pull-down.
        #[inline(always)]
        pub(crate) fn set(self, high: bool) {
            let bit = 1 << self.number;
            let bits = if high { bit } else { bit << 16 };
            // SAFETY: one store changes this pin only (RM0008 9.2.5).
            self.port
                .registers()
                .bsrr()
                .write(|w| unsafe { w.bits(bits) });
        }

        /// Returns the output bit of the pin.
        #[inline(always)]
        pub(crate) fn is_set(self) -> bool {
            self.port.registers().odr().read().bits() >> self.number & 1 != 0
        }

        /// Returns whether the pin is high.
        #[inline]
        pub(crate) fn is_high(self) -> bool {
            self.port.registers().idr().read().bits() >> self.number & 1 != 0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn adc_inputs_are_on_the_pins_of_the_data_sheet() {
        let inputs = (0..16).filter_map(|n| Pin::a(n).adc_input());
        let inputs = inputs.chain((0..16).filter_map(|n| Pin::b(n).adc_input()));
        let inputs = inputs.chain((0..16).filter_map(|n| Pin::c(n).adc_input()));
        assert!(inputs.eq(0..16));
        assert_eq!(Pin::c(4).adc_input(), Some(14));
    }
}
