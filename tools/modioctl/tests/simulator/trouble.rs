//! Tests with bit errors on the line, and with units that lose their power.

use crate::bus;
use crate::program::At;
use crate::unit::Unit;

/// `--trace` prints this with a request.
const REQUEST: &str = " -> ";

#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn four_hundred_polls_over_a_line_with_bit_errors_show_no_wrong_value() {
    let unit = Unit::with(1, &["--module", "4do"]);
    let direct = At::tcp(unit.tcp);
    direct.run("config set BAUD=115200").fine();
    direct.run("config save").fine();
    direct.run("reboot").fine();
    direct.run("write p5.1=on p5.3=on").fine();
    let at = At::tcp(bus::of(&[unit.tcp], bus::noise(10_000)));
    let words = "--baud 115200 --timeout 150ms --retries 9 watch p5.1 p5.2 p5.3 p5.4 BAUD p5.1.safe product_code --every 1ms --count 400 --csv";
    let text = at.run(words).fine();
    let mut lines = text.lines();
    assert_eq!(
        lines.next(),
        Some("time,p5.1,p5.2,p5.3,p5.4,BAUD,p5.1.safe,product code")
    );
    let lines: Vec<_> = lines.collect();
    assert_eq!(lines.len(), 400);
    for line in lines {
        let (_, values) = line.split_once(',').unwrap();
        assert_eq!(values, "on,off,on,off,115200,0,23835860");
    }
    // The line did have bit errors.
    let info = At::tcp(unit.tcp)
        .run("read bus_communication_errors")
        .fine();
    assert!(!info.ends_with(" 0\n"), "{info}");
}

#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn a_lost_connection_is_status_5_immediately() {
    let unit = Unit::with(1, &["--module", "4di"]);
    let mut cut = At::tcp(unit.tcp).start("--timeout 1h --trace --unit 99 info");
    cut.err.wait_for(REQUEST);
    drop(unit);
    let ran = cut.end();
    assert_eq!(ran.status, 5, "{ran:?}");
}

#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn ctrl_c_ends_a_command_that_waits_and_the_line_stays_usable() {
    let unit = Unit::with(1, &["--module", "4di"]);
    let at = At::port(unit.pty.display());
    let mut waiting = at.start("--timeout 1h --trace --unit 99 info");
    waiting.err.wait_for(REQUEST);
    waiting.interrupt();
    let ran = waiting.end();
    assert_eq!(ran.status, 130, "{ran:?}");
    at.run("info").fine();
}
