//! Tests of a line with a simulated UART and timer.

extern crate std;
use core::cell::Cell;
use std::boxed::Box;
use std::vec::Vec;

use modbus_server::fast::{self, EventSource, Packet, Waiting};
use modbus_server::line::{Framing, Receiver};
use modbus_server::{Adu, Request, Server, Tables};
use ports::line::{Alarms, Character};

use super::*;

/// A simulated UART: the received bytes and its state.
#[derive(Default)]
struct FakeUart {
    waiting: Option<u8>,
    /// A byte is wanted, or the last one has been sent; each is only reported when it was asked for.
    wants: bool,
    finishing: bool,
    driver: bool,
    /// An interrupt that the line does not use is enabled.
    others: bool,
    sent: Vec<u8>,
}

#[derive(Clone, Copy)]
struct Wants {
    received: bool,
    byte: bool,
    sent: bool,
}

impl Uart for FakeUart {
    type Status = Wants;

    fn status(&self) -> Wants {
        Wants {
            received: self.waiting.is_some(),
            byte: self.wants,
            sent: self.finishing,
        }
    }

    fn received(status: Wants) -> bool {
        status.received
    }

    fn wants_byte(status: Wants) -> bool {
        status.byte
    }

    fn sent(status: Wants) -> bool {
        status.sent
    }

    fn read(&mut self, _: Wants) -> Character {
        let byte = self.waiting.take().unwrap();
        Character { byte, faults: 0 }
    }

    fn start_sending(&mut self, first: u8) {
        self.driver = true;
        self.sent.push(first);
        self.wants = true;
    }

    fn send(&mut self, byte: u8) {
        assert!(self.driver, "a byte was sent while the driver is off");
        self.sent.push(byte);
    }

    fn finish_sending(&mut self) {
        (self.wants, self.finishing) = (false, true);
    }

    fn stop_sending(&mut self) {
        (self.driver, self.finishing) = (false, false);
    }

    fn disable_other_interrupts(&mut self) -> bool {
        core::mem::take(&mut self.others)
    }

    fn driver_is_off(&self) -> bool {
        !self.driver
    }

    fn set_up(&mut self) {
        *self = Self {
            sent: self.sent.clone(),
            ..Self::default()
        };
    }
}

/// A simulated timer; the tests end its silences.
#[derive(Default)]
struct FakeGap {
    running: bool,
    passed: Option<Silence>,
    limited: bool,
    alarms: Alarms,
    /// The time of an arbitration, of its next turn, and of the last falling edge.
    now: u32,
    wake: u32,
    fell: Option<u32>,
    /// The timer stops directly after the next read of its state.
    stops: Cell<bool>,
    stopped: Cell<bool>,
}

impl FakeGap {
    fn look(&self, state: fn(&Self) -> bool) -> bool {
        let seen = state(self);
        if self.stops.take() {
            self.stopped.set(true);
        }
        seen
    }
}

impl GapTimer for FakeGap {
    fn restart(&mut self) {
        self.running = true;
    }

    fn stop(&mut self) {
        self.running = false;
    }

    fn is_running(&self) -> bool {
        self.look(|gap| gap.running && !gap.stopped.get())
    }

    fn is_pending(&self) -> bool {
        self.look(|gap| gap.passed.is_some() || gap.stopped.get())
    }

    fn take_event(&mut self) -> Silence {
        let event = self.passed.take().unwrap_or(Silence::None);
        self.running &= event != Silence::T35;
        event
    }

    fn limit_sending(&mut self) {
        self.limited = true;
    }

    fn take_alarms(&mut self) -> Alarms {
        core::mem::take(&mut self.alarms)
    }

    fn now(&self) -> u32 {
        self.now
    }

    fn fell(&mut self) -> Option<u32> {
        self.fell.take()
    }

    fn end_of(&self, _: u8) -> u32 {
        self.now
    }

    fn wake_at(&mut self, time: u32) -> bool {
        self.wake = time;
        time.wrapping_sub(self.now).cast_signed() > 0
    }

    fn set_up(&mut self) {
        *self = Self::default();
    }
}

/// Unit 17 with ten registers of value 0x1111.
struct Rig {
    line: Line<FakeUart, FakeGap, FastUnit>,
    server: Server,
    registers: [u16; 10],
}

const REQUEST: [u8; 8] = [0x11, 0x03, 0x00, 0x04, 0x00, 0x01, 0xC7, 0x5B];
const REPLY: [u8; 7] = [0x11, 0x03, 0x02, 0x11, 0x11, 0xB5, 0xDB];
const LONGEST_MS: u16 = 20;
const WINDOWS: Windows = Windows {
    start: 1_000,
    start_ms: 0,
    length: 100,
    guard: 10,
};

impl Rig {
    fn new() -> Self {
        let adus = Box::leak(Box::new([Adu::new(), Adu::new()]));
        let units = FastUnit {
            unit: 17,
            is_fast: true,
        };
        let port = Port::new(Receiver::rtu(units, false), adus);
        let (uart, gap) = (FakeUart::default(), FakeGap::default());
        let mut rig = Self {
            line: Line::new(uart, gap, port, WINDOWS, LONGEST_MS),
            server: Server::new(Framing::Rtu),
            registers: [0x1111; 10],
        };
        assert!(
            !rig.silence(Silence::T35),
            "the port is idle after a long silence"
        );
        rig
    }

    fn silence(&mut self, silence: Silence) -> bool {
        self.line.gap.passed = Some(silence);
        self.line.on_gap(0)
    }

    fn receive(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.line.uart.waiting = Some(*byte);
            assert!(!self.line.on_uart(|| 0));
        }
    }

    /// Serves the waiting request; its reply begins.
    fn serve(&mut self) {
        let mut tables = Tables {
            holding_registers: &mut self.registers,
            ..Tables::default()
        };
        let request = self.line.take().expect("a request waits");
        let reply = self.server.serve(request, &mut tables);
        self.line.send(reply, 0);
    }

    /// Runs the UART's interrupts up to the end of the reply.
    fn send(&mut self) {
        for _ in 0..600 {
            if self.line.on_uart(|| 0) {
                return;
            }
        }
        panic!("the reply does not end");
    }

    /// Returns whether the line was set up again in these milliseconds.
    fn pass(&mut self, ms: u16) -> bool {
        (0..ms).fold(false, |repaired, _| {
            repaired | self.line.on_millisecond(true)
        })
    }
}

#[test]
fn request_is_served_with_the_driver_on_from_the_first_byte_to_the_last() {
    let mut rig = Rig::new();
    rig.receive(&REQUEST);
    assert!(!rig.line.uart.driver);
    assert!(!rig.silence(Silence::T15));
    assert!(rig.silence(Silence::T35), "a request waits");
    rig.serve();
    assert!(rig.line.uart.driver && rig.line.gap.limited);
    assert!(
        !rig.line.gap.running,
        "no silence is measured after the unit's own reply"
    );
    rig.send();
    assert_eq!(rig.line.uart.sent, REPLY);
    assert!(!rig.line.uart.driver && !rig.line.is_replying());
    assert!(!rig.pass(100));
}

#[test]
fn timer_that_stopped_in_a_frame_is_started_again() {
    let mut rig = Rig::new();
    rig.receive(&REQUEST[..3]);
    assert!(!rig.pass(3));
    rig.line.gap.running = false;
    assert!(rig.pass(1) && rig.line.gap.running);
    assert!(!rig.pass(3), "a repair is reported once");
}

#[test]
fn timer_that_stops_during_the_check_has_ended_a_frame() {
    let mut rig = Rig::new();
    rig.receive(&REQUEST);
    rig.line.gap.stops.set(true);
    assert!(!rig.pass(1));
}

#[test]
fn driver_that_is_on_without_a_reply_is_switched_off() {
    let mut rig = Rig::new();
    rig.line.uart.driver = true;
    assert!(rig.pass(1) && !rig.line.uart.driver);
}

#[test]
fn event_that_is_pending_for_two_milliseconds_without_its_interrupt_is_a_fault() {
    let mut rig = Rig::new();
    rig.receive(&REQUEST);
    for _ in 0..3 {
        rig.line.gap.passed = Some(Silence::T15);
        assert!(!rig.pass(1), "the interrupt runs between two milliseconds");
        rig.line.on_gap(0);
    }
    rig.line.gap.passed = Some(Silence::T35);
    assert!(!rig.pass(1));
    assert!(rig.pass(1));
    assert!(!rig.pass(3));
}

#[test]
fn reply_that_does_not_end_is_aborted() {
    let mut rig = Rig::new();
    rig.receive(&REQUEST);
    assert!(rig.silence(Silence::T35));
    rig.serve();
    assert!(!rig.pass(LONGEST_MS - 1) && rig.line.uart.driver);
    assert!(rig.pass(1) && !rig.line.uart.driver);

    let mut rig = Rig::new();
    rig.receive(&REQUEST);
    assert!(rig.silence(Silence::T35));
    rig.serve();
    rig.line.on_alarm();
    assert!(rig.line.uart.driver, "the limit has not been reached");
    rig.line.gap.alarms.limit = true;
    rig.line.on_alarm();
    assert!(!rig.line.uart.driver && rig.pass(1));
}

#[test]
fn interrupt_without_a_cause_is_disabled() {
    let mut rig = Rig::new();
    rig.line.uart.others = true;
    rig.receive(&REQUEST[..1]);
    assert!(rig.line.uart.others);
    assert!(!rig.line.on_uart(|| 0));
    assert!(!rig.line.uart.others);
    assert!(rig.pass(1), "it is a repair");
}

/// Continue a scan.
const SCAN: [u8; 5] = [0xFD, 0x46, 2, 0x53, 0x91];

impl Rig {
    /// Receives a request of Fast Modbus to all units, which ends at this time.
    fn receive_scan(&mut self, ended: u32) {
        self.line.gap.now = ended;
        for (n, byte) in SCAN.into_iter().enumerate() {
            self.line.uart.waiting = Some(byte);
            assert_eq!(self.line.on_uart(|| 0), n + 1 == SCAN.len());
        }
    }

    /// Takes part in the arbitration after a request.
    fn serve_scan(&mut self, mut request: Request<'static>) {
        let mut unit = fast::Unit::new(1, 17, fast::Part::Everything);
        assert!(!unit.open(&mut request));
        let (reply, contest) = self.server.serve_fast(request, &mut unit, &mut NoEvents);
        self.line.arbitrate(reply, contest);
    }
}

#[test]
fn unit_that_serves_a_request_too_late_for_its_first_window_is_silent() {
    for (late_ms, takes_part) in [(0, true), (1, true), (2, false), (400, false)] {
        let mut rig = Rig::new();
        rig.receive_scan(0);
        rig.pass(late_ms);
        // The timer has wrapped, and does not show it.
        rig.line.gap.now = 500;
        let request = rig.line.take().expect("a request waits");
        rig.serve_scan(request);
        assert_eq!(rig.line.is_replying(), takes_part, "{late_ms} ms");
    }
}

#[test]
fn request_that_comes_while_another_one_is_served_keeps_its_own_time() {
    let mut rig = Rig::new();
    rig.receive_scan(0);
    let request = rig.line.take().expect("a request waits");
    rig.receive_scan(5_000);
    rig.serve_scan(request);
    assert!(!rig.line.is_replying());
    rig.line.gap.now = 5_300;
    let request = rig.line.take().expect("another request waits");
    rig.serve_scan(request);
    assert!(rig.line.is_replying());
    let first = 5_000 + WINDOWS.start;
    let wake = rig.line.gap.wake;
    assert!((first..=first + WINDOWS.length).contains(&wake), "{wake}");
}

/// A device without events.
struct NoEvents;

impl EventSource for NoEvents {
    fn waiting(&self) -> Waiting {
        Waiting::default()
    }
    fn reports_start(&self) -> bool {
        false
    }
    fn start_is_known(&mut self) {}
    fn fill(&mut self, _: &mut Packet) {}
    fn sent(&mut self) {}
}
