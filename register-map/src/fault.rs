//! The fault record, 0x0260 to 0x026F: the last fault that caused a reset. It is kept over every reset but not over
//! a loss of power.

use crate::block::block;
use crate::codes::FaultKind;
use crate::rule::Rule;
use crate::value::Value;

const READ: Rule = Rule::read_only();

/// Names of the bits of MISSING_TASKS.
const TASKS: &[(u8, &str)] = &[(0, "line"), (1, "serve"), (2, "scan"), (3, "background")];

block! {
    "Fault record", 0x0260..=0x026F;

    /// Last fault since power-on
    KIND "fault kind": 0x0260 x 1, Value::Codes(FaultKind::NAMES), READ;
    /// Faults since power-on
    COUNT "faults": 0x0261 x 1, Value::NUMBER, READ;
    /// At the fault; 0 = not known
    PROGRAM_COUNTER "program counter": 0x0262 x 2, Value::Opaque, READ;
    /// At the fault; 0 = not known
    LINK_REGISTER "link register": 0x0264 x 2, Value::Opaque, READ;
    /// Fault status
    STATUS "CFSR": 0x0266 x 2, Value::Opaque, READ;
    /// Of the failed access; 0 = not known
    FAULT_ADDRESS "fault address": 0x0268 x 2, Value::Opaque, READ;
    /// At the fault
    UPTIME "uptime at the fault": 0x026A x 2, Value::long("s"), READ;
    /// Tasks that hung; 0 = only idle
    MISSING_TASKS "missing tasks": 0x026C x 1, Value::Bits(TASKS), READ;
    /// Repairs of registers and of endless replies
    LINE_REPAIRS "line repairs": 0x026D x 1, Value::NUMBER, READ;
    /// Reads 0
    RESERVED "reserved": 0x026E x 2, Value::NUMBER, READ;
}
