//! Describes messages in words, for people.

use super::{FUNCTION, Packet, sub};
use crate::Direction;
use crate::adu::{Framing, bytes};

/// Returns the PDU that a message carries to or from the unit with a serial number.
pub fn carried(pdu: &[u8]) -> Option<(Direction, &[u8])> {
    match pdu {
        [FUNCTION, sub::REQUEST, _, _, _, _, pdu @ ..] => Some((Direction::Request, pdu)),
        [FUNCTION, sub::REPLY, _, _, _, _, pdu @ ..] => Some((Direction::Response, pdu)),
        _ => None,
    }
}

/// Describes a PDU of function 70, without what it carries. Returns `None` for an unknown sub-function, and when the form
/// does not match it.
pub fn words(pdu: &[u8]) -> Option<String> {
    let [FUNCTION, sub, data @ ..] = pdu else {
        return None;
    };
    let text = match (*sub, data) {
        (sub::START_SCAN, []) => "start scan".to_owned(),
        (sub::CONTINUE_SCAN, []) => "continue scan".to_owned(),
        (sub::FOUND, [serial @ .., unit]) => format!("found {}, unit {unit}", hex(serial)?),
        (sub::NONE_LEFT, []) => "no unit is left".to_owned(),
        (sub::REQUEST, _) => format!("for {}", hex(data.get(..4)?)?),
        (sub::REPLY, _) => format!("from {}", hex(data.get(..4)?)?),
        (sub::FETCH, [least, room, unit, flag]) => {
            let from = format!("fetch events from unit {least} on, {room} bytes");
            match unit {
                0 => from,
                _ => format!("{from}, has packet {flag} of unit {unit}"),
            }
        }
        (sub::EVENTS, _) => events(&Packet::of(0, data)?),
        (sub::NO_EVENTS, []) => "no events".to_owned(),
        _ => return None,
    };
    Some(text)
}

fn events(packet: &Packet) -> String {
    let each = packet.events.iter().map(|event| {
        let value = bytes(Framing::Rtu, &event.data);
        let text = format!("type {} {:#06X} = {value}", event.kind, event.id);
        text.trim_end_matches(" = ").to_owned()
    });
    let each: Vec<_> = each.collect();
    let (flag, waiting) = (packet.flag, packet.waiting);
    format!("packet {flag}, {waiting} events: {}", each.join(", "))
}

/// Returns a serial number in hexadecimal; `None` when it has another length.
fn hex(serial: &[u8]) -> Option<String> {
    let serial = serial.try_into().ok()?;
    Some(format!("{:08X}", u32::from_be_bytes(serial)))
}

#[cfg(test)]
mod tests {
    use crate::decode::{request, response};

    #[test]
    fn messages_are_described() {
        for (pdu, text) in [
            (&[0x46, 1][..], "start scan"),
            (&[0x46, 3, 13, 0, 0xA1, 0xB2, 17], "found 0D00A1B2, unit 17"),
            (&[0x46, 4], "no unit is left"),
            (
                &[0x46, 8, 13, 0, 0xA1, 0xB2, 3, 2, 0, 0, 6],
                "for 0D00A1B2: read holding registers 0x0200 x 6",
            ),
            (
                &[0x46, 0x10, 0, 64, 0, 0],
                "fetch events from unit 0 on, 64 bytes",
            ),
            (
                &[0x46, 0x10, 0, 64, 5, 1],
                "fetch events from unit 0 on, 64 bytes, has packet 1 of unit 5",
            ),
            (
                &[0x46, 0x11, 1, 2, 10, 2, 4, 1, 0xD0, 4, 0, 0, 15, 0, 0],
                "packet 1, 2 events: type 4 0x01D0 = 04 00, type 15 0x0000",
            ),
            (&[0x46, 0x12], "no events"),
            (&[0x46, 0x18, 0], "fast modbus: 18 00"),
            (&[0x46, 3, 13], "fast modbus: 03 0D"),
        ] {
            let text = text.to_owned();
            let text = if text.starts_with("fast") {
                text
            } else {
                format!("fast modbus {text}")
            };
            assert_eq!([request(pdu), response(pdu, None)], [text.clone(), text]);
        }
        let asked = [0x46, 8, 13, 0, 0xA1, 0xB2, 3, 2, 0, 0, 1];
        let answer = [0x46, 9, 13, 0, 0xA1, 0xB2, 3, 2, 0x23, 0x83];
        let text = "fast modbus from 0D00A1B2: read holding registers 0x0200 = 2383";
        assert_eq!(response(&answer, Some(&asked)), text);
    }
}
