//! The circuit of a modio board: everything that is connected to the pins of the part.

use crate::line::{Format, Line, Settings};
use crate::slot::Slot;
use f103::periph::gpio::{Drive, Gpio};
use f103::periph::i2c::{Bus, Wires};
use f103::periph::usart::Wire;
use f103::soc::{Circuit, Pin, Pins};
use f103::time::Time;

use super::terminals::Terminals;
use super::{Config, Layout, Radio, Rs232};

/// USART3's transmitter: RXD of the LoRa module.
const RADIO_TX: Pin = Pin::new('B', 10);
/// I2C bus of the modules' DACs.
const SCL: Pin = Pin::new('B', 6);
const SDA: Pin = Pin::new('B', 7);

/// Time after power-on by which the firmware of a board that pulls its driver enable up has to drive this pin: the
/// reset of the part takes half of it.
const GRACE: Time = Time::from_ms(5);
/// Finding when the firmware does not.
const FLOATING_ENABLE: &str = "the RS-485 driver is on because the firmware does not drive its enable pin, which the board pulls up";

/// Rate and format of the terminal at the RS-232 port, which can be changed.
const TERMINAL: Settings = Settings {
    baud: 9600,
    format: Format::N1,
};
/// Finding when the LoRa module is used with bit 7 of OPTION set.
const FIXED_TRANSMISSION: &str = "the fixed transmission of the LoRa module is not modelled";

/// A modio board without its part.
#[derive(Debug)]
pub struct Modio {
    /// Type of the board.
    pub layout: &'static Layout,
    /// The RS-485 line.
    pub line: Line,
    /// The slots with their modules, in the order of [`Layout::slots`].
    pub slots: Vec<Slot>,
    /// DIP switch SW01: bit 0 = position 1, a set bit = ON = connected to ground.
    pub dip: u8,
    /// Position of the switch when the power was switched on last. The firmware reads the switch only then.
    pub dip_at_power_on: u8,
    /// The inputs and outputs that are fixed on the board.
    pub terminals: Terminals,
    /// The RS-232 port.
    pub rs232: Option<Rs232>,
    /// The LoRa module, if it is fitted.
    pub radio: Option<Radio>,
    powered: bool,
    /// Instant from which on the board's pull-up has switched the driver of the RS-485 line on.
    floats_since: Option<Time>,
    /// Number of the slot whose DAC has acknowledged its address.
    addressed: Option<usize>,
}

impl Modio {
    /// Returns a board with this configuration.
    #[must_use]
    pub fn new(config: &Config) -> Self {
        let slots = config.layout.slots.iter().zip(config.plugged());
        let slots =
            slots.map(|(pins, (_, module))| Slot::new(module).with_dac_at(pins.dac_address));
        Self {
            layout: config.layout,
            line: Line::default(),
            slots: slots.collect(),
            dip: config.dip,
            dip_at_power_on: config.dip,
            terminals: Terminals::new(config.layout.terminals),
            rs232: config.layout.rs232.map(|_| Rs232::new(TERMINAL)),
            radio: config
                .radio
                .map(|stored| Radio::new(stored, config.chip.corner)),
            powered: false,
            floats_since: None,
            addressed: None,
        }
    }

    /// Takes over the level of the driver enable.
    fn set_enable(&mut self, on: bool, driven: bool, now: Time) {
        self.line.set_driver(on, now);
        if on && !driven {
            self.floats_since.get_or_insert(now);
        } else {
            self.floats_since = None;
        }
    }
}

impl Circuit for Modio {
    fn drive(&self, pins: &mut Pins) {
        for (slot, slot_pins) in self.slots.iter().zip(self.layout.slots) {
            for (&pin, line) in slot_pins.lines.iter().zip(1..) {
                pins.drive_from(pin, slot.drive(line), slot.source_ohms(line));
            }
        }
        self.terminals.drive(pins);
        let line = &self.layout.line;
        let enable = line.enable_pulled_up.then_some(&line.enable);
        for &pin in self.layout.pulled_up.iter().chain(enable) {
            pins.drive(
                pin,
                if self.powered {
                    Drive::PullUp
                } else {
                    Drive::Floating
                },
            );
        }
        for (n, &pin) in self.layout.switch.iter().enumerate() {
            let on = self.dip >> n & 1 != 0;
            pins.drive(pin, if on { Drive::Low } else { Drive::Floating });
        }
        if self.slots.is_empty() {
            return;
        }
        let held = self.held();
        for (pin, free) in [(SCL, held.scl), (SDA, held.sda)] {
            pins.drive(pin, if free { Drive::PullUp } else { Drive::Low });
        }
        if let (Some(radio), Some(at)) = (&self.radio, &self.layout.radio) {
            radio.drive(at, pins);
        }
    }

    fn port_changed(&mut self, port: char, gpio: &Gpio, now: Time) -> bool {
        let enable = self.layout.line.enable;
        if port == enable.port() {
            let at_pin = |pins: u16| pins >> enable.number() & 1 != 0;
            let on = self.powered && at_pin(gpio.level());
            self.set_enable(on, at_pin(gpio.outputs()), now);
        }
        self.terminals.port_changed(port, gpio);
        let high = gpio.outputs() & gpio.level();
        for (slot, slot_pins) in self.slots.iter_mut().zip(self.layout.slots) {
            for (pin, line) in slot_pins.lines.iter().zip(1..) {
                if pin.port() == port {
                    slot.set_line(line, high >> pin.number() & 1 != 0);
                }
            }
        }
        let radio = self.radio.as_mut().zip(self.layout.radio.as_ref());
        let switched = radio.is_some_and(|(radio, at)| radio.port_changed(at, port, gpio, now));
        if port != SCL.port() || self.slots.is_empty() {
            return switched;
        }
        let low = gpio.pulled_low();
        let pins = Wires {
            scl: low >> SCL.number() & 1 == 0,
            sda: low >> SDA.number() & 1 == 0,
        };
        let slots = self.slots.iter_mut();
        slots.fold(switched, |changed, slot| slot.set_pins(pins) | changed)
    }

    fn set_power(&mut self, on: bool, now: Time) {
        self.powered = on;
        if on {
            self.dip_at_power_on = self.dip;
            self.set_enable(self.layout.line.enable_pulled_up, false, now);
        } else {
            self.line.power_off(now);
            self.floats_since = None;
        }
        self.terminals.set_power(on);
        for slot in &mut self.slots {
            slot.set_power(on, now);
        }
        if let Some(radio) = &mut self.radio {
            radio.set_power(on, now);
        }
    }

    fn wire(&mut self, tx: Pin) -> Option<&mut dyn Wire> {
        match tx {
            _ if tx == self.layout.line.tx => Some(&mut self.line),
            _ if Some(tx) == self.layout.rs232 => {
                self.rs232.as_mut().map(|port| port as &mut dyn Wire)
            }
            RADIO_TX => self.radio.as_mut().map(|radio| radio as &mut dyn Wire),
            _ => None,
        }
    }

    fn pins_changed(&mut self) -> bool {
        self.radio.as_mut().is_some_and(Radio::aux_changed)
    }

    fn i2c(&mut self, scl: Pin) -> Option<&mut dyn Bus> {
        (scl == SCL && !self.slots.is_empty()).then_some(self as &mut dyn Bus)
    }

    fn take_findings(&mut self) -> Vec<(Time, &'static str)> {
        let mut findings = self.line.take_findings();
        let unmodelled = self.radio.as_mut();
        let unmodelled = unmodelled.and_then(|radio| radio.module.take_unmodelled());
        findings.extend(unmodelled.map(|at| (at, FIXED_TRANSMISSION)));
        let late = |since: Time| self.line.now() >= since + GRACE;
        if let Some(since) = self.floats_since.filter(|since| late(*since)) {
            findings.push((since, FLOATING_ENABLE));
            // Reported once each time that the pin floats.
            self.floats_since = Some(Time::MAX);
        }
        findings
    }
}

impl Modio {
    /// Returns the levels of the I2C wires as the modules hold them. Each module can hold a wire low.
    fn held(&self) -> Wires {
        all(self.slots.iter().map(Slot::held))
    }
}

/// The DACs of all slots on one I2C bus.
impl Bus for Modio {
    fn wires(&self) -> Wires {
        all(self.slots.iter().map(Bus::wires))
    }

    fn address(&mut self, byte: u8, now: Time) -> bool {
        self.addressed = None;
        for (n, slot) in self.slots.iter_mut().enumerate() {
            // Pass the address to every DAC, so that those with another address ignore the following bytes.
            if slot.address(byte, now) {
                self.addressed = Some(n);
            }
        }
        self.addressed.is_some()
    }

    fn write(&mut self, byte: u8, now: Time) -> bool {
        let slots = self.slots.iter_mut();
        slots.fold(false, |taken, slot| slot.write(byte, now) | taken)
    }

    fn read(&mut self, now: Time) -> u8 {
        match self.addressed {
            Some(n) => self.slots[n].read(now),
            None => 0xFF,
        }
    }

    fn stop(&mut self, now: Time) {
        for slot in &mut self.slots {
            slot.stop(now);
        }
    }
}

/// Returns the wired AND: each wire is high only if it is high in all of `wires`.
fn all(wires: impl Iterator<Item = Wires>) -> Wires {
    wires.fold(Wires::FREE, |a, b| Wires {
        scl: a.scl && b.scl,
        sda: a.sda && b.sda,
    })
}
