//! Fast Modbus, function 70: an extension of Modbus that some units have.

use modbus_line::fast::{
    ADDRESS, FUNCTION, Packet, Priority, Reply, Request, Setting, are_on, kind, settings,
};

use crate::case::{Case, Check, Need, case, skip};
use crate::frame::{self, rtu};
use crate::points::pdu;
use crate::tester::Tester;

const N: &[Need] = &[Need::Rtu];
/// Scans end after this number of units.
const MOST_UNITS: usize = 300;
/// Number of packets of other units in front of the packet of the unit under test.
const MOST_PACKETS: usize = 100;

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    case("fast/scan", "Fast Modbus 01 to 04", "a scan finds the unit once, then says that no unit is left", N, scan),
    case("fast/by-serial", "Fast Modbus 08", "a request to the unit's serial number has the reply of one to its address", N,
        by_serial),
    case("fast/other-serial", "Fast Modbus 08", "a request to another serial number gets silence", N, other_serial),
    case("fast/unknown-to-all", "Fast Modbus", "unknown sub-functions and wrong lengths, to all units, get silence", N,
        unknown_to_all),
    case("fast/unknown-to-unit", "Fast Modbus", "unknown sub-functions to the unit's address are exception 01", N,
        unknown_to_unit),
    case("fast/settings", "Fast Modbus 18", "a list of settings with a wrong length is 03 or silence", N, wrong_settings),
    case("fast/events", "Fast Modbus 10 to 18",
        "the state of a point whose events are switched on is sent, again byte for byte until it is confirmed", N, events),
];

/// Skips the case if the unit does not have function 70.
fn claimed(tester: &mut Tester<'_>) -> Check {
    let nothing = settings(&[]);
    match tester.ask_due(&nothing)? {
        frame::Reply::Pdu(reply) if reply == nothing => Ok(()),
        reply if reply == frame::Reply::Silence || reply.exception(FUNCTION) == Some(1) => {
            skip("the unit does not have function 70")
        }
        _ => tester.fail("the settings of no point, or exception 01"),
    }
}

/// Sends a request to all units. Returns the reply, if there is one.
fn ask(tester: &mut Tester<'_>, request: &Request) -> Check<Option<Reply>> {
    let (_, wait) = request.longest_wait(tester.endpoint.line());
    let patience = tester.patience;
    // An arbitration has longer silences than the silence that ends a reply.
    tester.patience.reply += wait;
    tester.patience.quiet = tester.patience.quiet.max(wait);
    let received = tester.raw_due(&tester.target.mode.frame(ADDRESS, &request.pdu()));
    tester.patience = patience;
    received?;
    let bytes: Vec<u8> = tester
        .received
        .iter()
        .map(|received| received.byte)
        .collect();
    Ok(request.find(&bytes).map(|(reply, _)| reply))
}

/// Scans the line. Returns the serial number of the unit.
fn find(tester: &mut Tester<'_>) -> Check<u32> {
    let mut found = None;
    let mut request = Request::StartScan;
    for _ in 0..MOST_UNITS {
        match ask(tester, &request)? {
            Some(Reply::Found { serial, unit }) if unit == tester.unit() => {
                tester.ensure(found.is_none(), "the unit is found once")?;
                found = Some(serial);
            }
            Some(Reply::Found { .. }) => {}
            Some(Reply::NoneLeft) => {
                return found.map_or_else(|| tester.fail("the unit is found"), Ok);
            }
            _ => return tester.fail("a unit that is found, or that none is left"),
        }
        request = Request::ContinueScan;
    }
    tester.fail("the scan ends")
}

fn scan(tester: &mut Tester<'_>) -> Check {
    claimed(tester)?;
    let serial = find(tester)?;
    let is_end = ask(tester, &Request::ContinueScan)? == Some(Reply::NoneLeft);
    tester.ensure(is_end, "no unit is left, again")?;
    let again = find(tester)?;
    tester.ensure(again == serial, "the same serial number in the next scan")
}

fn by_serial(tester: &mut Tester<'_>) -> Check {
    claimed(tester)?;
    let serial = find(tester)?;
    let inside = |pdu: &[u8]| Request::BySerial {
        serial,
        pdu: pdu.to_vec(),
    };
    let ping = tester.target.ping.clone();
    let by_address = tester.reply(&ping)?;
    let by_serial = ask(tester, &inside(&ping))?;
    // The value of an input may have changed.
    let is_alike = matches!(by_serial, Some(Reply::Pdu(pdu)) if pdu[0] == ping[0] && pdu.len() == by_address.len());
    tester.ensure(is_alike, "a reply of the same function and length")?;
    let refused = pdu(3, 0xFFFF, 0);
    tester.exception(&refused, 3)?;
    let by_serial = ask(tester, &inside(&refused))?;
    let wanted = vec![0x83, 3];
    tester.ensure(
        by_serial == Some(Reply::Pdu(wanted)),
        "exception 03 to function 03",
    )
}

fn other_serial(tester: &mut Tester<'_>) -> Check {
    claimed(tester)?;
    let other = find(tester)? ^ 0x4000;
    let request = Request::BySerial {
        serial: other,
        pdu: tester.target.ping.clone(),
    };
    let frame = tester.target.mode.frame(ADDRESS, &request.pdu());
    tester.silence_to(&frame, "the request is for another serial number")
}

fn unknown_to_all(tester: &mut Tester<'_>) -> Check {
    claimed(tester)?;
    let subs = [0, 5, 7, 0x0F, 0x13, 0x19, 0x20, 0x7F, 0x80, 0xFF];
    let unknown = subs.map(|sub| vec![FUNCTION, sub]);
    let lengths = [
        &[][..],
        &[1, 0],
        &[2, 0],
        &[8],
        &[0x10, 0, 100, 0],
        &[0x10, 0, 100, 0, 0, 0],
    ];
    let lengths = lengths.map(|data| [&[FUNCTION], data].concat());
    for pdu in unknown.iter().chain(&lengths) {
        let frame = rtu(&[&[ADDRESS], &pdu[..]].concat());
        tester.silence_to(&frame, "the request is to all units, and unknown")?;
    }
    tester.alive("unknown requests to all units")
}

fn unknown_to_unit(tester: &mut Tester<'_>) -> Check {
    claimed(tester)?;
    for sub in [0, 5, 7, 0x0F, 0x13, 0x19, 0x20, 0x7F, 0x80, 0xFF] {
        tester.exception(&[FUNCTION, sub, 0], 1)?;
    }
    Ok(())
}

fn wrong_settings(tester: &mut Tester<'_>) -> Check {
    claimed(tester)?;
    // The event that the unit has started: to switch it off changes no point.
    let right = settings(&[start()]);
    tester.reply(&right)?;
    for length in 3..right.len() {
        let mut short = right[..length].to_vec();
        tester.exception_03_or_silence(&short)?;
        short[2] = (length - 3) as u8;
        // A list without a point is right.
        if length > 3 {
            tester.exception_03_or_silence(&short)?;
        }
    }
    tester.exception_03_or_silence(&[&right[..], &[0]].concat())
}

/// Switches off the event that the unit has started.
const fn start() -> Setting {
    Setting {
        kind: kind::UNIT,
        id: 0,
        priority: Priority::Off,
    }
}

/// Switches on the events of a point that has events. Skips the case if there is none.
fn switch_on(tester: &mut Tester<'_>) -> Check<Setting> {
    for kind in kind::COIL..=kind::INPUT_REGISTER {
        // The types of events are the functions that read the points.
        let Some(span) = tester.target.readable(kind).first() else {
            continue;
        };
        let point = Setting {
            kind,
            id: span.first,
            priority: Priority::Low,
        };
        let both = [point, start()];
        let reply = tester.reply(&settings(&both))?;
        match are_on(&both, &reply).as_deref() {
            Some([true, false]) => return Ok(point),
            Some([false, false]) => {}
            _ => return tester.fail("a bit for each setting, and start off"),
        }
    }
    skip("no point reports events")
}

/// Fetches packets until there is one of the unit; `None` if no unit has events.
fn fetch(tester: &mut Tester<'_>, mut confirmed: Option<(u8, u8)>) -> Check<Option<Packet>> {
    for _ in 0..MOST_PACKETS {
        let request = Request::Fetch {
            least: 0,
            room: 100,
            confirmed,
        };
        match ask(tester, &request)? {
            Some(Reply::Events(packet)) if packet.unit == tester.unit() => return Ok(Some(packet)),
            Some(Reply::Events(packet)) => confirmed = Some((packet.unit, packet.flag)),
            Some(Reply::NoEvents) => return Ok(None),
            _ => return tester.fail("events, or that there are none"),
        }
    }
    tester.fail("the unit's events, or that there are none")
}

fn events(tester: &mut Tester<'_>) -> Check {
    claimed(tester)?;
    let point = switch_on(tester)?;
    let result = reported(tester, point);
    let off = Setting {
        priority: Priority::Off,
        ..point
    };
    tester.reply(&settings(&[off]))?;
    result
}

fn reported(tester: &mut Tester<'_>, point: Setting) -> Check {
    let is_of_point = |packet: &Packet| {
        let mut events = packet.events.iter();
        events.any(|event| (event.kind, event.id) == (point.kind, point.id))
    };
    let Some(mut packet) = fetch(tester, None)? else {
        return tester.fail("the state of the point");
    };
    let again = fetch(tester, None)?.as_ref() == Some(&packet);
    tester.ensure(again, "the same packet, because it is not confirmed")?;
    // A packet that was not confirmed before this case is sent first.
    for _ in 0..MOST_PACKETS {
        let next = fetch(tester, Some((tester.unit(), packet.flag)))?;
        tester.ensure(
            next.as_ref().is_none_or(|next| next.flag != packet.flag),
            "a packet with another flag, or none, after the confirmation",
        )?;
        if is_of_point(&packet) {
            return Ok(());
        }
        match next {
            Some(next) => packet = next,
            None => break,
        }
    }
    tester.fail("the state of the point")
}
