//! Frames: a unit address and a PDU as sent on the line (Modbus over Serial Line V1.02, 2.5; Modbus Messaging on
//! TCP/IP V1.0b, 3.1).

use crc::{CRC_16_MODBUS, Crc};

const CRC16: Crc<u16> = Crc::<u16>::new(&CRC_16_MODBUS);

/// Length of the longest RTU frame in bytes.
pub const RTU_MOST: usize = 256;
/// Length of the longest ASCII frame in characters: `:`, two digits for each byte and the LRC, CR and LF.
pub const ASCII_MOST: usize = 513;
/// Number of bytes in front of the PDU on TCP.
pub const MBAP: usize = 7;

/// Framing of a Modbus message.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Framing {
    /// Bytes between silences, with a CRC.
    #[default]
    Rtu,
    /// Hexadecimal digits between `:` and CR LF, with an LRC.
    Ascii,
    /// A header with the length: Modbus TCP.
    Mbap,
}

impl Framing {
    /// Returns the framing of a frame from a serial line, judged by its content; `None` when its CRC or LRC is
    /// wrong. Each byte of an ASCII frame must be valid, so an RTU frame is not mistaken for one.
    #[must_use]
    pub fn on_line(frame: &[u8]) -> Option<Self> {
        [Self::Ascii, Self::Rtu]
            .into_iter()
            .find(|framing| framing.open(frame).is_some())
    }

    /// Returns the frame with this address and PDU. `transaction` is only used for Modbus TCP.
    #[must_use]
    pub fn frame(self, transaction: u16, unit: u8, pdu: &[u8]) -> Vec<u8> {
        let mut frame = vec![unit];
        frame.extend(pdu);
        match self {
            Self::Rtu => {
                let check = crc(&frame);
                frame.extend(check);
                frame
            }
            Self::Ascii => {
                frame.push(lrc(&frame));
                let digits = frame.iter().map(|byte| format!("{byte:02X}"));
                format!(":{}\r\n", digits.collect::<String>()).into_bytes()
            }
            Self::Mbap => {
                let length = u16::try_from(frame.len()).unwrap_or(u16::MAX);
                let mut header = transaction.to_be_bytes().to_vec();
                header.extend([0, 0]);
                header.extend(length.to_be_bytes());
                header.append(&mut frame);
                header
            }
        }
    }

    /// Returns the length of the ASCII or TCP frame at the beginning of these bytes, when it is known. The length of an
    /// RTU frame depends on its function: see [`response_length`] and [`request_length`].
    #[must_use]
    pub fn length(self, bytes: &[u8]) -> Option<usize> {
        match self {
            Self::Rtu => None,
            Self::Ascii => Some(bytes.windows(2).position(|two| two == b"\r\n")? + 2),
            Self::Mbap => {
                let header = bytes.first_chunk::<{ MBAP - 1 }>()?;
                Some(MBAP - 1 + usize::from(u16::from_be_bytes([header[4], header[5]])))
            }
        }
    }

    /// Returns the address and the PDU of a complete frame; `None` when it is damaged.
    #[must_use]
    pub fn open(self, frame: &[u8]) -> Option<(u8, Vec<u8>)> {
        self.check(frame).ok()
    }

    /// Returns the address and the PDU of a whole frame.
    ///
    /// # Errors
    ///
    /// What is wrong with the frame, for people.
    pub fn check(self, frame: &[u8]) -> Result<(u8, Vec<u8>), String> {
        let bytes = match self {
            Self::Rtu => {
                let check = frame.split_last_chunk::<2>();
                let (body, check) = check.ok_or("too short for a CRC")?;
                if frame.len() > RTU_MOST {
                    return Err(format!("longer than {RTU_MOST} bytes"));
                }
                fits("CRC", check, &crc(body))?;
                body.to_vec()
            }
            Self::Ascii => {
                let digits = frame.strip_prefix(b":");
                let digits = digits.ok_or("it does not begin with ':'")?;
                let digits = digits.strip_suffix(b"\r\n");
                let bytes = hex(digits.ok_or("it does not end in CR LF")?)?;
                let (check, body) = bytes.split_last().ok_or("nothing in it")?;
                fits("LRC", &[*check], &[lrc(body)])?;
                body.to_vec()
            }
            Self::Mbap => {
                let header = frame.split_at_checked(MBAP - 1);
                let (header, rest) = header.ok_or("too short for a header")?;
                let length = usize::from(u16::from_be_bytes([header[4], header[5]]));
                if header[2..4] != [0, 0] || rest.len() != length {
                    return Err("its header is wrong".to_owned());
                }
                rest.to_vec()
            }
        };
        match bytes.split_first() {
            Some((unit, pdu)) if !pdu.is_empty() => Ok((*unit, pdu.to_vec())),
            _ => Err("too short for an address and a function code".to_owned()),
        }
    }
}

/// Returns bytes in hexadecimal, and an ASCII frame as characters.
#[must_use]
pub fn bytes(framing: Framing, bytes: &[u8]) -> String {
    let frame = bytes.trim_ascii_end();
    // Other characters can control a terminal.
    let is_text = frame.starts_with(b":") && frame.iter().all(u8::is_ascii_graphic);
    if framing == Framing::Ascii && is_text {
        return String::from_utf8_lossy(frame).into_owned();
    }
    let digits: Vec<_> = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
    digits.join(" ")
}

/// Compares a check with the right one.
fn fits(name: &str, check: &[u8], right: &[u8]) -> Result<(), String> {
    if check == right {
        return Ok(());
    }
    let [check, right] = [check, right].map(|check| bytes(Framing::Rtu, check));
    Err(format!("its {name} {check} is wrong, {right} is right"))
}

/// Returns the CRC in the order of the line, low byte first (V1.02, 6.2.2).
#[must_use]
pub fn crc(bytes: &[u8]) -> [u8; 2] {
    CRC16.checksum(bytes).to_le_bytes()
}

/// Returns the byte that makes the sum of all bytes 0 (V1.02, 6.2.1).
#[must_use]
pub fn lrc(bytes: &[u8]) -> u8 {
    let sum = bytes.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
    sum.wrapping_neg()
}

/// Returns the bytes of hexadecimal digits.
fn hex(digits: &[u8]) -> Result<Vec<u8>, &'static str> {
    let (pairs, rest) = digits.as_chunks::<2>();
    if !rest.is_empty() {
        return Err("an odd number of digits");
    }
    let digit = |digit: u8| char::from(digit).to_digit(16).map(|value| value as u8);
    let byte = |[high, low]: &[u8; 2]| Some(digit(*high)? << 4 | digit(*low)?);
    let bytes: Option<_> = pairs.iter().map(byte).collect();
    bytes.ok_or("not only hexadecimal digits")
}

/// Returns the length in bytes of the RTU response to this request, CRC included, from the beginning of the
/// response. Returns `None` when more bytes are needed, or when only the silence after the frame shows its end.
#[must_use]
pub fn response_length(request: &[u8], frame: &[u8]) -> Option<usize> {
    let function = *frame.get(1)?;
    let counted = |at: usize| frame.get(at).map(|count| at + 1 + usize::from(*count) + 2);
    match function {
        0x80.. => Some(5),
        0x01..=0x04 | 0x0C | 0x11 | 0x14 | 0x17 => counted(2),
        0x05 | 0x06 | 0x0B | 0x0F | 0x10 => Some(8),
        0x07 => Some(5),
        // These return the request's own bytes, or the same number of others.
        0x08 | 0x15 => Some(request.len() + 3),
        0x16 => Some(10),
        0x18 => fifo_length(frame),
        0x2B => identification_length(frame),
        // Fast Modbus: which points report events.
        0x46 if frame.get(2) == Some(&0x18) => counted(3),
        _ => None,
    }
}

/// Returns the length of an RTU request in bytes, CRC included, as far as the beginning of the request determines the
/// length. Returns `None` when more bytes are needed, or when the function is unknown.
#[must_use]
pub fn request_length(frame: &[u8]) -> Option<usize> {
    let function = *frame.get(1)?;
    let counted = |at: usize| frame.get(at).map(|count| at + 1 + usize::from(*count) + 2);
    match function {
        // Function 08 can send more than one word with subfunction 0. No common master does.
        0x01..=0x06 | 0x08 => Some(8),
        0x07 | 0x0B | 0x0C | 0x11 => Some(4),
        0x0F | 0x10 => counted(6),
        0x14 | 0x15 => counted(2),
        0x16 => Some(10),
        0x17 => counted(10),
        0x18 => Some(6),
        0x2B if frame.get(2) == Some(&0x0E) => Some(7),
        0x46 if frame.get(2) == Some(&0x18) => counted(3),
        _ => None,
    }
}

/// Returns the length of a response of function 18, whose byte count has 16 bits (V1.1b3 6.18).
fn fifo_length(frame: &[u8]) -> Option<usize> {
    let count = frame.get(2..)?.first_chunk()?;
    Some(4 + usize::from(u16::from_be_bytes(*count)) + 2)
}

/// Returns the length of a response with objects of the device identification (V1.1b3 6.21).
fn identification_length(frame: &[u8]) -> Option<usize> {
    let objects = *frame.get(7)?;
    let mut end = 8;
    for _ in 0..objects {
        end += 2 + usize::from(*frame.get(end + 1)?);
    }
    Some(end + 2)
}

/// Returns a request's function, address and one more word.
#[must_use]
pub fn pdu(function: u8, address: u16, word: u16) -> Vec<u8> {
    let ([ah, al], [wh, wl]) = (address.to_be_bytes(), word.to_be_bytes());
    vec![function, ah, al, wh, wl]
}

/// Returns a write of several registers, function 10.
#[must_use]
pub fn write_words(address: u16, values: &[u16]) -> Vec<u8> {
    let mut request = pdu(0x10, address, values.len() as u16);
    request.push((values.len() * 2) as u8);
    request.extend(values.iter().flat_map(|value| value.to_be_bytes()));
    request
}

/// Returns the words of a response to function 03, 04 or 17.
#[must_use]
pub fn words_of(response: &[u8]) -> Vec<u16> {
    words(response.get(2..).unwrap_or_default())
}

/// Returns the words of registers or records, high byte first.
#[must_use]
pub fn words(bytes: &[u8]) -> Vec<u16> {
    let (pairs, _) = bytes.as_chunks();
    pairs.iter().copied().map(u16::from_be_bytes).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_match_the_examples_of_the_standard() {
        // V1.02 6.2.2 gives the CRC of 02 07 as 41 12, low byte first.
        assert_eq!(Framing::Rtu.frame(0, 2, &[7]), [2, 7, 0x41, 0x12]);
        let ascii = Framing::Ascii.frame(0, 0x11, &[3, 0, 0x6B, 0, 3]);
        assert_eq!(ascii, b":1103006B00037E\r\n");
        let tcp = Framing::Mbap.frame(0x1501, 0xFF, &[3, 0, 4, 0, 1]);
        assert_eq!(tcp, [0x15, 1, 0, 0, 0, 6, 0xFF, 3, 0, 4, 0, 1]);
    }

    #[test]
    fn open_returns_the_pdu_of_a_frame_and_none_for_a_damaged_one() {
        for framing in [Framing::Rtu, Framing::Ascii, Framing::Mbap] {
            let frame = framing.frame(7, 17, &[3, 2, 0xAB, 0xCD]);
            assert_eq!(framing.open(&frame), Some((17, vec![3, 2, 0xAB, 0xCD])));
            assert_eq!(framing.open(&frame[..frame.len() - 1]), None);
            assert_eq!(framing.open(&[]), None);
            let mut damaged = frame.clone();
            damaged[5] ^= 1;
            assert_eq!(framing.open(&damaged), None, "{framing:?}");
            assert!(framing.check(&damaged).unwrap_err().contains("wrong"));
        }
    }

    #[test]
    fn an_ascii_frame_is_shown_as_text_unless_it_has_control_characters() {
        let ascii = |frame| bytes(Framing::Ascii, frame);
        assert_eq!(ascii(b":0103\r\n"), ":0103");
        assert_eq!(ascii(b":\x1b[2J\r\n"), "3A 1B 5B 32 4A 0D 0A");
        assert_eq!(ascii(b":01\r03\r\n"), "3A 30 31 0D 30 33 0D 0A");
    }

    #[test]
    fn framing_is_recognised_by_the_content_of_a_frame() {
        for framing in [Framing::Rtu, Framing::Ascii] {
            // Unit 0x3A has the code of the colon.
            let frame = framing.frame(0, 0x3A, &[3, 0, 0, 0, 1]);
            assert_eq!(Framing::on_line(&frame), Some(framing));
            assert_eq!(Framing::on_line(&frame[..frame.len() - 1]), None);
        }
        assert_eq!(Framing::on_line(&Framing::Mbap.frame(1, 1, &[7])), None);
        // 0xFFFF is the CRC of an empty frame.
        for short in [&[0xFF, 0xFF][..], &[1, 0x7E, 0x80], &[1], &[], b":\r\n"] {
            assert_eq!(Framing::on_line(short), None, "{short:02X?}");
        }
    }

    #[test]
    fn the_length_of_a_response_is_known_from_its_beginning() {
        assert_eq!(response_length(&[3, 0, 0, 0, 2], &[1, 3]), None);
        assert_eq!(response_length(&[3, 0, 0, 0, 2], &[1, 3, 4]), Some(9));
        assert_eq!(response_length(&[3, 0, 0, 0, 2], &[1, 0x83]), Some(5));
        assert_eq!(response_length(&[8, 0, 0, 1, 2, 3], &[1, 8]), Some(9));
        let identity = [1, 0x2B, 14, 1, 1, 0, 0, 2, 0, 1, b'a', 1, 2, b'b', b'c'];
        assert_eq!(response_length(&[0x2B, 14, 1, 0], &identity), Some(17));
        assert_eq!(response_length(&[0x2B, 14, 1, 0], &identity[..11]), None);
        assert_eq!(response_length(&[0x41], &[1, 0x41, 5]), None);
        assert_eq!(
            response_length(&[0x46, 0x18, 0], &[1, 0x46, 0x18, 3]),
            Some(9)
        );
        let fifo = [1, 0x18, 0, 6, 0, 2];
        assert_eq!(response_length(&[0x18, 0, 1], &fifo), Some(12));
    }

    #[test]
    fn request_length_is_known_from_the_beginning_of_the_request() {
        let write = [1, 0x10, 0, 0, 0, 2, 4, 0, 1, 0, 2];
        assert_eq!(request_length(&write[..6]), None);
        assert_eq!(request_length(&write), Some(13));
        assert_eq!(request_length(&[1, 3]), Some(8));
        assert_eq!(request_length(&[1, 0x11]), Some(4));
        assert_eq!(request_length(&[1, 0x2B]), None);
        assert_eq!(request_length(&[1, 0x2B, 0x0E]), Some(7));
        assert_eq!(request_length(&[1, 0x83]), None);
        assert_eq!(request_length(&[]), None);
    }
}
