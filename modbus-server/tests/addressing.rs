//! Unit addresses, and traffic of other units on the same line (V1.02 2.1, 2.2).

mod common;

use common::{Points, UNIT, Unit, frame, pdu, send, write_words};
use modbus_server::line::{Faults, Framing, Port, Receiver, UnitSet};
use modbus_server::{Adu, Outcome, Server, Tables};

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
    assert_eq!(counters.bus_messages, 254 * 4, "every frame is counted");
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
fn the_highest_address_works_like_any_other() {
    // A device may use address 255 for a special mode.
    let mut unit = Unit::with(255, false, Points::new(1, 1));
    let request = frame(255, &pdu(0x06, &[0, 7]));
    assert_eq!(unit.raw(&request), Some(request));
    assert_eq!(unit.raw(&frame(UNIT, &pdu(0x06, &[0, 8]))), None);
    assert_eq!(unit.raw(&frame(0, &pdu(0x06, &[0, 9]))), None);
    assert_eq!(unit.points.words[0], 9);
}

#[test]
fn a_set_of_units_is_served_under_each_of_its_addresses() {
    const UNITS: UnitSet = UnitSet::new(&[1, 17, 255]);
    let mut adus = [Adu::new(), Adu::new()];
    let mut port = Port::new(Receiver::rtu(UNITS, false), &mut adus);
    port.long_silence(0);
    let mut server = Server::new(Framing::Rtu);
    // One virtual unit per address. Initially, the unit's register 0 holds its address.
    let mut registers: Vec<u16> = (0..256).collect();
    let mut exchange = |to: u8, pdu: &[u8]| {
        for byte in frame(to, pdu) {
            port.received(byte, Faults::NONE);
        }
        port.long_silence(0);
        let request = port.take()?;
        let unit = request.unit();
        assert_eq!(unit, to);
        // A broadcast is executed by all of them.
        let mut register = [registers[usize::from(unit)]];
        let mut tables = Tables {
            holding_registers: &mut register,
            ..Tables::default()
        };
        let reply = server.serve(request, &mut tables);
        assert_eq!(reply.outcome(), Outcome::Accepted);
        port.send(reply, 0);
        for address in [1, 17, 255] {
            if [0, address].contains(&unit) {
                registers[usize::from(address)] = register[0];
            }
        }
        send(&mut port)
    };
    let read = pdu(0x03, &[0, 1]);
    for to in 1..=255 {
        let expected = [1, 17, 255]
            .contains(&to)
            .then(|| frame(to, &[3, 2, 0, to]));
        assert_eq!(exchange(to, &read), expected, "unit {to}");
    }
    let write = pdu(0x06, &[0, 0x1234]);
    assert_eq!(exchange(17, &write), Some(frame(17, &write)));
    assert_eq!(exchange(17, &read), Some(frame(17, &[3, 2, 0x12, 0x34])));
    assert_eq!(exchange(1, &read), Some(frame(1, &[3, 2, 0, 1])));
    assert_eq!(exchange(0, &pdu(0x06, &[0, 7])), None);
    assert_eq!(exchange(255, &read), Some(frame(255, &[3, 2, 0, 7])));
    // All addresses share one event counter.
    let events = exchange(1, &[0x0B]);
    assert_eq!(events, Some(frame(1, &[0x0B, 0, 0, 0, 8])));
}

#[test]
fn listen_only_mode_of_one_address_silences_all_and_any_address_ends_it() {
    let units = UnitSet::new(&[1, 17]);
    let mut adus = [Adu::new(), Adu::new()];
    let mut port = Port::new(Receiver::rtu(units, false), &mut adus);
    port.long_silence(0);
    let mut server = Server::new(Framing::Rtu);
    let mut tables = Tables::default();
    let mut outcome = |to: u8, fields: &[u16]| {
        for byte in frame(to, &pdu(0x08, fields)) {
            port.received(byte, Faults::NONE);
        }
        port.long_silence(0);
        let request = port.take().expect("a request waits");
        let reply = server.serve(request, &mut tables);
        let outcome = reply.outcome();
        port.send(reply, 0);
        (outcome, send(&mut port).is_some())
    };
    assert_eq!(outcome(1, &[0, 7]), (Outcome::Accepted, true));
    assert_eq!(outcome(1, &[4, 0]), (Outcome::Accepted, false));
    for unit in [1, 17] {
        assert_eq!(outcome(unit, &[0, 7]), (Outcome::NotObeyed, false));
    }
    assert_eq!(outcome(17, &[1, 0]), (Outcome::Accepted, false));
    for unit in [1, 17] {
        assert_eq!(outcome(unit, &[0, 7]), (Outcome::Accepted, true));
    }
}
