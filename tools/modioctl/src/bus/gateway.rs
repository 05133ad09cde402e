//! Exceptions with which a gateway, or a unit, does not answer a request.

/// Returns whether an exception is the answer of a gateway for a unit that does not answer it (V1.1b3 chapter 7, codes
/// 0A and 0B).
pub const fn is_from_gateway(code: u8) -> bool {
    matches!(code, 0x0A | 0x0B)
}

/// Returns whether an answer to a read is exception 05 or 06: the unit, or a gateway, has no time for it now. To a write
/// these exceptions can mean more.
pub const fn is_busy(pdu: &[u8], answer: &[u8]) -> bool {
    let is_read = matches!(
        pdu,
        [0x01..=0x04 | 0x07 | 0x0B | 0x0C | 0x11 | 0x14 | 0x18, ..] | [0x2B, 0x0E, ..]
    );
    is_read && matches!(answer, [0x80..=0xFF, 5 | 6])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_read_can_be_repeated_while_the_unit_is_busy() {
        assert!(is_busy(&[3, 0, 0, 0, 1], &[0x83, 6]));
        assert!(is_busy(&[0x2B, 0x0E, 1, 0], &[0xAB, 5]));
        assert!(!is_busy(&[6, 1, 0, 0, 1], &[0x86, 6]), "a write");
        assert!(!is_busy(&[3, 0, 0, 0, 1], &[0x83, 2]));
    }
}
