//! Tests of the radio line with a simulated module.

extern crate std;
use core::convert::Infallible;
use std::boxed::Box;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::vec::Vec;

use embedded_hal::digital;
use embedded_hal::digital::{InputPin, PinState};
use embedded_hal_nb::serial::{ErrorKind, ErrorType};
use modbus_server::{Counters, Outcome, Tables, line::Framing};
use modio_drivers::LoraSettings;

use super::*;

const SETTINGS: LoraSettings = match LoraSettings::new(0, 23, 2, 0) {
    Some(settings) => settings,
    None => unreachable!(),
};
const GAP_MS: u16 = 50;
const CONFIG: RadioConfig = RadioConfig {
    module: SETTINGS,
    frame_gap_ms: GAP_MS,
};
/// Unit 17 reads holding register 4, and the reply.
const READ: [u8; 8] = [0x11, 0x03, 0x00, 0x04, 0x00, 0x01, 0xC7, 0x5B];
const REPLY: [u8; 7] = [0x11, 0x03, 0x02, 0x11, 0x11, 0xB5, 0xDB];

/// A module with the right parameters, and the UART.
#[derive(Default)]
struct Module {
    asleep: bool,
    busy: bool,
    silent: bool,
    to_unit: VecDeque<Option<u8>>,
    from_unit: Vec<u8>,
    /// Number of bytes that the UART can take now.
    room: usize,
    unflushed: bool,
}

#[derive(Clone, Default)]
struct Shared(Rc<RefCell<Module>>);

struct Pin(Shared);

impl ErrorType for Shared {
    type Error = ErrorKind;
}

impl Read<u8> for Shared {
    fn read(&mut self) -> nb::Result<u8, ErrorKind> {
        match self.0.borrow_mut().to_unit.pop_front() {
            Some(Some(byte)) => Ok(byte),
            Some(None) => Err(nb::Error::Other(ErrorKind::FrameFormat)),
            None => Err(nb::Error::WouldBlock),
        }
    }
}

impl Write<u8> for Shared {
    fn write(&mut self, byte: u8) -> nb::Result<(), ErrorKind> {
        let mut module = self.0.borrow_mut();
        module.room = module.room.checked_sub(1).ok_or(nb::Error::WouldBlock)?;
        module.from_unit.push(byte);
        if module.asleep && module.from_unit == [0xC1; 3] {
            module.from_unit.clear();
            if !module.silent {
                let reply = core::iter::once(0xC0).chain(*SETTINGS.parameters());
                module.to_unit.extend(reply.map(Some));
            }
        }
        Ok(())
    }

    fn flush(&mut self) -> nb::Result<(), ErrorKind> {
        if self.0.borrow().unflushed {
            Err(nb::Error::WouldBlock)
        } else {
            Ok(())
        }
    }
}

impl digital::ErrorType for Pin {
    type Error = Infallible;
}

impl OutputPin for Pin {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.0.borrow_mut().asleep = false;
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.0.borrow_mut().asleep = true;
        Ok(())
    }
}

impl InputPin for Pin {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        Ok(!self.0.0.borrow().busy)
    }

    fn is_low(&mut self) -> Result<bool, Infallible> {
        Ok(self.0.0.borrow().busy)
    }
}

impl AuxPin for Pin {
    fn pull(&mut self, _: PinState) {}
}

/// Unit 17 with ten registers of value 0x1111.
struct Bench {
    module: Shared,
    line: RadioLine<Shared, Pin, Pin>,
    server: Server,
    registers: [u16; 10],
    now_ms: u32,
}

impl Bench {
    /// A unit whose radio is not set up yet.
    fn starting() -> Self {
        let module = Shared::default();
        module.0.borrow_mut().room = 1000;
        let pin = || Pin(module.clone());
        let adus = Box::leak(Box::new([Adu::new()]));
        let line = RadioLine::new(
            module.clone(),
            [pin(), pin()],
            pin(),
            CONFIG,
            17,
            true,
            adus,
        );
        Self {
            module,
            line,
            server: Server::new(Framing::Rtu),
            registers: [0x1111; 10],
            now_ms: 0,
        }
    }

    /// A unit whose radio is ready and has been silent.
    fn new() -> Self {
        let mut bench = Self::starting();
        while bench.line.works().is_none() {
            bench.pass(1);
        }
        assert_eq!(bench.line.works(), Some(true));
        bench.pass(GAP_MS);
        bench
    }

    /// Lets milliseconds pass and serves requests as they come. Returns the outcome of the last one.
    fn pass(&mut self, ms: u16) -> Option<Outcome> {
        let mut outcome = None;
        for _ in 0..ms {
            self.now_ms += 1;
            if self.line.poll(self.now_ms, 1) {
                outcome = outcome.or(self.serve());
            }
        }
        outcome
    }

    fn serve(&mut self) -> Option<Outcome> {
        let mut tables = Tables {
            holding_registers: &mut self.registers,
            ..Tables::default()
        };
        let request = self.line.take(&self.server, 0)?;
        let decided = request.decide(&self.server, &tables);
        let committed = self.line.answer(decided).commit(&mut self.server);
        let outcome = committed.decision().outcome;
        let done = committed.carry_out(&mut self.server, &mut tables);
        self.line.finish(done);
        Some(outcome)
    }

    fn receive(&mut self, bytes: &[u8]) {
        let bytes = bytes.iter().map(|byte| Some(*byte));
        self.module.0.borrow_mut().to_unit.extend(bytes);
    }

    fn sent(&mut self) -> Vec<u8> {
        core::mem::take(&mut self.module.0.borrow_mut().from_unit)
    }

    fn counters(&self) -> Counters {
        self.server.counters_at(&ServedLine::counters(&self.line))
    }

    #[track_caller]
    fn is_well(&mut self) {
        for _ in 0..3 {
            self.receive(&READ);
            assert_eq!(self.pass(GAP_MS + 1), Some(Outcome::Accepted));
            self.pass(2);
            assert_eq!(self.sent(), REPLY);
            assert!(!self.line.is_replying());
            self.pass(SETTINGS.packet_ms());
            assert!(!self.line.is_on_air());
        }
    }
}

#[test]
fn request_is_answered_after_the_frame_gap() {
    let mut bench = Bench::new();
    bench.receive(&READ);
    assert_eq!(bench.pass(GAP_MS), None);
    assert_eq!(bench.pass(1), Some(Outcome::Accepted));
    bench.pass(2);
    assert_eq!(bench.sent(), REPLY);
    bench.is_well();
    let counters = bench.counters();
    assert_eq!(
        (counters.bus_messages, counters.communication_errors),
        (4, 0)
    );
}

#[test]
fn pauses_below_the_frame_gap_do_not_end_a_frame_and_are_not_counted() {
    let mut bench = Bench::new();
    for part in READ.chunks(3) {
        bench.receive(part);
        assert_eq!(bench.pass(GAP_MS), None);
    }
    assert_eq!(bench.pass(1), Some(Outcome::Accepted));
    assert_eq!(bench.counters().gaps, 0);
}

#[test]
fn pause_of_the_frame_gap_ends_a_frame() {
    let mut bench = Bench::new();
    bench.receive(&READ[..4]);
    bench.pass(GAP_MS + 1);
    bench.receive(&READ[4..]);
    assert_eq!(bench.pass(GAP_MS + 1), None);
    assert_eq!(bench.counters().communication_errors, 2);
    bench.is_well();
}

#[test]
fn silence_is_not_shorter_when_the_task_was_late() {
    let mut bench = Bench::new();
    bench.receive(&READ[..4]);
    bench.pass(1);
    bench.receive(&READ[4..]);
    // Stopped for longer than the frame gap, while the rest of the frame was received.
    bench.now_ms += 60;
    assert!(!bench.line.poll(bench.now_ms, 60));
    assert_eq!(bench.pass(GAP_MS), Some(Outcome::Accepted));
}

#[test]
fn damaged_byte_spoils_its_frame_only() {
    let mut bench = Bench::new();
    bench.receive(&READ[..4]);
    bench.module.0.borrow_mut().to_unit.push_back(None);
    bench.receive(&READ[4..]);
    assert_eq!(bench.pass(GAP_MS + 5), None);
    assert_eq!(bench.counters().communication_errors, 1);
    bench.is_well();
}

#[test]
fn rest_of_a_frame_at_the_start_is_ignored() {
    let mut bench = Bench::starting();
    while bench.line.works().is_none() {
        bench.pass(1);
    }
    bench.receive(&READ);
    assert_eq!(bench.pass(GAP_MS + 1), None);
    assert_eq!(bench.counters(), Counters::default());
    bench.is_well();
}

#[test]
fn reply_waits_while_the_radio_is_busy() {
    let mut bench = Bench::new();
    bench.receive(&READ);
    bench.pass(GAP_MS);
    bench.module.0.borrow_mut().busy = true;
    assert_eq!(bench.pass(1), Some(Outcome::Accepted));
    bench.pass(500);
    assert_eq!(bench.sent(), []);
    assert!(bench.line.is_replying());
    bench.module.0.borrow_mut().busy = false;
    bench.pass(1);
    assert_eq!(bench.sent(), REPLY);
}

#[test]
fn reply_ends_when_the_radio_has_sent_it() {
    let mut bench = Bench::new();
    bench.module.0.borrow_mut().room = 3;
    bench.receive(&READ);
    bench.pass(GAP_MS + 10);
    assert_eq!(
        bench.module.0.borrow().from_unit,
        REPLY[..3],
        "the UART is full"
    );
    bench.module.0.borrow_mut().room = 1000;
    bench.module.0.borrow_mut().unflushed = true;
    bench.pass(1);
    assert_eq!(bench.sent(), REPLY);
    assert!(
        bench.line.is_replying(),
        "bytes are still on their way to the radio"
    );
    bench.module.0.borrow_mut().unflushed = false;
    bench.module.0.borrow_mut().busy = true;
    bench.pass(100);
    assert!(bench.line.is_replying(), "the radio sends");
    bench.module.0.borrow_mut().busy = false;
    bench.now_ms += 1;
    assert!(bench.line.poll(bench.now_ms, 1), "the module has the reply");
    assert!(!bench.line.is_replying());
    assert!(bench.line.is_on_air(), "the last packet");
    for _ in 1..SETTINGS.packet_ms() {
        bench.now_ms += 1;
        assert!(!bench.line.poll(bench.now_ms, 1));
        assert!(bench.line.is_on_air());
    }
    bench.now_ms += 1;
    assert!(bench.line.poll(bench.now_ms, 1), "the reply has been sent");
    assert!(!bench.line.is_on_air());
    bench.is_well();
}

#[test]
fn request_while_the_last_packet_may_be_on_the_air_is_served() {
    let mut bench = Bench::new();
    for _ in 0..3 {
        bench.receive(&READ);
        assert_eq!(bench.pass(GAP_MS + 1), Some(Outcome::Accepted));
        bench.pass(2);
        assert_eq!(bench.sent(), REPLY);
    }
}

#[test]
fn bytes_received_during_a_reply_are_discarded() {
    let mut bench = Bench::new();
    bench.receive(&READ);
    bench.module.0.borrow_mut().unflushed = true;
    bench.pass(GAP_MS + 2);
    bench.receive(&READ);
    bench.pass(10);
    bench.module.0.borrow_mut().unflushed = false;
    assert_eq!(bench.pass(100), None);
    assert_eq!(bench.sent(), REPLY);
    bench.is_well();
}

#[test]
fn broadcast_write_is_done_in_silence() {
    let mut bench = Bench::new();
    bench.receive(&[0x00, 0x06, 0x00, 0x02, 0xAB, 0xCD, 0x97, 0x7E]);
    assert_eq!(bench.pass(GAP_MS + 1), Some(Outcome::Accepted));
    bench.pass(10);
    assert_eq!(bench.registers[2], 0xABCD);
    assert_eq!(bench.sent(), []);
    bench.is_well();
}

#[test]
fn request_for_another_unit_is_ignored() {
    let mut bench = Bench::new();
    bench.receive(&[0x12, 0x03, 0x00, 0x04, 0x00, 0x01, 0xC7, 0x68]);
    assert_eq!(bench.pass(GAP_MS + 10), None);
    assert_eq!(bench.sent(), []);
    assert_eq!(bench.counters().bus_messages, 1);
    bench.is_well();
}

#[test]
fn radio_that_does_not_answer_is_reported_until_it_does() {
    let mut bench = Bench::starting();
    bench.module.0.borrow_mut().silent = true;
    bench.pass(2000);
    assert_eq!(bench.line.works(), Some(false));
    bench.pass(5000);
    assert_eq!(bench.line.works(), Some(false), "another attempt");
    bench.module.0.borrow_mut().silent = false;
    bench.pass(12_000);
    assert_eq!(bench.line.works(), Some(true));
    bench.pass(GAP_MS);
    bench.sent();
    bench.is_well();
}

#[test]
fn reply_is_aborted_when_the_radio_fails_and_later_requests_are_served() {
    for begun in [false, true] {
        let mut bench = Bench::new();
        bench.receive(&READ);
        bench.pass(GAP_MS);
        bench.module.0.borrow_mut().busy = !begun;
        bench.module.0.borrow_mut().unflushed = true;
        bench.pass(2);
        assert_eq!(bench.sent().is_empty(), !begun);
        bench.module.0.borrow_mut().busy = true;
        while bench.line.works() == Some(true) {
            assert!(bench.line.is_replying());
            bench.now_ms += 1;
            let ended = bench.line.poll(bench.now_ms, 1);
            assert_eq!(ended, bench.line.works() == Some(false));
        }
        assert!(!bench.line.is_replying(), "begun: {begun}");
        bench.module.0.borrow_mut().busy = false;
        bench.module.0.borrow_mut().unflushed = false;
        bench.pass(12_000);
        bench.sent();
        bench.is_well();
    }
}
