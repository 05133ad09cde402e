//! PB6 and PB7 as pins of the peripheral or as outputs set by software.

use super::freeing::Wires;
use crate::{
    design::I2C_HALF_PERIOD_US,
    pin::{Mode, Pin},
    wait::delay_us,
};

const SCL: Pin = Pin::b(6);
const SDA: Pin = Pin::b(7);

/// The two pins. The slowest edges, 2 MHz, are well above SCL.
pub(super) struct BusPins;

impl BusPins {
    /// Makes both pins open-drain outputs set by software, released.
    pub(super) fn by_hand(&mut self) {
        self.set_scl(true);
        self.set_sda(true);
        SCL.configure(Mode::OpenDrain);
        SDA.configure(Mode::OpenDrain);
    }

    /// Makes both pins open-drain outputs of the peripheral.
    pub(super) fn by_peripheral(&mut self) {
        SCL.configure(Mode::PeripheralOpenDrain);
        SDA.configure(Mode::PeripheralOpenDrain);
    }
}

impl Wires for BusPins {
    fn set_scl(&mut self, high: bool) {
        SCL.set(high);
    }

    fn set_sda(&mut self, high: bool) {
        SDA.set(high);
    }

    fn scl(&self) -> bool {
        SCL.is_high()
    }

    fn sda(&self) -> bool {
        SDA.is_high()
    }

    fn wait(&mut self) {
        delay_us(I2C_HALF_PERIOD_US);
    }
}
