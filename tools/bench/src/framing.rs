//! Framing of a request and its response on the line, in both transmission modes (V1.02 2.5).

use crc::{CRC_16_MODBUS, Crc};
use register_map::codes::Mode;

use crate::requests::UNIT;

const MODBUS: Crc<u16> = Crc::<u16>::new(&CRC_16_MODBUS);

/// Returns the ADU for the unit: bytes and a CRC in RTU mode, hexadecimal digits and an LRC in ASCII mode.
#[must_use]
pub fn adu(mode: Mode, pdu: &[u8]) -> Vec<u8> {
    let mut adu = vec![UNIT];
    adu.extend(pdu);
    match mode {
        Mode::Rtu => {
            let check = MODBUS.checksum(&adu);
            adu.extend(check.to_le_bytes());
            adu
        }
        Mode::Ascii => {
            let sum = adu.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
            adu.push(sum.wrapping_neg());
            let digits: String = adu.iter().map(|byte| format!("{byte:02X}")).collect();
            format!(":{digits}\r\n").into_bytes()
        }
    }
}

/// Returns whether these bytes are an ADU of the unit with a valid CRC or LRC.
#[must_use]
pub fn is_adu(mode: Mode, bytes: &[u8]) -> bool {
    inside(mode, bytes).is_some_and(|pdu| !pdu.is_empty() && adu(mode, &pdu) == bytes)
}

/// Returns the PDU of an ADU.
fn inside(mode: Mode, bytes: &[u8]) -> Option<Vec<u8>> {
    match mode {
        Mode::Rtu => bytes
            .get(1..bytes.len().checked_sub(2)?)
            .map(<[u8]>::to_vec),
        Mode::Ascii => {
            let digits = bytes.get(3..bytes.len().checked_sub(4)?)?;
            let pair = |pair| u8::from_str_radix(str::from_utf8(pair).ok()?, 16).ok();
            digits.chunks(2).map(pair).collect()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_of_both_modes_are_recognised() {
        // The standard's appendix B has 02 07 with the CRC 41 12; here the unit is 1.
        let rtu = adu(Mode::Rtu, &[0x07]);
        assert_eq!(rtu, [0x01, 0x07, 0x41, 0xE2]);
        // 01 + 03 + 10 + 01 = 15, and EB makes it 100.
        let ascii = adu(Mode::Ascii, &[0x03, 0x10, 0x01]);
        assert_eq!(ascii, b":01031001EB\r\n");
        assert!(is_adu(Mode::Rtu, &rtu) && is_adu(Mode::Ascii, &ascii));
        assert!(!is_adu(Mode::Rtu, &ascii) && !is_adu(Mode::Ascii, &rtu));
        assert!(!is_adu(Mode::Rtu, &[1, 2, 3, 4]) && !is_adu(Mode::Rtu, &[1]));
        for wrong in [
            &b":01031001EA\r\n"[..],
            b":01031001EB\r",
            b":0103101EB\r\n",
            b":\r\n",
            b"",
        ] {
            assert!(!is_adu(Mode::Ascii, wrong), "{wrong:?}");
        }
    }
}
