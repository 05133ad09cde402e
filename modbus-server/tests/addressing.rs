//! Whose request it is, and life on a line shared with other units (V1.02 2.1, 2.2).

mod common;

use common::{Points, UNIT, Unit, frame, pdu, write_words};
use modbus_server::line::Framing;
use modbus_server::{Adu, Outcome, Server};

fn unit() -> Unit {
    Unit::new(Points::new(64, 64))
}

#[test]
fn nothing_is_answered_or_written_for_another_unit() {
    let mut unit = unit();
    let points = unit.points.clone();
    for other in (1..=255).filter(|other| *other != UNIT) {
        for request in [
            pdu(0x03, &[0, 1]),
            pdu(0x06, &[0, 1]),
            write_words(0, &[1, 2]),
            vec![0x7F],
        ] {
            assert_eq!(unit.raw(&frame(other, &request)), None, "unit {other}");
        }
    }
    assert_eq!(unit.points, points);
    let counters = unit.counters();
    assert_eq!(counters.bus_messages, 254 * 4, "heard, each of them");
    assert_eq!(
        (
            counters.unit_messages,
            counters.no_response,
            counters.exceptions
        ),
        (0, 0, 0)
    );
    unit.must_answer();
}

#[test]
fn the_highest_address_is_one_like_any_other() {
    // A device may use it for a mode of its own.
    let mut unit = Unit::with(255, false, Points::new(1, 1));
    let request = frame(255, &pdu(0x06, &[0, 7]));
    assert_eq!(unit.raw(&request), Some(request));
    assert_eq!(unit.raw(&frame(UNIT, &pdu(0x06, &[0, 8]))), None);
    assert_eq!(unit.raw(&frame(0, &pdu(0x06, &[0, 9]))), None);
    assert_eq!(unit.points.words[0], 9);
}

#[test]
fn other_units_replies_are_never_taken_for_requests() {
    let mut unit = unit();
    let points = unit.points.clone();
    for reply in [
        vec![0x03, 0x02, 0x12, 0x34],
        pdu(0x06, &[0, 1]),
        pdu(0x10, &[0, 2]),
        vec![0x83, 0x02],
    ] {
        for other in [1, 16, 18, 247] {
            unit.raw(&frame(other, &pdu(0x03, &[0, 1])));
            assert_eq!(unit.raw(&frame(other, &reply)), None);
            unit.must_answer();
        }
    }
    assert_eq!(unit.points, points);
}

#[test]
fn other_units_broken_traffic_makes_the_unit_neither_deaf_nor_talkative() {
    let mut unit = unit();
    let theirs = frame(UNIT + 1, &write_words(0, &[0x1234; 60]));
    for len in 1..theirs.len() {
        assert_eq!(unit.raw(&theirs[..len]), None);
        unit.must_answer();
    }
}

#[test]
fn the_server_itself_looks_at_the_address_too() {
    let server = Server::new(UNIT, Framing::Rtu);
    let points = Points::new(4, 4);
    for (bytes, outcome) in [
        (&[][..], Outcome::NotForUs),
        (&[UNIT], Outcome::NotForUs),
        (&[UNIT + 1, 0x06, 0, 0, 0, 1], Outcome::NotForUs),
        (&[UNIT, 0x00], Outcome::NoRequest),
        (&[0, 0x03, 0, 0, 0, 1], Outcome::NoEffect),
    ] {
        let mut adu = Adu::new();
        assert!(bytes.iter().all(|byte| adu.push(*byte)));
        let decision = server.decide(&adu, &points);
        assert_eq!(decision.outcome, outcome, "{bytes:02X?}");
        assert_eq!(decision.reply, None);
        assert!(!decision.work.writes() && decision.work.reads().is_none());
    }
}
