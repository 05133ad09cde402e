//! Tests of every command, except `monitor` and `sniff`, which have their own files. Reads, writes and scans run on each
//! kind of line, the other commands on one of them.

use crate::bus;
use crate::gateway::Gateway;
use crate::program::{At, has, modioctl};
use crate::unit::Unit;

fn lines(unit: &Unit) -> [At; 3] {
    [
        At::port(unit.pty.display()),
        At::tcp(unit.tcp),
        At::modbus_tcp(Gateway::default().before(unit.tcp)),
    ]
}

#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn a_slot_is_commissioned_with_one_command_and_its_points_are_read() {
    let unit = Unit::with(1, &["--module", "4ai", "--no-preset"]);
    let [at, ..] = lines(&unit);
    let text = at.run("module set p5 4ai").fine();
    assert_eq!(text, "port 5: 4ai, saved and in force; state: good\n");
    at.run("write p5.1.range=0 p5.1.scale=1").fine();
    at.run("config save").fine();
    unit.post("/api/channels/1", r#"{"millivolts":1650}"#);
    unit.wait(500);
    let text = at.run("read p5.1").fine();
    assert!(
        text.starts_with("p5.1  5") && text.ends_with(" mV\n") || text.starts_with("p5.1  49"),
        "{text}"
    );
    let text = at.run("reboot").fine();
    assert!(text.starts_with("restarted"), "{text}");
    let text = at.run("read p5.1.scale p5.2.scale").fine();
    has(&text, &["engineering units", "raw 12-bit"]);
}

#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn outputs_are_written_and_read_back_on_every_line() {
    let unit = Unit::with(1, &["--module", "4do"]);
    for at in lines(&unit) {
        at.run("write p5.1=on p5.2=off").fine();
        let text = at.run("--json read p5.1 p5.2").fine();
        let values: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(
            (&values[0]["value"], &values[1]["value"]),
            (&true.into(), &false.into())
        );
        at.run("write p5.1=0 0x0011=1").fine();
        let text = at.run("read p5.1 p5.2").fine();
        assert_eq!(text, "p5.1  off\np5.2  on\n");
    }
}

#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn info_and_describe_show_identity_and_registers() {
    let unit = Unit::with(7, &["--module", "2relay"]);
    let [_, at, _] = lines(&unit);
    let text = at.run("--unit 7 info").fine();
    has(
        &text,
        &[
            "LLD-ModbusIO-02",
            "modio-02",
            "2relay",
            "reset cause",
            "bus messages",
        ],
    );
    let info: serde_json::Value =
        serde_json::from_str(&at.run("--unit 7 --json info").fine()).unwrap();
    assert_eq!(info["unit address"], 7);
    let text = at.run("--unit 7 describe").fine();
    has(
        &text,
        &["p5.3 ", "digital output", "BAUD", "COMM_TIMEOUT", "0x0010"],
    );
    // The description read from the unit is the same, except for the source.
    let read = at.run("--unit 7 describe --refresh").fine();
    assert!(
        read.lines().next().unwrap().ends_with("from the unit"),
        "{read}"
    );
    assert!(
        read.lines().skip(1).eq(text.lines().skip(1)),
        "{read}\n{text}"
    );
}

#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn settings_are_exported_and_imported_and_a_wrong_file_changes_nothing() {
    let unit = Unit::with(1, &["--module", "2ai2ao"]);
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("unit.toml");
    let path = file.display();
    let [.., at] = lines(&unit);
    at.run("config reset --restart").fine();
    at.run("module set 5 2ai2ao").fine();
    let wrote = at.run(&format!("config export {path} --force"));
    assert_eq!(wrote.err, format!("modioctl: wrote {path}\n"));
    assert_eq!(wrote.fine(), "");
    let same = at.run(&format!("config diff {path}")).fine();
    assert_eq!(same, "no difference\n");

    let exported = std::fs::read_to_string(&file).unwrap();
    let changed = exported
        .replace("COMM_TIMEOUT = 0.0", "COMM_TIMEOUT = 2.5")
        .replace("p5.3.safe = 0 ", "p5.3.safe = 1000 ");
    std::fs::write(&file, changed.replace("p5.1.beta = 3950", "p5.1.beta = 10")).unwrap();
    let wrong = at.run(&format!("config import {path}")).failed(2);
    has(&wrong, &["p5.1.beta", "2000 to 5000 K"]);
    assert_eq!(at.run("read COMM_TIMEOUT").fine(), "COMM_TIMEOUT  0.0 s\n");

    std::fs::write(&file, changed).unwrap();
    let differs = at.run(&format!("config diff {path}")).fine();
    has(&differs, &["COMM_TIMEOUT", "p5.3.safe"]);
    let text = at.run(&format!("config import {path} --restart")).fine();
    let rows = [
        "COMM_TIMEOUT  0.0 s     2.5 s\n",
        "p5.3.safe     0         1000\n",
    ];
    assert!(rows.iter().all(|row| text.contains(row)), "{text}");
    assert!(text.ends_with("\n2 settings written\nsaved\n"), "{text}");
    assert_eq!(
        at.run("config get COMM_TIMEOUT").fine(),
        "COMM_TIMEOUT  2.5 s\n"
    );
}

#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn an_import_with_another_rate_follows_the_unit() {
    let unit = Unit::with(1, &["--module", "4di"]);
    let at = At::port(unit.pty.display());
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("unit.toml");
    std::fs::write(&file, "BAUD = 19200\nFORMAT = \"7E1\"\nMODE = \"ascii\"\n").unwrap();
    let text = at
        .run(&format!("config import {} --restart", file.display()))
        .fine();
    assert!(
        text.ends_with("restarted: all settings are in force\n"),
        "{text}"
    );
    let text = at
        .run("--baud 19200 --format 7E1 --mode ascii read MODE")
        .fine();
    assert_eq!(text, "MODE  ASCII\n");
}

#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn a_raw_pdu_is_sent_and_both_frames_are_shown() {
    let unit = Unit::with(1, &["--module", "4di"]);
    let [pty, tcp, modbus_tcp] = lines(&unit);
    for at in [pty, tcp] {
        let text = at.run("raw 08 0000 1234").fine();
        assert_eq!(
            text,
            "-> 01 08 00 00 12 34 ED 7C  diagnostics 00: 12 34\n<- 01 08 00 00 12 34 ED 7C  diagnostics 00: 12 34\n"
        );
    }
    let text = modbus_tcp.run("raw 02 0010 0004").fine();
    has(&text, &["read discrete inputs 0x0010 = 0000"]);
}

#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn a_unit_is_found_on_every_line_and_blinks() {
    let unit = Unit::with(2, &["--module", "2relay"]);
    for at in lines(&unit) {
        let found = at.run("--timeout 600ms --json scan --units 1-3").fine();
        let found: serde_json::Value = serde_json::from_str(&found).unwrap();
        let units = found["units"].as_array().unwrap();
        assert_eq!(units.len(), 1, "{found}");
        assert_eq!(units[0]["unit"], 2, "{found}");
    }
    let [at, ..] = lines(&unit);
    at.run("--unit 2 identify").fine();
}

#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn each_of_three_boards_on_a_line_answers_for_itself() {
    let units = [
        Unit::with(1, &["--module", "4do"]),
        Unit::with(2, &["--module", "4di"]),
        Unit::with(30, &["--module", "4ao"]),
    ];
    let at = At::tcp(bus::of(&units.each_ref().map(|unit| unit.tcp), |_| {}));
    let text = at.run("--timeout 600ms scan --units 1-3,29,30").fine();
    let lines: Vec<_> = text
        .lines()
        .map(str::split_whitespace)
        .map(|words| words.collect::<Vec<_>>().join(" "))
        .collect();
    let version = env!("CARGO_PKG_VERSION");
    let expected = [(1, "4do"), (2, "4di"), (30, "4ao")]
        .map(|(unit, module)| format!("{unit} modio modio-02 {version} p5 {module}"));
    assert_eq!(lines, expected);
    at.run("--unit 1 write p5.4=on").fine();
    assert_eq!(at.run("--unit 2 read p5.4").fine(), "p5.4  off\n");
    assert_eq!(at.run("--unit 1 read p5.4").fine(), "p5.4  on\n");
}

#[test]
fn commands_without_a_unit_need_no_endpoint() {
    let run = |words: &[&str]| String::from_utf8(modioctl(words).output().unwrap().stdout).unwrap();
    assert!(run(&["completions", "bash"]).contains("_modioctl"));
    assert!(run(&["man"]).contains(".TH modioctl"));
    assert!(modioctl(&["ports"]).output().unwrap().status.success());
}
