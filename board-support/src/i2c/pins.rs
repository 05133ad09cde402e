//! PB6 and PB7 as pins of the peripheral or as outputs set by software.

use stm32f1xx_hal::gpio::{Cr, PB6, PB7};

use super::freeing::Wires;
use crate::{design::I2C_HALF_PERIOD_US, pin::Port, wait::delay_us};

const SCL: u16 = 1 << 6;
const SDA: u16 = 1 << 7;

/// The two pins and their configuration register. The HAL's pins change their type with their mode, but these
/// change their mode at run time.
pub(crate) struct BusPins {
    _scl: PB6,
    _sda: PB7,
    /// Permission to change the configuration register, which other pins share.
    _cr: Cr<'B', false>,
}

impl BusPins {
    pub(crate) fn new(scl: PB6, sda: PB7, cr: Cr<'B', false>) -> Self {
        Self {
            _scl: scl,
            _sda: sda,
            _cr: cr,
        }
    }

    /// Makes both pins open-drain outputs set by software, released.
    pub(super) fn by_hand(&mut self) {
        self.set_scl(true);
        self.set_sda(true);
        self.configure(false);
    }

    /// Makes both pins open-drain outputs of the peripheral.
    pub(super) fn by_peripheral(&mut self) {
        self.configure(true);
    }

    /// Selects the slowest edges, 2 MHz, which is well above SCL.
    fn configure(&mut self, peripheral: bool) {
        Port::B.registers().crl().modify(|_, w| {
            w.mode6().output2().mode7().output2();
            if peripheral {
                w.cnf6().alt_open_drain().cnf7().alt_open_drain()
            } else {
                w.cnf6().open_drain().cnf7().open_drain()
            }
        });
    }

    fn set(&mut self, pin: u16, high: bool) {
        let bits = if high {
            u32::from(pin)
        } else {
            u32::from(pin) << 16
        };
        // SAFETY: one store changes the pins whose bits are set and no other, and only this value owns these pins.
        Port::B
            .registers()
            .bsrr()
            .write(|w| unsafe { w.bits(bits) });
    }
}

impl Wires for BusPins {
    fn set_scl(&mut self, high: bool) {
        self.set(SCL, high);
    }

    fn set_sda(&mut self, high: bool) {
        self.set(SDA, high);
    }

    fn scl(&self) -> bool {
        Port::B.registers().idr().read().bits() & u32::from(SCL) != 0
    }

    fn sda(&self) -> bool {
        Port::B.registers().idr().read().bits() & u32::from(SDA) != 0
    }

    fn wait(&mut self) {
        delay_us(I2C_HALF_PERIOD_US);
    }
}
