//! DAC, RM0008 chapter 12: two channels of 12 bits at PA4 and PA5, loaded by software.
//!
//! Triggers, waves and DMA are not modelled. The output settles immediately.

use crate::peripheral::{Peripheral, Unmodelled};
use crate::time::Time;

/// CR, 12.5.1, of channel 1; channel 2 is 16 bits higher.
mod cr {
    pub const EN: u32 = 1 << 0;
    pub const BOFF: u32 = 1 << 1;
    pub const MASK: u32 = 0x1FFF;
}

/// Reference voltage in millivolts: the supply.
const SUPPLY_MV: u32 = 3300;
/// With its buffer, an output reaches both supplies only up to this voltage in millivolts (DS5792, DAC characteristics).
const BUFFER_MV: u16 = 200;

/// The DAC's registers.
#[derive(Debug, Default)]
pub struct Dac {
    cr: u32,
    /// DHR and DOR have the same value, because no trigger is modelled.
    codes: [u16; 2],
}

impl Dac {
    /// Returns the voltage of channel `n`, 0 or 1, in millivolts (12.3.5); `None` while the channel is off.
    #[must_use]
    pub fn millivolts(&self, n: usize) -> Option<u16> {
        let cr = self.cr >> (16 * n);
        (cr & cr::EN != 0).then(|| {
            let exact = (u32::from(self.codes[n]) * SUPPLY_MV / 4095) as u16;
            if cr & cr::BOFF == 0 {
                exact.clamp(BUFFER_MV, SUPPLY_MV as u16 - BUFFER_MV)
            } else {
                exact
            }
        })
    }
}

impl Peripheral for Dac {
    fn read(&mut self, offset: u32, _now: Time) -> Result<u32, Unmodelled> {
        let [one, two] = self.codes.map(u32::from);
        Ok(match offset {
            0x00 => self.cr,
            // SWTRIGR is write-only.
            0x04 => 0,
            0x08 | 0x2C => one,
            0x0C => one << 4,
            0x10 => one >> 4,
            0x14 | 0x30 => two,
            0x18 => two << 4,
            0x1C => two >> 4,
            0x20 => two << 16 | one,
            0x24 => two << 20 | one << 4,
            0x28 => two >> 4 << 8 | one >> 4,
            _ => return Err(Unmodelled("a reserved address of DAC")),
        })
    }

    fn write(&mut self, offset: u32, value: u32, _now: Time) -> Result<(), Unmodelled> {
        let right = |value: u32| (value & 0xFFF) as u16;
        let left = |value: u32| (value >> 4 & 0xFFF) as u16;
        let byte = |value: u32| (value & 0xFF) as u16 * 16;
        match offset {
            0x00 => {
                self.cr = value & (cr::MASK | cr::MASK << 16);
                let modelled = cr::EN | cr::BOFF;
                if self.cr & !(modelled | modelled << 16) != 0 {
                    return Err(Unmodelled("DAC triggers, waves or DMA (CR)"));
                }
            }
            0x04 => {}
            0x08 => self.codes[0] = right(value),
            0x0C => self.codes[0] = left(value),
            0x10 => self.codes[0] = byte(value),
            0x14 => self.codes[1] = right(value),
            0x18 => self.codes[1] = left(value),
            0x1C => self.codes[1] = byte(value),
            0x20 => self.codes = [right(value), right(value >> 16)],
            0x24 => self.codes = [left(value), left(value >> 16)],
            0x28 => self.codes = [byte(value), byte(value >> 8)],
            _ => return Err(Unmodelled("a reserved or read-only address of DAC")),
        }
        Ok(())
    }

    fn reset(&mut self, _now: Time) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_alignment_loads_its_channel() {
        let mut dac = Dac::default();
        for (offset, value, codes) in [
            (0x08, 0xF123, [0x123, 0]),
            (0x0C, 0x4567, [0x456, 0]),
            (0x10, 0x89, [0x890, 0]),
            (0x14, 0x321, [0x890, 0x321]),
            (0x18, 0x6540, [0x890, 0x654]),
            (0x1C, 0x98, [0x890, 0x980]),
            (0x20, 0x0321_0123, [0x123, 0x321]),
            (0x24, 0x6540_4560, [0x456, 0x654]),
            (0x28, 0x9889, [0x890, 0x980]),
        ] {
            dac.write(offset, value, Time::ZERO).unwrap();
            let read = [0x2C, 0x30].map(|dor| dac.read(dor, Time::ZERO).unwrap());
            assert_eq!(read, codes, "{offset:#x}");
        }
        assert_eq!(dac.read(0x28, Time::ZERO), Ok(0x9889));
    }

    #[test]
    fn buffer_keeps_the_output_away_from_the_supplies() {
        let mut dac = Dac::default();
        assert_eq!(dac.millivolts(0), None, "off");
        // Channel 1 without its buffer, channel 2 with it.
        dac.write(0, cr::EN | cr::BOFF | cr::EN << 16, Time::ZERO)
            .unwrap();
        assert_eq!([0, 1].map(|n| dac.millivolts(n)), [Some(0), Some(200)]);
        dac.write(0x20, 0x0FFF_0FFF, Time::ZERO).unwrap();
        assert_eq!([0, 1].map(|n| dac.millivolts(n)), [Some(3300), Some(3100)]);
        dac.write(0x20, 0x0800_0800, Time::ZERO).unwrap();
        assert_eq!([0, 1].map(|n| dac.millivolts(n)), [Some(1650), Some(1650)]);
        assert!(dac.write(0, 1 << 2, Time::ZERO).is_err(), "a trigger");
    }
}
