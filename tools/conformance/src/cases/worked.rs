//! The worked frames of manuals, sent to the unit.

use crate::case::{Case, Check, Need, case, skip};
use crate::frame::{Reply, crc, rtu};
use crate::tester::Tester;
use crate::vectors::{Worked, frames};

const S: &str = "manuals, see docs/conformance.md";

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    case("worked/for-other-units", S, "worked frames for other units get silence", &[Need::Rtu], for_others),
    case("worked/for-this-unit", S,
        "worked requests for this unit get a reply or an exception, worked replies are no requests",
        &[Need::Rtu, Need::Modio], for_this),
    case("worked/requests-readdressed", S,
        "worked requests with this unit's address get a reply or an exception in good form",
        &[Need::Rtu, Need::Modio], readdressed),
    case("worked/errata", S, "worked frames whose CRC is wrong get silence, with this unit's address too",
        &[Need::Rtu], errata),
];

fn for_others(tester: &mut Tester<'_>) -> Check {
    let unit = tester.unit();
    for worked in frames().filter(|w| w.crc_ok() && w.bytes[0] != unit) {
        let why = format!("the frame is for unit {}", worked.bytes[0]);
        tester.silence_to(&worked.bytes, why)?;
        tester.alive(format!("{} {}", worked.source, worked.place))?;
    }
    Ok(())
}

/// Sends a worked frame to this unit. A write to a register that exists is left out, because it would change the
/// unit. On a modio these are writes to 0x0006 with analog points in port 2, which the modio-08 has.
fn send(tester: &mut Tester<'_>, worked: &Worked, frame: &[u8]) -> Check {
    let function = frame[1];
    if let [_, 6 | 0x10, high, low, ..] = *frame {
        let address = u16::from_be_bytes([high, low]);
        let readable = tester.target.readable(3);
        if worked.request && readable.iter().any(|span| span.has(address)) {
            return Ok(());
        }
    }
    let reply = if worked.request {
        tester.raw_due(frame)?
    } else {
        tester.raw(frame)?
    };
    let place = format!("{} {}", worked.source, worked.place);
    let right = match &reply {
        Reply::Silence => !worked.request,
        Reply::Wrong(..) => false,
        Reply::Pdu(pdu) => {
            let ordinary = pdu[0] == function && worked.request;
            ordinary || (pdu.len() == 2 && pdu[0] == function | 0x80)
        }
    };
    let wanted = format!("a reply or an exception in good form: {place}");
    tester.ensure(right, wanted)
}

fn for_this(tester: &mut Tester<'_>) -> Check {
    let unit = tester.unit();
    let mine: Vec<_> = frames()
        .filter(|w| w.crc_ok() && w.bytes[0] == unit)
        .collect();
    if mine.is_empty() {
        return skip(format!("no worked frame is for unit {unit}"));
    }
    for worked in mine {
        // The file has a request and its echo as one frame.
        send(tester, &worked, &worked.bytes)?;
    }
    tester.alive("the worked frames")
}

fn readdressed(tester: &mut Tester<'_>) -> Check {
    for worked in frames().filter(|worked| worked.request) {
        let body = &worked.bytes[1..worked.bytes.len() - 2];
        let frame = rtu(&[&[tester.unit()], body].concat());
        send(tester, &worked, &frame)?;
    }
    tester.alive("the worked requests")
}

fn errata(tester: &mut Tester<'_>) -> Check {
    for worked in frames().filter(|worked| !worked.crc_ok()) {
        let mut mine = worked.bytes.clone();
        mine[0] = tester.unit();
        // The printed CRC may be right for this unit's address.
        let (body, check) = mine.split_at(mine.len() - 2);
        let right = crc(body) == check;
        let frames = [worked.bytes.clone(), mine];
        for frame in frames.iter().take(if right { 1 } else { 2 }) {
            tester.silence_to(frame, "the CRC is wrong")?;
            tester.alive(format!("{} {}", worked.source, worked.place))?;
        }
    }
    Ok(())
}
