//! Words for what was received in place of an answer.

use modbus_line::other::{MODBUS_TCP, TELNET};

use super::{Device, place};
use crate::bus::adu::{self, Framing};
use crate::bus::{Lost, Place, Waiting, decode};
use crate::failure::Failure;

impl Device {
    /// Returns the failure for this request without an answer. It is that of [`Self::lost`], if nothing more is known.
    pub fn lost_after(&self, pdu: &[u8], lost: &Lost) -> Failure {
        let general = self.lost(lost);
        let endpoint = self.master.endpoint();
        let other_kind = match &endpoint.place {
            Place::Serial(_) => String::new(),
            Place::Tcp(address) => format!("; if it speaks Modbus TCP, use --modbus-tcp {address}"),
            Place::ModbusTcp(address) => {
                format!("; if it passes on raw frames, use --tcp {address}")
            }
        };
        match lost {
            Lost::Silent if !self.master.has_echo() => {
                Failure::NoAnswer(format!("{general}{other_kind}"))
            }
            Lost::Broken(_) => Failure::Port(format!("{general}{other_kind}")),
            Lost::Garbled(bytes) => self.other(pdu, bytes).map_or(general, |other| {
                Failure::Garbled(format!(
                    "something answers at {}, but not this request ({}): {other}",
                    place(endpoint),
                    shown(endpoint.framing, bytes)
                ))
            }),
            _ => general,
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
pub fn shown(framing: Framing, bytes: &[u8]) -> String {
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
