//! Writing coils: functions 05 and 0F.

use crate::case::{Case, Check, Need, case, skip};
use crate::points::{pdu, write_bits};
use crate::tester::Tester;

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    case("fc05/on-and-off", "V1.1b3 6.5", "FF00 sets, 0000 clears, and both are echoed",
        &[Need::Function(5), Need::Function(1), Need::Bits], on_and_off),
    case("fc05/value", "V1.1b3 6.5", "any value but FF00 and 0000 is exception 03, and the coil stays",
        &[Need::Function(5), Need::Function(1), Need::Bits], value),
    case("fc05/address", "V1.1b3 6.5", "a coil that is not there is exception 02", &[Need::Function(5)], address),
    case("fc05/value-before-address", "V1.1b3 6.5", "a bad value at a bad address is exception 03",
        &[Need::Function(5)], value_first),
    case("fc05/length", "V1.1b3 6.5", "a request a byte short or long is 03 or silence, and the coil stays",
        &[Need::Function(5), Need::Function(1), Need::Bits], length).interpretation(),
    case("fc0f/every-quantity", "V1.1b3 6.11",
        "every quantity of coils is written, and echoed with address and quantity",
        &[Need::Function(0x0F), Need::Function(1), Need::Bits], every_quantity),
    case("fc0f/quantity-0-and-1969", "V1.1b3 6.11",
        "quantities of 0 and above 1968 are exception 03, byte count right or not", &[Need::Function(0x0F)],
        quantity_out_of_range),
    case("fc0f/quantity-1968", "V1.1b3 6.11",
        "1968 coils with byte count 246 fit a frame: written, or 02 where there are not so many",
        &[Need::Function(0x0F)], quantity_most),
    case("fc0f/quantity-before-address", "V1.1b3 6.11",
        "a bad quantity or byte count at a bad address is exception 03, not 02", &[Need::Function(0x0F)],
        quantity_first),
    case("fc0f/byte-count", "V1.1b3 6.11",
        "a byte count that does not fit the quantity is exception 03 and writes nothing",
        &[Need::Function(0x0F), Need::Function(1), Need::Bits], byte_count),
    case("fc0f/data-length", "V1.1b3 6.11",
        "data short of the byte count or beyond it is 03 or silence and writes nothing",
        &[Need::Function(0x0F), Need::Function(1), Need::Bits], data_length).interpretation(),
    case("fc0f/padding", "V1.1b3 6.11", "padding bits of the last byte are ignored",
        &[Need::Function(0x0F), Need::Function(1), Need::Bits], padding),
    case("fc0f/past-the-end", "V1.1b3 6.11", "a range past the end is exception 02 and writes nothing",
        &[Need::Function(0x0F), Need::Function(1), Need::Bits], past_the_end),
];

fn on_and_off(tester: &mut Tester<'_>) -> Check {
    let span = tester.bits()?.up_to(16);
    for address in span.first..=span.last {
        for (value, state) in [(0xFF00, true), (0xFF00, true), (0, false)] {
            let mut wanted = tester.read_bits(span)?;
            let request = pdu(5, address, value);
            tester.reply_is(&request, &request)?;
            wanted[usize::from(address - span.first)] = state;
            let text = format!("coil {address:04X} is {state}, no other has changed");
            tester.bits_are(span, &wanted, text)?;
        }
    }
    Ok(())
}

fn value(tester: &mut Tester<'_>) -> Check {
    let span = tester.bits()?;
    let at = span.up_to(1);
    for state in [true, false] {
        tester.set_bits(span.first, &[state])?;
        for value in [0x0001, 0x00FF, 0x0100, 0x1234, 0xFE00, 0xFF01, 0xFFFF] {
            tester.exception(&pdu(5, span.first, value), 3)?;
            tester.bits_are(at, &[state], format!("the coil still is {state}"))?;
        }
    }
    Ok(())
}

fn address(tester: &mut Tester<'_>) -> Check {
    for address in tester.outside(1) {
        tester.exception(&pdu(5, address, 0xFF00), 2)?;
        tester.exception(&pdu(5, address, 0), 2)?;
    }
    Ok(())
}

fn value_first(tester: &mut Tester<'_>) -> Check {
    let nowhere = tester.target.nowhere(1).unwrap_or(0xFFFF);
    tester.exception(&pdu(5, nowhere, 0x1234), 3)
}

fn length(tester: &mut Tester<'_>) -> Check {
    let span = tester.bits()?.up_to(1);
    tester.set_bits(span.first, &[false])?;
    let request = pdu(5, span.first, 0xFF00);
    tester.wrong_lengths(&request, &[1])?;
    tester.is_off(span)
}

fn every_quantity(tester: &mut Tester<'_>) -> Check {
    let span = tester.bits()?;
    let longest = span.len().min(1968) as u16;
    for quantity in (1..=longest.min(17)).chain([longest]) {
        let here = span.up_to(quantity);
        for odd in [true, false] {
            let values: Vec<bool> = (0..quantity).map(|n| (n % 2 == 1) == odd).collect();
            let request = write_bits(span.first, &values, false);
            tester.reply_is(&request, &request[..5])?;
            tester.bits_are(here, &values, format!("the coils are {values:?}"))?;
        }
    }
    Ok(())
}

fn quantity_out_of_range(tester: &mut Tester<'_>) -> Check {
    let at = tester.target.bits.map_or(0, |span| span.first);
    tester.exception(&[pdu(0x0F, at, 0), vec![0]].concat(), 3)?;
    tester.exception(&[pdu(0x0F, at, 0), vec![1, 0]].concat(), 3)?;
    // 1969 coils need 247 bytes. Their frame has 256 bytes, which is still a valid length.
    for (quantity, bytes) in [(1969, 247_u8), (1976, 247), (2048, 0), (0xFFFF, 247)] {
        let data = vec![0; usize::from(bytes)];
        let request = [pdu(0x0F, at, quantity), vec![bytes], data].concat();
        tester.exception(&request, 3)?;
    }
    Ok(())
}

fn quantity_first(tester: &mut Tester<'_>) -> Check {
    let nowhere = tester.nowhere(1)?;
    for (quantity, count) in [(0, 0_u8), (0, 1), (1969, 247), (1, 0), (1, 2), (9, 1)] {
        let data = vec![0; usize::from(count)];
        let request = [pdu(0x0F, nowhere, quantity), vec![count], data].concat();
        tester.exception(&request, 3)?;
    }
    tester.exception(&write_bits(nowhere, &[false], false), 2)
}

fn quantity_most(tester: &mut Tester<'_>) -> Check {
    let span = tester.target.bits;
    if let Some(span) = span.filter(|span| span.len() >= 1968) {
        if !tester.target.has(1) {
            return skip("the coils cannot be read first");
        }
        // Write the values that the coils already have.
        let values = tester.read_bits(span.up_to(1968))?;
        let request = write_bits(span.first, &values, false);
        return tester.reply_is(&request, &request[..5]);
    }
    let at = span.map_or(0, |span| span.first);
    let request = [pdu(0x0F, at, 1968), vec![246], vec![0; 246]].concat();
    tester.exception(&request, 2)
}

fn byte_count(tester: &mut Tester<'_>) -> Check {
    let span = tester.bits()?.up_to(8);
    let quantity = span.len() as u16;
    tester.set_bits(span.first, &vec![false; usize::from(quantity)])?;
    for (count, bytes) in [(0_u8, 0), (0, 1), (2, 2), (3, 3), (255, 1), (246, 246)] {
        let head = [pdu(0x0F, span.first, quantity), vec![count]].concat();
        tester.exception_03_with(&head, &vec![0xFF; bytes])?;
    }
    tester.is_off(span)
}

fn data_length(tester: &mut Tester<'_>) -> Check {
    let span = tester.bits()?.up_to(8);
    let quantity = span.len() as u16;
    tester.set_bits(span.first, &vec![false; usize::from(quantity)])?;
    let request = write_bits(span.first, &vec![true; usize::from(quantity)], false);
    tester.wrong_lengths(&request, &[1, 2, 240])?;
    tester.is_off(span)
}

fn padding(tester: &mut Tester<'_>) -> Check {
    let span = tester.bits()?;
    let all = span.up_to(8);
    for quantity in 1..=all.len() as u16 {
        tester.set_bits(all.first, &vec![false; all.len() as usize])?;
        let request = write_bits(all.first, &vec![true; usize::from(quantity)], true);
        tester.reply_is(&request, &request[..5])?;
        let wanted: Vec<bool> = (0..all.len()).map(|n| n < u32::from(quantity)).collect();
        tester.bits_are(all, &wanted, format!("the coils are {wanted:?}"))?;
    }
    Ok(())
}

fn past_the_end(tester: &mut Tester<'_>) -> Check {
    let span = tester.bits()?;
    let readable = tester.target.readable(1).to_vec();
    // The run with these coils may have more coils after them.
    let Some(run) = readable.iter().find(|run| run.has(span.last)).copied() else {
        return tester.fail("the coils to write to can be read");
    };
    let Some(_) = run.last.checked_add(1) else {
        return tester.exception(&write_bits(0xFFFF, &[false; 2], false), 2);
    };
    let whole = run.len().min(1967) as u16;
    let first = run.last - (whole - 1);
    let before = tester.read_bits(run.up_to(2000))?;
    tester.exception(&write_bits(run.last, &[true; 2], false), 2)?;
    let too_many = vec![true; usize::from(whole) + 1];
    tester.exception(&write_bits(first, &too_many, false), 2)?;
    tester.exception(&write_bits(0xFFFF, &[true; 2], false), 2)?;
    tester.bits_are(run.up_to(2000), &before, "no coil has been written")
}
