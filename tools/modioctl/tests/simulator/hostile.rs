//! Tests with lines that return what they receive, or that are never silent. They must never count as a unit, and must
//! end every command.

use std::io::{Read, Write};
use std::net::SocketAddr;
use std::thread;
use std::time::Duration;

use modbus_reference::{Device, Server};
use modioctl::bus::adu::Framing;

use crate::program::At;
use crate::served::{Answers, serve, serve_requests};

/// Commands with requests whose responses equal the request.
const COMMANDS: [&str; 10] = [
    "write 0=1",
    "config set BAUD=9600",
    "identify",
    "reboot",
    "raw 05 0000 FF00",
    "raw 06 0000 0001",
    "raw 08 0000 1234",
    "raw 15 09 06 0001 0000 0001 1234",
    "raw 16 0000 0000 0000",
    "raw 41 00",
];

/// An adapter that returns what it sends. With `delay` there is also a unit with address 1, which answers after that
/// time.
fn echo(delay: Option<Duration>) -> SocketAddr {
    serve(move |mut master| {
        let mut server = Server::new(None, Device::new(4, 4));
        let mut bytes = [0; 512];
        while let Ok(count @ 1..) = master.read(&mut bytes) {
            if master.write_all(&bytes[..count]).is_err() {
                return;
            }
            let (Some(delay), Some((1, pdu))) = (delay, Framing::Rtu.open(&bytes[..count])) else {
                continue;
            };
            thread::sleep(delay);
            let _ = master.write_all(&server.response(1, &pdu));
        }
    })
}

#[test]
fn an_echo_is_not_mistaken_for_a_unit() {
    let nobody = echo(None);
    for at in [At::tcp(nobody), At::modbus_tcp(nobody)] {
        for words in COMMANDS {
            let words = format!("--timeout 60ms --retries 1 {words}");
            let text = at.run(&words).failed(3);
            assert!(text.contains("returns what it sends"), "{words}: {text}");
        }
        let text = at.run("--timeout 60ms scan --units 1-3").failed(3);
        assert!(text.contains("returns what it sends"), "{text}");
    }
}

#[test]
fn an_echo_that_begins_late_and_in_pieces_is_not_mistaken_for_a_unit() {
    let nobody = serve(|mut master| {
        let mut bytes = [0; 512];
        // The adapter is not ready for the first request.
        let _ = master.read(&mut bytes);
        while let Ok(count @ 1..) = master.read(&mut bytes) {
            let _ = master.write_all(&bytes[..4]);
            thread::sleep(Duration::from_millis(150));
            let _ = master.write_all(&bytes[4..count]);
        }
    });
    for words in ["identify", "raw 06 0000 0001"] {
        let words = format!("--timeout 300ms --retries 0 {words}");
        let text = At::tcp(nobody).run(&words).failed(3);
        assert!(text.contains("returns what it sends"), "{words}: {text}");
    }
}

/// A unit whose identification moves the cursor, changes the colour and rings.
#[test]
fn texts_of_a_unit_have_escapes_for_control_characters() {
    const TEXT: &[u8] = b"\x1b[31m\x07\r\n\x7fA";
    let unit = serve_requests(|unit, pdu| {
        let length = TEXT.len() as u8;
        let answer = match pdu[0] {
            0x11 => [&[0x11, length + 1], TEXT, &[0xFF]].concat(),
            0x2B => [&[0x2B, 0x0E, 3, 3, 0, 0, 1, 0, length][..], TEXT].concat(),
            function => vec![function | 0x80, 1],
        };
        Some(Framing::Rtu.frame(0, unit, &answer))
    });
    for (words, is_text) in [
        ("--trace scan --units 1", true),
        ("--trace info", true),
        ("raw 2B 0E 03 00", true),
        ("raw 11", false),
    ] {
        let ran = At::tcp(unit).run(words);
        assert_eq!(ran.status, 0, "{ran:?}");
        let shown = r"\u{1b}[31m\u{7}\r\n\u{7f}A";
        assert_eq!(ran.out.contains(shown), is_text, "{ran:?}");
        let raw = |c: char| c.is_control() && c != '\n';
        assert!(!ran.out.contains(raw) && !ran.err.contains(raw), "{ran:?}");
    }
}

#[test]
fn a_unit_behind_an_echo_answers() {
    for delay in [Duration::ZERO, Duration::from_millis(30)] {
        let at = At::tcp(echo(Some(delay)));
        for words in ["raw 05 0000 FF00", "raw 06 0001 0007", "write 1=7"] {
            at.run(words).fine();
        }
    }
}

#[test]
fn a_line_that_is_never_silent_is_status_4() {
    let line = serve(|mut master| while master.write_all(&[0; 4096]).is_ok() {});
    for at in [At::tcp(line), At::modbus_tcp(line)] {
        for words in ["read 0", "info", "watch 0 --count 1"] {
            let words = format!("--timeout 100ms --retries 0 {words}");
            assert_eq!(at.run(&words).status, 4, "{words}");
        }
        let ran = at.run("scan");
        assert!(
            ran.out.starts_with("the line is never silent at "),
            "{ran:?}"
        );
        assert_eq!(ran.status, 4, "{ran:?}");
        for words in COMMANDS {
            let words = format!("--timeout 100ms --retries 0 {words}");
            let text = at.run(&words).failed(4);
            assert!(text.contains("is never silent"), "{words}: {text}");
        }
    }
}
