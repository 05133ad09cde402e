//! Tests of the commands that use Fast Modbus: `scan --fast`, `events` and `address`.

use std::io::{Read, Write};
use std::net::SocketAddr;

use modbus_line::adu::Framing;
use modbus_line::fast::ADDRESS;

use crate::program::{At, has};
use crate::served::serve;
use crate::unit::Unit;

/// Serves a unit of another maker, through an adapter that returns what it sends. It has registers 200 to 219 only. Its
/// first reply to the start of a scan is damaged. With `ends` the line is lost when the unit is asked for its name.
fn other_maker(ends: bool) -> SocketAddr {
    const SERIAL: [u8; 4] = [0, 1, 0xEB, 0x37];
    serve(move |mut line| {
        let mut bytes = [0; 64];
        let mut is_found = false;
        let mut starts = 0;
        while let Ok(count @ 1..) = line.read(&mut bytes) {
            let Some((ADDRESS, pdu)) = Framing::Rtu.open(&bytes[..count]) else {
                continue;
            };
            let found = [&[0x46, 3][..], &SERIAL, &[0x0C]].concat();
            let mut letters = [0_u8; 40];
            for (register, letter) in letters.chunks_mut(2).zip(b"WBMSW4") {
                register[1] = *letter;
            }
            let head = [&[0x46, 9][..], &SERIAL].concat();
            let reply = match pdu[..] {
                [0x46, 1] => {
                    starts += 1;
                    found
                }
                [0x46, 2] if !is_found => found,
                [0x46, 2] => vec![0x46, 4],
                [0x46, 8, ..] if ends => return,
                [0x46, 8, _, _, _, _, 3, 0, 200, 0, 20] => [&head[..], &[3, 40], &letters].concat(),
                [0x46, 8, ..] => [&head[..], &[pdu[6] | 0x80, 2]].concat(),
                _ => continue,
            };
            is_found = pdu[1] <= 2;
            let mut frame = Framing::Rtu.frame(0, ADDRESS, &reply);
            if starts == 1 && pdu == [0x46, 1] {
                frame[6] ^= 1;
            }
            let arbitration = [0xFF; 9];
            let all = [&bytes[..count], &arbitration, &frame].concat();
            let _ = line.write_all(&all);
        }
    })
}

#[test]
fn a_unit_of_another_maker_is_found_after_a_damaged_reply_with_its_name() {
    let text = At::tcp(other_maker(false)).run("scan --fast").fine();
    has(&text, &["12", "0001EB37", "WBMSW4", "damaged replies"]);
}

#[test]
fn a_fast_scan_whose_line_is_lost_prints_what_it_found() {
    let ran = At::tcp(other_maker(true)).run("scan --fast");
    assert_eq!(ran.status, 5, "{ran:?}");
    has(&ran.out, &["12", "0001EB37"]);
    has(&ran.err, &["is lost", "the scan is not complete"]);
}

#[test]
fn a_line_without_fast_modbus_is_reported() {
    let silent = serve(|mut line| while let Ok(1..) = line.read(&mut [0; 64]) {});
    let at = At::tcp(silent);
    let text = at.run("--timeout 10ms scan --fast").failed(3);
    has(&text, &["function 70", "`modioctl scan` without --fast"]);
    let text = at.run("--timeout 10ms events").failed(3);
    has(&text, &["function 70", "no unit"]);
    let at = At::modbus_tcp(silent);
    for words in ["scan --fast", "events", "address 0D001234 5"] {
        has(&at.run(words).failed(2), &["only for RTU"]);
    }
}

#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn units_with_one_address_are_found_and_refuse_another_address_and_events() {
    // The modio-02 does not have function 70.
    let line = Unit::bus(
        r#"
        board = [
            { board = "modio-08", dip = 17 },
            { board = "modio-02", dip = 5 },
            { board = "modio-08", dip = 3 },
            { board = "modio-08", dip = 17 },
        ]"#,
    );
    for at in [At::port(line.pty.display()), At::tcp(line.tcp)] {
        let text = at.run("--json --timeout 1s scan --fast").fine();
        let found: serde_json::Value = serde_json::from_str(&text).unwrap();
        let units = found["units"].as_array().unwrap();
        let of = |unit: &serde_json::Value| {
            let identity = unit["identity"].as_str().unwrap();
            assert!(identity.starts_with("modio modio-08 "), "{found}");
            (unit["unit"].as_u64(), unit["note"] != "")
        };
        let units: Vec<_> = units.iter().map(of).collect();
        let once = (Some(3), false);
        assert_eq!(units, [once, (Some(17), true), (Some(17), true)], "{found}");
    }
    let at = At::tcp(line.tcp);
    has(
        &at.run("events").failed(4),
        &["several units have address 17"],
    );
    has(&at.run("events --units 5").failed(1), &["function 70"]);
    let text = at.run("scan --fast").fine();
    let serial = text.lines().next().unwrap().split_whitespace().nth(1);
    let text = at.run(&format!("address {} 18", serial.unwrap())).failed(1);
    has(&text, &["positions 2, 5 of SW01"]);
}

#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn events_of_two_units_are_printed_also_after_a_restart() {
    let line = Unit::bus(
        r#"
        board = [
            { board = "modio-08", dip = 3, slots = { 1 = "4di", 2 = "4do" } },
            { board = "modio-08", dip = 200, slots = { 1 = "4di", 4 = "2ai2ao" } },
        ]"#,
    );
    let at = At::port(line.pty.display());
    let mut events = at.start("--timeout 1s events");
    // The state of all points is printed first, by points in ascending order.
    events.out.wait_for("unit 3  p2.4 off");
    events.out.wait_for("unit 200  p4.4 0");
    for (energised, text) in [(true, "unit 3  p1.1 on"), (false, "unit 3  p1.1 off")] {
        let body = format!("{{\"energised\": {energised}}}");
        line.post("/api/boards/unit-3/slots/1/channels/1", &body);
        events.out.wait_for(text);
    }
    line.post(
        "/api/boards/unit-200/slots/4/channels/1",
        r#"{"millivolts": 1650}"#,
    );
    events.out.wait_for("unit 200  p4.1 2");
    line.post("/api/boards/unit-200/power", r#"{"cycle": true}"#);
    events.out.wait_for("unit 200  started");
    events.out.wait_for("unit 200  p4.4 0");
    events.interrupt();
    let ran = events.end();
    assert_eq!(ran.status, 0, "{ran:?}");

    let text = at.run("--json events --units 3 --count 1").fine();
    let event: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(event["unit_address"], 3, "{event}");
    assert_eq!(event["name"], "p1.1", "{event}");
    assert_eq!(event["value"], false, "{event}");
}
