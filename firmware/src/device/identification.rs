//! Identification of the device: functions 11 and 2B/0E (V1.1b3 6.13, 6.21).

use crate::config::Config;
use register_map::board::Board;

/// Number of hexadecimal digits of the unique identity.
pub const SERIAL_LEN: usize = 24;

/// Returns the unique identity as text: the half-words in the order of their registers.
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

/// Object ID for the module of the first slot. Those of the other slots follow.
const FIRST_MODULE: u8 = 0x81;

/// Returns an object of the device identification: 00 to 06 as in the standard; 80, the unique identity; from 81
/// on, the module of each slot.
#[must_use]
pub fn object<'a, B: Board>(
    id: u8,
    serial: &'a [u8; SERIAL_LEN],
    config: &Config<B>,
) -> Option<&'a [u8]> {
    let board = B::ROW;
    Some(match id {
        0x00 => b"modio",
        0x01 => b"23835860",
        0x02 => env!("CARGO_PKG_VERSION").as_bytes(),
        0x03 => env!("CARGO_PKG_REPOSITORY").as_bytes(),
        0x04 => board.name.as_bytes(),
        0x05 => board.model.as_bytes(),
        0x06 => b"Modbus I/O",
        0x80 => serial,
        _ => {
            let slot = usize::from(id.checked_sub(FIRST_MODULE)?);
            config.modules().get(slot)?.name().as_bytes()
        }
    })
}

#[cfg(test)]
mod tests {
    extern crate std;

    use register_map::board::{Modio02, Modio08};
    use register_map::configuration::module_of;

    use super::*;
    use crate::config::Settings;

    #[test]
    fn the_product_code_is_that_of_the_registers() {
        let config = Config::<Modio02>::new(Settings::defaults(), false);
        let code = std::format!("{:08X}", register_map::state::PRODUCT);
        assert_eq!(object(1, &[0; 24], &config), Some(code.as_bytes()));
        assert_eq!(object(4, &[0; 24], &config), Some(&b"modio-02"[..]));
    }

    #[test]
    fn the_serial_number_is_the_unique_identity() {
        let config = Config::<Modio02>::new(Settings::defaults(), false);
        let serial = serial([0x0123, 0x4567, 0x89AB, 0xCDEF, 0x0000, 0xFFFF]);
        assert_eq!(&serial, b"0123456789ABCDEF0000FFFF");
        assert_eq!(object(0x80, &serial, &config), Some(&serial[..]));
    }

    #[test]
    fn every_slot_has_an_object_for_its_module() {
        let pairs = [(module_of(1), 1), (module_of(4), 5)];
        let (settings, _) = Settings::load(pairs.into_iter());
        let config = Config::<Modio08>::new(settings, false);
        let modules = (0x81..=0x84).map(|id| object(id, &[0; 24], &config));
        assert!(modules.eq([&b"4di"[..], b"none", b"none", b"4ao"].map(Some)));
        assert_eq!(object(0x85, &[0; 24], &config), None);
        assert_eq!(object(0x7F, &[0; 24], &config), None);
    }
}
