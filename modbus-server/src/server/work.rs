//! The work of a request: writes points and registers and creates the body of the reply.

use super::Server;
use crate::decision::Job;
use crate::diagnostic::Diagnostic;
use crate::{
    Adu, Bits, BitsOut, DataModel, Decision, Span, Table, Words, WordsOut, file, identification,
};

/// Status of functions 0B and 0C: no program command is being processed (V1.1b3 6.9). This server has none.
const NOT_BUSY: [u8; 2] = [0x00, 0x00];
/// Longest data of a reply in a PDU of 253 bytes, without the function code.
const MAX_CUSTOM: usize = 252;
/// Longest server ID with additional data of function 11, without its byte count and run indicator.
const MAX_SERVER_ID: usize = MAX_CUSTOM - 2;
/// Position of the data of function 08 in its request, counted from the unit address.
const DIAGNOSTIC_DATA: u8 = 4;

impl Server {
    /// Does the work of a decision. `adu` is the request of this decision. Afterwards, if the reply has a body,
    /// `adu` holds it from [`Head::body_from`](crate::head::Head::body_from) on.
    pub(super) fn carry_out(
        &mut self,
        decision: &Decision,
        adu: &mut Adu,
        model: &mut impl DataModel,
    ) {
        match decision.work.0 {
            Job::None => {}
            Job::ReadBits(table, span) => {
                let bytes = adu.resize(usize::from(span.count().div_ceil(8)));
                model.read_bits(table, span, &mut BitsOut::new(bytes, span.count()));
            }
            Job::ReadWords(table, span) => read_words(table, span, adu, model),
            Job::WriteBits { span, from } => {
                model.write_bits(span, Bits::new(adu.from(from), span.count()));
            }
            Job::WriteWords { span, from } => {
                model.write_words(span, words(adu, span, from));
            }
            Job::WriteMasked { address, value } => {
                let value = value.to_be_bytes();
                model.write_words(Span::single(address), Words::new(&value));
            }
            Job::WriteThenRead { write, from, read } => {
                model.write_words(write, words(adu, write, from));
                read_words(Table::HoldingRegisters, read, adu, model);
            }
            Job::ReadFile => file::read(adu, model),
            Job::WriteFile => file::write(adu, model),
            Job::ExceptionStatus => body(adu, &[model.exception_status()]),
            Job::Diagnose(Diagnostic::Register) => {
                let register = model.diagnostic_register();
                self.cleared_bits &= register;
                diagnostic_data(adu, register & !self.cleared_bits);
            }
            Job::Diagnose(Diagnostic::Clear) => {
                self.cleared_bits = model.diagnostic_register();
            }
            Job::Diagnose(Diagnostic::Counter(index)) => {
                let counter = self.counters().as_words().get(usize::from(index)).copied();
                diagnostic_data(adu, counter.unwrap_or_default());
            }
            // The reply repeats the request; the remaining bytes are in the body.
            Job::Diagnose(_) => {}
            Job::EventCounter => {
                body(adu, &NOT_BUSY);
                adu.extend(&self.tally.events.to_be_bytes());
            }
            Job::EventLog => {
                // At most 6 + 64.
                body(adu, &[6 + self.log.count()]);
                adu.extend(&NOT_BUSY);
                adu.extend(&self.tally.events.to_be_bytes());
                adu.extend(&self.counters().bus_messages.to_be_bytes());
                self.log.append_to(adu);
            }
            Job::ServerId => {
                let id = model.server_id();
                let id = id.get(..MAX_SERVER_ID).unwrap_or(id);
                let more = model.additional_data();
                let more = more.get(..MAX_SERVER_ID - id.len()).unwrap_or(more);
                // At most 251.
                body(adu, &[(id.len() + more.len()) as u8 + 1]);
                adu.extend(id);
                adu.extend(&[if model.is_running() { 0xFF } else { 0x00 }]);
                adu.extend(more);
            }
            Job::Identify { code, object } => identification::fill(code, object, model, adu),
            Job::Custom => {
                model.serve_custom(adu.get(1), adu);
                adu.cut(adu.len().saturating_sub(MAX_CUSTOM));
            }
        }
        self.finish(decision);
    }
}

/// Returns the words of a request.
fn words(adu: &Adu, span: Span, from: u8) -> Words<'_> {
    Words::new(adu.from(from)).slice(0, span.count())
}

/// Begins a body with these bytes.
fn body(adu: &mut Adu, bytes: &[u8]) {
    adu.clear();
    adu.extend(bytes);
}

fn read_words(table: Table, span: Span, adu: &mut Adu, model: &impl DataModel) {
    let mut out = WordsOut::new(adu.resize(usize::from(span.count()) * 2));
    model.read_words(table, span, &mut out);
    out.finish();
}

/// Stores a value at the position of the data of function 08.
fn diagnostic_data(adu: &mut Adu, value: u16) {
    let [high, low] = value.to_be_bytes();
    adu.set(DIAGNOSTIC_DATA, high);
    adu.set(DIAGNOSTIC_DATA + 1, low);
}
