//! A port and its server: start and end of a reply, and the use of the buffers.

mod common;

use common::{UNIT, send};
use modbus_server::line::{Faults, Framing, Port, Receiver, Width};
use modbus_server::{Adu, Counters, Outcome, Server, Tables};

/// Holding registers at 0 to 9.
#[derive(Default)]
struct Registers([u16; 10]);

impl Registers {
    fn tables(&mut self) -> Tables<'_> {
        Tables {
            holding_registers: &mut self.0,
            ..Tables::default()
        }
    }
}

const READ: [u8; 8] = [0x11, 0x03, 0x00, 0x04, 0x00, 0x01, 0xC7, 0x5B];
const REPLY: [u8; 7] = [0x11, 0x03, 0x02, 0x11, 0x11, 0xB5, 0xDB];
/// A valid frame for another unit: unit 18 reads a register.
const OTHERS: [u8; 8] = [0x12, 0x03, 0x00, 0x04, 0x00, 0x01, 0xC7, 0x68];

struct Unit<'a> {
    port: Port<'a>,
    server: Server,
    registers: Registers,
    now: u32,
}

impl<'a> Unit<'a> {
    fn rtu(adus: &'a mut [Adu]) -> Self {
        let mut unit = Self {
            port: Port::new(Receiver::rtu(UNIT, false), adus),
            server: Server::new(Framing::Rtu),
            registers: Registers([0x1111; 10]),
            now: 0,
        };
        // The port ignores characters until the line has been silent once.
        assert!(!unit.silence());
        unit
    }

    fn receive(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.port.received(*byte, Faults::NONE);
        }
    }

    /// Passes t1.5, then t3.5. Returns whether a request waits.
    fn silence(&mut self) -> bool {
        assert!(!self.port.short_silence(self.now), "RTU frames end at t3.5");
        self.port.long_silence(self.now)
    }

    fn receive_frame(&mut self, bytes: &[u8]) -> bool {
        self.receive(bytes);
        self.silence()
    }

    fn serve(&mut self, delay: u16) -> Option<Outcome> {
        let request = self.port.take()?;
        assert_eq!(request.ended(), self.now);
        let reply = self.server.serve(request, &mut self.registers.tables());
        let outcome = reply.outcome();
        self.port.send(reply, delay);
        Some(outcome)
    }

    /// Returns the bytes of a reply that may start, and ends the reply.
    fn sends(&mut self) -> Vec<u8> {
        send(&mut self.port).unwrap_or_default()
    }

    fn counters(&self) -> Counters {
        self.server.counters_at(self.port.counters())
    }

    /// Checks that the unit answers again, so both its buffers are back and it receives.
    fn is_well(&mut self) {
        for _ in 0..3 {
            assert!(self.receive_frame(&READ));
            assert_eq!(self.serve(0), Some(Outcome::Accepted));
            assert_eq!(self.sends(), REPLY);
            assert!(!self.port.is_replying());
        }
    }
}

#[test]
fn a_request_is_served_and_its_reply_sent() {
    let mut adus = [Adu::new(), Adu::new()];
    let mut unit = Unit::rtu(&mut adus);
    assert_eq!(unit.serve(0), None, "nothing was received");
    assert_eq!(unit.port.start(), None);
    unit.is_well();
}

#[test]
fn port_with_one_buffer_serves_requests_but_none_before_the_end_of_a_reply() {
    let mut adus = [Adu::new()];
    let mut unit = Unit::rtu(&mut adus);
    unit.is_well();
    assert!(unit.receive_frame(&READ));
    assert_eq!(unit.serve(0), Some(Outcome::Accepted));
    assert_eq!(unit.port.start(), Some(UNIT));
    assert!(!unit.receive_frame(&READ), "there is no buffer for it");
    assert_eq!(unit.counters().no_response, 1);
    unit.port.sent();
    unit.is_well();
    let counters = unit.counters();
    assert_eq!((counters.bus_messages, counters.unit_messages), (8, 8));
}

#[test]
fn a_delayed_reply_starts_after_its_ticks() {
    let mut adus = [Adu::new(), Adu::new()];
    let mut unit = Unit::rtu(&mut adus);
    for delay in [1, 2, 7] {
        assert!(unit.receive_frame(&READ));
        unit.serve(delay);
        // The request ended within a tick, so the first tick does not count.
        for _ in 0..delay {
            assert!(!unit.port.tick());
            assert_eq!(unit.port.start(), None);
            assert!(unit.port.is_replying());
        }
        assert!(unit.port.tick());
        assert_eq!(unit.sends(), REPLY);
    }
    unit.is_well();
}

#[test]
fn a_reply_is_dropped_and_counted_when_another_frame_begins_before_it() {
    for frame in [&OTHERS[..], &OTHERS[..3]] {
        for (step, delay) in [(0, 0), (1, 0), (2, 2)] {
            let mut adus = [Adu::new(), Adu::new()];
            let mut unit = Unit::rtu(&mut adus);
            assert!(unit.receive_frame(&READ));
            // The frame is received before the request is taken, before its reply is sent, or during the delay.
            let receive = |unit: &mut Unit<'_>, now: bool| {
                if now {
                    unit.receive(frame);
                    if frame.len() == OTHERS.len() {
                        assert!(!unit.silence());
                    }
                }
            };
            receive(&mut unit, step == 0);
            let request = unit.port.take().expect("a request waits");
            receive(&mut unit, step == 1);
            let reply = unit.server.serve(request, &mut unit.registers.tables());
            unit.port.send(reply, delay);
            receive(&mut unit, step == 2);
            (0..5).for_each(|_| _ = unit.port.tick());
            assert_eq!(unit.port.start(), None);
            assert!(!unit.port.is_replying());
            let counters = unit.counters();
            assert_eq!((counters.unit_messages, counters.no_response), (1, 1));
            unit.silence();
            unit.is_well();
        }
    }
}

#[test]
fn a_new_request_drops_the_delayed_reply_before_it() {
    let mut adus = [Adu::new(), Adu::new()];
    let mut unit = Unit::rtu(&mut adus);
    assert!(unit.receive_frame(&READ));
    unit.serve(5);
    assert!(unit.port.is_replying());
    assert!(unit.receive_frame(&READ));
    assert!(!unit.port.is_replying(), "that reply is not sent");
    unit.serve(0);
    assert_eq!(unit.sends(), REPLY);
    assert_eq!(unit.counters().no_response, 1);
    unit.is_well();
}

#[test]
fn no_buffer_is_lost_when_a_second_request_is_taken_before_the_first_reply_is_sent() {
    let mut adus = [Adu::new(), Adu::new()];
    let mut unit = Unit::rtu(&mut adus);
    let served = [(); 2].map(|()| {
        assert!(unit.receive_frame(&READ));
        let request = unit.port.take().expect("a request waits");
        unit.server.serve(request, &mut unit.registers.tables())
    });
    for reply in served {
        unit.port.send(reply, 0);
    }
    assert_eq!(unit.sends(), REPLY);
    assert_eq!(unit.counters().no_response, 1);
    unit.is_well();
}

#[test]
fn a_request_that_was_not_taken_is_dropped_for_the_next() {
    let mut adus = [Adu::new(), Adu::new()];
    let mut unit = Unit::rtu(&mut adus);
    assert!(unit.receive_frame(&READ));
    assert!(unit.receive_frame(&READ));
    assert_eq!(unit.serve(0), Some(Outcome::Accepted));
    assert_eq!(unit.sends(), REPLY);
    assert_eq!(unit.serve(0), None, "the first one was dropped");
    assert_eq!(unit.port.counters().dropped, 1);
    assert_eq!(unit.counters().no_response, 1);
    unit.is_well();
}

#[test]
fn an_aborted_reply_gives_its_buffer_back() {
    for sent in 0..REPLY.len() {
        let mut adus = [Adu::new(), Adu::new()];
        let mut unit = Unit::rtu(&mut adus);
        assert!(unit.receive_frame(&READ));
        unit.serve(0);
        assert_eq!(unit.port.start(), Some(UNIT));
        for byte in &REPLY[1..=sent.min(REPLY.len() - 1)] {
            assert_eq!(unit.port.next_byte(), Some(*byte));
        }
        unit.port.sent();
        assert!(!unit.port.is_replying());
        unit.is_well();
    }
}

#[test]
fn a_request_without_reply_starts_no_reply() {
    let mut adus = [Adu::new(), Adu::new()];
    let mut unit = Unit::rtu(&mut adus);
    assert!(!unit.receive_frame(&OTHERS));
    // A broadcast writes 7 to register 4.
    assert!(unit.receive_frame(&[0x00, 0x06, 0x00, 0x04, 0x00, 0x07, 0x88, 0x18]));
    assert_eq!(unit.serve(0), Some(Outcome::Accepted));
    assert_eq!(unit.port.start(), None);
    assert!(!unit.port.is_replying());
    assert_eq!(unit.registers.0[4], 7);
    unit.registers.0[4] = 0x1111;
    unit.is_well();
}

/// An ASCII line: its frames end with a character, and the short silence is t3.5.
#[test]
fn an_ascii_request_is_served_at_the_short_silence_and_too_late_at_the_long_one() {
    let mut adus = [Adu::new(), Adu::new()];
    let mut port = Port::new(Receiver::ascii(UNIT, Width::Eight), &mut adus);
    let mut server = Server::new(Framing::ASCII);
    let mut registers = Registers([0x1111; 10]);
    for round in 0..3 {
        for late in [false, true] {
            for byte in b":110300040001E7\r\n" {
                assert!(!port.short_silence(0), "the frame is not complete");
                port.received(*byte, Faults::NONE);
            }
            if late {
                assert!(!port.long_silence(0));
                assert!(port.take().is_none());
                assert_eq!(port.counters().dropped, round + 1);
                continue;
            }
            assert!(port.short_silence(0));
            let request = port.take().expect("a request waits");
            port.send(server.serve(request, &mut registers.tables()), 0);
            let sent = send(&mut port).expect("the request is answered");
            assert_eq!(sent, b":1103021111C8\r\n");
        }
    }
}
