//! Mask write, 16, and read/write multiple registers, 17.

use crate::bench::Bench;
use crate::case::{Case, Check, Need, case, skip};
use crate::points::{pdu, words_of};
use crate::target::Span;

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

fn formula(bench: &mut Bench<'_>) -> Check {
    let words = bench.words()?;
    let at = words.span.first;
    for (from, to) in [(words.low, words.high), (words.high, words.low)] {
        // Three pairs of masks that change one accepted value to another.
        let masks = [(0, to), (from & to, to), (!(from ^ to), to)];
        for (and, or) in masks {
            bench.set_words(at, &[from])?;
            let request = mask(at, and, or);
            bench.reply_is(&request, &request)?;
            let wanted = (from & and) | (or & !and);
            let text = format!("{from:04X} with AND {and:04X}, OR {or:04X} becomes {wanted:04X}");
            bench.words_are(Span::one(at), &[wanted], text)?;
        }
        bench.set_words(at, &[from])?;
        let keep = mask(at, 0xFFFF, 0xFFFF);
        bench.reply_is(&keep, &keep)?;
        let text = format!("AND FFFF keeps {from:04X}, whatever OR is");
        bench.words_are(Span::one(at), &[from], text)?;
    }
    Ok(())
}

fn mask_refused(bench: &mut Bench<'_>) -> Check {
    let words = bench.words()?;
    let bad = bench.refused_value()?;
    let at = words.span.first;
    bench.set_words(at, &[words.low])?;
    bench.exception(&mask(at, 0, bad), 3)?;
    bench.word_is(at, words.low)
}

fn mask_address(bench: &mut Bench<'_>) -> Check {
    let nowhere = bench.nowhere(3)?;
    bench.exception(&mask(nowhere, 0xFFFF, 0), 2)
}

fn mask_length(bench: &mut Bench<'_>) -> Check {
    let words = bench.words()?;
    let at = words.span.first;
    bench.set_words(at, &[words.low])?;
    let request = mask(at, 0, words.high);
    bench.wrong_lengths(&request, &[1])?;
    bench.word_is(at, words.low)
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

fn write_first(bench: &mut Bench<'_>) -> Check {
    let words = bench.words()?;
    let longest = words.span.len().min(121) as u16;
    for quantity in (1..=longest.min(4)).chain([longest]) {
        let span = words.span.up_to(quantity);
        for value in [words.high, words.low] {
            let values = vec![value; usize::from(quantity)];
            let reply = bench.reply(&both(span, span.first, &values))?;
            bench.ensure(
                usize::from(reply[1]) == values.len() * 2 && words_of(&reply) == values,
                format!("the values that were written: {values:04X?}"),
            )?;
        }
    }
    Ok(())
}

fn two_places(bench: &mut Bench<'_>) -> Check {
    let words = bench.words()?;
    if words.span.len() < 2 {
        return skip("one register alone");
    }
    let (first, second) = (words.span.first, words.span.first + 1);
    bench.set_words(first, &[words.low, words.low])?;
    let reply = bench.reply(&both(Span::one(first), second, &[words.high]))?;
    let same = words_of(&reply) == [words.low];
    bench.ensure(same, "the value of the first register from before")?;
    let wanted = "only the second register is written";
    bench.words_are(words.span.up_to(2), &[words.low, words.high], wanted)
}

fn quantities(bench: &mut Bench<'_>) -> Check {
    let read = bench.target.longest(3).map_or(0, |span| span.first);
    let words = bench.words()?;
    let write = words.span.first;
    bench.set_words(write, &[words.low])?;
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
        bench.exception_03_with(&head, &data)?;
    }
    still_low(bench)
}

fn quantities_most(bench: &mut Bench<'_>) -> Check {
    let wide = super::write_words::wide(bench)?;
    let run = bench.target.longest(3).filter(|run| run.len() >= 125);
    let (Some(wide), Some(run)) = (wide.filter(|_| bench.target.has(3)), run) else {
        let nowhere = bench.nowhere(3)?;
        let read = Span::of(nowhere.saturating_sub(124), 125);
        return bench.exception(&both(read, read.first, &[0; 121]), 2);
    };
    // Write the values that the registers already have.
    let values = bench.read_words(wide.up_to(121))?;
    let reply = bench.reply(&both(run.up_to(125), wide.first, &values))?;
    let must = "250 data bytes and the byte count 250";
    bench.ensure(reply.len() == 252 && reply[1] == 250, must)?;
    let wanted = "the registers hold what was written";
    bench.words_are(wide.up_to(121), &values, wanted)
}

fn quantity_first(bench: &mut Bench<'_>) -> Check {
    let nowhere = bench.nowhere(3)?;
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
        let right = bench.ask_due(&request)?.exception(0x17) == Some(3);
        bench.ensure(right, format!("exception 03 to function 17: {wrong}"))?;
    }
    bench.exception(&good, 2)
}

fn still_low(bench: &mut Bench<'_>) -> Check {
    let words = bench.words()?;
    bench.word_is(words.span.first, words.low)
}

fn byte_count(bench: &mut Bench<'_>) -> Check {
    let words = bench.words()?;
    let one = words.span.up_to(1);
    bench.set_words(one.first, &[words.low])?;
    let good = both(one, one.first, &[words.high]);
    for count in [0_u8, 1, 3, 4, 255] {
        let head = [&good[..9], &[count]].concat();
        bench.exception_03_with(&head, &vec![1; usize::from(count).min(240)])?;
    }
    still_low(bench)
}

fn truncated(bench: &mut Bench<'_>) -> Check {
    let words = bench.words()?;
    let one = words.span.up_to(1);
    bench.set_words(one.first, &[words.low])?;
    let request = both(one, one.first, &[words.high]);
    bench.wrong_lengths(&request, &[1])?;
    still_low(bench)
}

fn address(bench: &mut Bench<'_>) -> Check {
    let words = bench.words()?;
    let nowhere = bench.nowhere(3)?;
    let one = words.span.up_to(1);
    let out = Span::one(nowhere);
    bench.set_words(one.first, &[words.low])?;
    bench.exception(&both(out, one.first, &[words.high]), 2)?;
    bench.exception(&both(one, nowhere, &[words.high]), 2)?;
    still_low(bench)
}
