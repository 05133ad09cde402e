//! The fault record of the last start in the terms of the register map.

use board_support::fault::FaultRecord;
use firmware::alive;
use register_map::codes::FaultKind;

/// Returns the kind of the fault.
pub fn kind(record: &FaultRecord) -> FaultKind {
    FaultKind::from_code(record.kind.into()).unwrap_or(FaultKind::None)
}

/// Returns the fault record as the 16 registers from 0x0260 on.
pub fn words(record: &FaultRecord) -> [u16; 16] {
    let mut words = [0; 16];
    let [kind, count, longs @ .., missing, _, _, _] = &mut words;
    (*kind, *count) = (record.kind.into(), record.count);
    *missing = alive::missing_tasks(record.missing);
    let [pc, lr, status, address] = record.place;
    let values = [pc, lr, status, address, record.uptime];
    for (words, value) in longs.as_chunks_mut().0.iter_mut().zip(&values) {
        *words = [(value >> 16) as u16, *value as u16];
    }
    words
}
