//! The bus as an I2C master uses it, byte by byte.

use crate::time::Time;

/// The levels of the two wires without the I2C block: `true` = released, pulled high.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wires {
    /// The clock.
    pub scl: bool,
    /// The data.
    pub sda: bool,
}

impl Wires {
    /// Both released: a free bus.
    pub const FREE: Self = Self {
        scl: true,
        sda: true,
    };
}

/// A bus without devices, with its pull-ups.
#[derive(Clone, Copy, Debug)]
pub struct NoDevice;

impl Bus for NoDevice {
    fn wires(&self) -> Wires {
        Wires::FREE
    }

    fn address(&mut self, _byte: u8, _now: Time) -> bool {
        false
    }

    fn write(&mut self, _byte: u8, _now: Time) -> bool {
        false
    }

    fn read(&mut self, _now: Time) -> u8 {
        0xFF
    }

    fn stop(&mut self, _now: Time) {}
}

/// The devices on a bus, all of them together.
pub trait Bus {
    /// Returns what the devices do to the wires, and what the firmware does when it drives the pins itself.
    fn wires(&self) -> Wires;

    /// Takes a start condition and an address byte (bit 0 = read). Returns whether a device acknowledges.
    fn address(&mut self, byte: u8, now: Time) -> bool;

    /// Takes a data byte from the master. Returns whether it is acknowledged.
    fn write(&mut self, byte: u8, now: Time) -> bool;

    /// Returns the next byte for the master: 0xFF when no device drives the wire.
    fn read(&mut self, now: Time) -> u8;

    /// Takes a stop condition.
    fn stop(&mut self, now: Time);
}
