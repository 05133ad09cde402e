//! A server on crate rmodbus, as in its documentation: `ModbusFrame` over `ModbusStorage`.

use std::io;

use peers::{BITS, UNIT, WORDS};
use rmodbus::ModbusProto;
use rmodbus::server::ModbusFrame;
use rmodbus::server::storage::ModbusStorage;

fn main() -> io::Result<()> {
    let mut storage = ModbusStorage::<BITS, BITS, WORDS, WORDS>::new();
    peers::main(|request| {
        let mut reply = Vec::new();
        let mut frame = ModbusFrame::new(UNIT, request, ModbusProto::Rtu, &mut reply);
        frame.parse().ok()?;
        if frame.processing_required {
            let done = if frame.readonly {
                frame.process_read(&storage)
            } else {
                frame.process_write(&mut storage)
            };
            done.ok()?;
        }
        if !frame.response_required {
            return None;
        }
        frame.finalize_response().ok()?;
        Some(reply)
    })
}
