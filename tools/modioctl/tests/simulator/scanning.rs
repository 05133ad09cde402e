//! Tests of `modioctl scan` on large buses.

use std::collections::BTreeSet;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener};
use std::sync::mpsc::{self, Receiver};
use std::thread;
use std::time::{Duration, Instant};

use modbus_reference::{Device, Server, framed};
use modioctl::bus::adu::{Framing, request_length};

use crate::program::{At, has};
use crate::served::{Answers, serve_requests};
use crate::unit::Unit;

/// The shortest time-out with which a master finds every unit when it waits for each in turn: V1.02, 2.4.1, gives
/// 100 ms as the least time that a master should wait.
const SENSIBLE: Duration = Duration::from_millis(100);

/// A bus of units that answer after `delay`, one line for all. The receiver gets the unit of each request, and when it
/// arrived.
fn bus(addresses: BTreeSet<u8>, delay: Duration) -> (SocketAddr, Receiver<(u8, Instant)>) {
    let (tell, requests) = mpsc::channel();
    let mut server = Server::new(None, Device::new(4, 4));
    let address = serve_requests(move |unit, pdu| {
        // Some tests do not listen.
        let _ = tell.send((unit, Instant::now()));
        if !addresses.contains(&unit) {
            return Some(Vec::new());
        }
        thread::sleep(delay);
        Some(server.response(unit, pdu))
    });
    (address, requests)
}

fn found(at: &At, words: &str) -> BTreeSet<u8> {
    let text = at.run(words).fine();
    text.lines()
        .map(|line| line.split_whitespace().next().unwrap().parse().unwrap())
        .collect()
}

/// A busy computer lengthens the waits, and nothing shortens them, so the shortest one counts.
#[test]
fn a_missing_unit_takes_a_third_of_the_time_of_sequential_waiting() {
    let addresses: BTreeSet<u8> = (0..5).map(|n| n * 8 + 3).collect();
    let (bus, requests) = bus(addresses.clone(), Duration::from_millis(12));
    assert_eq!(found(&At::tcp(bus), "scan --units 1-40"), addresses);
    // The silent addresses are asked again after all of them.
    let requests: Vec<_> = requests.try_iter().take(40).collect();
    assert!(
        (1..=40).eq(requests.iter().map(|request| request.0)),
        "{requests:?}"
    );
    let missing = requests
        .windows(2)
        .filter(|two| !addresses.contains(&two[0].0));
    let waits = missing.map(|two| two[1].1 - two[0].1);
    let shortest = waits.min().expect("missing units");
    // A request of 4 bytes takes 4.6 ms at 9600 bit/s.
    let third = (SENSIBLE + Duration::from_micros(4_583)) / 3;
    assert!(shortest < third, "{shortest:?}, {third:?}");
}

/// Without t3.5 the other units of the line drop the request.
#[test]
fn the_next_request_follows_an_answer_after_t35() {
    let delay = Duration::from_millis(12);
    let (bus, requests) = bus((1..=20).collect(), delay);
    found(&At::tcp(bus), "scan --units 1-20");
    let requests: Vec<_> = requests.try_iter().take(20).collect();
    // 38.5 bits at 9600 bit/s.
    let least = delay + Duration::from_micros(4_010);
    for two in requests.windows(2) {
        let between = two[1].1 - two[0].1;
        assert!(between >= least, "after unit {}: {between:?}", two[0].0);
    }
}

#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn units_with_neighbouring_addresses_are_found_by_every_scan() {
    let line = Unit::several(&["1:4ai", "2:4do", "3:2relay"]);
    for at in [At::port(line.pty.display()), At::tcp(line.tcp)] {
        for _ in 0..3 {
            assert_eq!(found(&at, "scan --units 1-5"), BTreeSet::from([1, 2, 3]));
        }
    }
}

#[test]
fn a_unit_that_answers_late_is_found() {
    for delay in [40, 70] {
        let addresses = BTreeSet::from([3, 9, 10, 200]);
        let (bus, _) = bus(addresses.clone(), Duration::from_millis(delay));
        assert_eq!(
            found(&At::tcp(bus), "scan --units 1-12,195-205"),
            addresses,
            "{delay} ms"
        );
    }
}

/// A bus of units with a RESPONSE_DELAY of 100 ms. A unit drops its answer when another request comes before. The
/// receiver gets the unit of each request.
fn delayed(addresses: &[u8]) -> (SocketAddr, Receiver<u8>) {
    let (tell, requests) = mpsc::channel();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let addresses = addresses.to_vec();
    thread::spawn(move || {
        let (mut master, _) = listener.accept().unwrap();
        let mut server = Server::new(None, Device::new(4, 4));
        let mut bytes = [0; 512];
        let mut answer: Option<Vec<u8>> = None;
        loop {
            let delay = answer.is_some().then_some(Duration::from_millis(100));
            master.set_read_timeout(delay).unwrap();
            match (master.read(&mut bytes), answer.take()) {
                (Ok(0), _) => return,
                (Ok(count), _) => {
                    // On a busy host one read may return several requests of the scan.
                    let mut rest = &bytes[..count];
                    while let Some(length) = request_length(rest) {
                        let (request, after) = rest.split_at(length);
                        rest = after;
                        let (unit, pdu) = Framing::Rtu.open(request).unwrap();
                        let _ = tell.send(unit);
                        let frame = server.response(unit, &pdu);
                        answer = addresses.contains(&unit).then_some(frame);
                    }
                }
                (Err(_), Some(answer)) => master.write_all(&answer).unwrap(),
                (Err(error), None) => panic!("{error}"),
            }
        }
    });
    (address, requests)
}

#[test]
fn units_with_a_response_delay_are_found_by_the_second_pass() {
    let (bus, _) = delayed(&[2, 5, 6]);
    let units = found(&At::tcp(bus), "scan --units 1-9");
    assert_eq!(units, BTreeSet::from([2, 5, 6]));
}

#[test]
fn ctrl_c_keeps_the_units_that_were_found() {
    let (bus, requests) = delayed(&[1]);
    let scan = At::tcp(bus).start("scan");
    // The second pass has asked unit 1.
    while requests.recv().unwrap() != 247 {}
    while requests.recv().unwrap() != 2 {}
    scan.interrupt();
    let ran = scan.end();
    assert_eq!(ran.status, 130, "{ran:?}");
    assert!(ran.out.starts_with("1  "), "{ran:?}");
}

/// A gateway that delivers each answer when the addresses after it are asked.
#[test]
fn an_answer_that_is_a_second_late_belongs_to_its_own_unit_and_is_not_a_second_unit() {
    let addresses = BTreeSet::from([1, 4]);
    let asked = addresses.clone();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let bus = listener.local_addr().unwrap();
    thread::spawn(move || {
        let (mut master, _) = listener.accept().unwrap();
        let mut bytes = [0; 512];
        while let Ok(count @ 1..) = master.read(&mut bytes) {
            let (unit, pdu) = Framing::Rtu.open(&bytes[..count]).unwrap();
            if !asked.contains(&unit) {
                continue;
            }
            let wait = if pdu == [0x11] { 700 } else { 0 };
            let answer = framed(None, unit, &[pdu[0] | 0x80, 1]);
            let mut line = master.try_clone().unwrap();
            thread::spawn(move || {
                thread::sleep(Duration::from_millis(wait));
                let _ = line.write_all(&answer);
            });
        }
    });
    assert_eq!(found(&At::tcp(bus), "scan --units 1-12"), addresses);
}

#[test]
fn a_scan_that_finds_nothing_names_the_response_delay_and_the_radio() {
    let (bus, _) = bus(BTreeSet::new(), Duration::ZERO);
    let text = At::tcp(bus).run("scan --units 1-2").failed(3);
    has(&text, &["RESPONSE_DELAY", "over the air", "--timeout"]);
}

#[test]
fn a_scan_with_silent_addresses_names_the_response_delay_and_the_radio() {
    let (bus, _) = bus(BTreeSet::from([2]), Duration::ZERO);
    let at = At::tcp(bus);
    let ran = at.run("scan --units 1-4");
    assert_eq!(ran.status, 0, "{ran:?}");
    has(
        &ran.err,
        &[
            "silent addresses: 3",
            "RESPONSE_DELAY",
            "over the air",
            "--timeout",
        ],
    );
    assert_eq!(at.run("scan --units 2").err, "");
}

#[test]
fn a_scan_whose_line_is_lost_prints_what_it_found_and_what_it_did_not_do() {
    for fails_at in [5, 2] {
        let mut server = Server::new(None, Device::new(4, 4));
        let mut asked = BTreeSet::new();
        let line = serve_requests(move |unit, pdu| {
            // The first unit is lost in the first pass, the second one in the second pass.
            let again = !asked.insert(unit);
            if unit == fails_at && (unit == 5 || again) {
                return None;
            }
            let frame = server.response(unit, pdu);
            Some(if unit == 1 { frame } else { Vec::new() })
        });
        let ran = At::tcp(line).run("scan --units 1-9");
        assert_eq!(ran.status, 5, "{ran:?}");
        assert!(ran.out.starts_with("1  "), "{ran:?}");
        let not_done = match fails_at {
            5 => "-9 were not asked",
            _ => "-9 were not asked a second time",
        };
        has(&ran.err, &["is lost", not_done]);
        assert_eq!(ran.err.lines().count(), 1, "{ran:?}");
    }
}
