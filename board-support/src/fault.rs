//! The last fault before the last start, kept across the reset.
//!
//! A fault handler notes what happened (`kept::note`) and resets the chip; the next start reads the record. The watchdog
//! resets the chip without calling a handler. The running firmware therefore keeps what the next start needs to describe
//! a watchdog reset: the uptime and the marks of its tasks (`kept::marks`). The record lies in the
//! [kept region](crate::kept).

/// Kinds of fault, with their numbers as reported in the fault record.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// No fault since power-on.
    #[default]
    None = 0,
    /// The program panicked.
    Panic = 1,
    /// The core raised a hard fault, or an interrupt without a handler occurred (CFSR is 0 then).
    HardFault = 2,
    /// The independent watchdog was not refreshed.
    Watchdog = 3,
    /// The crystal stopped while the core ran on it.
    Crystal = 4,
    /// The stack overflowed.
    StackOverflow = 5,
}

/// A fault as a handler reports it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Fault {
    /// The kind of fault.
    pub kind: Kind,
    /// Program counter, link register, the core's configurable fault status register (PM0056 4.4.11; 0 when the core
    /// raised no fault), and the address whose access failed. 0 = not known.
    pub place: [u32; 4],
}

/// The last fault since power-on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FaultRecord {
    /// Number of the fault's [`Kind`].
    pub kind: u8,
    /// Number of times the crystal has failed since power-on, at most 255.
    pub crystal_faults: u8,
    /// Number of faults since power-on; stops at 65535.
    pub count: u16,
    /// After a watchdog reset: the tasks without a mark, one bit per task.
    pub missing: u16,
    /// As [`Fault::place`].
    pub place: [u32; 4],
    /// Uptime of the firmware at the fault, in seconds.
    pub uptime: u32,
}

/// Distinguishes a stack overflow from other hard faults. It is one when the stack pointer after the exception lies
/// below the stack, or when the address whose access failed lies just below the stack. An exception always lowers
/// the stack pointer by the size of its frame, even without room.
///
/// `bottom` is the stack's lowest address, `address` is 0 when it is not known.
#[must_use]
pub const fn is_stack_overflow(stack_pointer: u32, bottom: u32, address: u32) -> bool {
    /// A push reaches 36 bytes below, the locals of a function rarely more than a few hundred.
    const BELOW: u32 = 2048;
    stack_pointer < bottom || (address < bottom && address >= bottom.saturating_sub(BELOW))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stack_overflow_is_recognised_by_stack_pointer_or_address() {
        const BOTTOM: u32 = 0x2000_0000;
        assert!(is_stack_overflow(BOTTOM - 16, BOTTOM, 0));
        assert!(is_stack_overflow(BOTTOM, BOTTOM, BOTTOM - 4));
        assert!(!is_stack_overflow(BOTTOM, BOTTOM, 0));
        assert!(!is_stack_overflow(BOTTOM + 64, BOTTOM, BOTTOM + 4));
        assert!(
            !is_stack_overflow(BOTTOM + 64, BOTTOM, 0x0900_0000),
            "a wrong pointer far from the stack"
        );
        assert!(!is_stack_overflow(BOTTOM + 64, BOTTOM, 0x4000_0000));
    }
}
