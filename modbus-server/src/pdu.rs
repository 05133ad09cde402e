//! Decodes the fields of requests, the bytes after the function code: checks quantities, byte counts, lengths and the
//! form of values (exception 03), then the wrap at 16 bits (02). The model checks the addresses.

use crate::{Bits, Exception, Span, Words};

/// Largest number of bits that one request may read (V1.1b3 6.1).
pub(crate) const MAX_READ_BITS: u16 = 2000;
/// Largest number of words that one request may read (V1.1b3 6.3).
pub(crate) const MAX_READ_WORDS: u16 = 125;
/// Largest number of bits that one request may write (V1.1b3 6.11).
const MAX_WRITE_BITS: u16 = 1968;
/// Largest number of words that one request may write (V1.1b3 6.12).
const MAX_WRITE_WORDS: u16 = 123;
/// Largest number of words that one request may write when it also reads (V1.1b3 6.17).
const MAX_WRITE_WORDS_AND_READ: u16 = 121;

/// Decodes address and quantity.
pub(crate) fn read(fields: &[u8], most: u16) -> Result<Span, Exception> {
    let &[address_hi, address_lo, quantity_hi, quantity_lo] = fields else {
        return Err(Exception::IllegalDataValue);
    };
    span(
        u16::from_be_bytes([address_hi, address_lo]),
        u16::from_be_bytes([quantity_hi, quantity_lo]),
        most,
    )
}

/// Decodes address and FF00 (on) or 0000 (off). Used as packed bits, the first value byte contains exactly this
/// bit.
pub(crate) fn write_single_bit(fields: &[u8]) -> Result<(Span, Bits<'_>), Exception> {
    let (&[hi, lo], value @ ([0x00, 0x00] | [0xFF, 0x00])) = single(fields)? else {
        return Err(Exception::IllegalDataValue);
    };
    let span = Span::single(u16::from_be_bytes([hi, lo]));
    Ok((span, Bits::new(value, 1)))
}

/// Decodes address and value.
pub(crate) fn write_single_word(fields: &[u8]) -> Result<(Span, Words<'_>), Exception> {
    let (&address, value) = single(fields)?;
    let span = Span::single(u16::from_be_bytes(address));
    Ok((span, Words::new(value)))
}

/// Returns the address and the value of a single write.
fn single(fields: &[u8]) -> Result<(&[u8; 2], &[u8; 2]), Exception> {
    let (address, value) = fields
        .split_first_chunk()
        .ok_or(Exception::IllegalDataValue)?;
    let value = value.try_into().map_err(|_| Exception::IllegalDataValue)?;
    Ok((address, value))
}

/// Decodes address, quantity, byte count and packed bits.
pub(crate) fn write_bits(fields: &[u8]) -> Result<(Span, Bits<'_>), Exception> {
    let (start, quantity, data) = multiple(fields)?;
    if data.len() != usize::from(quantity.div_ceil(8)) {
        return Err(Exception::IllegalDataValue);
    }
    let span = span(start, quantity, MAX_WRITE_BITS)?;
    Ok((span, Bits::new(data, quantity)))
}

/// Decodes address, quantity, byte count and words.
pub(crate) fn write_words(fields: &[u8]) -> Result<(Span, Words<'_>), Exception> {
    let (start, quantity, data) = multiple(fields)?;
    if data.len() != usize::from(quantity) * 2 {
        return Err(Exception::IllegalDataValue);
    }
    let span = span(start, quantity, MAX_WRITE_WORDS)?;
    Ok((span, Words::new(data)))
}

/// Decodes address, AND mask and OR mask.
pub(crate) fn mask_word(fields: &[u8]) -> Result<[u16; 3], Exception> {
    let fields: [u8; 6] = fields.try_into().map_err(|_| Exception::IllegalDataValue)?;
    let [a, b, c, d, e, f] = fields;
    Ok([[a, b], [c, d], [e, f]].map(u16::from_be_bytes))
}

/// Decodes address and quantity to read, then the fields of [`write_words`]. Returns what to read, and what to write.
/// Both quantities are checked before the end of either range.
pub(crate) fn write_then_read(fields: &[u8]) -> Result<(Span, Span, Words<'_>), Exception> {
    let (to_read, to_write) = fields
        .split_first_chunk::<4>()
        .ok_or(Exception::IllegalDataValue)?;
    let (start, quantity, data) = multiple(to_write)?;
    if data.len() != usize::from(quantity) * 2 {
        return Err(Exception::IllegalDataValue);
    }
    let read = read(to_read, MAX_READ_WORDS);
    if read == Err(Exception::IllegalDataValue) {
        return Err(Exception::IllegalDataValue);
    }
    let write = span(start, quantity, MAX_WRITE_WORDS_AND_READ)?;
    Ok((read?, write, Words::new(data)))
}

/// Checks that a function without fields has none.
pub(crate) const fn nothing(fields: &[u8]) -> Result<(), Exception> {
    if fields.is_empty() {
        Ok(())
    } else {
        Err(Exception::IllegalDataValue)
    }
}

/// Returns address, quantity and data of a multiple write whose byte count is correct.
fn multiple(fields: &[u8]) -> Result<(u16, u16, &[u8]), Exception> {
    let &[
        address_hi,
        address_lo,
        quantity_hi,
        quantity_lo,
        byte_count,
        ref data @ ..,
    ] = fields
    else {
        return Err(Exception::IllegalDataValue);
    };
    if data.len() != usize::from(byte_count) {
        return Err(Exception::IllegalDataValue);
    }
    Ok((
        u16::from_be_bytes([address_hi, address_lo]),
        u16::from_be_bytes([quantity_hi, quantity_lo]),
        data,
    ))
}

/// Returns the span, after the checks of its quantity and then of its end.
fn span(start: u16, quantity: u16, most: u16) -> Result<Span, Exception> {
    if quantity == 0 || quantity > most {
        return Err(Exception::IllegalDataValue);
    }
    Span::new(start, quantity).ok_or(Exception::IllegalDataAddress)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_also_apply_to_requests_too_long_for_a_frame() {
        // 124 words with a correct byte count: 259 bytes on an RTU line, but other kinds of lines may carry it.
        let fields = |count: u8| {
            let mut fields = [0; 5 + 248];
            fields[3] = count;
            fields[4] = count * 2;
            fields
        };
        let decode = |fields: &[u8]| write_words(fields).map(|_| ());
        assert_eq!(decode(&fields(124)), Err(Exception::IllegalDataValue));
        assert_eq!(decode(&fields(123)[..5 + 246]), Ok(()));

        let fields = |count: u8| {
            let mut fields = [0; 9 + 244];
            fields[3] = 1;
            fields[7] = count;
            fields[8] = count * 2;
            fields
        };
        let decode = |fields: &[u8]| write_then_read(fields).map(|_| ());
        assert_eq!(decode(&fields(122)), Err(Exception::IllegalDataValue));
        assert_eq!(decode(&fields(121)[..9 + 242]), Ok(()));
    }
}
