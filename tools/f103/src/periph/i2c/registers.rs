//! The registers of I2C1, and its events.

use super::I2c;
use super::bits::{ccr, cr1, cr2, offset, sr1, sr2};
use crate::peripheral::{Peripheral, Unmodelled};
use crate::time::Time;

impl Peripheral for I2c {
    fn read(&mut self, offset: u32, now: Time) -> Result<u32, Unmodelled> {
        Ok(match offset {
            offset::CR1 => self.cr1,
            offset::CR2 => self.cr2,
            offset::OAR1 => self.oar[0],
            offset::OAR2 => self.oar[1],
            offset::DR => self.read_data(now),
            offset::SR1 => {
                self.shown = self.sr1;
                self.sr1
            }
            offset::SR2 => {
                let value = self.sr2 | if self.busy { sr2::BUSY } else { 0 };
                self.clear_addr(now);
                value
            }
            offset::CCR => self.ccr,
            offset::TRISE => self.trise,
            _ => return Err(Unmodelled("I2C register")),
        })
    }

    fn write(&mut self, offset: u32, value: u32, now: Time) -> Result<(), Unmodelled> {
        let in_reset = self.cr1 & cr1::SWRST != 0;
        if in_reset && offset != offset::CR1 {
            return Err(Unmodelled("I2C register written while SWRST = 1"));
        }
        match offset {
            offset::CR1 => return self.write_cr1(value, now),
            offset::CR2 => {
                self.cr2 = value & cr2::MASK;
                if value & cr2::DMA != 0 {
                    return Err(Unmodelled("I2C DMA (CR2)"));
                }
            }
            // The own addresses: without another master nobody uses them.
            offset::OAR1 => self.oar[0] = value & 0xC3FF,
            offset::OAR2 => self.oar[1] = value & 0xFF,
            offset::DR => return self.write_data(value as u8, now),
            offset::SR1 => self.sr1 &= value | !sr1::RC_W0,
            offset::SR2 => {}
            offset::CCR | offset::TRISE => {
                if offset == offset::CCR {
                    self.ccr = value & ccr::MASK;
                } else {
                    self.trise = value & 0x3F;
                }
                if self.cr1 & cr1::PE != 0 {
                    return Err(Unmodelled("I2C CCR or TRISE written while PE = 1"));
                }
            }
            _ => return Err(Unmodelled("I2C register")),
        }
        Ok(())
    }

    fn next_event(&self) -> Option<Time> {
        self.due
    }

    fn irq(&self) -> bool {
        self.irq_event() || self.irq_error()
    }

    fn reset(&mut self, _now: Time) {
        self.software_reset();
    }

    fn set_clock(&mut self, hz: u32, _now: Time) {
        self.hz = hz;
    }
}
