//! Tests of the words for bytes that are no answer: of gateways, of other masters and of other units.

use std::io::{Read, Write};
use std::net::SocketAddr;

use modioctl::bus::adu::Framing;

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
