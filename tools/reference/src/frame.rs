//! Frames and requests, as a master creates them.

/// The unit address of the tests.
pub const UNIT: u8 = 17;

/// Computes the CRC-16/MODBUS bit by bit, as in V1.02 6.2.2, low byte first.
pub fn crc(bytes: &[u8]) -> [u8; 2] {
    let mut register = 0xFFFF_u16;
    for byte in bytes {
        register ^= u16::from(*byte);
        for _ in 0..8 {
            let carry = register & 1 != 0;
            register >>= 1;
            if carry {
                register ^= 0xA001;
            }
        }
    }
    register.to_le_bytes()
}

/// Returns an RTU frame: unit, PDU, CRC.
pub fn frame(unit: u8, pdu: &[u8]) -> Vec<u8> {
    let mut frame = vec![unit];
    frame.extend(pdu);
    frame.extend(crc(&frame.clone()));
    frame
}

/// Computes the LRC as in V1.02 6.2.1.
pub fn lrc(bytes: &[u8]) -> u8 {
    let sum: u32 = bytes.iter().map(|byte| u32::from(*byte)).sum();
    (0x100 - sum % 0x100) as u8
}

/// Returns an ASCII frame: colon, unit, PDU and LRC in hexadecimal, carriage return, end mark.
pub fn ascii_frame(unit: u8, pdu: &[u8], delimiter: u8) -> Vec<u8> {
    let mut bytes = vec![unit];
    bytes.extend(pdu);
    bytes.push(lrc(&bytes));
    let digits: String = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
    [b":", digits.as_bytes(), b"\r", &[delimiter]].concat()
}

/// Returns a frame in ASCII mode with this end mark, or in RTU mode for `None`.
pub fn framed(delimiter: Option<u8>, unit: u8, pdu: &[u8]) -> Vec<u8> {
    match delimiter {
        None => frame(unit, pdu),
        Some(delimiter) => ascii_frame(unit, pdu, delimiter),
    }
}

/// Returns unit and PDU of a valid frame.
///
/// # Panics
///
/// When the frame is not valid.
pub fn unframed(delimiter: Option<u8>, frame: &[u8]) -> Vec<u8> {
    let bytes = match delimiter {
        None => judge_rtu(frame),
        Some(delimiter) => frame
            .strip_prefix(b":")
            .and_then(|rest| rest.strip_suffix(&[b'\r', delimiter]))
            .and_then(judge_ascii),
    };
    let bytes = bytes.expect("a valid frame");
    assert_eq!(framed(delimiter, bytes[0], &bytes[1..]), frame);
    bytes
}

/// Returns unit and PDU of an RTU frame, if it is valid.
pub fn judge_rtu(text: &[u8]) -> Option<Vec<u8>> {
    if !(4..=256).contains(&text.len()) {
        return None;
    }
    let (body, check) = text.split_at(text.len() - 2);
    (crc(body) == check).then(|| body.to_vec())
}

/// Returns unit and PDU of the characters between the colon and the end of an ASCII frame, if they are valid.
pub fn judge_ascii(inside: &[u8]) -> Option<Vec<u8>> {
    let text = std::str::from_utf8(inside).ok()?;
    let fits = text.len() % 2 == 0 && (6..=510).contains(&text.len());
    let digits = text.chars().all(|c| "0123456789ABCDEF".contains(c));
    if !fits || !digits {
        return None;
    }
    let pair = |at: usize| u8::from_str_radix(&text[at..at + 2], 16).ok();
    let mut bytes = (0..text.len())
        .step_by(2)
        .map(pair)
        .collect::<Option<Vec<u8>>>()?;
    let check = bytes.pop()?;
    (check == lrc(&bytes)).then_some(bytes)
}
/// Returns a PDU of function code and 16-bit fields.
pub fn pdu(function: u8, fields: &[u16]) -> Vec<u8> {
    let mut pdu = vec![function];
    fields
        .iter()
        .for_each(|field| pdu.extend(field.to_be_bytes()));
    pdu
}

/// Returns the PDU of function 0F.
pub fn write_bits(start: u16, bits: &[bool]) -> Vec<u8> {
    let mut pdu = pdu(0x0F, &[start, bits.len() as u16]);
    let packed = pack(bits);
    pdu.push(packed.len() as u8);
    pdu.extend(packed);
    pdu
}

/// Returns the PDU of function 10.
pub fn write_words(start: u16, words: &[u16]) -> Vec<u8> {
    let mut pdu = pdu(0x10, &[start, words.len() as u16]);
    pdu.push((words.len() * 2) as u8);
    words.iter().for_each(|word| pdu.extend(word.to_be_bytes()));
    pdu
}

/// Returns the PDU of function 17.
pub fn write_then_read(read: u16, count: u16, write: u16, words: &[u16]) -> Vec<u8> {
    let mut request = pdu(0x17, &[read, count]);
    request.extend(&write_words(write, words)[1..]);
    request
}

/// Returns the PDU of function 14: file, first record and count of each group.
pub fn read_files(groups: &[(u16, u16, u16)]) -> Vec<u8> {
    let groups: Vec<Vec<u8>> = groups
        .iter()
        .map(|(file, record, count)| pdu(6, &[*file, *record, *count]))
        .collect();
    let groups = groups.concat();
    [&[0x14, groups.len() as u8], &groups[..]].concat()
}

/// Returns the PDU of function 15: file, first record and words of each group.
pub fn write_files(groups: &[(u16, u16, Vec<u16>)]) -> Vec<u8> {
    let groups: Vec<Vec<u8>> = groups
        .iter()
        .map(|(file, record, words)| {
            let header = pdu(6, &[*file, *record, words.len() as u16]);
            [
                header,
                words.iter().flat_map(|word| word.to_be_bytes()).collect(),
            ]
            .concat()
        })
        .collect();
    let groups = groups.concat();
    [&[0x15, groups.len() as u8], &groups[..]].concat()
}

/// Packs eight bits into a byte, the first bit lowest.
pub fn pack(bits: &[bool]) -> Vec<u8> {
    let packed = |bits: &[bool]| {
        bits.iter()
            .rev()
            .fold(0, |byte, bit| byte << 1 | *bit as u8)
    };
    bits.chunks(8).map(packed).collect()
}
