//! Tests of the words for bytes that are no answer: of gateways, of other masters and of other units.

use std::io::{Read, Write};
use std::net::SocketAddr;

use modioctl::bus::adu::Framing;
use portable_pty::{PtySize, native_pty_system};

use crate::program::{At, has};
use crate::served::serve;

/// Answers each request with the bytes that `answer` returns for it; closes the connection in place of an empty answer.
fn gateway(answer: impl Fn(&[u8]) -> Vec<u8> + Clone + Send + 'static) -> SocketAddr {
    serve(move |mut master| {
        let mut bytes = [0; 512];
        while let Ok(count @ 1..) = master.read(&mut bytes) {
            let answer = answer(&bytes[..count]);
            if answer.is_empty() {
                return;
            }
            let _ = master.write_all(&answer);
        }
    })
}

const WORDS: &str = "--timeout 50ms --retries 0";

#[test]
fn answers_of_gateways_and_other_units_are_named_by_every_command() {
    let rtu = |pdu: &'static [u8]| At::tcp(gateway(move |_| Framing::Rtu.frame(0, 1, pdu)));
    let tcp = |transaction| {
        At::modbus_tcp(gateway(move |_| {
            Framing::Mbap.frame(transaction, 1, &[1, 1, 1])
        }))
    };
    for (at, text) in [
        (
            At::tcp(gateway(|_| Framing::Rtu.frame(0, 7, &[1, 1, 1]))),
            "unit 7 answers, not unit 1",
        ),
        (rtu(&[1, 2, 1, 0]), "its byte count is 2, and 1 is right"),
        (
            At::tcp(gateway(|_| Framing::Mbap.frame(1, 1, &[1, 1, 1]))),
            "use --modbus-tcp",
        ),
        (
            At::modbus_tcp(gateway(|_| Framing::Rtu.frame(0, 1, &[1, 1, 1]))),
            "use --tcp",
        ),
        (tcp(0x1234), "no request had its transaction id 1234"),
        (
            At::modbus_tcp(gateway(|request| {
                let transaction = u16::from_be_bytes([request[0], request[1]]);
                Framing::Mbap.frame(transaction, 1, &[1, 1, 1])[..7].to_vec()
            })),
            "the gateway sent 7 of 10 bytes",
        ),
        (
            At::tcp(gateway(|_| {
                let frame = Framing::Rtu.frame(0, 1, &[1, 1, 1]);
                [&[0xFF, 0xFB, 0, 0xFF, 0xFD, 3][..], &frame].concat()
            })),
            "the gateway speaks telnet",
        ),
    ] {
        let ran = at.run(&format!("{WORDS} raw 01 0010 0001"));
        has(&ran.out, &[text]);
        let error = ran.failed(4);
        has(&error, &[text]);
        assert!(!error.contains("two units"), "{error}");
    }
}

#[test]
fn silent_and_closed_connections_name_the_other_kind_of_tcp() {
    let silent = serve(|mut master| while let Ok(1..) = master.read(&mut [0; 512]) {});
    let closing = gateway(|_| Vec::new());
    for (address, status) in [(silent, 3), (closing, 5)] {
        for (at, option) in [
            (At::tcp(address), "--modbus-tcp"),
            (At::modbus_tcp(address), "--tcp"),
        ] {
            let error = at.run(&format!("{WORDS} read 0")).failed(status);
            has(&error, &[&format!("use {option} {address}")]);
        }
    }
}

/// Bytes on a line can look like the header of Modbus TCP.
#[test]
fn serial_port_is_never_said_to_speak_modbus_tcp() {
    let pty = native_pty_system().openpty(PtySize::default()).unwrap();
    let mut requests = pty.master.try_clone_reader().unwrap();
    let mut responses = pty.master.take_writer().unwrap();
    std::thread::spawn(move || {
        while let Ok(1..) = requests.read(&mut [0; 256]) {
            let answer = Framing::Mbap.frame(1, 1, &[3, 2, 0, 5]);
            let _ = responses.write_all(&answer);
        }
    });
    let at = At::port(pty.master.tty_name().unwrap().display());
    let ran = at.run(&format!("{WORDS} raw 03 0010 0001"));
    assert!(!ran.out.contains("Modbus TCP"), "{ran:?}");
    has(&ran.failed(4), &["garbled"]);
}

#[test]
fn raw_shows_exceptions_of_gateways_and_names_busy() {
    for (answer, shown, text, status) in [
        (
            &[0x83, 0x0B][..],
            "<- 01 83 0B",
            "does not answer the gateway",
            3,
        ),
        (&[0x83, 6], "<- 01 83 06", "busy", 1),
        (
            &[0x83, 2],
            "<- 01 83 02",
            "exception 02 (illegal data address): there is no such point",
            1,
        ),
    ] {
        let at = At::tcp(gateway(move |_| Framing::Rtu.frame(0, 1, answer)));
        let ran = at.run(&format!("{WORDS} raw 03 0010 0001"));
        has(&ran.out, &[shown]);
        has(&ran.failed(status), &[text]);
    }
}

#[test]
fn wrong_answer_to_an_earlier_attempt_is_not_named_as_late() {
    let at = At::modbus_tcp(serve(|mut master| {
        let mut bytes = [0; 512];
        // The next attempt has no answer.
        for answers in [true, false] {
            assert!(master.read(&mut bytes).unwrap() > 2);
            if answers {
                let transaction = u16::from_be_bytes([bytes[0], bytes[1]]);
                let answer = Framing::Mbap.frame(transaction, 1, &[1, 2, 1, 0]);
                master.write_all(&answer).unwrap();
            }
        }
        let _ = master.read(&mut bytes);
    }));
    let ran = at.run("--timeout 50ms --retries 1 raw 01 0010 0001");
    has(&ran.failed(4), &["its byte count is 2, and 1 is right"]);
}
