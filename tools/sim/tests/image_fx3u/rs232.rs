//! The RS-232 socket: a second Modbus line with 9600 8N1.

use register_map::codes::Baud;
use register_map::configuration::{BAUD, BETA, COMMAND, KEY, OPENING_KEY, UNIT};
use register_map::name::UNIT_BY_SERIAL;
use register_map::{second, state};
use sim::Time;
use sim::board::terminals::Value;
use sim::line::{Format, Settings};

use crate::rig::{Rig, START, adu};
use crate::{board, set, unit, words};

/// Unit 1 reads three points, and the reply while X0 to X2 are off.
const READ: [u8; 6] = [1, 2, 0, 0, 0, 3];
const REPLY: [u8; 4] = [1, 2, 1, 0];

/// Sends bytes at the socket without a gap, and returns what the board sends in the next 80 ms.
fn exchange(rig: &mut Rig, bytes: &[u8]) -> Vec<u8> {
    let now = rig.board.now();
    let end = rig.board.rs232().unwrap().send(now, bytes);
    rig.board.run_until(end + Time::from_ms(80));
    let received = rig.board.rs232().unwrap().take_received();
    received.into_iter().map(|byte| byte.byte).collect()
}

/// Sends a request at the socket and returns the reply without its CRC, or nothing. Checks the CRC.
fn ask(rig: &mut Rig, request: &[u8]) -> Vec<u8> {
    let mut reply = exchange(rig, &adu(request));
    if !reply.is_empty() {
        let body = reply[..reply.len() - 2].to_vec();
        assert_eq!(reply, adu(&body));
        reply = body;
    }
    reply
}

fn write(rig: &mut Rig, address: u16, value: u16) {
    let [a, b] = address.to_be_bytes();
    let [c, d] = value.to_be_bytes();
    let request = [1, 6, a, b, c, d];
    assert_eq!(ask(rig, &request), request);
}

/// A master that asks again as soon as it has a reply and a silence has passed.
struct Master {
    request: Vec<u8>,
    reply: Vec<u8>,
    received: Vec<u8>,
    /// The next request begins then; `None` while the reply is missing.
    next: Option<Time>,
    /// End of the last request.
    asked: Time,
    /// Number of requests, and the longest time until a reply was complete.
    count: u16,
    longest: Time,
}

impl Master {
    fn new(request: &[u8], reply: &[u8]) -> Self {
        Self {
            request: adu(request),
            reply: adu(reply),
            received: Vec::new(),
            next: Some(Time::ZERO),
            asked: Time::ZERO,
            count: 0,
            longest: Time::ZERO,
        }
    }

    /// Takes what was received until `now`. Returns the request that must be sent now, if any.
    fn step(&mut self, now: Time, received: impl Iterator<Item = u8>) -> Option<&[u8]> {
        self.received.extend(received);
        if self.next.is_none() && self.received.len() >= self.reply.len() {
            assert_eq!(self.received, self.reply);
            self.received.clear();
            self.longest = self.longest.max(now - self.asked);
            self.next = Some(now + Time::from_ms(4));
        }
        assert!(
            self.next.is_some() || now < self.asked + Time::from_ms(200),
            "request {} got no reply, but {:02X?}",
            self.count,
            self.received
        );
        self.next.take_if(|at| *at <= now)?;
        self.count += 1;
        self.asked = now;
        Some(&self.request)
    }
}

/// Lets a master at each line ask for this time, up to the last reply.
fn poll(rig: &mut Rig, [line, socket]: [&mut Master; 2], time: Time) {
    let end = rig.board.now() + time;
    while rig.board.now() < end || line.next.is_none() || socket.next.is_none() {
        rig.board.run_for(Time::from_us(500));
        let now = rig.board.now();
        let received = rig.board.line().take_received();
        assert!(received.iter().all(sim::line::Received::is_good));
        if let Some(request) = line.step(now, received.iter().map(|byte| byte.byte)) {
            line.asked = rig.board.line().send(now, request);
        }
        let received = rig.board.rs232().unwrap().take_received();
        if let Some(request) = socket.step(now, received.iter().map(|byte| byte.byte)) {
            socket.asked = rig.board.rs232().unwrap().send(now, request);
        }
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn masters_at_both_lines_get_every_reply_and_each_line_has_its_counters() {
    for baud in [Baud::B9600, Baud::B115200, Baud::B921600] {
        let mut rig = unit(&[(BAUD, baud.code())]);
        rig.settings(Settings {
            baud: u32::from(baud.code()) * 100,
            format: Format::N2,
        });
        let mut line = Master::new(&READ, &REPLY);
        let mut socket = Master::new(&[1, 3, 1, 10, 0, 1], &[1, 3, 2, 0, 1]);
        poll(&mut rig, [&mut line, &mut socket], Time::from_secs(2));
        assert!(line.count > 60 && socket.count > 60);
        // The counters of the other line are up to 100 ms old.
        rig.board.run_for(START);
        let read = words(&mut rig, second::BUS_MESSAGES, 9);
        let expected = [socket.count, 0, 0, socket.count, 0, 0, 0, 0, 0];
        assert_eq!(read, expected, "{baud:?}");
        let read = words(&mut rig, state::BUS_MESSAGES, 9);
        let count = line.count + 2;
        assert_eq!(read, [count, 0, 0, count, 0, 0, 0, 0, 0]);
        let [a, b] = second::BUS_MESSAGES.to_be_bytes();
        let [c, d] = (socket.count + 1).to_be_bytes();
        assert_eq!(ask(&mut rig, &[1, 3, a, b, 0, 1]), [1, 3, 2, c, d]);
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn save_while_both_masters_ask_loses_no_reply() {
    let mut rig = unit(&[]);
    let mut line = Master::new(&READ, &REPLY);
    let mut socket = Master::new(&READ, &REPLY);
    // More saves than fit in a page, so that pages are erased.
    for beta in 3000..3020 {
        write(&mut rig, KEY, OPENING_KEY);
        write(&mut rig, BETA, beta);
        write(&mut rig, COMMAND, 1);
        poll(&mut rig, [&mut line, &mut socket], Time::from_ms(300));
    }
    // A reply waits for an erase, for up to 40 ms.
    assert!(socket.longest < Time::from_ms(70), "{}", socket.longest);
    rig.board.cycle();
    rig.board.run_for(Time::from_ms(200));
    let [a, b] = BETA.to_be_bytes();
    let [c, d] = 3019_u16.to_be_bytes();
    assert_eq!(ask(&mut rig, &[1, 3, a, b, 0, 1]), [1, 3, 2, c, d]);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn reply_begins_after_t35() {
    let mut rig = unit(&[]);
    for n in 0..20 {
        let start = rig.board.now() + Time::from_us(137 * n);
        let end = rig.board.rs232().unwrap().send(start, &adu(&READ));
        rig.board.run_until(end + Time::from_ms(30));
        let reply = rig.board.rs232().unwrap().take_received();
        let bytes: Vec<u8> = reply.iter().map(|byte| byte.byte).collect();
        assert_eq!(bytes, adu(&REPLY));
        let silence = reply[0].start - end;
        assert!(silence > Time::from_us(3_646), "{silence}");
        assert!(silence < Time::from_us(5_500), "{silence}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn frames_that_are_t35_apart_are_two_and_a_shorter_pause_ends_none() {
    let mut rig = unit(&[]);
    write(&mut rig, KEY, OPENING_KEY);
    let [a, b] = BETA.to_be_bytes();
    for n in 0..20 {
        // A broadcast, and a request that reads what it has written.
        let start = rig.board.now() + Time::from_us(137 * u64::from(n));
        let port = rig.board.rs232().unwrap();
        let end = port.send(start, &adu(&[0, 6, a, b, 0x0B, 0xB8 + n]));
        let request = adu(&[1, 3, a, b, 0, 1]);
        let end = port.send(end + Time::from_us(3_750), &request[..5]);
        port.send(end + Time::from_us(2_500), &request[5..]);
        rig.board.run_for(Time::from_ms(100));
        let reply = rig.board.rs232().unwrap().take_received();
        let bytes: Vec<u8> = reply.iter().map(|byte| byte.byte).collect();
        assert_eq!(bytes, adu(&[1, 3, 2, 0x0B, 0xB8 + n]));
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn restart_follows_its_whole_reply() {
    let mut rig = unit(&[]);
    rig.tolerant = true;
    for n in 1..=5 {
        write(&mut rig, KEY, OPENING_KEY);
        // Its reply, and no byte of the restart.
        write(&mut rig, COMMAND, 2);
        rig.board.run_for(Time::from_ms(200));
        assert_eq!(rig.board.resets(), n);
        assert_eq!(ask(&mut rig, &READ), REPLY);
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn address_is_that_of_the_rs485_line_also_when_it_changes_and_in_recovery() {
    let mut rig = unit(&[]);
    let serial = words(&mut rig, state::SERIAL_NUMBER, 2);
    let serial: Vec<u8> = serial.into_iter().flat_map(u16::to_be_bytes).collect();
    let [a, b] = UNIT_BY_SERIAL.to_be_bytes();
    rig.exchange(&adu(
        &[&[0xFD, 0x46, 8][..], &serial, &[6, a, b, 0, 42]].concat()
    ));
    assert_eq!(ask(&mut rig, &READ), [0_u8; 0]);
    assert_eq!(ask(&mut rig, &[42, 2, 0, 0, 0, 3]), [42, 2, 1, 0]);
    drop(rig);

    let mut rig = Rig::with(board(&[(UNIT, 9)]));
    rig.tolerant = true;
    assert_eq!(ask(&mut rig, &[9, 2, 0, 0, 0, 3]), [9, 2, 1, 0]);
    for on in [true, false] {
        rig.board.run_for(Time::from_ms(500));
        set(&mut rig, "RUN", Value::Switch(on));
    }
    rig.board.run_for(Time::from_ms(500));
    assert_eq!(ask(&mut rig, &[9, 2, 0, 0, 0, 3]), [0_u8; 0]);
    assert_eq!(ask(&mut rig, &[255, 2, 0, 0, 0, 3]), [255, 2, 1, 0]);
}
