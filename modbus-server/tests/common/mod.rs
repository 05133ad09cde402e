//! Shared by the tests: a unit made of the crate's parts, driven in the same way as in a device.

#![allow(dead_code)] // each test file uses its own part of it

mod points;

#[allow(unused_imports)] // as above
pub use modbus_reference::{
    Device, MAX_WORD, UNIT, answer, ascii_frame, crc, frame, framed, lrc, object, pack, pdu,
    read_files, unframed, write_bits, write_files, write_then_read, write_words,
};
use modbus_server::line::{Faults, Framing, Port, Receiver, Units, Width};
use modbus_server::{Adu, Counters, DataModel, Server};
#[allow(unused_imports)] // as above
pub use points::Points;

/// Returns the end mark of frames in ASCII mode, as the reference takes it.
pub fn delimiter(framing: Framing) -> Option<u8> {
    match framing {
        Framing::Rtu => None,
        Framing::Ascii { delimiter } => Some(delimiter),
    }
}

/// A unit on a line: port, server and data model.
pub struct UnitOn<'a, M = Points> {
    pub port: Port<'a>,
    pub server: Server,
    pub points: M,
    /// The reply to an ASCII frame that has ended.
    said: Option<Vec<u8>>,
}

/// A unit whose buffers are never freed.
pub type Unit<M = Points> = UnitOn<'static, M>;

/// Returns a port whose buffers are never freed.
pub fn port(receiver: Receiver<'static>) -> Port<'static> {
    Port::new(receiver, Box::leak(Box::new([Adu::new(), Adu::new()])))
}

impl Unit {
    /// Creates an RTU unit.
    pub fn new(points: Points) -> Self {
        Self::with(UNIT, false, points)
    }

    pub fn with(unit: u8, strict_t15: bool, points: Points) -> Self {
        Self::of(Receiver::rtu(unit, strict_t15), Framing::Rtu, points)
    }

    pub fn ascii(width: Width, points: Points) -> Self {
        Self::of(Receiver::ascii(UNIT, width), Framing::ASCII, points)
    }

    fn of(receiver: Receiver<'static>, framing: Framing, points: Points) -> Self {
        Self::on(port(receiver), framing, points)
    }

    /// Sends a request that must be rejected and returns the exception code.
    pub fn refused(&mut self, pdu: &[u8]) -> u8 {
        let points = self.points.clone();
        let reply = self.request(pdu).expect("a reply");
        assert_eq!(reply.len(), 2, "{reply:02X?} to {pdu:02X?}");
        assert_eq!(reply[0], pdu[0] | 0x80);
        assert_eq!(self.points, points, "a rejected request changes nothing");
        reply[1]
    }
}

impl<M: DataModel> Unit<M> {
    /// Creates a unit with this data model.
    pub fn over(receiver: Receiver<'static>, framing: Framing, points: M) -> Self {
        Self::on(port(receiver), framing, points)
    }
}

impl<'a, M: DataModel> UnitOn<'a, M> {
    /// Creates a unit on this port, after the first silence.
    pub fn on(mut port: Port<'a>, framing: Framing, points: M) -> Self {
        assert!(!port.long_silence(0));
        Self {
            port,
            server: Server::new(framing),
            points,
            said: None,
        }
    }

    /// Receives one character. An ASCII frame that it ends is served.
    pub fn character(&mut self, byte: u8, faults: Faults) {
        self.port.received(byte, faults);
        if self.server.framing() != Framing::Rtu && self.port.short_silence(0) {
            self.said = self.serve();
        }
    }

    /// Receives characters without faults.
    pub fn characters(&mut self, bytes: &[u8]) {
        bytes
            .iter()
            .for_each(|byte| self.character(*byte, Faults::NONE));
    }

    /// Passes a silence of 1.5 characters on an RTU line.
    pub fn pause(&mut self) {
        assert!(!self.port.short_silence(0));
    }

    /// Passes a silence of 3.5 characters, or in ASCII mode of a second. Returns the reply to the frame before it,
    /// as it is sent on the line.
    pub fn silence(&mut self) -> Option<Vec<u8>> {
        self.pause();
        match self.said.take() {
            Some(said) => Some(said),
            None if self.port.long_silence(0) => self.serve(),
            None => None,
        }
    }

    /// Returns the reply to an ASCII frame that the last character has ended.
    pub fn take_said(&mut self) -> Option<Vec<u8>> {
        self.said.take()
    }

    /// Serves the waiting request and returns the reply as it is sent.
    fn serve(&mut self) -> Option<Vec<u8>> {
        let waiting = self.port.waiting();
        let request = self.port.take().expect("a request waits");
        assert_eq!(waiting, Some(request.unit()));
        let reply = self.server.serve(request, &mut self.points);
        let answers = reply.is_answered();
        self.port.send(reply, 0);
        let sent = send(&mut self.port);
        assert_eq!(sent.is_some(), answers);
        assert!(!self.port.is_replying());
        sent
    }

    /// Receives a whole frame including its CRC or LRC. Returns the reply, if any.
    pub fn raw(&mut self, bytes: &[u8]) -> Option<Vec<u8>> {
        self.characters(bytes);
        self.silence()
    }

    /// Receives a request to this unit. Checks the frame of the reply and returns its PDU.
    pub fn request(&mut self, pdu: &[u8]) -> Option<Vec<u8>> {
        let delimiter = delimiter(self.server.framing());
        let reply = self.raw(&framed(delimiter, UNIT, pdu))?;
        let [unit, pdu @ ..] = &unframed(delimiter, &reply)[..] else {
            panic!("an empty reply");
        };
        assert_eq!(*unit, UNIT);
        assert!(pdu.len() <= 253);
        Some(pdu.to_vec())
    }

    pub fn counters(&self) -> Counters {
        self.server.counters_at(self.port.counters())
    }

    /// Checks that the next valid request is answered.
    pub fn must_answer(&mut self) {
        let reply = self.request(&pdu(0x03, &[0, 1])).expect("a reply");
        assert_eq!(reply[..2], [0x03, 0x02]);
    }
}

/// Returns the characters of a reply that may start, and ends the reply.
pub fn send(port: &mut Port<'_, impl Units>) -> Option<Vec<u8>> {
    let mut sent = vec![port.start()?];
    assert!(port.is_sending());
    while let Some(byte) = port.next_byte() {
        sent.push(byte);
    }
    port.sent();
    Some(sent)
}
