//! Reading bits and words: functions 01 to 04.

use crate::case::{Case, Check, Need, case};
use crate::points::pdu;
use crate::tester::Tester;

/// Returns the largest quantity of one request (V1.1b3, 6.1 to 6.4).
const fn most(function: u8) -> u16 {
    if function <= 2 { 2000 } else { 125 }
}

fn data_bytes(function: u8, quantity: u16) -> usize {
    if function <= 2 {
        usize::from(quantity).div_ceil(8)
    } else {
        usize::from(quantity) * 2
    }
}

#[rustfmt::skip]
macro_rules! reading {
    ($f:literal, $name:literal, $section:literal) => { [
        case(concat!($name, "/quantity-0"), $section, "a quantity of 0 is exception 03", &[Need::Function($f)],
            quantity_0::<$f>),
        case(concat!($name, "/quantity-above-most"), $section,
            "a quantity above 2000 bits or 125 words is exception 03, up to FFFF", &[Need::Function($f)],
            quantity_above::<$f>),
        case(concat!($name, "/quantity-most"), $section,
            "2000 bits or 125 words are in range: 250 data bytes, or 02 where there are not so many",
            &[Need::Function($f)], quantity_most::<$f>),
        case(concat!($name, "/byte-count"), $section,
            "every quantity gives its number of bytes, the bits beyond it zero",
            &[Need::Function($f), Need::Readable($f)], byte_count::<$f>),
        case(concat!($name, "/one-past-the-end"), $section,
            "a range that reaches one address past the end of a run is exception 02",
            &[Need::Function($f), Need::Readable($f)], one_past::<$f>),
        case(concat!($name, "/no-wrap"), $section,
            "address FFFF with quantity 2 is exception 02: addresses do not wrap", &[Need::Function($f)],
            no_wrap::<$f>),
        case(concat!($name, "/quantity-before-address"), $section,
            "a bad quantity at a bad address is exception 03, not 02", &[Need::Function($f)], quantity_first::<$f>),
        case(concat!($name, "/length"), $section,
            "a request a byte short or long under a good check is 03 or silence, never data",
            &[Need::Function($f), Need::Readable($f)], length::<$f>).interpretation(),
    ] };
}

pub(super) const FC01: &[Case] = &reading!(1, "fc01", "V1.1b3 6.1");
pub(super) const FC02: &[Case] = &reading!(2, "fc02", "V1.1b3 6.2");
pub(super) const FC03: &[Case] = &reading!(3, "fc03", "V1.1b3 6.3");
pub(super) const FC04: &[Case] = &reading!(4, "fc04", "V1.1b3 6.4");

#[rustfmt::skip]
pub(super) const ALIKE: &[Case] = &[
    case("fc02/same-as-01", "map, access rules", "every bit point reads through 01 and 02 alike",
        &[Need::Modio, Need::Function(1), Need::Function(2), Need::Readable(1)], alike::<1, 2>),
    case("fc04/same-as-03", "map, access rules", "every word point reads through 03 and 04 alike",
        &[Need::Modio, Need::Function(3), Need::Function(4)], alike::<3, 4>),
];

/// Returns the first readable address, or 0.
fn somewhere(tester: &Tester<'_>, function: u8) -> u16 {
    let first = tester.target.readable(function).first();
    first.map_or(0, |span| span.first)
}

fn quantity_0<const F: u8>(tester: &mut Tester<'_>) -> Check {
    tester.exception(&pdu(F, somewhere(tester, F), 0), 3)
}

fn quantity_above<const F: u8>(tester: &mut Tester<'_>) -> Check {
    let at = somewhere(tester, F);
    for quantity in [most(F) + 1, most(F) + 2, 0x0800, 0x8000, 0xFFFF] {
        tester.exception(&pdu(F, at, quantity), 3)?;
    }
    Ok(())
}

fn quantity_most<const F: u8>(tester: &mut Tester<'_>) -> Check {
    let quantity = most(F);
    let span = tester.target.longest(F);
    let request = pdu(F, span.map_or(0, |span| span.first), quantity);
    if span.is_some_and(|span| span.len() >= u32::from(quantity)) {
        let reply = tester.reply(&request)?;
        let wanted = "250 data bytes and the byte count 250";
        return tester.ensure(reply.len() == 252 && reply[1] == 250, wanted);
    }
    tester.exception(&request, 2)
}

fn byte_count<const F: u8>(tester: &mut Tester<'_>) -> Check {
    let span = tester.readable(F)?;
    let longest = span.len().min(u32::from(most(F))) as u16;
    // The short quantities, whose padding differs, and the longest.
    for quantity in (1..=longest.min(17)).chain([longest]) {
        let reply = tester.reply(&pdu(F, span.first, quantity))?;
        let bytes = data_bytes(F, quantity);
        tester.ensure(
            reply.len() == 2 + bytes && usize::from(reply[1]) == bytes,
            format!("{bytes} data bytes and their count"),
        )?;
        if F <= 2 && quantity % 8 != 0 {
            let unused = reply[1 + bytes] >> (quantity % 8);
            tester.ensure(unused == 0, "unused high bits of the last byte are zero")?;
        }
    }
    Ok(())
}

fn one_past<const F: u8>(tester: &mut Tester<'_>) -> Check {
    for span in tester.target.readable(F).to_vec() {
        let Some(beyond) = span.last.checked_add(1) else {
            continue;
        };
        tester.exception(&pdu(F, span.last, 2), 2)?;
        let whole = span.len().min(u32::from(most(F)) - 1) as u16;
        tester.exception(&pdu(F, span.last - (whole - 1), whole + 1), 2)?;
        let elsewhere = tester.target.readable(F).iter().any(|s| s.has(beyond));
        if !elsewhere {
            tester.exception(&pdu(F, beyond, 1), 2)?;
        }
        if let Some(before) = span.first.checked_sub(1) {
            tester.exception(&pdu(F, before, 2), 2)?;
        }
    }
    Ok(())
}

fn no_wrap<const F: u8>(tester: &mut Tester<'_>) -> Check {
    tester.exception(&pdu(F, 0xFFFF, 2), 2)?;
    tester.exception(&pdu(F, 0xFFF0, most(F)), 2)
}

fn quantity_first<const F: u8>(tester: &mut Tester<'_>) -> Check {
    let nowhere = tester.nowhere(F)?;
    tester.exception(&pdu(F, nowhere, 0), 3)?;
    tester.exception(&pdu(F, nowhere, most(F) + 1), 3)?;
    tester.exception(&pdu(F, nowhere, 1), 2)
}

fn length<const F: u8>(tester: &mut Tester<'_>) -> Check {
    let request = pdu(F, tester.readable(F)?.first, 1);
    tester.wrong_lengths(&request, &[1, 2])
}

fn alike<const A: u8, const B: u8>(tester: &mut Tester<'_>) -> Check {
    for span in tester.target.readable(A).to_vec() {
        let quantity = span.len().min(u32::from(most(A))) as u16;
        let before = tester.reply(&pdu(A, span.first, quantity))?;
        let other = tester.reply(&pdu(B, span.first, quantity))?;
        let wanted = format!("as long as by function {A:02X}");
        tester.ensure(other.len() == before.len(), wanted)?;
        // Inputs and counters may change between the reads. Compare only the bytes that did not change.
        let after = tester.reply(&pdu(A, span.first, quantity))?;
        for at in (1..before.len()).filter(|at| before[*at] == after[*at]) {
            tester.ensure(
                other[at] == before[at],
                format!(
                    "{:02X} in byte {at} by function {B:02X}, as by {A:02X}, not {:02X}",
                    before[at], other[at]
                ),
            )?;
        }
    }
    Ok(())
}
