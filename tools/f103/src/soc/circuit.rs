//! The circuit that is connected to the pins of the part.

use crate::part::{PORTS, Part};
use crate::periph::adc::Adc;
use crate::periph::gpio::{Drive, Gpio};
use crate::periph::i2c::Bus;
use crate::periph::usart::Wire;
use crate::time::Time;

/// A pin of the part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pin {
    port: usize,
    number: usize,
}

impl Pin {
    /// Returns the pin `number` (0 to 15) of a port (`'A'` to `'E'`).
    ///
    /// # Panics
    ///
    /// If there is no such pin.
    #[must_use]
    pub const fn new(port: char, number: usize) -> Self {
        match Self::find(port, number) {
            Some(pin) => pin,
            None => panic!("no such pin: ports are A to E, pins 0 to 15"),
        }
    }

    /// Returns the pin `number` (0 to 15) of a port (`'A'` to `'E'`, or in lower case). `None` if there is no such pin.
    #[must_use]
    pub const fn find(port: char, number: usize) -> Option<Self> {
        let port = (port.to_ascii_uppercase() as usize).wrapping_sub('A' as usize);
        if port < PORTS && number < 16 {
            Some(Self { port, number })
        } else {
            None
        }
    }

    /// Returns the port of the pin, `'A'` to `'E'`.
    #[must_use]
    pub const fn port(self) -> char {
        (b'A' + self.port as u8) as char
    }

    /// Returns the port of the pin as a number: 0 is port A.
    pub(crate) const fn port_index(self) -> usize {
        self.port
    }

    /// Returns the number of the pin in its port, 0 to 15.
    #[must_use]
    pub const fn number(self) -> usize {
        self.number
    }

    /// Returns the number of the ADC1 input at this pin (DS5319 table 5); `None` if the pin is not an analog input.
    const fn analog_input(self) -> Option<usize> {
        match (self.port, self.number) {
            (0, 0..=7) => Some(self.number),
            (1, 0 | 1) => Some(8 + self.number),
            (2, 0..=5) => Some(10 + self.number),
            _ => None,
        }
    }
}

/// The part's pins, for a circuit that drives them.
#[derive(Debug)]
pub struct Pins<'a> {
    pub(super) part: &'static Part,
    pub(super) gpio: &'a mut [Gpio; PORTS],
    pub(super) adc: &'a mut Adc,
    pub(super) now: Time,
}

impl Pins<'_> {
    /// Sets what the circuit drives at `pin` from now on.
    ///
    /// # Panics
    ///
    /// If the part does not have the pin.
    pub fn drive(&mut self, pin: Pin, drive: Drive) {
        let exists = self.part.ports[pin.port] >> pin.number & 1 != 0;
        let (part, port, number) = (self.part.name, pin.port(), pin.number);
        assert!(exists, "the {part} has no pin P{port}{number}");
        let gpio = &mut self.gpio[pin.port];
        gpio.drive(pin.number, drive, self.now);
        if let Some(input) = pin.analog_input() {
            let millivolts = gpio.millivolts(pin.number);
            self.adc.set_millivolts(input, millivolts, self.now);
        }
    }

    /// As [`drive`](Self::drive), from a source with an impedance of `ohms`. The capacitor of the ADC is charged
    /// through this impedance.
    pub fn drive_from(&mut self, pin: Pin, drive: Drive, ohms: u32) {
        self.drive(pin, drive);
        if let Some(input) = pin.analog_input() {
            self.adc.set_source_ohms(input, ohms, self.now);
        }
    }
}

/// A circuit around the part. Each method has a default that connects nothing.
pub trait Circuit {
    /// Drives all pins that the circuit is connected to, except the RX pins of USARTs.
    fn drive(&self, _pins: &mut Pins) {}

    /// Called after the part has accessed `port`, because its outputs may have changed. Returns whether the circuit now
    /// drives its pins in another way; [`Circuit::drive`] is called then.
    fn port_changed(&mut self, _port: char, _gpio: &Gpio, _now: Time) -> bool {
        false
    }

    /// Called when the supply of the circuit and the part is switched: at power-off before the part's outputs change.
    fn set_power(&mut self, _on: bool, _now: Time) {}

    /// Returns whether the circuit drives its pins in another way than at the last call because time has passed. Called
    /// after a device at a USART was computed; [`Circuit::drive`] is called then.
    fn pins_changed(&mut self) -> bool {
        false
    }

    /// Returns the device at the USART whose transmitter is at pin `tx`; `None` if nothing is connected.
    fn wire(&mut self, _tx: Pin) -> Option<&mut dyn Wire> {
        None
    }

    /// Returns the devices on the I2C bus whose clock is at pin `scl`; `None` if there are none.
    fn i2c(&mut self, _scl: Pin) -> Option<&mut dyn Bus> {
        None
    }

    /// Returns the actions of the part since the last call that the circuit does not allow, each with its instant.
    fn take_findings(&mut self) -> Vec<(Time, &'static str)> {
        Vec::new()
    }
}

/// Nothing is connected.
impl Circuit for () {}
