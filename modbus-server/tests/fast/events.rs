//! The packets in which a unit reports its events, and whose turn it is.

use super::*;

#[test]
fn a_packet_is_sent_again_unchanged_until_it_is_confirmed() {
    let mut unit = Unit::new(Part::Everything);
    unit.device.has_started = false;
    assert_eq!(unit.fetch(0, 0), (0b1111, bytes("FD 46 12")));
    unit.device.events = vec![(0x01D0, 1)];
    let first = bytes("05 46 11 00 01 05 01 02 01 D0 01");
    assert_eq!(unit.fetch(0, 0), (0b1001, first.clone()));
    // A new event waits, and has high priority; the packet is the same.
    unit.device.events.push((1, 1));
    unit.device.is_high = true;
    assert_eq!(unit.fetch(0, 0), (0b1000, first.clone()));
    // After two packets in a row others go first.
    assert_eq!(
        unit.fetch(5, 1),
        (0b1110, first.clone()),
        "the flag is another one"
    );
    assert_eq!(
        unit.fetch(6, 0),
        (0b1000, first),
        "the address is another one"
    );
    let second = bytes("05 46 11 01 01 05 01 02 00 01 01");
    assert_eq!(unit.fetch(5, 0).1, second);
    unit.device.is_high = false;
    assert_eq!(unit.fetch(5, 1), (0b1111, bytes("FD 46 12")));
}

#[test]
fn a_packet_that_was_never_sent_cannot_be_confirmed() {
    let mut unit = Unit::new(Part::Everything);
    unit.device.has_started = false;
    unit.device.events = vec![(7, 1)];
    let fetch = bytes("FD 46 10 00 64 05 00");
    assert_eq!(unit.ask_losing_in(&fetch, Some(0)), Answer::Silence);
    assert_eq!(
        unit.fetch(5, 0).1,
        bytes("05 46 11 00 01 05 01 02 00 07 01")
    );
}

#[test]
fn other_requests_in_between_do_not_change_what_was_sent() {
    let mut unit = Unit::new(Part::Everything);
    unit.device.has_started = false;
    unit.device.events = vec![(7, 1)];
    let usual = [ADDRESS, 3, 0, 0, 0, 1];
    let by_serial = bytes("FD 46 08 00 01 EB 37 03 00 00 00 01");
    let none = (0b1111, bytes("FD 46 12"));
    // A packet was sent, then others are served, then it is confirmed.
    let packet = bytes("05 46 11 00 01 05 01 02 00 07 01");
    assert_eq!(unit.fetch(0, 0).1, packet);
    assert!(matches!(unit.ask(&usual), Answer::Usual(_)));
    assert!(matches!(unit.ask(&by_serial), Answer::After(0, 0, _)));
    assert_eq!(unit.fetch(5, 0), none);
    // A packet was not sent, because another unit won. A reply to the serial number does not change that.
    unit.device.events = vec![(8, 1)];
    let fetch = bytes("FD 46 10 00 64 05 01");
    assert_eq!(unit.ask_losing_in(&fetch, Some(0)), Answer::Silence);
    assert!(matches!(unit.ask(&by_serial), Answer::After(0, 0, _)));
    let packet = bytes("05 46 11 01 01 05 01 02 00 08 01");
    assert_eq!(unit.fetch(5, 1).1, packet);
}

/// Lets all units arbitrate for a fetch with this confirmation. Returns who has won, and the flag of its packet.
fn fetch_of_all(units: &mut [Unit], confirmed: (usize, u8)) -> (usize, u8) {
    let address = confirmed.0 as u8 + 1;
    for unit in &mut *units {
        let done = unit.begin(&[0xFD, 0x46, 0x10, 0, 100, address, confirmed.1]);
        assert_eq!(done, None);
    }
    loop {
        // Zeros are sent at the beginning of a window, and ones are decided at its end.
        let active = units
            .iter()
            .enumerate()
            .filter_map(|(n, unit)| Some((unit.port.deadline()?, n)));
        let (now, n) = active.min().expect("a unit wins");
        match units[n].port.turn() {
            Turn::None => {}
            Turn::Bit(_) => {
                units[n].port.sent();
                for (other, unit) in units.iter_mut().enumerate() {
                    if other != n {
                        unit.port.fell(now);
                    }
                }
            }
            Turn::Reply(first) => {
                assert_eq!(first, n as u8 + 1);
                let packet: Vec<u8> = std::iter::from_fn(|| units[n].port.next_byte()).collect();
                units[n].port.sent();
                return (n, packet[2]);
            }
        }
    }
}

#[test]
fn each_of_several_units_that_always_have_events_has_its_turn() {
    let mut units: Vec<Unit> = (1..=4).map(|n| Unit::at(n, Part::Everything)).collect();
    let mut last = (usize::MAX - 1, 0);
    let mut order = Vec::new();
    for round in 0..40 {
        for (n, unit) in units.iter_mut().enumerate() {
            unit.device.has_started = false;
            // The last one has an event from time to time.
            if n < 3 || round % 10 == 5 {
                unit.device.events.push((7, 1));
            }
        }
        last = fetch_of_all(&mut units, (last.0, last.1));
        order.push(last.0);
    }
    for n in 0..3 {
        let turns = order.iter().filter(|winner| **winner == n).count();
        assert!((9..=16).contains(&turns), "unit {n} in {order:?}");
        // Two packets of each of the others, and one more of the unit that was the first to have its turn again.
        let turns: Vec<usize> = (0..40).filter(|round| order[*round] == n).collect();
        assert!(
            turns.windows(2).all(|two| two[1] - two[0] <= 8),
            "{order:?}"
        );
    }
    assert_eq!(
        order.iter().filter(|winner| **winner == 3).count(),
        4,
        "{order:?}"
    );
}

#[test]
fn room_and_least_address_limit_a_packet() {
    let mut unit = Unit::new(Part::Everything);
    unit.device.events = vec![(7, 1), (8, 0), (9, 1)];
    assert_eq!(unit.ask(&bytes("FD 46 10 06 64 00 00")), Answer::Silence);
    let Answer::After(_, 12, reply) = unit.ask(&bytes("FD 46 10 05 03 00 00")) else {
        panic!("no reply");
    };
    assert_eq!(
        reply,
        with_crc(&bytes("05 46 11 01 03 00")),
        "no room for any event"
    );
    // The unit has started, and one event.
    let Answer::After(_, 12, reply) = unit.ask(&bytes("FD 46 10 05 0A 00 00")) else {
        panic!("no reply");
    };
    assert_eq!(
        reply,
        with_crc(&bytes("05 46 11 00 04 09 00 0F 00 00 01 02 00 07 01"))
    );
}

#[test]
fn the_start_is_reported_until_two_packets_in_a_row_are_confirmed_or_it_is_switched_off() {
    let mut unit = Unit::new(Part::Everything);
    let packet = |flag| vec![5, 0x46, 0x11, flag, 1, 4, 0, 0x0F, 0, 0];
    let none = (0b1111, bytes("FD 46 12"));
    assert_eq!(unit.fetch(5, 0).1, packet(0));
    // The confirmation of a packet from before the start fits this one.
    assert_eq!(unit.fetch(5, 0).1, packet(1));
    for _ in 0..10 {
        assert_eq!(unit.fetch(5, 0).1, packet(1), "the same confirmation again");
    }
    assert_eq!(unit.fetch(5, 1), none);
    assert!(!unit.device.has_started);
    // A master may switch it on again, and off.
    unit.device.has_started = true;
    assert_eq!(unit.fetch(0, 0).1, packet(0));
    unit.device.has_started = false;
    assert_eq!(unit.fetch(5, 0), none);
}

#[test]
fn a_packet_that_lost_is_made_again_of_what_waits_then() {
    let mut unit = Unit::new(Part::Everything);
    unit.device.has_started = false;
    unit.device.events = vec![(7, 1), (8, 1), (9, 0)];
    let fetch = bytes("FD 46 10 00 64 05 01");
    assert_eq!(unit.ask_losing_in(&fetch, Some(0)), Answer::Silence);
    // Sub-function 18 has switched point 8 off.
    unit.device.events.remove(1);
    assert_eq!(unit.ask_losing_in(&fetch, Some(0)), Answer::Silence);
    unit.device.events.push((10, 1));
    // The reply does not reach the master, which holds an old confirmation.
    let packet = bytes("05 46 11 00 03 0F 01 02 00 07 01 01 02 00 09 00 01 02 00 0A 01");
    assert_eq!(unit.fetch(5, 1).1, packet);
    unit.device.events.push((11, 1));
    assert_eq!(unit.fetch(5, 1).1, packet);
    assert_eq!(
        unit.fetch(5, 0).1,
        bytes("05 46 11 01 01 05 01 02 00 0B 01")
    );
    assert_eq!(unit.fetch(5, 1).1, bytes("FD 46 12"));
}

#[test]
fn after_four_packets_in_a_row_the_least_unit_asked_says_once_that_there_are_no_events() {
    let mut unit = Unit::new(Part::Everything);
    unit.device.has_started = false;
    let mut ask = |least: u8| {
        unit.device.events.push((7, 1));
        let request = [0xFD, 0x46, 0x10, least, 100, 0, 0];
        match unit.ask(&request) {
            Answer::After(value, 12, reply) => (value >> 8, reply[2]),
            other => panic!("{other:02X?}"),
        }
    };
    let round = [
        (0b1001, 0x11),
        (0b1001, 0x11),
        (0b1110, 0x11),
        (0b1001, 0x11),
    ];
    assert_eq!([5; 4].map(&mut ask), round);
    assert_eq!(ask(5), (0b1111, 0x12));
    // Its turn is over: others go first.
    assert_eq!(ask(5), (0b1110, 0x11));
    for _ in 0..20 {
        assert_eq!(ask(4).1, 0x11, "lower addresses are asked, too");
    }
    assert_eq!(ask(5), (0b1111, 0x12));
}
