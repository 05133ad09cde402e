//! Tests of `modioctl watch` with units that this test serves.

use std::net::SocketAddr;

use register_map::Module;

use crate::program::{At, has};
use crate::served::{Answers, Modio, other, serve_requests, serve_unit};

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
    let ran = At::tcp(unit).run(&words);
    has(&ran.err, &["; waiting for it\n", "the unit is back\n"]);
    ran.fine().lines().map(str::to_owned).collect()
}

#[test]
fn values_have_their_names_and_without_names_they_are_those_of_all_points() {
    let at = At::tcp(serve_unit(Modio::modio_02(Module::Di4)));
    let text = at.run("watch --count 3 --every 50ms").fine();
    assert_eq!(text.matches("p5.4 off").count(), 3, "{text}");
    let text = at
        .run("watch p5.1 status --count 2 --every 50ms --csv")
        .fine();
    assert_eq!(text.lines().next(), Some("time,p5.1,status"));
    assert_eq!(text.matches(",off,-").count(), 2, "{text}");
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
