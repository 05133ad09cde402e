//! Addresses of frames: other units, reserved addresses, broadcasts.

use crate::case::{Case, Check, Need, case};
use crate::cases::line_counters::count;
use crate::points::{diagnose, pdu, write_bits, write_words};
use crate::tester::Tester;

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    case("address/other-units", "V1.02 2.2", "requests for other units get silence", &[], other_units),
    case("address/reserved", "V1.02 2.2", "addresses 248 to 255 get silence", &[], reserved),
    case("address/other-units-write", "V1.02 2.2", "writes to other units and reserved addresses do nothing here",
        &[Need::Bits, Need::Function(1)], other_units_write),
    case("address/other-units-write-words", "V1.02 2.2",
        "register writes to other units and reserved addresses do nothing here", &[Need::Words, Need::Function(3)],
        other_units_write_words),
    case("broadcast/coils", "V1.02 2.1", "a broadcast 05 or 0F is done, in silence", &[Need::Bits, Need::Function(1)],
        broadcast_bits),
    case("broadcast/registers", "V1.02 2.1", "a broadcast 06 or 10 is done, in silence",
        &[Need::Words, Need::Function(3)], broadcast_words),
    case("broadcast/read", "V1.02 2.1", "a broadcast read gets silence", &[], broadcast_read),
    case("broadcast/nonsense", "V1.02 2.1", "a broadcast that is refused gets silence and writes nothing", &[],
        nonsense),
    case("broadcast/restart", "V1.1b3 6.8, 08/01",
        "a broadcast 08/01 gets silence and restarts nothing: the counters go on", &[Need::Function(8)],
        broadcast_restart).interpretation(),
    case("broadcast/listen-only", "V1.1b3 6.8, 08/04", "a broadcast 08/04 puts no unit into listen-only mode",
        &[Need::Function(8)], broadcast_listen_only).interpretation(),
    case("broadcast/refused-writes-nothing", "V1.02 2.1", "a broadcast write that is partly wrong writes nothing",
        &[Need::Bits, Need::Function(1)], refused_writes),
];

/// Returns the addresses of other units: all of them where time is exact, elsewhere those that differ from this unit's
/// address in one bit, and 1, 2 and 247.
fn others(tester: &Tester<'_>) -> Vec<u8> {
    let unit = tester.unit();
    let all = tester.exact(true, false);
    let near = |address: u8| (address ^ unit).count_ones() == 1 || [1, 2, 247].contains(&address);
    let mut others: Vec<u8> = (1..=247).collect();
    others.retain(|address| *address != unit && (all || near(*address)));
    others
}

fn reserved_addresses(tester: &Tester<'_>) -> Vec<u8> {
    (248..=255).filter(|a| *a != tester.unit()).collect()
}

fn silent_to(tester: &mut Tester<'_>, unit: u8, pdu: &[u8]) -> Check {
    let why = format!("the frame is for address {unit}, not for {}", tester.unit());
    tester.silence_of(unit, pdu, why)
}

fn other_units(tester: &mut Tester<'_>) -> Check {
    let ping = tester.target.ping.clone();
    for unit in others(tester) {
        silent_to(tester, unit, &ping)?;
    }
    tester.alive("requests for all other units")
}

fn reserved(tester: &mut Tester<'_>) -> Check {
    let ping = tester.target.ping.clone();
    for unit in reserved_addresses(tester) {
        silent_to(tester, unit, &ping)?;
    }
    tester.alive("requests for reserved addresses")
}

fn few_others(tester: &Tester<'_>) -> Vec<u8> {
    let unit = tester.unit();
    let mut few = vec![unit ^ 1, unit ^ 2, tester.other(), 248, 254, 255];
    few.retain(|address| ![0, unit].contains(address));
    few
}

fn other_units_write(tester: &mut Tester<'_>) -> Check {
    let span = tester.bits()?.up_to(1);
    tester.set_bits(span.first, &[false])?;
    for unit in few_others(tester) {
        silent_to(tester, unit, &pdu(5, span.first, 0xFF00))?;
        silent_to(tester, unit, &write_bits(span.first, &[true], false))?;
        tester.is_off(span)?;
    }
    Ok(())
}

fn other_units_write_words(tester: &mut Tester<'_>) -> Check {
    let words = tester.words()?;
    let at = words.span.first;
    tester.set_words(at, &[words.low])?;
    for unit in few_others(tester) {
        silent_to(tester, unit, &pdu(6, at, words.high))?;
        silent_to(tester, unit, &write_words(at, &[words.high]))?;
        tester.word_is(at, words.low)?;
    }
    Ok(())
}

fn broadcast_bits(tester: &mut Tester<'_>) -> Check {
    let span = tester.bits()?.up_to(1);
    for state in [true, false, true] {
        let value = if state { 0xFF00 } else { 0 };
        for request in [
            pdu(5, span.first, value),
            write_bits(span.first, &[state], false),
        ] {
            if !tester.target.has(request[0]) {
                continue;
            }
            tester.set_bits(span.first, &[!state])?;
            silent_to(tester, 0, &request)?;
            let wanted = format!("the broadcast has made the coil {state}");
            tester.bits_are(span, &[state], wanted)?;
        }
    }
    Ok(())
}

fn broadcast_words(tester: &mut Tester<'_>) -> Check {
    let words = tester.words()?;
    let at = words.span.first;
    for value in [words.high, words.low] {
        for request in [
            pdu(6, at, value),
            write_words(at, &[value]),
            [pdu(0x16, at, 0), value.to_be_bytes().to_vec()].concat(),
        ] {
            if !tester.target.has(request[0]) {
                continue;
            }
            tester.set_words(at, &[words.other(value)])?;
            silent_to(tester, 0, &request)?;
            let wanted = format!("the broadcast has made the register {value:04X}");
            tester.words_are(words.span.up_to(1), &[value], wanted)?;
        }
    }
    Ok(())
}

fn broadcast_read(tester: &mut Tester<'_>) -> Check {
    for function in 1..=4 {
        let readable = tester.target.readable(function);
        let first = readable.first().map_or(0, |span| span.first);
        silent_to(tester, 0, &pdu(function, first, 1))?;
    }
    for request in [
        vec![7],
        vec![0x0B],
        vec![0x11],
        vec![8, 0, 0, 1, 2],
        vec![0x2B, 0x0E, 1, 0],
    ] {
        silent_to(tester, 0, &request)?;
    }
    tester.alive("broadcasts that only read")
}

fn nonsense(tester: &mut Tester<'_>) -> Check {
    for request in [
        vec![0x66],
        vec![0],
        vec![0x80],
        vec![0xFF, 1, 2],
        vec![3, 0, 0, 0, 0],
        vec![5, 0xFF, 0xFF, 0x12, 0x34],
        vec![0x0F, 0, 0, 0, 0, 0],
        vec![0x10, 0, 0, 0, 1, 3, 0, 0, 0],
    ] {
        silent_to(tester, 0, &request)?;
    }
    tester.alive("broadcasts that make no sense")
}

fn broadcast_restart(tester: &mut Tester<'_>) -> Check {
    tester.alive("the start of the case")?;
    for data in [[0, 0], [0xFF, 0]] {
        let before = count(tester, 0x0B)?;
        silent_to(tester, 0, &diagnose(1, &data))?;
        let wanted = before.wrapping_add(2);
        let text = format!("counter 0B goes on to {wanted}, with the broadcast and this request");
        let after = count(tester, 0x0B)?;
        tester.ensure(after == wanted, text)?;
    }
    Ok(())
}

fn broadcast_listen_only(tester: &mut Tester<'_>) -> Check {
    let entered = silent_to(tester, 0, &diagnose(4, &[0, 0])).and_then(|()| {
        tester.alive("a broadcast 08/04: the mode is for the unit that is addressed")
    });
    if entered.is_err() {
        // End the mode, so that later cases are not affected.
        tester.ask(&diagnose(1, &[0, 0]))?;
    }
    entered
}

fn refused_writes(tester: &mut Tester<'_>) -> Check {
    let span = tester.bits()?.up_to(1);
    tester.set_bits(span.first, &[false])?;
    let mut wrong = write_bits(span.first, &[true], false);
    wrong[5] = 2;
    for request in [
        pdu(5, span.first, 0x1234),
        wrong,
        write_bits(span.first, &[true; 1968], true),
    ] {
        let beyond = request.len() > 200;
        if beyond && tester.bits()?.len() >= 1968 {
            continue;
        }
        silent_to(tester, 0, &request)?;
        tester.is_off(span)?;
    }
    Ok(())
}
