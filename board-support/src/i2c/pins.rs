//! PB6 and PB7 as the peripheral's, or moved by hand.

use stm32f1xx_hal::gpio::{Cr, PB6, PB7};

use super::freeing::Wires;
use crate::{design::I2C_HALF_PERIOD_US, pin::Port, wait::delay_us};

const SCL: u16 = 1 << 6;
const SDA: u16 = 1 << 7;

/// The two pins, and the register that says what they are. The HAL's pins change their type with their
/// use, and these change it while they run.
pub(crate) struct BusPins {
    _scl: PB6,
    _sda: PB7,
    /// The register is shared with other pins; who has this may change it.
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

    /// Open-drain outputs moved by hand, both let go.
    pub(super) fn by_hand(&mut self) {
        self.set_scl(true);
        self.set_sda(true);
        self.configure(false);
    }

    /// Open-drain outputs of the peripheral.
    pub(super) fn by_peripheral(&mut self) {
        self.configure(true);
    }

    /// The slowest slopes, 2 MHz: SCL is far below that.
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
        // SAFETY: changes the pins whose bits are set and no other, in one store, and this value alone
        // owns them.
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
