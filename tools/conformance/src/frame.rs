//! Frames of the serial line, RTU and ASCII (Modbus over Serial Line V1.02, 2.5), written for this suite
//! alone: a mistake in the server's own codec must not hide in its test.

use std::fmt;

use crc::{CRC_16_MODBUS, Crc};

const CRC16: Crc<u16> = Crc::<u16>::new(&CRC_16_MODBUS);

/// The CRC of an RTU frame as it stands on the line, low byte first (V1.02, 6.2.2).
#[must_use]
pub fn crc(bytes: &[u8]) -> [u8; 2] {
    CRC16.checksum(bytes).to_le_bytes()
}

/// The LRC of an ASCII frame's bytes: the two's complement of their sum (V1.02, 6.2.1).
#[must_use]
pub fn lrc(bytes: &[u8]) -> u8 {
    bytes
        .iter()
        .fold(0_u8, |sum, byte| sum.wrapping_add(*byte))
        .wrapping_neg()
}

/// How PDUs are put on the line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// Bytes, ended by silence.
    #[default]
    Rtu,
    /// Hexadecimal digits between ':' and CR LF.
    Ascii,
}

impl Mode {
    /// The bytes of a frame with this unit address and PDU.
    #[must_use]
    pub fn frame(self, unit: u8, pdu: &[u8]) -> Vec<u8> {
        let body = [&[unit], pdu].concat();
        match self {
            Self::Rtu => rtu(&body),
            Self::Ascii => ascii(&body, lrc(&body)),
        }
    }

    /// What a frame says: unit address and PDU.
    ///
    /// # Errors
    ///
    /// Why it is no frame, for people.
    pub fn decode(self, frame: &[u8]) -> Result<(u8, Vec<u8>), String> {
        let body = match self {
            Self::Rtu => decode_rtu(frame)?,
            Self::Ascii => decode_ascii(frame)?,
        };
        match body.split_first() {
            Some((unit, pdu)) if !pdu.is_empty() => Ok((*unit, pdu.to_vec())),
            _ => Err("too short for an address and a function code".to_owned()),
        }
    }
}

/// These bytes and their CRC.
#[must_use]
pub fn rtu(body: &[u8]) -> Vec<u8> {
    [body, &crc(body)].concat()
}

/// These bytes in ASCII framing with a check byte, right or not.
#[must_use]
pub fn ascii(body: &[u8], check: u8) -> Vec<u8> {
    let mut frame = vec![b':'];
    for byte in body.iter().chain([&check]) {
        frame.extend(format!("{byte:02X}").bytes());
    }
    frame.extend(*b"\r\n");
    frame
}

fn decode_rtu(frame: &[u8]) -> Result<Vec<u8>, String> {
    let Some((body, check)) = frame.split_last_chunk::<2>() else {
        return Err("too short for a CRC".to_owned());
    };
    let right = crc(body);
    if *check == right {
        Ok(body.to_vec())
    } else {
        let right = hex(&right);
        Err(format!("its CRC {} is wrong, {right} is right", hex(check)))
    }
}

fn decode_ascii(frame: &[u8]) -> Result<Vec<u8>, String> {
    let digits = frame
        .strip_prefix(b":")
        .ok_or("it does not begin with ':'")?
        .strip_suffix(b"\r\n")
        .ok_or("it does not end in CR LF")?;
    if digits.len() % 2 != 0 {
        return Err("an odd number of digits".to_owned());
    }
    let bytes: Option<Vec<u8>> = digits
        .chunks(2)
        .map(|pair| Some(digit(pair[0])? << 4 | digit(pair[1])?))
        .collect();
    let bytes = bytes.ok_or("something that is no digit 0-9 A-F")?;
    let (check, body) = bytes.split_last().ok_or("nothing in it")?;
    if *check == lrc(body) {
        Ok(body.to_vec())
    } else {
        let right = lrc(body);
        Err(format!(
            "its LRC {check:02X} is wrong, {right:02X} is right"
        ))
    }
}

/// Upper case only: V1.02, 2.5.2 names "0-9, A-F".
const fn digit(character: u8) -> Option<u8> {
    match character {
        b'0'..=b'9' => Some(character - b'0'),
        b'A'..=b'F' => Some(character - b'A' + 10),
        _ => None,
    }
}

/// Bytes for people: `01 03 00 10`; long runs are cut in the middle.
#[must_use]
pub fn hex(bytes: &[u8]) -> String {
    const ENDS: usize = 24;
    let join = |bytes: &[u8]| {
        let pairs: Vec<String> = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
        pairs.join(" ")
    };
    if bytes.len() <= 2 * ENDS {
        return join(bytes);
    }
    let (head, rest) = bytes.split_at(ENDS);
    let (middle, tail) = rest.split_at(rest.len() - ENDS);
    let (head, tail) = (join(head), join(tail));
    format!("{head} ... {} bytes ... {tail}", middle.len())
}

/// What came back for a request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reply {
    /// Nothing at all.
    Silence,
    /// A frame of the unit that was asked: its PDU.
    Pdu(Vec<u8>),
    /// Bytes that are no good reply: what they are, and what is wrong with them.
    Wrong(Vec<u8>, String),
}

impl Reply {
    /// The exception code, when it is the exception to `function`.
    #[must_use]
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
    fn checks_are_those_of_the_standard() {
        // V1.02, 6.2.2: the CRC of 02 07 is 0x1241, on the line 41 12.
        assert_eq!(crc(&[2, 7]), [0x41, 0x12]);
        // V1.1b3, 6.1's request to unit 17: sum 0x4A, LRC 0xB6.
        assert_eq!(lrc(&[0x11, 1, 0, 0x13, 0, 0x25]), 0xB6);
    }

    #[test]
    fn frames_go_there_and_back_in_both_modes() {
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
    }

    #[test]
    fn exceptions_are_known_by_function_and_length() {
        let pdu = |bytes: &[u8]| Reply::Pdu(bytes.to_vec());
        assert_eq!(pdu(&[0x83, 2]).exception(3), Some(2));
        assert_eq!(pdu(&[0x84, 2]).exception(3), None);
        assert_eq!(pdu(&[0x83, 2, 0]).exception(3), None);
        assert_eq!(pdu(&[3, 2]).exception(3), None);
    }

    #[test]
    fn long_bytes_are_cut_for_people() {
        assert_eq!(hex(&[1, 0xAB]), "01 AB");
        assert!(hex(&[0; 256]).contains("... 208 bytes ..."));
    }
}
