//! Commands that use Fast Modbus, function 70.

pub mod address;
pub mod events;
pub mod scan;

/// Returns a serial number as it is shown and typed.
fn hex(serial: u32) -> String {
    format!("{serial:08X}")
}
