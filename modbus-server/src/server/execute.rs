//! Checks a request, executes it, and makes its buffer the reply, in one pass.

use super::{Diagnostics, Server};
use crate::diagnostic::Diagnostic;
use crate::exception::first_of;
use crate::{
    Adu, BitsOut, DataModel, Exception, Function, Span, Table, Words, WordsOut, file,
    identification, pdu,
};

/// What an executed request means for the counters, the event log and the modes of the server.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Effect {
    /// Nothing.
    Read,
    /// Coils or holding registers were written.
    Written,
    /// The event counter or the event log was read.
    Polled,
    /// A sub-function of function 08 was executed.
    Diagnosed(Diagnostic),
}

/// Why a request is not executed.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Refusal {
    Exception(Exception),
    /// It was a broadcast, and is valid for a single unit only.
    NotForAll,
}

impl From<Exception> for Refusal {
    fn from(exception: Exception) -> Self {
        Self::Exception(exception)
    }
}

/// Status of functions 0B and 0C: no program command is being processed (V1.1b3 6.9). This server has none.
const NOT_BUSY: [u8; 2] = [0x00, 0x00];
/// Position of the first byte after the function code, counted from the unit address.
const FIELDS: u8 = 2;
/// Length of a unit address and a PDU of 253 bytes.
const LONGEST: usize = 254;
/// Longest server ID with additional data of function 11, without its byte count and run indicator.
const MAX_SERVER_ID: usize = LONGEST - FIELDS as usize - 2;
/// Length of a reply with address and value, or address and quantity.
const ECHO: usize = 6;
/// Position of the data of function 08, counted from the unit address.
const DIAGNOSTIC_DATA: u8 = 4;

/// Executes a request with a function code of the standard or a user-defined one. Afterwards `adu` holds the reply,
/// unless the request is refused; then nothing has changed.
///
/// Only "necessarily writing commands" (V1.02 2.1) can be a broadcast. A request for data is not one, even if it also
/// writes (17). The diagnostics of one unit do not concern all units.
///
/// # Errors
/// The reason why it is not executed.
#[inline(never)]
pub(super) fn execute(
    server: &mut Server,
    broadcast: bool,
    adu: &mut Adu,
    model: &mut impl DataModel,
) -> Result<Effect, Refusal> {
    let alone = if broadcast {
        Err(Refusal::NotForAll)
    } else {
        Ok(())
    };
    let (code, fields) = (adu.get(1), adu.fields());
    let function = match Function::from_code(code) {
        Some(function) if model.has(function) => function,
        Some(_) => return Err(Exception::IllegalFunction.into()),
        None => {
            model.check_custom(code, fields)?;
            alone?;
            return Ok(serve_custom(code, adu, model));
        }
    };
    match function {
        Function::ReadCoils | Function::ReadDiscreteInputs => {
            let span = pdu::read(fields, pdu::MAX_READ_BITS)?;
            let table = match function {
                Function::ReadCoils => Table::Coils,
                _ => Table::DiscreteInputs,
            };
            model.check_read_bits(table, span)?;
            alone?;
            let bytes = body(adu, usize::from(span.count().div_ceil(8)));
            model.read_bits(table, span, &mut BitsOut::new(bytes, span.count()));
        }
        Function::ReadHoldingRegisters | Function::ReadInputRegisters => {
            let span = pdu::read(fields, pdu::MAX_READ_WORDS)?;
            let table = match function {
                Function::ReadHoldingRegisters => Table::HoldingRegisters,
                _ => Table::InputRegisters,
            };
            model.check_read_words(table, span)?;
            alone?;
            read_words(server, table, span, adu, model);
        }
        Function::WriteSingleCoil | Function::WriteMultipleCoils => {
            let (span, bits) = match function {
                Function::WriteSingleCoil => pdu::write_single_bit(fields)?,
                _ => pdu::write_bits(fields)?,
            };
            model.check_write_bits(span, bits)?;
            model.write_bits(span, bits);
            adu.truncate(ECHO);
            return Ok(Effect::Written);
        }
        Function::WriteSingleRegister | Function::WriteMultipleRegisters => {
            let (span, words) = match function {
                Function::WriteSingleRegister => pdu::write_single_word(fields)?,
                _ => pdu::write_words(fields)?,
            };
            model.check_write_words(span, words)?;
            model.write_words(span, words);
            adu.truncate(ECHO);
            return Ok(Effect::Written);
        }
        Function::MaskWriteRegister => {
            let [address, and, or] = pdu::mask_word(fields)?;
            let value = masked(address, and, or, model)?.to_be_bytes();
            model.write_words(Span::single(address), Words::new(&value));
            return Ok(Effect::Written);
        }
        Function::ReadWriteMultipleRegisters => {
            let (read, write, words) = pdu::write_then_read(fields)?;
            first_of(
                model.check_write_words(write, words),
                model.check_read_words(Table::HoldingRegisters, read),
            )?;
            alone?;
            model.write_words(write, words);
            read_words(server, Table::HoldingRegisters, read, adu, model);
            return Ok(Effect::Written);
        }
        Function::ReadFileRecord if model.has_files() => {
            let bytes = file::check(fields, false, model)?;
            alone?;
            file::read(adu, bytes, model);
        }
        Function::WriteFileRecord if model.has_files() => {
            file::check(fields, true, model)?;
            file::write(fields, model);
        }
        Function::ReadFileRecord | Function::WriteFileRecord => {
            return Err(Exception::IllegalFunction.into());
        }
        Function::ReadExceptionStatus => {
            pdu::nothing(fields)?;
            alone?;
            data(adu, &[model.exception_status()]);
        }
        Function::Diagnostics => {
            let diagnostic = Diagnostic::decode(fields, server.framing)?;
            if server.diagnostics == Diagnostics::ReadOnly && !diagnostic.only_reads() {
                return Err(Exception::ServerDeviceBusy.into());
            }
            alone?;
            server.diagnose(diagnostic, adu, model);
            return Ok(Effect::Diagnosed(diagnostic));
        }
        Function::GetCommEventCounter => {
            pdu::nothing(fields)?;
            alone?;
            data(adu, &NOT_BUSY);
            adu.extend(&server.tally.events.to_be_bytes());
            return Ok(Effect::Polled);
        }
        Function::GetCommEventLog => {
            pdu::nothing(fields)?;
            alone?;
            // At most 6 + 64.
            data(adu, &[6 + server.log.count()]);
            adu.extend(&NOT_BUSY);
            adu.extend(&server.tally.events.to_be_bytes());
            adu.extend(&server.counters().bus_messages.to_be_bytes());
            server.log.append_to(adu);
            return Ok(Effect::Polled);
        }
        Function::ReportServerId => {
            pdu::nothing(fields)?;
            alone?;
            let id = model.server_id();
            let id = id.get(..MAX_SERVER_ID).unwrap_or(id);
            let more = model.additional_data();
            let more = more.get(..MAX_SERVER_ID - id.len()).unwrap_or(more);
            // At most 251.
            data(adu, &[(id.len() + more.len()) as u8 + 1]);
            adu.extend(id);
            adu.extend(&[if model.is_running() { 0xFF } else { 0x00 }]);
            adu.extend(more);
        }
        Function::EncapsulatedInterface => {
            let (code, object) = identification::decode(fields, model)?;
            alone?;
            identification::fill(code, object, model, adu);
        }
    }
    Ok(Effect::Read)
}

fn serve_custom(code: u8, adu: &mut Adu, model: &mut impl DataModel) -> Effect {
    let unit = adu.get(0);
    model.serve_custom(code, adu);
    adu.truncate(LONGEST);
    if adu.len() < usize::from(FIELDS) {
        adu.resize(FIELDS.into());
    }
    adu.set(0, unit);
    adu.set(1, code);
    Effect::Read
}

/// Replaces everything after the function code.
fn data(adu: &mut Adu, bytes: &[u8]) {
    adu.truncate(FIELDS.into());
    adu.extend(bytes);
}

/// Makes room for the data of a read, at most 250 bytes, writes the byte count in front of it, and returns the room.
#[inline(always)]
fn body(adu: &mut Adu, len: usize) -> &mut [u8] {
    let from = usize::from(FIELDS);
    match adu.resize(from + 1 + len).get_mut(from..) {
        Some([count, data @ ..]) => {
            *count = len as u8;
            data
        }
        _ => &mut [],
    }
}

fn read_words(
    server: &Server,
    table: Table,
    span: Span,
    adu: &mut Adu,
    model: &mut impl DataModel,
) {
    model.before_read_words(span, server);
    let mut out = WordsOut::new(body(adu, usize::from(span.count()) * 2));
    model.read_words(table, span, &mut out);
    out.finish();
}

/// Returns the result of a mask write: (current AND and) OR (or AND NOT and), V1.1b3 6.16.
///
/// # Errors
/// The exception of a write of the result, or of the read when the word cannot be read now.
fn masked(address: u16, and: u16, or: u16, model: &impl DataModel) -> Result<u16, Exception> {
    let span = Span::single(address);
    let mut bytes = [0; 2];
    if let Err(unreadable) = model.check_read_words(Table::HoldingRegisters, span) {
        // The value to write is not known, so only an address error can have a higher priority than this exception.
        let write = model.check_write_words(span, Words::new(&bytes));
        return Err(match write {
            Err(Exception::IllegalDataAddress) => Exception::IllegalDataAddress,
            _ => unreadable,
        });
    }
    let mut out = WordsOut::new(&mut bytes);
    model.read_words(Table::HoldingRegisters, span, &mut out);
    let value = (u16::from_be_bytes(bytes) & and) | (or & !and);
    model.check_write_words(span, Words::new(&value.to_be_bytes()))?;
    Ok(value)
}

impl Server {
    /// Puts what a sub-function of function 08 returns into the reply, which otherwise repeats the request.
    fn diagnose(&mut self, diagnostic: Diagnostic, adu: &mut Adu, model: &impl DataModel) {
        let value = match diagnostic {
            Diagnostic::Register => {
                let register = model.diagnostic_register();
                self.cleared_bits &= register;
                register & !self.cleared_bits
            }
            Diagnostic::Counter(index) => {
                let counters = self.counters().as_words();
                counters
                    .get(usize::from(index))
                    .copied()
                    .unwrap_or_default()
            }
            Diagnostic::Clear => {
                self.cleared_bits = model.diagnostic_register();
                return;
            }
            _ => return,
        };
        let [high, low] = value.to_be_bytes();
        adu.set(DIAGNOSTIC_DATA, high);
        adu.set(DIAGNOSTIC_DATA + 1, low);
    }
}
