//! A frame in one line of plain words.

/// What a frame says: a request when it goes to the unit, else a response.
pub fn of(frame: &[u8], request: bool, crc_ok: bool) -> String {
    let [unit, function, data @ .., _, _] = frame else {
        return format!("{} bytes, too short for a frame", frame.len());
    };
    if !crc_ok {
        return format!("{} bytes with a bad CRC", frame.len());
    }
    let to = match (request, unit) {
        (true, 0) => "all units".to_owned(),
        _ => format!("unit {unit}"),
    };
    let what = match function {
        0x80.. => exception(*function, data),
        _ if request => asked(*function, data),
        _ => answered(*function, data),
    };
    format!("{to}: {what}")
}

fn asked(function: u8, data: &[u8]) -> String {
    let (verb, noun) = name(function);
    match (function, words(data)) {
        (0x01..=0x04, [Some(at), Some(count)]) => format!("{verb} {count} {noun} from {at:#06x}"),
        (0x05 | 0x06, [Some(at), Some(value)]) => format!("{verb} {noun} {at:#06x}: {value:#06x}"),
        (0x0F | 0x10, [Some(at), Some(count)]) => format!("{verb} {count} {noun} from {at:#06x}"),
        _ => format!("{verb} {noun}: {} bytes", data.len()),
    }
}

fn answered(function: u8, data: &[u8]) -> String {
    let (verb, noun) = name(function);
    match (function, words(data)) {
        (0x05 | 0x06, [Some(at), Some(value)]) => {
            format!("{verb} {noun} {at:#06x}: {value:#06x}, done")
        }
        (0x0F | 0x10, [Some(at), Some(count)]) => {
            format!("{verb} {count} {noun} from {at:#06x}, done")
        }
        _ => {
            let bytes: Vec<String> = data
                .iter()
                .skip(1)
                .map(|byte| format!("{byte:02x}"))
                .collect();
            format!("{noun}: {}", bytes.join(" "))
        }
    }
}

fn exception(function: u8, data: &[u8]) -> String {
    let (verb, noun) = name(function & 0x7F);
    // V1.1b3, chapter 7.
    let reason = match data {
        [0x01] => "01, illegal function",
        [0x02] => "02, illegal data address",
        [0x03] => "03, illegal data value",
        [0x04] => "04, device failure",
        [0x06] => "06, busy",
        [code] => return format!("exception {code:02x} to {verb} {noun}"),
        _ => return format!("a broken exception to {verb} {noun}"),
    };
    format!("exception {reason}, to {verb} {noun}")
}

/// What a function does, and with what (V1.1b3, 6).
fn name(function: u8) -> (&'static str, String) {
    let (verb, noun) = match function {
        0x01 => ("read", "coils"),
        0x02 => ("read", "discrete inputs"),
        0x03 => ("read", "holding registers"),
        0x04 => ("read", "input registers"),
        0x05 => ("write", "coil"),
        0x06 => ("write", "register"),
        0x0F => ("write", "coils"),
        0x10 => ("write", "registers"),
        _ => return ("do", format!("function {function:02x}")),
    };
    (verb, noun.to_owned())
}

/// The first two 16-bit words of a PDU after its function code.
fn words(data: &[u8]) -> [Option<u16>; 2] {
    let mut words = data
        .chunks_exact(2)
        .map(|word| u16::from_be_bytes([word[0], word[1]]));
    [words.next(), words.next()]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The PDU's bytes with a unit address before and any CRC behind.
    fn told(unit: u8, pdu: &[u8], request: bool) -> String {
        let frame = [&[unit], pdu, &[0, 0]].concat();
        of(&frame, request, true)
    }

    #[test]
    fn requests_are_told() {
        for (unit, pdu, text) in [
            (
                1,
                &[1, 0, 0x10, 0, 4][..],
                "unit 1: read 4 coils from 0x0010",
            ),
            (
                247,
                &[4, 2, 0, 0, 2][..],
                "unit 247: read 2 input registers from 0x0200",
            ),
            (
                0,
                &[5, 0, 0x10, 0xFF, 0][..],
                "all units: write coil 0x0010: 0xff00",
            ),
            (
                1,
                &[15, 0, 0x10, 0, 4, 1, 5][..],
                "unit 1: write 4 coils from 0x0010",
            ),
            (1, &[0x2B, 14, 1, 0][..], "unit 1: do function 2b: 3 bytes"),
            (1, &[3, 0][..], "unit 1: read holding registers: 1 bytes"),
        ] {
            assert_eq!(told(unit, pdu, true), text);
        }
    }

    #[test]
    fn responses_are_told() {
        for (pdu, text) in [
            (&[1, 1, 0x05][..], "unit 1: coils: 05"),
            (
                &[3, 4, 0x23, 0x83, 0x58, 0x60][..],
                "unit 1: holding registers: 23 83 58 60",
            ),
            (
                &[5, 0, 0x10, 0xFF, 0][..],
                "unit 1: write coil 0x0010: 0xff00, done",
            ),
            (
                &[16, 1, 0, 0, 2][..],
                "unit 1: write 2 registers from 0x0100, done",
            ),
            (
                &[0x81, 2][..],
                "unit 1: exception 02, illegal data address, to read coils",
            ),
            (&[0xC1, 0x0B][..], "unit 1: exception 0b to do function 41"),
        ] {
            assert_eq!(told(1, pdu, false), text);
        }
    }

    #[test]
    fn what_is_no_frame_is_told_as_such() {
        assert_eq!(
            of(&[1, 2, 3], true, false),
            "3 bytes, too short for a frame"
        );
        assert_eq!(of(&[], false, false), "0 bytes, too short for a frame");
        assert_eq!(
            of(&[1, 1, 0, 0, 0, 1, 9, 9], true, false),
            "8 bytes with a bad CRC"
        );
    }
}
