//! The server on crate modbus-core, on a serial port.

fn main() -> std::io::Result<()> {
    peers::host::main(peers::modbus_core::ModbusCore::default())
}
