//! Units that the tests serve over TCP.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::thread;

use modbus_reference::{Device, Server};
use modio_description::{checksum, describe};
use modioctl::bus::adu::{Framing, request_length};
use register_map::board::MODIO_02;
use register_map::configuration::MODULE;
use register_map::state::{
    BOARD, DESCRIPTION_CRC, FIRMWARE_VERSION, MODULE_IN_FORCE, PRODUCT, PRODUCT_CODE,
};
use register_map::{Board, Module, points};

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

/// Returns the PDU of a server's response, which may be an exception.
pub fn answer(server: &mut Server, pdu: &[u8]) -> Vec<u8> {
    let answer = server.answer(pdu);
    answer.unwrap_or_else(|code| vec![pdu[0] | 0x80, code])
}

/// Returns the frame of a server's response.
pub fn response(server: &mut Server, unit: u8, pdu: &[u8]) -> Vec<u8> {
    Framing::Rtu.frame(0, unit, &answer(server, pdu))
}

/// Returns a server with these values of registers, without functions 11 and 2B.
pub fn server(words: impl IntoIterator<Item = (u16, u16)>) -> Server {
    let mut device = Device {
        max_word: u16::MAX,
        lacks: vec![0x11, 0x2B],
        ..Device::new(0x20, 0x600)
    };
    for (address, word) in words {
        device.words[usize::from(address)] = word;
    }
    Server::new(None, device)
}

/// Returns registers of a modio-02 with this module, whose description the program knows.
pub fn modio_02(module: Module) -> Vec<(u16, u16)> {
    modio(
        &MODIO_02,
        |port| if port == 5 { module } else { Module::None },
    )
}

/// Returns registers of this board with these modules, whose description the program knows.
pub fn modio(board: &Board, module: impl Fn(u16) -> Module) -> Vec<(u16, u16)> {
    let description = describe(board, "0.1.0", &module);
    let head = [
        (PRODUCT_CODE, (PRODUCT >> 16) as u16),
        (PRODUCT_CODE + 1, PRODUCT as u16),
        (FIRMWARE_VERSION, 0x0001),
        (BOARD, board.code),
        (DESCRIPTION_CRC, checksum(&description.encode())),
    ];
    let modules = (1..=points::PORTS).flat_map(|port| {
        let code = module(port).code();
        [
            (MODULE + port - 1, code),
            (MODULE_IN_FORCE + port - 1, code),
        ]
    });
    head.into_iter().chain(modules).collect()
}
