//! Tests of `modioctl watch` with a unit that this test serves, and that is switched off for a time.

use std::net::SocketAddr;

use crate::program::At;
use crate::served::{Answers, other, serve_requests};

/// Serves a unit that is no modio. Register 7 is the number of its reads. The reads with the numbers 2 and 3 have no
/// answer; with `hangs_up` the connection is closed instead.
fn unit(hangs_up: bool) -> SocketAddr {
    let mut server = other();
    serve_requests(move |unit, pdu| {
        if pdu[0] != 3 || pdu[1..3] != [0, 7] {
            return Some(server.response(unit, pdu));
        }
        server.device.words[7] += 1;
        match server.device.words[7] {
            2 | 3 if hangs_up => None,
            2 | 3 => Some(Vec::new()),
            _ => Some(server.response(unit, pdu)),
        }
    })
}

/// Runs a command, and returns its lines without the header.
fn lines(unit: SocketAddr, words: &str) -> Vec<String> {
    let words = format!("--timeout 50ms --retries 0 watch 7 8 --every 100ms --count 2 {words}");
    let text = At::tcp(unit).run(&words).fine();
    text.lines().map(str::to_owned).collect()
}

#[test]
fn row_of_a_unit_that_is_switched_off_has_no_value() {
    for hangs_up in [false, true] {
        let rows = lines(unit(hangs_up), "--csv");
        let values = rows.iter().map(|row| row.split_once(',').unwrap().1);
        let values: Vec<_> = values.collect();
        assert_eq!(values, ["0x0007,0x0008", "1,0", ",", ",", "4,0"]);
        let lines = lines(unit(hangs_up), "--json-lines");
        let value = |line: &String| serde_json::from_str::<serde_json::Value>(line).unwrap();
        let values: Vec<_> = lines
            .iter()
            .map(|line| value(line)["0x0007"].to_string())
            .collect();
        assert_eq!(values, ["1", "null", "null", "4"]);
    }
}

#[test]
fn line_for_people_is_not_printed_while_the_unit_is_switched_off() {
    let lines = lines(unit(false), "");
    let values: Vec<_> = lines.iter().map(|line| &line[14..]).collect();
    assert_eq!(values, ["0x0007 1   0x0008 0", "0x0007 4   0x0008 0"]);
}
