//! Who the device says it is: functions 11 and 2B/0E (V1.1b3 6.13, 6.21).

use register_map::{Module, state};

/// The identity of function 11: the board, as its register has it. Masters that take a single byte
/// for the identity find the run indicator where they look for it.
pub const SERVER_ID: [u8; 1] = [state::BOARD_MODIO_02 as u8];

/// Hexadecimal digits of the unique identity.
pub const SERIAL_LEN: usize = 24;

/// The unique identity as text: the half-words in the order of their registers.
#[must_use]
pub fn serial(unique_id: [u16; 6]) -> [u8; SERIAL_LEN] {
    let mut text = [b'0'; SERIAL_LEN];
    for (digits, mut word) in text.chunks_exact_mut(4).zip(unique_id) {
        for digit in digits.iter_mut().rev() {
            let nibble = (word & 0xF) as u8;
            *digit = nibble + if nibble < 10 { b'0' } else { b'A' - 10 };
            word >>= 4;
        }
    }
    text
}

/// An object of the device identification: 00 to 06 as the standard has them; 80, the unique
/// identity; 81, the module in the slot.
#[must_use]
pub const fn object(id: u8, serial: &[u8; SERIAL_LEN], module: Module) -> Option<&[u8]> {
    Some(match id {
        0x00 => b"modio",
        0x01 => b"23835860",
        0x02 => env!("CARGO_PKG_VERSION").as_bytes(),
        0x03 => env!("CARGO_PKG_REPOSITORY").as_bytes(),
        0x04 => b"modio-02",
        0x05 => b"LLD-ModbusIO-02",
        0x06 => b"Modbus I/O",
        0x80 => serial,
        0x81 => module.name().as_bytes(),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_product_code_is_that_of_the_registers() {
        extern crate std;
        let code = std::format!("{:08X}", state::PRODUCT);
        assert_eq!(object(1, &[0; 24], Module::None), Some(code.as_bytes()));
    }

    #[test]
    fn the_serial_number_is_the_unique_identity() {
        let serial = serial([0x0123, 0x4567, 0x89AB, 0xCDEF, 0x0000, 0xFFFF]);
        assert_eq!(&serial, b"0123456789ABCDEF0000FFFF");
        assert_eq!(object(0x80, &serial, Module::Di4), Some(&serial[..]));
        assert_eq!(object(0x81, &serial, Module::Di4), Some(&b"4di"[..]));
        assert_eq!(object(0x82, &serial, Module::Di4), None);
    }
}
