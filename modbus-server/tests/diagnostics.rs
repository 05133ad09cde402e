//! Functions 07, 08, 0B, 0C and 11: diagnostics and identity of the device (V1.1b3 6.7 to 6.10, 6.13).

mod common;

use common::{Points, UNIT, Unit, frame, pdu, write_words};
use modbus_server::Exception;
use modbus_server::line::Faults;

fn unit() -> Unit {
    Unit::new(Points::new(64, 64))
}

/// Returns a request of function 08.
fn diagnose(sub: u16, data: u16) -> Vec<u8> {
    pdu(0x08, &[sub, data])
}

/// Returns the value in the reply to a sub-function. The rest of the reply must repeat the request.
fn value(unit: &mut Unit, sub: u16) -> u16 {
    let reply = unit.request(&diagnose(sub, 0)).expect("a reply");
    assert_eq!(reply[..3], diagnose(sub, 0)[..3]);
    assert_eq!(reply.len(), 5);
    u16::from_be_bytes([reply[3], reply[4]])
}

/// Returns status, event count, message count and events of function 0C.
fn log(unit: &mut Unit) -> (u16, u16, u16, Vec<u8>) {
    let reply = unit.request(&[0x0C]).expect("a reply");
    assert_eq!((reply[0], usize::from(reply[1])), (0x0C, reply.len() - 2));
    let word = |at: usize| u16::from_be_bytes([reply[at], reply[at + 1]]);
    (word(2), word(4), word(6), reply[8..].to_vec())
}

/// Returns the count of function 0B.
fn events(unit: &mut Unit) -> u16 {
    let reply = unit.request(&[0x0B]).expect("a reply");
    assert_eq!((reply.len(), &reply[..3]), (5, &[0x0B, 0, 0][..]));
    u16::from_be_bytes([reply[3], reply[4]])
}

#[test]
fn the_exception_status_matches_the_example_of_the_standard() {
    assert_eq!(unit().request(&[0x07]), Some(vec![0x07, 0x6D]));
}

#[test]
fn functions_without_fields_reject_additional_bytes() {
    for function in [0x07, 0x0B, 0x0C, 0x11] {
        assert_eq!(unit().refused(&[function, 0]), 3);
        assert_eq!(unit().refused(&[function, 0, 0, 0, 0]), 3);
    }
}

#[test]
fn data_of_any_length_is_echoed() {
    let mut unit = unit();
    // The example of the standard.
    let example = [0x08, 0x00, 0x00, 0xA5, 0x37];
    assert_eq!(unit.request(&example), Some(example.to_vec()));
    for len in 0..=250 {
        let data: Vec<u8> = (0..len).map(|n: u8| n.wrapping_mul(7)).collect();
        let request = [&[0x08, 0x00, 0x00][..], &data].concat();
        assert_eq!(unit.request(&request), Some(request));
    }
}

#[test]
fn unknown_sub_functions_return_01_and_data_other_than_zero_returns_03() {
    let there = [
        1, 2, 4, 0x0A, 0x0B, 0x0C, 0x0D, 0x0E, 0x0F, 0x10, 0x11, 0x12, 0x14,
    ];
    for sub in 1..0x200 {
        if !there.contains(&sub) {
            assert_eq!(unit().refused(&diagnose(sub, 0)), 1, "{sub:04X}");
            assert_eq!(unit().refused(&diagnose(sub, 1)), 1, "{sub:04X}");
            continue;
        }
        for data in [0x0001, 0x0100, 0xFFFF, 0xFF01, 0x00FF] {
            assert_eq!(unit().refused(&diagnose(sub, data)), 3, "{sub:04X}");
        }
        assert_eq!(unit().refused(&diagnose(sub, 0)[..4]), 3, "{sub:04X} short");
        assert_eq!(unit().refused(&diagnose(sub, 0)[..3]), 3, "{sub:04X} short");
        let long = [&diagnose(sub, 0)[..], &[0]].concat();
        assert_eq!(unit().refused(&long), 3, "{sub:04X} long");
        if sub != 1 {
            assert_eq!(unit().refused(&diagnose(sub, 0xFF00)), 3, "{sub:04X}");
        }
    }
    assert_eq!(unit().refused(&[0x08]), 3);
    assert_eq!(unit().refused(&[0x08, 0x00]), 3);
}

#[test]
fn the_diagnostic_register_is_that_of_the_device() {
    assert_eq!(value(&mut unit(), 0x02), 0xAB6D);
}

#[test]
fn a_cleared_bit_of_the_diagnostic_register_stays_0_until_it_is_set_again() {
    let mut unit = unit();
    let clear = diagnose(0x0A, 0);
    assert_eq!(unit.request(&clear), Some(clear));
    assert_eq!(value(&mut unit, 0x02), 0, "all set bits were cleared");
    unit.points.status = 0x6F;
    assert_eq!(value(&mut unit, 0x02), 0x0002, "a newly set bit");
    unit.points.status = 0x00;
    assert_eq!(value(&mut unit, 0x02), 0);
    unit.points.status = 0x6F;
    assert_eq!(
        value(&mut unit, 0x02),
        0x006F,
        "the bits that were 0 in between"
    );
    // A restart of communication clears only the counters.
    unit.request(&diagnose(0x01, 0)).expect("an echo");
    assert_eq!(value(&mut unit, 0x02), 0x006F);
}

#[test]
fn every_counter_can_be_read() {
    let mut unit = unit();
    for _ in 0..3 {
        unit.raw(&frame(UNIT + 1, &[0x07])); // 3 on the bus
    }
    for _ in 0..4 {
        unit.raw(&[UNIT, 1, 2]); // 4 errors
    }
    for _ in 0..5 {
        unit.character(0, Faults::OVERRUN); // 5 overruns, errors as well
        unit.silence();
    }
    for _ in 0..6 {
        unit.refused(&[0x63]); // 6 exceptions
    }
    for _ in 0..7 {
        unit.raw(&frame(0, &write_words(0, &[1]))); // 7 without reply
    }
    unit.points.state = Some(Exception::NegativeAcknowledge.code());
    for _ in 0..8 {
        unit.refused(&pdu(0x03, &[0, 1])); // 8 NAK
    }
    unit.points.state = Some(Exception::ServerDeviceBusy.code());
    for _ in 0..9 {
        unit.refused(&pdu(0x03, &[0, 1])); // 9 busy
    }
    unit.points.state = None;
    // Each request that reads a counter is itself counted.
    let to_us = 6 + 7 + 8 + 9;
    assert_eq!(value(&mut unit, 0x0B), 3 + to_us + 1);
    assert_eq!(value(&mut unit, 0x0C), 4 + 5);
    assert_eq!(value(&mut unit, 0x0D), 6 + 8 + 9);
    assert_eq!(value(&mut unit, 0x0E), to_us + 4);
    assert_eq!(value(&mut unit, 0x0F), 7);
    assert_eq!(value(&mut unit, 0x10), 8);
    assert_eq!(value(&mut unit, 0x11), 9);
    assert_eq!(value(&mut unit, 0x12), 5);

    // 14 clears only the overruns.
    unit.request(&diagnose(0x14, 0)).expect("an echo");
    assert_eq!((value(&mut unit, 0x12), value(&mut unit, 0x0C)), (0, 9));
    // 0A clears all counters, including the event counter.
    let clear = diagnose(0x0A, 0);
    assert_eq!(unit.request(&clear), Some(clear));
    assert_eq!(unit.counters().as_words(), [0; 9]);
    assert_eq!(events(&mut unit), 0);
    assert_eq!(value(&mut unit, 0x0B), 2);
    unit.raw(&[UNIT, 1, 2]);
    assert_eq!(value(&mut unit, 0x0C), 1, "counting continues from 0");
}

#[test]
fn the_event_counter_counts_successful_requests() {
    let mut unit = unit();
    assert_eq!(events(&mut unit), 0);
    assert_eq!(events(&mut unit), 0, "0B itself does not count");
    unit.must_answer();
    assert_eq!(events(&mut unit), 1);
    unit.refused(&[0x63]);
    assert_eq!(events(&mut unit), 1, "an exception does not");
    unit.raw(&frame(0, &write_words(0, &[1])));
    assert_eq!(events(&mut unit), 2, "a broadcast does");
    unit.raw(&frame(0, &pdu(0x03, &[0, 1])));
    unit.raw(&frame(0, &write_words(64, &[1])));
    assert_eq!(events(&mut unit), 2, "one without effect does not");
    assert_eq!(log(&mut unit).1, 2, "0C returns the same count as 0B");
    assert_eq!(events(&mut unit), 2, "and does not count either");
}

#[test]
fn the_log_contains_the_events_newest_first() {
    let mut unit = unit();
    assert_eq!(
        log(&mut unit),
        (0, 0, 1, vec![0x80]),
        "only its own reception"
    );
    unit.must_answer();
    unit.refused(&[0x63]);
    unit.points.state = Some(Exception::ServerDeviceFailure.code());
    unit.refused(&pdu(0x03, &[0, 1]));
    unit.points.state = None;
    unit.raw(&[UNIT, 1, 2]);
    unit.character(0, Faults::OVERRUN);
    unit.silence();
    unit.raw(&frame(0, &write_words(0, &[1])));
    let newest_last = [
        0x80, 0x40, // the first 0C
        0x80, 0x40, // a read
        0x80, 0x41, // an unknown function
        0x80, 0x42, // a failure
        0x92, 0x82, // two damaged frames, one with an overrun
        0xC0, 0x40, // a broadcast
        0x80, // this request
    ];
    let (_, count, messages, events) = log(&mut unit);
    assert!(events.iter().rev().eq(newest_last.iter()), "{events:02X?}");
    assert_eq!((count, messages), (2, 6));
}

#[test]
fn the_log_holds_64_events() {
    let mut unit = unit();
    for _ in 0..31 {
        unit.must_answer();
    }
    assert_eq!(log(&mut unit).3.len(), 63);
    assert_eq!(log(&mut unit).3.len(), 64);
    for _ in 0..40_000 {
        unit.raw(&[UNIT, 1]);
    }
    let events = log(&mut unit).3;
    assert_eq!((events.len(), events[0], events[1]), (64, 0x80, 0x82));
    assert!(events[1..].iter().all(|event| *event == 0x82));
}

#[test]
fn a_unit_in_listen_only_mode_executes_only_the_restart() {
    let mut unit = unit();
    unit.must_answer();
    assert_eq!(unit.request(&diagnose(0x04, 0)), None);
    assert!(unit.server.is_listen_only());
    let points = unit.points.clone();
    for to in [UNIT, 0] {
        for request in [
            pdu(0x03, &[0, 1]),
            write_words(0, &[1]),
            vec![0x63],
            pdu(0x06, &[1, 0xFF00]), // the bytes after 06 equal those after 08 for a restart
            vec![0x0B],
            diagnose(0x04, 0),
            diagnose(0x0A, 0),
            diagnose(0x01, 1),
            [&diagnose(0x01, 0)[..], &[0]].concat(),
        ] {
            assert_eq!(unit.raw(&frame(to, &request)), None, "{request:02X?}");
        }
    }
    // A restart by broadcast or for another unit does not end the mode.
    assert_eq!(unit.raw(&frame(0, &diagnose(0x01, 0))), None);
    assert_eq!(unit.raw(&frame(UNIT + 1, &diagnose(0x01, 0))), None);
    assert!(unit.server.is_listen_only());
    assert_eq!(unit.points, points);
    let counters = unit.counters();
    assert_eq!(
        (
            counters.bus_messages,
            counters.unit_messages,
            counters.no_response
        ),
        (22, 21, 20),
        "counting continues"
    );
    assert_eq!(counters.exceptions, 0);

    assert_eq!(
        unit.request(&diagnose(0x01, 0)),
        None,
        "the restart is not answered"
    );
    assert_eq!(unit.counters().as_words(), [0; 9]);
    let (status, count, messages, events) = log(&mut unit);
    assert_eq!((status, count, messages), (0, 0, 1));
    // The newest events first: this request, the restart, the end of the previous request and its reception, and so
    // on.
    assert_eq!(events[..6], [0x80, 0x00, 0x60, 0xA0, 0x60, 0xE0]);
    assert_eq!(events[events.len() - 5..], [0x04, 0x40, 0x80, 0x40, 0x80]);
    unit.must_answer();
}

#[test]
fn a_restart_is_answered_and_clears_counters_and_with_ff00_the_log() {
    for (data, before) in [(0x0000, true), (0xFF00, false)] {
        let mut unit = unit();
        unit.must_answer();
        let restart = diagnose(0x01, data);
        assert_eq!(unit.request(&restart), Some(restart));
        assert_eq!(unit.counters().as_words(), [0; 9]);
        assert_eq!(events(&mut unit), 0);
        let (.., events) = log(&mut unit);
        let since = [0x80, 0x40, 0x80, 0x00];
        assert_eq!(events[..4], since);
        let rest: &[u8] = if before {
            &[0x40, 0x80, 0x40, 0x80]
        } else {
            &[]
        };
        assert_eq!(&events[4..], rest);
    }
}

#[test]
fn a_broadcast_of_diagnostics_has_no_effect() {
    let mut unit = unit();
    unit.must_answer();
    for sub in [0x00, 0x01, 0x04, 0x0A, 0x14] {
        assert_eq!(unit.raw(&frame(0, &diagnose(sub, 0))), None);
    }
    assert!(!unit.server.is_listen_only());
    assert_eq!(unit.counters().unit_messages, 6);
}

#[test]
fn in_rtu_mode_changing_the_delimiter_returns_01() {
    assert_eq!(unit().refused(&diagnose(0x03, 0x2300)), 1);
}

#[test]
fn the_server_reports_its_identity_and_run_indicator() {
    let mut unit = unit();
    assert_eq!(unit.request(&[0x11]), Some(vec![0x11, 2, 0x42, 0xFF]));
    unit.points.running = false;
    unit.points.server_id = vec![7; 300];
    let reply = unit.request(&[0x11]).expect("a reply");
    assert_eq!((reply.len(), reply[1], reply[2]), (253, 251, 7));
    assert_eq!(reply[252], 0x00);
    unit.points.server_id = vec![];
    assert_eq!(unit.request(&[0x11]), Some(vec![0x11, 1, 0x00]));
    unit.points.additional_data = b"more".to_vec();
    let reply = [&[0x11, 5, 0x00][..], b"more"].concat();
    assert_eq!(unit.request(&[0x11]), Some(reply));
    unit.points.server_id = vec![7; 248];
    let reply = unit.request(&[0x11]).expect("a reply");
    assert_eq!((reply.len(), reply[1]), (253, 251));
    assert_eq!(reply[250..], [0x00, b'm', b'o']);
}

#[test]
fn read_only_diagnostics_refuse_every_sub_function_that_changes_something() {
    let mut unit = unit();
    unit.server = unit.server.with_read_only_diagnostics();
    unit.request(&pdu(0x03, &[200, 1])).expect("an exception");
    for sub in
        (0x00..=0x14).filter(|sub| ![0x00, 0x02].contains(sub) && !(0x0B..=0x12).contains(sub))
    {
        let known = [0x01, 0x04, 0x0A, 0x14].contains(&sub);
        let expected = if known { 6 } else { 1 };
        assert_eq!(unit.refused(&diagnose(sub, 0)), expected, "{sub:02X}");
    }
    assert_eq!(unit.refused(&diagnose(0x01, 0xFF00)), 6);
    assert_eq!(unit.refused(&diagnose(0x0A, 1)), 3, "the value comes first");
    for sub in [0x00, 0x02].into_iter().chain(0x0B..=0x12) {
        value(&mut unit, sub);
    }
    assert!(value(&mut unit, 0x0D) > 0, "the counters were not cleared");
}
