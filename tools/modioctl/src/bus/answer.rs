//! What an answer means to the master: whose it is, whether it can be asked for again, and why there was none.

use std::io;

use register_map::state::PRODUCT_CODE;

use super::adu::ASCII_MOST;

/// Number of received bytes after which a line counts as never silent: several of the longest frames.
pub const MOST: usize = 4 * ASCII_MOST;

/// Reads one register. The response never equals the request, so this shows whether an adapter returns what it sends.
pub const PROBE: [u8; 5] = {
    let [high, low] = PRODUCT_CODE.to_be_bytes();
    [3, high, low, 0, 1]
};

/// Reason why a request had no answer.
#[derive(Debug)]
pub enum Lost {
    /// Nothing was received.
    Silent,
    /// A gateway answered that the unit does not answer it: exception 0A or 0B.
    Absent(u8),
    /// These bytes were received, and they are not an answer.
    Garbled(Vec<u8>),
    /// The port or the connection is lost.
    Broken(io::Error),
}

/// Returns whether an exception is the answer of a gateway for a unit that does not answer it (V1.1b3 chapter 7, codes
/// 0A and 0B).
pub(super) const fn is_from_gateway(code: u8) -> bool {
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

/// Returns the answer of a unit. A gateway answers for a unit that is absent.
pub(super) fn present(answer: Vec<u8>) -> Result<Vec<u8>, Lost> {
    match answer[..] {
        [0x80..=0xFF, code] if is_from_gateway(code) => Err(Lost::Absent(code)),
        _ => Ok(answer),
    }
}

/// Returns whether every response to this request differs from the request.
pub(super) const fn differs(pdu: &[u8]) -> bool {
    matches!(
        pdu,
        [
            0x01..=0x04 | 0x07 | 0x0B | 0x0C | 0x0F..=0x11 | 0x14 | 0x17 | 0x18,
            ..
        ] | [0x2B, 0x0E, ..]
    )
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
