//! Power control, RM0008 chapter 5: the voltage detector (PVD) that compares the supply with a threshold.
//!
//! Stop and standby, and the PVD's interrupt (EXTI line 16), are not modelled. A supply below 2.0 V is a
//! power-down, for which the chip has its own call.

use crate::peripheral::{Peripheral, Unmodelled};
use crate::time::Time;

/// The supply, in millivolts.
pub const NOMINAL_MV: u16 = 3300;

const CR_PVDE: u32 = 1 << 4;
const CR_PLS: u32 = 0b111 << 5;
const CR_DBP: u32 = 1 << 8;
const CR_WRITABLE: u32 = CR_PVDE | CR_PLS | CR_DBP;
/// LPDS and PDDS, which choose between stop and standby.
const CR_LOW_POWER: u32 = 0b11;
const CSR_PVDO: u32 = 1 << 2;
const CSR_EWUP: u32 = 1 << 8;

/// Typical thresholds of a falling supply in millivolts, by PLS (DS5319 table 11).
const FALLING_MV: [u16; 8] = [2080, 2180, 2280, 2380, 2480, 2580, 2680, 2780];
/// A rising supply has to exceed the threshold by this much (DS5319 table 11).
const HYSTERESIS_MV: u16 = 100;

/// The PWR registers.
#[derive(Debug)]
pub struct Pwr {
    cr: u32,
    csr: u32,
    supply_mv: u16,
    /// PVDO, kept because of the hysteresis.
    low: bool,
}

impl Default for Pwr {
    fn default() -> Self {
        Self {
            cr: 0,
            csr: 0,
            supply_mv: NOMINAL_MV,
            low: false,
        }
    }
}

impl Pwr {
    /// Returns the supply, in millivolts.
    #[must_use]
    pub const fn supply_mv(&self) -> u16 {
        self.supply_mv
    }

    /// Sets the supply, in millivolts.
    pub fn set_supply_mv(&mut self, millivolts: u16) {
        self.supply_mv = millivolts;
        self.compare();
    }

    fn compare(&mut self) {
        let falling = FALLING_MV[(self.cr >> 5 & 7) as usize];
        let threshold = if self.low {
            falling + HYSTERESIS_MV
        } else {
            falling
        };
        self.low = self.cr & CR_PVDE != 0 && self.supply_mv < threshold;
    }
}

impl Peripheral for Pwr {
    fn read(&mut self, offset: u32, _now: Time) -> Result<u32, Unmodelled> {
        match offset {
            0x00 => Ok(self.cr),
            0x04 => Ok(self.csr | if self.low { CSR_PVDO } else { 0 }),
            _ => Err(Unmodelled("a reserved address of PWR")),
        }
    }

    fn write(&mut self, offset: u32, value: u32, _now: Time) -> Result<(), Unmodelled> {
        match offset {
            0x00 => {
                self.cr = value & CR_WRITABLE;
                self.compare();
                if value & CR_LOW_POWER != 0 {
                    return Err(Unmodelled("stop and standby modes (PWR_CR)"));
                }
            }
            0x04 => self.csr = value & CSR_EWUP,
            _ => return Err(Unmodelled("a reserved address of PWR")),
        }
        Ok(())
    }

    fn reset(&mut self, _now: Time) {
        *self = Self {
            supply_mv: self.supply_mv,
            ..Self::default()
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: Time = Time::ZERO;

    #[test]
    fn pvdo_follows_the_supply_with_hysteresis_while_pvde_is_set() {
        let mut pwr = Pwr::default();
        pwr.set_supply_mv(2700);
        assert_eq!(pwr.read(4, NOW), Ok(0), "the detector is off");
        pwr.write(0, CR_PVDE | CR_PLS, NOW).unwrap();
        assert_eq!(pwr.read(4, NOW), Ok(CSR_PVDO));
        pwr.set_supply_mv(2850);
        assert_eq!(pwr.read(4, NOW), Ok(CSR_PVDO), "within the hysteresis");
        pwr.set_supply_mv(2900);
        assert_eq!(pwr.read(4, NOW), Ok(0));
        pwr.set_supply_mv(2790);
        assert_eq!(pwr.read(4, NOW), Ok(0), "falling");
        pwr.write(0, CR_PVDE, NOW).unwrap();
        pwr.set_supply_mv(2100);
        assert_eq!(pwr.read(4, NOW), Ok(0), "the lowest threshold");
        pwr.set_supply_mv(2000);
        assert_eq!(pwr.read(4, NOW), Ok(CSR_PVDO));
    }

    #[test]
    fn reset_keeps_the_supply_and_clears_the_detector() {
        let mut pwr = Pwr::default();
        pwr.write(0, CR_PVDE | CR_PLS, NOW).unwrap();
        pwr.set_supply_mv(2500);
        pwr.reset(NOW);
        assert_eq!((pwr.supply_mv(), pwr.read(0, NOW)), (2500, Ok(0)));
        assert_eq!(pwr.read(4, NOW), Ok(0));
    }
}
