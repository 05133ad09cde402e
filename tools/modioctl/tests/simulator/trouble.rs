//! Tests with bit errors on the line, and with units that lose their power.

use std::process::Stdio;
use std::thread;
use std::time::Duration;

use crate::bus;
use crate::program::At;
use crate::unit::Unit;

#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn a_thousand_polls_over_a_line_with_bit_errors_show_no_wrong_value() {
    let unit = Unit::with(1, &["--module", "4do"]);
    let direct = At::tcp(unit.tcp);
    direct.run("config set BAUD=115200").fine();
    direct.run("config save").fine();
    direct.run("reboot").fine();
    direct.run("write p5.1=on p5.3=on").fine();
    let at = At::tcp(bus::of(&[unit.tcp], 10_000));
    let words = "--baud 115200 --timeout 100ms --retries 4 watch p5.1 p5.2 p5.3 p5.4 BAUD p5.1.safe product_code --every 1ms --count 1000 --csv";
    let text = at.run(words).fine();
    let mut lines = text.lines();
    assert_eq!(
        lines.next(),
        Some("time,p5.1,p5.2,p5.3,p5.4,BAUD,p5.1.safe,product code")
    );
    let lines: Vec<_> = lines.collect();
    assert_eq!(lines.len(), 1000);
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
fn a_unit_that_stops_during_a_command_gives_one_line_and_status_3() {
    let unit = Unit::with(1, &["--module", "4di"]);
    let at = At::tcp(unit.tcp);
    let dying = at
        .command("--timeout 200ms --retries 1 config reset --restart")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    thread::sleep(Duration::from_millis(60));
    unit.post("/api/power", r#"{"on":false}"#);
    let output = dying.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(3), "{output:?}");
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(
        text.lines().count() == 1 && text.contains("does not answer"),
        "{text}"
    );
}

#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn a_lost_connection_is_status_5_immediately() {
    let unit = Unit::with(1, &["--module", "4di"]);
    let at = At::tcp(unit.tcp);
    let cut = at
        .command("--timeout 30s --unit 99 info")
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    thread::sleep(Duration::from_millis(300));
    drop(unit);
    let output = cut.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(5), "{output:?}");
}

#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn ctrl_c_ends_a_command_that_waits_and_the_line_stays_usable() {
    let unit = Unit::with(1, &["--module", "4di"]);
    let at = At::port(unit.pty.display());
    let mut waiting = at
        .command("--timeout 1h --unit 99 info")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    thread::sleep(Duration::from_millis(300));
    let id = waiting.id().to_string();
    std::process::Command::new("kill")
        .args(["-INT", &id])
        .status()
        .unwrap();
    assert_eq!(waiting.wait().unwrap().code(), Some(130));
    at.run("info").fine();
}
