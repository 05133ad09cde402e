//! Properties for any input: no panic, no answer to anything but a valid request to this unit, the same answers as
//! a simple second server, and an answer to the next valid request.

mod common;

use common::{
    Device, Points, UNIT, Unit, delimiter, framed, pdu, read_files, write_bits, write_files,
    write_then_read, write_words,
};
use modbus_reference::Server;
use modbus_server::line::{Faults, Framing, Width};
use proptest::collection::vec;
use proptest::prelude::*;

/// More bits than one request may write, more words than one request may read, and an end that tests can reach.
const BITS: usize = 2010;
const WORDS: usize = 130;

/// A user-defined function of the device.
const CUSTOM: u8 = 0x41;

/// Exceptions for states of the device that prevent an otherwise valid request.
const STATES: &[u8] = &[4, 5, 6, 7, 8, 0x0A, 0x0B];

/// Returns four tables of different lengths, each about as long as one request may access.
fn points() -> impl Strategy<Value = Device> {
    let bits = (vec(any::<bool>(), BITS), vec(any::<bool>(), BITS - 5));
    let words = (vec(any::<u16>(), WORDS), vec(any::<u16>(), WORDS - 3));
    let files = prop_oneof![1 => Just(Vec::new()), 3 => vec(vec(any::<u16>(), 0..150), 1..4)];
    let lacks = prop_oneof![3 => Just(Vec::new()), 1 => vec(1_u8..=0x2B, 1..20)];
    (
        bits,
        words,
        files,
        100_u32..140,
        prop::option::weighted(0.2, prop::sample::select(STATES)),
        lacks,
    )
        .prop_map(
            |(bits, words, files, read_only_from, state, lacks)| Device {
                bits: bits.0,
                input_bits: bits.1,
                words: words.0,
                input_words: words.1,
                files,
                read_only_from,
                state,
                lacks,
                additional_data: vec![0xA5; usize::from(read_only_from as u8 % 4)],
                custom: Some(CUSTOM),
                ..Device::new(0, 0)
            },
        )
}

/// Returns an address that exists, the end of the points, or the end of all addresses.
fn address() -> impl Strategy<Value = u16> {
    prop_oneof![
        4 => 0_u16..30,
        2 => 90_u16..145,
        1 => 2000_u16..2015,
        1 => 0xFF80_u16..,
        1 => any::<u16>(),
    ]
}

/// Returns a quantity, mostly near one of the limits.
fn quantity() -> impl Strategy<Value = u16> {
    prop_oneof![
        4 => 0_u16..20,
        2 => 120_u16..128,
        1 => 1960_u16..1972,
        1 => 1995_u16..2003,
        1 => any::<u16>(),
    ]
}

/// Returns request PDUs, most of them valid or nearly valid.
fn request() -> BoxedStrategy<Vec<u8>> {
    let single = prop_oneof![Just(0xFF00_u16), Just(0), any::<u16>(), 0xFFE0_u16..];
    let read = (1_u8..=4, address(), quantity()).prop_map(|(f, a, q)| pdu(f, &[a, q]));
    let write = (5_u8..=6, address(), single).prop_map(|(f, a, v)| pdu(f, &[a, v]));
    let bits = (address(), vec(any::<bool>(), 0..40)).prop_map(|(a, b)| write_bits(a, &b));
    let words = (address(), vec(0_u16..0xFFF8, 0..124)).prop_map(|(a, w)| write_words(a, &w));
    let many = (0_u16..30, vec(any::<bool>(), 1950..1968)).prop_map(|(a, b)| write_bits(a, &b));
    let mask = (address(), any::<u16>(), any::<u16>()).prop_map(|(a, b, c)| pdu(0x16, &[a, b, c]));
    let both = (address(), quantity(), address(), vec(0_u16..0xFFF8, 0..122))
        .prop_map(|(a, q, b, w)| write_then_read(a, q, b, &w));
    let alone = prop::sample::select(&[0x07, 0x0B, 0x0C, 0x11][..]).prop_map(|f| vec![f]);
    let data = prop_oneof![4 => Just(0_u16), 1 => Just(0xFF00), 1 => 0x2000_u16..0x4000, 1 => any::<u16>()];
    let diagnose = (0_u16..0x17, data).prop_map(|(sub, data)| pdu(0x08, &[sub, data]));
    let echo = vec(any::<u8>(), 0..250).prop_map(|data| [&[0x08, 0, 0][..], &data].concat());
    let group = (0_u16..5, address(), quantity());
    let read_file = vec(group, 0..5).prop_map(|groups| read_files(&groups));
    let one_word = (0_u16..4, 0_u16..90, Just(1_u16));
    let read_records = vec(one_word, 30..=35).prop_map(|groups| read_files(&groups));
    let group = (0_u16..5, address(), vec(0_u16..0xFFF8, 0..60));
    let write_file = vec(group, 0..5).prop_map(|groups| write_files(&groups));
    let object = prop_oneof![0_u8..9, 0x7E_u8..0x88];
    let identify = (0_u8..6, object).prop_map(|(code, id)| vec![0x2B, 0x0E, code, id]);
    let custom = vec(any::<u8>(), 0..100).prop_map(|data| [&[CUSTOM][..], &data].concat());
    let shaped = prop_oneof![
        3 => read, 2 => write, 2 => bits, 2 => words, 1 => many, 1 => mask, 2 => both,
        2 => read_file, 1 => read_records, 2 => write_file,
        2 => alone, 4 => diagnose, 1 => echo, 2 => identify, 1 => custom,
    ]
    .boxed();
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

/// An event on a line.
#[derive(Clone, Debug)]
enum Event {
    Bytes(Vec<u8>),
    Faulty(u8, u8),
    Pause,
    Silence,
}

/// Returns sequences of traffic: valid frames, damaged frames, noise.
fn traffic(framing: Framing) -> BoxedStrategy<Vec<Event>> {
    let unit = prop_oneof![6 => Just(UNIT), 2 => Just(0), 1 => any::<u8>()];
    let whole = (unit, request())
        .prop_map(move |(unit, pdu)| framed(delimiter(framing), unit, &pdu))
        .boxed();
    let flipped = (whole.clone(), any::<prop::sample::Index>()).prop_map(|(mut bytes, bit)| {
        let bit = bit.index(bytes.len() * 8);
        bytes[bit / 8] ^= 1 << (bit % 8);
        bytes
    });
    let likely = prop::sample::select(&b":0123456789ABCDEF\r\n#af"[..]);
    let noise = vec(prop_oneof![1 => any::<u8>(), 2 => likely], 0..600);
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

fn unit_and_framing(ascii: bool, strict: bool, device: Device) -> (Unit, Option<u8>) {
    let points = Points(device);
    if ascii {
        (Unit::ascii(Width::Eight, points), Some(b'\n'))
    } else {
        (Unit::with(UNIT, strict, points), None)
    }
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
        ascii in any::<bool>(),
        requests in vec((prop::bool::weighted(0.1), request()), 1..12),
    ) {
        let (mut unit, end) = unit_and_framing(ascii, false, start.clone());
        let mut reference = Server::new(end, start);
        for (broadcast, pdu) in requests {
            let to = if broadcast { 0 } else { UNIT };
            let reply = unit.raw(&framed(reference.delimiter, to, &pdu));
            prop_assert_eq!(reply, reference.good(to, &pdu, false), "{:02X?}", pdu);
            prop_assert_eq!(&unit.points.0, &reference.device, "{:02X?}", pdu);
            prop_assert_eq!(delimiter(unit.server.framing()), reference.delimiter);
            prop_assert_eq!(unit.server.is_listen_only(), reference.listening);
            if !reference.listening {
                prop_assert_eq!(unit.counters().as_words(), reference.counters);
            }
        }
    }

    #[test]
    fn traffic_is_handled_as_by_the_reference(
        start in points(),
        strict in any::<bool>(),
        (ascii, traffic) in any::<bool>().prop_flat_map(|ascii| {
            let framing = if ascii { Framing::ASCII } else { Framing::Rtu };
            (Just(ascii), traffic(framing))
        }),
    ) {
        let (mut unit, end) = unit_and_framing(ascii, strict, start.clone());
        let mut reference = modbus_reference::Unit::new(end, start, strict);
        let mut replies = (Vec::new(), Vec::new());
        for event in traffic {
            match event {
                Event::Bytes(bytes) => {
                    for byte in bytes {
                        unit.character(byte, Faults::NONE);
                        replies.0.extend(unit.take_said());
                        replies.1.extend(reference.character(byte, 0));
                    }
                }
                Event::Faulty(byte, faults) => {
                    unit.character(byte, Faults::from_bits(faults));
                    replies.0.extend(unit.take_said());
                    replies.1.extend(reference.character(byte, faults));
                }
                Event::Pause => {
                    unit.port.short_silence(0);
                    reference.pause();
                }
                Event::Silence => {
                    replies.0.extend(unit.silence());
                    replies.1.extend(reference.silence());
                }
            }
            prop_assert_eq!(&replies.0, &replies.1);
        }
        prop_assert_eq!(unit.silence(), reference.silence());
        prop_assert_eq!(&unit.points.0, &reference.server.device);
        // Send one more request, because counters are copied with requests, and a restart, because a unit in
        // listen-only mode answers nothing else. The log contains everything that happened before.
        let mut last = vec![vec![0x0C]];
        if reference.server.listening {
            last.insert(0, vec![0x08, 0x00, 0x01, 0x00, 0x00]);
        }
        for pdu in last {
            let reply = unit.raw(&framed(reference.server.delimiter, UNIT, &pdu));
            prop_assert_eq!(reply, reference.server.good(UNIT, &pdu, false));
            prop_assert_eq!(unit.counters().as_words(), reference.server.counters);
        }
        unit.points.state = None;
        unit.points.lacks.clear();
        unit.must_answer();
    }
}
