//! Marks that the tasks of the firmware leave, so that the next start can name a task that hung.

/// Number of tasks that leave a mark.
pub const TASKS: usize = 9;

/// Mark of a task that has run to its end. Any other value counts as missing in the fault record.
pub const ENDED: u8 = 1;
