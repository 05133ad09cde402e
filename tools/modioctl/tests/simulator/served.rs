//! Units that the tests serve over TCP.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use modbus_reference::{Device, Server};
use modioctl::bus::adu::{Framing, request_length};
use register_map::board::MODIO_02;
use register_map::{Module, Row};

/// Serves each connection in a new thread. Returns the address.
pub fn serve(connection: impl Fn(TcpStream) + Clone + Send + 'static) -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    thread::spawn(move || {
        for master in listener.incoming().flatten() {
            master.set_nodelay(true).unwrap();
            let connection = connection.clone();
            thread::spawn(move || connection(master));
        }
    });
    address
}

/// Serves a unit at every address.
pub fn serve_unit(mut unit: impl Answers + Send + 'static) -> SocketAddr {
    serve_requests(move |address, pdu| Some(unit.response(address, pdu)))
}

/// Serves requests in RTU frames. `answer` gets the unit and the PDU of a request and returns the bytes to send, none
/// for silence. `None` closes the connection.
pub fn serve_requests(
    answer: impl FnMut(u8, &[u8]) -> Option<Vec<u8>> + Send + 'static,
) -> SocketAddr {
    let answer = Arc::new(Mutex::new(answer));
    serve(move |mut master| {
        let mut bytes = [0; 512];
        while let Ok(count @ 1..) = master.read(&mut bytes) {
            let mut rest = &bytes[..count];
            while !rest.is_empty() {
                // One read may return several requests.
                let length = request_length(rest).filter(|length| *length <= rest.len());
                let (request, after) = rest.split_at(length.unwrap_or(rest.len()));
                rest = after;
                let Some((unit, pdu)) = Framing::Rtu.open(request) else {
                    continue;
                };
                let Some(bytes) = answer.lock().unwrap()(unit, &pdu) else {
                    return;
                };
                let _ = master.write_all(&bytes);
            }
        }
    })
}

/// What answers requests.
pub trait Answers {
    /// Returns the PDU of the response, or an exception code.
    fn result(&mut self, pdu: &[u8]) -> Result<Vec<u8>, u8>;

    /// Returns the PDU of the response, which may be an exception.
    fn answer(&mut self, pdu: &[u8]) -> Vec<u8> {
        let answer = self.result(pdu);
        answer.unwrap_or_else(|code| vec![pdu[0] | 0x80, code])
    }

    /// Returns the frame of the response.
    fn response(&mut self, unit: u8, pdu: &[u8]) -> Vec<u8> {
        Framing::Rtu.frame(0, unit, &self.answer(pdu))
    }
}

impl Answers for Server {
    fn result(&mut self, pdu: &[u8]) -> Result<Vec<u8>, u8> {
        self.answer(pdu)
    }
}

/// A modio without functions 11 and 2B. Its time stands still.
pub struct Modio {
    pub modio: modbus_reference::Modio,
    server: Server,
}

impl Modio {
    /// A modio-02 with this module, whose description the program knows.
    pub fn modio_02(module: Module) -> Self {
        Self::of(&MODIO_02, |_| module)
    }

    /// A unit of this board with these modules, whose description the program knows. It has run for a while.
    pub fn of(board: &'static Row, module: impl Fn(u16) -> Module) -> Self {
        let mut modio = modbus_reference::Modio::new(board, module);
        modio.now = Duration::from_secs(1000);
        Self {
            modio,
            server: other(),
        }
    }

    /// The same with these values of registers, which can only be read.
    pub fn with(mut self, registers: impl IntoIterator<Item = (u16, u16)>) -> Self {
        self.modio.fixed.extend(registers);
        self
    }
}

impl Answers for Modio {
    fn result(&mut self, pdu: &[u8]) -> Result<Vec<u8>, u8> {
        let of_modio = self.modio.answer(pdu, &self.server.counters);
        let answer = of_modio.unwrap_or_else(|| self.server.result(pdu));
        if self.modio.restart {
            self.modio.start(self.modio.now, false);
        }
        answer
    }
}

/// Returns a device that is no modio, without functions 11 and 2B.
pub fn other() -> Server {
    let device = Device {
        max_word: u16::MAX,
        lacks: vec![0x11, 0x2B],
        ..Device::new(0x20, 0x600)
    };
    Server::new(None, device)
}
