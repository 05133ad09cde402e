//! The fault record, 0x0260 to 0x026F: what went wrong before the last reset that a fault caused. It
//! outlives every reset but a loss of power.

use crate::block::block;
use crate::codes::FaultKind;
use crate::rule::Rule;

const READ: Rule = Rule::read_only();

block! {
    "Fault record", 0x0260..=0x026F;

    /// What the last fault since power-on was
    KIND "fault kind": 0x0260 x 1, "", READ, FaultKind::NAMES;
    /// Faults since power-on
    COUNT "faults": 0x0261 x 1, "", READ, &[];
    /// Program counter at the fault, high word first; 0 = not known
    PROGRAM_COUNTER "program counter": 0x0262 x 2, "", READ, &[];
    /// Link register at the fault, high word first; 0 = not known
    LINK_REGISTER "link register": 0x0264 x 2, "", READ, &[];
    /// Configurable fault status register of the core (CFSR), high word first
    STATUS "CFSR": 0x0266 x 2, "", READ, &[];
    /// Address whose access failed (BFAR or MMFAR), high word first; 0 = not known
    FAULT_ADDRESS "fault address": 0x0268 x 2, "", READ, &[];
    /// Uptime at the fault, high word first
    UPTIME "uptime at the fault": 0x026A x 2, "s", READ, &[];
    /// The tasks that had not begun, or not ended, when the watchdog bit: those that hung or were kept from running. 0 = only idle. Bit 0 line, 1 serve, 2 scan, 3 background
    MISSING_TASKS "missing tasks": 0x026C x 1, "", READ, &[];
    /// How often since the start the line was set up again, because its UART or timer had lost their settings or a reply did not end; 65535 = that often or more
    LINE_REPAIRS "line repairs": 0x026D x 1, "", READ, &[];
    /// Reserved, reads 0
    RESERVED "reserved": 0x026E x 2, "", READ, &[];
}
