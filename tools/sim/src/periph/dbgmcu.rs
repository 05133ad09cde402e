//! The debug unit's identity and control, RM0008 sections 31.6.1 and 31.16.3.

use crate::peripheral::{Peripheral, Unmodelled};
use crate::time::Time;

/// A medium-density device (0x410), revision Y (0x2003).
pub const IDCODE: u32 = 0x2003_6410;

/// DBGMCU. Its freeze bits act only while a debugger halts the core.
#[derive(Debug, Default)]
pub struct Dbgmcu {
    cr: u32,
}

impl Peripheral for Dbgmcu {
    fn read(&mut self, offset: u32, _now: Time) -> Result<u32, Unmodelled> {
        match offset {
            0 => Ok(IDCODE),
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
        // DBGMCU_CR is reset by power-on alone (RM0008 31.16.3): the board makes a new one then.
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identity_is_read_only_and_control_outlives_a_reset() {
        let mut debug = Dbgmcu::default();
        debug.write(0, 1, Time::ZERO).unwrap();
        debug.write(4, 1 << 8, Time::ZERO).unwrap();
        debug.reset(Time::ZERO);
        assert_eq!(debug.read(0, Time::ZERO), Ok(IDCODE));
        assert_eq!(debug.read(4, Time::ZERO), Ok(1 << 8));
        assert!(debug.read(8, Time::ZERO).is_err());
    }
}
