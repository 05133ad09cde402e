//! The registers of RCC, and its events.

use super::{CFGR_SW, CIR_CSSC, CIR_CSSF, Changes, Rcc};
use crate::peripheral::{Peripheral, Unmodelled};
use crate::time::Time;

impl Peripheral for Rcc {
    fn read(&mut self, offset: u32, _now: Time) -> Result<u32, Unmodelled> {
        Ok(match offset {
            0x00 => self.read_cr(),
            0x04 => self.cfgr | self.sws << 2,
            // No ready interrupt can be enabled, and without its enable no flag is set but CSSF.
            0x08 => CIR_CSSF * u32::from(self.failed),
            0x0C => self.rstr.0,
            0x10 => self.rstr.1,
            0x14 => self.ahbenr,
            0x18 => self.enr.0,
            0x1C => self.enr.1,
            0x20 => return Err(Unmodelled("RCC_BDCR, the backup domain")),
            0x24 => self.read_csr(),
            _ => return Err(Unmodelled("a reserved address of RCC")),
        })
    }

    fn write(&mut self, offset: u32, value: u32, now: Time) -> Result<(), Unmodelled> {
        match offset {
            0x00 => return self.write_cr(value, now),
            0x04 => {
                let written = self.write_cfgr(value);
                self.switch();
                return written;
            }
            0x08 => {
                self.failed &= value & CIR_CSSC == 0;
                if value & 0x1F00 != 0 {
                    return Err(Unmodelled("RCC_CIR's ready interrupts"));
                }
            }
            0x0C => {
                self.changes.resets.0 |= value & !self.rstr.0;
                self.rstr.0 = value;
            }
            0x10 => {
                self.changes.resets.1 |= value & !self.rstr.1;
                self.rstr.1 = value;
            }
            0x14 => self.ahbenr = value & self.enables[0],
            0x18 => {
                self.enr.0 = value & self.enables[1];
                self.changes.clocks = true;
            }
            0x1C => {
                self.enr.1 = value & self.enables[2];
                self.changes.clocks = true;
            }
            0x20 => return Err(Unmodelled("RCC_BDCR, the backup domain")),
            0x24 => self.write_csr(value, now),
            _ => return Err(Unmodelled("a reserved address of RCC")),
        }
        Ok(())
    }

    fn next_event(&self) -> Option<Time> {
        // Events are a switch that waits for its clock, and a clock that comes back. Ready flags are computed when
        // they are read.
        if self.stopped() {
            return self.source(self.sws).filter(|&at| at < Time::MAX);
        }
        if self.cfgr & CFGR_SW == self.sws {
            return None;
        }
        self.wanted().filter(|&at| at < Time::MAX)
    }

    fn advance(&mut self, now: Time) {
        let stopped = self.stopped();
        self.now = now;
        self.changes.clocks |= stopped && !self.stopped();
        self.switch();
    }

    fn reset(&mut self, now: Time) {
        let fresh = Self::new(self.crystal, self.oscillators, self.enables);
        *self = Self {
            csr_flags: self.csr_flags,
            now,
            hsi: Some(now),
            changes: Changes {
                clocks: true,
                ..Changes::default()
            },
            ..fresh
        };
    }
}
