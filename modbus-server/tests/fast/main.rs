//! Fast Modbus on one unit: its messages, with the frames of the extension's document. Its packets of events are in
//! `events`.

#[path = "../common/mod.rs"]
mod common;
mod events;

use common::{Points, crc, frame};
use modbus_server::fast::{self, Contest, EventSource, Kind, Packet, Part, Setting, Waiting};
use modbus_server::line::{Arbitration, FastUnit, Faults, Framing, Port, Receiver, Turn, Windows};
use modbus_server::{
    Adu, Bits, BitsOut, DataModel, Exception, Server, Span, Table, Words, WordsOut,
};

/// The serial number of the extension's examples.
const SERIAL: u32 = 0x0001_EB37;
const ADDRESS: u8 = 5;

/// A device with events, each of which is a discrete input and its value.
struct Device {
    points: Points,
    events: Vec<(u16, u16)>,
    /// Number of events in front that the packet has.
    in_packet: usize,
    is_high: bool,
    has_started: bool,
    set: Vec<(u8, u16, Setting)>,
}

impl EventSource for Device {
    fn waiting(&self) -> Waiting {
        Waiting {
            count: self.events.len() as u8,
            is_high: self.is_high,
        }
    }

    fn reports_start(&self) -> bool {
        self.has_started
    }

    fn start_is_known(&mut self) {
        self.has_started = false;
    }

    fn fill(&mut self, packet: &mut Packet) {
        let mut events = self.events.iter();
        self.in_packet = events
            .position(|(id, value)| !packet.push(Kind::DiscreteInput, *id, *value))
            .unwrap_or(self.events.len());
    }

    fn sent(&mut self) {
        self.events.drain(..self.in_packet);
        self.in_packet = 0;
    }
}

impl DataModel for Device {
    fn check_read_words(&self, table: Table, span: Span) -> Result<(), Exception> {
        self.points.check_read_words(table, span)
    }
    fn check_write_words(&self, span: Span, words: Words<'_>) -> Result<(), Exception> {
        self.points.check_write_words(span, words)
    }
    fn check_read_bits(&self, table: Table, span: Span) -> Result<(), Exception> {
        self.points.check_read_bits(table, span)
    }
    fn check_write_bits(&self, span: Span, bits: Bits<'_>) -> Result<(), Exception> {
        self.points.check_write_bits(span, bits)
    }
    fn read_bits(&self, table: Table, span: Span, out: &mut BitsOut<'_>) {
        self.points.read_bits(table, span, out);
    }
    fn read_words(&self, table: Table, span: Span, out: &mut WordsOut<'_>) {
        self.points.read_words(table, span, out);
    }
    fn write_words(&mut self, span: Span, words: Words<'_>) {
        self.points.write_words(span, words);
    }
    fn check_custom(&self, code: u8, data: &[u8]) -> Result<(), Exception> {
        if code == fast::FUNCTION {
            fast::check_settings(data)
        } else {
            Err(Exception::IllegalFunction)
        }
    }
    fn serve_custom(&mut self, _: u8, adu: &mut Adu) {
        fast::apply_settings(adu, |kind, id, setting| {
            self.set.push((kind, id, setting));
            id != 473 && setting != Setting::Off
        });
    }
}

struct Unit {
    port: Port<'static, FastUnit>,
    server: Server,
    unit: fast::Unit,
    device: Device,
}

/// What a unit does after a request.
#[derive(Debug, PartialEq)]
enum Answer {
    /// Nothing.
    Silence,
    /// A reply, after the windows with these bits.
    After(u32, u8, Vec<u8>),
    /// A usual reply.
    Usual(Vec<u8>),
}

impl Unit {
    fn new(part: Part) -> Self {
        Self::at(ADDRESS, part)
    }

    fn at(address: u8, part: Part) -> Self {
        let units = FastUnit {
            unit: address,
            is_fast: true,
        };
        let adus = Box::leak(Box::new([Adu::new(), Adu::new()]));
        let mut port = Port::new(Receiver::rtu(units, false), adus);
        assert!(!port.long_silence(0));
        Self {
            port,
            server: Server::new(Framing::Rtu),
            unit: fast::Unit::new(SERIAL, address, part),
            device: Device {
                points: Points::new(40, 130),
                events: Vec::new(),
                in_packet: 0,
                is_high: false,
                has_started: true,
                set: Vec::new(),
            },
        }
    }

    /// Receives characters. Returns whether the last one ended a request of Fast Modbus.
    fn characters(&mut self, bytes: &[u8]) -> bool {
        let mut waits = false;
        for byte in bytes {
            assert!(!waits, "a request ended too early");
            waits = self.port.received(*byte, Faults::NONE) && self.port.ends_fast_message(0);
        }
        waits
    }

    /// Receives a request without CRC, and takes part in its arbitration. Returns the answer if there is none.
    fn begin(&mut self, request: &[u8]) -> Option<Answer> {
        let mut waits = self.characters(&with_crc(request));
        if !waits {
            waits = self.port.long_silence(0);
        }
        let Some(mut request) = self.port.take().filter(|_| waits) else {
            return Some(Answer::Silence);
        };
        if request.unit() != fast::ADDRESS {
            let reply = self.server.serve(request, &mut self.device);
            self.port.send(reply, 0);
            return Some(common::send(&mut self.port).map_or(Answer::Silence, Answer::Usual));
        }
        let (reply, contest) = if self.unit.open(&mut request) {
            let mut reply = self.server.serve(request, &mut self.device);
            self.unit.close(&mut reply);
            (reply, Contest::default())
        } else {
            (self.server).serve_fast(request, &mut self.unit, &mut self.device)
        };
        let windows = Windows {
            start: 1_000,
            start_ms: 0,
            length: 100,
            guard: 10,
        };
        let arbitration = Arbitration::new(contest.value, contest.windows, 0, windows);
        self.port.arbitrate(reply, arbitration);
        None
    }

    /// Receives a request without CRC, whose arbitration the unit wins, unless a start bit is seen in window `lost_in`.
    fn ask_losing_in(&mut self, request: &[u8], lost_in: Option<usize>) -> Answer {
        if let Some(answer) = self.begin(request) {
            return answer;
        }
        let mut bits = 0;
        for window in 0.. {
            let Some(deadline) = self.port.deadline() else {
                return Answer::Silence;
            };
            if lost_in == Some(window) {
                self.port.fell(deadline - 5);
            }
            match self.port.turn() {
                Turn::None => bits = bits << 1 | 1,
                Turn::Bit(0xFF) => {
                    bits <<= 1;
                    assert_eq!(self.port.next_byte(), None);
                    self.port.sent();
                }
                Turn::Bit(byte) => panic!("{byte:02X}"),
                Turn::Reply(first) => {
                    let mut reply = vec![first];
                    reply.extend(std::iter::from_fn(|| self.port.next_byte()));
                    self.port.sent();
                    return Answer::After(bits, window as u8, reply);
                }
            }
        }
        unreachable!()
    }

    fn ask(&mut self, request: &[u8]) -> Answer {
        self.ask_losing_in(request, None)
    }

    /// Asks for events with room for 100 bytes, and returns the reply without CRC and its priority bits.
    fn fetch(&mut self, confirmed: u8, flag: u8) -> (u32, Vec<u8>) {
        match self.ask(&[0xFD, 0x46, 0x10, 0, 100, confirmed, flag]) {
            Answer::After(value, 12, reply) => {
                assert_eq!(value & 0xFF, ADDRESS.into());
                (value >> 8, reply[..reply.len() - 2].to_vec())
            }
            other => panic!("{other:02X?}"),
        }
    }
}

fn with_crc(bytes: &[u8]) -> Vec<u8> {
    let mut frame = bytes.to_vec();
    frame.extend(crc(bytes));
    frame
}

fn bytes(text: &str) -> Vec<u8> {
    text.split(' ')
        .map(|byte| u8::from_str_radix(byte, 16).unwrap())
        .collect()
}

#[test]
fn a_scan_finds_a_unit_once() {
    let mut unit = Unit::new(Part::Everything);
    let start = bytes("FD 46 01");
    let Answer::After(value, 32, reply) = unit.ask(&start) else {
        panic!("no reply");
    };
    assert_eq!(
        (value, &reply[..8]),
        (0x6001_EB37, &bytes("FD 46 03 00 01 EB 37 05")[..])
    );
    let none = Answer::After(0xF001_EB37, 32, bytes("FD 46 04 D3 93"));
    assert_eq!(unit.ask(&bytes("FD 46 02")), none);
    assert!(
        matches!(unit.ask(&start), Answer::After(0x6001_EB37, 32, _)),
        "it starts again"
    );
    // A unit that loses was not found.
    assert_eq!(unit.ask_losing_in(&start, Some(1)), Answer::Silence);
    assert!(matches!(
        unit.ask(&bytes("FD 46 02")),
        Answer::After(0x6001_EB37, 32, _)
    ));
    assert_eq!(unit.ask(&bytes("FD 46 02")), none);
}

#[test]
fn frames_of_the_document_have_the_lengths_that_end_them() {
    for request in [
        "FD 46 01 13 90",
        "FD 46 02 53 91",
        "FD 46 08 00 01 EB 37 03 00 C8 00 14 5B 07",
    ] {
        assert!(
            Unit::new(Part::Everything).characters(&bytes(request)),
            "{request}"
        );
    }
    // Replies of other units end without a silence, too; characters of an arbitration may be in front, also damaged.
    for reply in [
        "FD 46 03 00 01 EB 37 0C CE DC",
        "FD 46 04 D3 93",
        "FD 46 12 52 5D",
        "FF FF FF FF FF FF FF FF FF FD 46 03 00 01 EB 37 0C CE DC",
        "FE FF F8 FF FD 46 04 D3 93",
    ] {
        let mut unit = Unit::new(Part::Requests);
        assert_eq!(unit.ask(&bytes("FD 46 01")), Answer::Silence);
        assert!(!unit.characters(&bytes(reply)), "{reply}");
        let counters = *unit.port.counters();
        assert_eq!(
            (counters.bus_messages, counters.communication_errors),
            (2, 0),
            "{reply}"
        );
        // The next request comes before t3.5 has passed.
        assert!(unit.characters(&bytes("FD 46 02 53 91")), "{reply}");
    }
}

#[test]
fn what_is_not_understood_gets_silence_from_all_and_an_exception_from_one() {
    let mut unit = Unit::new(Part::Everything);
    for request in [
        "FD 46",
        "FD 46 05",
        "FD 46 01 00",
        "FD 46 10 00",
        "FD 46 18 00",
        "FD 03 00 00 00 01",
        "FD 60 01",
    ] {
        assert_eq!(unit.ask(&bytes(request)), Answer::Silence, "{request}");
    }
    for (request, exception) in [
        ("05 46 01", 1),
        ("05 46 10 00 64 00 00", 1),
        ("05 46 18", 3),
        ("05 46 18 05 02 00 04 01 03", 3),
        ("05 46 18 04 02 00 04 01 01", 3),
        ("05 46 18 06 02 00 04 03 01 01", 3),
    ] {
        let reply = with_crc(&[5, 0xC6, exception]);
        assert_eq!(unit.ask(&bytes(request)), Answer::Usual(reply), "{request}");
    }
    assert_eq!(unit.device.set, []);
}

#[test]
fn settings_of_the_document_are_answered_with_masks() {
    let mut unit = Unit::new(Part::Everything);
    let request = "05 46 18 15 02 00 04 03 01 00 01 04 01 D0 0A 02 00 02 00 00 00 00 00 00 02";
    let reply = with_crc(&bytes("05 46 18 03 05 05 00"));
    assert_eq!(unit.ask(&bytes(request)), Answer::Usual(reply));
    assert_eq!(unit.device.set.len(), 13);
    assert_eq!(unit.device.set[0], (2, 4, Setting::Low));
    assert_eq!(unit.device.set[5], (4, 466, Setting::High));
}

#[test]
fn requests_reach_a_unit_by_its_serial_number() {
    let mut unit = Unit::new(Part::NoEvents);
    let by_serial = |pdu: &str| format!("FD 46 08 00 01 EB 37 {pdu}");
    let mut ask = |pdu: &str| match unit.ask(&bytes(&by_serial(pdu))) {
        Answer::After(0, 0, reply) => {
            let (reply, sum) = reply.split_at(reply.len() - 2);
            assert_eq!(crc(reply), sum);
            assert_eq!(reply[..7], bytes("FD 46 09 00 01 EB 37"));
            reply[7..].to_vec()
        }
        other => panic!("{other:02X?}"),
    };
    let one = ask("03 00 00 00 01");
    assert_eq!(one[..2], [3, 2]);
    assert_eq!(ask("06 00 00 12 34"), bytes("06 00 00 12 34"));
    assert_eq!(ask("03 00 00 00 01"), bytes("03 02 12 34"));
    assert_eq!(ask("08 00 00 00 00"), [0x88, 1]);
    assert_eq!(ask("46 18 00"), [0xC6, 1]);
    assert_eq!(ask("2A"), [0xAA, 1]);
    // 122 registers fit.
    assert_eq!(ask("03 00 00 00 7A").len(), 246);
    assert_eq!(ask("03 00 00 00 7B"), [0x83, 3]);
    assert_eq!(ask("17 00 00 00 7B 00 00 00 01 02 55 55"), [0x97, 3]);
    assert_eq!(
        ask("03 00 00 00 01"),
        bytes("03 02 12 34"),
        "17 has written nothing"
    );
    assert_eq!(unit.server.counters().unit_messages, 10);
    assert_eq!(
        unit.ask(&bytes("FD 46 08 00 01 EB 38 03 00 00 00 01")),
        Answer::Silence
    );
}

#[test]
fn a_unit_takes_part_only_in_what_it_can() {
    let all = [
        "FD 46 01",
        "FD 46 08 00 01 EB 37 03 00 00 00 01",
        "FD 46 10 00 64 00 00",
    ];
    for (part, takes) in [
        (Part::Everything, [true, true, true]),
        (Part::NoEvents, [true, true, false]),
        (Part::Scans, [true, false, false]),
        (Part::Requests, [false, true, false]),
    ] {
        let answers = all.map(|request| Unit::new(part).ask(&bytes(request)) != Answer::Silence);
        assert_eq!(answers, takes, "{part:?}");
    }
}

#[test]
fn errors_count_again_after_the_silence_behind_a_reply() {
    let mut unit = Unit::new(Part::Requests);
    let noise = [1, 2, 3, 4, 5];
    unit.ask(&bytes("FD 46 01"));
    unit.characters(&noise[..2]);
    // A window of an arbitration in which nobody sends.
    unit.port.short_silence(0);
    unit.characters(&noise[2..]);
    unit.port.long_silence(0);
    unit.characters(&bytes("FD 46 04 D3 93"));
    unit.characters(&noise);
    unit.port.long_silence(0);
    let counters = *unit.port.counters();
    assert_eq!((counters.communication_errors, counters.gaps), (0, 0));
    unit.characters(&noise);
    unit.port.long_silence(0);
    assert_eq!(unit.port.counters().communication_errors, 1);
    let usual = frame(ADDRESS, &[3, 0, 0, 0, 1]);
    unit.characters(&usual);
    assert!(unit.port.long_silence(0));
}

/// Returns the answer of a unit to a write of `value` to register 0, after `before` was received.
fn write_after(unit: &mut Unit, value: [u8; 2]) -> Answer {
    unit.ask(&[ADDRESS, 6, 0, 0, value[0], value[1]])
}

#[test]
fn write_of_4611_after_a_request_to_an_absent_serial_number_is_served() {
    let mut unit = Unit::new(Part::Everything);
    let usual = |value: [u8; 2]| Answer::Usual(with_crc(&[ADDRESS, 6, 0, 0, value[0], value[1]]));
    assert_eq!(write_after(&mut unit, [0x46, 0x11]), usual([0x46, 0x11]));
    // A read of a unit with another serial number, which is not on the line: no reply follows.
    let absent = unit.ask(&bytes("FD 46 08 00 00 00 01 03 00 00 00 01"));
    assert_eq!(absent, Answer::Silence);
    assert!(!unit.port.long_silence(0));
    for attempt in 0..3 {
        assert_eq!(
            write_after(&mut unit, [0x46, 0x11]),
            usual([0x46, 0x11]),
            "attempt {attempt}"
        );
    }
}

#[test]
fn write_of_4611_with_a_gap_in_the_frame_is_served() {
    let mut unit = Unit::new(Part::Everything);
    let frame = with_crc(&[ADDRESS, 6, 0, 0, 0x46, 0x11]);
    unit.characters(&frame[..3]);
    assert!(!unit.port.short_silence(0));
    unit.characters(&frame[3..]);
    assert!(
        unit.port.long_silence(0),
        "gaps are only counted without STRICT_T15"
    );
}
