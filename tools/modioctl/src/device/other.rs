//! Words for a request without an answer, and for what was received in its place.

use modbus_line::other::{MODBUS_TCP, TELNET};

use super::{Device, place};
use crate::bus::adu::{self, Framing};
use crate::bus::{Lost, MOST, Place, Waiting, decode};
use crate::failure::Failure;

impl Device {
    /// Returns the failure for a request without an answer. With the request it also names the other kind of TCP, and what
    /// was received in place of the answer.
    pub fn lost(&self, request: Option<&[u8]>, lost: &Lost) -> Failure {
        let endpoint = self.master.endpoint();
        let unit = self.unit;
        let place = place(endpoint);
        let other_kind = match (&endpoint.place, request) {
            (Place::Serial(_), _) | (_, None) => String::new(),
            (Place::Tcp(address), _) => {
                format!("; if it speaks Modbus TCP, use --modbus-tcp {address}")
            }
            (Place::ModbusTcp(address), _) => {
                format!("; if it passes on raw frames, use --tcp {address}")
            }
        };
        match lost {
            Lost::Silent if self.master.has_echo() => Failure::NoAnswer(format!(
                "unit {unit} does not answer at {place}, and the adapter returns what it sends, which is not an answer: check power, wiring (A and B swapped?), address, rate and format; switch the echo of the adapter off if you can"
            )),
            Lost::Silent => Failure::NoAnswer(format!(
                "unit {unit} does not answer at {place}: check power, wiring (A and B swapped?), address, rate and format; `modioctl scan` looks for units{other_kind}"
            )),
            Lost::Absent(code) => Failure::NoAnswer(format!(
                "unit {unit} does not answer the gateway at {place} (exception {code:02X}): check power and wiring of the unit, its address, and rate and format in the gateway"
            )),
            Lost::Garbled(bytes) => {
                let shown = shown(endpoint.framing, bytes);
                let other = request.and_then(|pdu| self.other(pdu, bytes));
                Failure::Garbled(match other {
                    Some(other) => format!(
                        "something answers at {place}, but not this request ({shown}): {other}"
                    ),
                    None if bytes.len() >= MOST => format!(
                        "the line at {place} is never silent: wrong rate or format, a program that sends all the time, or a line without bias"
                    ),
                    None => format!(
                        "something answers at {place}, but garbled ({shown}): wrong rate or format, two units with address {unit}, or no termination"
                    ),
                })
            }
            Lost::Broken(error) => Failure::Port(format!(
                "{place} is lost ({error}): check that the adapter is plugged in, or that the gateway runs{other_kind}"
            )),
        }
    }

    /// Returns what these bytes are, which were received in place of an answer to this request, if that is known.
    pub fn other(&self, pdu: &[u8], bytes: &[u8]) -> Option<String> {
        let waiting = Waiting {
            framing: self.master.endpoint().framing,
            transaction: self.master.garbled_transaction(),
            unit: self.unit,
            pdu,
        };
        // These are spoken on networks only.
        let other = waiting.other(bytes);
        other.filter(|what| !self.is_serial() || ![TELNET, MODBUS_TCP].contains(&what.as_str()))
    }
}

/// Returns the first bytes of an answer, and how many there are.
fn shown(framing: Framing, bytes: &[u8]) -> String {
    let first = bytes.get(..bytes.len().min(12)).unwrap_or_default();
    let more = if first.len() < bytes.len() {
        " ..."
    } else {
        ""
    };
    format!(
        "{}: {}{more}",
        decode::count_of(bytes),
        adu::bytes(framing, first)
    )
}
