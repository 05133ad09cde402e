//! The exact line of the running command, tested by a client on its socket.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use super::{Running, connect, eventually, state};

/// A client of the line.
struct Client {
    stream: BufReader<TcpStream>,
}

impl Client {
    /// Connects and sends nothing.
    fn silent(address: &str) -> Self {
        Self {
            stream: BufReader::new(connect(address)),
        }
    }

    /// Connects and sends the first request, which must be `hello`.
    fn connect(address: &str) -> Self {
        let mut client = Self::silent(address);
        let hello = client.ask(b"hello 1\n");
        assert!(hello.starts_with("ok "), "{hello}");
        client
    }

    fn read(&mut self) -> String {
        let mut line = String::new();
        self.stream.read_line(&mut line).unwrap();
        line
    }

    fn ask(&mut self, request: &[u8]) -> String {
        self.stream.get_mut().write_all(request).unwrap();
        self.read()
    }
}

/// Returns a simulator whose firmware is an endless loop, the address of its line and the URL of its front panel.
fn started(more: &[&str]) -> (Running, String, String) {
    let arguments = [&["--exact-line", "127.0.0.1:0"][..], more].concat();
    let mut running = Running::start_loop(&arguments);
    let line = running.endpoint("exact-line: ");
    let http = running.endpoint("http: http://");
    (running, line, http)
}

#[test]
fn no_virtual_time_passes_between_requests() {
    let (_running, line, http) = started(&[]);
    let mut client = Client::connect(&line);
    assert_eq!(client.ask(b"run 0\n"), "ok 500000.000\n");
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(client.ask(b"run 1500.5\r\n"), "ok 501500.500\n");
    assert_eq!(
        state(&http)["virtual_ms"],
        501,
        "the front panel shows the virtual time"
    );
    let hello = client.ask(b"hello 1\n");
    assert!(
        hello.starts_with("ok 501500.500 version=1 line=9600,8N2 "),
        "{hello}"
    );
}

#[test]
fn each_invalid_line_gets_an_error_and_no_time_passes() {
    let (_running, line, _) = started(&[]);
    let mut client = Client::connect(&line);
    let before = client.ask(b"run 0\n");
    for request in [
        &b"\n"[..],
        b"\r\n",
        b"nonsense\n",
        b"send\n",
        b"send 1\n",
        b"send 01 parity:01\n",
        b"run -1\n",
        b"run 600000000.001\n",
        b"line 9600 7N1\n",
        b"send \xC3\x28\n",
        b"\x00\xFF\n",
        b"GET / HTTP/1.1\r\n",
    ] {
        let reply = client.ask(request);
        assert!(reply.starts_with("error ") && reply.len() > 12, "{reply}");
    }
    assert_eq!(client.ask(b"run 0\n"), before);
}

#[test]
fn a_line_that_is_too_long_ends_the_connection_and_the_next_client_is_served() {
    let (_running, line, _) = started(&[]);
    let mut client = Client::connect(&line);
    let longest = [b"send ".to_vec(), vec![b' '; (1 << 20) - 5], b"\n".to_vec()].concat();
    assert!(client.ask(&longest).contains("at least one piece"));
    client
        .stream
        .get_mut()
        .write_all(&vec![b'0'; (1 << 20) + 2])
        .unwrap();
    let reply = client.read();
    assert!(
        reply.starts_with("error the line is longer than 1048576"),
        "{reply}"
    );
    assert_eq!(client.stream.read(&mut [0; 8]).unwrap(), 0);
    assert_eq!(served(&line).ask(b"run 0\n"), "ok 500000.000\n");
}

/// Connects until the server has noticed that the previous client has disconnected.
fn served(line: &str) -> Client {
    let end = Instant::now() + Duration::from_secs(60);
    loop {
        let mut client = Client::silent(line);
        // The server may reset the connection of a refused client.
        let mut reply = String::new();
        let written = client.stream.get_mut().write_all(b"hello 1\n");
        let read = client.stream.read_line(&mut reply);
        if written.is_ok() && read.is_ok() && reply.starts_with("ok ") {
            return client;
        }
        assert!(Instant::now() < end, "{reply}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn second_client_is_refused_and_the_first_is_still_served() {
    let (_running, line, _) = started(&[]);
    let mut first = Client::connect(&line);
    assert_eq!(first.ask(b"run 10\n"), "ok 500010.000\n");
    let mut second = Client::silent(&line);
    assert_eq!(
        second.read(),
        "error the line is in use by another client\n"
    );
    assert_eq!(first.ask(b"run 10\n"), "ok 500020.000\n");
}

#[test]
fn connection_that_does_not_begin_with_hello_has_no_effect() {
    let (_running, line, http) = started(&[]);
    let orders = "run 1000\npower off\nhello 1\n";
    for begin in [
        format!("POST / HTTP/1.1\r\nHost: localhost\r\n\r\n{orders}"),
        orders.to_owned(),
        format!("\n{orders}"),
        format!("hello {}\n{orders}", "1".repeat(100)),
    ] {
        let mut client = Client::silent(&line);
        client.stream.get_mut().write_all(begin.as_bytes()).unwrap();
        // The server may reset the connection, because it does not read the rest.
        let mut answer = String::new();
        let _ = client.stream.read_to_string(&mut answer);
        assert!(!answer.contains("ok "), "{answer}");
    }
    // A connection that sends nothing does not take the line either.
    let _idle = Client::silent(&line);
    let mut client = Client::connect(&line);
    assert_eq!(client.ask(b"run 0\n"), "ok 500000.000\n");
    assert_eq!(state(&http)["powered"], true);
}

#[test]
fn a_client_that_disconnects_in_the_middle_is_replaced_by_the_next() {
    let (_running, line, _) = started(&[]);
    let mut client = Client::connect(&line);
    client.stream.get_mut().write_all(b"run 1000").unwrap();
    drop(client);
    let mut client = served(&line);
    assert_eq!(
        client.ask(b"run 0\n"),
        "ok 500000.000\n",
        "an incomplete line is not a request"
    );
    // This request takes a minute of virtual time, and its client does not wait for the reply.
    client
        .stream
        .get_mut()
        .write_all(b"run 60000000\n")
        .unwrap();
    drop(client);
    assert_eq!(served(&line).ask(b"run 0\n"), "ok 60500000.000\n");
}

#[cfg(unix)]
#[test]
fn signals_end_the_simulator_during_a_long_request() {
    let (mut running, line, http) = started(&[]);
    let mut client = Client::connect(&line);
    let before = state(&http)["virtual_ms"].take();
    client
        .stream
        .get_mut()
        .write_all(b"run 600000000\n")
        .unwrap();
    eventually("no virtual time passes", || {
        state(&http)["virtual_ms"] != before
    });
    running.signal("-INT");
    assert_eq!(running.end(), (Some(0), String::new()));
    // The connection may end with an error before the reply is read.
    let mut reply = String::new();
    let _ = client.stream.read_line(&mut reply);
    assert!(!reply.starts_with("ok "), "the request was over: {reply}");
}
