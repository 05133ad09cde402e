//! What is connected to the pins of the part on the modio-02.
//!
//! ```text
//! PA0-3  slot lines 1-4, ADC1 IN0-3     PA9    USART1 TX -> RS-485 driver
//! PA4-7  SW01 positions 1-4             PA10   RS-485 receiver -> USART1 RX, TIM1 CH3
//! PA8    driver enable                  PB6-7  I2C1 -> the slot's DAC
//! PB8-9  LEDs, PC13 LED                 PB12-15 SW01 positions 5-8
//! ```

use register_map::Module;

use crate::line::Line;
use crate::periph::gpio::{Drive, Gpio};
use crate::periph::i2c::{Bus, Wires};
use crate::periph::usart::Wire;
use crate::slot::Slot;
use crate::soc::{Circuit, Pin, Pins};
use crate::time::Time;

/// The driver enable on port A.
const DRIVER_ENABLE: usize = 8;
const TX: Pin = Pin::new('A', 9);
const SCL: Pin = Pin::new('B', 6);
const SDA: Pin = Pin::new('B', 7);
/// Lines from the slot, on PA0 and up.
const LINES: usize = 4;
/// SW01, position 1 first.
const SWITCH: [Pin; 8] = [
    Pin::new('A', 4),
    Pin::new('A', 5),
    Pin::new('A', 6),
    Pin::new('A', 7),
    Pin::new('B', 12),
    Pin::new('B', 13),
    Pin::new('B', 14),
    Pin::new('B', 15),
];

/// The modio-02 without its part.
#[derive(Debug)]
pub struct Modio {
    /// The RS-485 bus.
    pub line: Line,
    /// The slot and what is plugged into it.
    pub slot: Slot,
    /// SW01: bit 0 = position 1, a set bit = ON = connected to ground.
    pub dip: u8,
}

impl Modio {
    /// A board with `module` in its slot, whose switch stands at `dip`.
    #[must_use]
    pub fn new(module: Module, dip: u8) -> Self {
        Self {
            line: Line::default(),
            slot: Slot::new(module),
            dip,
        }
    }
}

impl Circuit for Modio {
    fn drive(&self, pins: &mut Pins) {
        for line in 0..LINES {
            let (drive, ohms) = (self.slot.drive(line + 1), self.slot.source_ohms(line + 1));
            pins.drive_from(Pin::new('A', line), drive, ohms);
        }
        for (n, pin) in SWITCH.into_iter().enumerate() {
            let on = self.dip >> n & 1 != 0;
            pins.drive(pin, if on { Drive::Low } else { Drive::Floating });
        }
        let held = self.slot.held();
        for (pin, free) in [(SCL, held.scl), (SDA, held.sda)] {
            pins.drive(pin, if free { Drive::PullUp } else { Drive::Low });
        }
    }

    fn port_changed(&mut self, port: char, gpio: &Gpio, now: Time) -> bool {
        match port {
            'A' => {
                let on = gpio.level() >> DRIVER_ENABLE & 1 != 0;
                self.line.set_driver(on, now);
                let high = gpio.outputs() & gpio.level();
                for line in 0..LINES {
                    self.slot.set_line(line + 1, high >> line & 1 != 0);
                }
                false
            }
            'B' => {
                let low = gpio.pulled_low();
                self.slot.set_pins(Wires {
                    scl: low >> SCL.number() & 1 == 0,
                    sda: low >> SDA.number() & 1 == 0,
                })
            }
            _ => false,
        }
    }

    fn set_power(&mut self, on: bool, now: Time) {
        self.slot.set_power(on, now);
    }

    fn wire(&mut self, tx: Pin) -> Option<&mut dyn Wire> {
        (tx == TX).then_some(&mut self.line as &mut dyn Wire)
    }

    fn i2c(&mut self, scl: Pin) -> Option<&mut dyn Bus> {
        (scl == SCL).then_some(&mut self.slot as &mut dyn Bus)
    }

    fn take_findings(&mut self) -> Vec<(Time, &'static str)> {
        self.line.take_findings()
    }
}
