//! Mask write, 16, and read/write multiple registers, 17.

use crate::case::{Case, Check, Need, case, skip};
use crate::points::{pdu, words_of};
use crate::target::Span;
use crate::tester::Tester;

const W16: &[Need] = &[Need::Function(0x16), Need::Function(3), Need::Words];
const W17: &[Need] = &[Need::Function(0x17), Need::Function(3), Need::Words];

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    case("fc16/formula", "V1.1b3 6.16",
        "the register becomes (current AND and) OR (or AND NOT and), and the request is echoed", W16, formula),
    case("fc16/refused-value", "V1.1b3 6.16", "a result out of range is exception 03 and the register stays", W16,
        mask_refused),
    case("fc16/address", "V1.1b3 6.16", "a register that is not there is exception 02", &[Need::Function(0x16)],
        mask_address),
    case("fc16/length", "V1.1b3 6.16", "a request of another length is 03 or silence, and the register stays", W16,
        mask_length).interpretation(),
    case("fc17/write-before-read", "V1.1b3 6.17", "what is written is what is read in the same request", W17,
        write_first),
    case("fc17/two-places", "V1.1b3 6.17", "reading and writing may be at different places", W17, two_places),
    case("fc17/quantities", "V1.1b3 6.17",
        "reading 0 or more than 125, writing 0 or more than 121 is exception 03 and writes nothing",
        &[Need::Function(0x17), Need::Words], quantities),
    case("fc17/quantities-most", "V1.1b3 6.17",
        "reading 125 and writing 121 registers fits a frame: done, or 02 where there are not so many",
        &[Need::Function(0x17)], quantities_most),
    case("fc17/quantity-before-address", "V1.1b3 6.17",
        "a bad quantity or byte count at bad addresses is exception 03, not 02", &[Need::Function(0x17)],
        quantity_first),
    case("fc17/byte-count", "V1.1b3 6.17",
        "a byte count that is not twice the quantity is exception 03 and writes nothing", W17, byte_count),
    case("fc17/truncated", "V1.1b3 6.17",
        "a request cut short or too long is 03 or silence, never a success, and writes nothing", W17,
        truncated).interpretation(),
    case("fc17/address", "V1.1b3 6.17", "a bad address to read or to write is exception 02 and writes nothing", W17,
        address),
];

fn mask(address: u16, and: u16, or: u16) -> Vec<u8> {
    [pdu(0x16, address, and), or.to_be_bytes().to_vec()].concat()
}

fn formula(tester: &mut Tester<'_>) -> Check {
    let words = tester.words()?;
    let at = words.span.first;
    for (from, to) in [(words.low, words.high), (words.high, words.low)] {
        // Three pairs of masks that change one accepted value to another.
        let masks = [(0, to), (from & to, to), (!(from ^ to), to)];
        for (and, or) in masks {
            tester.set_words(at, &[from])?;
            let request = mask(at, and, or);
            tester.reply_is(&request, &request)?;
            let wanted = (from & and) | (or & !and);
            let text = format!("{from:04X} with AND {and:04X}, OR {or:04X} becomes {wanted:04X}");
            tester.words_are(Span::one(at), &[wanted], text)?;
        }
        tester.set_words(at, &[from])?;
        let keep = mask(at, 0xFFFF, 0xFFFF);
        tester.reply_is(&keep, &keep)?;
        let text = format!("AND FFFF keeps {from:04X}, whatever OR is");
        tester.words_are(Span::one(at), &[from], text)?;
    }
    Ok(())
}

fn mask_refused(tester: &mut Tester<'_>) -> Check {
    let words = tester.words()?;
    let bad = tester.refused_value()?;
    let at = words.span.first;
    tester.set_words(at, &[words.low])?;
    tester.exception(&mask(at, 0, bad), 3)?;
    tester.word_is(at, words.low)
}

fn mask_address(tester: &mut Tester<'_>) -> Check {
    let nowhere = tester.nowhere(3)?;
    tester.exception(&mask(nowhere, 0xFFFF, 0), 2)
}

fn mask_length(tester: &mut Tester<'_>) -> Check {
    let words = tester.words()?;
    let at = words.span.first;
    tester.set_words(at, &[words.low])?;
    let request = mask(at, 0, words.high);
    tester.wrong_lengths(&request, &[1])?;
    tester.word_is(at, words.low)
}

/// Returns a request of function 17 that reads a span and writes values.
fn both(read: Span, write: u16, values: &[u16]) -> Vec<u8> {
    let mut request = pdu(0x17, read.first, read.len() as u16);
    request.extend(write.to_be_bytes());
    request.extend((values.len() as u16).to_be_bytes());
    request.push((values.len() * 2) as u8);
    request.extend(values.iter().flat_map(|value| value.to_be_bytes()));
    request
}

fn write_first(tester: &mut Tester<'_>) -> Check {
    let words = tester.words()?;
    let longest = words.span.len().min(121) as u16;
    for quantity in (1..=longest.min(4)).chain([longest]) {
        let span = words.span.up_to(quantity);
        for value in [words.high, words.low] {
            let values = vec![value; usize::from(quantity)];
            let reply = tester.reply(&both(span, span.first, &values))?;
            tester.ensure(
                usize::from(reply[1]) == values.len() * 2 && words_of(&reply) == values,
                format!("the values that were written: {values:04X?}"),
            )?;
        }
    }
    Ok(())
}

fn two_places(tester: &mut Tester<'_>) -> Check {
    let words = tester.words()?;
    if words.span.len() < 2 {
        return skip("one register alone");
    }
    let (first, second) = (words.span.first, words.span.first + 1);
    tester.set_words(first, &[words.low, words.low])?;
    let reply = tester.reply(&both(Span::one(first), second, &[words.high]))?;
    let same = words_of(&reply) == [words.low];
    tester.ensure(same, "the value of the first register from before")?;
    let wanted = "only the second register is written";
    tester.words_are(words.span.up_to(2), &[words.low, words.high], wanted)
}

fn quantities(tester: &mut Tester<'_>) -> Check {
    let read = tester.target.longest(3).map_or(0, |span| span.first);
    let words = tester.words()?;
    let write = words.span.first;
    tester.set_words(write, &[words.low])?;
    for (reads, writes, bytes) in [
        (0, 1_u16, 2),
        (126, 1, 2),
        (0xFFFF, 1, 2),
        (1, 0, 0),
        (1, 122, 242),
        // The frame of 122 registers would have 257 bytes, so the last data bytes are left out.
        (1, 122, 244),
        (1, 0x8001, 2),
    ] {
        let middle = [write.to_be_bytes(), writes.to_be_bytes()].concat();
        let head = [pdu(0x17, read, reads), middle, vec![bytes]].concat();
        let data = words.high.to_be_bytes().into_iter().cycle();
        let data: Vec<u8> = data.take(usize::from(bytes).min(242)).collect();
        tester.exception_03_with(&head, &data)?;
    }
    still_low(tester)
}

fn quantities_most(tester: &mut Tester<'_>) -> Check {
    let wide = super::write_words::wide(tester)?;
    let run = tester.target.longest(3).filter(|run| run.len() >= 125);
    let (Some(wide), Some(run)) = (wide.filter(|_| tester.target.has(3)), run) else {
        let nowhere = tester.nowhere(3)?;
        let read = Span::of(nowhere.saturating_sub(124), 125);
        return tester.exception(&both(read, read.first, &[0; 121]), 2);
    };
    // Write the values that the registers already have.
    let values = tester.read_words(wide.up_to(121))?;
    let reply = tester.reply(&both(run.up_to(125), wide.first, &values))?;
    let must = "250 data bytes and the byte count 250";
    tester.ensure(reply.len() == 252 && reply[1] == 250, must)?;
    let wanted = "the registers hold what was written";
    tester.words_are(wide.up_to(121), &values, wanted)
}

fn quantity_first(tester: &mut Tester<'_>) -> Check {
    let nowhere = tester.nowhere(3)?;
    let good = both(Span::one(nowhere), nowhere, &[0]);
    for (at, byte, wrong) in [
        (4, 0, "it reads 0 registers"),
        (4, 126, "it reads 126 registers"),
        (8, 0, "it writes 0 registers"),
        (8, 122, "it writes 122 registers"),
        (8, 2, "its byte count is 2 for 2 registers"),
    ] {
        let mut request = good.clone();
        request[at] = byte;
        let right = tester.ask_due(&request)?.exception(0x17) == Some(3);
        tester.ensure(right, format!("exception 03 to function 17: {wrong}"))?;
    }
    tester.exception(&good, 2)
}

fn still_low(tester: &mut Tester<'_>) -> Check {
    let words = tester.words()?;
    tester.word_is(words.span.first, words.low)
}

fn byte_count(tester: &mut Tester<'_>) -> Check {
    let words = tester.words()?;
    let one = words.span.up_to(1);
    tester.set_words(one.first, &[words.low])?;
    let good = both(one, one.first, &[words.high]);
    for count in [0_u8, 1, 3, 4, 255] {
        let head = [&good[..9], &[count]].concat();
        tester.exception_03_with(&head, &vec![1; usize::from(count).min(240)])?;
    }
    still_low(tester)
}

fn truncated(tester: &mut Tester<'_>) -> Check {
    let words = tester.words()?;
    let one = words.span.up_to(1);
    tester.set_words(one.first, &[words.low])?;
    let request = both(one, one.first, &[words.high]);
    tester.wrong_lengths(&request, &[1])?;
    still_low(tester)
}

fn address(tester: &mut Tester<'_>) -> Check {
    let words = tester.words()?;
    let nowhere = tester.nowhere(3)?;
    let one = words.span.up_to(1);
    let out = Span::one(nowhere);
    tester.set_words(one.first, &[words.low])?;
    tester.exception(&both(out, one.first, &[words.high]), 2)?;
    tester.exception(&both(one, nowhere, &[words.high]), 2)?;
    still_low(tester)
}
