//! The independent watchdog, RM0008 chapter 19: a 12-bit down-counter on the LSI that only a reset stops.

use crate::periph::clocks::Oscillators;
use crate::peripheral::{Peripheral, Unmodelled};
use crate::time::Time;

/// PR and RLR take up to this many LSI cycles to arrive (RM0008 19.4.4).
const UPDATE_CYCLES: u64 = 5;

const KEY_RELOAD: u32 = 0xAAAA;
const KEY_ACCESS: u32 = 0x5555;
const KEY_START: u32 = 0xCCCC;

/// The watchdog.
#[derive(Debug)]
pub struct Iwdg {
    /// The LSI in Hz.
    lsi: u32,
    open: bool,
    prescaler: u32,
    reload: u32,
    /// Until when SR shows PVU and RVU.
    prescaler_busy: Time,
    reload_busy: Time,
    /// When it resets the part, once started.
    bites: Option<Time>,
    bitten: bool,
}

impl Default for Iwdg {
    fn default() -> Self {
        Self::new(Oscillators::TYPICAL.lsi)
    }
}

impl Iwdg {
    /// A watchdog that has not been started, on an LSI of `lsi` Hz.
    #[must_use]
    pub fn new(lsi: u32) -> Self {
        Self {
            lsi,
            open: false,
            prescaler: 0,
            reload: 0xFFF,
            prescaler_busy: Time::ZERO,
            reload_busy: Time::ZERO,
            bites: None,
            bitten: false,
        }
    }

    /// Whether it has been started.
    #[must_use]
    pub fn running(&self) -> bool {
        self.bites.is_some()
    }

    /// Whether it has asked for a reset since the last call.
    pub fn take_bite(&mut self) -> bool {
        core::mem::take(&mut self.bitten)
    }

    /// From a reload to the reset (RM0008 table 96).
    fn timeout(&self) -> Time {
        // PR 0 to 6 divide by 4 to 256; 7 does as 6.
        let divider = 4u64 << self.prescaler.min(6);
        Time::cycles(u64::from(self.reload + 1) * divider, self.lsi)
    }
}

impl Peripheral for Iwdg {
    fn read(&mut self, offset: u32, now: Time) -> Result<u32, Unmodelled> {
        Ok(match offset {
            0x00 => 0,
            0x04 => self.prescaler,
            0x08 => self.reload,
            0x0C => u32::from(self.prescaler_busy > now) | u32::from(self.reload_busy > now) << 1,
            _ => return Err(Unmodelled("a reserved address of IWDG")),
        })
    }

    fn write(&mut self, offset: u32, value: u32, now: Time) -> Result<(), Unmodelled> {
        match offset {
            0x00 => {
                self.open = value & 0xFFFF == KEY_ACCESS;
                match value & 0xFFFF {
                    KEY_START if self.bites.is_none() => self.bites = Some(now + self.timeout()),
                    KEY_RELOAD if self.bites.is_some() => self.bites = Some(now + self.timeout()),
                    _ => {}
                }
            }
            0x04 if !self.open => return Err(Unmodelled("IWDG_PR written while protected")),
            0x08 if !self.open => return Err(Unmodelled("IWDG_RLR written while protected")),
            0x04 if self.prescaler_busy > now => {
                return Err(Unmodelled("IWDG_PR written while PVU is set"));
            }
            0x08 if self.reload_busy > now => {
                return Err(Unmodelled("IWDG_RLR written while RVU is set"));
            }
            0x04 => {
                self.prescaler = value & 7;
                self.prescaler_busy = now + Time::cycles(UPDATE_CYCLES, self.lsi);
            }
            0x08 => {
                self.reload = value & 0xFFF;
                self.reload_busy = now + Time::cycles(UPDATE_CYCLES, self.lsi);
            }
            0x0C => {}
            _ => return Err(Unmodelled("a reserved address of IWDG")),
        }
        Ok(())
    }

    fn next_event(&self) -> Option<Time> {
        self.bites
    }

    fn advance(&mut self, now: Time) {
        if self.bites.is_some_and(|at| at <= now) {
            self.bites = None;
            self.bitten = true;
        }
    }

    fn reset(&mut self, _now: Time) {
        *self = Self::new(self.lsi);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_bites_after_its_timeout_unless_fed() {
        let mut dog = Iwdg::default();
        dog.write(0, KEY_START, Time::ZERO).unwrap();
        assert_eq!(
            dog.next_event(),
            Some(Time::from_us(409_600)),
            "the longest at /4"
        );
        dog.write(0, KEY_ACCESS, Time::ZERO).unwrap();
        dog.write(4, 2, Time::ZERO).unwrap();
        dog.write(8, 999, Time::ZERO).unwrap();
        assert_eq!(dog.read(0x0C, Time::ZERO), Ok(3));
        assert_eq!(dog.read(0x0C, Time::from_us(125)), Ok(0));
        dog.write(0, KEY_RELOAD, Time::from_ms(1)).unwrap();
        assert_eq!(
            dog.next_event(),
            Some(Time::from_ms(401)),
            "1000 x 16 / 40 kHz"
        );
        assert!(
            dog.write(8, 1, Time::from_ms(1)).is_err(),
            "a reload closes the access"
        );
        dog.advance(Time::from_ms(400));
        assert!(!dog.take_bite());
        dog.advance(Time::from_ms(401));
        assert!(dog.take_bite());
    }
}
