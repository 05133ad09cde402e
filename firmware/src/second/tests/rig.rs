//! The second line of a unit with a simulated module, or with RS-232.

extern crate std;
use core::convert::Infallible;
use std::boxed::Box;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::vec::Vec;

use embedded_hal::digital::{self, InputPin};
use embedded_hal_nb::serial::{ErrorKind, ErrorType};
use modbus_server::{Counters, Outcome, Server, Tables, crc, line::Framing};
use modio_drivers::LoraSettings;

use super::super::*;

pub(super) const SETTINGS: LoraSettings = match LoraSettings::new(0, 23, 2, 0) {
    Some(settings) => settings,
    None => unreachable!(),
};
pub(super) const GAP_MS: u16 = 50;
pub(super) const CONFIG: RadioConfig = RadioConfig {
    module: SETTINGS,
    frame_gap_ms: GAP_MS,
};
/// Unit 17 reads holding register 4, and the reply.
pub(super) const READ: [u8; 8] = [0x11, 0x03, 0x00, 0x04, 0x00, 0x01, 0xC7, 0x5B];
pub(super) const REPLY: [u8; 7] = [0x11, 0x03, 0x02, 0x11, 0x11, 0xB5, 0xDB];

/// Returns a frame: these bytes and their CRC.
pub(super) fn frame(bytes: &[u8]) -> Vec<u8> {
    let crc = bytes
        .iter()
        .fold(crc::START, |crc, byte| crc::step(crc, *byte));
    [bytes, &crc.to_le_bytes()].concat()
}

/// Returns a request for this unit whose end only the frame gap shows; its reply is the same.
pub(super) fn echo() -> Vec<u8> {
    frame(&[0x11, 0x08, 0, 0, 1, 2, 3, 4])
}

/// A module with the right parameters, and the UART.
#[derive(Default)]
pub(super) struct Module {
    pub(super) asleep: bool,
    pub(super) busy: bool,
    pub(super) silent: bool,
    pub(super) to_unit: VecDeque<Option<u8>>,
    pub(super) from_unit: Vec<u8>,
    /// Number of bytes that the UART can take now.
    pub(super) room: usize,
    pub(super) unflushed: bool,
}

#[derive(Clone, Default)]
pub(super) struct Shared(pub(super) Rc<RefCell<Module>>);

/// M0 or M1, or else AUX.
pub(super) struct Pin(pub(super) Shared, bool);

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
        self.0.0.borrow_mut().asleep &= !self.1;
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.0.borrow_mut().asleep |= self.1;
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

/// Unit 17 with ten registers of value 0x1111.
pub(super) struct Rig<P = Lora<Shared, Pin, Pin>> {
    pub(super) module: Shared,
    pub(super) line: SecondLine<P, u8>,
    pub(super) server: Server,
    pub(super) registers: [u16; 10],
    pub(super) now_ms: u32,
}

impl Rig {
    /// A unit whose radio is not set up yet.
    pub(super) fn starting() -> Self {
        let module = Shared::default();
        module.0.borrow_mut().room = 1000;
        let pin = |mode| Pin(module.clone(), mode);
        let adus = Box::leak(Box::new([Adu::new()]));
        let line = SecondLine::radio(
            module.clone(),
            [pin(true), pin(true)],
            pin(false),
            CONFIG,
            17,
            true,
            adus,
        );
        Self::with(module, line)
    }

    /// A unit whose radio is ready and has been silent.
    pub(super) fn new() -> Self {
        let mut rig = Self::starting();
        while rig.line.works().is_none() {
            rig.pass(1);
        }
        assert_eq!(rig.line.works(), Some(true));
        rig.pass(GAP_MS);
        rig
    }

    #[track_caller]
    pub(super) fn is_well(&mut self) {
        for _ in 0..3 {
            self.receive(&READ);
            assert_eq!(self.pass(1), Some(Outcome::Accepted));
            self.pass(2);
            assert_eq!(self.sent(), REPLY);
            assert!(!self.line.is_replying());
            self.pass(SETTINGS.packet_ms());
            assert!(!self.line.is_ending());
        }
    }
}

impl Rig<Rs232<Shared>> {
    /// A unit with RS-232 that has been silent.
    pub(super) fn rs232() -> Self {
        let mut rig = Self::rs232_starting();
        rig.pass(10);
        rig
    }

    /// A unit with RS-232 that has just started.
    pub(super) fn rs232_starting() -> Self {
        let socket = Shared::default();
        socket.0.borrow_mut().room = 1000;
        let adus = Box::leak(Box::new([Adu::new()]));
        let line = SecondLine::rs232(socket.clone(), 17, adus);
        Self::with(socket, line)
    }
}

impl<P: Peer> Rig<P> {
    fn with(module: Shared, line: SecondLine<P, u8>) -> Self {
        Self {
            module,
            line,
            server: Server::new(Framing::Rtu),
            registers: [0x1111; 10],
            now_ms: 0,
        }
    }

    /// Lets milliseconds pass and serves requests as they come. Returns the outcome of the last one.
    pub(super) fn pass(&mut self, ms: u16) -> Option<Outcome> {
        let mut outcome = None;
        for _ in 0..ms {
            self.now_ms += 1;
            if self.line.poll(self.now_ms, 1) {
                outcome = outcome.or(self.serve());
            }
        }
        outcome
    }

    pub(super) fn serve(&mut self) -> Option<Outcome> {
        let mut tables = Tables {
            holding_registers: &mut self.registers,
            ..Tables::default()
        };
        let request = self.line.take()?;
        let reply = self.server.serve(request, &mut tables);
        let outcome = reply.outcome();
        self.line.send_reply(reply);
        Some(outcome)
    }

    pub(super) fn receive(&mut self, bytes: &[u8]) {
        let bytes = bytes.iter().map(|byte| Some(*byte));
        self.module.0.borrow_mut().to_unit.extend(bytes);
    }

    pub(super) fn sent(&mut self) -> Vec<u8> {
        core::mem::take(&mut self.module.0.borrow_mut().from_unit)
    }

    pub(super) fn counters(&self) -> Counters {
        self.server.counters_at(&self.line.counters())
    }
}
