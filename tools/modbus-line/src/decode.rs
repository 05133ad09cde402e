//! Describes requests and responses in words, for people.

use crate::adu::{Framing, RTU_MOST, bytes};
use crate::{Direction, fast, names};

/// Describes a frame in words: the unit, and the request or response. `request` is the PDU of the preceding
/// request, if known: it has the addresses that a response does not repeat.
#[must_use]
pub fn frame(
    framing: Framing,
    direction: Direction,
    bytes: &[u8],
    request: Option<&[u8]>,
) -> String {
    match framing.open(bytes) {
        None => damaged(framing, bytes),
        Some((unit, pdu)) => {
            let text = match direction {
                Direction::Request => self::request(&pdu),
                Direction::Response => response(&pdu, request),
            };
            match unit {
                0 => format!("all units: {text}"),
                fast::ADDRESS if pdu.first() == Some(&fast::FUNCTION) => text,
                _ => format!("unit {unit}: {text}"),
            }
        }
    }
}

/// Returns how many bytes these are, in words.
#[must_use]
pub fn count_of(bytes: &[u8]) -> String {
    match bytes.len() {
        1 => "1 byte".to_owned(),
        length => format!("{length} bytes"),
    }
}

/// Describes what is wrong with bytes that are not a frame.
fn damaged(framing: Framing, bytes: &[u8]) -> String {
    let count = count_of(bytes);
    match (framing, bytes) {
        (Framing::Mbap, _) => format!("not a complete frame, {count}"),
        (_, [b':', .., b'\r', b'\n']) => format!("{count} with a bad LRC"),
        _ if bytes.len() < 4 => format!("{count}, too short for a frame"),
        _ if bytes.len() > RTU_MOST => format!("{count}, too long for a frame"),
        _ => format!("{count} with a bad CRC"),
    }
}

fn word(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_be_bytes(*bytes.get(at..)?.first_chunk()?))
}

fn named(code: u8) -> String {
    if code & 0x7F == fast::FUNCTION {
        return "fast modbus".to_owned();
    }
    names::function(code).map_or_else(|| format!("function {code:02X}"), str::to_owned)
}

/// Describes a request in words.
#[must_use]
pub fn request(pdu: &[u8]) -> String {
    let Some(code) = pdu.first() else {
        return "nothing".to_owned();
    };
    let name = named(*code);
    fields(*code, pdu).map_or_else(|| with_rest(&name, pdu), |text| format!("{name} {text}"))
}

fn with_rest(name: &str, pdu: &[u8]) -> String {
    match pdu.get(1..) {
        None | Some([]) => name.to_owned(),
        Some(rest) => format!("{name}: {}", bytes(Framing::Rtu, rest)),
    }
}

/// Describes the parameters of a request; `None` when its form does not match the function.
fn fields(code: u8, pdu: &[u8]) -> Option<String> {
    let (first, second) = (word(pdu, 1), word(pdu, 3));
    Some(match code {
        0x01..=0x04 => format!("{:#06X} x {}", first?, second?),
        0x05 => format!("{:#06X} = {}", first?, coil(second?)),
        0x06 => format!("{:#06X} = {}", first?, number(second?)),
        0x08 => format!("{:02X}: {}", first?, bytes(Framing::Rtu, pdu.get(3..)?)),
        0x0F => {
            let count = usize::from(second?);
            format!("{:#06X} x {count} = {}", first?, bits(pdu.get(6..)?, count))
        }
        0x10 => format!("{:#06X} x {} = {}", first?, second?, words(pdu.get(6..)?)),
        0x14 => {
            let groups = pdu.get(2..)?.chunks_exact(7).map(|group| {
                let at = |at| word(group, at).unwrap_or_default();
                format!("file {}, records {} x {}", at(1), at(3), at(5))
            });
            groups.collect::<Vec<_>>().join("; ")
        }
        0x16 => format!(
            "{:#06X} and {:#06X} or {:#06X}",
            first?,
            second?,
            word(pdu, 5)?
        ),
        0x17 => format!(
            "{:#06X} x {}, write {:#06X} = {}",
            first?,
            second?,
            word(pdu, 5)?,
            words(pdu.get(10..)?)
        ),
        fast::FUNCTION => message(pdu, None)?,
        0x2B if pdu.get(1) == Some(&0x0E) => format!(
            "read device identification, code {:02X}, from object {:02X}",
            pdu.get(2)?,
            pdu.get(3)?
        ),
        _ => return None,
    })
}

/// Describes a message of function 70, and the PDU that it carries to or from the unit with a serial number. `request` is
/// the PDU of the request before a reply.
fn message(pdu: &[u8], request: Option<&[u8]>) -> Option<String> {
    let text = fast::words(pdu)?;
    let Some((direction, carried)) = fast::carried(pdu) else {
        return Some(text);
    };
    let carried = match direction {
        Direction::Request => self::request(carried),
        Direction::Response => {
            let asked = request.and_then(fast::carried);
            response(carried, asked.map(|(_, pdu)| pdu))
        }
    };
    Some(format!("{text}: {carried}"))
}

/// Describes a response in words.
#[must_use]
pub fn response(pdu: &[u8], request: Option<&[u8]>) -> String {
    let Some(code) = pdu.first() else {
        return "nothing".to_owned();
    };
    let name = named(*code);
    if code & 0x80 != 0 {
        let reason = pdu.get(1).copied().unwrap_or_default();
        let why = names::exception(reason).unwrap_or("unknown exception");
        return format!("{name}: exception {reason:02X}, {why}");
    }
    let request = request.filter(|request| request.first() == Some(code));
    if let Some(wrong) = request.and_then(|request| wrong_count(request, pdu)) {
        return format!("{}, {wrong}", with_rest(&name, pdu));
    }
    answered(*code, pdu, request)
        .map_or_else(|| with_rest(&name, pdu), |text| format!("{name} {text}"))
}

/// Returns what is wrong with the byte count of a response to a read; `None` if nothing is, or for other functions.
pub(crate) fn wrong_count(request: &[u8], response: &[u8]) -> Option<String> {
    let (0x01..=0x04 | 0x17, [_, count, data @ ..]) = (*request.first()?, response) else {
        return None;
    };
    let asked = usize::from(u16::from_be_bytes(*request.get(3..)?.first_chunk()?));
    let right = match request[0] {
        0x01 | 0x02 => asked.div_ceil(8),
        _ => asked * 2,
    };
    let count = usize::from(*count);
    let is_same = request.first() == response.first();
    match is_same && (count, data.len()) != (right, right) {
        true if count == data.len() => {
            Some(format!("its byte count is {count}, and {right} is right"))
        }
        true => Some(format!(
            "its byte count is {count}, but it has {}",
            count_of(data)
        )),
        false => None,
    }
}

fn answered(code: u8, pdu: &[u8], request: Option<&[u8]>) -> Option<String> {
    let from = request.and_then(|request| word(request, 1));
    let from = from.map_or_else(String::new, |first| format!("{first:#06X} "));
    Some(match code {
        0x01 | 0x02 => {
            let data = pdu.get(2..)?;
            let count = request
                .and_then(|request| word(request, 3))
                .map(usize::from);
            format!("{from}= {}", bits(data, count.unwrap_or(data.len() * 8)))
        }
        0x03 | 0x04 | 0x17 => format!("{from}= {}", words(pdu.get(2..)?)),
        0x05 | 0x06 | 0x08 | 0x16 => fields(code, pdu)?,
        0x0F | 0x10 => format!("{:#06X} x {}", word(pdu, 1)?, word(pdu, 3)?),
        0x07 => format!("= {:08b}", pdu.get(1)?),
        0x0B => format!("status {:04X}, count {}", word(pdu, 1)?, word(pdu, 3)?),
        0x0C => log(pdu)?,
        0x11 => identity(pdu)?,
        0x14 => groups(pdu)?,
        fast::FUNCTION => message(pdu, request)?,
        0x2B => {
            let objects = objects(pdu)?.into_iter();
            let texts = objects.map(|(id, text)| format!("{id:02X} \"{text}\""));
            format!("= {}", texts.collect::<Vec<_>>().join(", "))
        }
        _ => return None,
    })
}

/// Returns the counters and events in a response of function 0C (V1.1b3, 6.10), newest event first.
fn log(pdu: &[u8]) -> Option<String> {
    let [status, events, messages] = [word(pdu, 2)?, word(pdu, 4)?, word(pdu, 6)?];
    let latest = match bytes(Framing::Rtu, counted(pdu)?.get(6..)?) {
        none if none.is_empty() => String::new(),
        latest => format!(": {latest}"),
    };
    Some(format!(
        "status {status:04X}, events {events}, messages {messages}{latest}"
    ))
}

/// Returns the server ID in a response of function 11, which the device defines, and the run indicator after it, if
/// the response contains only these (V1.1b3, 6.13).
fn identity(pdu: &[u8]) -> Option<String> {
    let data = counted(pdu)?;
    let (identity, state) = match data.split_last()? {
        (0, identity) => (identity, ", off"),
        (0xFF, identity) => (identity, ", on"),
        _ => (data, ""),
    };
    let is_text = str::from_utf8(identity)
        .is_ok_and(|text| !text.is_empty() && !text.contains(char::is_control));
    let identity = if is_text {
        format!("\"{}\"", text(identity))
    } else {
        bytes(Framing::Rtu, identity)
    };
    Some(format!("= {identity}{state}"))
}

/// Returns the records in a response of function 14, one group for each requested group (V1.1b3, 6.14).
fn groups(pdu: &[u8]) -> Option<String> {
    let mut rest = counted(pdu)?;
    let mut groups = Vec::new();
    while let Some((length, after)) = rest.split_first() {
        // The length includes the reference type, which is 6.
        let (group, after) = after.split_at_checked((*length).into())?;
        groups.push(words(group.strip_prefix(&[6])?));
        rest = after;
    }
    Some(format!("= {}", groups.join("; ")))
}

/// Returns the bytes that the second byte of a PDU counts; `None` when their number differs.
fn counted(pdu: &[u8]) -> Option<&[u8]> {
    let data = pdu.get(2..)?;
    (data.len() == usize::from(*pdu.get(1)?)).then_some(data)
}

/// Returns the objects in a response of function 2B/0E (V1.1b3, 6.21) in the form of [`text`].
#[must_use]
pub fn objects(pdu: &[u8]) -> Option<Vec<(u8, String)>> {
    let mut rest = pdu.get(7..)?;
    let mut objects = Vec::new();
    for _ in 0..*pdu.get(6)? {
        let (head, data) = rest.split_first_chunk::<2>()?;
        let (object, after) = data.split_at_checked(head[1].into())?;
        objects.push((head[0], text(object)));
        rest = after;
    }
    Some(objects)
}

/// Returns a text that a device sent, with escapes such as `\u{1b}` for every character that is not visible: control
/// characters act on a terminal, and others change the direction of the text after them.
#[must_use]
pub fn text(bytes: &[u8]) -> String {
    let mut shown = String::new();
    for c in String::from_utf8_lossy(bytes).chars() {
        match c {
            '"' | '\'' | '\\' => shown.push(c),
            _ => shown.extend(c.escape_debug()),
        }
    }
    shown
}

const fn coil(word: u16) -> &'static str {
    match word {
        0xFF00 => "on",
        0 => "off",
        _ => "neither on nor off",
    }
}

fn number(word: u16) -> String {
    format!("{word} ({word:#06X})")
}

fn words(data: &[u8]) -> String {
    let (pairs, _) = data.as_chunks::<2>();
    let texts = pairs
        .iter()
        .map(|pair| format!("{:04X}", u16::from_be_bytes(*pair)));
    texts.collect::<Vec<_>>().join(" ")
}

fn bits(data: &[u8], count: usize) -> String {
    let each = data
        .iter()
        .flat_map(|byte| (0..8).map(move |bit| byte >> bit & 1));
    each.take(count)
        .map(|bit| if bit == 1 { '1' } else { '0' })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_of_a_device_have_escapes_for_control_characters() {
        let object = |text: &[u8]| {
            let head = [0x2B, 0x0E, 1, 1, 0, 0, 1, 0, text.len() as u8];
            objects(&[&head, text].concat()).unwrap()[0].1.clone()
        };
        assert_eq!(object("MØ 2 (b)".as_bytes()), "MØ 2 (b)");
        assert_eq!(object("21 °C \"é\" \\".as_bytes()), "21 °C \"é\" \\");
        let red = object(b"a\x1b[31m\x07\r\n\x7f\x9b");
        assert_eq!(red, "a\\u{1b}[31m\\u{7}\\r\\n\\u{7f}\u{FFFD}");
        let directions = "\u{9B}\u{200F}\u{202E}\u{2066}\u{2028}".as_bytes();
        let escaped = r"\u{9b}\u{200f}\u{202e}\u{2066}\u{2028}";
        assert_eq!(object(directions), escaped);
        // The same texts in responses of functions 2B/0E and 11.
        let answer = [&[0x2B, 0x0E, 1, 1, 0, 0, 1, 0, 14][..], directions].concat();
        let shown = response(&answer, None);
        assert_eq!(shown, format!("encapsulated interface = 00 \"{escaped}\""));
        let shown = response(
            &[&[0x11, 4][..], "\u{202E}".as_bytes(), &[0xFF]].concat(),
            None,
        );
        assert_eq!(shown, r#"report server id = "\u{202e}", on"#);
    }

    #[test]
    fn requests_and_responses_are_described() {
        let asked = [3, 1, 1, 0, 2];
        assert_eq!(request(&asked), "read holding registers 0x0101 x 2");
        let answer = response(&[3, 4, 0, 96, 0, 0], Some(&asked));
        assert_eq!(answer, "read holding registers 0x0101 = 0060 0000");
        assert_eq!(
            request(&[5, 0, 0x10, 0xFF, 0]),
            "write single coil 0x0010 = on"
        );
        assert_eq!(
            request(&[0x0F, 0, 0x10, 0, 4, 1, 5]),
            "write multiple coils 0x0010 x 4 = 1010"
        );
        assert_eq!(
            response(&[1, 1, 5], Some(&[1, 0, 16, 0, 4])),
            "read coils 0x0010 = 1010"
        );
        assert_eq!(
            response(&[0x86, 6], Some(&[6, 1, 1, 0, 1])),
            "write single register: exception 06, server device busy"
        );
        let file = [0x14, 7, 6, 0, 1, 0, 0, 0, 2];
        assert_eq!(request(&file), "read file record file 1, records 0 x 2");
    }

    #[test]
    fn read_of_one_bit_shows_one_bit_and_names_a_wrong_byte_count() {
        let asked = Some(&[1, 0, 0x10, 0, 1][..]);
        assert_eq!(response(&[1, 1, 0xFF], asked), "read coils 0x0010 = 1");
        assert_eq!(response(&[1, 1, 0xFE], asked), "read coils 0x0010 = 0");
        let long = "read coils: 02 01 00, its byte count is 2, and 1 is right";
        assert_eq!(response(&[1, 2, 1, 0], asked), long);
        let words = Some(&[3, 0, 0x10, 0, 2][..]);
        let short = "read holding registers: 02 00 05, its byte count is 2, and 4 is right";
        assert_eq!(response(&[3, 2, 0, 5], words), short);
    }

    #[test]
    fn responses_with_a_byte_count_are_decoded() {
        for (pdu, text) in [
            // The example of V1.1b3, 6.10.
            (
                &[0x0C, 8, 0, 0, 1, 8, 1, 0x21, 0x20, 0][..],
                "get comm event log status 0000, events 264, messages 289: 20 00",
            ),
            (
                &[0x0C, 6, 0xFF, 0xFF, 0, 0, 0, 9],
                "get comm event log status FFFF, events 0, messages 9",
            ),
            (&[0x0C, 7, 0, 0], "get comm event log: 07 00 00"),
            (
                &[0x11, 6, b'm', b'o', b'd', b'i', b'o', 0xFF],
                "report server id = \"modio\", on",
            ),
            (&[0x11, 2, 1, 0], "report server id = 01, off"),
            (&[0x11, 2, 1, 7], "report server id = 01 07"),
            (&[0x11, 3, 1, 0xFF], "report server id: 03 01 FF"),
            // The example of V1.1b3, 6.14.
            (
                &[
                    0x14, 0x0C, 5, 6, 0x0D, 0xFE, 0, 0x20, 5, 6, 0x33, 0xCD, 0, 0x40,
                ],
                "read file record = 0DFE 0020; 33CD 0040",
            ),
            (&[0x14, 3, 5, 6, 0], "read file record: 03 05 06 00"),
        ] {
            assert_eq!(response(pdu, None), text);
        }
    }

    #[test]
    fn any_bytes_are_shown_without_a_panic() {
        for code in 0..=0xFF {
            for length in 0..12 {
                let pdu = [&[code], &[0xFF; 12][..length]].concat();
                let _ = (request(&pdu), response(&pdu, Some(&pdu)));
            }
        }
        assert_eq!(request(&[0x41, 1, 2]), "function 41: 01 02");
    }

    #[test]
    fn bytes_that_are_not_a_frame_are_described_as_damaged() {
        for (bytes, text) in [
            (&[1, 2, 3][..], "3 bytes, too short for a frame"),
            (&[1], "1 byte, too short for a frame"),
            (&[], "0 bytes, too short for a frame"),
            (&[1, 1, 0, 0, 0, 1, 9, 9], "8 bytes with a bad CRC"),
            (b":1103006B00037F\r\n", "17 bytes with a bad LRC"),
            (b":\r\n", "3 bytes with a bad LRC"),
            (&[0; 257], "257 bytes, too long for a frame"),
        ] {
            assert_eq!(frame(Framing::Rtu, Direction::Request, bytes, None), text);
        }
        let text = frame(Framing::Mbap, Direction::Request, &[0], None);
        assert_eq!(text, "not a complete frame, 1 byte");
    }
}
