//! The cycle counter of the DWT, which firmware can use without a debugger (ARMv7-M ARM, DDI 0403E, C1.8). The emulated
//! core itself has the ITM and the system control space.
//!
//! While DEMCR.TRCENA is clear, DWT is off (C1.6.5): writes are lost, reads return 0, and nothing counts. DEMCR is a
//! register of the emulated core, which cannot be read during an access. So a write to a DWT that was off is kept until
//! the core is between two instructions.

use crate::peripheral::Unmodelled;

/// Base address of DWT.
pub const BASE: u32 = 0xE000_1000;
/// Size of DWT's registers in bytes.
pub const SIZE: u32 = 0x1000;

const CTRL_CYCCNTENA: u32 = 1;
/// Number of comparators: four, as in the Cortex-M3.
const CTRL_NUMCOMP: u32 = 4 << 28;

/// The cycle counter.
#[derive(Debug, Default)]
pub struct Dwt {
    /// DEMCR.TRCENA.
    enabled: bool,
    /// A write (offset, value, cycle) that is lost unless TRCENA is set.
    kept: Option<(u32, u32, u64)>,
    /// While the counter is stopped, the value of CYCCNT; else CYCCNT minus the number of the HCLK cycle.
    count: u32,
    /// CTRL.CYCCNTENA.
    running: bool,
}

impl Dwt {
    /// Returns whether [`look`](Self::look) must be called after this instruction.
    #[must_use]
    pub fn awaits_look(&self) -> bool {
        self.kept.is_some()
    }

    /// Returns whether a change of DEMCR has an effect.
    #[must_use]
    pub fn in_use(&self) -> bool {
        self.running || self.kept.is_some()
    }

    /// Takes over DEMCR.TRCENA as `enabled` in HCLK cycle `cycle`. While it is clear, the counter is stopped and keeps
    /// its value.
    ///
    /// # Errors
    ///
    /// [`Unmodelled`] for a write that was lost, or as for [`Self::write`].
    pub fn look(&mut self, enabled: bool, cycle: u64) -> Result<(), Unmodelled> {
        let kept = self.kept.take();
        self.set_enabled(enabled, kept.map_or(cycle, |(_, _, at)| at));
        match kept {
            Some((offset, value, at)) if enabled => self.write(offset, value, at),
            Some(_) => Err(Unmodelled("DWT written while DEMCR.TRCENA is clear")),
            None => Ok(()),
        }
    }

    fn set_enabled(&mut self, enabled: bool, cycle: u64) {
        if enabled != self.enabled {
            self.enabled = enabled;
            if self.running {
                let cycle = cycle as u32;
                self.count = if enabled {
                    self.count.wrapping_sub(cycle)
                } else {
                    self.count.wrapping_add(cycle)
                };
            }
        }
    }

    /// Reads the register at `offset` in HCLK cycle `cycle`.
    ///
    /// # Errors
    ///
    /// [`Unmodelled`] for any register other than CTRL and CYCCNT.
    pub fn read(&self, offset: u32, cycle: u64) -> Result<u32, Unmodelled> {
        if !self.enabled {
            return Ok(0);
        }
        match offset {
            0 => Ok(CTRL_NUMCOMP | u32::from(self.running)),
            4 if self.running => Ok(self.count.wrapping_add(cycle as u32)),
            4 => Ok(self.count),
            _ => Err(Unmodelled("a register of DWT other than CTRL and CYCCNT")),
        }
    }

    /// Writes the register at `offset` in HCLK cycle `cycle`.
    ///
    /// # Errors
    ///
    /// [`Unmodelled`] for any register other than CYCCNT, and for any bit of CTRL other than CYCCNTENA.
    pub fn write(&mut self, offset: u32, value: u32, cycle: u64) -> Result<(), Unmodelled> {
        if !self.enabled {
            self.kept = Some((offset, value, cycle));
            return Ok(());
        }
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
                    return Err(Unmodelled("a bit of DWT_CTRL other than CYCCNTENA"));
                }
            }
            4 if self.running => self.count = value.wrapping_sub(cycle),
            4 => self.count = value,
            _ => return Err(Unmodelled("a register of DWT other than CTRL and CYCCNT")),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cyccnt_counts_only_while_cyccntena_is_set() {
        let mut dwt = Dwt::default();
        dwt.set_enabled(true, 0);
        dwt.write(4, 5, 100).unwrap();
        dwt.write(0, 1, 1_000).unwrap();
        assert_eq!(dwt.read(4, 1_010), Ok(15));
        dwt.write(0, 0, 1_020).unwrap();
        assert_eq!(dwt.read(4, 9_999), Ok(25));
        assert_eq!(dwt.read(0, 0), Ok(4 << 28));
    }

    #[test]
    fn without_trcena_writes_are_lost_reads_return_0_and_nothing_counts() {
        let mut dwt = Dwt::default();
        dwt.write(0, 1, 0).unwrap();
        assert!(dwt.look(false, 1).is_err());
        assert_eq!(dwt.read(0, 10), Ok(0));
        dwt.look(true, 20).unwrap();
        assert_eq!(dwt.read(0, 20), Ok(4 << 28));
        dwt.write(0, 1, 100).unwrap();
        dwt.look(false, 150).unwrap();
        assert_eq!(dwt.read(4, 200), Ok(0));
        dwt.look(true, 1_000).unwrap();
        assert_eq!(dwt.read(4, 1_010), Ok(60));
    }

    #[test]
    fn counter_started_directly_after_trcena_counts_from_the_cycle_of_the_write() {
        let mut dwt = Dwt::default();
        dwt.write(0, 1, 100).unwrap();
        assert!(dwt.awaits_look());
        dwt.look(true, 103).unwrap();
        assert_eq!(dwt.read(4, 110), Ok(10));
        assert!(dwt.in_use() && !dwt.awaits_look());
    }
}
