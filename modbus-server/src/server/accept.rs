//! The decision: checks the request, asks the model, and creates the head of the reply.

use super::{Diagnostics, Server};
use crate::decision::Job;
use crate::diagnostic::Diagnostic;
use crate::exception::first_of;
use crate::head::Head;
use crate::pdu::Request;
use crate::{DataModel, Exception, Function, Span, Table, Words, WordsOut, file, identification};

/// Returns the head of the reply of `unit`, and the work, for an accepted request. `fields` are the bytes after the
/// function code `function`.
///
/// # Errors
/// The exception to answer with.
pub(super) fn accept(
    server: &Server,
    unit: u8,
    function: u8,
    fields: &[u8],
    model: &impl DataModel,
) -> Result<(Head, Job), Exception> {
    let plain = Head::plain(unit, function);
    let known = match Function::from_code(function) {
        Some(known) if model.has(known) => known,
        Some(_) => return Err(Exception::IllegalFunction),
        None => {
            model.check_custom(function, fields)?;
            return Ok((plain, Job::Custom));
        }
    };
    Ok(match Request::decode(known, fields)? {
        Request::ReadBits(span) => {
            let table = match known {
                Function::ReadCoils => Table::Coils,
                _ => Table::DiscreteInputs,
            };
            model.check_read_bits(table, span)?;
            // At most 2000 / 8.
            let head = Head::read(unit, function, span.count().div_ceil(8) as u8);
            (head, Job::ReadBits(table, span))
        }
        Request::ReadWords(span) => {
            let table = match known {
                Function::ReadHoldingRegisters => Table::HoldingRegisters,
                _ => Table::InputRegisters,
            };
            model.check_read_words(table, span)?;
            let head = read_words(unit, function, span);
            (head, Job::ReadWords(table, span))
        }
        Request::WriteBits { span, bits, from } => {
            model.check_write_bits(span, bits)?;
            let head = Head::echo(unit, function, first(fields)?);
            (head, Job::WriteBits { span, from })
        }
        Request::WriteWords { span, words, from } => {
            model.check_write_words(span, words)?;
            let head = Head::echo(unit, function, first(fields)?);
            (head, Job::WriteWords { span, from })
        }
        Request::MaskWord { address, and, or } => {
            let value = masked(address, and, or, model)?;
            let head = Head::masks(unit, function, first(fields)?);
            (head, Job::WriteMasked { address, value })
        }
        Request::WriteThenRead {
            write,
            words,
            from,
            read,
        } => {
            first_of(
                model.check_write_words(write, words),
                model.check_read_words(Table::HoldingRegisters, read),
            )?;
            let head = read_words(unit, function, read);
            (head, Job::WriteThenRead { write, from, read })
        }
        Request::ReadFile(fields) if model.has_files() => {
            let bytes = file::check(fields, false, model)?;
            (Head::read(unit, function, bytes), Job::ReadFile)
        }
        Request::WriteFile(fields) if model.has_files() => {
            file::check(fields, true, model)?;
            (
                Head::in_place(unit, function, first(fields)?),
                Job::WriteFile,
            )
        }
        Request::ReadFile(_) | Request::WriteFile(_) => return Err(Exception::IllegalFunction),
        Request::ExceptionStatus => (plain, Job::ExceptionStatus),
        Request::Diagnose(fields) => {
            let can_listen_only = server.diagnostics != Diagnostics::WithoutListenOnly;
            let diagnostic = Diagnostic::decode(fields, server.framing, can_listen_only)?;
            if server.diagnostics == Diagnostics::ReadOnly && !diagnostic.only_reads() {
                return Err(Exception::ServerDeviceBusy);
            }
            // The reply begins like the request; the rest repeats or replaces the request's data.
            let head = Head::in_place(unit, function, first(fields)?);
            (head, Job::Diagnose(diagnostic))
        }
        Request::EventCounter => (plain, Job::EventCounter),
        Request::EventLog => (plain, Job::EventLog),
        Request::ServerId => (plain, Job::ServerId),
        Request::Identify(fields) => {
            let (code, object) = identification::decode(fields, model)?;
            let head = Head::before(unit, function, [identification::MEI_TYPE, code as u8]);
            (head, Job::Identify { code, object })
        }
    })
}

fn read_words(unit: u8, function: u8, span: Span) -> Head {
    // At most 125 * 2.
    Head::read(unit, function, (span.count() * 2) as u8)
}

/// Returns the first bytes after the function code, as received.
fn first<const N: usize>(fields: &[u8]) -> Result<[u8; N], Exception> {
    fields
        .first_chunk()
        .copied()
        .ok_or(Exception::IllegalDataValue)
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
