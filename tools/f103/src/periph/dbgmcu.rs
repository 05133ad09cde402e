//! The debug unit's identity and control, RM0008 sections 31.6.1 and 31.16.3.

use crate::peripheral::{Peripheral, Unmodelled};
use crate::time::Time;

/// DBGMCU. Its freeze bits act only while a debugger halts the core.
#[derive(Debug)]
pub struct Dbgmcu {
    idcode: u32,
    cr: u32,
}

impl Dbgmcu {
    /// Returns the block of a part with this DBGMCU_IDCODE, after power-on.
    #[must_use]
    pub const fn new(idcode: u32) -> Self {
        Self { idcode, cr: 0 }
    }
}

impl Peripheral for Dbgmcu {
    fn read(&mut self, offset: u32, _now: Time) -> Result<u32, Unmodelled> {
        match offset {
            0 => Ok(self.idcode),
            4 => Ok(self.cr),
            _ => Err(Unmodelled("a reserved address of DBGMCU")),
        }
    }

    fn write(&mut self, offset: u32, value: u32, _now: Time) -> Result<(), Unmodelled> {
        match offset {
            0 => Ok(()),
            4 => {
                self.cr = value;
                Ok(())
            }
            _ => Err(Unmodelled("a reserved address of DBGMCU")),
        }
    }

    fn reset(&mut self, _now: Time) {
        // Only power-on resets DBGMCU_CR (RM0008 31.16.3); the machine makes a new block then.
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identity_is_read_only_and_control_outlives_a_reset() {
        let mut debug = Dbgmcu::new(0x2003_6410);
        debug.write(0, 1, Time::ZERO).unwrap();
        debug.write(4, 1 << 8, Time::ZERO).unwrap();
        debug.reset(Time::ZERO);
        assert_eq!(debug.read(0, Time::ZERO), Ok(0x2003_6410));
        assert_eq!(debug.read(4, Time::ZERO), Ok(1 << 8));
        assert!(debug.read(8, Time::ZERO).is_err());
    }
}
