//! Target `fast`: function 70 on a whole device: frames of any content and in any order, arbitrations that any start bit
//! ends, inputs that change.
//!
//! What must hold: a reply fits its frame; an arbitration ends; and in the end the unit is found by a scan, reports its
//! events, and answers two plain requests, so that no buffer is lost.
//!
//! ```text
//!   event: tag, then
//!     0 a frame               unit (0: this one, 1: all, 2: function 70), length, PDU
//!     1 characters            length, characters
//!     2 a faulty character    character, faults
//!     3 t1.5   4 t3.5   5 inputs change   number, value
//!     6 a turn of the arbitration; tag & 8: after a start bit
//!     7 the waiting request is served
//! ```

use std::mem::MaybeUninit;

use firmware::config::{Config, LineName, Origin, Settings};
use firmware::device::{Device, Identity};
use modbus_reference::framed;
use modbus_server::fast::{self, Part};
use modbus_server::line::{Arbitration, FastUnit, Faults, Framing, Port, Receiver, Turn, Windows};
use modbus_server::{Adu, Server};
use register_map::{Module, configuration};

use crate::B;
use crate::script::Script;

const UNIT: u8 = 5;
const SERIAL: u32 = 0x0D00_1234;
const MODULES: [Module; 4] = [Module::Di4, Module::Do4, Module::Ai4, Module::Ao4];
/// An arbitration without a guard: every start bit since the last turn counts.
const WINDOWS: Windows = Windows {
    start: 1 << 16,
    start_ms: 0,
    length: 100 << 16,
    guard: 0,
};

/// A unit with its end of the line.
struct Unit<'a> {
    device: &'a mut Device<B>,
    server: Server,
    fast: fast::Unit,
    port: Port<'a, FastUnit>,
    waits: bool,
}

/// Target `fast`.
pub fn run(input: &[u8]) {
    let modules = configuration::modules((1_u16..).zip(MODULES));
    let (settings, _) = Settings::load(modules);
    let config = Config::new(settings, false);
    let identity = Identity {
        unit: UNIT,
        serial_number: SERIAL,
        reports_events: true,
        ..Identity::default()
    };
    let mut place = MaybeUninit::uninit();
    let mut adus = [Adu::new(), Adu::new()];
    let units = FastUnit {
        unit: UNIT,
        is_fast: true,
    };
    let mut unit = Unit {
        device: Device::new_in(&mut place, config, identity),
        server: Server::new(Framing::Rtu),
        fast: fast::Unit::new(SERIAL, UNIT, Part::Everything),
        port: Port::new(Receiver::rtu(units, false), &mut adus),
        waits: false,
    };
    let mut script = Script::new(input);
    while let Some(tag) = script.tag() {
        unit.event(tag, &mut script);
    }
    unit.must_work();
}

impl Unit<'_> {
    fn event(&mut self, tag: u8, script: &mut Script<'_>) {
        match tag & 7 {
            0 => {
                let unit = match script.byte() {
                    0 => UNIT,
                    1 => 0,
                    2 => fast::ADDRESS,
                    unit => unit,
                };
                let pdu = script.string();
                self.characters(&framed(None, unit, &pdu[..pdu.len().min(253)]));
            }
            1 => self.characters(script.string()),
            2 => {
                let (byte, faults) = (script.byte(), script.byte() & 15);
                self.character(byte, Faults::from_bits(faults));
            }
            3 => self.waits |= self.port.short_silence(0),
            4 => self.silence(),
            5 => self.change(script.byte(), script.half()),
            6 => {
                let _ = self.turn(tag & 8 != 0);
            }
            _ => {
                let _ = self.serve();
            }
        }
    }

    fn characters(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.character(*byte, Faults::NONE);
        }
    }

    fn character(&mut self, byte: u8, faults: Faults) {
        self.waits |= self.port.received(byte, faults) && self.port.ends_fast_message(0);
    }

    fn silence(&mut self) {
        self.waits |= self.port.long_silence(0);
    }

    fn change(&mut self, number: u8, value: u16) {
        self.device.tick(u32::from(value >> 8));
        let slot = usize::from(number >> 2 & 3);
        let mut channels = *self.device.points.ports()[slot].channels();
        channels.set_bit(usize::from(number & 3), value & 1 != 0);
        channels.set_word(usize::from(number & 3), value & 0xFFF);
        self.device.scanned(
            slot,
            &channels,
            &[None; 4],
            true,
            if number & 16 == 0 { 1 } else { 40 },
        );
        (0..4).for_each(|slot| self.device.run_links(slot));
    }

    /// Takes the unit's turn in its arbitration. Returns the reply, if it has won.
    fn turn(&mut self, start_bit: bool) -> Option<Vec<u8>> {
        let deadline = self.port.deadline()?;
        if start_bit {
            self.port.fell(deadline);
        }
        match self.port.turn() {
            Turn::None => None,
            Turn::Bit(byte) => {
                assert_eq!((byte, self.port.next_byte()), (0xFF, None));
                self.port.sent();
                None
            }
            Turn::Reply(first) => Some(self.rest(first)),
        }
    }

    /// Serves the request that waits. Returns the reply to one to the unit's own address.
    fn serve(&mut self) -> Option<Vec<u8>> {
        self.waits = false;
        let mut request = self.port.take()?;
        let to_all = request.unit() == fast::ADDRESS;
        let by_serial = to_all && self.fast.open(&mut request);
        self.device.set_origin(Origin {
            line: LineName::Rs485,
            broadcast: !by_serial && request.unit() == 0,
            by_serial,
        });
        if to_all {
            let (reply, contest) = if by_serial {
                let mut reply = self.server.serve(request, self.device);
                self.fast.close(&mut reply);
                (reply, Default::default())
            } else {
                self.server.serve_fast(request, &mut self.fast, self.device)
            };
            let arbitration = Arbitration::new(contest.value, contest.windows, 0, WINDOWS);
            self.port.arbitrate(reply, arbitration);
            return None;
        }
        let reply = self.server.serve(request, self.device);
        self.port.send(reply, 0);
        let first = self.port.start()?;
        Some(self.rest(first))
    }

    /// Returns the whole reply.
    fn rest(&mut self, first: u8) -> Vec<u8> {
        let mut reply = vec![first];
        reply.extend(std::iter::from_fn(|| self.port.next_byte()));
        self.port.sent();
        assert!((5..=256).contains(&reply.len()), "{reply:02X?}");
        let (body, _) = reply.split_at(reply.len() - 2);
        assert_eq!(framed(None, body[0], &body[1..]), reply);
        reply
    }

    /// Sends a request after a silence, and returns its reply. The unit wins its arbitration.
    fn ask(&mut self, unit: u8, pdu: &[u8]) -> Option<Vec<u8>> {
        self.silence();
        if self.waits {
            let _ = self.serve();
        }
        self.port.withdraw();
        self.characters(&framed(None, unit, pdu));
        if !self.waits {
            self.silence();
        }
        assert!(self.waits, "the request was not received");
        if let Some(reply) = self.serve() {
            return Some(reply);
        }
        for _ in 0..=32 {
            if let Some(reply) = self.turn(false) {
                return Some(reply);
            }
        }
        assert_eq!(self.port.deadline(), None, "the arbitration does not end");
        None
    }

    /// Whatever has happened, the unit works after this.
    fn must_work(&mut self) {
        // Function 08 sub-function 01 ends listen-only mode, without a reply.
        self.ask(UNIT, &[8, 0, 1, 0, 0]);
        let [serial @ .., _, _] = &self.ask(fast::ADDRESS, &[0x46, 1]).expect("it is found")[3..]
        else {
            panic!("too short");
        };
        assert_eq!(serial, [&SERIAL.to_be_bytes()[..], &[UNIT]].concat());
        for _ in 0..2 {
            let packet = self.ask(fast::ADDRESS, &[0x46, 0x10, 0, 100, 0, 0]);
            assert!(packet.expect("a packet").len() > 4);
            let read = self.ask(UNIT, &[2, 0, 0, 0, 4]).expect("a reply");
            assert_eq!(read[..3], [UNIT, 2, 1]);
        }
    }
}
