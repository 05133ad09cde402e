//! bxCAN, RM0008 chapter 24, on a bus without traffic: the modes, the bit timing and the filters. Sending is not
//! modelled.

use crate::peripheral::{Peripheral, Unmodelled};
use crate::time::Time;

/// MCR, 24.9.2.
mod mcr {
    pub const INRQ: u32 = 1 << 0;
    pub const SLEEP: u32 = 1 << 1;
    pub const RESET: u32 = 1 << 15;
    /// DBF and SLEEP.
    pub const AFTER_RESET: u32 = 0x0001_0002;
    pub const MASK: u32 = 0x0001_00FF;
}

/// MSR, 24.9.2. The interrupt flags stay clear.
mod msr {
    pub const INAK: u32 = 1 << 0;
    pub const SLAK: u32 = 1 << 1;
    /// RX and SAMP: the bus is recessive.
    pub const RECESSIVE: u32 = 0b11 << 10;
}

/// Recessive bits after which the controller takes part in the traffic (24.4.2).
const RECESSIVE_BITS: u64 = 11;
/// TSR: the three mailboxes are empty.
const EMPTY: u32 = 0x1C00_0000;
/// FMR after reset, and FINIT (24.9.4).
const FMR_RESET: u32 = 0x2A1C_0E01;
const BTR_RESET: u32 = 0x0123_0000;

/// The registers of bxCAN.
#[derive(Debug)]
pub struct Can {
    hz: u32,
    mcr: u32,
    /// INAK and SLAK.
    state: u32,
    /// Instant at which INAK clears, after INRQ was cleared.
    leaves: Option<Time>,
    ier: u32,
    btr: u32,
    fmr: u32,
    /// FM1R, FS1R, FFA1R, FA1R.
    filters: [u32; 4],
    banks: [u32; 28],
}

impl Default for Can {
    fn default() -> Self {
        Self {
            hz: 0,
            mcr: mcr::AFTER_RESET,
            state: msr::SLAK,
            leaves: None,
            ier: 0,
            btr: BTR_RESET,
            fmr: FMR_RESET,
            filters: [0; 4],
            banks: [0; 28],
        }
    }
}

impl Can {
    fn write_mcr(&mut self, value: u32, now: Time) {
        if value & mcr::RESET != 0 {
            self.reset(now);
            return;
        }
        self.mcr = value & mcr::MASK;
        if value & mcr::INRQ != 0 {
            // Also from the sleep mode: ST's snippets request the initialisation before they clear SLEEP.
            self.state = msr::INAK;
            self.leaves = None;
        } else if self.state & msr::INAK != 0 && self.leaves.is_none() {
            self.leaves = Some(now + Time::cycles(RECESSIVE_BITS * self.bit_cycles(), self.hz));
        } else if self.state & msr::INAK == 0 {
            self.state = if value & mcr::SLEEP != 0 {
                msr::SLAK
            } else {
                0
            };
        }
    }

    /// Returns the cycles of PCLK1 in a bit (24.7.7).
    const fn bit_cycles(&self) -> u64 {
        let quanta = 3 + (self.btr >> 16 & 0xF) + (self.btr >> 20 & 7);
        quanta as u64 * ((self.btr & 0x3FF) + 1) as u64
    }
}

impl Peripheral for Can {
    fn read(&mut self, offset: u32, _now: Time) -> Result<u32, Unmodelled> {
        Ok(match offset {
            0x00 => self.mcr,
            0x04 => self.state | msr::RECESSIVE,
            0x08 => EMPTY,
            // RF0R, RF1R, ESR: nothing was received, no error.
            0x0C | 0x10 | 0x18 => 0,
            0x14 => self.ier,
            0x1C => self.btr,
            // The mailboxes have no messages.
            0x180..0x1D0 => 0,
            0x200 => self.fmr,
            0x204 => self.filters[0],
            0x20C => self.filters[1],
            0x214 => self.filters[2],
            0x21C => self.filters[3],
            0x240..0x2B0 => self.banks[(offset as usize - 0x240) / 4],
            _ => return Err(Unmodelled("a reserved address of CAN")),
        })
    }

    fn write(&mut self, offset: u32, value: u32, now: Time) -> Result<(), Unmodelled> {
        match offset {
            0x00 => self.write_mcr(value, now),
            // MSR, TSR, RF0R, RF1R, ESR: no flag is set that a write could clear.
            0x04 | 0x08 | 0x0C | 0x10 | 0x18 => {}
            0x14 => self.ier = value & 0x0003_8F7F,
            0x1C if self.state & msr::INAK == 0 => {
                return Err(Unmodelled(
                    "CAN BTR written outside the initialisation mode: the write is lost",
                ));
            }
            0x1C => self.btr = value & 0xC37F_03FF,
            0x180..0x1B0 if offset & 0xF == 0 && value & 1 != 0 => {
                return Err(Unmodelled("a message sent on CAN"));
            }
            // TDTR, TDLR and TDHR of a mailbox, and TIR without TXRQ.
            0x180..0x1B0 => {}
            0x200 => self.fmr = value & 1 | self.fmr & !1,
            0x204 => self.filters[0] = value & 0x3FFF,
            0x20C => self.filters[1] = value & 0x3FFF,
            0x214 => self.filters[2] = value & 0x3FFF,
            0x21C => self.filters[3] = value & 0x3FFF,
            0x240..0x2B0 => self.banks[(offset as usize - 0x240) / 4] = value,
            _ => return Err(Unmodelled("a reserved or read-only address of CAN")),
        }
        Ok(())
    }

    fn advance(&mut self, now: Time) {
        if self.leaves.is_some_and(|at| at <= now) {
            self.leaves = None;
            self.state = if self.mcr & mcr::SLEEP != 0 {
                msr::SLAK
            } else {
                0
            };
        }
    }

    fn reset(&mut self, _now: Time) {
        *self = Self {
            hz: self.hz,
            ..Self::default()
        };
    }

    fn set_clock(&mut self, hz: u32, _now: Time) {
        self.hz = hz;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn initialisation_ends_after_eleven_recessive_bits() {
        let mut can = Can::default();
        can.set_clock(36_000_000, Time::ZERO);
        let state = |can: &mut Can, at| {
            can.advance(at);
            can.read(4, at).unwrap() & (msr::INAK | msr::SLAK)
        };
        assert_eq!(state(&mut can, Time::ZERO), msr::SLAK);
        assert!(can.write(0x1C, 0, Time::ZERO).is_err(), "BTR while asleep");
        can.write(0, mcr::AFTER_RESET | mcr::INRQ, Time::ZERO)
            .unwrap();
        assert_eq!(state(&mut can, Time::ZERO), msr::INAK);
        // 250 kbit/s: 6 quanta of 24 cycles.
        can.write(0x1C, 1 << 20 | 2 << 16 | 23, Time::ZERO).unwrap();
        can.write(0, 0, Time::ZERO).unwrap();
        assert_eq!(state(&mut can, Time::from_us(43)), msr::INAK);
        assert_eq!(state(&mut can, Time::from_us(44)), 0);
        can.write(0, mcr::RESET, Time::from_us(50)).unwrap();
        assert_eq!(state(&mut can, Time::from_us(50)), msr::SLAK);
    }

    #[test]
    fn filters_are_kept_and_sending_is_reported() {
        let mut can = Can::default();
        for (offset, value) in [(0x204, 1), (0x21C, 3), (0x240, 0x20), (0x2AC, 7)] {
            can.write(offset, value, Time::ZERO).unwrap();
            assert_eq!(can.read(offset, Time::ZERO), Ok(value));
        }
        can.write(0x200, 0, Time::ZERO).unwrap();
        assert_eq!(can.read(0x200, Time::ZERO), Ok(FMR_RESET & !1));
        assert_eq!(can.write(0x184, 8, Time::ZERO), Ok(()));
        assert!(can.write(0x180, 1, Time::ZERO).is_err());
    }
}
