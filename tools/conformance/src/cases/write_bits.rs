//! Writing coils: functions 05 and 0F.

use crate::bench::Bench;
use crate::case::{Case, Check, Need, case, skip};
use crate::points::{pdu, write_bits};

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

fn on_and_off(bench: &mut Bench<'_>) -> Check {
    let span = bench.bits()?.up_to(16);
    for address in span.first..=span.last {
        for (value, state) in [(0xFF00, true), (0xFF00, true), (0, false)] {
            let mut wanted = bench.read_bits(span)?;
            let request = pdu(5, address, value);
            bench.reply_is(&request, &request)?;
            wanted[usize::from(address - span.first)] = state;
            let text = format!("coil {address:04X} is {state}, no other has changed");
            bench.bits_are(span, &wanted, text)?;
        }
    }
    Ok(())
}

fn value(bench: &mut Bench<'_>) -> Check {
    let span = bench.bits()?;
    let at = span.up_to(1);
    for state in [true, false] {
        bench.set_bits(span.first, &[state])?;
        for value in [0x0001, 0x00FF, 0x0100, 0x1234, 0xFE00, 0xFF01, 0xFFFF] {
            bench.exception(&pdu(5, span.first, value), 3)?;
            bench.bits_are(at, &[state], format!("the coil still is {state}"))?;
        }
    }
    Ok(())
}

fn address(bench: &mut Bench<'_>) -> Check {
    for address in bench.outside(1) {
        bench.exception(&pdu(5, address, 0xFF00), 2)?;
        bench.exception(&pdu(5, address, 0), 2)?;
    }
    Ok(())
}

fn value_first(bench: &mut Bench<'_>) -> Check {
    let nowhere = bench.target.nowhere(1).unwrap_or(0xFFFF);
    bench.exception(&pdu(5, nowhere, 0x1234), 3)
}

fn length(bench: &mut Bench<'_>) -> Check {
    let span = bench.bits()?.up_to(1);
    bench.set_bits(span.first, &[false])?;
    let request = pdu(5, span.first, 0xFF00);
    bench.wrong_lengths(&request, &[1])?;
    bench.is_off(span)
}

fn every_quantity(bench: &mut Bench<'_>) -> Check {
    let span = bench.bits()?;
    let longest = span.len().min(1968) as u16;
    for quantity in (1..=longest.min(17)).chain([longest]) {
        let here = span.up_to(quantity);
        for odd in [true, false] {
            let values: Vec<bool> = (0..quantity).map(|n| (n % 2 == 1) == odd).collect();
            let request = write_bits(span.first, &values, false);
            bench.reply_is(&request, &request[..5])?;
            bench.bits_are(here, &values, format!("the coils are {values:?}"))?;
        }
    }
    Ok(())
}

fn quantity_out_of_range(bench: &mut Bench<'_>) -> Check {
    let at = bench.target.bits.map_or(0, |span| span.first);
    bench.exception(&[pdu(0x0F, at, 0), vec![0]].concat(), 3)?;
    bench.exception(&[pdu(0x0F, at, 0), vec![1, 0]].concat(), 3)?;
    // 1969 coils need 247 bytes. Their frame has 256 bytes, which is still a valid length.
    for (quantity, bytes) in [(1969, 247_u8), (1976, 247), (2048, 0), (0xFFFF, 247)] {
        let data = vec![0; usize::from(bytes)];
        let request = [pdu(0x0F, at, quantity), vec![bytes], data].concat();
        bench.exception(&request, 3)?;
    }
    Ok(())
}

fn quantity_first(bench: &mut Bench<'_>) -> Check {
    let nowhere = bench.nowhere(1)?;
    for (quantity, count) in [(0, 0_u8), (0, 1), (1969, 247), (1, 0), (1, 2), (9, 1)] {
        let data = vec![0; usize::from(count)];
        let request = [pdu(0x0F, nowhere, quantity), vec![count], data].concat();
        bench.exception(&request, 3)?;
    }
    bench.exception(&write_bits(nowhere, &[false], false), 2)
}

fn quantity_most(bench: &mut Bench<'_>) -> Check {
    let span = bench.target.bits;
    if let Some(span) = span.filter(|span| span.len() >= 1968) {
        if !bench.target.has(1) {
            return skip("the coils cannot be read first");
        }
        // Write the values that the coils already have.
        let values = bench.read_bits(span.up_to(1968))?;
        let request = write_bits(span.first, &values, false);
        return bench.reply_is(&request, &request[..5]);
    }
    let at = span.map_or(0, |span| span.first);
    let request = [pdu(0x0F, at, 1968), vec![246], vec![0; 246]].concat();
    bench.exception(&request, 2)
}

fn byte_count(bench: &mut Bench<'_>) -> Check {
    let span = bench.bits()?.up_to(8);
    let quantity = span.len() as u16;
    bench.set_bits(span.first, &vec![false; usize::from(quantity)])?;
    for (count, bytes) in [(0_u8, 0), (0, 1), (2, 2), (3, 3), (255, 1), (246, 246)] {
        let head = [pdu(0x0F, span.first, quantity), vec![count]].concat();
        bench.exception_03_with(&head, &vec![0xFF; bytes])?;
    }
    bench.is_off(span)
}

fn data_length(bench: &mut Bench<'_>) -> Check {
    let span = bench.bits()?.up_to(8);
    let quantity = span.len() as u16;
    bench.set_bits(span.first, &vec![false; usize::from(quantity)])?;
    let request = write_bits(span.first, &vec![true; usize::from(quantity)], false);
    bench.wrong_lengths(&request, &[1, 2, 240])?;
    bench.is_off(span)
}

fn padding(bench: &mut Bench<'_>) -> Check {
    let span = bench.bits()?;
    let all = span.up_to(8);
    for quantity in 1..=all.len() as u16 {
        bench.set_bits(all.first, &vec![false; all.len() as usize])?;
        let request = write_bits(all.first, &vec![true; usize::from(quantity)], true);
        bench.reply_is(&request, &request[..5])?;
        let wanted: Vec<bool> = (0..all.len()).map(|n| n < u32::from(quantity)).collect();
        bench.bits_are(all, &wanted, format!("the coils are {wanted:?}"))?;
    }
    Ok(())
}

fn past_the_end(bench: &mut Bench<'_>) -> Check {
    let span = bench.bits()?;
    let readable = bench.target.readable(1).to_vec();
    // The run with these coils may have more coils after them.
    let Some(run) = readable.iter().find(|run| run.has(span.last)).copied() else {
        return bench.fail("the coils to write to can be read");
    };
    let Some(_) = run.last.checked_add(1) else {
        return bench.exception(&write_bits(0xFFFF, &[false; 2], false), 2);
    };
    let whole = run.len().min(1967) as u16;
    let first = run.last - (whole - 1);
    let before = bench.read_bits(run.up_to(2000))?;
    bench.exception(&write_bits(run.last, &[true; 2], false), 2)?;
    let too_many = vec![true; usize::from(whole) + 1];
    bench.exception(&write_bits(first, &too_many, false), 2)?;
    bench.exception(&write_bits(0xFFFF, &[true; 2], false), 2)?;
    bench.bits_are(run.up_to(2000), &before, "no coil has been written")
}
