//! The Modbus TCP gateway of the running command, tested by clients on its socket.

use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;

use modbus_line::adu::Framing;

use super::{Running, connect, eventually, state};

const READ: &[u8] = &[3, 2, 0, 0, 1];

/// A client of the gateway.
struct Client(TcpStream);

impl Client {
    fn connect(address: &str) -> Self {
        Self(connect(address))
    }

    fn send(&mut self, transaction: u16, unit: u8, pdu: &[u8]) {
        let frame = Framing::Mbap.frame(transaction, unit, pdu);
        self.0.write_all(&frame).unwrap();
    }

    /// Returns transaction, unit and PDU of the next response.
    fn receive(&mut self) -> (u16, u8, Vec<u8>) {
        let mut frame = vec![0; 6];
        self.0.read_exact(&mut frame).unwrap();
        frame.resize(6 + usize::from(frame[5]), 0);
        self.0.read_exact(&mut frame[6..]).unwrap();
        let (unit, pdu) = Framing::Mbap.open(&frame).expect("a Modbus header");
        (u16::from_be_bytes([frame[0], frame[1]]), unit, pdu)
    }

    fn ask(&mut self, unit: u8, pdu: &[u8]) -> Vec<u8> {
        self.send(0xABCD, unit, pdu);
        let (transaction, from, answer) = self.receive();
        assert_eq!((transaction, from), (0xABCD, unit));
        answer
    }

    /// Asserts that the gateway has closed the connection.
    fn assert_closed(&mut self) {
        match self.0.read(&mut [0; 8]) {
            Ok(0) => {}
            Err(error) if error.kind() == ErrorKind::ConnectionReset => {}
            other => panic!("{other:?}"),
        }
    }
}

/// Options for a gateway on a free port.
const GATEWAY: [&str; 2] = ["--modbus-tcp", "127.0.0.1:0"];
/// Options for a fast line, with a unit that never answers.
const FAST: [&str; 2] = ["--line", "115200,8N2"];

/// Returns a simulator with a gateway, the gateway's address and the URL of the front panel.
fn ready(mut running: Running) -> (Running, String, String) {
    running.skip_pty();
    let gateway = running.endpoint("modbus-tcp: ");
    let http = running.endpoint("http: http://");
    (running, gateway, http)
}

/// Returns a simulator with a gateway and a unit that never answers.
fn silent() -> (Running, String, String) {
    ready(Running::start_loop(&[GATEWAY, FAST].concat()))
}

#[test]
fn unit_that_does_not_answer_is_exception_0b_after_its_request_was_on_the_line() {
    let (_running, gateway, http) = silent();
    let mut client = Client::connect(&gateway);
    assert_eq!(client.ask(1, READ), [0x83, 0x0B]);
    assert_eq!(client.ask(247, &[0x41, 1, 2]), [0xC1, 0x0B]);
    assert_eq!(state(&http)["line"]["rx_frames"], 2);
}

#[test]
fn address_that_no_unit_can_have_is_exception_0a_and_not_on_the_line() {
    let (_running, gateway, http) = silent();
    let mut client = Client::connect(&gateway);
    for unit in [248, 254] {
        assert_eq!(client.ask(unit, READ), [0x83, 0x0A]);
    }
    assert_eq!(state(&http)["line"]["rx_frames"], 0);
}

#[test]
fn broadcast_is_sent_and_not_answered() {
    let (_running, gateway, http) = silent();
    let mut client = Client::connect(&gateway);
    client.send(1, 0, &[6, 0, 0x10, 0, 1]);
    client.send(2, 1, READ);
    assert_eq!(client.receive(), (2, 1, vec![0x83, 0x0B]));
    assert_eq!(state(&http)["line"]["rx_frames"], 2);
}

#[test]
fn pipelined_requests_are_answered_in_order_with_their_transactions() {
    let (_running, gateway, http) = silent();
    let mut client = Client::connect(&gateway);
    // More requests than the gateway queues. Some of them need the line.
    let unit = |n: u16| if n.is_multiple_of(5) { 9 } else { 250 };
    for n in 0..50 {
        client.send(n, unit(n), READ);
    }
    for n in 0..50 {
        let (transaction, from, _) = client.receive();
        assert_eq!((transaction, from), (n, unit(n)));
    }
    assert_eq!(state(&http)["line"]["rx_frames"], 10);
}

#[test]
fn clients_are_served_in_turn_and_idle_ones_do_not_block() {
    let (_running, gateway, _) = silent();
    let mut idle = Client::connect(&gateway);
    // Half of a request.
    idle.0.write_all(&[0, 1, 0, 0, 0]).unwrap();
    let mut many = Client::connect(&gateway);
    for n in 0..16 {
        many.send(n, 1, READ);
    }
    let mut one = Client::connect(&gateway);
    assert_eq!(many.receive().0, 0);
    assert_eq!(one.ask(1, READ), [0x83, 0x0B]);
    // The requests of the other client were not all served first.
    many.0.set_nonblocking(true).unwrap();
    let mut answered = Vec::new();
    let _ = many.0.read_to_end(&mut answered);
    assert!(answered.len() < 15 * 9, "{}", answered.len());
}

#[test]
fn wrong_header_closes_the_connection_and_others_go_on() {
    let (_running, gateway, _) = silent();
    let mut other = Client::connect(&gateway);
    for header in [
        &[0, 1, 0, 1, 0, 6, 1][..],
        &[0, 1, 0, 0, 0, 1, 1],
        &[0, 1, 0, 0, 0, 255, 1],
        b"GET / HTTP/1.1\r\n\r\n",
    ] {
        let mut client = Client::connect(&gateway);
        client.0.write_all(header).unwrap();
        client.assert_closed();
    }
    assert_eq!(other.ask(1, READ), [0x83, 0x0B]);
}

#[test]
fn client_that_only_sends_gets_its_responses_before_the_connection_closes() {
    let (_running, gateway, _) = silent();
    let mut client = Client::connect(&gateway);
    client.send(1, 1, READ);
    client.send(2, 250, READ);
    client.0.shutdown(std::net::Shutdown::Write).unwrap();
    assert_eq!(client.receive().0, 1);
    assert_eq!(client.receive().0, 2);
    client.assert_closed();
}

#[test]
fn halted_core_is_exception_0a_until_the_debugger_leaves() {
    let arguments = [GATEWAY, FAST, ["--gdb", "127.0.0.1:0"]].concat();
    let (mut running, gateway, _) = ready(Running::start_loop(&arguments));
    // The reply to the debugger confirms that the core is halted. A request that is then on the line would not be
    // handled.
    let mut debugger = TcpStream::connect(running.endpoint("gdb: ")).unwrap();
    debugger.write_all(b"$?#3f").unwrap();
    debugger.read_exact(&mut [0; 1]).unwrap();
    let mut client = Client::connect(&gateway);
    assert_eq!(client.ask(1, READ), [0x83, 0x0A]);
    drop(debugger);
    eventually("the core is still halted", || {
        client.ask(1, READ) == [0x83, 0x0B]
    });
}

/// Returns a simulator that runs the image.
fn image(more: &[&str]) -> (Running, String, String) {
    ready(Running::start_firmware(&[&GATEWAY[..], more].concat()))
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn unit_answers_through_the_gateway() {
    let (_running, gateway, http) = image(&["--dip", "17"]);
    let mut clients: Vec<_> = (0..4).map(|_| Client::connect(&gateway)).collect();
    for n in 0..5 {
        for client in &mut clients {
            client.send(n, 17, &[3, 2, 0, 0, 2]);
        }
        for client in &mut clients {
            let identity = vec![3, 4, 0x23, 0x83, 0x58, 0x60];
            assert_eq!(client.receive(), (n, 17, identity));
        }
    }
    let client = &mut clients[0];
    assert_eq!(
        client.ask(17, &[1, 0xFF, 0, 0, 1]),
        [0x81, 2],
        "the exception of the unit"
    );
    assert_eq!(
        client.ask(16, READ),
        [0x83, 0x0B],
        "no such unit on the line"
    );
    assert_eq!(
        client.ask(255, READ),
        [0x83, 0x0B],
        "a unit in recovery mode does not answer"
    );
    assert_eq!(state(&http)["line"]["tx_frames"], 21);
}
