//! The parts of the core's debug blocks that firmware may use without a debugger: DWT's cycle counter
//! (ARMv7-M ARM, DDI 0403E C1.8). The core itself answers the ITM and the system control space.

use crate::peripheral::Unmodelled;

/// Where DWT is.
pub const BASE: u32 = 0xE000_1000;
/// Bytes of DWT's registers.
pub const SIZE: u32 = 0x1000;

const CTRL_CYCCNTENA: u32 = 1;
/// Four comparators, as the Cortex-M3 has.
const CTRL_NUMCOMP: u32 = 4 << 28;

/// The cycle counter. It counts HCLK whether or not DEMCR.TRCENA is set.
#[derive(Debug, Default)]
pub struct Dwt {
    /// CYCCNT when it is stopped; else CYCCNT minus the cycle of HCLK.
    count: u32,
    running: bool,
}

impl Dwt {
    /// Reads the register at `offset` in HCLK cycle `cycle`.
    ///
    /// # Errors
    ///
    /// [`Unmodelled`] for any other than CTRL and CYCCNT.
    pub fn read(&self, offset: u32, cycle: u64) -> Result<u32, Unmodelled> {
        match offset {
            0 => Ok(CTRL_NUMCOMP | u32::from(self.running)),
            4 if self.running => Ok(self.count.wrapping_add(cycle as u32)),
            4 => Ok(self.count),
            _ => Err(Unmodelled("DWT beyond the cycle counter")),
        }
    }

    /// Writes the register at `offset` in HCLK cycle `cycle`.
    ///
    /// # Errors
    ///
    /// [`Unmodelled`] for any other than CTRL's CYCCNTENA and CYCCNT.
    pub fn write(&mut self, offset: u32, value: u32, cycle: u64) -> Result<(), Unmodelled> {
        let cycle = cycle as u32;
        match offset {
            0 => {
                let run = value & CTRL_CYCCNTENA != 0;
                if run && !self.running {
                    self.count = self.count.wrapping_sub(cycle);
                } else if !run && self.running {
                    self.count = self.count.wrapping_add(cycle);
                }
                self.running = run;
                if value & !(CTRL_CYCCNTENA | CTRL_NUMCOMP) != 0 {
                    return Err(Unmodelled("DWT_CTRL beyond CYCCNTENA"));
                }
            }
            4 if self.running => self.count = value.wrapping_sub(cycle),
            4 => self.count = value,
            _ => return Err(Unmodelled("DWT beyond the cycle counter")),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_counts_only_while_enabled() {
        let mut dwt = Dwt::default();
        dwt.write(4, 5, 100).unwrap();
        dwt.write(0, 1, 1_000).unwrap();
        assert_eq!(dwt.read(4, 1_010), Ok(15));
        dwt.write(0, 0, 1_020).unwrap();
        assert_eq!(dwt.read(4, 9_999), Ok(25));
        assert_eq!(dwt.read(0, 0), Ok(4 << 28));
    }
}
