//! Frames of the serial line, RTU and ASCII (Modbus over Serial Line V1.02, 2.5), by the crate `modbus-line`. The
//! server under test does not use that crate, so a mistake in the server's own codec does not hide in its test.

use std::fmt;

use modbus_line::adu::{Framing, bytes};
pub use modbus_line::adu::{crc, lrc};
use serde::Deserialize;

/// The form of a frame on the line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// Bytes, ended by silence.
    #[default]
    Rtu,
    /// Hexadecimal digits between ':' and CR LF.
    Ascii,
}

impl Mode {
    const fn framing(self) -> Framing {
        match self {
            Self::Rtu => Framing::Rtu,
            Self::Ascii => Framing::Ascii,
        }
    }

    /// Returns the bytes of a frame with this unit address and PDU.
    pub fn frame(self, unit: u8, pdu: &[u8]) -> Vec<u8> {
        self.framing().frame(0, unit, pdu)
    }

    /// Returns the unit address and the PDU of a frame. The error says what is wrong with the frame.
    pub fn decode(self, frame: &[u8]) -> Result<(u8, Vec<u8>), String> {
        // V1.02, 2.5.2 names the digits "0-9, A-F".
        if self == Self::Ascii && frame.iter().any(u8::is_ascii_lowercase) {
            return Err("not only digits 0-9 A-F".to_owned());
        }
        self.framing().check(frame)
    }
}

/// Returns these bytes and their CRC.
pub fn rtu(body: &[u8]) -> Vec<u8> {
    [body, &crc(body)].concat()
}

/// Returns these bytes in ASCII framing with a check byte, right or not.
pub fn ascii(body: &[u8], check: u8) -> Vec<u8> {
    let digits = body.iter().chain([&check]);
    let digits: String = digits.map(|byte| format!("{byte:02X}")).collect();
    format!(":{digits}\r\n").into_bytes()
}

/// Returns bytes for people, such as `01 03 00 10`; long runs are cut in the middle.
pub fn hex(run: &[u8]) -> String {
    const ENDS: usize = 24;
    let join = |run: &[u8]| bytes(Framing::Rtu, run);
    let middle = run.len().saturating_sub(2 * ENDS);
    if middle == 0 {
        return join(run);
    }
    let (head, tail) = (join(&run[..ENDS]), join(&run[ENDS + middle..]));
    format!("{head} ... {middle} bytes ... {tail}")
}

/// What was received after a request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reply {
    /// No byte.
    Silence,
    /// The PDU of a good frame of the unit that was asked.
    Pdu(Vec<u8>),
    /// Bytes that are no good reply, and what is wrong with them.
    Wrong(Vec<u8>, String),
}

impl Reply {
    /// Returns the exception code, if this is an exception reply to `function`.
    pub fn exception(&self, function: u8) -> Option<u8> {
        match self {
            Self::Pdu(pdu) => match pdu[..] {
                [f, code] if f == function | 0x80 => Some(code),
                _ => None,
            },
            _ => None,
        }
    }
}

impl fmt::Display for Reply {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Silence => f.write_str("silence"),
            Self::Pdu(pdu) => match pdu[..] {
                [function, code] if function & 0x80 != 0 => {
                    let function = function & 0x7F;
                    write!(f, "exception {code:02X} to function {function:02X}")
                }
                _ => write!(f, "the PDU {}", hex(pdu)),
            },
            Self::Wrong(bytes, why) => write!(f, "{} ({why})", hex(bytes)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frame_is_decoded_to_its_pdu_and_a_damaged_frame_is_refused() {
        for mode in [Mode::Rtu, Mode::Ascii] {
            let frame = mode.frame(17, &[3, 0, 0x6B, 0, 3]);
            assert_eq!(mode.decode(&frame), Ok((17, vec![3, 0, 0x6B, 0, 3])));
            for at in 0..frame.len() {
                let mut bad = frame.clone();
                bad[at] ^= 1;
                assert!(mode.decode(&bad).is_err(), "{mode:?} byte {at}");
                assert!(mode.decode(&frame[..at]).is_err(), "{mode:?} cut at {at}");
            }
        }
        assert_eq!(Mode::Ascii.frame(17, &[7]), b":1107E8\r\n");
        assert!(Mode::Ascii.decode(b":1107e8\r\n").is_err(), "lower case");
        // V1.1b3, 6.1's request to unit 17 has the sum 0x4A.
        let request = [0x11, 1, 0, 0x13, 0, 0x25];
        assert_eq!(ascii(&request, lrc(&request)), b":110100130025B6\r\n");
    }

    #[test]
    fn exception_reply_has_the_function_and_one_byte() {
        let pdu = |bytes: &[u8]| Reply::Pdu(bytes.to_vec());
        assert_eq!(pdu(&[0x83, 2]).exception(3), Some(2));
        assert_eq!(pdu(&[0x84, 2]).exception(3), None);
        assert_eq!(pdu(&[0x83, 2, 0]).exception(3), None);
        assert_eq!(pdu(&[3, 2]).exception(3), None);
    }

    #[test]
    fn long_runs_of_bytes_are_cut_in_the_middle() {
        assert_eq!(hex(&[1, 0xAB]), "01 AB");
        assert!(hex(&[0; 256]).contains("... 208 bytes ..."));
    }
}
