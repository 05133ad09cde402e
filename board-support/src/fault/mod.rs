//! What went wrong before the last start, kept across the reset.
//!
//! A record in RAM that nothing initialises: a reset leaves it, a loss of power does not. A handler
//! notes what happened (`note`) and resets the chip; the next start takes it (`take_at_start`). The
//! watchdog calls no handler, so the running firmware leaves what there is to know about a bite where
//! the next start finds it: the uptime (`keep_uptime`) and the marks of its tasks (`marks`).
//!
//! ```text
//! word  0      1                  2      3   4   5     6        7       8
//!       magic  kind, fresh,       count  pc  lr  CFSR  address  uptime  checksum    the record
//!              crystal faults
//!       uptime              marks                                             kept up to date
//!       DIP switch                                                            written at power-on
//! ```

#[cfg(target_os = "none")]
mod kept;
#[cfg(any(target_os = "none", test))]
mod record;

#[cfg(target_os = "none")]
pub(crate) use kept::{keep_dip, kept_dip, take_at_start};
#[cfg(target_os = "none")]
pub use kept::{keep_uptime, marks, note};

/// Tasks that leave a mark.
pub const TASKS: usize = 4;

/// What can go wrong, with the number it has for the outside.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// Nothing since power-on.
    #[default]
    None = 0,
    /// The program gave up.
    Panic = 1,
    /// The core could not go on, or an interrupt came that nobody handles (CFSR is 0 then).
    HardFault = 2,
    /// The independent watchdog was not fed.
    Watchdog = 3,
    /// The crystal stopped while the core ran on it.
    Crystal = 4,
    /// The stack was too small.
    StackOverflow = 5,
}

/// What a handler has to tell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Fault {
    /// What it was.
    pub kind: Kind,
    /// Program counter; 0 = not known.
    pub pc: u32,
    /// Link register; 0 = not known.
    pub lr: u32,
    /// The core's configurable fault status register (PM0056 4.4.11); 0 when it was no fault.
    pub status: u32,
    /// The address whose access failed; 0 = not known.
    pub address: u32,
}

/// The last fault since power-on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FaultRecord {
    /// What it was, and where.
    pub fault: Fault,
    /// Faults since power-on; 65535 stands for more, too.
    pub count: u16,
    /// How long the firmware had run, in seconds.
    pub uptime: u32,
    /// After a watchdog's bite: the tasks that had left no mark, a bit for each.
    pub missing: u16,
    /// Number of times the crystal has failed since power-on, at most 255.
    pub crystal_faults: u8,
}

/// Tells a stack overflow from other hard faults: by the stack pointer that the exception left behind
/// being below the stack, or by the address whose access failed lying just below it. An exception
/// always takes the stack pointer down by its frame, whether or not there is room.
///
/// `bottom` is the stack's lowest address, `address` is 0 when it is not known.
#[must_use]
pub const fn is_stack_overflow(stack_pointer: u32, bottom: u32, address: u32) -> bool {
    /// A push reaches 36 bytes, a function's locals rarely some hundred.
    const BELOW: u32 = 2048;
    stack_pointer < bottom || (address < bottom && address >= bottom.saturating_sub(BELOW))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stack_overflow_is_told_by_pointer_or_address() {
        const BOTTOM: u32 = 0x2000_0000;
        assert!(is_stack_overflow(BOTTOM - 16, BOTTOM, 0));
        assert!(is_stack_overflow(BOTTOM, BOTTOM, BOTTOM - 4));
        assert!(!is_stack_overflow(BOTTOM, BOTTOM, 0));
        assert!(!is_stack_overflow(BOTTOM + 64, BOTTOM, BOTTOM + 4));
        assert!(
            !is_stack_overflow(BOTTOM + 64, BOTTOM, 0x0900_0000),
            "a wild pointer"
        );
        assert!(!is_stack_overflow(BOTTOM + 64, BOTTOM, 0x4000_0000));
    }
}
