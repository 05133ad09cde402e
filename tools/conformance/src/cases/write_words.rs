//! Writing registers: functions 06 and 10.

use crate::case::{Case, Check, Need, case, skip};
use crate::points::{pdu, write_words};
use crate::target::Span;
use crate::tester::Tester;

const W06: &[Need] = &[Need::Function(6), Need::Function(3), Need::Words];
const W10: &[Need] = &[Need::Function(0x10), Need::Function(3), Need::Words];

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    case("fc06/echo", "V1.1b3 6.6", "a value is written and echoed, and no other register changes", W06, echo),
    case("fc06/refused-value", "V1.1b3 6.6", "a value out of range is exception 03 and the register stays", W06,
        refused),
    case("fc06/address", "V1.1b3 6.6", "a register that is not there is exception 02", &[Need::Function(6)], address),
    case("fc06/address-before-value", "V1.1b3 6.6", "a value out of range at a bad address is exception 02, not 03",
        &[Need::Function(6), Need::Words], address_first).interpretation(),
    case("fc06/length", "V1.1b3 6.6", "a request a byte short or long is 03 or silence, and the register stays", W06,
        length).interpretation(),
    case("fc10/every-quantity", "V1.1b3 6.12", "every quantity is written, and echoed with address and quantity", W10,
        every_quantity),
    case("fc10/quantity-0-and-124", "V1.1b3 6.12", "quantities of 0 and above 123 are exception 03",
        &[Need::Function(0x10)], quantity_out_of_range),
    case("fc10/quantity-123", "V1.1b3 6.12", "123 registers fit a frame: written, or 02 where there are not so many",
        &[Need::Function(0x10)], quantity_most),
    case("fc10/quantity-before-address", "V1.1b3 6.12",
        "a bad quantity or byte count at a bad address is exception 03, not 02", &[Need::Function(0x10)],
        quantity_first),
    case("fc10/address-before-value", "V1.1b3 6.12",
        "a value out of range in a range that is not there, or partly, is exception 02, not 03",
        &[Need::Function(0x10), Need::Function(3), Need::Words], range_first).interpretation(),
    case("fc10/byte-count", "V1.1b3 6.12",
        "a byte count that is not twice the quantity, odd or 255, is exception 03 and writes nothing", W10,
        byte_count),
    case("fc10/data-length", "V1.1b3 6.12",
        "data cut short or with bytes to spare is 03 or silence and writes nothing", W10,
        data_length).interpretation(),
    case("fc10/partly-out-of-range", "V1.1b3 6.12",
        "a range that is partly not there is exception 02 and writes nothing", W10, partly_out),
    case("fc10/one-bad-value", "V1.1b3 6.12", "one value out of range refuses all of them", W10,
        one_bad_value).interpretation(),
];

fn echo(tester: &mut Tester<'_>) -> Check {
    let words = tester.words()?;
    let span = words.span.up_to(16);
    for address in span.first..=span.last {
        for value in [words.low, words.high, words.low] {
            let mut wanted = tester.read_words(span)?;
            let request = pdu(6, address, value);
            tester.reply_is(&request, &request)?;
            wanted[usize::from(address - span.first)] = value;
            let text = format!("register {address:04X} is {value:04X}, no other has changed");
            tester.words_are(span, &wanted, text)?;
        }
    }
    Ok(())
}

fn refused(tester: &mut Tester<'_>) -> Check {
    let words = tester.words()?;
    let value = tester.refused_value()?;
    tester.set_words(words.span.first, &[words.low])?;
    tester.exception(&pdu(6, words.span.first, value), 3)?;
    tester.word_is(words.span.first, words.low)
}

fn address(tester: &mut Tester<'_>) -> Check {
    for address in tester.outside(3) {
        tester.exception(&pdu(6, address, 0), 2)?;
    }
    Ok(())
}

fn length(tester: &mut Tester<'_>) -> Check {
    let words = tester.words()?;
    tester.set_words(words.span.first, &[words.low])?;
    let request = pdu(6, words.span.first, words.high);
    tester.wrong_lengths(&request, &[1])?;
    tester.word_is(words.span.first, words.low)
}

fn every_quantity(tester: &mut Tester<'_>) -> Check {
    let words = tester.words()?;
    let longest = words.span.len().min(123) as u16;
    for quantity in (1..=longest.min(9)).chain([longest]) {
        let here = words.span.up_to(quantity);
        for odd in [0, 1] {
            let values: Vec<u16> = (0..quantity)
                .map(|n| if n % 2 == odd { words.low } else { words.high })
                .collect();
            let request = write_words(here.first, &values);
            tester.reply_is(&request, &request[..5])?;
            tester.words_are(here, &values, format!("the registers are {values:04X?}"))?;
        }
    }
    Ok(())
}

fn quantity_out_of_range(tester: &mut Tester<'_>) -> Check {
    let at = tester.target.words.map_or(0, |words| words.span.first);
    tester.exception(&[pdu(0x10, at, 0), vec![0]].concat(), 3)?;
    tester.exception(&[pdu(0x10, at, 0), vec![2, 0, 1]].concat(), 3)?;
    // The frame of 124 registers would have 257 bytes, so the last data bytes are left out.
    for (quantity, count) in [
        (124, 246),
        (124, 248_u8),
        (125, 250),
        (128, 0),
        (0x8001, 2),
        (0xFFFF, 254),
    ] {
        let head = [pdu(0x10, at, quantity), vec![count]].concat();
        tester.exception_03_with(&head, &vec![0; usize::from(count.min(246))])?;
    }
    Ok(())
}

/// Returns the 123 registers that a case may write to, if the unit has that many. The case must restore their values.
pub(super) fn wide(tester: &mut Tester<'_>) -> Check<Option<Span>> {
    let config =
        tester.target.modio.is_some() && tester.target.allow_config && tester.target.has(3);
    if config {
        tester.unlock()?;
        return Ok(Some(Span::of(register_map::configuration::BETA, 123)));
    }
    let known = tester.target.words.map(|words| words.span);
    Ok(known.filter(|span| span.len() >= 123))
}

fn quantity_first(tester: &mut Tester<'_>) -> Check {
    let nowhere = tester.nowhere(3)?;
    for (quantity, count) in [(0, 0), (124, 246), (1, 0), (1, 1), (1, 4)] {
        let data = vec![0; usize::from(count)];
        let request = [pdu(0x10, nowhere, quantity), vec![count], data].concat();
        tester.exception(&request, 3)?;
    }
    tester.exception(&write_words(nowhere, &[0]), 2)
}

fn address_first(tester: &mut Tester<'_>) -> Check {
    let bad = tester.refused_value()?;
    let nowhere = tester.nowhere(3)?;
    tester.exception(&pdu(6, nowhere, bad), 2)
}

fn range_first(tester: &mut Tester<'_>) -> Check {
    let bad = tester.refused_value()?;
    let words = tester.words()?;
    let nowhere = tester.nowhere(3)?;
    tester.exception(&write_words(nowhere, &[bad]), 2)?;
    let last = words.span.last;
    let next = last.checked_add(1);
    let there = |address: u16| tester.target.readable(3).iter().any(|run| run.has(address));
    if next.is_none_or(there) {
        return Ok(());
    }
    let before = tester.read_word(last)?;
    tester.exception(&write_words(last, &[bad, words.low]), 2)?;
    tester.word_is(last, before)
}

fn quantity_most(tester: &mut Tester<'_>) -> Check {
    if let Some(span) = wide(tester)? {
        let values = tester.read_words(span)?;
        let request = write_words(span.first, &values);
        tester.reply_is(&request, &request[..5])?;
        let wanted = "the registers have the values that were written";
        return tester.words_are(span, &values, wanted);
    }
    // A range that ends at an address that does not exist.
    let nowhere = tester.nowhere(3)?;
    let first = nowhere.saturating_sub(122);
    tester.exception(&write_words(first, &[0; 123]), 2)
}

fn unchanged(tester: &mut Tester<'_>, at: u16, value: u16, count: usize) -> Check {
    let wanted = format!("every register still is {value:04X}");
    tester.words_are(Span::of(at, count as u16), &vec![value; count], wanted)
}

fn byte_count(tester: &mut Tester<'_>) -> Check {
    let words = tester.words()?;
    let span = words.span.up_to(4);
    let (at, quantity) = (span.first, span.len() as u16);
    tester.set_words(at, &vec![words.low; usize::from(quantity)])?;
    let right = (quantity * 2) as u8;
    for count in [0, 1, right - 1, right + 1, right + 2, 246, 255] {
        let high = words.high.to_be_bytes().repeat(128);
        let head = [pdu(0x10, at, quantity), vec![count]].concat();
        tester.exception_03_with(&head, &high[..usize::from(count).min(246)])?;
    }
    unchanged(tester, at, words.low, usize::from(quantity))
}

fn data_length(tester: &mut Tester<'_>) -> Check {
    let words = tester.words()?;
    let span = words.span.up_to(3);
    let count = span.len() as usize;
    tester.set_words(span.first, &vec![words.low; count])?;
    let request = write_words(span.first, &vec![words.high; count]);
    tester.wrong_lengths(&request, &[1, 2, 100])?;
    unchanged(tester, span.first, words.low, count)
}

fn partly_out(tester: &mut Tester<'_>) -> Check {
    let words = tester.words()?;
    let readable = tester.target.readable(3).to_vec();
    let Some(run) = readable.iter().find(|run| run.has(words.span.last)) else {
        return tester.fail("the registers to write to can be read");
    };
    // The last registers of the run, and the address after them, which does not exist.
    for count in 1..=run.len().min(8) as u16 {
        let tail = Span::of(run.last - (count - 1), count);
        let before = tester.read_words(tail)?;
        let mut values: Vec<u16> = before.iter().map(|word| words.other(*word)).collect();
        values.push(words.low);
        tester.exception(&write_words(tail.first, &values), 2)?;
        let wanted = format!("the registers still are {before:04X?}");
        let stands = tester.words_are(tail, &before, wanted);
        if stands.is_err() {
            tester.set_words(tail.first, &before)?;
        }
        stands?;
    }
    tester.exception(&write_words(0xFFFF, &[words.high; 2]), 2)
}

fn one_bad_value(tester: &mut Tester<'_>) -> Check {
    let words = tester.words()?;
    let (Some(bad), count @ 2..) = (words.refused, words.span.up_to(4).len() as usize) else {
        return skip("no value is known that is refused, or one register alone");
    };
    let at = words.span.first;
    tester.set_words(at, &vec![words.low; count])?;
    for place in 0..count {
        let mut values = vec![words.high; count];
        values[place] = bad;
        tester.exception(&write_words(at, &values), 3)?;
        unchanged(tester, at, words.low, count)?;
    }
    Ok(())
}
