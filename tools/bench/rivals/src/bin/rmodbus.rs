//! A server on crate rmodbus, as in its documentation.

#![no_std]
#![no_main]

use heapless::Vec;
use rivals::{ADU, BITS, UNIT, WORDS};
use rmodbus::{
    ModbusProto,
    server::{ModbusFrame, storage::ModbusStorage},
};

#[cortex_m_rt::entry]
fn main() -> ! {
    let mut storage = ModbusStorage::<BITS, BITS, WORDS, WORDS>::new();
    rivals::run(|request, response| {
        let mut out = Vec::<u8, ADU>::new();
        let mut frame = ModbusFrame::new(UNIT, request, ModbusProto::Rtu, &mut out);
        if frame.parse().is_err() {
            return 0;
        }
        if frame.processing_required {
            let done = if frame.readonly {
                frame.process_read(&storage)
            } else {
                frame.process_write(&mut storage)
            };
            if done.is_err() {
                return 0;
            }
        }
        if !frame.response_required || frame.finalize_response().is_err() {
            return 0;
        }
        match response.get_mut(..out.len()) {
            Some(place) => place.copy_from_slice(&out),
            None => return 0,
        }
        out.len()
    })
}
