//! The server on crate rmodbus, on a serial port.

fn main() -> std::io::Result<()> {
    peers::host::main(peers::rmodbus::Rmodbus::default())
}
