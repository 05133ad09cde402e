//! A server on crate rmodbus, as in its documentation: `ModbusFrame` over `ModbusStorage`.

use ::rmodbus::ModbusProto;
use ::rmodbus::server::ModbusFrame;
use ::rmodbus::server::storage::ModbusStorage;
use heapless::Vec;

use crate::{BITS, LONGEST, Server, UNIT, WORDS};

/// The server.
#[derive(Default)]
pub struct Rmodbus(ModbusStorage<BITS, BITS, WORDS, WORDS>);

impl Server for Rmodbus {
    fn answer(&mut self, frame: &[u8], reply: &mut [u8; LONGEST]) -> Option<usize> {
        let mut out = Vec::<u8, LONGEST>::new();
        let mut frame = ModbusFrame::new(UNIT, frame, ModbusProto::Rtu, &mut out);
        frame.parse().ok()?;
        if frame.processing_required {
            let done = if frame.readonly {
                frame.process_read(&self.0)
            } else {
                frame.process_write(&mut self.0)
            };
            done.ok()?;
        }
        if !frame.response_required {
            return None;
        }
        frame.finalize_response().ok()?;
        reply.get_mut(..out.len())?.copy_from_slice(&out);
        Some(out.len())
    }
}
