//! A server on crate modbus-core: its decoder and encoder of RTU frames, the points in arrays. The checks that the
//! crate leaves to its user are here: quantities, addresses and broadcasts.

use ::modbus_core::rtu::server::{decode_request, encode_response};
use ::modbus_core::rtu::{RequestAdu, ResponseAdu};
use ::modbus_core::{
    Coils, Data, Exception, ExceptionResponse, FunctionCode, Request, RequestPdu, Response,
    ResponsePdu,
};

use crate::{BITS, LONGEST, Server, UNIT, WORDS};

/// The unit address of a broadcast.
const BROADCAST: u8 = 0;

/// The server, with its points.
pub struct ModbusCore {
    coils: [bool; BITS],
    discrete_inputs: [bool; BITS],
    holding_registers: [u16; WORDS],
    input_registers: [u16; WORDS],
}

/// Returns `count` points from `first` on.
fn part<T>(points: &mut [T], first: u16, count: usize) -> Result<&mut [T], Exception> {
    let first = usize::from(first);
    points
        .get_mut(first..first + count)
        .ok_or(Exception::IllegalDataAddress)
}

/// Returns a quantity if it is from 1 to `most`.
fn quantity(count: u16, most: u16) -> Result<usize, Exception> {
    if (1..=most).contains(&count) {
        Ok(count.into())
    } else {
        Err(Exception::IllegalDataValue)
    }
}

impl ModbusCore {
    fn serve<'a>(
        &mut self,
        request: Request<'_>,
        data: &'a mut [u8],
    ) -> Result<Response<'a>, Exception> {
        let value = |_| Exception::IllegalDataValue;
        Ok(match request {
            Request::ReadCoils(first, count) => {
                let bits = part(&mut self.coils, first, quantity(count, 2000)?)?;
                Response::ReadCoils(Coils::from_bools(bits, data).map_err(value)?)
            }
            Request::ReadDiscreteInputs(first, count) => {
                let bits = part(&mut self.discrete_inputs, first, quantity(count, 2000)?)?;
                Response::ReadDiscreteInputs(Coils::from_bools(bits, data).map_err(value)?)
            }
            Request::ReadHoldingRegisters(first, count) => {
                let words = part(&mut self.holding_registers, first, quantity(count, 125)?)?;
                Response::ReadHoldingRegisters(Data::from_words(words, data).map_err(value)?)
            }
            Request::ReadInputRegisters(first, count) => {
                let words = part(&mut self.input_registers, first, quantity(count, 125)?)?;
                Response::ReadInputRegisters(Data::from_words(words, data).map_err(value)?)
            }
            Request::WriteSingleCoil(at, on) => {
                part(&mut self.coils, at, 1)?[0] = on;
                Response::WriteSingleCoil(at)
            }
            Request::WriteSingleRegister(at, word) => {
                part(&mut self.holding_registers, at, 1)?[0] = word;
                Response::WriteSingleRegister(at, word)
            }
            Request::WriteMultipleCoils(first, coils) => {
                let bits = part(&mut self.coils, first, quantity(coils.len() as u16, 1968)?)?;
                for (bit, value) in bits.iter_mut().zip(coils) {
                    *bit = value;
                }
                Response::WriteMultipleCoils(first, coils.len() as u16)
            }
            Request::WriteMultipleRegisters(first, words) => {
                let registers = part(
                    &mut self.holding_registers,
                    first,
                    quantity(words.len() as u16, 123)?,
                )?;
                for (register, value) in registers.iter_mut().zip(words) {
                    *register = value;
                }
                Response::WriteMultipleRegisters(first, words.len() as u16)
            }
            _ => return Err(Exception::IllegalFunction),
        })
    }
}

impl Server for ModbusCore {
    fn answer(&mut self, frame: &[u8], reply: &mut [u8; LONGEST]) -> Option<usize> {
        let RequestAdu {
            hdr,
            pdu: RequestPdu(request),
        } = decode_request(frame).ok()??;
        if hdr.slave != UNIT && hdr.slave != BROADCAST {
            return None;
        }
        let function = FunctionCode::new(*frame.get(1)?);
        let mut data = [0; LONGEST];
        let answer = self.serve(request, &mut data);
        if hdr.slave == BROADCAST {
            return None;
        }
        let pdu = ResponsePdu(answer.map_err(|exception| ExceptionResponse {
            function,
            exception,
        }));
        encode_response(ResponseAdu { hdr, pdu }, reply).ok()
    }
}

impl Default for ModbusCore {
    fn default() -> Self {
        Self {
            coils: [false; BITS],
            discrete_inputs: [false; BITS],
            holding_registers: [0; WORDS],
            input_registers: [0; WORDS],
        }
    }
}
