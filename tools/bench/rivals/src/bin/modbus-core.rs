//! A server on crate modbus-core, as far as the crate supports it: it does not decode a valid request of 0F or 10.

#![no_std]
#![no_main]

use modbus_core::{
    Coils, Data, Exception, ExceptionResponse, FunctionCode, Request, RequestPdu, Response,
    ResponsePdu,
    rtu::{
        Header, RequestAdu, ResponseAdu,
        server::{decode_request, encode_response},
    },
};
use rivals::{ADU, BITS, UNIT, WORDS};

/// The points. Each bit is a byte, as in rmodbus.
struct Points {
    bits: [bool; BITS],
    words: [u16; WORDS],
}

impl Points {
    fn bits(&self, start: u16, count: u16) -> Option<&[bool]> {
        self.bits
            .get(start.into()..usize::from(start) + usize::from(count))
    }

    fn words(&self, start: u16, count: u16) -> Option<&[u16]> {
        self.words
            .get(start.into()..usize::from(start) + usize::from(count))
    }

    fn serve<'a>(
        &mut self,
        request: Request<'_>,
        data: &'a mut [u8],
    ) -> Result<Response<'a>, Exception> {
        let address = Exception::IllegalDataAddress;
        let value = |_| Exception::IllegalDataValue;
        Ok(match request {
            Request::ReadCoils(start, count) => {
                let bits = self.bits(start, count).ok_or(address)?;
                Response::ReadCoils(Coils::from_bools(bits, data).map_err(value)?)
            }
            Request::ReadDiscreteInputs(start, count) => {
                let bits = self.bits(start, count).ok_or(address)?;
                Response::ReadDiscreteInputs(Coils::from_bools(bits, data).map_err(value)?)
            }
            Request::ReadHoldingRegisters(start, count) => {
                let words = self.words(start, count).ok_or(address)?;
                Response::ReadHoldingRegisters(Data::from_words(words, data).map_err(value)?)
            }
            Request::ReadInputRegisters(start, count) => {
                let words = self.words(start, count).ok_or(address)?;
                Response::ReadInputRegisters(Data::from_words(words, data).map_err(value)?)
            }
            Request::WriteSingleCoil(at, on) => {
                *self.bits.get_mut(usize::from(at)).ok_or(address)? = on;
                Response::WriteSingleCoil(at)
            }
            Request::WriteSingleRegister(at, word) => {
                *self.words.get_mut(usize::from(at)).ok_or(address)? = word;
                Response::WriteSingleRegister(at, word)
            }
            _ => return Err(Exception::IllegalFunction),
        })
    }
}

#[cortex_m_rt::entry]
fn main() -> ! {
    let mut points = Points {
        bits: [false; BITS],
        words: [0; WORDS],
    };
    rivals::run(|request, response| {
        let Ok(Some(RequestAdu {
            hdr,
            pdu: RequestPdu(pdu),
        })) = decode_request(request)
        else {
            return 0;
        };
        if hdr.slave != UNIT {
            return 0;
        }
        let function = FunctionCode::new(request.get(1).copied().unwrap_or_default());
        let mut data = [0; ADU];
        let answer = points.serve(pdu, &mut data);
        let pdu = ResponsePdu(answer.map_err(|exception| ExceptionResponse {
            function,
            exception,
        }));
        let adu = ResponseAdu {
            hdr: Header { slave: UNIT },
            pdu,
        };
        encode_response(adu, response).unwrap_or(0)
    })
}
