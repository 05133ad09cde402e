//! Inputs and outputs that are fixed on a board, each between a screw terminal and a pin of the part.
//!
//! | kind | circuit |
//! |---|---|
//! | digital input | an opto-coupler: the pin is low while the input is energised, else pulled up |
//! | relay | a transistor: the coil is energised while the part drives the pin high |
//! | 0 to 10 V | a divider of 10 kOhm and 4.7 kOhm, with 10 uF at the pin |
//! | 0 to 20 mA | 499 ohm to ground, beside the same divider without the capacitor |
//! | potentiometer | 10 kOhm across the supply of the part |
//! | analog output | the part's own DAC, amplified by 1 + 10 kOhm / 4.7 kOhm |
//! | switch | the pin is connected to ground or to the supply |
//! | supply monitor | an opto-coupler: the pin is high while 24 V are present |

use super::Error;
use f103::periph::gpio::{Drive, Gpio};
use f103::soc::{Pin, Pins};

/// Resistors of the divider at an analog input, and of its shunt for a current, in ohms.
const UPPER: f64 = 10_000.0;
const LOWER: f64 = 4_700.0;
const SHUNT: f64 = 499.0;
/// Voltage at the pin for each volt at the divider. The amplifier of an output has the inverse gain.
const DIVIDER: f64 = LOWER / (UPPER + LOWER);
/// Resistance of a potentiometer, in ohms.
const TRACK: f64 = 10_000.0;
/// Supply of the part in millivolts. The pins are clamped to it.
const SUPPLY: f64 = 3_300.0;

/// What is between a terminal and its pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A digital input.
    Input,
    /// A relay.
    Relay,
    /// An analog input for 0 to 10 V.
    Voltage,
    /// An analog input for 0 to 20 mA.
    Current,
    /// A potentiometer on the board.
    Potentiometer,
    /// An analog output for 0 to 10 V.
    Output,
    /// A switch on the board.
    Switch,
    /// The monitor of the 24 V supply.
    Supply,
}

/// A terminal of a board, or an element on the board that a person moves.
#[derive(Clone, Copy, Debug)]
pub struct Terminal {
    /// Name on the board, such as `X0`.
    pub name: &'static str,
    /// Pin of the part.
    pub pin: Pin,
    /// The circuit between the two.
    pub kind: Kind,
}

/// State of a terminal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Value {
    /// Digital input: whether it is energised.
    Input(bool),
    /// Relay: whether its coil is energised.
    Relay(bool),
    /// Voltage at an analog input in millivolts, up to 12 V.
    Voltage(u16),
    /// Current into an analog input in microamperes, up to 25 mA.
    Current(u16),
    /// Position of a potentiometer in thousandths of its range.
    Potentiometer(u16),
    /// Voltage of an analog output in millivolts.
    Output(u16),
    /// Position of a switch: whether the pin is connected to the supply.
    Switch(bool),
    /// Whether the 24 V supply is present.
    Supply(bool),
}

/// The terminals of a board with their states.
#[derive(Clone, Debug)]
pub struct Terminals {
    table: &'static [Terminal],
    values: Vec<Value>,
    powered: bool,
}

impl Terminals {
    /// Returns these terminals with nothing applied to them and the 24 V supply present, without power.
    #[must_use]
    pub fn new(table: &'static [Terminal]) -> Self {
        let value = |terminal: &Terminal| match terminal.kind {
            Kind::Input => Value::Input(false),
            Kind::Relay => Value::Relay(false),
            Kind::Voltage => Value::Voltage(0),
            Kind::Current => Value::Current(0),
            Kind::Potentiometer => Value::Potentiometer(0),
            Kind::Output => Value::Output(0),
            Kind::Switch => Value::Switch(false),
            Kind::Supply => Value::Supply(true),
        };
        Self {
            table,
            values: table.iter().map(value).collect(),
            powered: false,
        }
    }

    /// Returns every terminal with its state, in the order on the board.
    pub fn iter(&self) -> impl Iterator<Item = (&'static Terminal, Value)> + '_ {
        self.table.iter().zip(self.values.iter().copied())
    }

    /// Returns the state of the terminal `name`; `None` if the board has no such terminal.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<Value> {
        let mut all = self.iter();
        all.find(|(terminal, _)| terminal.name == name)
            .map(|(_, value)| value)
    }

    /// Applies `value` to the terminal `name` from outside.
    ///
    /// # Errors
    ///
    /// [`Error::Terminal`] if the board has no such terminal, [`Error::TerminalKind`] if it is of another kind or an
    /// output, [`Error::Range`] if the value is out of its range.
    pub fn set(&mut self, name: &str, value: Value) -> Result<(), Error> {
        match value {
            Value::Voltage(12_001..) => return Err(Error::Range("the input takes 0 to 12000 mV")),
            Value::Current(25_001..) => return Err(Error::Range("the input takes 0 to 25000 uA")),
            Value::Potentiometer(1_001..) => {
                return Err(Error::Range("a potentiometer takes 0 to 1000"));
            }
            Value::Relay(_) | Value::Output(_) => return Err(Error::TerminalKind),
            _ => {}
        }
        let at = self.table.iter().position(|known| known.name == name);
        let place = at.map(|at| &mut self.values[at]).ok_or(Error::Terminal)?;
        if core::mem::discriminant(place) != core::mem::discriminant(&value) {
            return Err(Error::TerminalKind);
        }
        *place = value;
        Ok(())
    }

    /// Switches the supply of the board. Without it the relays and the analog outputs are off.
    pub(super) fn set_power(&mut self, on: bool) {
        self.powered = on;
        if !on {
            self.take_outputs(|_| true, |_| None);
        }
    }

    /// Takes over the outputs of the part at `port`.
    pub(super) fn port_changed(&mut self, port: char, gpio: &Gpio) {
        if self.powered {
            self.take_outputs(|pin| pin.port() == port, |_| Some(gpio));
        }
    }

    fn take_outputs<'a>(
        &mut self,
        concerns: impl Fn(Pin) -> bool,
        gpio: impl Fn(Pin) -> Option<&'a Gpio>,
    ) {
        for (Terminal { pin, .. }, value) in self.table.iter().zip(&mut self.values) {
            if !concerns(*pin) {
                continue;
            }
            let gpio = gpio(*pin);
            match value {
                Value::Relay(on) => {
                    let high = gpio.map_or(0, |gpio| gpio.outputs() & gpio.level());
                    *on = high >> pin.number() & 1 != 0;
                }
                Value::Output(millivolts) => {
                    let at_pin = gpio.and_then(|gpio| gpio.dac(pin.number())).unwrap_or(0);
                    *millivolts = (f64::from(at_pin) / DIVIDER).round() as u16;
                }
                _ => {}
            }
        }
    }

    /// Drives the pins of the part.
    pub(super) fn drive(&self, pins: &mut Pins) {
        for (terminal, value) in self.iter() {
            let (drive, ohms) = match value {
                _ if !self.powered => (Drive::Floating, 0),
                Value::Input(energised) => (at_opto_coupler(energised), 0),
                Value::Switch(high) => (level(high), 0),
                // The emitter of the opto-coupler, with a resistor to ground.
                Value::Supply(present) => (level(present), 0),
                // The capacitor holds the voltage during a sample.
                Value::Voltage(millivolts) => (clamped(f64::from(millivolts) * DIVIDER), 0),
                Value::Current(microamperes) => {
                    let ohms = parallel(SHUNT, UPPER + LOWER);
                    let millivolts = f64::from(microamperes) / 1000.0 * ohms;
                    let source = parallel(SHUNT + UPPER, LOWER);
                    (clamped(millivolts * DIVIDER), source as u32)
                }
                Value::Potentiometer(thousandths) => {
                    let below = f64::from(thousandths) / 1000.0;
                    let source = TRACK * below * (1.0 - below);
                    (clamped(SUPPLY * below), source as u32)
                }
                Value::Relay(_) | Value::Output(_) => continue,
            };
            pins.drive_from(terminal.pin, drive, ohms);
        }
    }
}

/// Returns what the transistor of an opto-coupler with a pull-up drives.
const fn at_opto_coupler(conducts: bool) -> Drive {
    if conducts { Drive::Low } else { Drive::PullUp }
}

const fn level(high: bool) -> Drive {
    if high { Drive::High } else { Drive::Low }
}

/// Returns a voltage in millivolts that the diodes at the pin limit.
fn clamped(millivolts: f64) -> Drive {
    Drive::Millivolts(millivolts.min(SUPPLY).round() as u16)
}

/// Returns the resistance of two resistors in parallel.
const fn parallel(one: f64, two: f64) -> f64 {
    one * two / (one + two)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: [Terminal; 3] = [
        Terminal {
            name: "X0",
            pin: Pin::new('B', 13),
            kind: Kind::Input,
        },
        Terminal {
            name: "Y0",
            pin: Pin::new('C', 9),
            kind: Kind::Relay,
        },
        Terminal {
            name: "AD0",
            pin: Pin::new('A', 1),
            kind: Kind::Voltage,
        },
    ];

    #[test]
    fn value_of_the_wrong_kind_or_out_of_range_is_refused() {
        let mut terminals = Terminals::new(&TABLE);
        for (name, value, error) in [
            ("X0", Value::Voltage(1), Error::TerminalKind),
            ("Y0", Value::Relay(true), Error::TerminalKind),
            ("X7", Value::Input(true), Error::Terminal),
        ] {
            assert_eq!(terminals.set(name, value), Err(error), "{name}");
        }
        let most = terminals.set("AD0", Value::Voltage(12_001));
        assert!(matches!(most, Err(Error::Range(_))));
        terminals.set("AD0", Value::Voltage(12_000)).unwrap();
        assert_eq!(terminals.get("AD0"), Some(Value::Voltage(12_000)));
        assert_eq!(terminals.get("X7"), None);
    }
}
