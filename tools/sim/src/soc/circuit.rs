//! What surrounds the part: a circuit that is connected to its pins.

use crate::part::Part;
use crate::periph::adc::Adc;
use crate::periph::gpio::{Drive, Gpio};
use crate::periph::i2c::Bus;
use crate::periph::usart::Wire;
use crate::time::Time;

/// Ports that are modelled, A to D.
pub const PORTS: usize = 4;

/// A pin of the part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pin {
    port: usize,
    number: usize,
}

impl Pin {
    /// The pin `number` (0 to 15) of port `'A'` to `'D'`.
    ///
    /// # Panics
    ///
    /// When there is no such pin.
    #[must_use]
    pub const fn new(port: char, number: usize) -> Self {
        match Self::find(port, number) {
            Some(pin) => pin,
            None => panic!("no such pin: ports are A to D, pins 0 to 15"),
        }
    }

    /// The same; `None` when there is no such pin.
    #[must_use]
    pub const fn find(port: char, number: usize) -> Option<Self> {
        let port = (port.to_ascii_uppercase() as usize).wrapping_sub('A' as usize);
        if port < PORTS && number < 16 {
            Some(Self { port, number })
        } else {
            None
        }
    }

    /// Its port, `'A'` to `'D'`.
    #[must_use]
    pub const fn port(self) -> char {
        (b'A' + self.port as u8) as char
    }

    /// Its port as a number: 0 = A.
    pub(crate) const fn port_index(self) -> usize {
        self.port
    }

    /// Its number in the port.
    #[must_use]
    pub const fn number(self) -> usize {
        self.number
    }

    /// The input of ADC1 at this pin (DS5319 table 5).
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
    /// The circuit does this to `pin` from now on.
    ///
    /// # Panics
    ///
    /// When the part does not have the pin.
    pub fn drive(&mut self, pin: Pin, drive: Drive) {
        let exists = self.part.ports[pin.port] >> pin.number & 1 != 0;
        assert!(exists, "the {} has no such pin: {pin:?}", self.part.name);
        let gpio = &mut self.gpio[pin.port];
        gpio.drive(pin.number, drive, self.now);
        if let Some(input) = pin.analog_input() {
            let millivolts = gpio.millivolts(pin.number);
            self.adc.set_millivolts(input, millivolts, self.now);
        }
    }

    /// The same from a source of this impedance, in ohms, which an analog input has to charge its capacitor
    /// through.
    pub fn drive_from(&mut self, pin: Pin, drive: Drive, ohms: u32) {
        self.drive(pin, drive);
        if let Some(input) = pin.analog_input() {
            self.adc.set_source_ohms(input, ohms, self.now);
        }
    }
}

/// A circuit around the part. Every method has a default: nothing is connected.
pub trait Circuit {
    /// Says what the circuit does to the pins: all that it is connected to, but for the wires of USARTs.
    fn drive(&self, _pins: &mut Pins) {}

    /// The part has accessed `port`, so it may drive its pins in another way. Returns whether the circuit now
    /// does something else to the pins: then [`Circuit::drive`] is called.
    fn port_changed(&mut self, _port: char, _gpio: &Gpio, _now: Time) -> bool {
        false
    }

    /// The supply of the circuit and the part comes or goes.
    fn set_power(&mut self, _on: bool, _now: Time) {}

    /// What is connected to the USART whose transmitter is at pin `tx`.
    fn wire(&mut self, _tx: Pin) -> Option<&mut dyn Wire> {
        None
    }

    /// The devices on the I2C bus whose clock is at pin `scl`.
    fn i2c(&mut self, _scl: Pin) -> Option<&mut dyn Bus> {
        None
    }

    /// What the part did that is not good for the circuit, since the last call.
    fn take_findings(&mut self) -> Vec<(Time, &'static str)> {
        Vec::new()
    }
}

/// Nothing is connected.
impl Circuit for () {}
