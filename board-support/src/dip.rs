//! SW01, the eight-way DIP switch: read once at power-on.

/// The switch as a number 0 to 255, from the levels of ports A and B: position 1 is bit 0, and ON pulls
/// its pin low. Positions 1 to 4 are on PA4 to PA7, 5 to 8 on PB12 to PB15.
pub(crate) const fn number(a: u32, b: u32) -> u8 {
    !((a >> 4 & 0x0F) | (b >> 8 & 0xF0)) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_position_is_its_own_bit_and_other_pins_do_not_count() {
        assert_eq!(number(0xFFFF, 0xFFFF), 0, "all open");
        for position in 0..4 {
            assert_eq!(
                number(0xFFFF & !(1 << (4 + position)), 0xFFFF),
                1 << position
            );
            let upper = 1 << (4 + position);
            assert_eq!(number(0xFFFF, 0xFFFF & !(1 << (12 + position))), upper);
        }
        assert_eq!(number(0xFF0F, 0x0FFF), 255, "all closed");
        assert_eq!(number(0x00F0, 0xF000), 0);
    }
}
