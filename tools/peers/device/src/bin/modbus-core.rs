//! The server on crate modbus-core.

#![no_std]
#![no_main]

#[cortex_m_rt::entry]
fn main() -> ! {
    rivals::run(peers::modbus_core::ModbusCore::default())
}
