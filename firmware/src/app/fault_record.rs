//! The fault record of the last start in the terms of the register map.

use board_support::fault;
use firmware::alive;
use register_map::codes::FaultKind;

/// Returns the kind of a fault as its register has it.
pub const fn kind(kind: fault::Kind) -> FaultKind {
    match kind {
        fault::Kind::None => FaultKind::None,
        fault::Kind::Panic => FaultKind::Panic,
        fault::Kind::HardFault => FaultKind::HardFault,
        fault::Kind::Watchdog => FaultKind::Watchdog,
        fault::Kind::Crystal => FaultKind::Crystal,
        fault::Kind::StackOverflow => FaultKind::StackOverflow,
    }
}

/// Returns the fault record as the 16 registers from 0x0260 on.
pub fn words(record: &fault::FaultRecord) -> [u16; 16] {
    let high = |word: u32| (word >> 16) as u16;
    let low = |word: u32| word as u16;
    let fault::FaultRecord {
        fault,
        count,
        uptime,
        missing,
        crystal_faults: _,
    } = *record;
    [
        kind(fault.kind).code(),
        count,
        high(fault.pc),
        low(fault.pc),
        high(fault.lr),
        low(fault.lr),
        high(fault.status),
        low(fault.status),
        high(fault.address),
        low(fault.address),
        high(uptime),
        low(uptime),
        alive::missing_tasks(missing),
        0,
        0,
        0,
    ]
}
