//! Whatever arrives: no panic, no answer to what is not a good request to this unit, the same
//! answers as a plain second server gives, and an answer to the next good request.

mod common;

use common::reference::{Reference, serve};
use common::{Points, UNIT, Unit, frame, pack, pdu, write_bits, write_words};
use modbus_server::rtu::Faults;
use proptest::collection::vec;
use proptest::prelude::*;

/// More bits than one write may hold, more words than one read may ask for, and an end within
/// reach.
const BITS: usize = 2010;
const WORDS: usize = 130;

fn points() -> impl Strategy<Value = Points> {
    (
        vec(any::<bool>(), BITS),
        vec(any::<u16>(), WORDS),
        100_u32..140,
    )
        .prop_map(|(bits, words, read_only_from)| Points {
            bits,
            words,
            read_only_from,
            state: None,
        })
}

/// An address that exists, the end of the points, or the end of all addresses.
fn address() -> impl Strategy<Value = u16> {
    prop_oneof![
        4 => 0_u16..30,
        2 => 90_u16..145,
        1 => 2000_u16..2015,
        1 => 0xFF80_u16..,
        1 => any::<u16>(),
    ]
}

/// A quantity, mostly about one of the limits.
fn quantity() -> impl Strategy<Value = u16> {
    prop_oneof![
        4 => 0_u16..20,
        2 => 120_u16..128,
        1 => 1960_u16..1972,
        1 => 1995_u16..2003,
        1 => any::<u16>(),
    ]
}

/// Request PDUs, most of them right or nearly so.
fn request() -> BoxedStrategy<Vec<u8>> {
    let single = prop_oneof![Just(0xFF00_u16), Just(0), any::<u16>(), 0xFFE0_u16..];
    let read = (1_u8..=4, address(), quantity()).prop_map(|(f, a, q)| pdu(f, &[a, q]));
    let write = (5_u8..=6, address(), single).prop_map(|(f, a, v)| pdu(f, &[a, v]));
    let bits = (address(), vec(any::<bool>(), 0..40)).prop_map(|(a, b)| write_bits(a, &b));
    let words = (address(), vec(0_u16..0xFFF8, 0..124)).prop_map(|(a, w)| write_words(a, &w));
    let many = (0_u16..30, vec(any::<bool>(), 1950..1968)).prop_map(|(a, b)| write_bits(a, &b));
    let shaped = prop_oneof![3 => read, 2 => write, 2 => bits, 2 => words, 1 => many].boxed();
    let bent = (shaped.clone(), any::<prop::sample::Index>(), any::<u8>());
    let bent = bent.prop_map(|(mut pdu, at, byte)| {
        let at = at.index(pdu.len());
        pdu[at] = byte;
        pdu
    });
    let cut = (shaped.clone(), any::<prop::sample::Index>())
        .prop_map(|(pdu, at)| pdu[..=at.index(pdu.len())].to_vec());
    let long = (shaped.clone(), vec(any::<u8>(), 1..3)).prop_map(|(p, more)| [p, more].concat());
    let noise = vec(any::<u8>(), 1..=253);
    prop_oneof![6 => shaped, 2 => bent, 1 => cut, 1 => long, 1 => noise]
        .prop_map(|mut pdu| {
            pdu.truncate(253);
            pdu
        })
        .boxed()
}

/// What can happen on a line.
#[derive(Clone, Debug)]
enum Event {
    Bytes(Vec<u8>),
    Faulty(u8, u8),
    Pause,
    Silence,
}

/// Stretches of traffic: good frames, spoiled ones, noise.
fn traffic() -> BoxedStrategy<Vec<Event>> {
    let unit = prop_oneof![6 => Just(UNIT), 2 => Just(0), 1 => any::<u8>()];
    let whole = (unit, request())
        .prop_map(|(unit, pdu)| frame(unit, &pdu))
        .boxed();
    let flipped = (whole.clone(), any::<prop::sample::Index>()).prop_map(|(mut bytes, bit)| {
        let bit = bit.index(bytes.len() * 8);
        bytes[bit / 8] ^= 1 << (bit % 8);
        bytes
    });
    let noise = vec(any::<u8>(), 0..300);
    let stretch = prop_oneof![
        5 => whole.clone().prop_map(|bytes| vec![Event::Bytes(bytes)]),
        1 => flipped.prop_map(|bytes| vec![Event::Bytes(bytes)]),
        1 => noise.prop_map(|bytes| vec![Event::Bytes(bytes)]),
        1 => (any::<u8>(), 0_u8..16).prop_map(|(byte, faults)| vec![Event::Faulty(byte, faults)]),
        2 => (whole, any::<prop::sample::Index>()).prop_map(|(bytes, at)| {
            let (a, b) = bytes.split_at(at.index(bytes.len()));
            vec![Event::Bytes(a.to_vec()), Event::Pause, Event::Bytes(b.to_vec())]
        }),
    ];
    let ended = (stretch, prop::bool::weighted(0.8)).prop_map(|(mut events, silence)| {
        events.extend(silence.then_some(Event::Silence));
        events
    });
    vec(ended, 0..12)
        .prop_map(|stretches| stretches.concat())
        .boxed()
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 2000,
        failure_persistence: None,
        ..Default::default()
    })]

    #[test]
    fn requests_are_served_as_by_the_reference(
        start in points(),
        requests in vec(request(), 1..6),
    ) {
        let mut unit = Unit::new(start.clone());
        let mut reference = start;
        for pdu in requests {
            prop_assert_eq!(unit.request(&pdu), serve(&mut reference, &pdu), "{:02X?}", pdu);
            prop_assert_eq!(&unit.points, &reference, "{:02X?}", pdu);
        }
    }

    #[test]
    fn traffic_is_met_as_by_the_reference(
        start in points(),
        strict in any::<bool>(),
        traffic in traffic(),
    ) {
        let mut unit = Unit::with(UNIT, strict, start.clone());
        let mut reference = Reference::new(start, strict);
        for event in traffic {
            match event {
                Event::Bytes(bytes) => {
                    unit.characters(&bytes);
                    bytes.iter().for_each(|byte| reference.character(*byte, false));
                }
                Event::Faulty(byte, faults) => {
                    unit.receiver.character(byte, Faults::from_bits(faults));
                    reference.character(byte, faults != 0);
                }
                Event::Pause => {
                    unit.receiver.t15();
                    reference.pause();
                }
                Event::Silence => prop_assert_eq!(unit.silence(), reference.silence()),
            }
        }
        prop_assert_eq!(unit.silence(), reference.silence());
        prop_assert_eq!(&unit.points, &reference.points);
        let counters = unit.counters();
        prop_assert_eq!(counters.bus_messages, reference.bus_messages);
        prop_assert_eq!(counters.communication_errors, reference.communication_errors);
        prop_assert_eq!(counters.gaps, reference.gaps);
        prop_assert_eq!(counters.busy, 0);
        unit.must_answer();
    }

    #[test]
    fn noise_is_not_answered(noise in vec(vec(any::<u8>(), 0..300), 0..20)) {
        // A chance of 2^-16 apiece is left that noise has a good CRC; the reference would agree.
        let mut unit = Unit::new(Points::new(BITS, WORDS));
        let mut reference = Reference::new(unit.points.clone(), false);
        for bytes in noise {
            bytes.iter().for_each(|byte| reference.character(*byte, false));
            prop_assert_eq!(unit.raw(&bytes), reference.silence());
        }
        unit.must_answer();
    }

    #[test]
    fn words_come_back_as_written(start in 0_u16..7, words in vec(0_u16..0xFFF0, 1..=123)) {
        let mut unit = Unit::new(Points::new(BITS, WORDS));
        let count = words.len() as u16;
        let echo = unit.request(&write_words(start, &words));
        prop_assert_eq!(echo, Some(pdu(0x10, &[start, count])));
        let reply = unit.request(&pdu(0x03, &[start, count])).unwrap();
        prop_assert_eq!(&reply[2..], &write_words(start, &words)[6..]);
    }

    #[test]
    fn bits_come_back_as_written(start in 0_u16..42, bits in vec(any::<bool>(), 1..=1968)) {
        let mut unit = Unit::new(Points::new(BITS, WORDS));
        let count = bits.len() as u16;
        let echo = unit.request(&write_bits(start, &bits));
        prop_assert_eq!(echo, Some(pdu(0x0F, &[start, count])));
        let reply = unit.request(&pdu(0x02, &[start, count])).unwrap();
        prop_assert_eq!(&reply[2..], pack(&bits));
    }
}
