//! Names what was received in place of an answer. Noise and collisions have no name; a gateway, another master or another
//! unit have.

use crate::Waiting;
use crate::adu::{Framing, MBAP, request_length, response_length};
use crate::decode::wrong_count;
use crate::waiting::NOISE;

/// Telnet's code for the beginning of a command. As data it is sent twice (RFC 854).
const IAC: u8 = 0xFF;
/// Telnet's commands WILL, WON'T, DO and DON'T, with which its sides agree on options.
const OPTIONS: std::ops::RangeInclusive<u8> = 0xFB..=0xFE;

/// What to do with a gateway that speaks telnet.
pub const TELNET: &str =
    "the gateway speaks telnet, as for RFC 2217, which doubles each byte FF: set it to raw TCP";

/// What to do with a gateway that speaks Modbus TCP.
pub const MODBUS_TCP: &str = "it is Modbus TCP: use --modbus-tcp in place of --tcp";

impl Waiting<'_> {
    /// Returns what these bytes are, which were received in place of an answer, and what to do; `None` if that is not
    /// known. The transaction of this request is the latest of the program, whose first one is 1.
    #[must_use]
    pub fn other(&self, bytes: &[u8]) -> Option<String> {
        match self.framing {
            Framing::Mbap => self.other_on_tcp(bytes),
            Framing::Rtu if is_telnet(bytes) => Some(TELNET.to_owned()),
            // A frame with a valid checksum first: the header of Modbus TCP has none.
            framing => match frame(framing, self.pdu, bytes) {
                Some((unit, pdu, true)) if (unit, &pdu[..]) == (self.unit, self.pdu) => None,
                Some((_, _, true)) => Some("another master uses the line: only one may".to_owned()),
                Some((unit, pdu, false)) => Some(self.other_answer(unit, &pdu)),
                None => is_modbus_tcp(bytes).then(|| MODBUS_TCP.to_owned()),
            },
        }
    }

    fn other_on_tcp(&self, bytes: &[u8]) -> Option<String> {
        if let Some((unit, pdu, false)) = frame(Framing::Rtu, self.pdu, bytes)
            && unit == self.unit
            && self.fits(&pdu)
        {
            return Some("it is an RTU frame: use --tcp in place of --modbus-tcp".to_owned());
        }
        let length = Framing::Mbap.length(bytes)?;
        let Some(frame) = bytes.get(..length) else {
            let is_header = bytes[2..4] == [0, 0];
            let received = bytes.len();
            return is_header.then(|| {
                format!("the gateway sent {received} of {length} bytes: it cuts its answer off")
            });
        };
        let (unit, pdu) = Framing::Mbap.open(frame)?;
        let transaction = u16::from_be_bytes([frame[0], frame[1]]);
        if !(1..=self.transaction).contains(&transaction) {
            return Some(format!(
                "no request had its transaction id {transaction:04X}: the gateway does not return the id, or mixes up its masters"
            ));
        }
        if transaction < self.transaction && unit == self.unit {
            return Some("it answers an earlier request: use a longer --timeout".to_owned());
        }
        Some(self.other_answer(unit, &pdu))
    }

    fn other_answer(&self, unit: u8, pdu: &[u8]) -> String {
        let [asked, answered] = [self.pdu, pdu].map(|pdu| pdu.first().copied().unwrap_or_default());
        if unit != self.unit {
            return format!(
                "unit {unit} answers, not unit {}: another master uses the line, or the gateway changes addresses",
                self.unit
            );
        }
        if answered & 0x7F != asked {
            return format!("it answers function {answered:02X}, not {asked:02X}");
        }
        wrong_count(self.pdu, pdu)
            .unwrap_or_else(|| "it answers another request of this function".to_owned())
    }
}

/// Returns whether these bytes are from a gateway that speaks telnet: it agrees on options, or doubles each byte FF of a
/// frame.
#[must_use]
pub fn is_telnet(bytes: &[u8]) -> bool {
    let mut data = Vec::new();
    let mut rest = bytes.iter().copied();
    let mut found = false;
    while let Some(byte) = rest.next() {
        if byte == IAC {
            match rest.next() {
                Some(IAC) => found = true,
                Some(command) if OPTIONS.contains(&command) && rest.next().is_some() => {
                    found = true;
                    continue;
                }
                _ => return false,
            }
        }
        data.push(byte);
    }
    found && (data.is_empty() || Framing::Rtu.open(&data).is_some())
}

/// Returns whether these bytes begin with a frame of Modbus TCP.
fn is_modbus_tcp(bytes: &[u8]) -> bool {
    let length = Framing::Mbap.length(bytes).filter(|length| *length > MBAP);
    let frame = length.and_then(|length| bytes.get(..length));
    frame.is_some_and(|frame| Framing::Mbap.open(frame).is_some())
}

/// Returns the unit and the PDU of the first frame in these bytes, and whether it can only be a request.
fn frame(framing: Framing, asked: &[u8], bytes: &[u8]) -> Option<(u8, Vec<u8>, bool)> {
    (0..bytes.len()).find_map(|start| {
        let rest = bytes.get(start..)?;
        let lengths = match framing {
            Framing::Rtu if start > NOISE => return None,
            Framing::Rtu => [
                response_length(asked, rest),
                request_length(rest),
                Some(rest.len()),
            ],
            Framing::Ascii | Framing::Mbap => [framing.length(rest), None, None],
        };
        lengths.into_iter().enumerate().find_map(|(n, length)| {
            let (unit, pdu) = framing.open(rest.get(..length?)?)?;
            Some((unit, pdu, n == 1))
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const READ: &[u8] = &[3, 0, 0x10, 0, 1];

    fn other(framing: Framing, bytes: &[u8]) -> String {
        let waiting = Waiting {
            framing,
            transaction: 9,
            unit: 1,
            pdu: READ,
        };
        assert_eq!(waiting.find(bytes), None);
        waiting.other(bytes).unwrap_or_default()
    }

    #[test]
    fn frames_that_are_no_answer_are_named() {
        for framing in [Framing::Rtu, Framing::Ascii, Framing::Mbap] {
            let of = |unit, pdu: &[u8]| other(framing, &framing.frame(9, unit, pdu));
            for (unit, pdu, text) in [
                (7, &[3, 2, 0, 5][..], "unit 7 answers, not unit 1"),
                (1, &[4, 2, 0, 5], "it answers function 04, not 03"),
                (
                    1,
                    &[3, 4, 0, 5, 0, 6],
                    "its byte count is 4, and 2 is right",
                ),
                (1, &[3, 2, 0], "its byte count is 2, but it has 1 byte"),
            ] {
                let named = of(unit, pdu);
                assert!(named.starts_with(text), "{framing:?}: {named}");
            }
            assert_eq!(other(framing, &[0xAA; 12]), "");
        }
        let request = Framing::Rtu.frame(0, 7, READ);
        assert!(other(Framing::Rtu, &request).starts_with("another master"));
        // The beginning of this request is also that of a frame of Modbus TCP.
        let usual = Framing::Rtu.frame(0, 1, &[3, 0, 0, 0, 2]);
        assert!(other(Framing::Rtu, &usual).starts_with("another master"));
        let own = Framing::Rtu.frame(0, 1, READ);
        assert_eq!(other(Framing::Rtu, &own), "");
    }

    #[test]
    fn frame_of_the_other_kind_of_tcp_names_its_option() {
        for framing in [Framing::Rtu, Framing::Ascii] {
            let tcp = Framing::Mbap.frame(9, 1, &[3, 2, 0, 5]);
            assert!(other(framing, &tcp).contains("use --modbus-tcp"));
        }
        let rtu = Framing::Rtu.frame(0, 1, &[3, 2, 0, 5]);
        assert!(other(Framing::Mbap, &rtu).contains("use --tcp"));
    }

    #[test]
    fn header_of_a_gateway_is_examined() {
        let of = |transaction, length| {
            let frame = Framing::Mbap.frame(transaction, 1, &[3, 2, 0, 5]);
            other(Framing::Mbap, &frame[..length])
        };
        for foreign in [0, 10, 0x1234] {
            let named = of(foreign, 11);
            let text = format!("no request had its transaction id {foreign:04X}");
            assert!(named.starts_with(&text), "{named}");
        }
        assert!(of(8, 11).contains("earlier request"));
        for length in [6, 7, 10] {
            assert!(of(9, length).starts_with(&format!("the gateway sent {length} of 11 bytes")));
        }
    }

    #[test]
    fn telnet_is_recognised_by_its_options_and_by_doubled_bytes() {
        let answer = Framing::Rtu.frame(0, 1, &[3, 2, 0xFF, 0xFF]);
        let doubled: Vec<u8> = answer
            .iter()
            .flat_map(|byte| vec![*byte; if *byte == 0xFF { 2 } else { 1 }])
            .collect();
        // Will binary, do suppress go ahead.
        let options = [0xFF, 0xFB, 0, 0xFF, 0xFD, 3];
        for bytes in [&doubled[..], &options, &[&options, &doubled[..]].concat()] {
            assert_eq!(other(Framing::Rtu, bytes), TELNET, "{bytes:02X?}");
        }
        for bytes in [&answer[..], &[0xFF; 8], &[0xFF, 0xFB], &[]] {
            assert!(!is_telnet(bytes), "{bytes:02X?}");
        }
    }
}
